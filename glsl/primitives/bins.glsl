// entry compute COUNT
// entry compute EMIT
// entry compute ENDS
//
// Bins: the primitives of each tile, by rank, from which meshes and splats are drawn. Pairs of a tile and a primitive are emitted in order
// of rank; a stable sort by tile (radix-sort.glsl) between EMIT and ENDS keeps that order in each tile.
//
//   COUNT  one invocation a rank: the box of its primitive, and how many tiles it touches
//   EMIT   one invocation for BIN_PAIRS pairs, so that a large primitive is split: finds their primitives in the prefix sums of the
//          counts. Without FILL it only counts the pairs of each tile
//   ENDS   one invocation a tile: where its sorted pairs end
//
//   in    primitives by rank, the box of pixels that contains each
//   out   the bins, tile by tile, and where each ends
//
// Pairs beyond the capacity are left out, and the frame is repeated with more.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"
#include "shared/integers.glsl"
#include "shared/tile-pixels.glsl"

layout(constant_id = SPEC_FILL) const bool FILL = false;
layout(constant_id = SPEC_FLAGGED) const bool FLAGGED = false; // only primitives whose box contains a marked pixel

layout(push_constant) uniform BinsPush {
    uint across;   // tiles in a row of the image
    uint first;    // first tile of those that are binned
    uint tiles;    // their number
    uint count;    // primitives
    uint capacity; // pairs
} push;

layout(local_size_x = 64) in;

// The tiles that a box touches, of those that are binned: rows of `width` from `column` on, from which the first `skipped` are missing.
struct Touched {
    uint number, row, column, width, skipped;
};

// First and last row of the tiles that are binned.
uvec2 binned_rows() {
    return uvec2(quotient(push.first, push.across), quotient(push.first + push.tiles - 1u, push.across));
}

Touched touched_by(uvec2 box, uvec2 binned) {
    uint x0 = (box.x & 0xffffu) / TILE, x1 = ((box.x >> 16) + TILE - 1u) / TILE;
    uint y0 = (box.y & 0xffffu) / TILE, y1 = ((box.y >> 16) + TILE - 1u) / TILE;
    uint last = push.first + push.tiles - 1u, first_row = binned.x, last_row = binned.y;
    Touched tiles;
    tiles.row = max(y0, first_row);
    tiles.column = x0;
    tiles.width = x1 - x0;
    uint end = min(y1, last_row + 1u), rows = max(end, tiles.row) - tiles.row;
    // The first row may begin, and the last one end, within the box.
    uint begins = clamp(push.first - first_row * push.across, x0, x1), ends = clamp(last - last_row * push.across + 1u, x0, x1);
    tiles.skipped = tiles.row == first_row ? begins - x0 : 0u;
    uint cut = end == last_row + 1u ? x1 - ends : 0u, all = rows * tiles.width;
    tiles.number = all - min(all, tiles.skipped + cut);
    return tiles;
}

#ifdef COUNT
layout(set = 0, binding = BINDING_ORDER, std430) readonly buffer Order { uint order[]; };
layout(set = 0, binding = BINDING_BOXES, std430) readonly buffer Boxes { uvec2 boxes[]; };
layout(set = 0, binding = BINDING_BIN_OFFSETS, std430) writeonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = BINDING_RANKED_BOXES, std430) writeonly buffer RankedBoxes { uvec2 ranked_boxes[]; };
layout(set = 0, binding = BINDING_MARKED, std430) readonly buffer Marked { uvec2 marked[]; };

// Whether a box contains a marked pixel of the tiles that it touches; boxes of many tiles may without.
bool is_marked(uvec2 box, Touched tiles) {
    if (tiles.number > 4096u) return true;
    uvec2 at = uvec2(tiles.column + tiles.skipped, tiles.row);
    bool found = false;
    for (uint i = 0u; i < tiles.number && !found; ++i) {
        if (at.x == tiles.column + tiles.width) at = uvec2(tiles.column, at.y + 1u);
        found = (marked[at.y * push.across + at.x - push.first] & pixels_of_box(box, at * TILE)) != uvec2(0u);
        ++at.x;
    }
    return found;
}

void main() {
    uint rank = INVOCATION_NUMBER;
    if (rank >= push.count) return;
    uvec2 box = boxes[order[rank]];
    Touched touched = touched_by(box, binned_rows());
    ranked_boxes[rank] = box;
    offsets[rank] = !FLAGGED || is_marked(box, touched) ? touched.number : 0u;
}
#endif

#ifdef EMIT
layout(set = 0, binding = BINDING_ORDER, std430) readonly buffer Order { uint order[]; };
layout(set = 0, binding = BINDING_RANKED_BOXES, std430) readonly buffer RankedBoxes { uvec2 ranked_boxes[]; };
layout(set = 0, binding = BINDING_BIN_OFFSETS, std430) readonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = BINDING_SCAN_TOTAL, std430) readonly buffer Total { uint total[]; };
layout(set = 0, binding = BINDING_BIN_TILES, std430) buffer Tiles { uint tiles[]; };
layout(set = 0, binding = BINDING_BINS, std430) writeonly buffer Bins { uint bins[]; };

// Whether the pairs of a rank do not begin after a pair.
bool begins(uint rank, uint pair) {
    return rank < push.count && offsets[rank] <= pair;
}

// Returns the last rank, from `rank` on, whose pairs do not begin after this one. It has some, since the next one's do.
uint rank_of(uint rank, uint pair) {
    if (begins(rank + 1u, pair)) ++rank;
    // Further only at first, and where ranks have no pairs. (A loop: software rasterisers run through branches that no invocation takes.)
    for (uint once = 0u; once < uint(begins(rank + 1u, pair)); ++once) {
        uint span = 1u;
        while (begins(rank + span, pair)) {
            rank += span;
            span *= 2u;
        }
        while (span > 1u) {
            span /= 2u;
            if (begins(rank + span, pair)) rank += span;
        }
    }
    return rank;
}

void main() {
    uint first = INVOCATION_NUMBER * BIN_PAIRS, end = min(first + BIN_PAIRS, min(total[0], push.capacity));
    uint rank = 0u;
    uvec2 binned = binned_rows();
    for (uint pair = first; pair < end; ++pair) {
        rank = rank_of(rank, pair);
        Touched touched = touched_by(ranked_boxes[rank], binned);
        uint at = pair - offsets[rank] + touched.skipped;
        uint row = quotient(at, touched.width);
        uint tile = (touched.row + row) * push.across + touched.column + at - row * touched.width - push.first;
        if (FILL) {
            tiles[pair] = tile;
            bins[pair] = order[rank];
        } else {
            atomicAdd(tiles[tile], 1u);
        }
    }
}
#endif

#ifdef ENDS
layout(set = 0, binding = BINDING_SCAN_TOTAL, std430) readonly buffer Total { uint total[]; };
layout(set = 0, binding = BINDING_BIN_TILES, std430) readonly buffer Tiles { uint tiles[]; };
layout(set = 0, binding = BINDING_BIN_ENDS, std430) writeonly buffer Ends { uint bin_ends[]; };
layout(set = 0, binding = BINDING_STATUS, std430) buffer Status { uint status[]; };

// Returns the number of pairs of tiles up to one.
uint pairs_up_to(uint tile, uint pairs) {
    uint below = 0u, above = pairs;
    while (below < above) {
        uint middle = (below + above) / 2u;
        if (tiles[middle] <= tile) below = middle + 1u; else above = middle;
    }
    return below;
}

void main() {
    uint tile = INVOCATION_NUMBER;
    if (tile >= push.tiles) return;
    uint pairs = min(total[0], push.capacity), end = pairs_up_to(tile, pairs);
    bin_ends[tile] = end;
    if (tile == 0u && total[0] > push.capacity) atomicAdd(status[STATUS_LOST], total[0] - push.capacity);
    atomicMax(status[STATUS_LONGEST_BIN], end - (tile == 0u ? 0u : pairs_up_to(tile - 1u, pairs)));
}
#endif
