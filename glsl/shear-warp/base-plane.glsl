// The rays of a base plane's texels, in index space turned so that the stack lies along z. For grid.glsl.
//
// Depth z runs along the stack from the plane through the domain's centre, in indices, and grows along the rays: that of
// texel t is p(z) = (q, 0) + z (d, sign) with q = q0 + step_q t and d = d0 + step_d t, t counted from the middle texel.
//
// An affine map that does not change lengths takes a step along z to `world`'s upper triangle, so that its true length is
// what the last row is times a root (`half_scale.w`).

layout(push_constant, std430) uniform BasePlanePush {
    vec4 q0_step;     // xy: q0, zw: step_q
    vec4 d0_step;     // xy: d0, zw: step_d
    vec4 half_scale;  // half the domain, indices; w: world length of a step along z, across the slices
    vec4 slope_u;     // x, y, z: of dx, dy and 1, the offset to one side for each unit across; w: near
    vec2 slope_v;     // the same of dy and 1, to the other side
    float z0;         // depth at which slab 0 begins
    float h;          // thickness of a slab
    float value_scale; // scalar = value_scale * texel + value_offset
    float value_offset;
    uint knots;       // number of knots
    uint first;       // first slab of this dispatch, from where each ray enters
    uint count;       // number of slabs of this dispatch
    uint order;       // axis of the stack, 4 when another dispatch resumes, 8 when rays go down the stack; 16 when
                      // raster begins at the back; 256 times the slices that one stands for
    float opaque;     // transmittance at which a texel is done
    uint offset;      // of texel 0 in the intermediate image; raster: of the first row
    uvec2 size;       // texels
    uvec2 atlas;      // raster: of the image that all base planes share
} push;

Ray ray_of(vec2 texel) {
    vec2 t = texel - vec2(push.size / 2u);
    vec3 q = vec3(fma(push.q0_step.zw, t, push.q0_step.xy), 0.0);
    vec3 d = vec3(fma(push.d0_step.zw, t, push.d0_step.xy), (push.order & 8u) != 0u ? -1.0 : 1.0);
    vec2 slope = vec2(dot(push.slope_u.xyz, vec3(d.xy, 1.0)), fma(push.slope_v.x, d.y, push.slope_v.y));
    // A zero component would give 0 * inf = NaN on a face itself.
    vec3 safe = mix(d, vec3(1e-30), lessThan(abs(d), vec3(1e-30)));
    return Ray(q, d, 1.0 / safe, push.half_scale.w * sqrt(1.0 + dot(slope, slope)));
}
