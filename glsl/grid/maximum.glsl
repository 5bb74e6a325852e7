// entry compute COMPUTE precise
//
// Maximum intensity projection: a pixel shows colour and opacity of the greatest scalar on its ray, with the path of one voxel.
//
// A ray is sampled where it enters the domain, at equal distances h, and where it leaves. Bricks in which no scalar exceeds the greatest
// so far are skipped.
//
//   COMPUTE   one invocation owns a pixel and marches its ray in registers
//
//   in    volume, transfer function
//   out   accumulation image: premultiplied linear RGBA; the greatest scalar where another dispatch resumes
//   error the greatest scalar is low by at most h times half the field's slope along the ray; second order where the field is smooth
//   cost  one fetch per sample in bricks that may hold the greatest scalar
//
// Source: Wallis et al., Three-dimensional display in nuclear medicine, 1989.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"
#include "shared/optics.glsl"
#include "grid/grid.glsl"
#include "grid/volume.glsl"
#include "grid/march.glsl"

void main() {
    ivec2 pixel;
    if (!own_pixel(pixel)) return;
    Ray ray = ray_of(vec2(pixel) + 0.5);
    vec2 interval = interval_of(ray, vec2(pixel));

    // Load these before the loop: drivers do not hoist them.
    Lattice lattice = load_lattice();
    BrickGrid brick_grid = load_bricks();
    uint walk = slabs_between_looks(push.d0_h.w);

    float h = push.d0_h.w * push.unit / ray.length_per_depth;
    float z0 = interval.x;
    // Sample i lies at depth z0 + i h, the last one where the ray leaves.
    float samples = interval.x <= interval.y ? ceil((interval.y - z0) / h) + 1.0 : 0.0;
    uvec2 all = uvec2(push.first, min(samples, float(push.first + push.count))), ahead = slabs_ahead(all);
    if (RESUME) brick_grid.reached = imageLoad(accumulation, pixel).x;
    if (PAGED && before.slab > 0u) brick_grid.reached = before.transmittance;
    uint i = ahead.x;
    while (i < ahead.y && !has_missed()) {
        uint stop = skip_empty(i, ahead.y, fma(float(i), h, z0), z0, h, walk, ray, interval.y, brick_grid);
        for (; i < stop; ++i) {
            float texel = stored_at(ray, min(fma(float(i), h, z0), interval.y), lattice);
            if (has_missed()) break;
            float s = HAS_NAN && is_nan(texel) ? -3e38 : scalar_of(texel, lattice);
            brick_grid.reached = max(brick_grid.reached, s);
        }
    }

    LayersAhead none = LayersAhead(0u, 0u, 3e38);
    ends_ray(pixel, i, all.y, brick_grid.reached, -3.1e38, 0.0, none, UNKNOWN, UNKNOWN);
    vec4 shown = vec4(brick_grid.reached);
    if ((push.order & MARCH_CONTINUES) == 0u) {
        load_knots();
        vec4 optics = classify(brick_grid.reached, push.knots);
        shown = brick_grid.reached > -3e38 ? emission_of(optics.rgb, optics.a * push.unit) : vec4(0.0);
    }
    imageStore(accumulation, pixel, shown);
    add_counts();
}
