// entry vertex   VERTEX
// entry fragment FRAGMENT
// entry fragment SHADER_BLEND
// entry compute  COMPUTE
//
// Pre-integrated slabs between view-aligned slices: first the scalar on the front and on the back of a slab, then,
// dependent on both, the transfer function integrated between them.
//
// Slab i is that of depths [z0 + i h, z0 + (i + 1) h], cut along a pixel's ray to the domain and to the eye. The
// scalar is taken where the ray enters and leaves what is left, and as linear in between.
//
//   VERTEX        one instance a slab: its outline in the image (slab.glsl)
//   FRAGMENT      one slab of one pixel, blended by fixed function
//   SHADER_BLEND  the same, blended by the shader into a format of low precision, rounded at random
//   COMPUTE       one invocation owns a pixel and walks its slabs front to back in registers; the scalar at a
//                 slab's back is that at the next one's front
//
//   in    volume, transfer function or its table
//   out   colour attachment 0, packed texels (SHADER_BLEND) or the accumulation image (COMPUTE): premultiplied
//         linear RGBA
//   error second order in h where the field is smooth, whatever the transfer function; tables add their own; a
//         homogeneous domain is exact
//   cost  per slab and covered pixel one fetch (raster: two) and one integration
//
// Source: Engel, Kraus and Ertl, Graphics Hardware 2001; Peikert, SciVis 2007, page 4-19.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "optics.glsl"
#include "grid.glsl"
#include "segments.glsl"
#include "slab.glsl"

layout(constant_id = SPEC_RESUME) const bool RESUME = false;

// A place on the ray with what the integration needs of it.
struct Face {
    float texel;
    End end;
};

Face face_at(Ray ray, float z, Lattice lattice) {
    float texel = stored_at(ray, z, lattice);
    return Face(texel, end_at(HAS_NAN && is_nan(texel) ? 0.0 : scalar_of(texel, lattice)));
}

// Premultiplied colour and opacity of the slab's piece between two places.
vec4 slab_emission(Face front, Face back, float len, uint knots) {
    if (HAS_NAN && (is_nan(front.texel) || is_nan(back.texel))) return vec4(0.0);
    return segment(front.end, back.end, len, knots);
}

#ifdef VERTEX
layout(location = 0) flat out uint slab_out;

void main() {
    gl_Position = slab_corner(gl_InstanceIndex, gl_VertexIndex, slab_out);
}
#endif

#if defined(FRAGMENT) || defined(SHADER_BLEND)
#include "blend.glsl"
layout(location = 0) flat in uint slab_in;

void main() {
    load_segments();
    Ray ray = ray_of(gl_FragCoord.xy);
    Lattice lattice = load_lattice();
    vec2 piece = slab_piece(slab_begin(slab_in), slab_begin(slab_in + 1u), interval_of(ray));
    vec4 emission = vec4(0.0);
    if (piece.x < piece.y) {
        emission = slab_emission(face_at(ray, piece.x, lattice), face_at(ray, piece.y, lattice),
                                 (piece.y - piece.x) * ray.length_per_depth, push.knots);
    }
    blend(emission, slab_in);
}
#endif

#ifdef COMPUTE
layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = BINDING_ACCUMULATION, rgba32f) uniform image2D accumulation;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, ivec2(2.0 * push.half_extent + 0.5)))) return;
    Ray ray = ray_of(vec2(pixel) + 0.5);
    vec2 interval = interval_of(ray);
    uvec2 slabs = slabs_of(interval);

    // Read once, before the loop: drivers do not take these loads out of it.
    Lattice lattice = load_lattice();
    BrickGrid brick_grid = load_bricks();
    float h = push.d0_h.w, z0 = push.py_z0.w;
    uint knots = push.knots;
    float opaque = push.opaque;
    uint walk = slabs_between_looks(h);
    load_segments();

    vec4 sum = RESUME ? imageLoad(accumulation, pixel) : vec4(0.0);
    float transmittance = resumed(sum);
    uint slab = slabs.x;
    while (slab < slabs.y && transmittance > opaque) {
        uint stop = slabs.y;
        if (EMPTY_SPACE) {
            float until = empty_until(ray, max(fma(float(slab), h, z0), interval.x), interval.y, brick_grid);
            // Slabs that end before there show nothing.
            slab = clamp(uint(max(floor((until - z0) / h), 0.0)), slab, slabs.y);
            stop = min(slab + walk, slabs.y);
        }
        Face front = face_at(ray, max(fma(float(slab), h, z0), interval.x), lattice);
        for (; slab < stop && transmittance > opaque; ++slab) {
            vec2 piece = slab_piece(fma(float(slab), h, z0), fma(float(slab + 1u), h, z0), interval);
            Face back = face_at(ray, piece.y, lattice);
            if (piece.x < piece.y) {
                float len = (piece.y - piece.x) * ray.length_per_depth;
                add_behind(sum, transmittance, slab_emission(front, back, len, knots));
                front = back;
            }
        }
    }
    imageStore(accumulation, pixel, paused(sum, transmittance));
}
#endif
