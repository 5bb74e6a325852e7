// entry compute COMPUTE
//
// Splats as a view sees them: the pixels that each may cover, its key in the order that they are drawn in, and for elliptical weighted
// averages the ellipse.
//
//   COMPUTE  one invocation a splat
//
//   in    splats (splats.glsl)
//   out   boxes of pixels, keys, records
//
// A kernel that ends at a covariance S (its ellipsoid is m + S^(1/2) of the unit sphere) is seen, in perspective, between the two
// places t for which the plane x = t z touches it: (z^2 - Szz) t^2 - 2 (x z - Sxz) t + (x^2 - Sxx) = 0.
//
// ELLIPSE: the affine approximation of the projection at the centre maps the covariance to the image (Zwicker 2001); the peak is the
// line integral through the centre. A footprint with a standard deviation below that of the pixel's filter is widened to it (LOWPASS_AUTO,
// Mueller 1998) or convolved with it (LOWPASS_FULL, Zwicker). A pixel averages opacity, not optical depth: the peak is lowered so that the
// sum of opacities over the image, 2 pi sqrt(det) (Ein(peak) - Ein(its value at the cut)), stays.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"
#include "shared/keys.glsl"
#include "shared/straight.glsl"
#include "splat/boxes.glsl"

layout(constant_id = SPEC_SPLAT_SHAPE) const uint SHAPE = SHAPE_ALIKE;
layout(constant_id = SPEC_SPLAT_KERNEL) const uint KERNEL = KERNEL_GAUSSIAN;
layout(constant_id = SPEC_SPLAT_DENSITY) const bool DENSITY = false;
layout(constant_id = SPEC_SPLAT_EWA) const bool EWA = false;
layout(constant_id = SPEC_SPLAT_ORDER) const uint ORDER = ORDER_CENTRES;
layout(constant_id = SPEC_SPLAT_AXIS) const uint AXIS_OF_SHEETS = 0;
layout(constant_id = SPEC_SPLAT_LOWPASS) const uint LOWPASS = LOWPASS_NONE;

layout(push_constant) uniform SplatViewPush {
    vec4 right;       // X of a centre, to the right of the image's middle: dot of xyz with it, + w
    vec4 up;          // Y
    vec4 forward;     // depth from the plane through the centre of the data; w: depth of the eye
    vec2 half_extent; // of the image, pixels
    float pixel;      // side of a pixel where lines are told apart
    float w0, w1;     // lines pass at (P w, depth) with w = w0 + w1 depth
    float unit;       // world length of a unit of depth
    float cut;        // distance at which kernels end, in sigmas, or along each axis
    float amplitude;
    float lowpass;    // variance of the pixel's filter, in pixels
    float thickness;  // of a sheet along its axis
    float eye;        // of the eye along that axis; beyond 1e30 for parallel lines, with the sign of where it is
    float middle;     // of the sheet of number 0
    uint count;       // splats
    float aspect;     // offsets of X, Y and depth from the eye are (X aspect + skew.x depth, Y + skew.y depth, depth) at right angles
    vec2 skew;
    uint room;        // places, of which those beyond the splats come last in order
    uint pad0;
} push;

layout(local_size_x = 64) in;
layout(set = 0, binding = BINDING_SPLAT_POINTS, std430) readonly buffer SplatPoints { vec4 splat_points[]; };
// COVARIANCES: roots (splats.glsl) in two, then covariances xx xy xz yy, yz zz.
layout(set = 0, binding = BINDING_SPLAT_SHAPES, std430) readonly buffer SplatShapes { vec4 splat_shapes[]; };
layout(set = 0, binding = BINDING_SPLAT_RECORDS, std430) writeonly buffer SplatRecords { vec4 splat_records[]; };
layout(set = 0, binding = BINDING_RANK_KEYS, std430) writeonly buffer SortKeys { uint sort_keys[]; };
layout(set = 0, binding = BINDING_ORDER, std430) writeonly buffer Order { uint order[]; };
layout(set = 0, binding = BINDING_BOXES, std430) writeonly buffer Boxes { uvec2 boxes[]; };

// Ein(x) = integral of (1 - exp(-t)) / t from 0 to x, to 1e-5: its series; beyond, with Abramowitz and Stegun 5.1.56.
float ein(float x) {
    if (x < 2.0) {
        float sum = 0.0, term = 1.0;
        for (uint k = 1u; k <= 14u; ++k) {
            term *= -x / float(k);
            sum -= term / float(k);
        }
        return sum;
    }
    float e1 = exp(-x) / x * (x * x + 2.334733 * x + 0.250621) / (x * x + 3.330657 * x + 1.681534);
    return 0.5772156649 + log(x) + e1;
}

// Sum of opacities of an ellipse in units of 2 pi sqrt(det): the integral of (1 - exp(-t)) / t between the optical depths at the cut and at the
// peak. `end` is the one over the other.
float hidden(float peak, float end) {
    return ein(peak) - ein(peak * end);
}

// The peak that hides y, which is less than what `start` hides: its root is found from above, where it is concave.
float peak_that_hides(float y, float start, float end) {
    float x = start;
    for (uint i = 0u; i < 8u; ++i) {
        float slope = x < 1e-3 ? 1.0 - end : (exp(-x * end) - exp(-x)) / x;
        x = clamp(x + (y - hidden(x, end)) / max(slope, 1e-30), y, start);
    }
    return x;
}

// Least and greatest place, x / w, of what spans x +- sqrt(xx) and w +- sqrt(ww) with the covariance xz; all of the image where it
// reaches behind the eye. `w` is proportional to the depth before the eye, of slope w1.
vec2 places(float x, float w, float xx, float xz, float ww) {
    float a = w * w - ww, b = x * w - xz, c = x * x - xx;
    if (a <= 0.0 || w <= 0.0) return vec2(-1e30, 1e30);
    float root = sqrt(max(b * b - a * c, 0.0));
    return vec2(b - root, b + root) / a;
}

// A kernel's centre in the view: to the right of its axis, up, depth; `w` is proportional to the depth before the eye.
struct Centre {
    float x, y, z, w;
};

Centre centre_of(vec3 m) {
    float x = dot(m, push.right.xyz) + push.right.w, y = dot(m, push.up.xyz) + push.up.w, z = dot(m, push.forward.xyz);
    return Centre(x, y, z, push.w0 + push.w1 * z);
}

// A kernel's covariance in the coordinates of the view, for one sigma.
struct Spread {
    float xx, xy, xz, yy, yz, zz;
};

// Kernels with a radius have `per_sigma`, the inverse of their sigma.
Spread spread_of(uint i, float per_sigma) {
    vec3 r = push.right.xyz, u = push.up.xyz, f = push.forward.xyz;
    if (SHAPE == SHAPE_COVARIANCES) {
        vec4 c0 = splat_shapes[4u * i + 2u], c1 = splat_shapes[4u * i + 3u];
        mat3 s = mat3(c0.x, c0.y, c0.z, c0.y, c0.w, c1.x, c0.z, c1.x, c1.y);
        vec3 sr = s * r, su = s * u, sf = s * f;
        return Spread(dot(r, sr), dot(r, su), dot(r, sf), dot(u, su), dot(u, sf), dot(f, sf));
    }
    float sigma = SHAPE == SHAPE_RADII ? 1.0 / per_sigma : 1.0, variance = sigma * sigma;
    return Spread(variance * dot(r, r), variance * dot(r, u), variance * dot(r, f), variance * dot(u, u), variance * dot(u, f), variance * dot(f, f));
}

// Whether the kernel is a product along the axes of a lattice, which ends on a box; others end on an ellipsoid.
const bool PRODUCT = SHAPE == SHAPE_ALIKE && KERNEL != KERNEL_GAUSSIAN;

// Returns half the depth that a kernel spans.
float reach_of(Spread spread) {
    vec3 f = push.forward.xyz;
    return PRODUCT ? push.cut * (abs(f.x) + abs(f.y) + abs(f.z)) : push.cut * sqrt(spread.zz);
}

// Returns the box of a kernel in the image: least and greatest place, in pixels from the image's centre, y down.
vec4 box_of(Centre c, Spread spread, float reach) {
    vec2 across, down;
    if (PRODUCT) {
        // A box: its extents, each for itself.
        vec3 r = push.right.xyz, u = push.up.xyz;
        vec2 side = push.cut * vec2(abs(r.x) + abs(r.y) + abs(r.z), abs(u.x) + abs(u.y) + abs(u.z));
        float near = c.w - abs(push.w1) * reach, far = c.w + abs(push.w1) * reach;
        vec2 low = vec2(c.x, c.y) - side, high = vec2(c.x, c.y) + side;
        bool before = near > 0.0;
        across = before ? vec2(low.x / (low.x < 0.0 ? near : far), high.x / (high.x > 0.0 ? near : far)) : vec2(-1e30, 1e30);
        down = before ? vec2(low.y / (low.y < 0.0 ? near : far), high.y / (high.y > 0.0 ? near : far)) : vec2(-1e30, 1e30);
    } else {
        float cut2 = push.cut * push.cut, ww = push.w1 * push.w1 * spread.zz * cut2;
        across = places(c.x, c.w, spread.xx * cut2, push.w1 * spread.xz * cut2, ww);
        down = places(c.y, c.w, spread.yy * cut2, push.w1 * spread.yz * cut2, ww);
    }
    return vec4(across.x, -down.y, across.y, -down.x) / push.pixel;
}

// An ellipse in the image, y down: covariance in square pixels with its determinant, and the optical depth at its centre.
struct Ellipse {
    float xx, xy, yy, det, peak;
};

// Returns the ellipse of a kernel: the image of its covariance by the projection's derivative at the centre, and the integral along the
// line through the centre, sqrt(2 pi / (t^T S^-1 t)).
Ellipse ellipse_of(uint i, Centre c, Spread spread) {
    float xx = spread.xx, xy = spread.xy, xz = spread.xz, yy = spread.yy, yz = spread.yz, zz = spread.zz;
    float s = 1.0 / (max(c.w, 1e-20) * push.pixel), gx = -c.x * push.w1 * s / max(c.w, 1e-20), gy = c.y * push.w1 * s / max(c.w, 1e-20);
    Ellipse to;
    to.xx = s * s * xx + 2.0 * s * gx * xz + gx * gx * zz;
    to.xy = -s * s * xy + s * gy * xz - gx * s * yz + gx * gy * zz;
    to.yy = s * s * yy - 2.0 * s * gy * yz + gy * gy * zz;
    vec3 t = vec3(c.x * push.w1, c.y * push.w1, c.w) / max(c.w, 1e-20);
    vec3 along_line = straight(t, push.aspect, push.skew);
    float along;
    if (SHAPE == SHAPE_COVARIANCES) {
        vec3 right = push.aspect * push.right.xyz + push.skew.x * push.forward.xyz, up = push.up.xyz + push.skew.y * push.forward.xyz;
        // By the root of the inverse: cofactors of discs and needles cancel. The line's direction is what the projection maps to 0.
        vec4 l0 = splat_shapes[4u * i];
        vec2 l1 = splat_shapes[4u * i + 1u].xy;
        vec3 v = along_line.x * right + along_line.y * up + along_line.z * push.forward.xyz;
        vec3 lv = vec3(l0.x * v.x, l0.y * v.x + l0.z * v.y, l0.w * v.x + l1.x * v.y + l1.y * v.z);
        along = dot(lv, lv);
        float root = s * s / (l0.x * l0.z * l1.y * push.aspect);
        to.det = root * root * along;
    } else {
        float cxx = yy * zz - yz * yz, cxy = xz * yz - xy * zz, cxz = xy * yz - xz * yy;
        float cyy = xx * zz - xz * xz, cyz = xy * xz - xx * yz, czz = xx * yy - xy * xy;
        float det = xx * cxx + xy * cxy + xz * cxz;
        along = (cxx * t.x * t.x + cyy * t.y * t.y + czz * t.z * t.z + 2.0 * (cxy * t.x * t.y + cxz * t.x * t.z + cyz * t.y * t.z)) / det;
        to.det = to.xx * to.yy - to.xy * to.xy;
    }
    to.peak = splat_points[2u * i + 1u].a * push.amplitude * push.unit * sqrt(6.283185307 / along) * length(along_line);
    return to;
}

// Widens an ellipse by the pixel's filter, and lowers its peak so that the sum of opacities in the image stays.
void lowpass(inout Ellipse to) {
    float middle = 0.5 * (to.xx + to.yy), spread = sqrt(max(middle * middle - to.det, 0.0));
    float large = middle + spread, small = max(to.det, 0.0) / max(large, 1e-30), wide;
    if (LOWPASS == LOWPASS_FULL) {
        to.xx += push.lowpass;
        to.yy += push.lowpass;
        wide = (large + push.lowpass) * (small + push.lowpass);
    } else if (small < push.lowpass) {
        float large_to = max(large, push.lowpass), by = spread > 1e-6 * middle ? (large_to - push.lowpass) / (2.0 * spread) : 0.0;
        to.xx = push.lowpass + by * (to.xx - small);
        to.yy = push.lowpass + by * (to.yy - small);
        to.xy *= by;
        wide = large_to * push.lowpass;
    } else {
        wide = large * small;
    }
    float ratio = sqrt(clamp(large * small / wide, 0.0, 1.0));
    float bounded = min(to.peak, 1e30), end = exp(-0.5 * (push.cut * push.cut));
    if (ratio < 0.9999) to.peak = peak_that_hides(ratio * hidden(bounded, end), bounded, end);
    to.det = wide;
}

// Returns the sort key of a kernel that spans z +- reach.
uint key_of(Centre c, float reach, vec3 m) {
    if (ORDER == ORDER_CENTRES) {
        // Distance from the eye less the depth of the plane through the centre of the data, without the difference.
        vec3 from_eye = straight(vec3(c.x, c.y, c.z - push.forward.w), push.aspect, push.skew);
        return float_key(c.z + (push.w1 == 0.0 ? 0.0 : further_than_deep(from_eye)));
    }
    if (ORDER == ORDER_NEAREST) return float_key(c.z - reach);
    float at = (floor(m[AXIS_OF_SHEETS] / push.thickness + 0.25) + push.middle) * push.thickness;
    // Lines go both ways from an eye between sheets.
    float key = abs(push.eye) > 1e30 ? (push.eye < 0.0 ? at : -at) : abs(at - push.eye);
    return (float_key(key) & 0xfffffffeu) | uint(at > push.eye);
}

void main() {
    uint i = INVOCATION_NUMBER;
    if (i >= push.room) return;
    if (i >= push.count) {
        boxes[i] = uvec2(0u);
        sort_keys[i] = 0xffffffffu;
        order[i] = i;
        return;
    }
    vec4 point = splat_points[SHAPE == SHAPE_ALIKE && !DENSITY ? i : 2u * i];
    Centre c = centre_of(point.xyz);
    Spread spread = spread_of(i, point.w);
    float reach = reach_of(spread);
    vec4 box = box_of(c, spread, reach);
    bool there = c.z + reach > push.forward.w;

    if (EWA) {
        Ellipse to = ellipse_of(i, c, spread);
        if (LOWPASS != LOWPASS_NONE) lowpass(to);
        vec2 centre = vec2(c.x, -c.y) / (max(c.w, 1e-20) * push.pixel);
        vec2 side = push.cut * sqrt(vec2(to.xx, to.yy));
        box = vec4(centre - side, centre + side);
        // Behind the eye there is no ellipse.
        there = there && c.w > 0.0 && c.z > push.forward.w && to.det > 0.0;
        // For the exponential to base 2: the form, less the logarithm of the peak; and where it is cut.
        float half_bits = 0.72134752 / to.det, lowered = -log2(max(to.peak, 1e-37));
        splat_records[2u * i] = vec4(centre, to.yy * half_bits, -2.0 * to.xy * half_bits);
        splat_records[2u * i + 1u] = vec4(to.xx * half_bits, lowered, lowered + 0.72134752 * (push.cut * push.cut), 0.0);
    } else if (SHAPE == SHAPE_COVARIANCES) {
        splat_records[2u * i] = vec4(c.z - reach, c.z + reach, 0.0, 0.0);
    }

    uvec2 packed = packed_box(box, push.half_extent);
    there = there && packed != uvec2(0u);
    boxes[i] = there ? packed : uvec2(0u);
    sort_keys[i] = there ? key_of(c, reach, point.xyz) : 0xffffffffu;
    order[i] = i;
}
