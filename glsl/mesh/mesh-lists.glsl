// entry compute COUNT
// entry compute FILL
//
// Lists of what a pixel's line meets, for techniques that sort it: for each pixel the faces or cells, in order of rank. One workgroup is a
// tile of the band, one invocation a pixel.
//
//   COUNT  counts the primitives that the pixel's line meets
//   FILL   walks through them, and writes where the line meets each, from the prefix sum of the counts on
//
//   in     bins of primitives by rank with their hits (mesh-tiles.glsl)
//   out    lists, and where each ends
//   cost   four words of hits for 128 pairs, twice; an intersection for each entry
//
// Where pixels were drawn otherwise and only those that are flagged need lists (LISTED), the others have none. What has no room is counted,
// and the frame repeated with more.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "mesh/cell-scalars.glsl"
#include "mesh/coverage.glsl"
#include "mesh/mesh.glsl"
#include "mesh/own-pixel.glsl"
#include "mesh/tile-walk.glsl"

layout(constant_id = SPEC_BACK_TO_FRONT) const bool BACK_TO_FRONT = false;
layout(constant_id = SPEC_LISTED) const uint LISTED = 0; // FLAG_* of the pixels that are to have lists; 0: all

layout(local_size_x = TILE_PIXELS) in;
layout(set = 0, binding = BINDING_CURSORS, std430) buffer Cursors { uint cursors[]; };
layout(set = 0, binding = BINDING_STATUS, std430) buffer Status { uint status[]; };
layout(set = 0, binding = BINDING_FLAGS, std430) readonly buffer Flags { uint flags[]; };

bool has_list(OwnPixel own) {
    if (!own.exists) return false;
    return LISTED == 0u || (flags[own.word] & LISTED) != 0u;
}

#ifdef COUNT
void main() {
    OwnPixel own = own_pixel();
    if (own.in_band >= push.count) return;
    uint number = 0u;
    if (has_list(own)) {
        Walk walk = range_of(own.in_band, 0u, 0xffffffffu);
        uint base = walk.begin / HIT_PAIRS * HIT_PAIRS;
        for (; base < walk.end; base += HIT_PAIRS) {
            ivec4 met = bitCount(hits_at(base, walk, gl_LocalInvocationIndex));
            number += uint(met.x + met.y + met.z + met.w);
        }
        // Devices may end a loop that takes too many turns.
        if (base < walk.end) atomicAdd(status[STATUS_CUT], 1u);
    }
    if (push.number != 0u) number += cursors[cursor_of(own)];
    cursors[cursor_of(own)] = number;
}
#endif

#ifdef FILL
layout(set = 0, binding = BINDING_LISTS, std430) writeonly buffer Lists { uvec2 lists[]; }; // a face's fragment in one, a cell's in two

void main() {
    OwnPixel own = own_pixel();
    if (!has_list(own)) return;
    uint pixel = gl_LocalInvocationIndex, cursor = cursor_of(own), slot = cursors[cursor];
    FaceLine line = face_line(own);
    Walk walk = walk_through(own.in_band, pixel, 0u, 0xffffffffu);
    while (has_pair(walk) && slot < push.capacity) {
        uint id = next_primitive(walk, pixel);
        if (CELLS) {
            uvec4 piece = floatBitsToUint(piece_of(id, primitive_of(id, line.line0), line.pixel, line.line));
            lists[2u * slot] = piece.xy;
            lists[2u * slot + 1u] = piece.zw;
        } else {
            uvec2 pair = BY_PLANES ? pair_of(id, line) : uvec2(0u);
            bool asks = (pair.y & 3u) == SIDE_UNKNOWN;
            for (uint once = 0u; once < uint(asks); ++once) pair = pair_by_corners(id, line, BACK_TO_FRONT);
            lists[slot] = pair;
        }
        ++slot;
    }
    cursors[cursor] = slot;
    if (has_pair(walk)) atomicAdd(status[slot < push.capacity ? STATUS_CUT : STATUS_LOST], 1u);
    if (is_cut(walk)) atomicAdd(status[STATUS_CUT], 1u);
}
#endif
