// Notes of the depths at which lines through a mesh become opaque.
#ifndef MESH_HIT_DEPTHS_GLSL
#define MESH_HIT_DEPTHS_GLSL

#include "frame/hit-depths.glsl"
#include "mesh/mesh-segments.glsl"
#include "mesh/own-pixel.glsl"

uint number_of(OwnPixel own) {
    return own.pixel.y * uint(2.0 * push.half_extent.x) + own.pixel.x;
}

// Adds a piece of a pending segment, of which `len` was left before and `pending.len` is now.
void add_piece(inout vec4 sum, vec4 piece, float len, Pending pending, OwnPixel own, bool back_to_front) {
    float before = 1.0 - sum.a;
    composite(sum, piece, back_to_front);
    note_hit(number_of(own), before, 1.0 - sum.a, pending.end - len / own.world, pending.end - pending.len / own.world);
}

// Adds the next piece of a pending segment, unless it has to wait.
void add_next(inout vec4 sum, inout Pending pending, OwnPixel own, bool back_to_front, uint knots) {
    float len = pending.len;
    vec4 piece = next_piece(pending, back_to_front, knots);
    add_piece(sum, piece, len, pending, own, back_to_front);
}

// Adds the piece that waits.
void add_thickest(inout vec4 sum, inout Pending pending, OwnPixel own, bool back_to_front) {
    float len = pending.len;
    vec4 piece = thickest_piece(pending, back_to_front);
    add_piece(sum, piece, len, pending, own, back_to_front);
}

// Notes a segment that was added whole, where the opacity was 1 - `before`, and is 1 - `after`. Where it matters the segment is taken again, piece
// by piece.
void note_segment(End front, End back, float d0, float d1, float before, float after, uint knots, OwnPixel own) {
    float at = uintBitsToFloat(HIT_AT);
    if (HIT_AT == 0u || before <= at || after > at) return;
    uint pixel = number_of(own);
    note_hit(pixel, before, after, d0, d1);
    Pending pending;
    begin_segment(pending, front, back, (d1 - d0) * own.world, d1);
    vec4 sum = vec4(0.0);
    for (uint turn = 0u; turn < 128u + knots && pending.len > 0.0; ++turn) {
        float len = pending.len, left = before * (1.0 - sum.a);
        take_piece(sum, pending, false, knots);
        note_hit(pixel, left, before * (1.0 - sum.a), d1 - len / own.world, d1 - pending.len / own.world);
    }
}

#endif
