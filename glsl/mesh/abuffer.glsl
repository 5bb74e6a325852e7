// entry compute TILES
// entry compute LISTS
//
// In each pixel the cells that its line passes, sorted by the middles of their pieces, and integrated one after the other.
//
//   TILES   one invocation owns a pixel and walks through the cells that its line meets. They come nearly sorted and pass through a window;
//           where that was not enough, the pixel is flagged
//   LISTS   the same for flagged pixels, from their lists, which are sorted in place
//
//   in    bins of cells by rank with their hits (mesh-tiles.glsl), or lists of cells by rank (mesh-lists.glsl); transfer function or its
//         table
//   out   accumulation image: premultiplied linear RGBA
//
// Source: Carpenter, SIGGRAPH 1984.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/optics.glsl"
#include "shared/segments.glsl"
#include "frame/layers.glsl"
#include "mesh/mesh.glsl"
#include "mesh/mesh-bounds.glsl"
#include "mesh/mesh-segments.glsl"
#include "mesh/mesh-hit-depths.glsl"
#include "mesh/mesh-layers.glsl"
#include "mesh/own-pixel.glsl"
#include "mesh/pixel-list.glsl"
#include "mesh/status.glsl"
#include "mesh/tile-walk.glsl"

layout(constant_id = SPEC_BACK_TO_FRONT) const bool BACK_TO_FRONT = false;
layout(constant_id = SPEC_LISTED) const uint LISTED = 0; // FLAG_* of the pixels that are drawn; 0: all

layout(local_size_x = TILE_PIXELS) in;
layout(set = 0, binding = BINDING_FLAGS, std430) buffer Flags { uint flags[]; };
layout(set = 0, binding = BINDING_ACCUMULATION, rgba32f) uniform image2D accumulation;

const float NOTHING = -3.402823e38;
const float EVERYTHING = 3.402823e38;

// A window like the k-buffer's, with the pieces themselves.
const uint HELD = 8u;
float held_at[HELD];
vec4 held[HELD];

void clear_window() {
    for (uint j = 0u; j < HELD; ++j) held_at[j] = NOTHING;
}

// Puts a piece into the window, and takes out the least.
void pass_through(inout float at, inout vec4 piece) {
    for (uint j = 0u; j < HELD; ++j) {
        bool before = at < held_at[j];
        float kept_at = held_at[j];
        vec4 kept = held[j];
        held_at[j] = before ? at : kept_at;
        held[j] = before ? piece : kept;
        at = before ? kept_at : at;
        piece = before ? kept : piece;
    }
    float leaves_at = held_at[0];
    vec4 leaves = held[0];
    for (uint j = 1u; j < HELD; ++j) {
        held_at[j - 1u] = held_at[j];
        held[j - 1u] = held[j];
    }
    held_at[HELD - 1u] = at;
    held[HELD - 1u] = piece;
    at = leaves_at;
    piece = leaves;
}

// Place of a piece in the direction of ranks. What is left of a cell behind the eye has none, and falls through the window.
float place_of(vec4 piece) {
    return piece.y > piece.x ? middle_of(piece, BACK_TO_FRONT) : NOTHING;
}

#ifdef TILES
const bool REPAIRS = false;

struct Source {
    Walk walk;
    uint pixel;
    vec2 line0; // of the tile
    uint held;  // turns that empty the window
};

Source source_of(OwnPixel own) {
    Source source;
    source.pixel = gl_LocalInvocationIndex;
    source.walk = walk_through(own.in_band, source.pixel, push.first, push.number);
    source.line0 = line_at(vec2(pixel_of(own.tile, 0u)) + 0.5);
    source.held = has_pair(source.walk) ? HELD : 0u;
    clear_window();
    return source;
}

bool has_next(Source source) {
    return any(bvec2(has_pair(source.walk), source.held > 0u));
}

bool ended_early(Source source) {
    return is_cut(source.walk);
}

void count_drawn(Source source) {
    count_fragments(source.walk.met);
}

// Returns the next piece in order, with its place; none as long as the window fills.
vec4 next_of(inout Source source, OwnPixel own, out float at) {
    vec4 piece = vec4(0.0);
    at = EVERYTHING;
    if (has_pair(source.walk)) {
        uint id = next_primitive(source.walk, source.pixel);
        uvec2 number = uvec2(source.pixel % TILE, source.pixel / TILE);
        piece = piece_of(id, primitive_of(id, source.line0), number, line_at(vec2(own.pixel) + 0.5));
        at = place_of(piece);
    } else {
        --source.held;
    }
    pass_through(at, piece);
    return piece;
}
#endif

#ifdef LISTS
const bool REPAIRS = true;

layout(set = 0, binding = BINDING_LISTS, std430) buffer Lists { vec4 lists[]; };

// Sorts a list, a pass through the window after another.
void sort_list(uint begin, uint end) {
    // As many turns as every device makes in a dispatch.
    uint turns = max(30000u / max(end - begin, 1u), 1u);
    bool unsorted = true;
    for (uint turn = 0u; turn < turns && unsorted; ++turn) {
        unsorted = false;
        clear_window();
        uint to = begin;
        float last = NOTHING;
        for (uint from = begin; from < end + HELD; ++from) {
            vec4 piece = lists[min(from, end - 1u)];
            float at = from < end ? middle_of(piece, BACK_TO_FRONT) : EVERYTHING;
            pass_through(at, piece);
            if (at != NOTHING && to < end) {
                unsorted = unsorted || at < last;
                last = at;
                lists[to++] = piece;
            }
        }
    }
}

struct Source {
    uint next, end;
};

Source source_of(OwnPixel own) {
    PixelList list = list_of(own);
    sort_list(list.begin, list.end);
    return Source(list.begin, list.end);
}

bool has_next(Source source) {
    return source.next < source.end;
}

bool ended_early(Source source) {
    return false;
}

// They were counted when the pixel was drawn first.
void count_drawn(Source source) {}

vec4 next_of(inout Source source, OwnPixel own, out float at) {
    vec4 piece = lists[source.next++];
    at = place_of(piece);
    return piece;
}
#endif

void main() {
    OwnPixel own = own_pixel();
    if (!own.exists) return;
    if (REPAIRS && (flags[own.word] & LISTED) == 0u) return;
    if (REPAIRS) forget_hit(number_of(own));
    load_segments(push.knots);
    uint knots = push.knots;
    vec2 bounds = bounds_at(own.pixel);
    float opaque = end_of_line(BACK_TO_FRONT);
    Source source = source_of(own);
    LayersAhead ahead = layers_from(own.pixel, uint(2.0 * push.half_extent.x), -3e38);
    vec4 sum = vec4(0.0);
    bool unsorted = false;
    float last = NOTHING;
    Pending pending;
    begin_segment(pending, no_end(), no_end(), 0.0, 0.0);
    Uncut rest = Uncut(pending.front, pending.back, vec2(0.0));
    // A turn for each piece of a line, and for each further piece of it between knots.
    bool goes_on = true;
    while (goes_on) {
        while ((has_next(source) || pending.len > 0.0 || is_uncut(rest)) && sum.a < opaque && !pending.waits) {
            if (pending.len == 0.0 && !is_uncut(rest)) {
                float at;
                vec4 listed = next_of(source, own, at);
                if (at != NOTHING) {
                    unsorted = unsorted || at < last;
                    last = at;
                    Piece piece = Piece(listed.x, listed.y, listed.z, listed.w);
                    if (BOUNDED) cut(piece, bounds);
                    End near = end_at(piece.s0), far = end_at(piece.s1);
                    float len = max(piece.d1 - piece.d0, 0.0) * own.world;
                    if (LAYERS) rest = Uncut(near, far, vec2(piece.d0, piece.d1));
                    else if (BACK_TO_FRONT) begin_segment(pending, far, near, len, piece.d1);
                    else begin_segment(pending, near, far, len, piece.d1);
                }
            }
            if (LAYERS && pending.len == 0.0 && is_uncut(rest)) begin_uncut(rest, pending, ahead, false, own.world, sum);
            if (pending.len > 0.0) add_next(sum, pending, own, BACK_TO_FRONT, knots);
        }
        goes_on = pending.waits;
        for (uint once = 0u; once < uint(goes_on); ++once) add_thickest(sum, pending, own, BACK_TO_FRONT);
    }
    if (LAYERS && sum.a < opaque) pass_layers(ahead, 3e37, sum);
    // Devices may end a loop that takes too many turns, and go on after it. (Not the loop's own condition: compilers know that.)
    bool left = has_next(source) || ended_early(source) || pending.len != 0.0 || is_uncut(rest);
    if (left && sum.a < opaque) atomicAdd(status[STATUS_CUT], 1u);
    if (LISTED != FLAG_OVERLAPS) flags[own.word] = (unsorted ? FLAG_UNSORTED : 0u) | (REPAIRS ? FLAG_REPAIRED : 0u);
    // Of repair the last round counts.
    if (unsorted) atomicAdd(status[REPAIRS ? STATUS_UNREPAIRED : STATUS_OVERFLOW_PIXELS], REPAIRS ? push.last_round : 1u);
    count_drawn(source);
    imageStore(accumulation, ivec2(own.pixel), sum);
}
