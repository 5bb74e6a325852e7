// entry compute TILES
// entry compute REPAIR
//
// Hardware-assisted visibility sorting: faces come nearly sorted, a k-buffer in each pixel puts them in order, and what lies between
// two faces that leave it one after the other is integrated.
//
//   TILES   one invocation owns a pixel and walks through the faces that its line meets; the k-buffer is in registers, between dispatches
//           in storage images
//   REPAIR  the same for pixels whose pairs did not leave in order, from lists, which are sorted first
//
//   in    bins of faces by rank with their hits (mesh-tiles.glsl), or lists of faces by rank (mesh-lists.glsl); transfer function or its
//         table
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
#include "mesh/mesh-hit-depths.glsl"
#include "mesh/mesh-layers.glsl"
#include "mesh/havs-sweep.glsl"
#include "mesh/own-pixel.glsl"
#include "mesh/pixel-list.glsl"
#include "mesh/status.glsl"
#include "mesh/tile-walk.glsl"
#include "mesh/sweep-images.glsl"


layout(local_size_x = TILE_PIXELS) in;
layout(set = 0, binding = BINDING_FLAGS, std430) buffer Flags { uint flags[]; };

// A face at a depth, in the direction of ranks.
Pair pair_in(uvec2 listed) {
    return Pair(uintBitsToFloat(listed.x) * (BACK_TO_FRONT ? -1.0 : 1.0), listed.y);
}

#ifdef TILES
const bool REPAIRS = false;

layout(constant_id = SPEC_RESUME) const bool RESUME = false;
layout(constant_id = SPEC_LAST_CHUNK) const bool LAST_CHUNK = true;

// Whether the last pair waits for its corners, or has been asked for and comes next.
const uint CORNERS_NONE = 0u, CORNERS_WAIT = 1u, CORNERS_ASKED = 2u;

// The faces of a pixel's line that are still to come.
struct Source {
    Walk walk;
    uint pixel;
    FaceLine line;
    uint asks;  // CORNERS_*
    uint id;    // of the face that came last
    uvec2 pair; // of it, from its corners
};

Source source_of(OwnPixel own) {
    Source source;
    source.pixel = gl_LocalInvocationIndex;
    source.walk = walk_through(own.in_band, source.pixel, push.first, push.number);
    source.line = face_line(own);
    source.asks = CORNERS_NONE;
    return source;
}

bool has_next(Source source) {
    return has_pair(source.walk) || source.asks != CORNERS_NONE;
}

bool ended_early(Source source) {
    return is_cut(source.walk);
}

void count_drawn(Source source) {
    count_fragments(source.walk.met);
}

// Returns the next pair, unless it has to wait: then it comes after `ask_corners`.
Pair next_of(inout Source source) {
    bool asked = source.asks == CORNERS_ASKED;
    if (!asked) source.id = next_primitive(source.walk, source.pixel);
    uvec2 pair = BY_PLANES ? pair_of(source.id, source.line) : pair_by_corners(source.id, source.line, BACK_TO_FRONT);
    if (asked) pair = source.pair;
    source.asks = !asked && (pair.y & 3u) == SIDE_UNKNOWN ? CORNERS_WAIT : CORNERS_NONE;
    return pair_in(pair);
}

bool waits(Source source) {
    return source.asks == CORNERS_WAIT;
}

void ask_corners(inout Source source) {
    source.pair = pair_by_corners(source.id, source.line, BACK_TO_FRONT);
    source.asks = CORNERS_ASKED;
}
#endif

#ifdef REPAIR
const bool REPAIRS = true, RESUME = false, LAST_CHUNK = true;

layout(set = 0, binding = BINDING_LISTS, std430) buffer Lists { uvec2 lists[]; };

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
            Pair pair = pair_in(lists[min(from, max(end, 1u) - 1u)]);
            // It lets the least of the window out.
            if (from >= end) pair = Pair(EVERYTHING, 0u);
            Pair leaves = pass_through(pair);
            if (leaves.at != NOTHING && to < end) {
                unsorted = unsorted || leaves.at < last;
                last = leaves.at;
                lists[to++] = uvec2(floatBitsToUint(leaves.at * (BACK_TO_FRONT ? -1.0 : 1.0)), leaves.what);
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

Pair next_of(inout Source source) {
    return pair_in(lists[source.next++]);
}

bool waits(Source source) {
    return false;
}

void ask_corners(inout Source source) {}
#endif

void main() {
    OwnPixel own = own_pixel();
    if (!own.exists) return;
    if (REPAIRS && (flags[own.word] & FLAG_UNSORTED) == 0u) return;
    if (REPAIRS) forget_hit(number_of(own));
    ivec2 pixel = ivec2(own.pixel);
    load_segments(push.knots);
    uint knots = push.knots;
    vec2 drawn = drawn_depths(own.pixel);
    float opaque = end_of_line(BACK_TO_FRONT);
    Source source = source_of(own);
    // Most parts of a mesh do not meet most pixels.
    if (RESUME && !LAST_CHUNK && !has_next(source) && !ended_early(source)) return;
    clear_window();
    Sweep sweep = empty_sweep();
    if (RESUME) sweep = load_sweep(pixel, unpack_state(flags[own.word]));
    LayersAhead ahead = layers_from(own.pixel, uint(2.0 * push.half_extent.x), -3e38);
    uint nearest = ahead.next;
    if (LAYERS && RESUME) skip_layers(ahead, sweep.state.passed);

    Pending pending;
    begin_segment(pending, sweep.end, sweep.end, 0.0, 0.0);
    Uncut rest = Uncut(sweep.end, sweep.end, vec2(0.0));
    // A turn for each pair and for each further piece of a segment. After the last pair K turns empty the window, if anything is in it.
    uint held = LAST_CHUNK && (has_next(source) || RESUME) ? K : 0u;
    bool more = has_next(source);
    bool goes_on = true;
    while (goes_on) {
        while ((more || held > 0u || pending.len > 0.0 || is_uncut(rest)) && sweep.sum.a < opaque && !pending.waits && !waits(source)) {
            if (pending.len == 0.0 && !is_uncut(rest)) {
                // From the last one on comes what is greater than all: it lets the least of the window out.
                Pair pair = Pair(EVERYTHING, 0u);
                if (more) pair = next_of(source); else --held;
                more = has_next(source);
                if (!waits(source)) {
                    vec2 depths = leave(sweep, pending, pass_through(pair), drawn, own.world);
                    if (LAYERS) {
                        rest = Uncut(pending.front, pending.back, depths);
                        pending.len = 0.0;
                    }
                }
            }
            if (LAYERS && pending.len == 0.0 && is_uncut(rest)) begin_uncut(rest, pending, ahead, CELL_SCALARS, own.world, sweep.sum);
            if (pending.len > 0.0) add_next(sweep.sum, pending, own, BACK_TO_FRONT, knots);
        }
        goes_on = pending.waits || waits(source);
        for (uint once = 0u; once < uint(waits(source)); ++once) ask_corners(source);
        for (uint once = 0u; once < uint(pending.waits); ++once) add_thickest(sweep.sum, pending, own, BACK_TO_FRONT);
    }
    if (LAYERS && LAST_CHUNK && sweep.sum.a < opaque) pass_layers(ahead, 3e37, sweep.sum);
    // Devices may end a loop that takes too many turns, and go on after it. (Not the loop's own condition: compilers know that.)
    uint left = uint(has_next(source) || ended_early(source)) + held + uint(pending.len != 0.0 || is_uncut(rest));
    if (left != 0u && sweep.sum.a < opaque) atomicAdd(status[STATUS_CUT], 1u);

    count_drawn(source);
    imageStore(accumulation, pixel, sweep.sum);
    if (LAST_CHUNK) {
        bool unsorted = sweep.state.unsorted, over = overlaps(sweep, opaque);
        flags[own.word] = (unsorted ? FLAG_UNSORTED : 0u) | (REPAIRS ? FLAG_REPAIRED : 0u) | (over ? FLAG_OVERLAPS : 0u);
        if (over) atomicAdd(status[STATUS_OVERLAPS], 1u);
        // Of repair the last round counts.
        if (unsorted) atomicAdd(status[REPAIRS ? STATUS_UNREPAIRED : STATUS_OVERFLOW_PIXELS], REPAIRS ? push.last_round : 1u);
    } else {
        store_window(pixel, sweep.last);
        sweep.state.begun = true;
        // Depths do not tell which surfaces were passed, where pairs leave out of order.
        sweep.state.passed = LAYERS ? min(ahead.next - nearest, MOST_LAYERS) : 0u;
        flags[own.word] = pack_state(sweep.state);
    }
}
