// Splats: kernels in their own space, and what of one lies on a pixel's line.
//
// A kernel's centre m lies in splat space: on a lattice voxel indices from the domain's centre, over sigma for Gaussians, so that all
// kernels are alike; else radii of the data from its centre. A pixel's line there is q + z d, z the depth from the plane through the
// centre. With the kernel's distance measured in sigmas (A = |d|^2, residual r = m - q - u d at the nearest point u) a Gaussian along the
// line is
//
//     exp(-|r|^2 / 2) exp(-A (z - u)^2 / 2),
//
// whose integral between two depths has two error functions. The residual is subtracted before it is squared: nothing cancels
// however far the eye is. Kernels that are products along the axes are summed up at Gauss-Legendre points.
//
// Source: Zwicker 2001; Mueller and Crawfis 1998 for slabs; Peikert, SciVis 2007, pages 4-20 and 4-21.
// Lanes (column-lanes.glsl, pixel-lanes.glsl) come first.
#ifndef SPLATS_GLSL
#define SPLATS_GLSL

#include "interface.glsl"
#include "shared/error-function.glsl"
#include "splat/band.glsl"

layout(constant_id = SPEC_SPLAT_SHAPE) const uint SHAPE = SHAPE_ALIKE;
layout(constant_id = SPEC_SPLAT_KERNEL) const uint KERNEL = KERNEL_GAUSSIAN;
layout(constant_id = SPEC_SPLAT_DENSITY) const bool DENSITY = false; // extinctions add up; else scalars are interpolated
layout(constant_id = SPEC_EYE_INSIDE) const bool EYE_INSIDE = false; // kernels may reach behind the eye

// Each splat's centre with its scalar, on a lattice whose scalars are interpolated; else two: centre and 1 / sigma, then colour and
// extinction, or scalar and weight.
layout(set = 0, binding = BINDING_SPLAT_POINTS, std430) readonly buffer SplatPoints { vec4 splat_points[]; };
layout(set = 0, binding = BINDING_SPLAT_SHAPES, std430) readonly buffer SplatShapes { vec4 splat_shapes[]; };   // see splat-project.glsl
layout(set = 0, binding = BINDING_SPLAT_DOMAIN, std430) readonly buffer SplatDomain { vec4 splat_domain[]; };   // half extents of a lattice, 0 where there is none
// What is read of a splat.
struct Read {
    vec4 point;
    vec4 value;
};

Read read_splat(uint id) {
    Read read = Read(vec4(0.0), vec4(0.0));
    if (SHAPE == SHAPE_ALIKE && !DENSITY) {
        read.point = FETCH(splat_points, id);
    } else {
        FETCH_TWO(splat_points, 2u * id, read.point, read.value)
    }
    return read;
}

const float HALF_SQRT_PI = 0.88622693;

struct Line {
    vec3 q, d;
    float inverse_a;
    float along;     // sqrt(a / 2): depths to arguments of the error function
    float scale;     // sqrt(pi) / 2 over that: half a Gaussian's integral over depths for each error function
    float unit;      // world length of a unit of depth along the line
};

Line line_of(vec2 pixel) {
    vec2 from = pixel - half_image();
    vec3 lateral = from.x * push.px_slope.xyz + from.y * push.py_slope.xyz;
    Line line;
    line.q = push.q0_kq.xyz + push.q0_kq.w * lateral;
    line.d = push.d0_slope.xyz + (push.px_slope.w > 0.0 ? push.unit : 0.0) * lateral;
    float a = dot(line.d, line.d);
    line.inverse_a = 1.0 / a;
    line.along = sqrt(0.5 * a);
    line.scale = HALF_SQRT_PI / line.along;
    vec2 slope = fma(from, vec2(push.px_slope.w, push.py_slope.w), vec2(push.d0_slope.w, push.slope_y));
    line.unit = push.unit * sqrt(1.0 + dot(slope, slope));
    return line;
}

// A kernel as a line meets it.
struct Meeting {
    float u;     // depth of the nearest point
    float along; // depths to arguments of the error function
    float beyond; // square of the distance to the cut, less that of the line; not positive where it misses
    float scale; // half a Gaussian's integral over depths, of peak 1, for each error function
    vec3 from;   // the line's point at depth 0, from the centre: for kernels that are summed up at points
    vec3 step;   // and its direction
};

struct Splat {
    vec3 centre;
    float inverse, sigma;
    vec4 root0;      // COVARIANCE: L with precision L^T L, l00 l10 l11 l20
    vec2 root1;      // l21 l22
};

Splat splat_of(uint id, vec4 point) {
    float inverse = SHAPE == SHAPE_RADII ? point.w : 1.0;
    Splat splat = Splat(point.xyz, inverse, 1.0 / inverse, vec4(0.0), vec2(0.0));
    if (SHAPE == SHAPE_COVARIANCES) {
        splat.root0 = splat_shapes[4u * id];
        splat.root1 = splat_shapes[4u * id + 1u].xy;
    }
    return splat;
}

vec3 in_sigmas(Splat splat, vec3 v) {
    return vec3(splat.root0.x * v.x, splat.root0.y * v.x + splat.root0.z * v.y, splat.root0.w * v.x + splat.root1.x * v.y + splat.root1.y * v.z);
}

Meeting meet(Line line, Splat splat) {
    Meeting met;
    vec3 b = splat.centre - line.q, d = line.d;
    float inverse_a = line.inverse_a, along = line.along * splat.inverse, scale = line.scale * splat.sigma;
    if (SHAPE == SHAPE_COVARIANCES) {
        b = in_sigmas(splat, b);
        d = in_sigmas(splat, d);
        float a = dot(d, d);
        inverse_a = 1.0 / a;
        along = sqrt(0.5 * a);
        scale = HALF_SQRT_PI / along;
    }
    met.u = dot(b, d) * inverse_a;
    vec3 r = b - met.u * d;
    if (SHAPE == SHAPE_COVARIANCES) {
        // Of a disc both terms are as long as its distance is in its thickness: what they were rounded by lies along the line, and is taken
        // out again.
        float rest = dot(r, d) * inverse_a;
        met.u += rest;
        r -= rest * d;
    }
    float e = dot(r, r) * (splat.inverse * splat.inverse);
    float beyond = push.cut * push.cut - e;
    met.along = along;
    met.beyond = beyond;
    met.scale = scale;
    met.from = -b * splat.inverse;
    met.step = d * splat.inverse;
    return met;
}

// Of a Gaussian whose cut the line does not miss: the greatest argument of the error function before the cut, and what error functions are multiplied by.
float most_of(Meeting met) {
    return min(sqrt(0.5 * met.beyond), 3.9);
}

float peak_of(Meeting met) {
    return exp(0.5 * (met.beyond - push.cut * push.cut)) * met.scale;
}

// One factor of a kernel that is a product.
float factor(float x) {
    x = abs(x);
    if (KERNEL == KERNEL_TENT) return max(1.0 - x, 0.0);
    if (KERNEL == KERNEL_BSPLINE) {
        float far = max(2.0 - x, 0.0), near = max(1.0 - x, 0.0);
        return (far * far * far - 4.0 * near * near * near) * (1.0 / 6.0);
    }
    // sinc(x) sinc(x / 3). Near the whole numbers the sine is the product's small number: its argument is reduced to them first.
    float whole = floor(x + 0.5), rest = x - whole;
    float sign = mod(whole, 2.0) == 0.0 ? 1.0 : -1.0;
    float y = 9.869604401 * rest * rest;
    float sine = sign * 3.14159265 * rest * (1.0 + y * (-0.1666666667 + y * (0.008333333333 + y * (-0.0001984126984 + y * 2.7557319e-6))));
    float z = 1.0471975512 * x, w = z * z;
    // sin(z) / z up to 3: its series.
    float slow = 1.0 + w * (-1.0 / 6.0 + w * (1.0 / 120.0 + w * (-1.0 / 5040.0 + w * (1.0 / 362880.0 + w * (-1.0 / 39916800.0 + w * (1.0 / 6227020800.0))))));
    return x < 3.0 ? (x < 1e-4 ? 1.0 : sine / (3.14159265 * x)) * slow : 0.0;
}

float kernel_at(vec3 p) {
    // Of the distance, with peak 1.
    if (KERNEL == KERNEL_BSPLINE && SHAPE == SHAPE_RADII) return 1.5 * factor(length(p));
    return factor(p.x) * factor(p.y) * factor(p.z);
}

// Depths between which a kernel that is no Gaussian is not 0.
vec2 support_of(Meeting met) {
    if (SHAPE == SHAPE_RADII) {
        float half_length = sqrt(max(met.beyond, 0.0)) / length(met.step);
        return vec2(met.u - half_length, met.u + half_length);
    }
    // Where the line runs along a face, it is inside or outside for all depths.
    vec3 inverse = 1.0 / mix(met.step, vec3(1e-12), lessThan(abs(met.step), vec3(1e-12)));
    vec3 t0 = (-push.cut - met.from) * inverse, t1 = (push.cut - met.from) * inverse;
    vec3 low = min(t0, t1), high = max(t0, t1);
    return vec2(max(low.x, max(low.y, low.z)), min(high.x, min(high.y, high.z)));
}

// Integral over depths, of two points; exact for cubics.
float sampled(Meeting met, float z0, float z1) {
    float middle = 0.5 * (z0 + z1), half_length = 0.5 * max(z1 - z0, 0.0);
    float offset = half_length * 0.57735027;
    return half_length * (kernel_at(met.from + (middle - offset) * met.step) + kernel_at(met.from + (middle + offset) * met.step));
}

// Whether the line passes a kernel before its cut. What follows is worth a branch: half of the lines of a tile miss a small kernel.
bool meets(Meeting met) {
    return (KERNEL != KERNEL_GAUSSIAN && SHAPE != SHAPE_RADII) || met.beyond > 0.0;
}

// The whole line integral in depth, of what is drawn, where the line meets the kernel.
float footprint(Meeting met, vec2 drawn) {
    if (KERNEL == KERNEL_GAUSSIAN) {
        float most = most_of(met);
        if (BOUNDED) {
            vec2 ends = clamp((drawn - met.u) * met.along, -most, most);
            return peak_of(met) * max(error_function(ends.y) - error_function(ends.x), 0.0);
        }
        float low = EYE_INSIDE ? clamp((drawn.x - met.u) * met.along, -most, most) : -most;
        float part = EYE_INSIDE ? error_function(most) - error_function(low) : 2.0 * error_function(most);
        return peak_of(met) * part;
    }
    vec2 range = support_of(met);
    if (EYE_INSIDE || BOUNDED) range.x = max(range.x, drawn.x);
    if (BOUNDED) range.y = min(range.y, drawn.y);
    float sum = 0.0, width = max(range.y - range.x, 0.0) * (1.0 / FOOTPRINT_PARTS);
    for (uint i = 0u; i < FOOTPRINT_PARTS; ++i) sum += sampled(met, range.x + float(i) * width, range.x + float(i + 1u) * width);
    return sum;
}

// What of the depths that are drawn lies inside a lattice's domain.
vec2 domain_of(Line line, vec2 drawn) {
    vec2 range = vec2(drawn.x, min(drawn.y, 1e30));
    vec3 half_box = splat_domain[0].xyz;
    if (SHAPE != SHAPE_ALIKE || DENSITY) return range;
    vec3 inverse = 1.0 / mix(line.d, vec3(1e-12), lessThan(abs(line.d), vec3(1e-12)));
    vec3 t0 = (-half_box - line.q) * inverse, t1 = (half_box - line.q) * inverse;
    vec3 low = min(t0, t1), high = max(t0, t1);
    return vec2(max(range.x, max(low.x, max(low.y, low.z))), min(range.y, min(high.x, min(high.y, high.z))));
}

#endif
