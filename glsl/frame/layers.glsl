// The translucent surfaces that a pixel's line passes, nearest first (surfaces.glsl), where a scene has any. Include only.

layout(constant_id = SPEC_LAYERS) const bool LAYERS = false;

layout(set = 0, binding = BINDING_LAYER_CURSORS, std430) readonly buffer LayerCursors { uint layer_cursors[]; };
layout(set = 0, binding = BINDING_LAYER_ENDS, std430) readonly buffer LayerEnds { uint layer_ends[]; };
layout(set = 0, binding = BINDING_LAYER_DEPTHS, std430) readonly buffer LayerDepths { uvec2 layer_depths[]; };
layout(set = 0, binding = BINDING_LAYERS, std430) readonly buffer Layers { vec4 layers[]; };

// Those that are still to come.
struct LayersAhead {
    uint next, end;
    float depth; // of the next
};

void look_ahead(inout LayersAhead ahead) {
    ahead.depth = ahead.next < ahead.end ? uintBitsToFloat(layer_depths[ahead.next].x) : 3e38;
}

// From a depth on; what lies before it has been passed already.
LayersAhead layers_from(uvec2 pixel, uint width, float depth) {
    LayersAhead ahead = LayersAhead(0u, 0u, 3e38);
    if (!LAYERS) return ahead;
    uint across = (width + TILE - 1u) / TILE, tile = pixel.y / TILE * across + pixel.x / TILE;
    uint slot = tile * TILE_PIXELS + pixel.y % TILE * TILE + pixel.x % TILE;
    ahead.next = slot == 0u ? 0u : layer_cursors[slot - 1u];
    ahead.end = layer_ends[slot];
    look_ahead(ahead);
    for (uint turn = 0u; turn < MOST_TURNS / 2u && ahead.depth < depth; ++turn) {
        ++ahead.next;
        look_ahead(ahead);
    }
    return ahead;
}

// Leaves out those that an earlier dispatch has passed.
void skip_layers(inout LayersAhead ahead, uint passed) {
    ahead.next = min(ahead.next + passed, ahead.end);
    look_ahead(ahead);
}

// Premultiplied colour and opacity of the next, which is passed.
vec4 take_layer(inout LayersAhead ahead) {
    vec4 colour = layers[ahead.next];
    ++ahead.next;
    look_ahead(ahead);
    return colour;
}

#ifdef MARCH_LAYERS
// Composites those up to a depth, front to back.
void pass_layers(inout LayersAhead ahead, float depth, float opaque, inout vec4 sum, inout float transmittance) {
    for (uint turn = 0u; turn < MOST_TURNS / 2u && ahead.depth <= depth && transmittance > opaque; ++turn) {
        add_behind(sum, transmittance, take_layer(ahead));
    }
}

// What of a piece lies before the next. Then `reached` is where it is cut: the rest of it comes in another turn, and the surface before it.
bool cut_at_layer(inout LayersAhead ahead, inout vec2 piece, inout float reached, float opaque, inout vec4 sum, inout float transmittance) {
    piece.x = max(piece.x, reached);
    pass_layers(ahead, piece.x, opaque, sum, transmittance);
    bool cut = ahead.depth < piece.y;
    if (cut) reached = piece.y = ahead.depth;
    return cut;
}

// Composites those that are left, up to where another dispatch goes on.
void end_layers(inout LayersAhead ahead, float end, float opaque, inout vec4 sum, inout float transmittance) {
    for (uint turn = 0u; turn < MOST_TURNS / 2u && ahead.depth < end && transmittance > opaque; ++turn) {
        add_behind(sum, transmittance, take_layer(ahead));
    }
}
#endif
