// entry compute COMPUTE
//
// Hardware-assisted visibility sorting: faces come nearly sorted, a k-buffer in each pixel puts them in order, and what lies between
// two faces that leave it one after the other is integrated.
//
//   COMPUTE   one invocation owns a pixel and takes its list; the k-buffer is in registers, between dispatches in storage images
//
//   in    lists of faces by rank (mesh-lists.glsl), transfer function or its table
//   out   accumulation image: premultiplied linear RGBA; for each pixel whether what left the k-buffer was not in order
//
// A line is inside the mesh while it has entered more often than left: faces of the outline say so, coincident ones too, in whatever order
// they come.
//
// Source: Callahan, Ikits, Comba and Silva, TVCG 11(3), 2005; Peikert, SciVis 2007, pages 4-26 to 4-30.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/optics.glsl"
#include "shared/segments.glsl"
#include "frame/layers.glsl"
#include "mesh/mesh-segments.glsl"
#include "mesh/mesh-layers.glsl"
#include "mesh/havs-sweep.glsl"
#include "mesh/pixel-list.glsl"
#include "mesh/sweep-images.glsl"

layout(constant_id = SPEC_RESUME) const bool RESUME = false;
layout(constant_id = SPEC_LAST_CHUNK) const bool LAST_CHUNK = true;
layout(constant_id = SPEC_REPAIR) const bool REPAIR = false;

layout(local_size_x = TILE_PIXELS) in;
layout(set = 0, binding = BINDING_LISTS, std430) buffer Lists { uvec2 lists[]; };
layout(set = 0, binding = BINDING_STATUS, std430) buffer Status { uint status[]; };
layout(set = 0, binding = BINDING_FLAGS, std430) buffer Flags { uint flags[]; };

// Returns an entry of a list that ends at `end`. From `to` on comes what is greater than all: it lets the least of the window out.
Pair arrival(uint i, uint to, uint end) {
    uvec2 entry = lists[min(i, max(end, 1u) - 1u)];
    Pair pair = Pair(uintBitsToFloat(entry.x) * (BACK_TO_FRONT ? -1.0 : 1.0), entry.y);
    if (i >= to) pair = Pair(EVERYTHING, 0u);
    return pair;
}

// Sorts a list in place: it passes through the window again and again until what leaves is in order, at most as many times as every device
// completes in a dispatch.
void sort_list(uint begin, uint end) {
    uint turns = max(30000u / max(end - begin, 1u), 1u);
    bool unsorted = true;
    for (uint turn = 0u; turn < turns && unsorted; ++turn) {
        unsorted = false;
        clear_window();
        uint to = begin;
        float last = NOTHING;
        for (uint from = begin; from < end + K; ++from) {
            Pair leaves = pass_through(arrival(from, end, end));
            if (leaves.at != NOTHING && to < end) {
                unsorted = unsorted || leaves.at < last;
                last = leaves.at;
                lists[to++] = uvec2(floatBitsToUint(leaves.at * (BACK_TO_FRONT ? -1.0 : 1.0)), leaves.what);
            }
        }
    }
}

void main() {
    PixelList list = list_of_invocation();
    if (!list.exists) return;
    ivec2 pixel = ivec2(list.pixel);
    load_segments(push.knots);
    uint knots = push.knots;
    vec2 drawn = drawn_depths(list.pixel);
    float opaque = end_of_line(BACK_TO_FRONT);
    if (REPAIR) {
        if ((flags[list.word] & FLAG_UNSORTED) == 0u) return;
        sort_list(list.begin, list.end);
    }
    clear_window();
    Sweep sweep = empty_sweep();
    if (RESUME) sweep = load_sweep(pixel, unpack_state(flags[list.word]));
    LayersAhead ahead = layers_from(list.pixel, uint(2.0 * push.half_extent.x), -3e38);
    uint nearest = ahead.next;
    if (LAYERS && RESUME) skip_layers(ahead, sweep.state.passed);

    Pending pending;
    begin_segment(pending, sweep.end, sweep.end, 0.0);
    Uncut rest = Uncut(sweep.end, sweep.end, vec2(0.0));
    // A turn for each pair and for each further piece of a segment. After the last one the window is emptied.
    uint i = list.from, last = LAST_CHUNK ? list.to + K : list.to;
    while ((i < last || pending.len > 0.0 || is_uncut(rest)) && sweep.sum.a < opaque) {
        if (pending.len == 0.0 && !is_uncut(rest)) {
            vec2 depths = leave(sweep, pending, pass_through(arrival(i, list.to, list.end)), drawn, list.world);
            if (LAYERS) {
                rest = Uncut(pending.front, pending.back, depths);
                pending.len = 0.0;
            }
            ++i;
        }
        if (LAYERS && pending.len == 0.0 && is_uncut(rest)) begin_uncut(rest, pending, ahead, CELL_SCALARS, list.world, sweep.sum);
        if (pending.len > 0.0) composite(sweep.sum, next_piece(pending, BACK_TO_FRONT, knots), BACK_TO_FRONT);
    }
    if (LAYERS && LAST_CHUNK && sweep.sum.a < opaque) pass_layers(ahead, 3e37, sweep.sum);
    // Devices may end a loop that takes too many turns, and go on after it. (Not the loop's own condition: compilers know that.)
    uint left = max(i, last) - i + uint(pending.len != 0.0 || is_uncut(rest));
    if (left != 0u && sweep.sum.a < opaque) atomicAdd(status[STATUS_CUT], 1u);

    imageStore(accumulation, pixel, sweep.sum);
    if (LAST_CHUNK) {
        bool unsorted = sweep.state.unsorted, over = overlaps(sweep, opaque);
        flags[list.word] = (unsorted ? FLAG_UNSORTED : 0u) | (REPAIR ? FLAG_REPAIRED : 0u) | (over ? FLAG_OVERLAPS : 0u);
        if (over) atomicAdd(status[STATUS_OVERLAPS], 1u);
        // Of repair the last round counts.
        if (unsorted) atomicAdd(status[REPAIR ? STATUS_UNREPAIRED : STATUS_OVERFLOW_PIXELS], REPAIR ? push.last_round : 1u);
    } else {
        store_window(pixel, sweep.last);
        sweep.state.begun = true;
        // Depths do not tell which surfaces were passed, where pairs leave out of order.
        sweep.state.passed = LAYERS ? min(ahead.next - nearest, MOST_LAYERS) : 0u;
        flags[list.word] = pack_state(sweep.state);
    }
}
