// Slabs of equal depth between planes parallel to the image: what of one lies on a ray, and the polygon that
// covers it in the image. For grid.glsl's rays; z0 and h are depths.

layout(constant_id = SPEC_CLIP_ENDS) const bool CLIP_ENDS = true;

float slab_begin(uint slab) {
    return fma(float(slab), push.d0_h.w, push.py_z0.w);
}

// What of the slab [begin, end] lies on the ray inside `interval`, as depths; empty when x >= y. Without
// clipping: all of it where its middle lies inside.
vec2 slab_piece(float begin, float end, vec2 interval) {
    if (CLIP_ENDS) return vec2(max(begin, interval.x), min(end, interval.y));
    float middle = 0.5 * (begin + end);
    return vec2(begin, middle >= interval.x && middle <= interval.y ? end : begin);
}

#ifdef VERTEX
// Component `axis` of v alone.
vec3 along(vec3 v, int axis) {
    return vec3(axis == 0 ? v.x : 0.0, axis == 1 ? v.y : 0.0, axis == 2 ? v.z : 0.0);
}

// One corner of the polygon of a slab, of six in the order of a strip. Odd push.order draws the farthest slab
// first. Polygon order after Rezk Salama and Kolb, VMV 2005.
vec4 slab_corner(uint instance, uint vertex, out uint slab) {
    uint place = (push.order & 1u) != 0u ? push.count - 1u - instance : instance;
    slab = push.first + place;
    float h = push.d0_h.w, kq = push.q0_kq.w, kd = push.px_kd.w;
    float z = 0.5 * (slab_begin(slab) + slab_begin(slab + 1u));
    float w = kq + kd * z; // depth from the eye for perspective, 1 for orthographic

    // A strip 0 1 5 2 4 3 of the hexagon's corners.
    const int STRIP[6] = int[](0, 1, 5, 2, 4, 3);
    int corner = STRIP[vertex];

    // A slab that touches the eye may cover the whole image, and so may one that is far larger than it.
    if (CLIP_ENDS && (kd != 0.0 && w - 0.5 * h < 0.25 * h || magnified(w))) {
        return vec4(corner >= 1 && corner <= 3 ? 1.0 : -1.0, corner < 3 ? -1.0 : 1.0, 0.0, 1.0);
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
    vec3 normal = cross(px, py) / dot(cross(px, py), d0);

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

    return clip_of(point, z);
}
#endif

#ifdef COMPUTE
// The slabs of this dispatch that the ray meets, as [x, y); one more at each end against rounding: they have no
// length.
uvec2 slabs_of(vec2 interval) {
    vec2 place = (interval - push.py_z0.w) / push.d0_h.w;
    float begin = max(floor(place.x) - 1.0, float(push.first));
    float end = min(ceil(place.y) + 1.0, float(push.first + push.count));
    return interval.x < interval.y && begin < end ? uvec2(begin, end) : uvec2(0u);
}
#endif
