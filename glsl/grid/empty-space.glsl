// Empty-space skipping: a march skips bricks in which nothing is visible (bricks.glsl), or no scalar exceeds the greatest so far.
#ifndef EMPTY_SPACE_GLSL
#define EMPTY_SPACE_GLSL

#include "interface.glsl"
#include "shared/brick-codes.glsl"
#include "shared/integers.glsl"
#include "grid/lattice.glsl"
#include "grid/ray.glsl"

layout(constant_id = SPEC_EMPTY_SPACE) const bool EMPTY_SPACE = false;
layout(constant_id = SPEC_GREATEST) const bool GREATEST = false;

layout(set = 0, binding = BINDING_BRICKS, std430) readonly buffer Bricks {
    uint codes[];
} bricks;

struct BrickGrid {
    ivec3 count;
    ivec3 stride;
    vec3 half_size; // half the domain, indices
    float reached;  // GREATEST: the greatest scalar of the ray so far
};

// Returns the bricks of a domain in whose index space z is axis `axis` of the grid, and the other two follow cyclically.
BrickGrid bricks_of(vec3 half_size, uint axis) {
    ivec3 count = max(ivec3(ceil(2.0 * half_size / float(BRICK) - 1e-3)), ivec3(1));
    BrickGrid grid;
    grid.count = count;
    // The codes are stored along the grid's own axes, whichever of them is z here.
    uint x = (2u - axis) % 3u;
    count[x] = row_of(count[x]);
    grid.stride = strides_of(count, axis);
    grid.half_size = half_size;
    grid.reached = -3e38;
    return grid;
}

// Returns whether a brick may show anything.
bool may_show(int brick, BrickGrid grid) {
    return GREATEST ? greatest_of(bricks.codes[brick / 2], brick) > grid.reached : bit_of(bricks.codes[brick / 32], brick);
}

// Returns the number of slabs, h cells thick, to march before the next look at the bricks: about four bricks, which takes some 4 % more samples
// than two, and half the looks. It is the same for all invocations of a tile, so that those which run in lockstep do not wait for each other.
uint slabs_between_looks(float h) {
    return uint(clamp(4.0 * float(BRICK) / h, 4.0, 128.0));
}

// Returns the depth up to which nothing is visible on the ray from depth z on; z where something is visible in the brick there.
//
// Rounding may place a position in a neighbouring brick, and the ray may skip a corner of a brick that is shorter than the nudge:
// both are harmless, because the range of a brick includes the samples one cell around it.
float empty_until(Ray ray, float z, float far, BrickGrid grid) {
    const float NUDGE = 0.01; // cells
    const int MOST_TURNS = 4096; // bricks: beyond, slabs are sampled in vain
    float speed = max(max(abs(ray.d.x), abs(ray.d.y)), abs(ray.d.z));
    float nudge = NUDGE / max(speed, 1e-30);
    float at = z;
    for (int turn = 0; turn < MOST_TURNS; ++turn) {
        vec3 place = (fma(vec3(at + nudge), ray.d, ray.q) + grid.half_size) / float(BRICK);
        ivec3 brick = min(whole_of(max(place, vec3(0.0))), grid.count - 1);
        ivec3 code = brick * grid.stride;
        if (may_show(code.x + code.y + code.z, grid)) break;
        vec3 face = (vec3(brick) + mix(vec3(0.0), vec3(1.0), greaterThan(ray.inverse, vec3(0.0)))) * float(BRICK);
        vec3 leave = (face - grid.half_size - ray.q) * ray.inverse;
        at = max(min(min(leave.x, leave.y), leave.z), at + nudge);
        if (at >= far) break;
    }
    return at;
}

// Skips those of the slabs from `slab` to `end` in which nothing is visible. Slab i lies between the depths z0 + i h and
// z0 + (i + 1) h, and the ray enters slab `slab` at depth z. Returns the slab before which to look again.
uint skip_empty(inout uint slab, uint end, float z, float z0, float h, uint walk, Ray ray, float far, BrickGrid grid) {
    if (!EMPTY_SPACE) return end;
    // Skip whole slabs only.
    float until = empty_until(ray, z, far, grid);
    slab = until < far ? clamp(uint(max(floor((until - z0) / h), 0.0)), slab, end) : end;
    return min(slab + walk, end);
}

#endif
