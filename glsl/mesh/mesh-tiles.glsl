// entry compute MARK
// entry compute MASKS
// entry compute HITS
//
// A bit tells for each pixel and each primitive of its tile's bin (bins.glsl, the bins of a band) whether the pixel's line meets the
// primitive. Techniques walk through the bits in order of rank (tile-walk.glsl), and find the place when they come to it.
//
//   MARK   one invocation a pixel: marks the flagged pixels of the band's tiles, where only these are drawn again
//   MASKS  one invocation a pair of a tile and a primitive: the pixels of the tile that it covers
//   HITS   one invocation for a row of pixels and 32 pairs: turns masks of pixels, in place, into a word for each pixel, whose bits are
//          pairs; the words of a pixel for HIT_PAIRS pairs lie side by side
//
//   cost   finds the pixels that a primitive covers from where its edges cross rows, once; 8 bytes a pair
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"
#include "mesh/mesh.glsl"
#include "mesh/coverage.glsl"
#include "mesh/own-pixel.glsl"
#include "shared/tile-pixels.glsl"

layout(constant_id = SPEC_LISTED) const uint LISTED = 0; // FLAG_* of the pixels whose tiles need hits; 0: all tiles do

layout(local_size_x = 64) in;

#ifdef MARK
layout(set = 0, binding = BINDING_FLAGS, std430) readonly buffer Flags { uint flags[]; };
layout(set = 0, binding = BINDING_MARKED, std430) buffer Marked { uint marked[]; };

void main() {
    OwnPixel own = own_pixel();
    uint bit = gl_LocalInvocationIndex;
    if (own.exists && (flags[own.word] & LISTED) != 0u) atomicOr(marked[2u * own.in_band + bit / 32u], 1u << bit % 32u);
}
#endif

#ifdef MASKS
layout(set = 0, binding = BINDING_BIN_ENDS, std430) readonly buffer BinEnds { uint bin_ends[]; };
layout(set = 0, binding = BINDING_MARKED, std430) readonly buffer Marked { uvec2 marked[]; };
layout(set = 0, binding = BINDING_BOXES, std430) readonly buffer Boxes { uvec2 boxes[]; };
layout(set = 0, binding = BINDING_BIN_TILES, std430) readonly buffer Tiles { uint tiles[]; };
layout(set = 0, binding = BINDING_BINS, std430) readonly buffer Bins { uint bins[]; };
layout(set = 0, binding = BINDING_HITS, std430) writeonly buffer Hits { uvec2 masks[]; }; // masks until HITS

void main() {
    uint pair = INVOCATION_NUMBER;
    if (pair >= bin_ends[push.count - 1u]) return;
    uint id = bins[pair], tile = tiles[pair];
    bool needed = LISTED == 0u || marked[tile] != uvec2(0u);
    // (A loop: software rasterisers run through branches that no invocation takes.)
    for (uint needs = 0u; needs < uint(needed); ++needs) {
        uvec2 origin = pixel_of(push.band + tile, 0u);
        Primitive primitive = primitive_of(id, line_at(vec2(origin) + 0.5));
        uvec2 pixels = pixels_of(primitive);
        // Of what lies before the eye its edges tell all; the box keeps out what is behind.
        bool behind = reaches_behind_eye(primitive);
        for (uint once = 0u; once < uint(behind); ++once) pixels &= pixels_of_box(boxes[id], origin);
        masks[pair] = pixels;
    }
}
#endif

#ifdef HITS
layout(set = 0, binding = BINDING_BIN_ENDS, std430) readonly buffer BinEnds { uint bin_ends[]; };
layout(set = 0, binding = BINDING_HITS, std430) buffer Hits { uint hits[]; }; // the masks before

// The bytes of a row of four masks.
uint rows_of(uint pair, uint row) {
    uint four = 0u;
    for (uint i = 0u; i < 4u; ++i) four |= (hits[2u * (pair + i) + row / 4u] >> 8u * (row % 4u) & 0xffu) << 8u * i;
    return four;
}

void main() {
    // The masks of 32 pairs have as many words as 64 pixels.
    uint block = INVOCATION_NUMBER / TILE, row = INVOCATION_NUMBER % TILE;
    bool exists = block * 32u < bin_ends[push.count - 1u];
    uvec4 low = uvec4(0u), high = uvec4(0u);
    for (uint i = 0u; i < 32u && exists; i += 8u) {
        // A square of 8 by 8 bits, a byte for each pair, is transposed in squares of 2, 4 and 8.
        uint a = rows_of(block * 32u + i, row), b = rows_of(block * 32u + i + 4u, row);
        uvec2 both = uvec2(a, b);
        uvec2 swapped = (both ^ both >> 7) & 0x00aa00aau;
        both ^= swapped ^ swapped << 7;
        swapped = (both ^ both >> 14) & 0x0000ccccu;
        both ^= swapped ^ swapped << 14;
        uint across = (both.x ^ both.y << 4) & 0xf0f0f0f0u;
        both ^= uvec2(across, across >> 4);
        low |= (uvec4(both.x) >> uvec4(0u, 8u, 16u, 24u) & 0xffu) << i;
        high |= (uvec4(both.y) >> uvec4(0u, 8u, 16u, 24u) & 0xffu) << i;
    }
    // The invocations of HIT_PAIRS are in one workgroup: when all have read, they write.
    memoryBarrierBuffer();
    barrier();
    if (!exists) return;
    const uint WORDS = HIT_PAIRS / 32u; // of a pixel, side by side
    uint at = (block / WORDS * TILE_PIXELS + row * TILE) * WORDS + block % WORDS;
    for (uint i = 0u; i < 4u; ++i) {
        hits[at + i * WORDS] = low[i];
        hits[at + (i + 4u) * WORDS] = high[i];
    }
}
#endif
