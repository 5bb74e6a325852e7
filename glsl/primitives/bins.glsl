// entry compute COMPUTE
//
// The primitives of each tile, by rank: what lists of meshes and splats begin with.
//
//   COMPUTE  one invocation a run of ranks: which tiles its primitives may cover; first counted, then, with the counts summed up,
//            written. Runs are summed up within tiles, so that each tile has its primitives by rank without an atomic, and
//            nothing is sorted by tile.
//
//   in    primitives by rank, the pixels that each may cover
//   out   places in the bins, tile by tile and run by run; the bins
//
// What has no room is counted, and the frame repeated with more.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"

layout(constant_id = SPEC_FILL) const bool FILL = false;
layout(constant_id = SPEC_FLAGGED) const bool FLAGGED = false; // only where a frame has flagged pixels

layout(push_constant) uniform BinsPush {
    uint across;   // tiles in a row of the image
    uint first;    // first tile of those that are binned
    uint tiles;    // their number
    uint count;    // primitives
    uint number;   // of a run
    uint runs;
    uint capacity; // entries that the bins have room for
} push;

layout(local_size_x = 8) in;
layout(set = 0, binding = BINDING_ORDER, std430) readonly buffer Order { uint order[]; };
layout(set = 0, binding = BINDING_BOXES, std430) readonly buffer Boxes { uvec2 boxes[]; };
layout(set = 0, binding = BINDING_BIN_TABLE, std430) buffer BinTable { uint bin_table[]; };
layout(set = 0, binding = BINDING_BINS, std430) writeonly buffer Bins { uint bins[]; };
layout(set = 0, binding = BINDING_STATUS, std430) buffer Status { uint status[]; };

void main() {
    uint run = gl_GlobalInvocationID.x;
    uint runs = push.runs, capacity = push.capacity, across = push.across, first = push.first, tiles = push.tiles;
    if (run >= runs) return;
    if (FLAGGED && status[STATUS_OVERFLOW_PIXELS] == 0u) return;
    uint i = min(run * push.number, push.count), end = min(i + push.number, push.count);
    // One turn a tile of a primitive: runs next to each other stay in step.
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
    // Runs are made short enough for what every device makes of a loop.
    lost += end - i + uint(y < y1);
    if (lost > 0u) atomicAdd(status[STATUS_LOST], lost);
}
