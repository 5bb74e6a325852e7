// A stack of 2D slices: reconstruction on a slice and between two, and the emission of a slab that is represented by its slice.
#ifndef STACK_GLSL
#define STACK_GLSL

#include "interface.glsl"
#include "shared/device.glsl"
#include "shared/integers.glsl"
#include "shared/interpolated.glsl"
#include "shared/optics.glsl"
#include "frame/counts.glsl"
#include "grid/pages.glsl"
#include "grid/ray.glsl"
#include "grid/lattice.glsl"

layout(constant_id = SPEC_BETWEEN) const bool BETWEEN = false;

// Slices of the stack; of a grid in pages those of their pool.
layout(set = 0, binding = BINDING_VOLUME) uniform sampler2DArray stack;

// Returns parameters of reconstruction with those of a pool of pages.
Lattice of_stack(Lattice lattice) {
    return with_pool(lattice, textureSize(stack, 0), lattice.axis);
}

// A texel of the pool is so far beyond its index, on the page that samples are read from.
vec3 page_first;

// Finds the page of samples at an index; where slices beside it are read too (`around`), only its own page will do. Returns whether it is held;
// else it is missed.
bool has_page(vec3 index, bool around, Lattice lattice) {
    if (!PAGED) return true;
    bool held = find_page(index, around, lattice);
    page_first = pool_first;
    return held;
}

// The same for samples at depth z of the ray, which are taken in runs (`enter_pages`) or at will.
bool has_page_at(float z, bool in_run, vec3 index, Lattice lattice) {
    if (!PAGED || !in_run) return has_page(index, false, lattice);
    page_first = first_in_run(z);
    return true;
}

// Interpolates between the four texels from i to j on a slice at one level.
float between_texels(ivec2 i, ivec2 j, vec2 w, int slice, int level) {
    taken_fetches += 4u;
    float v00 = texelFetch(stack, ivec3(i, slice), level).r;
    float v10 = texelFetch(stack, ivec3(j.x, i.y, slice), level).r;
    float v01 = texelFetch(stack, ivec3(i.x, j.y, slice), level).r;
    float v11 = texelFetch(stack, ivec3(j, slice), level).r;
    return interpolated(interpolated(v00, v10, w.x), interpolated(v01, v11, w.x), w.y);
}

// Interpolates on a slice at one level around an index of level 0.
float fetched(vec2 index, int slice, int level) {
    vec2 size = vec2(textureSize(stack, level).xy);
    if (PREFILTER) index = (index + 0.5) * (size / vec2(textureSize(stack, 0).xy)) - 0.5;
    index = clamp(index, vec2(0.0), size - 1.0);
    vec2 base = min(floor(index), max(size - 2.0, 0.0));
    ivec2 i = whole_of(base);
    return between_texels(i, min(i + 1, ivec2(size) - 1), index - base, slice, level);
}

// Returns what the sampler interpolates on a slice at a coordinate of the texture, at a mip level.
float filtered(vec2 coordinate, float slice, float level) {
    ++taken_fetches;
    vec3 size = vec3(textureSize(stack, int(level)).xy, 1.0);
    return textureLod(stack, vec3(sampled_at(vec3(coordinate, 0.5), size).xy, slice), level).r;
}

// Returns the stored value on a slice, of the page that has been found.
float on_page(vec2 index, float slice, Lattice lattice) {
    slice += page_first.z;
    if (!FILTER_EXACT) return filtered((index + page_first.xy + 0.5) * lattice.texel.xy, slice, 0.0);
    vec2 last = 2.0 * lattice.half_size.xy;
    index = clamp(index, vec2(0.0), last);
    vec2 base = min(floor(index), last - 1.0);
    ivec2 i = whole_of(base + page_first.xy);
    return between_texels(i, i + 1, index - base, whole_of(slice), 0);
}

// Returns the stored value on a slice, bilinear; of a grid in pages its page has been found.
float on_slice(vec2 index, float slice, float level, Lattice lattice) {
    if (PAGED) return on_page(index, slice, lattice);
    if (!FILTER_EXACT) return filtered((index + 0.5) / (2.0 * lattice.half_size.xy + 1.0), slice, level);
    if (!PREFILTER) return fetched(index, whole_of(slice), 0);
    level = min(level, float(textureQueryLevels(stack) - 1));
    int below = whole_of(level);
    float fine = fetched(index, whole_of(slice), below);
    return level == float(below) ? fine : interpolated(fine, fetched(index, whole_of(slice), below + 1), level - float(below));
}

// Returns the stored value at an index, trilinear: it interpolates between two slices. Of a grid in pages its page has been found.
float between_slices(vec3 index, float level, Lattice lattice) {
    float last = 2.0 * lattice.half_size.z;
    float place = clamp(index.z, 0.0, last);
    float slice = max(min(floor(place), last - 1.0), 0.0);
    return interpolated(on_slice(index.xy, slice, level, lattice), on_slice(index.xy, min(slice + 1.0, last), level, lattice),
               place - slice);
}

// Returns the stored value at depth z of the ray, on a slice or (BETWEEN) between two; NaN in a cell that touches a NaN sample, 0 where its page
// is missed.
float stored_at(Ray ray, float z, float slice, bool in_run, Lattice lattice) {
    ++taken_samples;
    vec3 index = fma(vec3(z), ray.d, ray.q) + lattice.half_size;
    float level = PREFILTER ? level_at(z, lattice) : 0.0;
    if (!BETWEEN) index.z = slice;
    if (!has_page_at(z, in_run, index, lattice)) return 0.0;
    return BETWEEN ? between_slices(index, level, lattice) : on_slice(index.xy, slice, level, lattice);
}

// Returns the stored value on the slice `step` beyond a slice, or on that itself at the end of the stack.
float beside_slice(vec2 index, float slice, float step, Lattice lattice) {
    if (!has_page(vec3(index, slice), true, lattice)) return 0.0;
    return on_slice(index, clamp(slice + step, 0.0, 2.0 * lattice.half_size.z), 0.0, lattice);
}

// Returns premultiplied colour and opacity of a piece of the ray, classified on its slice at depth z.
vec4 slice_emission(Ray ray, vec2 piece, float z, float slice, bool in_run, Lattice lattice, uint knots) {
    float texel = stored_at(ray, z, slice, in_run, lattice);
    vec4 optics = classify(scalar_of(texel, lattice), knots);
    float tau = HAS_NAN && is_nan(texel) ? 0.0 : optics.a;
    float len = max(piece.y - piece.x, 0.0);
    if (HAS_NAN && !BETWEEN) {
        // The slice separates two cells; a cell is vacuum where the slice on its other side is NaN. Subtract its length.
        vec2 index = fma(vec2(z), ray.d.xy, ray.q.xy) + lattice.half_size.xy;
        float plane = clamp((slice - lattice.half_size.z - ray.q.z) * ray.inverse.z, piece.x, max(piece.x, piece.y));
        float ahead = plane - piece.x, after = len - ahead;
        bool down = ray.d.z < 0.0;
        float below = beside_slice(index, slice, -1.0, lattice);
        float above = beside_slice(index, slice, 1.0, lattice);
        if (is_nan(below)) len -= down ? after : ahead;
        if (is_nan(above)) len -= down ? ahead : after;
        len = max(len, 0.0);
    }
    // Multiply the lengths first, then the extinction: 0 * tau must stay 0.
    return emission_of(optics.rgb, tau * (len * ray.length_per_depth));
}

#endif
