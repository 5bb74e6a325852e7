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

// Opacity of an optical depth: 1 - exp(-od), accurate to a few units in the last place also where od is
// small and the subtraction would lose everything. The series' first omitted term is od^5/120, below
// 2^-24 of the result for od < 0.05; beyond, 1 - exp loses at most 2^-24 / 0.05 of it.
float alpha_of(float od) {
    return od < 0.05 ? od * (1.0 - od * (0.5 - od * (1.0 / 6.0 - od * (1.0 / 24.0)))) : 1.0 - exp(-od);
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
