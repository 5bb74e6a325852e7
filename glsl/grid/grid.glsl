// A regular grid as techniques see it: rays in index space, the scalar at a position, empty space.
//
// Depth z is measured along the view from the plane through the domain's centre, and positions from that
// centre in units of the grid's indices, so that a far eye costs no precision; depth is in units of the
// smallest voxel spacing, so that the world's scale costs none either. The ray of a pixel is
// p(z) = q + z d with
//   q = q0 + kq (x px + y py),  d = d0 + kd (x px + y py),
// x and y in pixels from the image's centre, y down. Perspective: kq = depth of the centre plane from
// the eye, kd = 1. Orthographic: kq = 1, kd = 0.

#ifndef BASE_PLANE
layout(push_constant, std430) uniform GridPush {
    vec4 q0_kq;       // w: kq
    vec4 px_kd;       // w: kd
    vec4 py_z0;       // w: where slab 0 begins, in the technique's own measure
    vec4 d0_h;        // w: thickness of a slab, in the same measure
    vec4 half_scale;  // half the domain, indices; w: side of a pixel at unit depth, world
    vec2 half_extent; // half the image, pixels
    float near;       // smallest depth to draw: that of the eye for perspective
    float value_scale; // scalar = value_scale * texel + value_offset
    float value_offset;
    uint knots;       // number of knots
    uint first;       // first slab of this draw or dispatch
    uint count;       // number of slabs of this draw or dispatch
    uint order;       // raster: how instances map to slabs, 2 (first slab) + (back to front); compute: the
                      // grid's axis that index space calls z, the others following it cyclically, and 4 when
                      // another dispatch resumes
    float unit;       // world length of one unit of depth: the smallest voxel spacing
    float opaque;     // transmittance at which a pixel is done
    uint seed;        // of dithering
} push;
#endif

struct Ray {
    vec3 q;
    vec3 d;
    vec3 inverse;           // 1 / d, finite
    float length_per_depth; // world length of one unit of depth
};

#ifdef BASE_PLANE
#include "shear-warp/base-plane.glsl"
#define NEAR push.slope_u.w
#else
#define NEAR push.near
// The ray through a point of the image, in pixels.
Ray ray_of(vec2 pixel) {
    vec2 xy = pixel - push.half_extent;
    vec3 lateral = fma(vec3(xy.x), push.px_kd.xyz, xy.y * push.py_z0.xyz);
    vec2 slope = xy * (push.half_scale.w * push.px_kd.w);
    vec3 q = fma(vec3(push.q0_kq.w), lateral, push.q0_kq.xyz);
    vec3 d = fma(vec3(push.px_kd.w), lateral, push.d0_h.xyz);
    // A zero component would give 0 * inf = NaN on a face itself.
    vec3 safe = mix(d, vec3(1e-30), lessThan(abs(d), vec3(1e-30)));
    return Ray(q, d, 1.0 / safe, push.unit * sqrt(1.0 + dot(slope, slope)));
}
#endif

// Depths at which the ray enters and leaves what of the domain lies in front of the eye; enters > leaves
// when it misses.
vec2 domain_of(Ray ray) {
    vec3 half_size = push.half_scale.xyz;
    vec3 a = (-half_size - ray.q) * ray.inverse;
    vec3 b = (half_size - ray.q) * ray.inverse;
    vec3 near = min(a, b), far = max(a, b);
    // Parallel to a pair of faces a ray lies between them all along, the faces included, or not at all.
    vec3 between = mix(vec3(1e30), vec3(-1e30), lessThanEqual(abs(ray.q), half_size));
    near = mix(near, between, lessThan(abs(ray.d), vec3(1e-30)));
    far = mix(far, -between, lessThan(abs(ray.d), vec3(1e-30)));
    return vec2(max(max(max(near.x, near.y), near.z), NEAR), min(min(far.x, far.y), far.z));
}

#if !defined(BASE_PLANE) && !defined(VERTEX)
#include "frame/bounded.glsl"

// The same, cut to the bounds of the pixel's line.
vec2 interval_of(Ray ray, vec2 pixel) {
    vec2 interval = domain_of(ray), bounds = bounds_of(uvec2(pixel), uint(2.0 * push.half_extent.x + 0.5));
    return BOUNDED ? vec2(max(interval.x, bounds.x), min(interval.y, bounds.y)) : interval;
}
#endif

// ------------------------------------------------------------------------------- reconstruction

layout(constant_id = SPEC_FILTER_EXACT) const bool FILTER_EXACT = false;
layout(constant_id = SPEC_HAS_NAN) const bool HAS_NAN = false;
layout(constant_id = SPEC_PREFILTER) const bool PREFILTER = false;

// What reconstruction needs of the push constants, read once before loops: drivers do not take these loads
// out of them.
struct Lattice {
    vec3 half_size;
    float value_scale;
    float value_offset;
    float kq;
    float kd;
    float lod;  // mip level of a voxel per pixel at unit distance
};

Lattice load_lattice() {
#ifdef BASE_PLANE
    return Lattice(push.half_scale.xyz, push.value_scale, push.value_offset, 0.0, 0.0, 0.0);
#else
    vec3 px = push.px_kd.xyz, py = push.py_z0.xyz;
#ifdef STACK
    px.z = py.z = 0.0; // a stack is minified along its slices only
#endif
    float footprint = max(dot(px, px), dot(py, py));
    return Lattice(push.half_scale.xyz, push.value_scale, push.value_offset, push.q0_kq.w, push.px_kd.w,
                   PREFILTER ? 0.5 * log2(footprint) : 0.0);
#endif
}

// Mip level at which a voxel is as large as a pixel, seen at depth z.
float level_at(float z, Lattice lattice) {
    return max(lattice.lod + log2(max(fma(lattice.kd, z, lattice.kq), 1e-30)), 0.0);
}

// By its bits: float tests may be optimised away.
bool is_nan(float value) {
    return (floatBitsToUint(value) & 0x7fffffffu) > 0x7f800000u;
}

// The scalar of a stored number. Two roundings, not one: the first gives back an integer's code exactly, so
// that integer data falls on the right side of a jump.
float scalar_of(float texel, Lattice lattice) {
    precise float stored = lattice.value_scale * texel;
    precise float scalar = stored + lattice.value_offset;
    // Beyond, products with it could overflow. So are the knots.
    return clamp(scalar, -1e37, 1e37);
}

#ifndef STACK
layout(set = 0, binding = BINDING_VOLUME) uniform sampler3D volume;

// Eight fetches at one level, around an index of level 0.
float fetched(vec3 index, int level) {
    vec3 size = vec3(textureSize(volume, level));
    if (PREFILTER) index = (index + 0.5) * (size / vec3(textureSize(volume, 0))) - 0.5;
    index = clamp(index, vec3(0.0), size - 1.0);
    vec3 base = min(floor(index), max(size - 2.0, 0.0));
    vec3 w = index - base;
    ivec3 i = ivec3(base), j = min(i + 1, ivec3(size) - 1);
    float v000 = texelFetch(volume, i, level).r;
    float v100 = texelFetch(volume, ivec3(j.x, i.y, i.z), level).r;
    float v010 = texelFetch(volume, ivec3(i.x, j.y, i.z), level).r;
    float v110 = texelFetch(volume, ivec3(j.x, j.y, i.z), level).r;
    float v001 = texelFetch(volume, ivec3(i.x, i.y, j.z), level).r;
    float v101 = texelFetch(volume, ivec3(j.x, i.y, j.z), level).r;
    float v011 = texelFetch(volume, ivec3(i.x, j.y, j.z), level).r;
    float v111 = texelFetch(volume, j, level).r;
    float low = mix(mix(v000, v100, w.x), mix(v010, v110, w.x), w.y);
    float high = mix(mix(v001, v101, w.x), mix(v011, v111, w.x), w.y);
    return mix(low, high, w.z);
}

// The stored number at depth z of the ray, trilinear; NaN in a cell that touches a NaN sample.
float stored_at(Ray ray, float z, Lattice lattice) {
    vec3 position = fma(vec3(z), ray.d, ray.q);
    float level = PREFILTER ? level_at(z, lattice) : 0.0;
    if (!FILTER_EXACT) return textureLod(volume, position / (2.0 * lattice.half_size + 1.0) + 0.5, level).r;
    vec3 index = position + lattice.half_size;
    if (!PREFILTER) return fetched(index, 0);
    level = min(level, float(textureQueryLevels(volume) - 1));
    int below = int(level);
    float fine = fetched(index, below);
    return level == float(below) ? fine : mix(fine, fetched(index, below + 1), level - float(below));
}
#endif

#if defined(VERTEX) && !defined(BASE_PLANE)
// Clip coordinates of a position at depth z. (px, py, d0) is a frame of index space: the lateral offset from the
// central ray has the pixel's x and y, times w, as its first two coordinates in it.
vec4 clip_of(vec3 position, float z) {
    vec3 px = push.px_kd.xyz, py = push.py_z0.xyz, d0 = push.d0_h.xyz;
    vec3 lateral = position - push.q0_kq.xyz - z * d0;
    vec2 xy = vec2(dot(cross(py, d0), lateral), dot(cross(d0, px), lateral)) / dot(cross(px, py), d0);
    return vec4(xy / push.half_extent, 0.0, push.q0_kq.w + push.px_kd.w * z);
}

// Whether the domain is so large in pixels, where rays are w apart, that float32 places its corners no better than to a 64th of
// one: then what covers the whole image takes the place of outlines.
bool magnified(float w) {
    const float MOST_PIXELS = 262144.0;
    vec3 px = push.px_kd.xyz, py = push.py_z0.xyz;
    return 2.0 * length(push.half_scale.xyz) > MOST_PIXELS * w * min(length(px), length(py));
}
#endif
