// entry compute DRAW
// entry compute DRAW_WIDE
// entry compute REPAIR
//
// Gaussians splatted whole, front to back: elliptical weighted average splats, or with the integral along each pixel's own line.
//
//   DRAW       one invocation owns a column of a tile and blends the splats of its bin in registers, in the order of their centres
//   DRAW_WIDE  one invocation a pixel, for devices whose workgroups should be wide
//   REPAIR     one invocation for each listed pixel, in whose line the order by centres is too far from its own
//
// BY_PIXEL: splats are blended in the order of the places where the pixel's own line is nearest to their centres. They come nearly so. Each passes
// through a window of WAITING places, which the nearest leaves. A splat that should have come before one that has left lists the pixel.
// REPAIR draws it by sweeps through the bin: each finds the SWEPT nearest of those that are left.
//
//   in    bins of splats by distance of their centres, records of the view (splat-project.glsl)
//   out   accumulation image: premultiplied linear RGBA; BY_PIXEL: listed pixels, then for each the place of its bin at which REPAIR goes on
//   error opacity does not depend on the order: its only error is that of footprints. Colour mixes as if kernels did not overlap: two that do are wrong by at most the
//         product of their opacities times the difference of their colours
//   cost  per splat and pixel one exponential for the footprint and a series for opacity
//
// Source: Zwicker, Pfister, van Baar, Gross, EWA volume splatting, 2001. Windows: Radl et al., StopThePop, 2024 (the idea).
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"
#ifdef DRAW
#include "splat/column-lanes.glsl"
#else
#include "splat/pixel-lanes.glsl"
#endif
#include "frame/listed.glsl"
#include "shared/optics.glsl"
#include "splat/splats.glsl"

layout(constant_id = SPEC_SPLAT_EWA) const bool EWA = false;
layout(constant_id = SPEC_SPLAT_BY_PIXEL) const bool BY_PIXEL = false;

layout(local_size_x = 64 / ROWS) in;
layout(set = 0, binding = BINDING_SPLAT_RECORDS, std430) readonly buffer SplatRecords { vec4 splat_records[]; };

const float BEHIND_ALL = 3e38;

// Returns minus the logarithm to base 2 of an ellipse's optical depth at a pixel: a quadratic form less the logarithm of the peak.
float form_of(vec4 record0, vec4 record1, vec2 pixel) {
    vec2 from = pixel - record0.xy;
    return fma(from.x, record0.z * from.x, record1.y) + from.y * (record0.w * from.x + record1.x * from.y);
}

// Returns the share of an ellipse that is drawn: the same as of the kernel along the pixel's line.
float drawn_share(Meeting met, vec2 drawn) {
    if (met.beyond <= 0.0) return met.u >= drawn.x && met.u <= drawn.y ? 1.0 : 0.0;
    float most = most_of(met);
    vec2 ends = clamp((drawn - met.u) * met.along, -most, most);
    return max(error_function(ends.y) - error_function(ends.x), 0.0) / (2.0 * error_function(most));
}

// Returns whether a footprint covers a pixel; `form` is that of its ellipse, which ends at `end`.
bool covers(Meeting met, float form, float end) {
    return mix(met.beyond, end - form, EWA) > 0.0;
}

// Returns the optical depth of a splat whose footprint covers the pixel, between the depths that are drawn.
float optical_depth(Meeting met, float form, Line line, float extinction, vec2 drawn) {
    if (!EWA) return extinction * push.amplitude * line.unit * footprint(met, drawn);
    return exp2(-form) * (BOUNDED ? drawn_share(met, drawn) : 1.0);
}

// Returns the depth at which a line meets a splat in its order: where it is nearest to the centre. An ellipse covers lines that pass the kernel, and
// may be nearest to it anywhere.
float place_of(Meeting met, vec3 centre) {
    if (!EWA) return met.u;
    float z = dot(push.forward_reach.xyz, centre), most = 0.4 * push.h;
    return clamp(met.u, z - most, z + most);
}

// Returns the least depth at which the line may meet what follows in its bin a splat that it meets `at`. Bins ascend by the distance of centres, for
// parallel lines by their depth, and the line meets each within its reach: in distance along the line they are no nearer than twice the reach
// before, and depths differ by less. Ellipses near an eye inside have no bound.
float followed_from(float at) {
    return EWA && EYE_INSIDE ? -BEHIND_ALL : at - 2.0 * push.h;
}

#ifndef REPAIR
// A splat that waits to be blended: where the line is nearest to it, and what it adds.
struct Piece {
    float at;
    float depth;
    vec3 colour;
};

Piece waiting[ROWS * WAITING];

// Swaps a piece with one that waits and is nearer, or as near: those that wait are sorted, the farthest first, and of equals the last of the bin.
#define SWAP(j) { \
        Piece other = waiting[j]; \
        bool swaps = other.at <= piece.at; \
        waiting[j].at = swaps ? piece.at : other.at; \
        waiting[j].depth = swaps ? piece.depth : other.depth; \
        waiting[j].colour = mix(other.colour, piece.colour, bvec3(swaps)); \
        piece.at = swaps ? other.at : piece.at; \
        piece.depth = swaps ? other.depth : piece.depth; \
        piece.colour = mix(piece.colour, other.colour, bvec3(swaps)); \
    }
#define EMPTY(j) waiting[j] = none;

void main() {
    uint lane = LANE;
    uint in_band = WORKGROUP_NUMBER;
    if (in_band >= push.tiles) return;
    uvec2 bin = bin_of(in_band);
    uint place = in_band * TILE_PIXELS + lane;
    uint i = RESUME ? splat_state[place].x : bin.x;
    uint end = bin.y, stop = min(end, i + MOST);
    if (RESUME && i >= end) return;
    uvec2 origin = first_pixel(in_band, lane);
    vec2 from = vec2(origin) + 0.5 - push.half_extent;
    Line lines[ROWS];
    vec2 drawn[ROWS];
    vec4 sum[ROWS];
    float transmittance[ROWS];
    float last[ROWS]; // BY_PIXEL: the farthest piece that is blended; BEHIND_ALL once one came too late
    float opaque = push.opaque;
    // BY_PIXEL: rows that are opaque and lie behind nothing that follows, or are listed; bit by bit.
    uint ended = 0u;
#define BEGIN(r) { \
        lines[r] = line_of(vec2(origin + uvec2(0, r)) + 0.5); \
        drawn[r] = drawn_depths(origin + uvec2(0, r)); \
        load_pixel(origin + uvec2(0, r), sum[r], transmittance[r]); \
        if (BY_PIXEL) { \
            last[r] = RESUME ? uintBitsToFloat(splat_state[place + r * TILE].y) : -BEHIND_ALL; \
            Piece none = Piece(last[r], 0.0, vec3(0.0)); \
            EACH_WAITING(EMPTY, r) \
            if (!in_image(origin + uvec2(0, r))) ended |= 1u << r; \
        } \
    }
    EACH_ROW(BEGIN)
    // Puts a piece among those that wait, and blends the nearest of them all.
#define BLEND_NEAREST(r, added) { \
        Piece piece = added; \
        EACH_WAITING(SWAP, r) \
        last[r] = piece.at < last[r] ? BEHIND_ALL : piece.at; \
        add_piece_behind(sum[r], transmittance[r], piece.colour, piece.depth); \
    }
#define BLEND_LAST(r) BLEND_NEAREST(r, Piece(BEHIND_ALL, 0.0, vec3(0.0)))
    float live = 1.0;
#define IS_LIVE ANY(BY_PIXEL ? ended != (1u << ROWS) - 1u : live > opaque)
    for (; i < stop && IS_LIVE; ++i) {
        uint id = bins[i];
        Read read = read_splat(id);
        Splat splat = splat_of(id, read.point);
        vec4 value = read.value, record0 = vec4(0.0), record1 = vec4(0.0);
        if (EWA) FETCH_TWO(splat_records, 2u * id, record0, record1)
        live = 0.0;
#define BLEND(r) { \
            Meeting met = meet(lines[r], splat); \
            float form = form_of(record0, record1, from + vec2(0.0, float(r))); \
            if (covers(met, form, record1.z)) { \
                float depth = optical_depth(met, form, lines[r], value.a, drawn[r]); \
                if (BY_PIXEL) { \
                    float at = place_of(met, splat.centre); \
                    BLEND_NEAREST(r, Piece(at, depth, value.rgb)) \
                    bool over = transmittance[r] <= opaque && followed_from(at) > last[r]; \
                    ended |= uint(over || last[r] == BEHIND_ALL) << r; \
                } else add_piece_behind(sum[r], transmittance[r], value.rgb, depth); \
            } \
            live = max(live, transmittance[r]); \
        }
        EACH_ROW(BLEND)
    }
    // Opaque pixels have ended; all invocations of a subgroup agree.
    bool unfinished = i < end && IS_LIVE;
    splat_state[place].x = unfinished ? i : end;
    if (unfinished && IS_LAST) atomicAdd(status[STATUS_UNFINISHED], 1u);
    // What waits is blended: what another dispatch puts before it lists the pixel.
#define END(r) { \
        uvec2 pixel = origin + uvec2(0, r); \
        if (BY_PIXEL) { \
            AS_MANY(BLEND_LAST, r) \
            splat_state[place + r * TILE].y = floatBitsToUint(last[r]); \
            if (!unfinished && last[r] == BEHIND_ALL && in_image(pixel)) pixels[room_for(1u, TILE_PIXELS)] = pixel.x | pixel.y << 16; \
        } \
        store_pixel(pixel, sum[r]); \
    }
    EACH_ROW(END)
}
#else
// Whether this dispatch continues where another has ended. One pipeline does both: it meets a splat at the same depth, to the bit.
#define RESUMES ((push.turns >> 30 & 1u) != 0u)

// The nearest splats that are left, nearest first: where the line is nearest to them, and their place in the bin.
const uint SWEPT = 16;
float swept_at[SWEPT];
uint swept[SWEPT];

// Written out: drivers that limit a shader's iterations count those of inner loops, too.
#define EACH_SWEPT(f) f(0) f(1) f(2) f(3) f(4) f(5) f(6) f(7) f(8) f(9) f(10) f(11) f(12) f(13) f(14) f(15)

// Puts a splat in its place among the swept ones, of equals the last; those behind it move on, and the farthest is left over.
#define SWEEP(j) { \
        before = before || at < swept_at[j]; \
        float other_at = swept_at[j]; \
        uint other = swept[j]; \
        swept_at[j] = before ? at : other_at; \
        swept[j] = before ? which : other; \
        at = before ? other_at : at; \
        which = before ? other : which; \
    }
#define EMPTY(j) { \
        swept_at[j] = BEHIND_ALL; \
        swept[j] = 0u; \
    }
#define FIRST_SWEPT(j) if (swept_at[j] < BEHIND_ALL) begin = min(begin, swept[j]);

void main() {
    uint number = INVOCATION_NUMBER;
    if (number >= pixels[PIXELS_COUNT]) return;
    uint word = pixels[PIXELS_FIRST + number];
    uvec2 pixel = uvec2(word & 0xffffu, word >> 16);
    uint across = (uint(2.0 * push.half_extent.x) + TILE - 1u) / TILE;
    uvec2 bin = bin_of(pixel.y / TILE * across + pixel.x / TILE - push.band);
    vec2 from = vec2(pixel) + 0.5 - push.half_extent;
    Line line = line_of(vec2(pixel) + 0.5);
    vec2 drawn = drawn_depths(pixel);
    // The last that is blended, by its place among those as near, and the first that is left.
    uint begin_at = PIXELS_FIRST + push.tiles * TILE_PIXELS + number;
    float last_at = RESUMES ? uintBitsToFloat(splat_state[number].x) : -BEHIND_ALL;
    uint last = RESUMES ? splat_state[number].y : 0u, begin = RESUMES ? pixels[begin_at] : bin.x;
    vec4 sum = RESUMES ? imageLoad(accumulation, ivec2(pixel)) : vec4(0.0);
    float transmittance = 1.0 - sum.a, opaque = push.opaque;
    if (last_at == BEHIND_ALL) return;
    // Iterations that are left, of which a sweep's other loops take some.
    const uint OTHERS = SWEPT + 2u;
    uint room = MOST;
    bool left = begin < bin.y, stuck = false;
    while (left && transmittance > opaque && room > OTHERS) {
        EACH_SWEPT(EMPTY)
        uint first_left = bin.y, i = begin, stop = begin + min(bin.y - begin, room - OTHERS);
        bool passed = false;
        for (; i < stop && !passed; ++i) {
            uint id = bins[i];
            vec4 record0 = vec4(0.0), record1 = vec4(0.0);
            if (EWA) {
                record0 = splat_records[2u * id];
                record1 = splat_records[2u * id + 1u];
            }
            Meeting met = meet(line, splat_of(id, splat_points[2u * id]));
            bool there = covers(met, form_of(record0, record1, from), record1.z);
            float at = place_of(met, splat_points[2u * id].xyz);
            passed = there && followed_from(at) > swept_at[SWEPT - 1u];
            at = there && (at > last_at || (at == last_at && i >= last)) ? at : BEHIND_ALL;
            uint which = i;
            bool before = false;
            EACH_SWEPT(SWEEP)
            if (at < BEHIND_ALL) first_left = min(first_left, which);
        }
        if (i < bin.y && !passed) {
            // This dispatch cannot finish the sweep. The next one begins with the first that is left.
            uint began = begin;
            begin = min(first_left, i);
            EACH_SWEPT(FIRST_SWEPT)
            stuck = room == MOST && begin == began;
            break;
        }
        room -= i - begin + OTHERS;
        for (uint j = 0u; j < SWEPT; ++j) {
            if (swept_at[j] == BEHIND_ALL) break;
            uint id = bins[swept[j]];
            Read read = read_splat(id);
            vec4 record0 = vec4(0.0), record1 = vec4(0.0);
            if (EWA) {
                record0 = splat_records[2u * id];
                record1 = splat_records[2u * id + 1u];
            }
            Meeting met = meet(line, splat_of(id, read.point));
            float form = form_of(record0, record1, from);
            add_piece_behind(sum, transmittance, read.value.rgb, optical_depth(met, form, line, read.value.a, drawn));
            last_at = swept_at[j];
            last = swept[j] + 1u;
        }
        begin = min(first_left, i);
        left = begin < bin.y;
    }
    left = left && transmittance > opaque;
    // A sweep that no dispatch can finish.
    if (stuck) atomicAdd(status[STATUS_CUT], 1u);
    if (left && IS_LAST) atomicAdd(status[STATUS_UNFINISHED], 1u);
    splat_state[number] = uvec2(floatBitsToUint(left ? last_at : BEHIND_ALL), last);
    pixels[begin_at] = begin;
    store_pixel(pixel, sum);
}
#endif
