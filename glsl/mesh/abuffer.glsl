// entry compute COMPUTE
//
// Exact lists: in each pixel the cells that its line passes, sorted by the middles of their pieces, and integrated one after
// the other.
//
//   COMPUTE   one invocation owns a pixel. Its list comes nearly sorted and passes through a window of K; where that was not
//             enough, the list is sorted in place
//
//   in    lists of cells by rank (mesh-lists.glsl), transfer function or its table
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
#include "mesh/mesh-layers.glsl"
#include "mesh/kbuffer.glsl"
#include "mesh/pixel-list.glsl"

layout(constant_id = SPEC_BACK_TO_FRONT) const bool BACK_TO_FRONT = false;
layout(constant_id = SPEC_REPAIR) const bool REPAIR = false;
layout(constant_id = SPEC_FLAGGED) const bool FLAGGED = false; // pixels of havs in which cells overlap

layout(local_size_x = TILE_PIXELS) in;
layout(set = 0, binding = BINDING_LISTS, std430) buffer Lists { vec4 lists[]; };
layout(set = 0, binding = BINDING_STATUS, std430) buffer Status { uint status[]; };
layout(set = 0, binding = BINDING_FLAGS, std430) buffer Flags { uint flags[]; };
layout(set = 0, binding = BINDING_ACCUMULATION, rgba32f) uniform image2D accumulation;

// A window like the k-buffer's, with the pieces themselves: they are written back where others still wait.
const uint HELD = 8u;
float held_at[HELD];
vec4 held[HELD];

// Sorts a list, a pass through the window after another; whether that was enough.
bool sort_list(uint begin, uint end) {
    // As many turns as every device makes in a dispatch.
    uint turns = max(30000u / max(end - begin, 1u), 1u);
    bool unsorted = true;
    for (uint turn = 0u; turn < turns && unsorted; ++turn) {
        unsorted = false;
        for (uint j = 0u; j < HELD; ++j) held_at[j] = NOTHING;
        uint to = begin;
        float last = NOTHING;
        for (uint from = begin; from < end + HELD; ++from) {
            vec4 piece = lists[min(from, end - 1u)];
            float at = from < end ? middle_of(piece, BACK_TO_FRONT) : 3.402823e38;
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
            if (leaves_at != NOTHING && to < end) {
                unsorted = unsorted || leaves_at < last;
                last = leaves_at;
                lists[to++] = leaves;
            }
        }
    }
    return !unsorted;
}

void main() {
    PixelList list = list_of_invocation();
    if (!list.exists) return;
    load_segments(push.knots);
    uint knots = push.knots;
    vec2 bounds = bounds_at(list.pixel);
    float opaque = end_of_line(BACK_TO_FRONT);

    bool unsorted = false;
    if (REPAIR) {
        if ((flags[list.word] & (FLAGGED ? FLAG_OVERLAPS : FLAG_UNSORTED)) == 0u) return;
        unsorted = !sort_list(list.begin, list.end);
    }
    LayersAhead ahead = layers_from(list.pixel, uint(2.0 * push.half_extent.x), -3e38);
    vec4 sum = vec4(0.0);
    float last = NOTHING;
    clear_window();
    Pending pending;
    begin_segment(pending, no_end(), no_end(), 0.0);
    Uncut rest = Uncut(pending.front, pending.back, vec2(0.0));
    // A turn for each piece of a line, and for each further piece of it between knots. After the last one the window is emptied.
    uint i = list.begin;
    while ((i < list.end + K || pending.len > 0.0 || is_uncut(rest)) && sum.a < opaque) {
        if (pending.len == 0.0 && !is_uncut(rest)) {
            Pair pair = Pair(EVERYTHING, i);
            if (i < list.end) {
                vec4 piece = lists[i];
                // What is left of a cell behind the eye has no place, and falls through the window.
                pair.at = piece.y > piece.x ? middle_of(piece, BACK_TO_FRONT) : NOTHING;
            }
            Pair leaves = pass_through(pair);
            if (leaves.at != NOTHING) {
                unsorted = unsorted || leaves.at < last;
                last = leaves.at;
                vec4 listed = lists[leaves.what];
                Piece piece = Piece(listed.x, listed.y, listed.z, listed.w);
                if (BOUNDED) cut(piece, bounds);
                End near = end_at(piece.s0), far = end_at(piece.s1);
                float len = max(piece.d1 - piece.d0, 0.0) * list.world;
                if (LAYERS) rest = Uncut(near, far, vec2(piece.d0, piece.d1));
                else if (BACK_TO_FRONT) begin_segment(pending, far, near, len);
                else begin_segment(pending, near, far, len);
            }
            ++i;
        }
        if (LAYERS && pending.len == 0.0 && is_uncut(rest)) begin_uncut(rest, pending, ahead, false, list.world, sum);
        if (pending.len > 0.0) composite(sum, next_piece(pending, BACK_TO_FRONT, knots), BACK_TO_FRONT);
    }
    if (LAYERS && sum.a < opaque) pass_layers(ahead, 3e37, sum);
    // Devices may end a loop that takes too many turns, and go on after it. (Not the loop's own condition: compilers know that.)
    uint left = list.end + K - i + uint(pending.len != 0.0 || is_uncut(rest));
    if (left != 0u && sum.a < opaque) atomicAdd(status[STATUS_CUT], 1u);
    if (!FLAGGED) flags[list.word] = (unsorted ? FLAG_UNSORTED : 0u) | (REPAIR ? FLAG_REPAIRED : 0u);
    // Of repair the last round counts.
    if (unsorted) atomicAdd(status[REPAIR ? STATUS_UNREPAIRED : STATUS_OVERFLOW_PIXELS], REPAIR ? push.last_round : 1u);
    imageStore(accumulation, ivec2(list.pixel), sum);
}
