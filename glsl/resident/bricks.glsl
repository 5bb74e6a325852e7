// entry compute COMPUTE
//
// Finds the bricks of a grid in which the transfer function shows anything: those whose range of scalars intersects one of the ranges
// with extinction.
//
//   in    ranges of the bricks; visible ranges of scalars, ascending and disjoint
//   out   one word per brick: 0 where nothing is visible
//   cost  a binary search per brick
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"

layout(push_constant, std430) uniform BricksPush {
    uint bricks;
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
    uint visible[];
} bricks;

layout(local_size_x = 64) in;

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
