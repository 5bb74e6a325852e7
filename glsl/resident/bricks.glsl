// entry compute COMPUTE
// entry compute AROUND
//
// Finds the bricks of a grid in which the transfer function shows anything: those whose range of scalars intersects one of the ranges
// with extinction.
//
//   COMPUTE   in: ranges of the bricks; visible ranges of scalars, ascending and disjoint. Out: one word per brick, 0 where nothing is
//             visible. A binary search per brick.
//   AROUND    in: these words. Out: one word per brick, 0 where nothing is visible in it and the 26 bricks around it.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"

layout(push_constant, std430) uniform BricksPush {
    uint bricks;
    uint ranges; // number of visible ranges
    float margin; // widens each visible range at both ends, scalars: a table smears its edges
    uint across;  // bricks along x
    uint rows;    // bricks along y
} push;

layout(local_size_x = 64) in;

#ifdef COMPUTE

layout(set = 0, binding = BINDING_RANGES, std430) readonly buffer Ranges {
    vec2 of_brick[];
} ranges;

layout(set = 0, binding = BINDING_VISIBLE, std430) readonly buffer Visible {
    vec2 of_scalars[];
} scalars;

layout(set = 0, binding = BINDING_BRICKS, std430) buffer Bricks {
    uint visible[];
} bricks;

void main() {
    // Large grids need several rows of workgroups.
    uint brick = INVOCATION_NUMBER;
    if (brick >= push.bricks) return;
    vec2 range = ranges.of_brick[brick];
    // The first visible range that ends at or above the brick's least scalar.
    uint low = 0, high = push.ranges;
    while (low < high) {
        uint middle = (low + high) / 2;
        if (scalars.of_scalars[middle].y + push.margin < range.x) low = middle + 1u; else high = middle;
    }
    bool visible = low < push.ranges && scalars.of_scalars[low].x - push.margin <= range.y;
    bricks.visible[brick] = visible && range.x <= range.y ? 1u : 0u;
}
#endif

#ifdef AROUND
layout(set = 0, binding = BINDING_BRICKS, std430) readonly buffer Bricks {
    uint visible[];
} bricks;

layout(set = 0, binding = BINDING_AROUND, std430) buffer Around {
    uint words[];
} around;

void main() {
    uint brick = INVOCATION_NUMBER;
    if (brick >= push.bricks) return;
    ivec3 count = ivec3(push.across, push.rows, push.bricks / (push.across * push.rows));
    ivec3 place = ivec3(brick % push.across, brick / push.across % push.rows, brick / (push.across * push.rows));
    ivec3 low = max(place - 1, 0), high = min(place + 1, count - 1);
    uint any = 0u;
    for (int z = low.z; z <= high.z; ++z) {
        for (int y = low.y; y <= high.y; ++y) {
            for (int x = low.x; x <= high.x; ++x) any |= bricks.visible[(z * count.y + y) * count.x + x];
        }
    }
    around.words[brick] = any;
}
#endif
