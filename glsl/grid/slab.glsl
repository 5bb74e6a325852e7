// Slabs of equal thickness between planes parallel to the image, on the rays of pixels. z0 and h of the push constants are depths.
#ifndef SLAB_GLSL
#define SLAB_GLSL

#include "grid/grid.glsl"

layout(constant_id = SPEC_CLIP_ENDS) const bool CLIP_ENDS = true;

// Returns the depth at which a slab begins.
float slab_begin(uint slab) {
    return fma(float(slab), push.d0_h.w, push.py_z0.w);
}

// Returns the part of the slab [begin, end] within `interval`, as depths; empty where x >= y. Without clipping: the whole slab where
// its middle lies within.
vec2 slab_piece(float begin, float end, vec2 interval) {
    if (CLIP_ENDS) return vec2(max(begin, interval.x), min(end, interval.y));
    float middle = 0.5 * (begin + end);
    return vec2(begin, middle >= interval.x && middle <= interval.y ? end : begin);
}

#ifdef COMPUTE
#include "grid/owned.glsl"

// Returns those of the slabs [x, y) on the ray of a pixel that belong to the part of space.
uvec2 owned_slabs(uvec2 slabs, vec2 interval, ivec2 pixel) {
    KEEP_OWNED(slabs, slab_piece(slab_begin(i), slab_begin(i + 1u), interval), pixel)
    return slabs;
}
#endif

// Returns the slabs of this dispatch that the ray meets, as [x, y), with one more at each end against rounding: it has no length on
// the ray.
uvec2 slabs_of(vec2 interval) {
    vec2 place = (interval - push.py_z0.w) / push.d0_h.w;
    float begin = max(floor(place.x) - 1.0, float(push.first));
    float end = min(ceil(place.y) + 1.0, float(push.first + push.count));
    return interval.x < interval.y && begin < end ? uvec2(begin, end) : uvec2(0u);
}

#endif
