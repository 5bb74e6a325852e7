// The samples of a grid: parameters of reconstruction, and the scalar of a stored value.
#ifndef LATTICE_GLSL
#define LATTICE_GLSL

#include "interface.glsl"

layout(constant_id = SPEC_FILTER_EXACT) const bool FILTER_EXACT = false;
layout(constant_id = SPEC_HAS_NAN) const bool HAS_NAN = false;
layout(constant_id = SPEC_PREFILTER) const bool PREFILTER = false;

// The push constants that reconstruction uses. Load them once before loops: drivers do not hoist these loads.
struct Lattice {
    vec3 half_size; // half the domain, indices
    float value_scale;
    float value_offset;
    float kq;
    float kd;
    float lod;      // mip level at which a voxel is as large as a pixel at unit distance
    uint axis;      // the grid's axis that index space calls z; the other two follow it cyclically
    ivec4 pages;    // xyz: steps from page to page; w: number of the first (pages.glsl)
    vec3 texel;     // of the pages' pool, in its normalised coordinates
};

// Returns the steps from a thing to the next along each axis in a list that is x fastest, in an index space whose z is axis `axis` of the
// grid and whose other axes follow cyclically.
ivec3 strides_of(ivec3 count, uint axis) {
    return axis == 2u ? ivec3(1, count.x, count.x * count.y)
         : axis == 0u ? ivec3(count.z, count.z * count.x, 1)
                      : ivec3(count.y * count.z, 1, count.y);
}

// Returns the mip level at which a voxel is as large as a pixel, at depth z.
float level_at(float z, Lattice lattice) {
    return max(lattice.lod + log2(max(fma(lattice.kd, z, lattice.kq), 1e-30)), 0.0);
}

// Tests the bits, because compilers may remove float tests.
bool is_nan(float value) {
    return (floatBitsToUint(value) & 0x7fffffffu) > 0x7f800000u;
}

// Returns the scalar of a stored value. It rounds twice: the product alone is an integer's code exactly, so that integer data lies
// on the right side of a jump.
float scalar_of(float texel, Lattice lattice) {
    precise float stored = lattice.value_scale * texel;
    precise float scalar = stored + lattice.value_offset;
    // Products with larger scalars could overflow. Knots are clamped to the same range.
    return clamp(scalar, -1e37, 1e37);
}

#endif
