// A walk through the primitives that a pixel's line meets, in order of rank (mesh-tiles.glsl).
#ifndef TILE_WALK_GLSL
#define TILE_WALK_GLSL

#include "interface.glsl"
#include "mesh/coverage.glsl"

layout(set = 0, binding = BINDING_BIN_ENDS, std430) readonly buffer BinEnds { uint bin_ends[]; };
layout(set = 0, binding = BINDING_BINS, std430) readonly buffer Bins { uint bins[]; };
layout(set = 0, binding = BINDING_HITS, std430) readonly buffer Hits { uint hits[]; };

struct Walk {
    uint bits;      // of the pairs to come of 32
    uint base;      // the first of these
    uint begin, end; // pairs of the walk
    uint met;        // primitives so far
};

// Which of the 32 pairs from `base` on are pairs of the walk that the pixel's line meets.
uint hits_at(uint base, Walk walk, uint pixel) {
    uint bits = hits[base / 32u * TILE_PIXELS + pixel];
    if (base < walk.begin) bits &= 0xffffffffu << (walk.begin - base);
    if (walk.end - base < 32u) bits &= (1u << (walk.end - base)) - 1u;
    return bits;
}

// Looks for the next pair that the pixel's line meets.
void look_ahead(inout Walk walk, uint pixel) {
    while (walk.bits == 0u && walk.base + 32u < walk.end) {
        walk.base += 32u;
        walk.bits = hits_at(walk.base, walk, pixel);
    }
}

// Whether the device has ended the search for the next pair early.
bool is_cut(Walk walk) {
    return walk.bits == 0u && walk.begin < walk.end && walk.base + 32u < walk.end;
}

// A walk that is to go through `number` pairs of the bin of a tile of the band, from `first` on.
Walk range_of(uint in_band, uint first, uint number) {
    uint begin = in_band == 0u ? 0u : bin_ends[in_band - 1u], end = bin_ends[in_band];
    begin = min(begin + first, end);
    end = begin + min(number, end - begin);
    // Wraps around before the first word.
    return Walk(0u, (begin & ~31u) - 32u, begin, end, 0u);
}

// The same, at the first pair that the pixel's line meets.
Walk walk_through(uint in_band, uint pixel, uint first, uint number) {
    Walk walk = range_of(in_band, first, number);
    if (walk.begin < walk.end) look_ahead(walk, pixel);
    return walk;
}

// Returns the primitive that the walk has come to, and goes on.
uint next_primitive(inout Walk walk, uint pixel) {
    uint pair = walk.base + uint(findLSB(walk.bits));
    walk.bits &= walk.bits - 1u;
    ++walk.met;
    look_ahead(walk, pixel);
    return bins[min(pair, walk.end - 1u)];
}

#endif
