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
    return with_pool(lattice, volume, lattice.half_size);
}

// Interpolates at one level around an index of level 0.
float fetched(vec3 index, int level) {
    vec3 size = vec3(textureSize(volume, level));
    if (PREFILTER) index = (index + 0.5) * (size / vec3(textureSize(volume, 0))) - 0.5;
    index = clamp(index, vec3(0.0), size - 1.0);
    vec3 base = min(floor(index), max(size - 2.0, 0.0));
    ivec3 i = whole_of(base);
    return between_texels(volume, i, min(i + 1, ivec3(size) - 1), index - base, level);
}

// Returns the stored value at an offset from a position, from the position's page.
float in_pages(vec3 position, vec3 offset, Lattice lattice) {
    ++taken_samples;
    return stored_on_page(volume, position + lattice.half_size, offset, vec3(1.0), 2.0 * lattice.half_size, lattice);
}

// Returns the stored value at a position, at a mip level; NaN in a cell that touches a NaN sample.
float stored_in(vec3 position, float level, Lattice lattice) {
    if (PAGED) return in_pages(position, vec3(0.0), lattice);
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
    vec3 last = 2.0 * lattice.half_size, first = z <= run_until ? run_first : pool_first;
    if (!FILTER_EXACT) {
        // Beyond the run any texel will do.
        ++taken_fetches;
        vec3 coordinate = (fma(vec3(z), ray.d, ray.q) + (lattice.half_size + 0.5 + first)) * lattice.texel;
        return textureLod(volume, sampled_at(coordinate, vec3(textureSize(volume, 0))), 0.0).r;
    }
    vec3 index = clamp(fma(vec3(min(z, page_until)), ray.d, ray.q) + lattice.half_size, vec3(0.0), last);
    return on_page(volume, index, first, vec3(1.0), last, lattice);
}

#endif
