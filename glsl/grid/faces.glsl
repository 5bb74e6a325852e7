// Segments between two positions on a ray through a grid.
#ifndef FACES_GLSL
#define FACES_GLSL

#include "shared/segments.glsl"
#include "grid/lattice.glsl"

// The stored value at a position on the ray, and the end of the segments that meet there.
struct Face {
    float texel;
    End end;
};

Face face_of(float texel, Lattice lattice) {
    return Face(texel, end_at(HAS_NAN && is_nan(texel) ? 0.0 : scalar_of(texel, lattice)));
}

// Returns premultiplied colour and opacity of the segment between two positions; vacuum where either is NaN.
vec4 between_faces(Face front, Face back, float len, uint knots) {
    if (HAS_NAN && (is_nan(front.texel) || is_nan(back.texel))) return vec4(0.0);
    return segment(front.end, back.end, len, knots);
}

#endif
