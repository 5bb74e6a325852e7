// entry compute COMPUTE
//
// Lists of what a pixel's line meets, for techniques that draw from them: for each pixel the faces or cells, in order of rank.
//
//   COMPUTE  one invocation a tile, from its bin (bins.glsl): which pixels of the tile its primitives cover, and where; counted, then
//            written. No other invocation has these pixels: ranks stay in order
//
//   cost  finds the pixels of a tile that a primitive covers from where its edges cross rows, twice
//
// Where pixels were drawn otherwise and only those that are flagged need lists (FLAGGED), the others have none.
//
// What has no room is counted, and the frame repeated with more.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "mesh/cell-scalars.glsl"
#include "shared/device.glsl"
#include "mesh/mesh.glsl"
#include "mesh/coverage.glsl"

layout(constant_id = SPEC_BACK_TO_FRONT) const bool BACK_TO_FRONT = false;
layout(constant_id = SPEC_FILL) const bool FILL = false;
layout(constant_id = SPEC_LISTED) const uint FLAGGED = 0; // FLAG_* of the pixels that are to have lists; 0: all

layout(local_size_x = 8) in;
layout(set = 0, binding = BINDING_BOXES, std430) readonly buffer Boxes { uvec2 boxes[]; };
layout(set = 0, binding = BINDING_BIN_ENDS, std430) readonly buffer BinEnds { uint bin_ends[]; };
layout(set = 0, binding = BINDING_BINS, std430) readonly buffer Bins { uint bins[]; };
layout(set = 0, binding = BINDING_CURSORS, std430) buffer Cursors { uint cursors[]; };
layout(set = 0, binding = BINDING_LISTS, std430) writeonly buffer Lists { uvec2 lists[]; }; // a face's fragment in one, a cell's in two
layout(set = 0, binding = BINDING_STATUS, std430) buffer Status { uint status[]; };
layout(set = 0, binding = BINDING_FLAGS, std430) readonly buffer Flags { uint flags[]; };

// The pixels of a tile that are to have lists.
uvec2 pixels_wanted(uint tile) {
    uvec2 wanted = uvec2(0u);
    uint at = tile * TILE_PIXELS;
    for (uint bit = 0u; bit < 32u; ++bit) {
        uvec2 word = uvec2(flags[at + bit], flags[at + bit + 32u]) & FLAGGED;
        wanted |= uvec2(notEqual(word, uvec2(0u))) << bit;
    }
    return wanted;
}

// Counters of all pixels, a bit of each in a mask.
uvec2 counts[COUNT_BITS];

// Counts pixels: adds with carry.
void count(uvec2 covered) {
    for (uint j = 0u; j < COUNT_BITS; ++j) {
        uvec2 carry = counts[j] & covered;
        counts[j] ^= covered;
        covered = carry;
    }
}

uint count_of(uint bit) {
    uint number = 0u;
    for (uint j = 0u; j < COUNT_BITS; ++j) number |= uint(has(counts[j], bit)) << j;
    return number;
}

void main() {
    uint in_band = INVOCATION_NUMBER, tile = push.band + in_band;
    if (in_band >= push.count) return;
    uvec2 origin = pixel_of(tile, 0u);
    vec2 line0 = line_at(vec2(origin) + 0.5);
    uint bin = tile - push.binned, begin = bin == 0u ? 0u : bin_ends[bin - 1u], bin_end = bin_ends[bin];
    uint first = min(begin + push.first, bin_end), end = min(bin_end, first + push.number);
    uvec2 wanted = uvec2(0xffffffffu);
    // Pixels beyond the image have no flags.
    uvec2 extent = uvec2(2.0 * push.half_extent);
    if (FLAGGED != 0u) wanted = pixels_wanted(tile) & pixels_of_box(extent << 16, origin);
    if ((wanted.x | wanted.y) == 0u) return;
    for (uint j = 0u; j < COUNT_BITS; ++j) counts[j] = uvec2(0u);

    uint lost = 0u, filled = 0u;
    for (uint i = first; i < end; ++i) {
        uint id = bins[i];
        Primitive primitive = primitive_of(id, line0);
        uvec2 covered = pixels_of(primitive) & pixels_of_box(boxes[id], origin) & wanted;
        if (!FILL) {
            count(covered);
            continue;
        }
        filled += uint(bitCount(covered.x) + bitCount(covered.y));
        for (uint turn = 0u; turn < TILE_PIXELS && (covered.x | covered.y) != 0u; ++turn) {
            bool lower = covered.x != 0u;
            uint word = mix(covered.y, covered.x, lower), bit = uint(findLSB(word)) + mix(32u, 0u, lower);
            covered = mix(uvec2(0u, word & word - 1u), uvec2(word & word - 1u, covered.y), bvec2(lower));
            uvec2 pixel = uvec2(bit % TILE, bit / TILE);
            uint slot = cursors[in_band * TILE_PIXELS + bit]++;
            if (slot >= push.capacity) {
                ++lost;
            } else if (CELLS) {
                uvec4 piece = floatBitsToUint(piece_of(id, primitive, pixel, line_at(vec2(origin) + 0.5 + vec2(pixel))));
                lists[2u * slot] = piece.xy;
                lists[2u * slot + 1u] = piece.zw;
            } else {
                lists[slot] = pair_of(id, primitive, pixel, BACK_TO_FRONT);
            }
        }
    }
    if (!FILL) {
        for (uint bit = 0u; bit < TILE_PIXELS; ++bit) cursors[in_band * TILE_PIXELS + bit] += count_of(bit);
    }
    if (lost > 0u) atomicAdd(status[STATUS_LOST], lost);
    if (filled > 0u) atomicAdd(status[STATUS_FILLED], filled);
}
