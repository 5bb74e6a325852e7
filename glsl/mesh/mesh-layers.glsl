// Segments of cells, split at the translucent surfaces between them.
#ifndef MESH_LAYERS_GLSL
#define MESH_LAYERS_GLSL

#include "interface.glsl"
#include "shared/device.glsl"
#include "frame/layers.glsl"
#include "mesh/mesh-segments.glsl"

// Composites the translucent surfaces up to a depth, front to back.
void pass_layers(inout LayersAhead ahead, float depth, inout vec4 sum) {
    for (uint turn = 0u; turn < MOST_LAYERS && ahead.depth <= depth; ++turn) composite(sum, take_layer(ahead), false);
}

// Part of a segment that is left to integrate, because translucent surfaces split it.
struct Uncut {
    End front, back;
    vec2 depths; // equal: nothing
};

bool is_uncut(Uncut rest) {
    return rest.depths.x < rest.depths.y;
}

// Begins what lies before the next surface, behind those that were come to. The rest follows in further turns of the loop over segments,
// as pieces do. One scalar is constant, two are linear.
void begin_uncut(inout Uncut rest, inout Pending pending, inout LayersAhead ahead, bool constant, float world, inout vec4 sum) {
    pass_layers(ahead, rest.depths.x, sum);
    float from = rest.depths.x, to = min(ahead.depth, rest.depths.y);
    End middle = rest.back;
    // A loop, which no invocation's device runs through where no surface is near.
    for (uint once = 0u; once < uint(to < rest.depths.y && !constant); ++once) {
        middle = end_at(rest.front.s + (rest.back.s - rest.front.s) * clamp((to - from) / (rest.depths.y - from), 0.0, 1.0));
    }
    begin_segment(pending, rest.front, middle, (to - from) * world, to);
    rest.front = middle;
    rest.depths.x = to;
}

#endif
