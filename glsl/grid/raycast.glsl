// entry compute COMPUTE precise
//
// Image-order ray casting, the baseline of the object-order techniques: the same reconstruction, the same integrators, the same early
// ray termination.
//
// A pixel's ray is divided into segments of equal length h from where it enters the domain (or from the eye); the last one is
// shorter. MIDPOINT classifies the scalar in the middle of a segment, the other integrators integrate between its ends.
//
//   COMPUTE   one invocation owns a pixel and marches its ray front to back in registers
//
//   in    volume, transfer function or its table
//   out   accumulation image: premultiplied linear RGBA
//   error that of slices-3d (MIDPOINT) or slabs (others) with the same spacing along the ray
//   cost  one fetch and one classification or integration per segment
//
// Source: Levoy, 1988; Peikert, SciVis 2007, page 4-17.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"
#include "shared/optics.glsl"
#include "shared/segments.glsl"
#include "grid/grid.glsl"
#include "grid/volume.glsl"
#include "grid/faces.glsl"
#include "grid/lighting.glsl"
#include "grid/march.glsl"

const uint AT_ONCE = LAYERS || LIT || INTEGRATOR != INTEGRATOR_MIDPOINT ? 1u : MOST_AT_ONCE;

void main() {
    ivec2 pixel;
    if (!own_pixel(pixel)) return;
    Ray ray = ray_of(vec2(pixel) + 0.5);
    vec2 interval = interval_of(ray, vec2(pixel));

    // Load these before the loop: drivers do not hoist them.
    Lattice lattice = load_lattice();
    BrickGrid brick_grid = load_bricks();
    uint knots = push.knots;
    float opaque = push.opaque;
    uint walk = slabs_between_looks(push.d0_h.w);
    load_segments(knots);

    // The depth of a segment: push.d0_h.w is its length in units of the smallest voxel spacing.
    float h = push.d0_h.w * push.unit / ray.length_per_depth;
    float z0 = interval.x;
    float segments = interval.x < interval.y ? ceil((interval.y - z0) / h) : 0.0;
    vec2 shown = shown_of(interval, pixel);
    float begin_at = floor((shown.x - z0) / h) - 1.0, end_at = min(segments, ceil((shown.y - z0) / h) + 1.0);
    uint first = uint(max(begin_at, float(push.first))), last = uint(clamp(end_at, 0.0, float(push.first + push.count)));

    float transmittance;
    vec4 sum = begin_march(pixel, transmittance);
    LayersAhead ahead = begin_layers(pixel, fma(float(first), h, z0));
    float reached = -3e38, layers_until = layers_end(fma(float(push.first + push.count), h, z0));
    uint i = first;
    while (i < last && transmittance > opaque) {
        uint stop = skip_empty(i, last, fma(float(i), h, z0), z0, h, walk, ray, interval.y, brick_grid);
        Face front;
        if (INTEGRATOR != INTEGRATOR_MIDPOINT) front = face_of(stored_at(ray, fma(float(i), h, z0), lattice), lattice);
        for (; i < stop && transmittance > opaque; i += AT_ONCE) {
            vec2 pieces[MOST_AT_ONCE];
            float texels[MOST_AT_ONCE];
            for (uint k = 0u; k < AT_ONCE; ++k) {
                vec2 piece = vec2(fma(float(i + k), h, z0), min(fma(float(min(i + k + 1u, last)), h, z0), interval.y));
                if (LAYERS && cut_at_layer(ahead, piece, reached, opaque, sum, transmittance)) --i;
                pieces[k] = piece;
                texels[k] = stored_at(ray, INTEGRATOR == INTEGRATOR_MIDPOINT ? 0.5 * (piece.x + piece.y) : piece.y, lattice);
            }
            for (uint k = 0u; k < AT_ONCE; ++k) {
                float begin = pieces[k].x, end = AT_ONCE == 1u || transmittance > opaque ? pieces[k].y : begin;
                float len = max(end - begin, 0.0) * ray.length_per_depth;
                vec4 emission;
                if (INTEGRATOR == INTEGRATOR_MIDPOINT) {
                    vec4 optics = classify(scalar_of(texels[k], lattice), knots);
                    emission = emission_of(optics.rgb, HAS_NAN && is_nan(texels[k]) ? 0.0 : optics.a * len);
                } else {
                    Face back = face_of(texels[k], lattice);
                    emission = between_faces(front, back, len, knots);
                    front = back;
                }
                if (LIT) emission = lit(emission, ray, fma(emitted_at, end - begin, begin), lattice);
                add_behind(sum, transmittance, emission);
            }
        }
    }
    if (LAYERS) end_layers(ahead, layers_until, opaque, sum, transmittance);
    end_march(pixel, sum, transmittance);
}
