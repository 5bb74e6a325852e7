// entry compute COMPUTE precise
// entry compute PILOT precise
//
// Image-order ray casting, the baseline of the object-order techniques: the same reconstruction, the same integrators, the same early
// ray termination.
//
// A pixel's ray is divided into segments of equal length h from where it enters the domain (or from the eye); the last one is
// shorter. MIDPOINT classifies the scalar in the middle of a segment, the other integrators integrate between its ends.
//
//   COMPUTE   one invocation owns a pixel and marches its ray front to back in registers
//   PILOT     one invocation owns a tile of 8 x 8 pixels and marches the ray of its centre, with the step of this dispatch: twice as
//             fine as that of the dispatch before, until the colour hardly changes (steps.glsl)
//
//   in    volume, transfer function or its table; COMPUTE: the step of each tile, where these differ
//   out   COMPUTE: accumulation image, premultiplied linear RGBA; PILOT: that colour for each step
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
#include "grid/tile-step.glsl"
#include "grid/pilots.glsl"

// Whether samples are taken in runs. Translucent surfaces split slabs, and light takes samples around.
const bool RUNS = !LAYERS && !LIT;
const uint AT_ONCE = RUNS && INTEGRATOR == INTEGRATOR_MIDPOINT ? MOST_AT_ONCE : 1u;

// The segments of a ray: segment i begins at depth z0 + i h. Those from `first` to before `end` show anything; `first` may be -1.
struct Segments {
    float z0, h;
    float first, end;
    float begin; // the depth up to which the tile shows nothing
};

// Divides an interval of a pixel's ray into segments of length `spacing`, in units of the smallest voxel spacing.
Segments segments_of(Ray ray, vec2 interval, ivec2 pixel, float spacing) {
    float h = spacing * push.unit / ray.length_per_depth;
    float z0 = interval.x;
    float segments = interval.x < interval.y ? ceil((interval.y - z0) / h) : 0.0;
    vec2 shown = shown_of(interval, pixel);
    return Segments(z0, h, floor((shown.x - z0) / h) - 1.0, min(segments, ceil((shown.y - z0) / h) + 1.0), shown.x);
}

// Returns the piece of the ray of a segment; the last of all, before segment `last`, ends at depth `far`.
vec2 segment(Segments all, uint i, uint last, float far) {
    return vec2(fma(float(i), all.h, all.z0), min(fma(float(min(i + 1u, last)), all.h, all.z0), far));
}

// Returns the depth of the sample that a segment's turn takes.
float sample_of(vec2 piece) {
    return INTEGRATOR == INTEGRATOR_MIDPOINT ? middle_of(piece) : piece.y;
}

// Marches the segments of a ray from `i` to before `last`, and leaves the number of the next in `i`. The last of all ends at depth `far`.
void march(ivec2 pixel, Ray ray, Segments all, float far, uint walk, inout uint i, uint last, inout LayersAhead ahead, inout float reached,
           out uvec2 known, inout vec4 sum, inout float transmittance) {
    float z0 = all.z0, h = all.h;
    known = uvec2(knows(before.front, i) ? before.front : UNKNOWN, UNKNOWN);
    // Load these before the loop: drivers do not hoist them.
    Lattice lattice = load_lattice();
    BrickGrid brick_grid = load_bricks();
    uint knots = push.knots;
    float opaque = push.opaque;
    load_segments(knots);

    while (i < last && transmittance > opaque && !has_missed()) {
        uint from = i, stop = skip_empty(i, last, max(fma(float(i), h, z0), all.begin), z0, h, walk, ray, far, brick_grid);
        if (i != from) known.x = UNKNOWN;
        Face front;
        if (INTEGRATOR != INTEGRATOR_MIDPOINT) {
            float texel = known.x != UNKNOWN ? uintBitsToFloat(known.x) : stored_at(ray, fma(float(i), h, z0), lattice);
            if (has_missed()) break;
            known.x = bits_of(texel);
            front = face_of(texel, lattice);
        }
        if (RUNS) stop = run_on_pages(i, stop, walk, sample_of(segment(all, i, last, far)), h, ray, lattice);
        for (; i < stop && transmittance > opaque && !has_missed(); i += AT_ONCE) {
            vec2 pieces[MOST_AT_ONCE];
            float texels[MOST_AT_ONCE];
            bool cut = false;
            float split = reached;
            for (uint k = 0u; k < AT_ONCE; ++k) {
                vec2 piece = segment(all, i + k, last, far);
                cut = LAYERS && cut_at_layer(ahead, piece, split, opaque, sum, transmittance);
                pieces[k] = piece;
                float at = sample_of(piece);
                texels[k] = RUNS                        ? stored_in_run(ray, at, lattice)
                            : knows(before.back, i + k) ? uintBitsToFloat(before.back)
                                                        : stored_at(ray, at, lattice);
            }
            if (has_missed()) break;
            if (PAGED) before.back = UNKNOWN;
            for (uint k = 0u; k < AT_ONCE; ++k) {
                bool drawn = AT_ONCE == 1u || i + k < stop && transmittance > opaque;
                vec2 piece = drawn ? pieces[k] : pieces[k].xx;
                float len = max(piece.y - piece.x, 0.0) * ray.length_per_depth;
                vec4 emission;
                if (INTEGRATOR == INTEGRATOR_MIDPOINT) {
                    vec4 optics = classify(scalar_of(texels[k], lattice), knots);
                    emission = emission_of(optics.rgb, HAS_NAN && is_nan(texels[k]) ? 0.0 : optics.a * len);
                } else {
                    Face back = face_of(texels[k], lattice);
                    emission = between_faces(front, back, len, knots);
                    front = back;
                }
                if (LIT) emission = lit(emission, ray, fma(emitted_at, piece.y - piece.x, piece.x), lattice);
                known.y = bits_of(texels[k]);
                if (has_missed()) break;
                add_part(pixel, sum, transmittance, emission, piece);
                known = uvec2(bits_of(texels[k]), UNKNOWN);
            }
            if (has_missed()) break;
            reached = split;
            if (cut) --i;
        }
        i = min(i, stop);
    }
}

#ifdef COMPUTE
void main() {
    ivec2 pixel;
    if (!own_pixel(pixel)) return;
    Ray ray = ray_of(vec2(pixel) + 0.5);
    vec2 interval = interval_of(ray, vec2(pixel));
    float spacing = step_of(pixel);
    Segments all = segments_of(ray, interval, pixel, spacing);
    float begin = float(push.first), end = float(push.first + push.count);
    uvec2 range = uvec2(max(all.first, begin), clamp(all.end, 0.0, end));
    KEEP_OWNED(range, segment(all, i, range.y, interval.y), pixel)
    uvec2 ahead_of = slabs_ahead(range);

    float transmittance;
    vec4 sum = begin_march(pixel, transmittance);
    LayersAhead ahead = begin_layers(pixel, fma(begin, all.h, all.z0));
    float layers_until = layers_end(fma(end, all.h, all.z0));
    float reached = before.reached;
    uvec2 known;
    uint i = ahead_of.x;
    march(pixel, ray, all, interval.y, slabs_between_looks(spacing), i, ahead_of.y, ahead, reached, known, sum, transmittance);
    bool ends = ends_ray(pixel, i, range.y, transmittance, push.opaque, reached, ahead, known.x, known.y);
    if (LAYERS && ends) end_layers(ahead, layers_until, push.opaque, sum, transmittance);
    end_march(pixel, sum, transmittance);
}
#endif

#ifdef PILOT
void main() {
    uint tile = WORKGROUP_NUMBER * TILE_PIXELS + gl_LocalInvocationIndex;
    ivec2 extent = ivec2(sides_of(push.sides)), tiles = (extent + TILE - 1) / TILE;
    if (tile >= uint(tiles.x * tiles.y)) return;
    float spacing = push.d0_h.w;
    uint level = push.first;
    if (level > 0u && pilots[tile].levels < level) return;
    if (level > 2u) {
        float change = max(pilots[tile].changes[level - 1u], pilots[tile].changes[level - 2u] / 16.0);
        if (change <= uintBitsToFloat(push.seed)) return;
    }

    ivec2 pixel = min(ivec2(int(tile) % tiles.x, int(tile) / tiles.x) * TILE + TILE / 2, extent - 1);
    Ray ray = ray_of(vec2(pixel) + 0.5);
    vec2 interval = interval_of(ray, vec2(pixel));
    Segments all = segments_of(ray, interval, pixel, spacing);

    float transmittance = 1.0;
    vec4 sum = vec4(0.0);
    LayersAhead ahead;
    float reached = -3e38;
    uvec2 known;
    uint i = uint(max(all.first, 0.0));
    march(pixel, ray, all, interval.y, slabs_between_looks(spacing), i, uint(max(all.end, 0.0)), ahead, reached, known, sum, transmittance);
    if (level > 0u) {
        vec4 difference = sum - pilots[tile].colour;
        float change = min(0.25 * dot(difference, difference), 1e30);
        pilots[tile].changes[level] = change;
        pilots[tile].changes[0] = level == 1u ? change : max(pilots[tile].changes[0], change);
    }
    pilots[tile].colour = sum;
    pilots[tile].levels = level + 1u;
    add_counts();
}
#endif
