// entry compute COMPUTE
//
// Image-order ray casting, what the object-order techniques are compared with: the same reconstruction, the same
// integrators, the same end of a ray.
//
// A pixel's ray is cut into segments of equal length h from where it enters the domain (or from the eye); the
// last one is shorter. MIDPOINT classifies the scalar in the middle of a segment, the others integrate between
// its ends.
//
//   COMPUTE   one invocation walks a pixel's ray front to back in registers
//
//   in    volume, transfer function or its table
//   out   accumulation image: premultiplied linear RGBA
//   error as slices-3d (MIDPOINT) and slabs (others) of the same spacing along the ray
//   cost  per segment one fetch and one classification or integration
//
// Source: Levoy, 1988; Peikert, SciVis 2007, page 4-17.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "optics.glsl"
#include "grid.glsl"
#include "segments.glsl"

layout(constant_id = SPEC_RESUME) const bool RESUME = false;

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = BINDING_ACCUMULATION, rgba32f) uniform image2D accumulation;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, ivec2(2.0 * push.half_extent + 0.5)))) return;
    Ray ray = ray_of(vec2(pixel) + 0.5);
    vec2 interval = interval_of(ray);

    // Read once, before the loop: drivers do not take these loads out of it.
    Lattice lattice = load_lattice();
    BrickGrid brick_grid = load_bricks();
    uint knots = push.knots;
    float opaque = push.opaque;
    uint walk = slabs_between_looks(push.d0_h.w);
    load_segments();

    // Depth of one segment: lengths on the ray are in units of the smallest voxel spacing.
    float h = push.d0_h.w * push.unit / ray.length_per_depth;
    float z0 = interval.x;
    float segments = interval.x < interval.y ? ceil((interval.y - z0) / h) : 0.0;
    uint first = push.first, last = uint(min(segments, float(push.first + push.count)));

    vec4 sum = RESUME ? imageLoad(accumulation, pixel) : vec4(0.0);
    float transmittance = resumed(sum);
    uint i = first;
    while (i < last && transmittance > opaque) {
        uint stop = last;
        if (EMPTY_SPACE) {
            float until = empty_until(ray, fma(float(i), h, z0), interval.y, brick_grid);
            // Segments that end before there show nothing.
            i = clamp(uint(max(floor((until - z0) / h), 0.0)), i, last);
            stop = min(i + walk, last);
        }
        float front_texel = 0.0;
        End front;
        if (INTEGRATOR != INTEGRATOR_MIDPOINT) {
            front_texel = stored_at(ray, fma(float(i), h, z0), lattice);
            front = end_at(HAS_NAN && is_nan(front_texel) ? 0.0 : scalar_of(front_texel, lattice));
        }
        for (; i < stop && transmittance > opaque; ++i) {
            float begin = fma(float(i), h, z0), end = min(fma(float(i + 1u), h, z0), interval.y);
            float len = max(end - begin, 0.0) * ray.length_per_depth;
            vec4 emission;
            if (INTEGRATOR == INTEGRATOR_MIDPOINT) {
                float texel = stored_at(ray, 0.5 * (begin + end), lattice);
                vec4 optics = classify(scalar_of(texel, lattice), knots);
                emission = emission_of(optics.rgb, HAS_NAN && is_nan(texel) ? 0.0 : optics.a * len);
            } else {
                float texel = stored_at(ray, end, lattice);
                End back = end_at(HAS_NAN && is_nan(texel) ? 0.0 : scalar_of(texel, lattice));
                bool vacuum = HAS_NAN && (is_nan(front_texel) || is_nan(texel));
                emission = vacuum ? vec4(0.0) : segment(front, back, len, knots);
                front_texel = texel;
                front = back;
            }
            add_behind(sum, transmittance, emission);
        }
    }
    imageStore(accumulation, pixel, paused(sum, transmittance));
}
