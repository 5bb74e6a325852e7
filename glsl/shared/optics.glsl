// The optical model that every technique shares: classification of a scalar by the transfer function, opacity and emission of a
// piece of a ray, front-to-back compositing.
#ifndef OPTICS_GLSL
#define OPTICS_GLSL

#include "interface.glsl"

struct Knot {
    vec4 value;       // r, g, b, extinction at this knot
    vec4 rise;        // their change up to the next knot; 0 at the last and at a jump
    float s;          // scalar, in the data's units
    float inverse_ds; // 1 / (scalar of the next knot - s); 0 at the last and at a jump
    float end;        // scalar of the next knot; 3e38 at the last
    float pad;
};

layout(constant_id = SPEC_KNOT_WALK) const uint KNOT_WALK = 0;

layout(set = 0, binding = BINDING_KNOTS_UNIFORM, std140) uniform KnotsUniform {
    Knot few[UNIFORM_KNOTS];
} knots_uniform;

layout(set = 0, binding = BINDING_KNOTS, std430) readonly buffer Knots {
    Knot many[];
} knots_storage;

// Registers: the knots, where there are few enough to search them in sequence.
Knot walked[UNIFORM_KNOTS];

// Loads the knots. Call it once, before the first `classify`, outside of loops.
void load_knots() {
    for (uint i = 0; i < KNOT_WALK; ++i) walked[i] = knots_uniform.few[i];
}

vec4 on_piece(Knot knot, float s) {
    return fma(knot.rise, vec4(min((s - knot.s) * knot.inverse_ds, 1.0)), knot.value);
}

// Returns colour (rgb) and extinction per world unit (a) of scalar s: the piecewise linear function of `count` knots, exact up to
// rounding, continuous from the right at jumps.
vec4 classify(float s, uint count) {
    if (KNOT_WALK == 0) {
        uint below = 0, above = count; // knots[below].s <= s < knots[above].s, or s is left of all
        while (above - below > 1) {
            uint middle = (below + above) / 2;
            if (knots_storage.many[middle].s <= s) below = middle; else above = middle;
        }
        Knot knot = knots_storage.many[below];
        // NaN yields the knot's value, as in the sequential search below.
        return s >= knot.s ? on_piece(knot, s) : knot.value;
    }
    // The number of iterations is constant, so compilers unroll the loop.
    vec4 value = walked[0].value;
    for (uint i = 0; i < KNOT_WALK; ++i) value = s >= walked[i].s ? on_piece(walked[i], s) : value;
    return value;
}

// Returns the opacity 1 - exp(-od) of an optical depth od >= 0, accurate to a few units in the last place also for small od, where
// the subtraction would cancel. With od log2(e) = k + f, |f| <= 1/2, it equals (1 - 2^-k) - 2^-k (2^-f - 1). The last parenthesis
// is f times a series, whose first omitted term is below 2e-8 of the sum. Where k is 0, nothing is subtracted.
float alpha_of(float od) {
    // The sum with 1.5 * 2^23 rounds x to a whole number k, which its last bits hold.
    float x = min(od * 1.44269504, 120.0);
    precise float sum = x + 12582912.0;
    precise float k = sum - 12582912.0;
    float f = x - k;
    float series = fma(f, fma(f, -0.0000152527338, 0.000154035304), -0.00133335581);
    series = fma(f, fma(f, fma(f, fma(f, series, 0.00961812911), -0.0555041087), 0.240226507), -0.693147181);
    float scale = intBitsToFloat((127 - floatBitsToInt(sum)) << 23);
    return fma(-scale, f * series, 1.0 - scale);
}

// Returns premultiplied colour and opacity of a piece of a ray of constant colour and optical depth `od`.
vec4 emission_of(vec3 colour, float od) {
    float alpha = alpha_of(od);
    return vec4(colour * alpha, alpha);
}

// Composites premultiplied colour and opacity behind `sum`.
void add_behind(inout vec4 sum, inout float transmittance, vec4 emission) {
    sum = fma(vec4(transmittance), emission, sum);
    transmittance = fma(-transmittance, emission.a, transmittance);
}

// Composites a piece of constant colour and optical depth `od` behind `sum`.
void add_piece_behind(inout vec4 sum, inout float transmittance, vec3 colour, float od) {
    float share = transmittance * alpha_of(od);
    sum = fma(vec4(share), vec4(colour, 1.0), sum);
    transmittance -= share;
}

#endif
