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
#include "mesh/mesh.glsl"
#include "mesh/mesh-segments.glsl"
#include "mesh/mesh-layers.glsl"
#include "mesh/havs-sweep.glsl"

layout(constant_id = SPEC_RESUME) const bool RESUME = false;
layout(constant_id = SPEC_LAST_CHUNK) const bool LAST_CHUNK = true;
layout(constant_id = SPEC_REPAIR) const bool REPAIR = false;

layout(local_size_x = TILE_PIXELS) in;
layout(set = 0, binding = BINDING_CURSORS, std430) readonly buffer Cursors { uint cursors[]; };
layout(set = 0, binding = BINDING_LISTS, std430) buffer Lists { uvec2 lists[]; };
layout(set = 0, binding = BINDING_STATUS, std430) buffer Status { uint status[]; };
layout(set = 0, binding = BINDING_FLAGS, std430) buffer Flags { uint flags[]; };
layout(set = 0, binding = BINDING_ACCUMULATION, rgba32f) uniform image2D accumulation;
layout(set = 0, binding = BINDING_KBUFFER_0, rgba32f) uniform image2D kbuffer_0;
layout(set = 0, binding = BINDING_KBUFFER_1, rgba32f) uniform image2D kbuffer_1;
layout(set = 0, binding = BINDING_KBUFFER_2, rgba32f) uniform image2D kbuffer_2;
layout(set = 0, binding = BINDING_KBUFFER_3, rgba32f) uniform image2D kbuffer_3;

// The pairs of a place in the images; K above 7 takes two texels side by side.
void load_pairs(uint first, ivec2 texel) {
    vec4 pairs[4] = vec4[](imageLoad(kbuffer_0, texel), imageLoad(kbuffer_1, texel), imageLoad(kbuffer_2, texel), imageLoad(kbuffer_3, texel));
    for (uint j = 0u; j < 8u; ++j) {
        if (first + j < K) {
            vec2 pair = (j & 1u) == 0u ? pairs[j / 2u].xy : pairs[j / 2u].zw;
            window[first + j] = Pair(pair.x, floatBitsToUint(pair.y));
        }
    }
}

void main() {
    uint in_band = gl_WorkGroupID.x + gl_WorkGroupID.y * gl_NumWorkGroups.x;
    if (in_band >= push.count) return;
    uint tile = push.band + in_band;
    uvec2 place = pixel_of(tile, gl_LocalInvocationIndex);
    if (any(greaterThanEqual(vec2(place), 2.0 * push.half_extent))) return;
    ivec2 pixel = ivec2(place);

    load_segments(push.knots);
    uint knots = push.knots;
    vec2 drawn = drawn_depths(place);
    float world = length_of_depth(line_at(vec2(place) + 0.5));
    uint slot = in_band * TILE_PIXELS + gl_LocalInvocationIndex, word = tile * TILE_PIXELS + gl_LocalInvocationIndex;
    // After the lists are written, places are where lists end.
    uint i = slot == 0u ? 0u : cursors[slot - 1u], end = min(cursors[slot], push.capacity);
    uint size = end - min(i, end);
    uint stop = min(end, i + push.first + push.number);
    i = min(i + push.first, end);
    float opaque = BACK_TO_FRONT ? 2.0 : 1.0 - push.opaque; // from behind a line does not end

    Sweep sweep;
    sweep.sum = vec4(0.0);
    sweep.last = Pair(NOTHING, 0u);
    sweep.end = end_at(0.0);
    sweep.inside = 0;
    sweep.unsorted = false;
    sweep.overlaps = false;
    clear_window();
    if (REPAIR) {
        if ((flags[word] & FLAG_UNSORTED) == 0u) return;
        // Through the window again and again, until what leaves is in order; as many turns as every device makes in a dispatch.
        uint turns = max(30000u / max(size, 1u), 1u);
        bool unsorted = true;
        for (uint turn = 0u; turn < turns && unsorted; ++turn) {
            unsorted = false;
            clear_window();
            uint to = i;
            float last = NOTHING;
            for (uint from = i; from < end + K; ++from) {
                Pair leaves;
                uvec2 entry = lists[min(from, end - 1u)];
                Pair pair = Pair(uintBitsToFloat(entry.x) * (BACK_TO_FRONT ? -1.0 : 1.0), entry.y);
                if (from >= end) pair = Pair(EVERYTHING, 0u);
                leaves = pass_through(pair);
                if (leaves.at != NOTHING && to < end) {
                    unsorted = unsorted || leaves.at < last;
                    last = leaves.at;
                    lists[to++] = uvec2(floatBitsToUint(leaves.at * (BACK_TO_FRONT ? -1.0 : 1.0)), leaves.what);
                }
            }
        }
        clear_window();
    }
    if (RESUME) {
        load_pairs(0u, K > 7u ? ivec2(pixel.x * 2, pixel.y) : pixel);
        if (K > 7u) load_pairs(8u, ivec2(pixel.x * 2 + 1, pixel.y));
        vec4 rest = imageLoad(kbuffer_3, K > 7u ? ivec2(pixel.x * 2 + 1, pixel.y) : pixel);
        sweep.last = Pair(rest.z, floatBitsToUint(rest.w));
        sweep.end = end_at(scalar_of_pair(sweep.last));
        sweep.sum = imageLoad(accumulation, pixel);
        sweep.inside = bitfieldExtract(int(flags[word]), SWEEP_INSIDE_SHIFT, SWEEP_INSIDE_BITS);
        sweep.unsorted = (flags[word] & FLAG_UNSORTED) != 0u;
        sweep.overlaps = (flags[word] & 1u << SWEEP_OVERLAPS_BIT) != 0u;
    }
    LayersAhead ahead = layers_from(place, uint(2.0 * push.half_extent.x), -3e38);
    uint nearest = ahead.next;
    if (LAYERS && RESUME) skip_layers(ahead, flags[word] >> SWEEP_PASSED_SHIFT);
    Pending pending;
    begin_segment(pending, sweep.end, sweep.end, 0.0);
    Uncut rest = Uncut(sweep.end, sweep.end, vec2(0.0));
    // A turn for each pair and for each further piece of a segment. After the last one the window is emptied.
    uint last = LAST_CHUNK ? stop + K : stop;
    while ((i < last || pending.len > 0.0 || is_uncut(rest)) && sweep.sum.a < opaque) {
        if (pending.len == 0.0 && !is_uncut(rest)) {
            uvec2 entry = lists[min(i, max(end, 1u) - 1u)];
            Pair pair = Pair(uintBitsToFloat(entry.x) * (BACK_TO_FRONT ? -1.0 : 1.0), entry.y);
            // What is greater than all lets the least out.
            if (i >= stop) pair = Pair(EVERYTHING, 0u);
            vec2 depths = leave(sweep, pending, pass_through(pair), drawn, world);
            if (LAYERS) {
                rest = Uncut(pending.front, pending.back, depths);
                pending.len = 0.0;
            }
            ++i;
        }
        if (LAYERS && pending.len == 0.0 && is_uncut(rest)) begin_uncut(rest, pending, ahead, CELL_SCALARS, world, sweep.sum);
        if (pending.len > 0.0) composite(sweep.sum, next_piece(pending, BACK_TO_FRONT, knots), BACK_TO_FRONT);
    }
    if (LAYERS && LAST_CHUNK && sweep.sum.a < opaque) pass_layers(ahead, 3e37, sweep.sum);
    // Devices may end a loop that takes too many turns, and go on after it. (Not the loop's own condition: compilers know that.)
    uint left = max(i, last) - i + uint(pending.len != 0.0 || is_uncut(rest));
    if (left != 0u && sweep.sum.a < opaque) atomicAdd(status[STATUS_CUT], 1u);
    if (LAST_CHUNK) {
        // What is not in order tells nothing of overlaps.
        bool overlaps = (sweep.overlaps || (sweep.inside != 0 && sweep.sum.a < opaque)) && !sweep.unsorted;
        flags[word] = (sweep.unsorted ? FLAG_UNSORTED : 0u) | (REPAIR ? FLAG_REPAIRED : 0u) | (overlaps ? FLAG_OVERLAPS : 0u);
        if (overlaps) atomicAdd(status[STATUS_OVERLAPS], 1u);
        // Of repair the last round counts.
        bool counts = sweep.unsorted && (!REPAIR || push.last_round == 1u);
        if (counts) atomicAdd(status[REPAIR ? STATUS_UNREPAIRED : STATUS_OVERFLOW_PIXELS], 1u);
    } else {
        vec4 pairs[8];
        for (uint j = 0u; j < 16u; ++j) {
            Pair pair = j < K ? window[min(j, K)] : Pair(0.0, 0u);
            if (j == (K > 7u ? 15u : 7u)) pair = sweep.last;
            vec2 both = vec2(pair.at, uintBitsToFloat(pair.what));
            if ((j & 1u) == 0u) pairs[j / 2u].xy = both; else pairs[j / 2u].zw = both;
        }
        ivec2 texel = K > 7u ? ivec2(pixel.x * 2, pixel.y) : pixel;
        imageStore(kbuffer_0, texel, pairs[0]);
        imageStore(kbuffer_1, texel, pairs[1]);
        imageStore(kbuffer_2, texel, pairs[2]);
        imageStore(kbuffer_3, texel, pairs[3]);
        if (K > 7u) {
            imageStore(kbuffer_0, texel + ivec2(1, 0), pairs[4]);
            imageStore(kbuffer_1, texel + ivec2(1, 0), pairs[5]);
            imageStore(kbuffer_2, texel + ivec2(1, 0), pairs[6]);
            imageStore(kbuffer_3, texel + ivec2(1, 0), pairs[7]);
        }
        // Depths do not tell which surfaces were passed, where pairs leave out of order.
        uint passed = LAYERS ? min(ahead.next - nearest, MOST_LAYERS) : 0u;
        uint inside = uint(sweep.inside) & ((1u << SWEEP_INSIDE_BITS) - 1u);
        flags[word] = (sweep.unsorted ? FLAG_UNSORTED : 0u) | uint(sweep.overlaps) << SWEEP_OVERLAPS_BIT |
                      inside << SWEEP_INSIDE_SHIFT | passed << SWEEP_PASSED_SHIFT;
    }
    imageStore(accumulation, pixel, sweep.sum);
}
