// Trilinear reconstruction from a 3D texture, with mip levels where voxels are smaller than pixels.
#ifndef VOLUME_GLSL
#define VOLUME_GLSL

#include "shared/device.glsl"
#include "shared/integers.glsl"
#include "shared/interpolated.glsl"
#include "frame/counts.glsl"
#include "grid/grid.glsl"

layout(set = 0, binding = BINDING_VOLUME) uniform sampler3D volume;

Lattice load_lattice() {
    return lattice_of_view(false);
}

// Interpolates at one level, with eight fetches, around an index of level 0.
float fetched(vec3 index, int level) {
    taken_fetches += 8u;
    vec3 size = vec3(textureSize(volume, level));
    if (PREFILTER) index = (index + 0.5) * (size / vec3(textureSize(volume, 0))) - 0.5;
    index = clamp(index, vec3(0.0), size - 1.0);
    vec3 base = min(floor(index), max(size - 2.0, 0.0));
    vec3 w = index - base;
    ivec3 i = whole_of(base), j = min(i + 1, ivec3(size) - 1);
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

// Returns the stored value at a position, at a mip level; NaN in a cell that touches a NaN sample.
float stored_in(vec3 position, float level, Lattice lattice) {
    ++taken_samples;
    if (!FILTER_EXACT) {
        ++taken_fetches;
        vec3 coordinate = position / (2.0 * lattice.half_size + 1.0) + 0.5;
        return textureLod(volume, sampled_at(coordinate, vec3(textureSize(volume, int(level)))), level).r;
    }
    vec3 index = position + lattice.half_size;
    if (!PREFILTER) return fetched(index, 0);
    level = min(level, float(textureQueryLevels(volume) - 1));
    int below = whole_of(level);
    float fine = fetched(index, below);
    return level == float(below) ? fine : interpolated(fine, fetched(index, below + 1), level - float(below));
}

// Returns the stored value at depth z of the ray.
float stored_at(Ray ray, float z, Lattice lattice) {
    return stored_in(fma(vec3(z), ray.d, ray.q), PREFILTER ? level_at(z, lattice) : 0.0, lattice);
}

#endif
