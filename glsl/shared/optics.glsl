// The optical model that every technique shares: classification of a scalar, opacity and emission of a piece
// of a ray.

struct Knot {
    vec4 value;       // r, g, b, tau at this knot
    vec4 rise;        // change of the same up to the next knot; 0 at the last and at a jump
    float s;          // scalar, the data's units
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

// The knots that are walked through, in registers.
Knot walked[UNIFORM_KNOTS];

// Reads the knots. To be called once, before the first `classify`, outside of loops.
void load_knots() {
    for (uint i = 0; i < KNOT_WALK; ++i) walked[i] = knots_uniform.few[i];
}

vec4 on_piece(Knot knot, float s) {
    return knot.value + knot.rise * min((s - knot.s) * knot.inverse_ds, 1.0);
}

// Colour (rgb) and extinction per world unit (a) of scalar s: the knots' piecewise linear function,
// evaluated exactly up to rounding, continuous from the right at jumps. `count` is the number of knots.
vec4 classify(float s, uint count) {
    if (KNOT_WALK == 0) {
        uint below = 0, above = count; // knots[below].s <= s < knots[above].s, or s is left of all
        while (above - below > 1) {
            uint middle = (below + above) / 2;
            if (knots_storage.many[middle].s <= s) below = middle; else above = middle;
        }
        Knot knot = knots_storage.many[below];
        // NaN takes the knot's value, as in the walk.
        return s >= knot.s ? on_piece(knot, s) : knot.value;
    }
    // A constant number of turns: unrolled.
    vec4 value = walked[0].value;
    for (uint i = 0; i < KNOT_WALK; ++i) value = s >= walked[i].s ? on_piece(walked[i], s) : value;
    return value;
}

// Opacity of an optical depth that is not negative: 1 - exp(-od), accurate to a few units in the last place also where od is small and
// the subtraction would lose everything. With od log2(e) = k + f, |f| <= 1/2, it is (1 - 2^-k) - 2^-k (2^-f - 1), and what stands in the last
// parentheses is f times a series: the first omitted term is below 2e-8 of it. Where k is 0 nothing is subtracted.
float alpha_of(float od) {
    float x = min(od * 1.44269504, 120.0), k = floor(x + 0.5), f = x - k;
    float rest = f * (-0.693147181 + f * (0.240226507 + f * (-0.0555041087 + f * (0.00961812911 + f * (-0.00133335581 + f * (0.000154035304 + f * -0.0000152527338))))));
    float scale = intBitsToFloat((127 - int(k)) << 23);
    return (1.0 - scale) - scale * rest;
}

// What a piece of a ray of one colour emits and hides: premultiplied colour and opacity.
vec4 emission_of(vec3 colour, float od) {
    float alpha = alpha_of(od);
    return vec4(colour * alpha, alpha);
}

// Adds what lies behind, front to back.
void add_behind(inout vec4 sum, inout float transmittance, vec4 emission) {
    sum += transmittance * emission;
    transmittance -= transmittance * emission.a;
}

// The same of a piece of one colour.
void add_piece_behind(inout vec4 sum, inout float transmittance, vec3 colour, float od) {
    float share = transmittance * alpha_of(od);
    sum += share * vec4(colour, 1.0);
    transmittance -= share;
}
