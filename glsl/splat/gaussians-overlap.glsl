// entry compute PLACE
// entry compute SHARE
// entry compute BLEND
//
// Trained splats as extinction along each pixel's line, where they overlap: C = sum of c_i w_i with w_i = ∫ κ_i(t) exp(-∫ Σ κ) dt.
//
// Each line is cut into SLABS, thin where it darkens. In a slab light falls as if all of it were spread evenly, so that no order is needed:
//
//   PLACE  puts the depths between slabs where the transmittance falls by equal steps of its square root, as splats come in their bin
//   SHARE  adds up the optical depth that each slab holds, and from it what a unit of optical depth in the slab adds to the pixel
//   BLEND  adds up colours: each splat's share of each slab that it reaches into
//
//   in     bins of splats, nearly by depth, records of the view (gaussians-project.glsl)
//   out    accumulation image: premultiplied RGBA, as trained: display-referred colours
//   error  opacity is exact to rounding; of colours the order within a slab is lost: of second order in 1 / SLABS
//   cost   three times through a bin: per splat and pixel a quadratic form, two exponentials, and an error function for each end of a slab within
//
// Source: Celarek et al. 2025 (the model); Kerbl et al. 2023.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"
#include "shared/error-function.glsl"
#include "splat/pixel-lanes.glsl"
#include "splat/band.glsl"
#include "splat/meet.glsl"

layout(constant_id = SPEC_SLAB_COUNT) const uint SLABS = 32;

layout(local_size_x = 64) in;
layout(set = 0, binding = BINDING_SPLAT_SLABS, std430) buffer SplatSlabs { uint slabs[]; };

const float BEHIND_ALL = 3e38;
const float MOST_DEPTH = 16.635532; // of a splat: that of an opacity which float32 does not tell from 1
const float REACH = 4.0;            // standard deviations that slabs are told apart in

// Words of a pixel: the depths between slabs, what each holds, where the bin is dark, number of depths that are placed.
const uint SHARES = SLABS + 1u, LAST = 2u * SLABS + 1u, PLACED = LAST + 1u;
uint place;
#define WORD(k) slabs[(k) * push.tiles * TILE_PIXELS + place]

float number(uint k) {
    return uintBitsToFloat(WORD(k));
}

void put(uint k, float value) {
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

bool met(vec2 pixel, Record record, vec2 drawn, out Part part) {
    Met met = meet(pixel, record, reference_of(record.form.xy, push.half_extent), drawn);
    part.at = met.depth;
    part.sigma = max(met.sigma, push.least);
    float peak = exp2(record.limits.y - met.bits);
    // -log(1 - peak)
    part.depth = RULE == RULE_INTEGRAL ? peak : peak < 0.01 ? peak * (1.0 + peak * (0.5 + peak * 0.33333333)) : min(-log(1.0 - peak), MOST_DEPTH);
    part.ends = vec2(drawn.x < part.at - REACH * part.sigma ? 0.0 : before(part, drawn.x), drawn.y > part.at + REACH * part.sigma ? 1.0 : before(part, drawn.y));
    return met.there && part.ends.y > part.ends.x;
}

#ifdef PLACE
// Transmittance between slabs.
float level_of(uint k) {
    float root = 1.0 - float(k + 1u) / float(SLABS);
    return root * root;
}

// Depth before which a share of a splat lies, nearly (Winitzki's inverse of the error function).
float depth_of(Part part, float share) {
    float x = clamp(2.0 * share - 1.0, -0.9999, 0.9999), l = log(1.0 - x * x), a = 4.3307468 + 0.5 * l;
    return part.at + part.sigma * 1.4142136 * sign(x) * sqrt(sqrt(a * a - l * 6.8027211) - a);
}

void main() {
    uint in_band = WORKGROUP_NUMBER;
    if (in_band >= push.tiles) return;
    uvec2 bin = bin_of(in_band), pixel = first_pixel(in_band, LANE);
    place = in_band * TILE_PIXELS + LANE;
    uint i = RESUME ? splat_state[place].x : bin.x;
    if (RESUME && i >= bin.y || !in_image(pixel)) return;
    vec2 from = vec2(pixel) + 0.5 - push.half_extent, drawn = drawn_depths(pixel);
    float front = RESUME ? number(0u) : BEHIND_ALL, back = RESUME ? number(SLABS) : -BEHIND_ALL;
    float transmittance = RESUME ? uintBitsToFloat(splat_state[place].y) : 1.0, opaque = push.opaque;
    uint placed = RESUME ? WORD(PLACED) : 0u;
    // Placing all takes turns of its own.
    uint room = MOST - min(SLABS * (SLABS + 3u) / 2u, MOST - 1u), stop = i + min(bin.y - i, room);
    bool dark = false;
    for (; i < stop && !dark; ++i) {
        Record record = record_at(bins[i]);
        Part part;
        if (!met(from, record, drawn, part)) continue;
        float depth = part.depth * (part.ends.y - part.ends.x), left = transmittance * exp(-depth);
        if (transmittance > opaque) {
            front = min(front, max(part.at - REACH * part.sigma, drawn.x));
            back = max(back, min(part.at + REACH * part.sigma, drawn.y));
        }
        for (; placed < SLABS - 1u && left <= level_of(placed); ++placed) {
            float share = clamp(log(transmittance / level_of(placed)) / part.depth, 0.0, 1.0), z = depth_of(part, part.ends.x + share);
            z = clamp(z, drawn.x, drawn.y);
            uint k = placed + 1u;
            for (; k > 1u && number(k - 1u) > z; --k) WORD(k) = WORD(k - 1u);
            put(k, z);
        }
        transmittance = left;
        dark = transmittance <= opaque && followed_from(record.limits.z) > back;
    }
    bool unfinished = i < bin.y && !dark;
    if (unfinished && IS_LAST) atomicAdd(status[STATUS_UNFINISHED], 1u);
    put(0u, front);
    put(SLABS, back);
    WORD(PLACED) = placed;
    WORD(LAST) = i;
    splat_state[place] = uvec2(unfinished ? i : bin.y, floatBitsToUint(transmittance));
    if (unfinished) return;
    for (uint k = placed + 1u; k < SLABS; ++k) put(k, back);
    for (uint k = 0u; k < SLABS; ++k) WORD(SHARES + k) = 0u;
}
#else
void main() {
    uint in_band = WORKGROUP_NUMBER;
    if (in_band >= push.tiles) return;
    uvec2 bin = bin_of(in_band), pixel = first_pixel(in_band, LANE);
    place = in_band * TILE_PIXELS + LANE;
    uint i = RESUME ? splat_state[place].x : bin.x, end = in_image(pixel) ? WORD(LAST) : 0u;
    if (i >= end && (RESUME || !in_image(pixel))) return;
    vec2 from = vec2(pixel) + 0.5 - push.half_extent, drawn = drawn_depths(pixel);
    vec4 sum = vec4(0.0);
    float transmittance;
#ifdef BLEND
    sum = imageLoad(accumulation, ivec2(pixel));
#endif
    // What a splat takes at most: a search of slabs, and all of them.
    const uint TURNS = SLABS + 8u;
    for (uint room = MOST; i < end && room >= TURNS; ++i) {
        Record record = record_at(bins[i]);
        Part part;
        room -= 1u;
        if (!met(from, record, drawn, part)) continue;
        float low = part.at - REACH * part.sigma, high = part.at + REACH * part.sigma;
        uint k = 0u, beyond = SLABS;
        while (beyond - k > 1u) {
            uint middle = (k + beyond) / 2u;
            if (number(middle) <= low) k = middle; else beyond = middle;
            room -= 1u;
        }
        float passed = part.ends.x, weight = 0.0;
#ifdef SHARE
#define ADD(share) put(SHARES + k, fma(part.depth, share, number(SHARES + k)));
#else
#define ADD(share) weight = fma(share, number(SHARES + k), weight);
#endif
        for (; k < SLABS - 1u; ++k) {
            float ends = number(k + 1u);
            if (ends >= high) break;
            float share = clamp(before(part, ends), part.ends.x, part.ends.y);
            ADD(share - passed)
            passed = share;
            room -= 1u;
        }
        ADD(part.ends.y - passed)
        sum.rgb = fma(vec3(part.depth * weight), record.colour.rgb, sum.rgb);
    }
    bool unfinished = i < end;
    if (unfinished && IS_LAST) atomicAdd(status[STATUS_UNFINISHED], 1u);
    splat_state[place].x = i;
#ifdef SHARE
    if (unfinished) return;
    // What a unit of optical depth adds, over a slab.
    transmittance = 1.0;
    for (uint k = 0u; k < SLABS; ++k) {
        float depth = number(SHARES + k), taken = transmittance * (depth < 1e-3 ? depth * (1.0 - 0.5 * depth) : 1.0 - exp(-depth));
        put(SHARES + k, depth > 0.0 ? taken / depth : transmittance);
        transmittance -= taken;
        sum.a += taken;
    }
#endif
    store_pixel(pixel, sum);
}
#endif
