// entry compute COMPUTE
// entry compute AROUND
//
// Finds the bricks of a grid in which the transfer function shows anything: those whose range of scalars intersects one of the ranges
// with extinction.
//
//   COMPUTE   in: ranges of the bricks; visible ranges of scalars, ascending and disjoint. Out: one bit per brick, 0 where nothing is
//             visible. A binary search per brick.
//   AROUND    in: these bits. Out: one bit per brick, 0 where nothing is visible in it and the 26 bricks around it. 27 words per 32 bricks.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/brick-codes.glsl"
#include "shared/device.glsl"

layout(push_constant, std430) uniform BricksPush {
    uint across; // bricks along x
    uint rows;   // along y
    uint planes; // along z
    uint ranges; // number of visible ranges
    float margin; // widens each visible range at both ends, scalars: a table smears its edges
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
    uint codes[];
} bricks;

// Returns whether a brick shows anything; `Telling::code` says the same of those of a page.
bool is_visible(vec2 range) {
    // The first visible range that ends at or above the brick's least scalar.
    uint low = 0, high = push.ranges;
    while (low < high) {
        uint middle = (low + high) / 2;
        if (scalars.of_scalars[middle].y + push.margin < range.x) low = middle + 1u; else high = middle;
    }
    bool visible = low < push.ranges && scalars.of_scalars[low].x - push.margin <= range.y;
    return visible && range.x <= range.y;
}

shared uint word_bits[2];

void main() {
    // Large grids need several rows of workgroups.
    uint number = INVOCATION_NUMBER, own = gl_LocalInvocationIndex, row_bricks = uint(row_of(int(push.across)));
    uint x = number % row_bricks, row = number / row_bricks;
    if (own < 2u) word_bits[own] = 0u;
    barrier();
    bool exists = x < push.across && row < push.rows * push.planes;
    if (exists && is_visible(ranges.of_brick[row * push.across + x])) atomicOr(word_bits[own / 32u], 1u << (own & 31u));
    barrier();
    if ((own & 31u) == 0u && row < push.rows * push.planes) bricks.codes[number / 32u] = word_bits[own / 32u];
}
#endif

#ifdef AROUND
layout(set = 0, binding = BINDING_BRICKS, std430) readonly buffer Bricks {
    uint codes[];
} bricks;

layout(set = 0, binding = BINDING_AROUND, std430) buffer Around {
    uint bits[];
} around;

void main() {
    int word = int(INVOCATION_NUMBER), across = row_of(int(push.across)) / 32;
    ivec3 place = ivec3(word % across, word / across % int(push.rows), word / across / int(push.rows));
    if (place.z >= int(push.planes)) return;
    ivec2 low = max(place.yz - 1, 0), high = min(place.yz + 1, ivec2(push.rows, push.planes) - 1);
    uint any = 0u;
    for (int z = low.y; z <= high.y; ++z) {
        for (int y = low.x; y <= high.x; ++y) {
            int at = (z * int(push.rows) + y) * across + place.x;
            uint own = bricks.codes[at];
            uint below = place.x > 0 ? bricks.codes[at - 1] : 0u, above = place.x + 1 < across ? bricks.codes[at + 1] : 0u;
            any |= own | own << 1 | own >> 1 | below >> 31 | above << 31;
        }
    }
    around.bits[word] = any;
}
#endif
