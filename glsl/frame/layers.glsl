// The translucent surfaces along a pixel's ray, nearest first, where a scene has any. surfaces.glsl writes them.
#ifndef LAYERS_GLSL
#define LAYERS_GLSL

#include "interface.glsl"
#include "shared/device.glsl"

layout(constant_id = SPEC_LAYERED) const bool LAYERS = false;

layout(set = 0, binding = BINDING_LAYER_CURSORS, std430) readonly buffer LayerCursors { uint layer_cursors[]; };
layout(set = 0, binding = BINDING_LAYER_ENDS, std430) readonly buffer LayerEnds { uint layer_ends[]; };
layout(set = 0, binding = BINDING_LAYER_DEPTHS, std430) readonly buffer LayerDepths { uvec2 layer_depths[]; };
layout(set = 0, binding = BINDING_LAYERS, std430) readonly buffer Layers { vec4 layers[]; };

// The surfaces not composited yet.
struct LayersAhead {
    uint next, end;
    float depth; // of the next; 3e38 without one
};

// Reads the depth of the next surface.
void look_ahead(inout LayersAhead ahead) {
    ahead.depth = ahead.next < ahead.end ? uintBitsToFloat(layer_depths[ahead.next].x) : 3e38;
}

// Returns the surfaces of a pixel from a depth on, in an image `width` pixels wide.
LayersAhead layers_from(uvec2 pixel, uint width, float depth) {
    LayersAhead ahead = LayersAhead(0u, 0u, 3e38);
    if (!LAYERS) return ahead;
    uint across = (width + TILE - 1u) / TILE, tile = pixel.y / TILE * across + pixel.x / TILE;
    uint slot = tile * TILE_PIXELS + pixel.y % TILE * TILE + pixel.x % TILE;
    ahead.next = slot == 0u ? 0u : layer_cursors[slot - 1u];
    ahead.end = layer_ends[slot];
    look_ahead(ahead);
    for (uint turn = 0u; turn < MOST_LAYERS && ahead.depth < depth; ++turn) {
        ++ahead.next;
        look_ahead(ahead);
    }
    return ahead;
}

// Skips the surfaces that earlier dispatches have composited.
void skip_layers(inout LayersAhead ahead, uint passed) {
    ahead.next = min(ahead.next + passed, ahead.end);
    look_ahead(ahead);
}

// Returns premultiplied colour and opacity of the next surface, and advances.
vec4 take_layer(inout LayersAhead ahead) {
    vec4 colour = layers[ahead.next];
    ++ahead.next;
    look_ahead(ahead);
    return colour;
}

#endif
