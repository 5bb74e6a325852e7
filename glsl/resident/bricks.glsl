// entry compute MARK
// entry compute MERGE
//
// Finds the bricks of a grid in which the transfer function shows nothing: those whose range of scalars intersects none of the ranges
// with extinction.
//
//   MARK   one invocation per brick
//   MERGE  one invocation per block of BLOCK bricks along each side: finds the blocks of which no brick shows anything
//
//   in    ranges of the bricks; visible ranges of scalars, ascending and disjoint
//   out   one word per brick: 0 where something is visible; else the side of the empty block around it, in bricks: BLOCK or 1
//   cost  a binary search, and two accesses per brick
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"

layout(push_constant, std430) uniform BricksPush {
    uint count[3]; // of bricks along each axis
    uint ranges; // number of visible ranges
    float margin; // widens each visible range at both ends, scalars: a table smears its edges
} push;

layout(set = 0, binding = BINDING_RANGES, std430) readonly buffer Ranges {
    vec2 of_brick[];
} ranges;

layout(set = 0, binding = BINDING_VISIBLE, std430) readonly buffer Visible {
    vec2 of_scalars[];
} scalars;

layout(set = 0, binding = BINDING_BRICKS, std430) buffer Bricks {
    uint empty[];
} bricks;

layout(local_size_x = 64) in;

#ifdef MARK
void main() {
    // Large grids need several rows of workgroups.
    uint brick = INVOCATION_NUMBER;
    if (brick >= push.count[0] * push.count[1] * push.count[2]) return;
    vec2 range = ranges.of_brick[brick];
    // The first visible range that ends at or above the brick's least scalar.
    uint low = 0, high = push.ranges;
    while (low < high) {
        uint middle = (low + high) / 2;
        if (scalars.of_scalars[middle].y + push.margin < range.x) low = middle + 1u; else high = middle;
    }
    bool visible = low < push.ranges && scalars.of_scalars[low].x - push.margin <= range.y;
    bricks.empty[brick] = visible && range.x <= range.y ? 0u : 1u;
}
#endif

#ifdef MERGE
void main() {
    uvec3 count = uvec3(push.count[0], push.count[1], push.count[2]), blocks = (count + BLOCK - 1u) / BLOCK;
    uint block = INVOCATION_NUMBER;
    if (block >= blocks.x * blocks.y * blocks.z) return;
    uvec3 first = uvec3(block % blocks.x, block / blocks.x % blocks.y, block / blocks.x / blocks.y) * BLOCK;
    uvec3 end = min(first + BLOCK, count);
    uint least = 1u;
    for (uint z = first.z; z < end.z; ++z) {
        for (uint y = first.y; y < end.y; ++y) {
            for (uint x = first.x; x < end.x; ++x) least = min(least, bricks.empty[(z * count.y + y) * count.x + x]);
        }
    }
    if (least == 0u) return;
    for (uint z = first.z; z < end.z; ++z) {
        for (uint y = first.y; y < end.y; ++y) {
            for (uint x = first.x; x < end.x; ++x) bricks.empty[(z * count.y + y) * count.x + x] = BLOCK;
        }
    }
}
#endif
