// The polygon that a slab (slab.glsl) covers in the image, for vertex stages.
#ifndef SLAB_OUTLINE_GLSL
#define SLAB_OUTLINE_GLSL

#include "grid/clip-space.glsl"
#include "grid/slab.glsl"

// Returns v with all components but `axis` set to 0.
vec3 along(vec3 v, int axis) {
    return vec3(axis == 0 ? v.x : 0.0, axis == 1 ? v.y : 0.0, axis == 2 ? v.z : 0.0);
}

// Returns a corner of the polygon of an instance's slab; six corners form a triangle strip. Order of corners after Rezk Salama and
// Kolb, VMV 2005.
vec4 slab_corner(uint instance, uint vertex, out uint slab) {
    uint place = (push.order & RASTER_BACK_TO_FRONT) != 0u ? push.count - 1u - instance : instance;
    slab = push.first + place;
    float h = push.d0_h.w, kq = push.q0_kq.w, kd = kd_of_view();
    float z = 0.5 * (slab_begin(slab) + slab_begin(slab + 1u));
    float w = kq + kd * z; // depth from the eye for perspective, 1 for orthographic

    // The strip's sequence of the hexagon's corners.
    const int STRIP[6] = int[](0, 1, 5, 2, 4, 3);
    int corner = STRIP[vertex];

    // A slab that touches the eye may cover the whole image, and so may a slab that is far larger than the image.
    if (CLIP_ENDS && (kd != 0.0 && w - 0.5 * h < 0.25 * h || magnified(w))) {
        return vec4(corner >= 1 && corner <= 3 ? 1.0 : -1.0, corner < 3 ? -1.0 : 1.0, 0.0, 1.0);
    }

    // Move each face of the domain outwards, so that the polygon on the slab's middle plane covers the outline of the whole slab.
    // Projecting a point at a distance delta from that plane, |delta| <= h / 2, onto it scales about the eye by w / (w + delta) in
    // perspective; parallel rays shift by delta d0.
    vec3 px = push.px_slope.xyz, py = push.py_z0.xyz, d0 = push.d0_h.xyz;
    vec3 low = -push.half_slope.xyz, high = push.half_slope.xyz;
    if (CLIP_ENDS) {
        // Add 1/32 pixel: rasterisers round vertices to 1/256, and fragments outside of the slab draw nothing.
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
    vec3 normal = cross(px, py) / dot(cross(px, py), d0);

    // Three paths of edges lead from the nearest corner of the box to the farthest, always to greater depth: the plane meets each
    // path once, and each of the three edges between paths at most once.
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

    return clip_of(point, z);
}

#endif
