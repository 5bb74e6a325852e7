// entry compute  COMPUTE
// entry compute  EDGE
// entry vertex   VERTEX
// entry fragment FRAGMENT
//
// Slices composited in the base plane. A texel of the intermediate image is a line of sight, so slices are resampled where the
// line passes them: sheared by a constant for parallel rays, and scaled too in perspective. The warp comes after
// (warp.glsl).
//
// Slab i is that of depths [z0 + i h, z0 + (i + 1) h], cut along a line to the domain and to the eye. MIDPOINT: its slice, or
// with BETWEEN what lies in its middle, is classified. Else the scalar is taken at both ends of the slab, and the
// transfer function integrated between them.
//
//   COMPUTE   one invocation owns a texel and walks its slabs front to back in registers
//   EDGE      one invocation owns a pixel, and does so where the warp cannot tell it from texels (shear-bounds.glsl)
//   VERTEX    one instance a slab: the rectangle of its sheared and scaled outline
//   FRAGMENT  one slab of one texel, blended by fixed function
//
//   in    stack, transfer function or its table
//   out   intermediate image, or colour attachment 0: premultiplied linear RGBA
//   error of a line, before the warp: as slices-2d, or as slabs. A homogeneous domain is exact
//   cost  per slab and covered texel one bilinear look-up (BETWEEN: two) and one classification or integration
//
// Source: Lacroute and Levoy, SIGGRAPH 1994; Peikert, Object Space Volume Rendering, SciVis 2007, pages 4-5 to 4-17.
#version 460
#extension GL_GOOGLE_include_directive : require

#define STACK
#define BASE_PLANE
#include "interface.glsl"
#include "shared/optics.glsl"
#include "grid/grid.glsl"
#include "grid/stack.glsl"
#include "shared/segments.glsl"

// The slice that a slab stands for: rays may go down the stack.
struct Slices {
    float first;
    float step;
    float last;
};

Slices load_slices() {
    float last = 2.0 * push.half_scale.z, every = float(int(push.order >> 8));
    return (push.order & 8u) != 0u ? Slices(last, -every, last) : Slices(0.0, every, last);
}

float slice_of(float slab, Slices slices) {
    return clamp(fma(slab, slices.step, slices.first), 0.0, slices.last);
}

layout(constant_id = SPEC_EVERY) const bool EVERY = false;

// What a slab gives on the ray: looked up in the middle of its piece, on its slice. Where that stands for several, it may be far from a piece that
// is cut off: then where the piece comes nearest to it, on the slice that is nearest there.
vec4 slab_emission(Ray ray, vec2 piece, float slab, float z0, float h, Slices slices, Lattice lattice, uint knots) {
    float z = 0.5 * (piece.x + piece.y), slice = slice_of(slab, slices);
    if (EVERY && !BETWEEN) {
        z = min(max(fma(slab + 0.5, h, z0), piece.x), max(piece.x, piece.y));
        slice = clamp(floor(fma(z, ray.d.z, lattice.half_size.z) + 0.5), 0.0, slices.last);
    }
    return slice_emission(ray, piece, z, slice, lattice, knots);
}

// What of a slab lies inside `interval`, as depths; empty when x >= y.
vec2 slab_piece(float slab, float z0, float h, vec2 interval) {
    return vec2(max(fma(slab, h, z0), interval.x), min(fma(slab + 1.0, h, z0), interval.y));
}

// The stored number at depth z of the ray, trilinear. Slices themselves are looked up alone.
float stored_at(Ray ray, float z, Lattice lattice) {
    vec3 index = fma(vec3(z), ray.d, ray.q) + lattice.half_size;
    float last = 2.0 * lattice.half_size.z;
    float place = clamp(index.z, 0.0, last);
    float slice = floor(place), share = place - slice;
    float texel = on_slice(index.xy, slice, 0.0, lattice);
    // A loop: software rasterisers run through branches that no invocation takes.
    for (uint once = 0u; once < uint(share > 0.0); ++once) {
        texel = mix(texel, on_slice(index.xy, slice + 1.0, 0.0, lattice), share);
    }
    return texel;
}

#include "grid/faces.glsl"

layout(constant_id = SPEC_BOUNDED) const bool BOUNDED = false;

#ifndef VERTEX
#ifndef EDGE
layout(set = 0, binding = BINDING_TEXEL_BOUNDS, std430) readonly buffer TexelBounds { vec2 texel_bounds[]; };
#endif

// What of the domain lies on the ray, between bounds.
vec2 between_bounds(Ray ray, vec2 bounds) {
    vec2 interval = domain_of(ray);
    return vec2(max(interval.x, bounds.x), min(interval.y, bounds.y));
}
#endif

#ifdef VERTEX
layout(location = 0) flat out uint slab_out;

void main() {
    bool back_to_front = (push.order & 16u) != 0u;
    uint slab = back_to_front ? push.count - 1u - gl_InstanceIndex : gl_InstanceIndex;
    slab_out = slab;
    vec3 half_size = push.half_scale.xyz;
    vec2 ends = slab_piece(float(slab), push.z0, push.h, vec2(max(-half_size.z, push.slope_u.w), half_size.z));
    if (ends.x >= ends.y) {
        gl_Position = vec4(0.0, 0.0, 0.0, 1.0); // no area
        return;
    }
    // Texels that see the slab's near and far side; where the eye is at hand, all may.
    vec2 low = vec2(push.size), high = vec2(0.0);
    for (int i = 0; i < 2; ++i) {
        vec2 step = fma(vec2(ends[i]), push.d0_step.zw, push.q0_step.zw);
        vec2 at = fma(vec2(ends[i]), push.d0_step.xy, push.q0_step.xy);
        bool near = any(lessThanEqual(step, 1e-3 * abs(push.q0_step.zw)));
        step = max(step, 1e-30);
        vec2 t0 = near ? vec2(0.0) : (-half_size.xy - at) / step + vec2(push.size / 2u);
        vec2 t1 = near ? vec2(push.size) : (half_size.xy - at) / step + vec2(push.size / 2u);
        low = min(low, t0);
        high = max(high, t1);
    }
    // A margin: rasterisers round vertices, and a texel too many draws nothing.
    low = clamp(low - 1.0, vec2(0.0), vec2(push.size));
    high = clamp(high + 1.0, vec2(0.0), vec2(push.size));
    ivec2 corner = ivec2(gl_VertexIndex & 1, gl_VertexIndex >> 1);
    vec2 texel = vec2(corner.x == 1 ? high.x : low.x, corner.y == 1 ? high.y : low.y);
    texel.y += float(push.offset); // base planes lie below each other
    gl_Position = vec4(texel / vec2(push.atlas) * 2.0 - 1.0, 0.0, 1.0);
}
#endif

#ifdef FRAGMENT
#include "grid/blend.glsl"
layout(location = 0) flat in uint slab_in;

void main() {
    load_segments();
    Lattice lattice = load_lattice();
    Ray ray = ray_of(floor(gl_FragCoord.xy) - vec2(0.0, float(push.offset)));
    vec2 interval = domain_of(ray);
    if (BOUNDED) interval = between_bounds(ray, texel_bounds[min(uint(gl_FragCoord.y) * push.atlas.x + uint(gl_FragCoord.x), uint(texel_bounds.length()) - 1u)]);
    vec2 piece = slab_piece(float(slab_in), push.z0, push.h, interval);
    vec4 emission = vec4(0.0);
    if (INTEGRATOR == INTEGRATOR_MIDPOINT) {
        emission = slab_emission(ray, piece, float(slab_in), push.z0, push.h, load_slices(), lattice, push.knots);
    } else if (piece.x < piece.y) {
        emission = between_faces(face_at(ray, piece.x, lattice), face_at(ray, piece.y, lattice),
                                 (piece.y - piece.x) * ray.length_per_depth, push.knots);
    }
    blend(emission, slab_in);
}
#endif

#if defined(COMPUTE) || defined(EDGE)
#include "grid/march.glsl"

#ifdef EDGE
layout(set = 0, binding = BINDING_EDGES, std430) readonly buffer Edges { vec4 edges[]; };
#endif

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
    if (!in_image(texel)) return;
#ifdef EDGE
    vec4 edge = edges[uint(texel.y) * uint(imageSize(accumulation).x) + uint(texel.x)];
    if (edge.z == float(EDGE_NONE)) return;
    Ray ray = ray_of(edge.xy);
    vec2 interval = between_bounds(ray, edge.zw);
#else
    Ray ray = ray_of(vec2(texel));
    vec2 interval = domain_of(ray);
    if (BOUNDED) interval = between_bounds(ray, texel_bounds[push.offset + uint(texel.y) * push.size.x + uint(texel.x)]);
#endif

    // Read once, before the loop: drivers do not take these loads out of it.
    Lattice lattice = load_lattice();
    BrickGrid brick_grid = load_bricks();
    float h = push.h, z0 = push.z0;
    uint knots = push.knots;
    float opaque = push.opaque;
    float walk = float(slabs_between_looks(h));
    load_segments();

    // Slabs from where the ray enters to where it leaves; one more at each end against rounding: they have no length.
    // Counted in floats: conversions are slow in software.
    float slabs = ceil((lattice.half_size.z - z0) / h);
    float begin = clamp(floor((interval.x - z0) / h) - 1.0, 0.0, slabs - 1.0);
    float end = clamp(floor((interval.y - z0) / h) + 1.0, 0.0, slabs - 1.0);
    Slices slices = load_slices();
    float slab = begin + float(push.first), last = interval.x < interval.y ? min(end + 1.0, slab + float(push.count)) : 0.0;

    float transmittance;
    vec4 sum = begin_march(texel, transmittance);
    while (slab < last && transmittance > opaque) {
        float stop = last;
        if (EMPTY_SPACE) {
            float until = empty_until(ray, slab_piece(slab, z0, h, interval).x, interval.y, brick_grid);
            // Slabs that end before there show nothing.
            slab = clamp(floor((until - z0) / h), slab, last);
            stop = min(slab + walk, last);
        }
        if (INTEGRATOR == INTEGRATOR_MIDPOINT) {
            for (; slab < stop && transmittance > opaque; slab += 1.0) {
                vec2 piece = slab_piece(slab, z0, h, interval);
                add_behind(sum, transmittance, slab_emission(ray, piece, slab, z0, h, slices, lattice, knots));
            }
        } else {
            Face front = face_at(ray, slab_piece(slab, z0, h, interval).x, lattice);
            for (; slab < stop && transmittance > opaque; slab += 1.0) {
                vec2 piece = slab_piece(slab, z0, h, interval);
                Face back = face_at(ray, piece.y, lattice);
                if (piece.x < piece.y) {
                    float len = (piece.y - piece.x) * ray.length_per_depth;
                    add_behind(sum, transmittance, between_faces(front, back, len, knots));
                    front = back;
                }
            }
        }
    }
    end_march(texel, sum, transmittance);
}
#endif
