// Outlines of cells in the image, for mesh.glsl's view.
//
// Of four points in a plane either one lies in the triangle of the others, or two segments cross (Radon's theorem): the signs of
// the numbers l with sum l = 0 and sum l p = 0 tell which, classes 1 and 2 of Shirley and Tuchman.
#ifndef OUTLINE_GLSL
#define OUTLINE_GLSL

#include "interface.glsl"
#include "shared/device.glsl"
#include "mesh/mesh.glsl"

layout(constant_id = DEVICE_SUBPIXEL_BITS) const uint SUBPIXEL_BITS = 4; // of the rasteriser's rounding of corners

// A convex polygon in normalised device coordinates; of a triangle c and d are the same.
struct Polygon {
    vec2 a, b, c, d;
};

float cross2(vec2 a, vec2 b) {
    return a.x * b.y - a.y * b.x;
}

// Corners in the order of the outline, two bits each, by which of corners 1, 2 and 3 have another sign than corner 0. The last is the
// inner one where the outline is a triangle.
const uint OUTLINE_ORDER[8] = uint[](
    0u,
    0u | 2u << 2 | 3u << 4 | 1u << 6,
    0u | 1u << 2 | 3u << 4 | 2u << 6,
    0u | 1u << 2 | 3u << 4 | 2u << 6,
    0u | 1u << 2 | 2u << 4 | 3u << 6,
    0u | 1u << 2 | 2u << 4 | 3u << 6,
    0u | 2u << 2 | 1u << 4 | 3u << 6,
    1u | 2u << 2 | 3u << 4 | 0u << 6);

vec2 choose(uint which, vec2 p0, vec2 p1, vec2 p2, vec2 p3) {
    return which < 2u ? (which == 0u ? p0 : p1) : (which == 2u ? p2 : p3);
}

// Moves a corner so that both its edges move outward by `margin`. Adds to `narrow` where an edge is too short to have a direction, or
// the corner would go further than a pixel.
vec2 widened(vec2 before, vec2 at, vec2 after, float margin, inout bool narrow) {
    vec2 e = at - before, f = after - at;
    float ee = dot(e, e), ff = dot(f, f);
    narrow = narrow || min(ee, ff) < 1.0 / 4096.0;
    vec2 m = vec2(e.y, -e.x) * inversesqrt(max(ee, 1e-12)), n = vec2(f.y, -f.x) * inversesqrt(max(ff, 1e-12));
    float both = 1.0 + dot(m, n);
    narrow = narrow || both < 2.0 * margin * margin;
    return at + (m + n) * (margin / max(both, 1e-6));
}

// The polygon that a cell covers: `box` are the pixels that it may cover.
Polygon outline_of(vec4 a, vec4 b, vec4 c, vec4 d, uvec2 box) {
    vec4 w = push.w0 + push.w1 * vec4(a.z, b.z, c.z, d.z);
    bool before_eye = min(min(w.x, w.y), min(w.z, w.w)) > 1e-4 * max(max(w.x, w.y), max(w.z, w.w));
    // In pixels from the middle of the image, y upward.
    vec4 scale = 1.0 / (push.pixel * (before_eye ? w : vec4(1.0)));
    vec2 p0 = a.xy * scale.x, p1 = b.xy * scale.y, p2 = c.xy * scale.z, p3 = d.xy * scale.w;
    vec2 far = max(max(abs(p0), abs(p1)), max(abs(p2), abs(p3)));
    float furthest = max(far.x, far.y);
    bool there = (box.x >> 16) > 0u;
    bool regular = before_eye && furthest < 1e5;
    // Twice the rasteriser's grid, and what places are rounded by here.
    float margin = 2.0 / float(1u << SUBPIXEL_BITS) + 2e-6 * furthest;

    vec2 d1 = p1 - p0, d2 = p2 - p0, d3 = p3 - p0;
    float l1 = cross2(d2, d3), l2 = -cross2(d1, d3), l3 = cross2(d1, d2), l0 = -(l1 + l2 + l3);
    bool sign0 = l0 > 0.0;
    uint other = uint((l1 > 0.0) != sign0) | uint((l2 > 0.0) != sign0) << 1 | uint((l3 > 0.0) != sign0) << 2;
    uint corners = OUTLINE_ORDER[other];
    bool triangle = other == 1u || other == 2u || other == 4u || other == 7u;
    vec2 q0 = choose(corners & 3u, p0, p1, p2, p3), q1 = choose(corners >> 2 & 3u, p0, p1, p2, p3);
    vec2 q2 = choose(corners >> 4 & 3u, p0, p1, p2, p3), q3 = choose(corners >> 6, p0, p1, p2, p3);
    if (triangle) q3 = q2;
    // Counterclockwise.
    if (cross2(q2 - q0, q3 - q1) + (triangle ? cross2(q1 - q0, q2 - q0) : 0.0) < 0.0) {
        vec2 q = q1;
        q1 = triangle ? q2 : q3;
        if (triangle) {
            q2 = q;
            q3 = q;
        } else {
            q3 = q;
        }
    }
    bool narrow = other == 0u;
    vec2 last = triangle ? q2 : q3;
    vec2 r0 = widened(last, q0, q1, margin, narrow), r1 = widened(q0, q1, q2, margin, narrow);
    vec2 r2 = widened(q1, q2, triangle ? q0 : q3, margin, narrow);
    vec2 r3 = r2;
    if (!triangle) r3 = widened(q2, q3, q0, margin, narrow);

    // Slivers: a box along their longest edge.
    vec2 longest = d1;
    longest = dot(d2, d2) > dot(longest, longest) ? d2 : longest;
    longest = dot(d3, d3) > dot(longest, longest) ? d3 : longest;
    vec2 u = d2 - d1, v = d3 - d1, t = d3 - d2;
    longest = dot(u, u) > dot(longest, longest) ? u : longest;
    longest = dot(v, v) > dot(longest, longest) ? v : longest;
    longest = dot(t, t) > dot(longest, longest) ? t : longest;
    float size = dot(longest, longest);
    u = size > 1e-12 ? longest * inversesqrt(max(size, 1e-12)) : vec2(1.0, 0.0);
    v = vec2(-u.y, u.x);
    vec4 along = vec4(0.0, dot(d1, u), dot(d2, u), dot(d3, u)), across = vec4(0.0, dot(d1, v), dot(d2, v), dot(d3, v));
    float along0 = min(min(along.x, along.y), min(along.z, along.w)) - margin;
    float along1 = max(max(along.x, along.y), max(along.z, along.w)) + margin;
    float across0 = min(min(across.x, across.y), min(across.z, across.w)) - margin;
    float across1 = max(max(across.x, across.y), max(across.z, across.w)) + margin;
    if (narrow) {
        r0 = p0 + along0 * u + across0 * v;
        r1 = p0 + along1 * u + across0 * v;
        r2 = p0 + along1 * u + across1 * v;
        r3 = p0 + along0 * u + across1 * v;
    }
    // Cells that the eye's plane cuts: the box.
    if (!regular) {
        vec2 low = vec2(box & 0xffffu) - push.half_extent, high = vec2(box >> 16) - push.half_extent;
        r0 = vec2(low.x, -low.y);
        r1 = vec2(high.x, -low.y);
        r2 = vec2(high.x, -high.y);
        r3 = vec2(low.x, -high.y);
    }
    vec2 unit = vec2(1.0, -1.0) / push.half_extent;
    Polygon polygon = Polygon(r0 * unit, r1 * unit, r2 * unit, r3 * unit);
    if (!there) polygon = Polygon(vec2(0.0), vec2(0.0), vec2(0.0), vec2(0.0));
    return polygon;
}

#endif
