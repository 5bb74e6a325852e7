// A walk through the primitives that a pixel's line meets, in order of rank (mesh-tiles.glsl).
#ifndef TILE_WALK_GLSL
#define TILE_WALK_GLSL

#include "interface.glsl"
#include "mesh/coverage.glsl"

layout(set = 0, binding = BINDING_BIN_ENDS, std430) readonly buffer BinEnds { uint bin_ends[]; };
layout(set = 0, binding = BINDING_BINS, std430) readonly buffer Bins { uint bins[]; };
layout(set = 0, binding = BINDING_HITS, std430) readonly buffer Hits { uvec4 hits[]; };

struct Walk {
    uvec4 bits;      // of the pairs to come of HIT_PAIRS
    uint base;       // the first of these
    uint begin, end; // pairs of the walk
    uint met;        // primitives so far
};

bool has_pair(Walk walk) {
    return (walk.bits.x | walk.bits.y | walk.bits.z | walk.bits.w) != 0u;
}

// Bits of the words from a place on, of `number` bits in a row.
uvec4 bits_from(uint number) {
    ivec4 bit = int(number) - ivec4(0, 32, 64, 96);
    return mix(uvec4(0xffffffffu) << uvec4(max(bit, 0) & 31), uvec4(0u), greaterThan(bit, ivec4(31)));
}

// Which of the HIT_PAIRS pairs from `base` on are pairs of the walk that the pixel's line meets.
uvec4 hits_at(uint base, Walk walk, uint pixel) {
    uvec4 bits = hits[base / HIT_PAIRS * TILE_PIXELS + pixel];
    return bits & bits_from(max(walk.begin, base) - base) & ~bits_from(min(walk.end - base, HIT_PAIRS));
}

// Looks for the next pair that the pixel's line meets.
void look_ahead(inout Walk walk, uint pixel) {
    while (!has_pair(walk) && walk.base + HIT_PAIRS < walk.end) {
        walk.base += HIT_PAIRS;
        walk.bits = hits_at(walk.base, walk, pixel);
    }
}

// Whether the device has ended the search for the next pair early.
bool is_cut(Walk walk) {
    return !has_pair(walk) && walk.begin < walk.end && walk.base + HIT_PAIRS < walk.end;
}

// A walk that is to go through `number` pairs of the bin of a tile of the band, from `first` on.
Walk range_of(uint in_band, uint first, uint number) {
    uint begin = in_band == 0u ? 0u : bin_ends[in_band - 1u], end = bin_ends[in_band];
    begin += min(first, end - begin);
    end = begin + min(number, end - begin);
    // Wraps around before the first word.
    return Walk(uvec4(0u), begin / HIT_PAIRS * HIT_PAIRS - HIT_PAIRS, begin, end, 0u);
}

// The same, at the first pair that the pixel's line meets.
Walk walk_through(uint in_band, uint pixel, uint first, uint number) {
    Walk walk = range_of(in_band, first, number);
    if (walk.begin < walk.end) look_ahead(walk, pixel);
    return walk;
}

// Returns the primitive that the walk has come to, and goes on.
uint next_primitive(inout Walk walk, uint pixel) {
    bvec4 empty = equal(walk.bits, uvec4(0u));
    bvec3 before = bvec3(empty.x, all(empty.xy), all(empty.xyz)); // all words up to the first, second and third
    uint word = before.z ? walk.bits.w : before.y ? walk.bits.z : before.x ? walk.bits.y : walk.bits.x;
    uint pair = walk.base + 32u * (uint(before.x) + uint(before.y) + uint(before.z)) + uint(findLSB(word));
    // Clears the bit. (Of a word 0 nothing is left.)
    uvec4 less = walk.bits & (walk.bits - 1u);
    walk.bits = uvec4(less.x, before.x ? less.y : walk.bits.y, before.y ? less.z : walk.bits.z, before.z ? less.w : walk.bits.w);
    ++walk.met;
    look_ahead(walk, pixel);
    return bins[min(pair, walk.end - 1u)];
}

#endif
