// Clips the pieces of a pixel's ray through a mesh to the bounds of the ray.
#ifndef MESH_BOUNDS_GLSL
#define MESH_BOUNDS_GLSL

#include "frame/bounded.glsl"
#include "mesh/mesh.glsl"

// Between which depths the line of a pixel is drawn, but for the eye.
vec2 bounds_at(uvec2 pixel) {
    return bounds_of(pixel, uint(2.0 * push.half_extent.x));
}

// What of a piece lies between two depths; the scalar is linear.
void cut(inout Piece piece, vec2 bounds) {
    float inverse = 1.0 / max(piece.d1 - piece.d0, 1e-30), s = piece.s0, rise = piece.s1 - piece.s0;
    vec2 x = clamp((bounds - piece.d0) * inverse, 0.0, 1.0);
    if (bounds.x > piece.d0) piece.s0 = s + rise * x.x;
    if (bounds.y < piece.d1) piece.s1 = s + rise * x.y;
    piece.d0 = max(piece.d0, bounds.x);
    piece.d1 = min(piece.d1, bounds.y);
}

#endif
