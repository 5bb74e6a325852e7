// entry vertex   VERTEX
// entry fragment FRAGMENT
// entry fragment SHADER_BLEND
// entry compute  COMPUTE precise
//
// View-aligned slices of a 3D texture, post-classified.
//
// Slice i represents the slab of depths [z0 + i h, z0 + (i + 1) h]. Along a pixel's ray the domain and the eye clip the slab. The
// scalar at the middle of the rest is classified; its extinction times the true length of that piece is the slice's optical depth.
//
//   VERTEX        one instance per slice: a polygon that covers the outline of the slice's slab (slab-outline.glsl)
//   FRAGMENT      one slice of one pixel, blended by fixed function
//   SHADER_BLEND  the same, blended by the shader into a format of low precision with stochastic rounding
//   COMPUTE       one invocation owns a pixel and marches its slices front to back in registers
//
//   in    volume, transfer function
//   out   colour attachment 0, packed texels (SHADER_BLEND) or the accumulation image (COMPUTE): premultiplied
//         linear RGBA
//   error second order in h where field and transfer function are smooth; a homogeneous domain is exact
//   cost  one fetch and one classification per slice and covered pixel
//
// Source: Cabral, Cam, Foran, VolVis 1994.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"
#include "shared/optics.glsl"
#include "grid/grid.glsl"
#include "grid/volume.glsl"
#include "grid/lighting.glsl"
#include "grid/slab.glsl"

// Returns premultiplied colour and opacity of a piece of the ray with the stored value of its middle, lit where the scene is.
vec4 slice_emission(float texel, Ray ray, vec2 piece, Lattice lattice, uint knots) {
    vec4 optics = classify(scalar_of(texel, lattice), knots);
    float tau = HAS_NAN && is_nan(texel) ? 0.0 : optics.a;
    // Multiply the lengths first, then the extinction: 0 * tau must stay 0.
    vec4 emission = emission_of(optics.rgb, tau * (max(piece.y - piece.x, 0.0) * ray.length_per_depth));
    return LIT ? lit(emission, ray, middle_of(piece), lattice) : emission;
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
    load_knots();
    Ray ray = ray_of(gl_FragCoord.xy);
    vec2 piece = slab_piece(slab_begin(slab_in), slab_begin(slab_in + 1u), interval_of(ray, gl_FragCoord.xy));
    Lattice lattice = load_lattice();
    blend(slice_emission(stored_at(ray, middle_of(piece), lattice), ray, piece, lattice, push.knots), slab_in);
}
#endif

#ifdef COMPUTE
#include "grid/march.glsl"

// Whether samples are taken in runs. Translucent surfaces split slabs, light takes samples around, and of a grid in pages slabs with whole ends
// lie beyond the last page.
const bool BEYOND = PAGED && !CLIP_ENDS, RUNS = !LAYERS && !LIT && !BEYOND;
const uint AT_ONCE = RUNS ? MOST_AT_ONCE : 1u;

void main() {
    ivec2 pixel;
    if (!own_pixel(pixel)) return;
    Ray ray = ray_of(vec2(pixel) + 0.5);
    vec2 interval = interval_of(ray, vec2(pixel));
    uvec2 all = owned_slabs(slabs_of(shown_of(interval, pixel)), interval, pixel), slabs = slabs_ahead(all);

    // Load these before the loop: drivers do not hoist them.
    Lattice lattice = load_lattice();
    BrickGrid brick_grid = load_bricks();
    float h = push.d0_h.w, z0 = push.py_z0.w;
    uint knots = push.knots;
    float opaque = push.opaque;
    uint walk = slabs_between_looks(h);
    load_knots();

    float transmittance;
    vec4 sum = begin_march(pixel, transmittance);
    LayersAhead ahead = begin_layers(pixel, fma(float(push.first), h, z0));
    float reached = before.reached, layers_until = layers_end(fma(float(push.first + push.count), h, z0));
    uint slab = slabs.x;
    while (slab < slabs.y && transmittance > opaque && !has_missed()) {
        float z = max(fma(float(slab), h, z0), interval.x);
        uint stop = skip_empty(slab, slabs.y, z, z0, h, walk, ray, interval.y, brick_grid);
        vec2 first = slab_piece(fma(float(slab), h, z0), fma(float(slab + 1u), h, z0), interval);
        if (RUNS) stop = run_on_pages(slab, stop, walk, middle_of(first), h, ray, lattice);
        for (; slab < stop && transmittance > opaque && !has_missed(); slab += AT_ONCE) {
            vec2 pieces[MOST_AT_ONCE];
            float texels[MOST_AT_ONCE];
            bool cut = false;
            float split = reached;
            for (uint k = 0u; k < AT_ONCE; ++k) {
                vec2 piece = slab_piece(fma(float(slab + k), h, z0), fma(float(slab + k + 1u), h, z0), interval);
                cut = LAYERS && cut_at_layer(ahead, piece, split, opaque, sum, transmittance);
                pieces[k] = piece;
                texels[k] = RUNS ? stored_in_run(ray, middle_of(piece), lattice) : stored_at(ray, middle_of(piece), lattice);
            }
            for (uint k = 0u; k < AT_ONCE; ++k) {
                bool drawn = AT_ONCE == 1u || slab + k < stop && transmittance > opaque;
                vec2 piece = drawn ? pieces[k] : pieces[k].xx;
                vec4 emission = slice_emission(texels[k], ray, piece, lattice, knots);
                if (has_missed()) break;
                add_part(pixel, sum, transmittance, emission, piece);
            }
            if (has_missed()) break;
            reached = split;
            if (cut) --slab;
        }
        slab = min(slab, stop);
    }
    bool ends = ends_ray(pixel, slab, all.y, transmittance, opaque, reached, ahead, UNKNOWN, UNKNOWN);
    if (LAYERS && ends) end_layers(ahead, layers_until, opaque, sum, transmittance);
    end_march(pixel, sum, transmittance);
}
#endif
