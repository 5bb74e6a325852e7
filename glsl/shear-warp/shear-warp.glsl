// entry compute  COMPUTE precise
// entry compute  EDGE
// entry vertex   VERTEX
// entry fragment FRAGMENT
//
// Compositing on the base plane, the first step of the shear-warp factorisation. A texel of the intermediate image is a ray, and
// slices are resampled where the ray passes them: sheared for parallel rays, sheared and scaled in perspective. The warp follows
// (warp.glsl).
//
// Slab i spans the depths [z0 + i h, z0 + (i + 1) h]; the domain and the eye clip it along a ray. MIDPOINT classifies the scalar on
// its slice, or with BETWEEN in its middle. The other integrators sample the scalar at both ends of the slab and integrate the
// transfer function between them.
//
//   COMPUTE   one invocation owns a texel and marches its slabs front to back in registers
//   EDGE      the same for the pixels that the warp cannot interpolate from texels (shear-bounds.glsl), one invocation per pixel
//   VERTEX    one instance per slab: the rectangle of its sheared and scaled outline
//   FRAGMENT  one slab of one texel, blended by fixed function
//
//   in    stack, transfer function or its table
//   out   intermediate image, or colour attachment 0: premultiplied linear RGBA
//   error of a ray, before the warp: that of slices-2d, or of slabs. A homogeneous domain is exact
//   cost  one bilinear fetch (BETWEEN: two) and one classification or integration per slab and covered texel
//
// Source: Lacroute and Levoy, SIGGRAPH 1994; Peikert, Object Space Volume Rendering, SciVis 2007, pages 4-5 to 4-17.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"
#include "shared/interpolated.glsl"
#include "shared/optics.glsl"
#include "shared/segments.glsl"
#include "frame/counts.glsl"
#include "grid/stack.glsl"
#include "grid/faces.glsl"
#include "shear-warp/base-plane.glsl"

// The slice of slab i is first + i step: rays may go down the stack.
struct Slices {
    float first;
    float step;
    float last;
};

Slices load_slices() {
    float last = 2.0 * push.half_scale.z, every = float(int(push.order >> PLANE_EVERY_SHIFT));
    return (push.order & PLANE_DOWN) != 0u ? Slices(last, -every, last) : Slices(0.0, every, last);
}

float slice_of(float slab, Slices slices) {
    return clamp(fma(slab, slices.step, slices.first), 0.0, slices.last);
}

layout(constant_id = SPEC_EVERY) const bool EVERY = false;

// Returns the depth of the sample that represents a piece of a slab: its middle. A slab of several slices (EVERY) may be clipped far from its
// middle: then it is the depth nearest to the slab's middle within the piece.
float sample_of(vec2 piece, float slab, float z0, float h) {
    if (!EVERY || BETWEEN) return 0.5 * (piece.x + piece.y);
    return min(max(fma(slab + 0.5, h, z0), piece.x), max(piece.x, piece.y));
}

// Returns premultiplied colour and opacity of a slab on the ray, classified on its slice at the depth of its sample; of several slices on the one
// nearest there.
vec4 slab_emission(Ray ray, vec2 piece, float slab, float z0, float h, Slices slices, bool in_run, Lattice lattice, uint knots) {
    float z = sample_of(piece, slab, z0, h), slice = slice_of(slab, slices);
    if (EVERY && !BETWEEN) {
        slice = clamp(floor(fma(z, ray.d.z, lattice.half_size.z) + 0.5), 0.0, slices.last);
    }
    return slice_emission(ray, piece, z, slice, in_run, lattice, knots);
}

// Returns the part of a slab within `interval`, as depths; empty where x >= y.
vec2 slab_piece(float slab, float z0, float h, vec2 interval) {
    return vec2(max(fma(slab, h, z0), interval.x), min(fma(slab + 1.0, h, z0), interval.y));
}

// Returns the stored value at depth z of the ray, trilinear, 0 where its page is missed; on a slice itself it reads that slice only.
float stored_at(Ray ray, float z, bool in_run, Lattice lattice) {
    ++taken_samples;
    vec3 index = fma(vec3(z), ray.d, ray.q) + lattice.half_size;
    float last = 2.0 * lattice.half_size.z;
    float place = clamp(index.z, 0.0, last);
    float slice = floor(place), share = place - slice;
    if (!has_page_at(z, in_run, vec3(index.xy, place), lattice)) return 0.0;
    float texel = on_slice(index.xy, slice, 0.0, lattice);
    // A loop, because software rasterisers execute branches that no invocation takes.
    for (uint once = 0u; once < uint(share > 0.0); ++once) {
        texel = interpolated(texel, on_slice(index.xy, slice + 1.0, 0.0, lattice), share);
    }
    return texel;
}

layout(constant_id = SPEC_BOUNDED) const bool BOUNDED = false;

#ifndef VERTEX
#ifndef EDGE
layout(set = 0, binding = BINDING_TEXEL_BOUNDS, std430) readonly buffer TexelBounds { vec2 texel_bounds[]; };
#endif

// Returns the depths between which the ray is drawn: the domain, within bounds.
vec2 between_bounds(Ray ray, vec2 bounds) {
    vec2 interval = domain_of(ray);
    return vec2(max(interval.x, bounds.x), min(interval.y, bounds.y));
}
#endif

#ifdef VERTEX
layout(location = 0) flat out uint slab_out;

void main() {
    bool back_to_front = (push.order & PLANE_BACK_TO_FRONT) != 0u;
    uint slab = back_to_front ? push.count - 1u - gl_InstanceIndex : gl_InstanceIndex;
    slab_out = slab;
    vec3 half_size = push.half_scale.xyz;
    vec2 ends = slab_piece(float(slab), push.z0, push.h, vec2(max(-half_size.z, push.slope_u.w), half_size.z));
    if (ends.x >= ends.y) {
        gl_Position = vec4(0.0, 0.0, 0.0, 1.0); // no area
        return;
    }
    // The texels whose rays meet the slab's near and far side; all texels where the eye is close.
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
    // Add a margin: rasterisers round vertices, and fragments outside of the slab draw nothing.
    low = clamp(low - 1.0, vec2(0.0), vec2(push.size));
    high = clamp(high + 1.0, vec2(0.0), vec2(push.size));
    ivec2 corner = ivec2(gl_VertexIndex & 1, gl_VertexIndex >> 1);
    vec2 texel = vec2(corner.x == 1 ? high.x : low.x, corner.y == 1 ? high.y : low.y);
    texel.y += float(push.offset); // base planes lie below each other
    gl_Position = vec4(texel / vec2(push.atlas) * 2.0 - 1.0, 0.0, 1.0);
}
#endif

#ifdef FRAGMENT
layout(location = 0) out vec4 colour;

layout(location = 0) flat in uint slab_in;

void main() {
    load_segments(push.knots);
    Lattice lattice = load_lattice();
    Ray ray = ray_of(floor(gl_FragCoord.xy) - vec2(0.0, float(push.offset)));
    vec2 interval = domain_of(ray);
    if (BOUNDED) {
        uint word = uint(gl_FragCoord.y) * push.atlas.x + uint(gl_FragCoord.x);
        interval = between_bounds(ray, texel_bounds[min(word, uint(texel_bounds.length()) - 1u)]);
    }
    vec2 piece = slab_piece(float(slab_in), push.z0, push.h, interval);
    vec4 emission = vec4(0.0);
    if (INTEGRATOR == INTEGRATOR_MIDPOINT) {
        emission = slab_emission(ray, piece, float(slab_in), push.z0, push.h, load_slices(), false, lattice, push.knots);
    } else if (piece.x < piece.y) {
        Face front = face_of(stored_at(ray, piece.x, false, lattice), lattice);
        Face back = face_of(stored_at(ray, piece.y, false, lattice), lattice);
        emission = between_faces(front, back, (piece.y - piece.x) * ray.length_per_depth, push.knots);
    }
    colour = emission;
}
#endif

#if defined(COMPUTE) || defined(EDGE)
#include "grid/empty-space.glsl"
#include "grid/paging.glsl"
#include "grid/resume.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

// Whether samples are taken in runs. Cells of NaN samples are told by the slices beside.
const bool BESIDE = HAS_NAN && !BETWEEN, RUNS = !BESIDE || INTEGRATOR != INTEGRATOR_MIDPOINT;

#ifdef EDGE
layout(set = 0, binding = BINDING_ACCUMULATION, rgba32f) uniform image2D accumulation;
layout(set = 0, binding = BINDING_EDGES, std430) readonly buffer Edges { vec4 edges[]; };

bool in_image(ivec2 pixel) {
    return all(lessThan(pixel, imageSize(accumulation)));
}

uint number_of(ivec2 pixel) {
    return uint(pixel.y) * uint(imageSize(accumulation).x) + uint(pixel.x);
}

vec4 load_state(ivec2 pixel) {
    return imageLoad(accumulation, pixel);
}

void store_state(ivec2 pixel, vec4 state) {
    imageStore(accumulation, pixel, state);
}
#else
layout(set = 0, binding = BINDING_INTERMEDIATE, std430) buffer Intermediate { vec4 intermediate[]; };

bool in_image(ivec2 texel) {
    return all(lessThan(texel, ivec2(push.size)));
}

uint number_of(ivec2 texel) {
    return push.offset + uint(texel.y) * push.size.x + uint(texel.x);
}

vec4 load_state(ivec2 texel) {
    return intermediate[number_of(texel)];
}

void store_state(ivec2 texel, vec4 state) {
    intermediate[number_of(texel)] = state;
}
#endif

void main() {
    ivec2 texel = ivec2(INVOCATION.xy);
    if (!in_image(texel)) return;
    uint number = number_of(texel);
    bool resumes = PAGED ? (push.order & MARCH_RESUMES) != 0u : RESUME;
    RayState before = FIRST_STATE;
    if (PAGED && resumes) {
        before = rays[number];
        if (!goes_on(before, push.order)) return;
    }
#ifdef EDGE
    vec4 edge = edges[number];
    if (edge.z == float(EDGE_NONE)) return;
    Ray ray = ray_of(edge.xy);
    vec2 interval = between_bounds(ray, edge.zw);
#else
    Ray ray = ray_of(vec2(texel));
    vec2 interval = domain_of(ray);
    if (BOUNDED) interval = between_bounds(ray, texel_bounds[number]);
#endif

    // Load these before the loop: drivers do not hoist them.
    Lattice lattice = of_stack(load_lattice());
    BrickGrid brick_grid = bricks_of(push.half_scale.xyz, push.order & MARCH_AXIS);
    float h = push.h, z0 = push.z0;
    uint knots = push.knots;
    float opaque = push.opaque;
    float walk = float(slabs_between_looks(h));
    load_segments(knots);

    // The slabs from where the ray enters to where it leaves, with one more at each end against rounding: it has no length on the
    // ray. Slabs are counted in floats, because conversions are slow in software.
    float slabs = ceil((lattice.half_size.z - z0) / h);
    float begin = clamp(floor((interval.x - z0) / h) - 1.0, 0.0, slabs - 1.0);
    float end = clamp(floor((interval.y - z0) / h) + 1.0, 0.0, slabs - 1.0);
    Slices slices = load_slices();
    float slab = max(begin + float(push.first), float(before.slab)), end_slab = interval.x < interval.y ? end + 1.0 : 0.0;
    float last = min(end_slab, slab + float(push.count));

    float transmittance;
    vec4 sum = unpacked_state(resumes ? load_state(texel) : vec4(0.0), transmittance);
    if (PAGED) transmittance = before.transmittance;
    uint known = PAGED && slab == float(before.slab) ? before.front : UNKNOWN;
    while (slab < last && transmittance > opaque && !has_missed()) {
        float from = slab, stop = last;
        if (EMPTY_SPACE) {
            float until = empty_until(ray, slab_piece(slab, z0, h, interval).x, interval.y, brick_grid);
            // Skip whole slabs only.
            slab = until < interval.y ? clamp(floor((until - z0) / h), slab, last) : last;
            stop = min(slab + walk, last);
        }
        vec2 first = slab_piece(slab, z0, h, interval);
        if (INTEGRATOR == INTEGRATOR_MIDPOINT) {
            if (RUNS) stop = run_on_pages(slab, stop, walk, sample_of(first, slab, z0, h), h, ray, lattice);
            for (; slab < stop && transmittance > opaque && !has_missed(); slab += 1.0) {
                vec2 piece = slab_piece(slab, z0, h, interval);
                vec4 emission = slab_emission(ray, piece, slab, z0, h, slices, RUNS, lattice, knots);
                if (has_missed()) break;
                add_behind(sum, transmittance, emission);
            }
        } else {
            if (slab != from) known = UNKNOWN;
            float value = known != UNKNOWN ? uintBitsToFloat(known) : stored_at(ray, first.x, false, lattice);
            if (has_missed()) break;
            known = bits_of(value);
            Face front = face_of(value, lattice);
            if (RUNS) stop = run_on_pages(slab, stop, walk, first.y, h, ray, lattice);
            for (; slab < stop && transmittance > opaque && !has_missed(); slab += 1.0) {
                vec2 piece = slab_piece(slab, z0, h, interval);
                Face back = face_of(stored_at(ray, piece.y, RUNS, lattice), lattice);
                if (has_missed()) break;
                if (piece.x < piece.y) {
                    float len = (piece.y - piece.x) * ray.length_per_depth;
                    add_behind(sum, transmittance, between_faces(front, back, len, knots));
                    front = back;
                    known = bits_of(back.texel);
                }
            }
        }
    }
    if (PAGED) {
        bool ended = !has_missed() && (slab >= end_slab || transmittance <= opaque);
        rays[number] = ray_at(ended, uint(slab), transmittance, 0.0, 0.0, known, UNKNOWN);
    }
    store_state(texel, packed_state(sum, transmittance, !PAGED && (push.order & MARCH_CONTINUES) != 0u));
    add_counts();
}
#endif
