// entry vertex   VERTEX
// entry fragment FRAGMENT
// entry compute  COMPUTE
//
// View-aligned slices of a 3D texture, post-classified.
//
// Slice i stands for the slab of depths [z0 + i h, z0 + (i + 1) h]. Along a pixel's ray the slab is cut
// to the domain and to the eye; the scalar at the middle of what is left is classified, and its
// extinction times the true length of that piece is the slice's optical depth.
//
//   VERTEX    one instance a slice: the polygon in which the slice's plane cuts the domain, each face of
//             the domain pushed out so far that the polygon covers the outline of the whole slab
//   FRAGMENT  one slice of one pixel, blended by fixed function
//   COMPUTE   one invocation owns a pixel and walks its slices front to back in registers
//
//   in    volume, transfer function
//   out   colour attachment 0 (raster) or the accumulation image (compute): premultiplied linear RGBA
//   error second order in h where field and transfer function are smooth; a homogeneous domain is exact
//   cost  one fetch and one classification per slice and covered pixel
//
// Source: Cabral, Cam, Foran, VolVis 1994; polygon order after Rezk Salama and Kolb, VMV 2005.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "optics.glsl"
#include "grid.glsl"

layout(constant_id = SPEC_CLIP_ENDS) const bool CLIP_ENDS = true;
layout(constant_id = SPEC_RESUME) const bool RESUME = false;

layout(push_constant, std430) uniform Slices3dPush {
    vec4 q0_kq;       // see grid.glsl; w: kq
    vec4 px_kd;       // w: kd
    vec4 py_z0;       // w: depth at which slab 0 begins
    vec4 d0_h;        // w: thickness of a slab, depth
    vec4 half_scale;  // half the domain, indices; w: side of a pixel at unit depth, world
    vec2 half_extent; // half the image, pixels
    float near;       // smallest depth to draw: that of the eye for perspective
    float value_scale; // scalar = value_scale * texel + value_offset
    float value_offset;
    uint knots;       // number of knots
    uint slab_first;  // first slab of this draw or dispatch
    uint slab_count;  // number of slabs of this draw or dispatch
    uint backwards;   // raster: 1 draws the farthest slab first
    float unit;       // world length of one unit of depth: the smallest voxel spacing
    float opaque;     // transmittance at which a pixel is done
} push;

float slab_begin(uint slab) {
    return fma(float(slab), push.d0_h.w, push.py_z0.w);
}

Ray ray_of(vec2 pixel) {
    return pixel_ray(pixel, push.q0_kq, push.px_kd, push.py_z0, push.d0_h, push.half_scale.w, push.unit,
                     push.half_extent);
}

vec2 interval_of(Ray ray) {
    vec2 interval = domain_interval(ray, push.half_scale.xyz);
    return vec2(max(interval.x, push.near), interval.y);
}

// What of the slab [begin, end] lies on the ray inside `interval`: middle and thickness, in depth.
vec2 slab_piece(float begin, float end, vec2 interval) {
    if (CLIP_ENDS) {
        begin = max(begin, interval.x);
        end = min(end, interval.y);
        return vec2(0.5 * (begin + end), max(end - begin, 0.0));
    }
    float middle = 0.5 * (begin + end);
    return vec2(middle, middle >= interval.x && middle <= interval.y ? end - begin : 0.0);
}

// Colour (rgb) and opacity (a) of a piece of the ray.
vec4 slab_emission(Ray ray, vec2 piece, vec3 half_size, float value_scale, float value_offset, uint knots) {
    float texel = grid_stored(fma(vec3(piece.x), ray.d, ray.q), half_size);
    // Two roundings, not one: the first gives back an integer's code exactly, so that integer data falls on
    // the right side of a jump.
    precise float stored = value_scale * texel;
    precise float scalar = stored + value_offset;
    vec4 optics = classify(scalar, knots);
    float tau = HAS_NAN && is_nan(texel) ? 0.0 : optics.a;
    // Lengths, then extinction: 0 * tau must stay 0.
    return vec4(optics.rgb, alpha_of(tau * (piece.y * ray.length_per_depth)));
}

#ifdef VERTEX
layout(location = 0) flat out uint slab_out;

// Component `axis` of v alone.
vec3 along(vec3 v, int axis) {
    return vec3(axis == 0 ? v.x : 0.0, axis == 1 ? v.y : 0.0, axis == 2 ? v.z : 0.0);
}

void main() {
    uint place = push.backwards != 0u ? push.slab_count - 1u - gl_InstanceIndex : gl_InstanceIndex;
    uint slab = push.slab_first + place;
    slab_out = slab;
    float h = push.d0_h.w, kq = push.q0_kq.w, kd = push.px_kd.w;
    float z = 0.5 * (slab_begin(slab) + slab_begin(slab + 1u));
    float w = kq + kd * z; // depth from the eye for perspective, 1 for orthographic

    // A strip 0 1 5 2 4 3 of the hexagon's corners.
    const int STRIP[6] = int[](0, 1, 5, 2, 4, 3);
    int corner = STRIP[gl_VertexIndex];

    // A slab that touches the eye may cover the whole image.
    if (CLIP_ENDS && kd != 0.0 && w - 0.5 * h < 0.25 * h) {
        gl_Position = vec4(corner >= 1 && corner <= 3 ? 1.0 : -1.0, corner < 3 ? -1.0 : 1.0, 0.0, 1.0);
        return;
    }

    // Push each face of the domain out to where the slab's outline meets it, seen on the slice's plane.
    // Perspective scales about the eye by w / (w + delta), |delta| <= h / 2; parallel rays shift by
    // delta d0.
    vec3 px = push.px_kd.xyz, py = push.py_z0.xyz, d0 = push.d0_h.xyz;
    vec3 low = -push.half_scale.xyz, high = push.half_scale.xyz;
    if (CLIP_ENDS) {
        // And by 1/32 pixel more: rasterisers round vertices to 1/256, and a pixel too many draws nothing.
        vec3 margin = sqrt(px * px + py * py) * (w / 32.0);
        if (kd != 0.0) {
            vec3 eye = push.q0_kq.xyz - kq * push.d0_h.xyz;
            float grow = 0.5 * h / (w - 0.5 * h), shrink = -0.5 * h / (w + 0.5 * h);
            vec3 to_low = low - eye, to_high = high - eye;
            low += min(to_low * grow, to_low * shrink) - margin;
            high += max(to_high * grow, to_high * shrink) + margin;
        } else {
            vec3 shift = 0.5 * h * abs(push.d0_h.xyz) + margin;
            low -= shift;
            high += shift;
        }
    }

    // Depth grows by `normal` per index; (px, py, d0) is its dual frame.
    vec3 across = cross(px, py);
    float det = dot(across, d0);
    vec3 normal = across / det;

    // Walk from the nearest corner of the box to the farthest: every edge leads to greater depth, so the
    // plane meets each of the three paths once, and each of the three edges between paths at most once.
    vec3 nearest = mix(high, low, greaterThanEqual(normal, vec3(0.0)));
    vec3 edge = mix(low - high, high - low, greaterThanEqual(normal, vec3(0.0)));
    vec3 rise = abs(normal) * (high - low);
    float t = clamp(z - dot(normal, nearest - push.q0_kq.xyz), 0.0, rise.x + rise.y + rise.z);
    int first = corner / 2, middle = (first + 2) % 3, last = (first + 1) % 3;
    bool bridge = (corner & 1) == 1 && t >= rise[first] && t <= rise[first] + rise[last];
    if (bridge) {
        int swap = middle;
        middle = last;
        last = swap;
    }
    vec3 step = clamp(vec3(t, t - rise[first], t - rise[first] - rise[middle])
                          / max(vec3(rise[first], rise[middle], rise[last]), vec3(1e-30)), 0.0, 1.0);
    vec3 point = nearest + along(edge, first) * step.x + along(edge, middle) * step.y + along(edge, last) * step.z;

    vec3 lateral = point - push.q0_kq.xyz - z * d0;
    vec2 xy = vec2(dot(cross(py, d0), lateral), dot(cross(d0, px), lateral)) / det;
    gl_Position = vec4(xy / push.half_extent, 0.0, w);
}
#endif

#ifdef FRAGMENT
layout(location = 0) flat in uint slab_in;
layout(location = 0) out vec4 colour;

void main() {
    load_knots();
    Ray ray = ray_of(gl_FragCoord.xy);
    vec2 piece = slab_piece(slab_begin(slab_in), slab_begin(slab_in + 1u), interval_of(ray));
    vec4 emission =
        slab_emission(ray, piece, push.half_scale.xyz, push.value_scale, push.value_offset, push.knots);
    colour = vec4(emission.rgb * emission.a, emission.a);
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

    // Read once, before the loop: drivers do not take these loads out of it.
    vec3 half_size = push.half_scale.xyz;
    float h = push.d0_h.w, z0 = push.py_z0.w;
    float value_scale = push.value_scale, value_offset = push.value_offset;
    uint knots = push.knots;
    float opaque = push.opaque;
    load_knots();

    // The slabs that the ray meets, one more at each end against rounding: they have no length.
    vec2 place = (interval - z0) / h;
    float begin = max(floor(place.x) - 1.0, float(push.slab_first));
    float end = min(ceil(place.y) + 1.0, float(push.slab_first + push.slab_count));

    vec4 sum = RESUME ? imageLoad(accumulation, pixel) : vec4(0.0);
    float transmittance = 1.0 - sum.a;
    if (interval.x < interval.y && begin < end) {
        for (uint slab = uint(begin); slab < uint(end) && transmittance > opaque; ++slab) {
            vec2 piece = slab_piece(fma(float(slab), h, z0), fma(float(slab + 1u), h, z0), interval);
            vec4 emission = slab_emission(ray, piece, half_size, value_scale, value_offset, knots);
            float weight = transmittance * emission.a;
            sum += vec4(emission.rgb * weight, weight);
            transmittance -= weight;
        }
    }
    imageStore(accumulation, pixel, sum);
}
#endif
