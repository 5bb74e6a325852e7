// The pieces of rays that belong to the part of space that is drawn: those whose middle lies in it. Parts that fill space share out the pieces
// of the whole, so that their images, composited front to back, are its image.
#ifndef OWNED_GLSL
#define OWNED_GLSL

#include "interface.glsl"
#include "grid/grid.glsl"

layout(constant_id = SPEC_OWNED) const bool OWNED = false;

layout(set = 0, binding = BINDING_LINE_OWNED, std430) readonly buffer LineOwned { vec2 line_owned[]; };

// Narrows a range [x, y) of numbers of pieces, whose middles grow along the ray, to those that belong to the part of space. PIECE is the
// piece of the number `i`. (A macro, because techniques number their pieces each in its own way.)
#define KEEP_OWNED(RANGE, PIECE, PIXEL) \
    if (OWNED) { \
        vec2 owned = line_owned[uint(PIXEL.y) * sides_of(push.sides).x + uint(PIXEL.x)]; \
        uint first = RANGE.x; \
        for (int side = 0; side < 2; ++side) { \
            uint last = RANGE.y; \
            while (first < last) { \
                uint i = (first + last) / 2u; \
                if (middle_of(PIECE) < owned[side]) first = i + 1u; \
                else last = i; \
            } \
            RANGE[side] = first; \
        } \
    }

#endif
