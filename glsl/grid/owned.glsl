// The pieces of rays that belong to the part of space that is drawn: those whose middle lies in it. Parts that fill space share out the pieces
// of the whole, so that their images, composited front to back, are its image.
#ifndef OWNED_GLSL
#define OWNED_GLSL

#include "interface.glsl"
#include "grid/grid.glsl"

layout(constant_id = SPEC_OWNED) const bool OWNED = false;

layout(set = 0, binding = BINDING_LINE_OWNED, std430) readonly buffer LineOwned { vec2 line_owned[]; };

// The depths between which the part of space lies on the pixel's ray.
vec2 owned = vec2(-3e38, 3e38);

// Most pieces at each end of a part that overlap it or border on it, and whose middle may lie outside.
const uint MOST_BESIDE = 4u;

// Narrows an interval to the part of space; x is not below y where nothing is left. Nothing outside needs samples.
vec2 owned_of(vec2 interval, ivec2 pixel) {
    if (!OWNED) return interval;
    owned = line_owned[uint(pixel.y) * sides_of(push.sides).x + uint(pixel.x)];
    return vec2(max(interval.x, owned.x), min(interval.y, owned.y));
}

bool owns(vec2 piece) {
    float middle = 0.5 * (piece.x + piece.y);
    return middle >= owned.x && middle < owned.y;
}

// Narrows a range [x, y) of numbers of pieces to those that belong to the part of space, whose ends it may reach beyond. PIECE is the piece
// of the number `i`. (A macro, because techniques number their pieces each in its own way.)
#define KEEP_OWNED(RANGE, PIECE) \
    for (uint turn = 0u; OWNED && turn < MOST_BESIDE && RANGE.x < RANGE.y; ++turn) { \
        uint i = RANGE.x; \
        if (owns(PIECE)) break; \
        ++RANGE.x; \
    } \
    for (uint turn = 0u; OWNED && turn < MOST_BESIDE && RANGE.x < RANGE.y; ++turn) { \
        uint i = RANGE.y - 1u; \
        if (owns(PIECE)) break; \
        --RANGE.y; \
    }

#endif
