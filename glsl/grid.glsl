// A regular grid as techniques see it: rays in index space, and the scalar at an index.
//
// Depth z is measured along the view from the plane through the domain's centre, and positions from that
// centre in units of the grid's indices, so that a far eye costs no precision; depth is in units of the
// smallest voxel spacing, so that the world's scale costs none either. The ray of a pixel is
// p(z) = q + z d with
//   q = q0 + kq (x px + y py),  d = d0 + kd (x px + y py),
// x and y in pixels from the image's centre, y down. Perspective: kq = depth of the centre plane from
// the eye, kd = 1. Orthographic: kq = 1, kd = 0.

struct Ray {
    vec3 q;
    vec3 d;
    float length_per_depth; // world length of one unit of depth
};

Ray pixel_ray(vec2 pixel, vec4 q0_kq, vec4 px_kd, vec4 py, vec4 d0, float scale, float unit,
              vec2 half_extent) {
    vec2 xy = pixel - half_extent;
    vec3 lateral = fma(vec3(xy.x), px_kd.xyz, xy.y * py.xyz);
    vec2 slope = xy * (scale * px_kd.w);
    return Ray(fma(vec3(q0_kq.w), lateral, q0_kq.xyz), fma(vec3(px_kd.w), lateral, d0.xyz), unit * sqrt(1.0 + dot(slope, slope)));
}

// Depths at which the ray enters and leaves the domain [-half_size, half_size]; entry > exit when it misses.
vec2 domain_interval(Ray ray, vec3 half_size) {
    // A zero component would give 0 * inf = NaN on the face itself.
    vec3 d = mix(ray.d, vec3(1e-30), lessThan(abs(ray.d), vec3(1e-30)));
    vec3 inverse = 1.0 / d;
    vec3 a = (-half_size - ray.q) * inverse;
    vec3 b = (half_size - ray.q) * inverse;
    vec3 near = min(a, b), far = max(a, b);
    return vec2(max(max(near.x, near.y), near.z), min(min(far.x, far.y), far.z));
}

layout(constant_id = SPEC_FILTER_EXACT) const bool FILTER_EXACT = false;
layout(constant_id = SPEC_HAS_NAN) const bool HAS_NAN = false;

layout(set = 0, binding = BINDING_VOLUME) uniform sampler3D volume;

// By its bits: float tests may be optimised away.
bool is_nan(float value) {
    return (floatBitsToUint(value) & 0x7fffffffu) > 0x7f800000u;
}

// The stored scalar at a position, trilinear; NaN in a cell that touches a NaN sample.
float grid_stored(vec3 position, vec3 half_size) {
    vec3 last = 2.0 * half_size; // index of the last sample along each axis
    if (!FILTER_EXACT) return textureLod(volume, position / (last + 1.0) + 0.5, 0.0).r;
    vec3 index = clamp(position + half_size, vec3(0.0), last);
    vec3 base = min(floor(index), last - 1.0);
    vec3 w = index - base;
    ivec3 i = ivec3(base);
    float v000 = texelFetch(volume, i, 0).r;
    float v100 = texelFetch(volume, i + ivec3(1, 0, 0), 0).r;
    float v010 = texelFetch(volume, i + ivec3(0, 1, 0), 0).r;
    float v110 = texelFetch(volume, i + ivec3(1, 1, 0), 0).r;
    float v001 = texelFetch(volume, i + ivec3(0, 0, 1), 0).r;
    float v101 = texelFetch(volume, i + ivec3(1, 0, 1), 0).r;
    float v011 = texelFetch(volume, i + ivec3(0, 1, 1), 0).r;
    float v111 = texelFetch(volume, i + ivec3(1, 1, 1), 0).r;
    float low = mix(mix(v000, v100, w.x), mix(v010, v110, w.x), w.y);
    float high = mix(mix(v001, v101, w.x), mix(v011, v111, w.x), w.y);
    return mix(low, high, w.z);
}
