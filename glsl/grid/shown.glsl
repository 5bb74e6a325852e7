// The depths between which a tile of the image shows anything (tile-intervals.glsl).
#ifndef SHOWN_GLSL
#define SHOWN_GLSL

#include "interface.glsl"
#include "grid/grid.glsl"

layout(constant_id = SPEC_BY_TILES) const bool BY_TILES = false;

layout(set = 0, binding = BINDING_TILE_INTERVALS, std430) readonly buffer TileIntervals {
    vec2 tile_intervals[];
};

// Returns the depths of the tile of a pixel; the first is greater where it shows nothing.
vec2 tile_interval_of(ivec2 pixel) {
    if (!BY_TILES) return vec2(-3e38, 3e38);
    return tile_intervals[tile_of(pixel)];
}

// Returns the part of an interval of depths in which a pixel shows anything; x is not below y where that is none. What lies outside need
// not be sampled.
vec2 shown_of(vec2 interval, ivec2 pixel) {
    return BY_TILES ? min(max(tile_interval_of(pixel), interval.x), interval.y) : interval;
}

#endif
