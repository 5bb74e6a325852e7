// Trilinear reconstruction from a 3D texture, with mip levels where voxels are smaller than pixels, or from a pool of pages.
#ifndef VOLUME_GLSL
#define VOLUME_GLSL

#include "shared/device.glsl"
#include "shared/integers.glsl"
#include "shared/interpolated.glsl"
#include "frame/counts.glsl"
#include "grid/grid.glsl"
#include "grid/pages.glsl"

layout(set = 0, binding = BINDING_VOLUME) uniform sampler3D volume;

Lattice load_lattice() {
    Lattice lattice = lattice_of_view(false);
    return with_pool(lattice, textureSize(volume, 0), 0u);
}

// Interpolates between the eight texels from i to j at one level.
float between_texels(ivec3 i, ivec3 j, vec3 w, int level) {
    taken_fetches += 8u;
    float v000 = texelFetch(volume, i, level).r;
    float v100 = texelFetch(volume, ivec3(j.x, i.y, i.z), level).r;
    float v010 = texelFetch(volume, ivec3(i.x, j.y, i.z), level).r;
    float v110 = texelFetch(volume, ivec3(j.x, j.y, i.z), level).r;
    float v001 = texelFetch(volume, ivec3(i.x, i.y, j.z), level).r;
    float v101 = texelFetch(volume, ivec3(j.x, i.y, j.z), level).r;
    float v011 = texelFetch(volume, ivec3(i.x, j.y, j.z), level).r;
    float v111 = texelFetch(volume, j, level).r;
    float low = interpolated(interpolated(v000, v100, w.x), interpolated(v010, v110, w.x), w.y);
    float high = interpolated(interpolated(v001, v101, w.x), interpolated(v011, v111, w.x), w.y);
    return interpolated(low, high, w.z);
}

// Interpolates at one level around an index of level 0.
float fetched(vec3 index, int level) {
    vec3 size = vec3(textureSize(volume, level));
    if (PREFILTER) index = (index + 0.5) * (size / vec3(textureSize(volume, 0))) - 0.5;
    index = clamp(index, vec3(0.0), size - 1.0);
    vec3 base = min(floor(index), max(size - 2.0, 0.0));
    ivec3 i = whole_of(base);
    return between_texels(i, min(i + 1, ivec3(size) - 1), index - base, level);
}

// Returns what the sampler interpolates at a coordinate of the texture, at a mip level.
float filtered(vec3 coordinate, float level) {
    ++taken_fetches;
    return textureLod(volume, sampled_at(coordinate, vec3(textureSize(volume, int(level)))), level).r;
}

// Returns the stored value at an index of the grid on a page that is held, of which texels of the pool are `first` beyond it.
float on_page(vec3 index, vec3 first, Lattice lattice) {
    if (!FILTER_EXACT) return filtered((index + first + 0.5) * lattice.texel, 0.0);
    vec3 base = min(floor(index), 2.0 * lattice.half_size - 1.0);
    ivec3 i = whole_of(base + first);
    return between_texels(i, i + 1, index - base, 0);
}

// Returns the stored value at an offset, of at most a cell along each axis, from a position, from the position's page; 0 where that is missed.
float in_pages(vec3 position, vec3 offset, Lattice lattice) {
    ++taken_samples;
    vec3 index = position + lattice.half_size;
    if (!find_page(index, offset != vec3(0.0), lattice)) return 0.0;
    return on_page(clamp(index + offset, vec3(0.0), 2.0 * lattice.half_size), pool_first, lattice);
}

// Returns the stored value at a position, at a mip level; NaN in a cell that touches a NaN sample.
float stored_in(vec3 position, float level, Lattice lattice) {
    if (PAGED) return in_pages(position, vec3(0.0), lattice);
    ++taken_samples;
    if (!FILTER_EXACT) return filtered(position / (2.0 * lattice.half_size + 1.0) + 0.5, level);
    vec3 index = position + lattice.half_size;
    if (!PREFILTER) return fetched(index, 0);
    level = min(level, float(textureQueryLevels(volume) - 1));
    int below = whole_of(level);
    float fine = fetched(index, below);
    return level == float(below) ? fine : interpolated(fine, fetched(index, below + 1), level - float(below));
}

// The same at an offset of at most a cell along each axis.
float stored_near(vec3 position, vec3 offset, float level, Lattice lattice) {
    return PAGED ? in_pages(position, offset, lattice) : stored_in(position + offset, level, lattice);
}

// Returns the stored value at depth z of the ray.
float stored_at(Ray ray, float z, Lattice lattice) {
    return stored_in(fma(vec3(z), ray.d, ray.q), PREFILTER ? level_at(z, lattice) : 0.0, lattice);
}

// The same in a run of samples (`enter_pages`).
float stored_in_run(Ray ray, float z, Lattice lattice) {
    if (!PAGED) return stored_at(ray, z, lattice);
    ++taken_samples;
    vec3 first = first_in_run(z);
    if (!FILTER_EXACT) {
        return filtered((fma(vec3(z), ray.d, ray.q) + (lattice.half_size + 0.5 + first)) * lattice.texel, 0.0);
    }
    vec3 index = clamp(fma(vec3(min(z, page_until)), ray.d, ray.q) + lattice.half_size, vec3(0.0), 2.0 * lattice.half_size);
    return on_page(index, first, lattice);
}

#endif
