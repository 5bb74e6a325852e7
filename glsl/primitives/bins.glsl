// entry compute COMPUTE
//
// Bins: the primitives of each tile, by rank, from which the lists of meshes and the bins of splats are built.
//
//   COMPUTE  one invocation per run of ranks: finds the tiles that its primitives may cover, first to count them, then, after the
//            prefix sums of the counts, to write them (FILL). The sums run over the runs within a tile, so that each tile has its
//            primitives by rank without an atomic and without sorting by tile.
//
//   in    primitives by rank, the box of pixels that contains each
//   out   positions in the bins, tile by tile and run by run; the bins
//
// Entries beyond the capacity are counted, and the frame is repeated with more.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"

layout(constant_id = SPEC_FILL) const bool FILL = false;
layout(constant_id = SPEC_FLAGGED) const bool FLAGGED = false; // only where a frame has flagged pixels

layout(push_constant) uniform BinsPush {
    uint across;   // tiles in a row of the image
    uint first;    // first tile of those that are binned
    uint tiles;    // their number
    uint count;    // primitives
    uint number;   // primitives per run
    uint runs;
    uint capacity; // of the bins, entries
} push;

layout(local_size_x = 8) in;
layout(set = 0, binding = BINDING_ORDER, std430) readonly buffer Order { uint order[]; };
layout(set = 0, binding = BINDING_BOXES, std430) readonly buffer Boxes { uvec2 boxes[]; };
layout(set = 0, binding = BINDING_BIN_TABLE, std430) buffer BinTable { uint bin_table[]; };
layout(set = 0, binding = BINDING_BINS, std430) writeonly buffer Bins { uint bins[]; };
layout(set = 0, binding = BINDING_STATUS, std430) buffer Status { uint status[]; };

void main() {
    uint run = INVOCATION.x;
    uint runs = push.runs, capacity = push.capacity, across = push.across, first = push.first, tiles = push.tiles;
    if (run >= runs) return;
    if (FLAGGED && status[STATUS_OVERFLOW_PIXELS] == 0u) return;
    uint i = min(run * push.number, push.count), end = min(i + push.number, push.count);
    // One iteration per tile of a primitive, so that neighbouring runs stay in lockstep.
    uint id = 0u, x = 0u, y = 0u, x0 = 0u, x1 = 0u, y1 = 0u, lost = 0u;
    for (uint turn = 0u; turn < MOST_TURNS && (i < end || y < y1); ++turn) {
        if (y >= y1) {
            id = order[i++];
            uvec2 box = boxes[id];
            x0 = (box.x & 0xffffu) / TILE;
            x1 = ((box.x >> 16) + TILE - 1u) / TILE;
            y = (box.y & 0xffffu) / TILE;
            y1 = ((box.y >> 16) + TILE - 1u) / TILE;
            x = x0;
        }
        if (y < y1) {
            uint tile = y * across + x - first;
            if (tile < tiles) {
                uint place = tile * runs + run;
                uint slot = bin_table[place];
                bin_table[place] = slot + 1u;
                if (FILL && slot < capacity) bins[slot] = id;
                lost += uint(FILL && slot >= capacity);
            }
            ++x;
            if (x >= x1) {
                x = x0;
                ++y;
            }
        }
    }
    // The host keeps runs so short that every device completes the loop.
    lost += end - i + uint(y < y1);
    if (lost > 0u) atomicAdd(status[STATUS_LOST], lost);
}
