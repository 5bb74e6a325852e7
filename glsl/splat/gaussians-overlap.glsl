// entry compute PLACE
// entry compute PLACE_WIDE
// entry compute SORT
// entry compute SHARE
// entry compute SHARE_WIDE
// entry compute ADJUST
// entry compute WEIGH
// entry compute BLEND
// entry compute BLEND_WIDE
//
// Trained splats as extinction along each pixel's line, where they overlap: C = sum of c_i w_i with w_i = ∫ κ_i(t) exp(-∫ Σ κ) dt.
//
// Each line is cut into SLABS, thin where it darkens. In a slab light falls as if all of it were spread evenly, so that no order is needed:
//
//   PLACE  puts the depths between slabs where the transmittance falls by equal steps of its square root, as splats come in their bin
//   SORT   puts these depths in order
//   SHARE  adds up the optical depth that each slab holds
//   ADJUST places the depths again, by what the slabs hold; then SHARE once more
//   WEIGH  finds what a unit of optical depth adds to the pixel from each slab
//   BLEND  adds up colours: each splat's share of each slab that it reaches into
//
// One invocation owns a column of a tile; by SORT, ADJUST, WEIGH and the entries ..._WIDE one pixel, for devices whose workgroups should be wide.
//
//   in     bins of splats, nearly by depth, records of the view (gaussians-project.glsl)
//   out    accumulation image: premultiplied RGBA, as trained: display-referred colours
//   error  opacity is exact to rounding; of colours the order within a slab is lost: of second order in 1 / SLABS
//   cost   four times through a bin: per splat and pixel a quadratic form, two exponentials, and an error function for each end of a slab within
//
// Source: Celarek et al. 2025 (the model); Kerbl et al. 2023.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"
#include "shared/error-function.glsl"
#if defined PLACE_WIDE || defined SORT || defined ADJUST || defined WEIGH || defined SHARE_WIDE || defined BLEND_WIDE
#include "splat/pixel-lanes.glsl"
#else
#include "splat/column-lanes.glsl"
#endif
#include "splat/band.glsl"
#include "splat/meet.glsl"

layout(constant_id = SPEC_SLAB_COUNT) const uint SLABS = 32;

layout(local_size_x = 64 / ROWS) in;
layout(set = 0, binding = BINDING_SPLAT_SLABS, std430) buffer SplatSlabs { uint slabs[]; };

const float BEHIND_ALL = 3e38;
const float MOST_DEPTH = 16.635532; // of a splat: that of an opacity which float32 does not tell from 1
const float REACH = 3.6;            // standard deviations that slabs are told apart in

// Words of a pixel: the depths between slabs, what each holds, the end of the part of its bin that is not dark, number of depths that are placed.
const uint SHARES = SLABS + 1u, LAST = 2u * SLABS + 1u, PLACED = LAST + 1u;
#define WORD(k) slabs[(k) * push.tiles * TILE_PIXELS + place]

// The same as SLABS, unknown to compilers, which would unroll loops of that length.
#define COUNT min(SLABS, uint(slabs.length()))

float number(uint place, uint k) {
    return uintBitsToFloat(WORD(k));
}

void put(uint place, uint k, float value) {
    WORD(k) = floatBitsToUint(value);
}

// A splat on a line: where it is met, its optical depth, and the shares of it before the line begins and ends.
struct Part {
    float at;
    float sigma;
    float depth;
    vec2 ends;
};

// Share of a splat that lies before a depth.
float before(Part part, float depth) {
    return 0.5 + 0.5 * error_function(clamp((depth - part.at) * (0.70710678 / part.sigma), -3.9, 3.9));
}

bool met(vec2 pixel, Record record, vec2 reference, vec2 drawn, out Part part) {
    Met met = meet(pixel, record, reference, drawn);
    if (!met.there) return false;
    part.at = met.depth;
    part.sigma = max(met.sigma, push.least);
    float peak = exp2(record.limits.y - met.bits), reach = REACH * part.sigma;
    // -log(1 - peak)
    part.depth = RULE == RULE_INTEGRAL ? peak : peak < 0.01 ? peak * (1.0 + peak * (0.5 + peak * 0.33333333)) : min(-log(max(1.0 - peak, 0.0)), MOST_DEPTH);
    part.ends = vec2(drawn.x < part.at - reach ? 0.0 : before(part, drawn.x), drawn.y > part.at + reach ? 1.0 : before(part, drawn.y));
    return part.ends.y > part.ends.x;
}

// Transmittance between slabs.
float level_of(uint k) {
    float root = 1.0 - float(k + 1u) / float(SLABS);
    return root * root;
}

#if defined PLACE || defined PLACE_WIDE
// Iterations that are left but for those that place depths: of all lanes at different splats.
uint room = MOST - 64u * SLABS;
// Those that a splat takes at most.
const uint TURNS = 1u + ROWS, ALWAYS = TURNS;

// Depth before which a share of a splat lies, nearly (Winitzki's inverse of the error function).
float depth_of(Part part, float share) {
    float x = clamp(2.0 * share - 1.0, -0.9999, 0.9999), l = log(1.0 - x * x), a = 4.3307468 + 0.5 * l;
    return part.at + part.sigma * 1.4142136 * sign(x) * sqrt(max(sqrt(a * a - l * 6.8027211) - a, 0.0));
}

// A line, as far as splats were met.
struct Line {
    vec2 drawn;
    float front, back;
    float transmittance;
    uint placed;
    bool dark;
};

Line begin_line(uvec2 pixel, uint place) {
    Line line = Line(drawn_depths(pixel), BEHIND_ALL, -BEHIND_ALL, 1.0, 0u, !in_image(pixel));
    if (RESUME) {
        line.front = number(place, 0u);
        line.back = number(place, SLABS);
        line.transmittance = uintBitsToFloat(splat_state[place].y);
        line.placed = WORD(PLACED);
    }
    return line;
}

void place_in(inout Line line, uint place, vec2 from, Record record, vec2 reference) {
    Part part;
    if (line.dark || !met(from, record, reference, line.drawn, part)) return;
    float left = line.transmittance * exp(-part.depth * (part.ends.y - part.ends.x)), reach = REACH * part.sigma;
    if (line.transmittance > push.opaque) {
        line.front = min(line.front, max(part.at - reach, line.drawn.x));
        line.back = max(line.back, min(part.at + reach, line.drawn.y));
    }
    for (; line.placed < SLABS - 1u && left <= level_of(line.placed); ++line.placed) {
        float share = clamp(log(line.transmittance / level_of(line.placed)) / part.depth, 0.0, 1.0);
        float depth = clamp(depth_of(part, part.ends.x + share), line.drawn.x, line.drawn.y);
        put(place, line.placed + 1u, depth);
    }
    line.transmittance = left;
    line.dark = left <= push.opaque && followed_from(record.limits.z) > line.back;
}

void end_line(Line line, uint place, uint i) {
    put(place, 0u, line.front);
    put(place, SLABS, line.back);
    WORD(PLACED) = line.placed;
    WORD(LAST) = i;
    splat_state[place].y = floatBitsToUint(line.transmittance);
}

#elif defined SORT
void main() {
    uint in_band = WORKGROUP_NUMBER, place = in_band * TILE_PIXELS + LANE;
    if (in_band >= push.tiles) return;
    uint placed = WORD(PLACED), count = COUNT;
    for (uint i = 2u; i <= placed; ++i) {
        float depth = number(place, i);
        uint k = i;
        for (; k > 1u && number(place, k - 1u) > depth; --k) put(place, k, number(place, k - 1u));
        put(place, k, depth);
    }
    float back = number(place, SLABS);
    for (uint k = placed + 1u; k < count; ++k) put(place, k, back);
    for (uint k = 0u; k < count; ++k) WORD(SHARES + k) = 0u;
}
#elif defined ADJUST
void main() {
    uint in_band = WORKGROUP_NUMBER, place = in_band * TILE_PIXELS + LANE;
    if (in_band >= push.tiles) return;
    float fresh[SLABS];
    uint placed = 0u, count = COUNT;
    float depth = 0.0, end = number(place, 0u);
    for (uint k = 0u; k < count; ++k) {
        float share = number(place, SHARES + k), begin = end;
        end = number(place, k + 1u);
        for (; placed < count - 1u; ++placed) {
            float wanted = -log(level_of(placed)) - depth;
            if (wanted > share) break;
            fresh[placed] = mix(begin, end, share > 0.0 ? max(wanted, 0.0) / share : 0.0);
        }
        depth += share;
        WORD(SHARES + k) = 0u;
    }
    for (uint k = 0u; k < placed; ++k) put(place, k + 1u, fresh[k]);
    for (uint k = placed + 1u; k < count; ++k) put(place, k, end);
}
#elif defined WEIGH
// Replaces the optical depth of each slab by the light that a unit of it adds.
void main() {
    uint in_band = WORKGROUP_NUMBER, place = in_band * TILE_PIXELS + LANE;
    if (in_band >= push.tiles) return;
    uvec2 pixel = first_pixel(in_band, LANE);
    float transmittance = 1.0, opacity = 0.0;
    uint count = COUNT;
    for (uint k = 0u; k < count; ++k) {
        float depth = number(place, SHARES + k), taken = transmittance * (depth < 1e-3 ? depth * (1.0 - 0.5 * depth) : 1.0 - exp(-depth));
        put(place, SHARES + k, depth > 0.0 ? taken / depth : transmittance);
        // Lines of pixels outside of the image are there, too, and slabs that hold nothing have no place.
        if (in_image(pixel) && taken > 0.0) {
            note_hit(number_of(pixel), transmittance, transmittance - taken, number(place, k), number(place, k + 1u));
        }
        transmittance -= taken;
        opacity += taken;
    }
    store_pixel(pixel, vec4(0.0, 0.0, 0.0, opacity));
}
#else
// The first step of a search among slabs.
const uint TOP = SLABS > 128u ? 128u : SLABS > 64u ? 64u : SLABS > 32u ? 32u : SLABS > 16u ? 16u : 8u;
// Iterations that are left, those that a splat takes at most, and those that it takes whatever it meets: of the search at most 9, of the slabs
// within one. Lanes of columns count together what they take beyond.
const uint TURNS = ROWS * (SLABS + 10u) + 1u, ALWAYS = ROWS > 1 ? ROWS * 10u + 1u : TURNS;
uint room = MOST;

// A line with the slabs that it is cut into.
struct Line {
    vec2 drawn;
    vec4 sum;
};

Line begin_line(uvec2 pixel, uint place) {
    Line line = Line(drawn_depths(pixel), vec4(0.0));
#if defined BLEND || defined BLEND_WIDE
    if (in_image(pixel)) line.sum = imageLoad(accumulation, ivec2(pixel));
#endif
    return line;
}

void place_in(inout Line line, uint place, vec2 from, Record record, vec2 reference) {
    Part part;
    bool there = met(from, record, reference, line.drawn, part);
    if (!ANY(there)) return;
    float low = part.at - REACH * part.sigma, high = part.at + REACH * part.sigma;
    uint k = 0u;
    for (uint leap = TOP; leap > 0u; leap /= 2u) k += k + leap < SLABS && number(place, k + leap) <= low ? leap : 0u;
    float passed = part.ends.x, weight = 0.0;
#if defined BLEND || defined BLEND_WIDE
#define ADD(share) weight = fma(share, number(place, SHARES + k), weight);
#else
#define ADD(share) put(place, SHARES + k, fma(part.depth, share, number(place, SHARES + k)));
#endif
    while (true) {
        float ends = k < SLABS - 1u ? number(place, k + 1u) : BEHIND_ALL;
        bool within = there && ends < high;
        if (!ANY(within)) break;
        if (within) {
            float share = clamp(before(part, ends), part.ends.x, part.ends.y);
            ADD(share - passed)
            passed = share;
            ++k;
        }
        if (ROWS > 1) room -= 1u;
    }
    if (!there) return;
    ADD(part.ends.y - passed)
#if defined BLEND || defined BLEND_WIDE
    line.sum.rgb = fma(vec3(part.depth * weight), record.colour.rgb, line.sum.rgb);
#endif
}

#endif

#if !defined SORT && !defined ADJUST && !defined WEIGH
void main() {
    uint in_band = WORKGROUP_NUMBER;
    if (in_band >= push.tiles) return;
    uvec2 bin = bin_of(in_band), origin = first_pixel(in_band, LANE);
    uint place = in_band * TILE_PIXELS + LANE, i = RESUME ? splat_state[place].x : bin.x;
#if defined PLACE || defined PLACE_WIDE
    uint end = bin.y;
#else
    uint end = WORD(LAST);
#endif
    if (RESUME && i >= end) return;
    vec2 from = vec2(origin) + 0.5 - half_image();
    Line lines[ROWS];
#define BEGIN(r) lines[r] = begin_line(origin + uvec2(0, r), place + r * TILE);
    EACH_ROW(BEGIN)
    bool live = true;
    for (; i < end && live && !ANY(room < TURNS); ++i) {
        uint at = record_of(bins[i], true);
        Record record;
        FETCH_RAY_RECORD(at, record)
        vec2 reference = reference_of(record.form.xy, half_image());
        room -= ALWAYS;
#define NEXT(r) place_in(lines[r], place + r * TILE, from + vec2(0.0, float(r)), record, reference);
        EACH_ROW(NEXT)
#if defined PLACE || defined PLACE_WIDE
#define LIVE(r) live = live || !lines[r].dark;
        live = false;
        EACH_ROW(LIVE)
        live = ANY(live);
#endif
    }
    bool unfinished = i < end && live;
    splat_state[place].x = unfinished ? i : bin.y;
    if (unfinished && IS_LAST) atomicAdd(status[STATUS_UNFINISHED], 1u);
#if defined PLACE || defined PLACE_WIDE
#define END(r) end_line(lines[r], place + r * TILE, i);
    EACH_ROW(END)
#elif defined BLEND || defined BLEND_WIDE
#define END(r) store_pixel(origin + uvec2(0, r), lines[r].sum);
    EACH_ROW(END)
#endif
}
#endif
