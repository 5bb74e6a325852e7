// The march of the compute routes for grids: one invocation owns a pixel and marches its ray front to back in registers, in one or
// several dispatches, through the volume and the translucent surfaces in it.
#ifndef MARCH_GLSL
#define MARCH_GLSL

#include "interface.glsl"
#include "shared/device.glsl"
#include "shared/optics.glsl"
#include "frame/layers.glsl"
#include "frame/by-list.glsl"
#include "frame/counts.glsl"
#include "frame/hit-depths.glsl"
#include "grid/grid.glsl"
#include "grid/empty-space.glsl"
#include "grid/interval.glsl"
#include "grid/owned.glsl"
#include "grid/paging.glsl"
#include "grid/resume.glsl"
#include "grid/shown.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

// Most slabs of one turn of a march: their samples are fetched before the first is classified, so that one fetch does not wait for the
// other. A turn takes one where surfaces split slabs, and where it does so much else that two only cost registers: light, and integrals
// between the ends of segments.
const uint MOST_AT_ONCE = 2u;

layout(set = 0, binding = BINDING_ACCUMULATION, rgba32f) uniform image2D accumulation;

// Where the dispatch before has left the ray of a grid in pages.
RayState before = FIRST_STATE;

uint number_of(ivec2 pixel) {
    return uint(pixel.y) * sides_of(push.sides).x + uint(pixel.x);
}

// Finds the pixel of an invocation: by its place in the dispatch, or in a list of tiles or pixels. Returns whether there is one that shows
// anything.
bool own_pixel(out ivec2 pixel) {
    pixel = ivec2(INVOCATION.xy);
    if (REDRAWN || BY_TILE_LIST) {
        uint number = REDRAWN ? WORKGROUP_NUMBER * TILE_PIXELS + gl_LocalInvocationIndex : WORKGROUP_NUMBER;
        if (number >= pixels[PIXELS_COUNT]) return false;
        uint word = pixels[PIXELS_FIRST + number];
        pixel = ivec2(word & 0xffffu, word >> 16);
    }
    if (REDRAWN) {
        vec2 tile = tile_interval_of(pixel);
        if (tile.x > tile.y && !RESUME) imageStore(accumulation, pixel, vec4(0.0));
        return tile.x <= tile.y;
    }
    if (BY_TILE_LIST) pixel = pixel * TILE + ivec2(gl_LocalInvocationID.xy);
    if (any(greaterThanEqual(pixel, ivec2(sides_of(push.sides))))) return false;
    if (!PAGED || (push.order & MARCH_RESUMES) == 0u) return true;
    before = rays[number_of(pixel)];
    return goes_on(before, push.order);
}

// Begins the march, or continues with what the dispatch before has stored: returns colour and opacity so far, and the transmittance.
vec4 begin_march(ivec2 pixel, out float transmittance) {
    if (PAGED) {
        transmittance = before.transmittance;
        return (push.order & MARCH_RESUMES) != 0u ? imageLoad(accumulation, pixel) : vec4(0.0);
    }
    return unpacked_state(RESUME ? imageLoad(accumulation, pixel) : vec4(0.0), transmittance);
}

// Returns whether a value of a slab, front or back, is known from the dispatch before: a ray that waits for one page needs no other.
bool knows(uint value, uint slab) {
    return PAGED && slab == before.slab && value != UNKNOWN;
}

// Returns the slabs of this dispatch, of those that the ray meets: of a grid in pages the next, else all.
uvec2 slabs_ahead(uvec2 slabs) {
    if (!PAGED) return slabs;
    uint first = max(slabs.x, before.slab);
    return uvec2(first, min(slabs.y, first + push.seed));
}

// Stores the result, or the state for the next dispatch.
void end_march(ivec2 pixel, vec4 sum, float transmittance) {
    imageStore(accumulation, pixel, packed_state(sum, transmittance, (push.order & MARCH_CONTINUES) != 0u));
    add_counts();
}

// Composites a piece of the ray between two depths.
void add_part(ivec2 pixel, inout vec4 sum, inout float transmittance, vec4 emission, vec2 piece) {
    float in_front = transmittance;
    add_behind(sum, transmittance, emission);
    note_hit(number_of(pixel), in_front, transmittance, piece.x, piece.y);
}

BrickGrid load_bricks() {
    return bricks_of(push.half_slope.xyz, push.order & MARCH_AXIS);
}

// Returns the translucent surfaces from depth `begin` on, where this dispatch begins: the one before has composited those in front.
LayersAhead begin_layers(ivec2 pixel, float begin) {
    if (PAGED) return layers_from(uvec2(pixel), sides_of(push.sides).x, before.layer);
    return layers_from(uvec2(pixel), sides_of(push.sides).x, push.first > 0u ? begin : -3e38);
}

// Returns the depth at which another dispatch resumes; 3e38 where none does.
float layers_end(float end) {
    return (push.order & MARCH_CONTINUES) != 0u ? end : 3e38;
}

// Composites the surfaces up to and including a depth, front to back.
void pass_layers(inout LayersAhead ahead, float depth, float opaque, inout vec4 sum, inout float transmittance) {
    for (uint turn = 0u; turn < MOST_LAYERS && ahead.depth <= depth && transmittance > opaque; ++turn) {
        add_behind(sum, transmittance, take_layer(ahead));
    }
}

// Notes how far the ray has come that ends before slab `end`. Returns whether this is its end; only a ray through pages may have another.
// Of maximum intensity projection `transmittance` is the greatest scalar.
bool ends_ray(ivec2 pixel, uint slab, uint end, float transmittance, float opaque, float reached, LayersAhead ahead, uint front, uint back) {
    if (!PAGED) return true;
    bool ended = !has_missed() && (slab >= end || transmittance <= opaque);
    rays[number_of(pixel)] = ray_at(ended, slab, transmittance, reached, ahead.depth, front, back);
    return ended;
}

// Shortens a piece to the part in front of the next surface, after compositing the surfaces already reached. Returns whether the
// surface splits the piece. Then `reached` becomes the depth of the split: the caller repeats the slab for the rest.
bool cut_at_layer(inout LayersAhead ahead, inout vec2 piece, inout float reached, float opaque, inout vec4 sum, inout float transmittance) {
    piece.x = max(piece.x, reached);
    pass_layers(ahead, piece.x, opaque, sum, transmittance);
    bool cut = ahead.depth < piece.y;
    if (cut) reached = piece.y = ahead.depth;
    return cut;
}

// Composites the remaining surfaces in front of depth `end`.
void end_layers(inout LayersAhead ahead, float end, float opaque, inout vec4 sum, inout float transmittance) {
    for (uint turn = 0u; turn < MOST_LAYERS && ahead.depth < end && transmittance > opaque; ++turn) {
        add_behind(sum, transmittance, take_layer(ahead));
    }
}

#endif
