// Segments: pieces of a ray along which the scalar is linear between a front and a back value. The integrators below compute
// emission and opacity of one.
//
//   INTEGRAL  mean extinction and mean emission from 1-D cumulative tables; self-attenuation with the mean colour, weighted by
//             extinction: opacity exact, colour second order in the segment's optical depth
//   FULL      a table over front scalar, back scalar and length: accuracy limited by the table's size
//   EXACT     no table: knots split the segment; on each piece colour and extinction are linear
//
// Source: Engel, Kraus and Ertl, Graphics Hardware 2001 (FULL); partial pre-integration after Moreland, 2004
// (EXACT).
#ifndef SEGMENTS_GLSL
#define SEGMENTS_GLSL

#include "interface.glsl"
#include "shared/device.glsl"
#include "shared/integers.glsl"
#include "shared/interpolated.glsl"
#include "shared/optics.glsl"

layout(constant_id = SPEC_INTEGRATOR) const uint INTEGRATOR = 0;
layout(constant_id = SPEC_TABLE_FILTER) const bool TABLE_FILTER = false;
layout(constant_id = SPEC_PLACED) const bool PLACED = false;

struct TableHead {
    vec4 range;  // first and last scalar, bins or node spacings per unit of scalar, their width
    vec4 before; // r, g, b, extinction left of the first knot
    vec4 after;  // the same right of the last
    vec4 size;   // INTEGRAL: bins; FULL: nodes, layers, longest segment
};

// A bin of the cumulative table of the emission density (r, g, b, 1) * extinction.
struct CumulativeBin {
    vec4 high; // sum of the means of all bins before; high + low has twice the precision of float32
    vec4 low;
    vec4 mean; // mean density in the bin
    vec4 rise; // density in the bin: mean + rise (x - 1/2), x in [0, 1]
};

layout(set = 0, binding = BINDING_TABLE_HEAD, std430) readonly buffer Table {
    TableHead head;
    CumulativeBin bins[]; // INTEGRAL
} table;

// FULL: mean emission density over front scalar, back scalar and length.
layout(set = 0, binding = BINDING_TABLE) uniform sampler3D table_texels;

// Registers: the table's head.
TableHead head;

// Index of the last knot.
int last_knot;

// Registers: where the last segment that was integrated emits, from 0 in front to 1 at the back: the mean place, weighted by emission.
// Set where PLACED, except by FULL.
float emitted_at = 0.5;

// Loads the transfer function of `knots` knots and the table's head. Call it once, before the first segment, outside of loops.
void load_segments(uint knots) {
    load_knots();
    last_knot = int(knots) - 1;
    if (INTEGRATOR == INTEGRATOR_INTEGRAL || INTEGRATOR == INTEGRATOR_FULL) head = table.head;
}

// One end of a segment. Its look-ups serve the segments on both sides.
struct End {
    float s;
    CumulativeBin bin;
    float place; // index of the bin
    float x;     // position in the bin, in [0, 1]
    vec4 optics; // colour and extinction
    int knot;    // the last knot at or below s; -1: none
};

// An end before the first look-up. (A look-up of a constant would depend on uniforms alone: Mesa 22.3's software driver then compiles the shader
// anew with each dispatch.)
End no_end() {
    return End(0.0, CumulativeBin(vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0)), 0.0, 0.0, vec4(0.0), -1);
}

End end_at(float s) {
    End end;
    end.s = clamp(s, -1e37, 1e37);
    if (INTEGRATOR == INTEGRATOR_EXACT) {
        int below = -1;
        if (KNOT_WALK == 0) {
            int above = last_knot + 1;
            while (above - below > 1) {
                int middle = (below + above) / 2;
                if (knots_storage.many[middle].s <= end.s) below = middle; else above = middle;
            }
            Knot knot = knots_storage.many[max(below, 0)];
            end.optics = below < 0 ? knot.value : on_piece(knot, end.s);
        } else {
            // As in `classify`; knots beyond the last repeat it.
            end.optics = walked[0].value;
            for (uint i = 0; i < KNOT_WALK; ++i) {
                bool reached = end.s >= walked[i].s;
                end.optics = reached ? on_piece(walked[i], end.s) : end.optics;
                below += int(reached);
            }
        }
        end.knot = min(below, last_knot);
    }
    if (INTEGRATOR == INTEGRATOR_INTEGRAL) {
        float width = head.range.w;
        precise float from_first = clamp(end.s, head.range.x, head.range.y) - head.range.x;
        float place = floor(from_first * head.range.z);
        precise float x = from_first - place * width;
        // The first product may round to the wrong side of an edge; edges are exact.
        place = clamp(place + float(x >= width) - float(x < 0.0), 0.0, head.size.x - 1.0);
        x = from_first - place * width;
        end.place = place;
        // Below 1, so that a segment across an edge has a non-empty part in at least one of the two bins.
        end.x = min(x * head.range.z, 0.99999994);
        end.bin = table.bins[whole_of(place)];
    }
    return end;
}

// Returns premultiplied colour and opacity of a mean emission density over a length.
vec4 emission_of_density(vec4 density, float len) {
    float od = density.a * len;
    float alpha = alpha_of(od);
    // alpha / extinction; for small optical depths by the series of 1 - exp(-od), divided by the extinction.
    float series = fma(-od, fma(-od, fma(-od, 1.0 / 24.0, 1.0 / 6.0), 0.5), 1.0);
    float depth = od < 0.05 ? len * series : alpha / density.a;
    return vec4(density.rgb * depth, alpha);
}

// Returns the emission density of a colour and an extinction.
vec4 density_of(vec4 optics) {
    return vec4(optics.rgb * optics.a, optics.a);
}

// Returns the least difference of scalars to integrate over. Where the ends are nearer, the integral reaches this far to the right
// of the lower end: the transfer function is continuous from the right.
float least_difference(float s) {
    return max(abs(s) * 2.4e-7, 1e-30);
}

// Returns the density at position x of a bin.
vec4 on_line(CumulativeBin bin, float x) {
    return fma(bin.rise, vec4(x - 0.5), bin.mean);
}

// Returns the mean density between two scalars: the weighted mean of the parts left of the table's range, in it, and right of it.
vec4 integral_density(End front, End back, uint knots) {
    End low = front, high = back;
    if (front.s > back.s) {
        low = back;
        high = front;
    }
    float first = head.range.x, last = head.range.y;
    float wide = max(high.s, low.s + least_difference(low.s));
    vec3 weights = max(vec3(min(wide, first) - low.s, clamp(wide, first, last) - clamp(low.s, first, last),
                            wide - max(low.s, last)), 0.0);
    weights /= weights.x + weights.y + weights.z;
    vec4 inside;
    if (low.place == high.place) {
        inside = on_line(low.bin, 0.5 * (low.x + high.x));
    } else {
        // The rest of the lower bin, the beginning of the higher one, and the whole bins between them. The difference of the
        // cumulative sums contains the lower bin: its mean is subtracted, which leaves 0 for neighbours.
        float number = high.place - low.place - 1.0;
        precise vec4 middle = (high.bin.high - low.bin.high) + (high.bin.low - low.bin.low) - low.bin.mean;
        inside = (1.0 - low.x) * on_line(low.bin, 0.5 * (1.0 + low.x)) + high.x * on_line(high.bin, 0.5 * high.x);
        if (number > 0.0) inside += middle;
        inside /= (1.0 - low.x) + high.x + number;
    }
    vec4 density = weights.x * density_of(head.before) + weights.y * inside + weights.z * density_of(head.after);
    // Equal scalars may lie on a jump, which the bin smears: classify them instead. (A loop instead of a branch: software
    // rasterisers execute branches that no invocation takes.)
    for (uint turn = 0u; turn < uint(front.s == back.s); ++turn) density = density_of(classify(front.s, knots));
    return max(density, 0.0);
}

// Returns the effective mean density between two scalars in the table's range, for a length.
vec4 full_density(float front, float back, float len) {
    vec2 nodes = (vec2(front, back) - head.range.x) * head.range.z;
    float layer = clamp(log2(head.size.z / max(len, 1e-30)), 0.0, head.size.y - 1.0);
    vec3 size = head.size.xxy;
    vec3 place = vec3(nodes, layer);
    if (TABLE_FILTER) return textureLod(table_texels, sampled_at((place + 0.5) / size, size), 0.0);
    vec3 index = clamp(place, vec3(0.0), size - 1.0);
    ivec3 i = whole_of(index), j = min(i + 1, ivec3(size) - 1);
    vec3 w = index - vec3(i);
    vec4 v000 = texelFetch(table_texels, i, 0);
    vec4 v100 = texelFetch(table_texels, ivec3(j.x, i.y, i.z), 0);
    vec4 v010 = texelFetch(table_texels, ivec3(i.x, j.y, i.z), 0);
    vec4 v110 = texelFetch(table_texels, ivec3(j.x, j.y, i.z), 0);
    vec4 v001 = texelFetch(table_texels, ivec3(i.x, i.y, j.z), 0);
    vec4 v101 = texelFetch(table_texels, ivec3(j.x, i.y, j.z), 0);
    vec4 v011 = texelFetch(table_texels, ivec3(i.x, j.y, j.z), 0);
    vec4 v111 = texelFetch(table_texels, j, 0);
    vec4 low = interpolated(interpolated(v000, v100, w.x), interpolated(v010, v110, w.x), w.y);
    vec4 high = interpolated(interpolated(v001, v101, w.x), interpolated(v011, v111, w.x), w.y);
    return interpolated(low, high, w.z);
}

// Composites `back` behind `front`.
vec4 behind(vec4 front, vec4 back) {
    return fma(vec4(1.0 - front.a), back, front);
}

// Returns premultiplied colour and opacity of a segment by the full table. The table's range splits the segment: outside of it
// colour and extinction are constant.
vec4 full_segment(float front, float back, float len, uint knots) {
    float s0 = head.range.x, s1 = head.range.y;
    float inside_front = clamp(front, s0, s1), inside_back = clamp(back, s0, s1);
    // Where the segment enters and leaves the range, as fractions of its length.
    vec2 cut = front == back ? vec2(0.0) : clamp((vec2(inside_front, inside_back) - front) / (back - front), 0.0, 1.0);
    vec4 ahead = front < s0 ? head.before : head.after, after = back < s0 ? head.before : head.after;
    vec4 first = emission_of(ahead.rgb, ahead.a * (len * cut.x));
    vec4 last = emission_of(after.rgb, after.a * (len * (1.0 - cut.y)));
    float inside = len * (cut.y - cut.x);
    vec4 middle = inside > 0.0 ? emission_of_density(full_density(inside_front, inside_back, inside), inside) : vec4(0.0);
    vec4 all = behind(behind(first, middle), last);
    // Equal scalars, as in integral_density.
    for (uint turn = 0u; turn < uint(front == back); ++turn) {
        vec4 optics = classify(front, knots);
        all = emission_of(optics.rgb, optics.a * len);
    }
    return all;
}

// Returns the weight of the front colour in a piece along which colour is linear and extinction times length goes linearly from a
// to b; the back colour has the rest of the opacity. The weight is the integral over t in [0, 1] of 1 - exp(-od(t)), where
// od(t) = a t + (b - a) t^2 / 2; partial pre-integration calls it 1 - Psi. Gauss-Legendre with four points per panel, panels of an
// optical depth of about 2/3, ended where od is 12 and the integrand is 1: accurate to 1e-6, and no difference cancels.
float front_weight(float a, float b) {
    const float NODE[4] = float[](0.06943184420297371, 0.33000947820757187, 0.6699905217924281, 0.9305681557970263);
    const float WEIGHT[4] = float[](0.17392742256872692, 0.3260725774312731, 0.3260725774312731, 0.17392742256872692);
    // Larger extinctions are opaque all the same, but their squares would overflow.
    a = min(a, 1e15);
    b = min(b, 1e15);
    float od = min(0.5 * (a + b), 12.0);
    float root = sqrt(max(a * a + 24.0 * (b - a), 0.0));
    float cut = min(24.0 / max(a + root, 24.0), 1.0);
    float panels = max(ceil(1.5 * od), 1.0);
    float width = cut / panels;
    float sum = 0.0;
    for (float panel = 0.0; panel < panels; panel += 1.0) {
        for (int k = 0; k < 4; ++k) {
            float t = (panel + NODE[k]) * width;
            sum = fma(WEIGHT[k], alpha_of(t * fma(0.5 * (b - a), t, a)), sum);
        }
    }
    return sum * width + (1.0 - cut);
}

// Returns the opacity of an optical depth of at most 1/2, within 1e-7 of it: the polynomial that interpolates (1 - exp(-od)) / od
// at six Chebyshev nodes.
float alpha_of_half(float od) {
    float series = fma(od, fma(od, fma(od, -0.0011234042, 0.008189614), -0.041630074), 0.16666242);
    return od * fma(od, fma(od, series, -0.49999982), 1.0);
}

// A piece along which colour and extinction are linear.
struct LinearPiece {
    vec4 emission; // premultiplied colour and opacity
    float weight;  // of the front colour; the back colour has the rest of the opacity
};

// Returns a piece for optical depths up to 1/2. Gauss-Legendre with three points replaces `front_weight`: 1 - exp(-od(t)) is within 2e-7
// of a polynomial of degree 5 there.
LinearPiece thin_piece(vec4 ahead, vec4 after, float len) {
    float a = ahead.a * len, slope = 0.5 * (after.a - ahead.a) * len;
    float alpha = alpha_of_half(a + slope);
    const float NODE[3] = float[](0.1127016653792583, 0.5, 0.8872983346207417);
    float outer = alpha_of_half(NODE[0] * fma(slope, NODE[0], a)) + alpha_of_half(NODE[2] * fma(slope, NODE[2], a));
    float weight = fma(8.0 / 18.0, alpha_of_half(NODE[1] * fma(slope, NODE[1], a)), (5.0 / 18.0) * outer);
    return LinearPiece(vec4(fma(ahead.rgb, vec3(weight), after.rgb * (alpha - weight)), alpha), weight);
}

// The same for any optical depth.
LinearPiece thick_piece(vec4 ahead, vec4 after, float len) {
    float alpha = alpha_of(len * 0.5 * (ahead.a + after.a));
    float weight = front_weight(len * ahead.a, len * after.a);
    return LinearPiece(vec4(fma(ahead.rgb, vec3(weight), after.rgb * max(alpha - weight, 0.0)), alpha), weight);
}

// Returns the place of a piece's emission times its opacity, where it reaches from one place of the segment to another.
float moment_of(LinearPiece piece, float from, float to) {
    return fma(piece.weight, from - to, piece.emission.a * to);
}

// Sets where a segment emits from the sum of the moments of its pieces.
void set_emitted_at(float moment, float alpha) {
    emitted_at = alpha > 0.0 ? clamp(moment / alpha, 0.0, 1.0) : 0.5;
}

// Looks up the knot of an index.
void knot_at(int number, inout float s, inout vec4 optics) {
    if (KNOT_WALK == 0) {
        Knot knot = knots_storage.many[clamp(number, 0, last_knot)];
        s = knot.s;
        optics = knot.value;
        return;
    }
    for (uint i = 0; i < KNOT_WALK; ++i) {
        s = number == int(i) ? walked[i].s : s;
        optics = number == int(i) ? walked[i].value : optics;
    }
}

// Returns premultiplied colour and opacity of a segment, piece by piece: the knots that it crosses split it, in the order in which
// the ray meets them.
vec4 exact_pieces(End front, End back, float len) {
    bool rising = back.knot > front.knot;
    uint crossings = uint(abs(back.knot - front.knot));
    float scale = crossings == 0u ? 0.0 : 1.0 / (back.s - front.s), done = 0.0;
    vec4 ahead = front.optics, all = vec4(0.0);
    float moment = 0.0;
    for (uint turn = 0u; turn <= crossings; ++turn) {
        bool at_back = turn == crossings;
        int crossed = rising ? front.knot + 1 + int(turn) : front.knot - int(turn);
        float s = 0.0;
        vec4 after = vec4(0.0);
        if (KNOT_WALK == 0) {
            // A loop, because software rasterisers execute branches that no invocation takes.
            for (uint once = 0u; once < uint(!at_back); ++once) {
                s = knots_storage.many[crossed].s;
                after = knots_storage.many[crossed].value;
            }
        } else {
            knot_at(crossed, s, after);
        }
        after = at_back ? back.optics : after;
        // The fraction first: for nearly equal scalars in a large world len / (b - a) would overflow.
        float x = at_back ? 1.0 : clamp((s - front.s) * scale, done, 1.0);
        float piece_len = (x - done) * len;
        bool thick = max(ahead.a, after.a) * piece_len > 0.5;
        LinearPiece piece = thin_piece(ahead, after, piece_len);
        for (uint once = 0u; once < uint(thick); ++once) piece = thick_piece(ahead, after, piece_len);
        if (PLACED) moment = fma(1.0 - all.a, moment_of(piece, done, x), moment);
        all = behind(all, piece.emission);
        ahead = after;
        done = x;
    }
    if (PLACED) set_emitted_at(moment, all.a);
    return all;
}

// The same. Thin segments that cross at most one knot take the straight path, because software rasterisers run a loop for all
// invocations as soon as one needs it.
vec4 exact_between(End front, End back, float len) {
    uint crossings = uint(abs(back.knot - front.knot));
    float s = 0.0;
    vec4 knot = back.optics;
    if (KNOT_WALK != 0) knot_at(max(front.knot, back.knot), s, knot);
    vec4 middle = crossings == 0u ? back.optics : knot;
    float x = crossings == 0u ? 1.0 : clamp((s - front.s) / (back.s - front.s), 0.0, 1.0);
    LinearPiece first = thin_piece(front.optics, middle, len * x), second = thin_piece(middle, back.optics, len * (1.0 - x));
    vec4 all = behind(first.emission, second.emission);
    if (PLACED) set_emitted_at(fma(1.0 - first.emission.a, moment_of(second, x, 1.0), moment_of(first, 0.0, x)), all.a);
    bool thin = max(max(front.optics.a, back.optics.a), middle.a) * len <= 0.5;
    bool simple = thin && crossings <= (KNOT_WALK == 0 ? 0u : 1u);
    for (uint once = 0u; once < uint(!simple); ++once) all = exact_pieces(front, back, len);
    return all;
}

// Returns a piece of constant extinction, without its colour.
LinearPiece even_piece(float od) {
    float alpha = alpha_of(od);
    return LinearPiece(vec4(0.0, 0.0, 0.0, alpha), od < 0.05 ? od * fma(od, fma(od, 1.0 / 24.0, -1.0 / 6.0), 0.5) : 1.0 - alpha / od);
}

// Sets where a segment emits from its mean extinction, as if the extinction jumped from that of its front to that of its back: then the
// mean tells where. This is exact for one jump.
void set_emitted_at_jump(float ahead, float after, float mean, float len) {
    float x = ahead == after ? 0.5 : clamp((after - mean) / (after - ahead), 0.0, 1.0);
    LinearPiece first = even_piece(ahead * (len * x)), second = even_piece(after * (len * (1.0 - x)));
    float moment = fma(1.0 - first.emission.a, moment_of(second, x, 1.0), moment_of(first, 0.0, x));
    set_emitted_at(moment, behind(first.emission, second.emission).a);
}

// Returns premultiplied colour and opacity of a segment of world length `len`.
vec4 segment(End front, End back, float len, uint knots) {
    if (INTEGRATOR == INTEGRATOR_INTEGRAL) {
        vec4 density = integral_density(front, back, knots);
        if (PLACED) set_emitted_at_jump(classify(front.s, knots).a, classify(back.s, knots).a, density.a, len);
        return emission_of_density(density, len);
    }
    if (INTEGRATOR == INTEGRATOR_FULL) return full_segment(front.s, back.s, len, knots);
    return exact_between(front, back, len);
}

#endif
