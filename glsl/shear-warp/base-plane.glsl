// Push constants of compositing on a base plane, and the rays of its texels in index space, whose axes are permuted so that the stack
// lies along z.
//
// Depth z runs along the stack from the plane through the domain's centre, in indices, and grows along the rays. The ray of texel t
// is p(z) = (q, 0) + z (d, sign) with q = q0 + step_q t and d = d0 + step_d t, t counted from the middle texel.
//
// The world length of a unit of depth is computed in an orthonormal basis whose third vector is normal to the slices: there the
// step along the ray is half_scale.w times (dot(slope_u, (dx, dy, 1)), dot(slope_v, (dy, 1)), 1).
#ifndef BASE_PLANE_GLSL
#define BASE_PLANE_GLSL

#include "interface.glsl"
#include "grid/ray.glsl"
#include "grid/lattice.glsl"

layout(push_constant, std430) uniform BasePlanePush {
    vec4 q0_step;     // xy: q0, zw: step_q
    vec4 d0_step;     // xy: d0, zw: step_d
    vec4 half_scale;  // half the domain, indices; w: world length of a step along z, across the slices
    vec4 slope_u;     // xyz: coefficients of dx, dy and 1 in the sideways offset per unit across; w: least depth to draw
    vec2 slope_v;     // coefficients of dy and 1 in the offset to the other side
    float z0;         // depth at which slab 0 begins
    float h;          // thickness of a slab
    float value_scale; // scalar = value_scale * texel + value_offset
    float value_offset;
    uint knots;       // number of knots
    uint first;       // first slab of this dispatch, counted from where each ray enters
    uint count;       // number of slabs of this dispatch
    uint order;       // MARCH_* with the axis of the stack, and PLANE_*
    float opaque;     // transmittance at which a ray ends
    uint offset;      // of texel 0 in the intermediate image; raster: of the first row
    uvec2 size;       // texels
    uvec2 atlas;      // raster: size of the image that all base planes share
} push;

// Returns the ray of a texel, or of a position between texels.
Ray ray_of(vec2 texel) {
    vec2 t = texel - vec2(push.size / 2u);
    vec3 q = vec3(fma(push.q0_step.zw, t, push.q0_step.xy), 0.0);
    vec3 d = vec3(fma(push.d0_step.zw, t, push.d0_step.xy), (push.order & PLANE_DOWN) != 0u ? -1.0 : 1.0);
    vec2 slope = vec2(dot(push.slope_u.xyz, vec3(d.xy, 1.0)), fma(push.slope_v.x, d.y, push.slope_v.y));
    return Ray(q, d, finite_inverse(d), push.half_scale.w * sqrt(1.0 + dot(slope, slope)));
}

// Returns the depths at which the ray enters and leaves the domain in front of the eye.
vec2 domain_of(Ray ray) {
    return domain_of(ray, push.half_scale.xyz, push.slope_u.w);
}

Lattice load_lattice() {
    vec3 half_size = push.half_scale.xyz;
    return Lattice(half_size, push.value_scale, push.value_offset, 0.0, 0.0, 0.0, push.order & MARCH_AXIS, ivec4(0), vec3(0.0));
}

#endif
