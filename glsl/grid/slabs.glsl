// entry vertex   VERTEX
// entry fragment FRAGMENT
// entry fragment SHADER_BLEND
// entry compute  COMPUTE precise
//
// Pre-integrated slabs between view-aligned slices: samples the scalar on the front and back of a slab, then integrates the transfer
// function between the two.
//
// Slab i spans the depths [z0 + i h, z0 + (i + 1) h]; the domain and the eye clip it along a pixel's ray. The scalar is sampled where
// the ray enters and leaves the rest, and assumed linear in between.
//
//   VERTEX        one instance per slab: its outline in the image (slab-outline.glsl)
//   FRAGMENT      one slab of one pixel, blended by fixed function
//   SHADER_BLEND  the same, blended by the shader into a format of low precision with stochastic rounding
//   COMPUTE       one invocation owns a pixel and marches its slabs front to back in registers; the scalar at the back of a slab is
//                 the scalar at the front of the next
//
//   in    volume, transfer function or its table
//   out   colour attachment 0, packed texels (SHADER_BLEND) or the accumulation image (COMPUTE): premultiplied
//         linear RGBA
//   error second order in h where the field is smooth, whatever the transfer function; tables add their own; a
//         homogeneous domain is exact
//   cost  one fetch (raster: two) and one integration per slab and covered pixel
//
// Source: Engel, Kraus and Ertl, Graphics Hardware 2001; Peikert, SciVis 2007, page 4-19.
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
#include "grid/slab.glsl"

// Returns premultiplied colour and opacity of a piece of the ray between two faces, lit where the scene is.
vec4 slab_emission(Ray ray, vec2 piece, Face front, Face back, Lattice lattice, uint knots) {
    vec4 emission = between_faces(front, back, (piece.y - piece.x) * ray.length_per_depth, knots);
    return LIT ? lit(emission, ray, fma(emitted_at, piece.y - piece.x, piece.x), lattice) : emission;
}

#ifdef VERTEX
#include "grid/slab-outline.glsl"

layout(location = 0) flat out uint slab_out;

void main() {
    gl_Position = slab_corner(gl_InstanceIndex, gl_VertexIndex, slab_out);
}
#endif

#if defined(FRAGMENT) || defined(SHADER_BLEND)
#ifdef SHADER_BLEND
#include "grid/blend.glsl"
#else
#include "grid/blend-fixed.glsl"
#endif
#include "grid/interval.glsl"

layout(location = 0) flat in uint slab_in;

void main() {
    load_segments(push.knots);
    Ray ray = ray_of(gl_FragCoord.xy);
    Lattice lattice = load_lattice();
    vec2 piece = slab_piece(slab_begin(slab_in), slab_begin(slab_in + 1u), interval_of(ray, gl_FragCoord.xy));
    vec4 emission = vec4(0.0);
    if (piece.x < piece.y) {
        Face front = face_of(stored_at(ray, piece.x, lattice), lattice);
        Face back = face_of(stored_at(ray, piece.y, lattice), lattice);
        emission = slab_emission(ray, piece, front, back, lattice, push.knots);
    }
    blend(emission, slab_in);
}
#endif

#ifdef COMPUTE
#include "grid/march.glsl"

// Whether samples are taken in runs. Translucent surfaces split slabs, light takes samples around, and of a grid in pages slabs with whole ends
// lie beyond the last page.
const bool BEYOND = PAGED && !CLIP_ENDS, RUNS = !LAYERS && !LIT && !BEYOND;

void main() {
    ivec2 pixel;
    if (!own_pixel(pixel)) return;
    Ray ray = ray_of(vec2(pixel) + 0.5);
    vec2 interval = interval_of(ray, vec2(pixel));
    vec2 shown = shown_of(interval, pixel);
    uvec2 all = owned_slabs(slabs_of(shown), interval, pixel), slabs = slabs_ahead(all);

    // Load these before the loop: drivers do not hoist them.
    Lattice lattice = load_lattice();
    BrickGrid brick_grid = load_bricks();
    float h = push.d0_h.w, z0 = push.py_z0.w;
    uint knots = push.knots;
    float opaque = push.opaque;
    uint walk = slabs_between_looks(h);
    load_segments(knots);

    float transmittance;
    vec4 sum = begin_march(pixel, transmittance);
    LayersAhead ahead = begin_layers(pixel, fma(float(push.first), h, z0));
    float reached = before.reached, layers_until = layers_end(fma(float(push.first + push.count), h, z0));
    uint slab = slabs.x;
    uint known_front = knows(before.front, slab) ? before.front : UNKNOWN, known_back = UNKNOWN;
    while (slab < slabs.y && transmittance > opaque && !has_missed()) {
        float z = max(fma(float(slab), h, z0), shown.x);
        uint from = slab, stop = skip_empty(slab, slabs.y, z, z0, h, walk, ray, interval.y, brick_grid);
        if (slab != from) known_front = UNKNOWN;
        float texel = known_front != UNKNOWN ? uintBitsToFloat(known_front) : stored_at(ray, max(fma(float(slab), h, z0), interval.x), lattice);
        if (has_missed()) break;
        known_front = bits_of(texel);
        Face front = face_of(texel, lattice);
        if (RUNS) stop = run_on_pages(slab, stop, walk, min(fma(float(slab + 1u), h, z0), interval.y), h, ray, lattice);
        for (; slab < stop && transmittance > opaque && !has_missed(); ++slab) {
            vec2 piece = slab_piece(fma(float(slab), h, z0), fma(float(slab + 1u), h, z0), interval);
            float split = reached;
            bool cut = LAYERS && cut_at_layer(ahead, piece, split, opaque, sum, transmittance);
            float texel = RUNS                        ? stored_in_run(ray, piece.y, lattice)
                          : knows(before.back, slab) ? uintBitsToFloat(before.back)
                                                     : stored_at(ray, piece.y, lattice);
            if (has_missed()) break;
            before.back = UNKNOWN;
            Face back = face_of(texel, lattice);
            if (piece.x < piece.y) {
                vec4 emission = slab_emission(ray, piece, front, back, lattice, knots);
                known_back = bits_of(texel);
                if (has_missed()) break;
                known_back = UNKNOWN;
                add_part(pixel, sum, transmittance, emission, piece);
                front = back;
                known_front = bits_of(texel);
            }
            reached = split;
            // Where a surface splits a slab, the slab is taken again for the rest.
            if (cut) --slab;
        }
    }
    bool ends = ends_ray(pixel, slab, all.y, transmittance, opaque, reached, ahead, known_front, known_back);
    if (LAYERS && ends) end_layers(ahead, layers_until, opaque, sum, transmittance);
    end_march(pixel, sum, transmittance);
}
#endif
