// entry vertex   VERTEX
// entry fragment FRAGMENT
// entry fragment SHADER_BLEND
// entry compute  COMPUTE precise
//
// Slices of a stack of 2D textures, parallel to the base plane, post-classified. The axes of index space are permuted so that the
// stack lies along z; z0 and h are indices from the domain's centre.
//
// Slab i spans [z0 + i h, z0 + (i + 1) h] along z; the domain and the eye clip it along a pixel's ray. Its slice is sampled,
// bilinear, at the x and y of the middle of the rest; BETWEEN interpolates between two slices.
//
//   VERTEX        one instance per slab: the faces of its box that the viewer sees from inside, so that every pixel is covered once,
//                 also where the eye is in the box
//   FRAGMENT      one slab of one pixel, blended by fixed function
//   SHADER_BLEND  the same, blended by the shader into a format of low precision with stochastic rounding
//   COMPUTE       one invocation owns a pixel and marches its slabs front to back in registers
//
//   in    stack, transfer function
//   out   colour attachment 0, packed texels (SHADER_BLEND) or the accumulation image (COMPUTE): premultiplied
//         linear RGBA
//   error with BETWEEN second order in h where field and transfer function are smooth; without, it depends on the distance of the
//         stored slices along the ray; a homogeneous domain is exact
//   cost  one bilinear fetch (BETWEEN: two) and one classification per slab and covered pixel
//
// Source: Peikert, Object Space Volume Rendering, SciVis 2007, page 4-3.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"
#include "shared/optics.glsl"
#include "grid/grid.glsl"
#include "grid/stack.glsl"

// Returns the part of a slab on the ray within `interval`, as depths; empty where x >= y.
vec2 slab_piece(uint slab, Ray ray, vec2 interval, float z0, float h) {
    float a = (fma(float(slab), h, z0) - ray.q.z) * ray.inverse.z;
    float b = (fma(float(slab + 1u), h, z0) - ray.q.z) * ray.inverse.z;
    return vec2(max(min(a, b), interval.x), min(max(a, b), interval.y));
}

#ifdef VERTEX
#include "grid/clip-space.glsl"

layout(location = 0) flat out uint slab_out;

void main() {
    // Front to back: upwards from the slab of the eye, then downwards from the slab below it.
    uint begin = push.order >> RASTER_FIRST_SHIFT;
    uint place = (push.order & RASTER_BACK_TO_FRONT) != 0u ? push.count - 1u - gl_InstanceIndex : gl_InstanceIndex;
    uint upwards = push.count - begin;
    uint slab = push.first + (place < upwards ? begin + place : push.count - 1u - place);
    slab_out = slab;

    float h = push.d0_h.w, kq = push.q0_kq.w, kd = kd_of_view();
    vec3 px = push.px_slope.xyz, py = push.py_z0.xyz, d0 = push.d0_h.xyz;
    vec3 low = -push.half_slope.xyz, high = push.half_slope.xyz;
    low.z = max(low.z, fma(float(slab), h, push.py_z0.w));
    high.z = min(high.z, fma(float(slab + 1u), h, push.py_z0.w));

    const ivec2 CORNER[6] = ivec2[](ivec2(0, 0), ivec2(1, 0), ivec2(0, 1), ivec2(0, 1), ivec2(1, 0), ivec2(1, 1));
    // Add a margin to the box: rasterisers round vertices to 1/256 pixel, and fragments outside of the slab draw nothing. The
    // margin is measured in pixels at the box's farthest corner.
    vec3 normal = cross(px, py) / dot(cross(px, py), d0); // gradient of depth, per index
    vec3 across = mix(low, high, greaterThan(normal, vec3(0.0)));
    float w_far = kq + kd * dot(normal, across - push.q0_kq.xyz);
    if (magnified(w_far)) {
        gl_Position = gl_VertexIndex < 6 ? vec4(2.0 * vec2(CORNER[gl_VertexIndex]) - 1.0, 0.0, 1.0) : vec4(0.0, 0.0, 0.0, 1.0);
        return;
    }
    vec3 margin = (sqrt(px * px + py * py) + abs(d0) * 1e-4) * (max(w_far, 0.0) / 32.0);
    low -= margin;
    high += margin;

    // Drop faces that the viewer does not see from inside.
    int face = gl_VertexIndex / 6, axis = face >> 1;
    bool upper = (face & 1) == 1;
    float plane = upper ? high[axis] : low[axis];
    vec3 eye = push.q0_kq.xyz - kq * d0;
    float inside = kd != 0.0 ? plane - eye[axis] : d0[axis];
    if (upper ? inside <= 0.0 : inside >= 0.0) {
        gl_Position = vec4(0.0, 0.0, 0.0, 1.0); // no area
        return;
    }
    ivec2 corner = CORNER[gl_VertexIndex % 6];
    vec3 point;
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    point[axis] = plane;
    point[u] = corner.x == 1 ? high[u] : low[u];
    point[v] = corner.y == 1 ? high[v] : low[v];

    gl_Position = clip_of(point, dot(normal, point - push.q0_kq.xyz));
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
    vec2 piece = slab_piece(slab_in, ray, interval_of(ray, gl_FragCoord.xy), push.py_z0.w, push.d0_h.w);
    float middle = 0.5 * (piece.x + piece.y);
    blend(slice_emission(ray, piece, middle, float(slab_in), false, lattice_of_view(true), push.knots), slab_in);
}
#endif

#ifdef COMPUTE
#include "grid/march.glsl"

// Whether samples are taken in runs. Translucent surfaces split slabs, and cells of NaN samples are told by the slices beside.
const bool BESIDE = HAS_NAN && !BETWEEN, RUNS = !LAYERS && !BESIDE;

void main() {
    ivec2 pixel;
    if (!own_pixel(pixel)) return;
    Ray ray = ray_of(vec2(pixel) + 0.5);
    vec2 interval = interval_of(ray, vec2(pixel));

    // Load these before the loop: drivers do not hoist them.
    Lattice lattice = of_stack(lattice_of_view(true));
    BrickGrid brick_grid = load_bricks();
    float h = push.d0_h.w, z0 = push.py_z0.w;
    uint knots = push.knots;
    float opaque = push.opaque;
    uint walk = slabs_between_looks(h);
    load_knots();

    // The slabs from where the ray enters to where it leaves, up or down the stack, with one more at each end against rounding: it
    // has no length on the ray. `turn` counts slabs along the ray.
    float slabs = ceil((lattice.half_size.z - z0) / h);
    vec2 shown = shown_of(interval, pixel);
    vec2 place = (fma(shown, vec2(ray.d.z), vec2(ray.q.z)) - z0) / h;
    bool down = ray.d.z < 0.0;
    float begin = clamp(floor(place.x) + (down ? 1.0 : -1.0), 0.0, slabs - 1.0);
    float end = clamp(floor(place.y) + (down ? -1.0 : 1.0), 0.0, slabs - 1.0);
    uint turns = shown.x < shown.y ? uint(abs(end - begin)) + 1u : 0u;
    uint first_slab = uint(begin);
    uvec2 all = uvec2(push.first, min(turns, push.first + push.count));
    KEEP_OWNED(all, slab_piece(down ? first_slab - i : first_slab + i, ray, interval, z0, h), pixel)
    uvec2 turns_ahead = slabs_ahead(all);
    uint turn = turns_ahead.x, last = turns_ahead.y;

    float transmittance;
    vec4 sum = begin_march(pixel, transmittance);
    // The planes at which this dispatch begins and ends.
    float first_plane = fma(down ? begin + 1.0 - float(push.first) : begin + float(push.first), h, z0);
    float done = float(push.first + push.count), last_plane = fma(down ? begin + 1.0 - done : begin + done, h, z0);
    LayersAhead ahead = begin_layers(pixel, (first_plane - ray.q.z) * ray.inverse.z);
    float reached = before.reached, layers_until = layers_end((last_plane - ray.q.z) * ray.inverse.z);
    while (turn < last && transmittance > opaque && !has_missed()) {
        uint stop = last;
        if (EMPTY_SPACE) {
            uint slab = down ? first_slab - turn : first_slab + turn;
            float until = empty_until(ray, slab_piece(slab, ray, interval, z0, h).x, interval.y, brick_grid);
            // Skip whole slabs only.
            float at = (fma(until, ray.d.z, ray.q.z) - z0) / h;
            float passed = down ? float(first_slab) - ceil(at) + 1.0 : floor(at) - float(first_slab);
            turn = until < interval.y ? clamp(uint(max(passed, 0.0)), turn, last) : last;
            stop = min(turn + walk, last);
        }
        if (RUNS) {
            vec2 piece = slab_piece(down ? first_slab - turn : first_slab + turn, ray, interval, z0, h);
            stop = run_on_pages(turn, stop, walk, 0.5 * (piece.x + piece.y), h * abs(ray.inverse.z), ray, lattice);
        }
        for (; turn < stop && transmittance > opaque && !has_missed(); ++turn) {
            uint slab = down ? first_slab - turn : first_slab + turn;
            vec2 piece = slab_piece(slab, ray, interval, z0, h);
            float split = reached;
            bool cut = LAYERS && cut_at_layer(ahead, piece, split, opaque, sum, transmittance);
            vec4 emission = slice_emission(ray, piece, 0.5 * (piece.x + piece.y), float(slab), RUNS, lattice, knots);
            if (has_missed()) break;
            reached = split;
            if (cut) --turn;
            add_part(pixel, sum, transmittance, emission, piece);
        }
    }
    bool ends = ends_ray(pixel, turn, all.y, transmittance, opaque, reached, ahead, UNKNOWN, UNKNOWN);
    if (LAYERS && ends) end_layers(ahead, layers_until, opaque, sum, transmittance);
    end_march(pixel, sum, transmittance);
}
#endif
