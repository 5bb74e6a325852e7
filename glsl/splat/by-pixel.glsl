// Splats blended in each pixel's own order: of the places where its line meets them.
//
// Splats come nearly so. Each passes through a window of WAITING places, which the nearest leaves. One that should have come before another that
// has left lists the pixel. Listed pixels are drawn by sweeps through the bin: each finds the SWEPT nearest of those that are left.
//
// Lanes (column-lanes.glsl, pixel-lanes.glsl) come first. An includer that draws listed pixels defines REPAIR and the functions below, and calls repair.
//
// Source: Radl et al., StopThePop, 2024 (the idea of windows).
#ifndef BY_PIXEL_GLSL
#define BY_PIXEL_GLSL

#include "interface.glsl"
#include "shared/device.glsl"
#include "frame/listed.glsl"
#include "splat/band.glsl"

const float BEHIND_ALL = 3e38;

// Blends a piece behind others.
void blend_behind(inout vec4 sum, inout float transmittance, vec3 colour, float opacity) {
    float share = transmittance * opacity;
    sum = fma(vec4(share), vec4(colour, 1.0), sum);
    transmittance -= share;
}

#ifndef REPAIR
// A splat that waits to be blended: where the line meets it, and what it adds.
struct Piece {
    float at;
    float opacity;
    vec3 colour;
};

Piece waiting[ROWS * WAITING];

// Swaps a piece with one that waits and is nearer, or as near: those that wait are sorted, the farthest first, and of equals the last of the bin.
#define SWAP(j) { \
        Piece other = waiting[j]; \
        bool swaps = other.at <= piece.at; \
        waiting[j].at = swaps ? piece.at : other.at; \
        waiting[j].opacity = swaps ? piece.opacity : other.opacity; \
        waiting[j].colour = mix(other.colour, piece.colour, bvec3(swaps)); \
        piece.at = swaps ? other.at : piece.at; \
        piece.opacity = swaps ? other.opacity : piece.opacity; \
        piece.colour = mix(piece.colour, other.colour, bvec3(swaps)); \
    }
#define EMPTY(j) waiting[j] = none;
// Empties the window of a row; `after` is where the last one was met that has left.
#define EMPTY_WINDOW(r, after) { \
        Piece none = Piece(after, 0.0, vec3(0.0)); \
        EACH_WAITING(EMPTY, r) \
    }
// Puts a piece among those that wait, and blends the nearest of them all. `last` becomes BEHIND_ALL once one comes too late.
#define BLEND_NEAREST(r, pixel, drawn, added, sum, transmittance, last) { \
        Piece piece = added; \
        float before = transmittance; \
        EACH_WAITING(SWAP, r) \
        last = piece.at < last ? BEHIND_ALL : piece.at; \
        blend_behind(sum, transmittance, piece.colour, piece.opacity); \
        note_drawn(pixel, drawn, before, transmittance, piece.at, piece.at); \
    }
#else
// Begins the line of a pixel that is drawn again.
void begin_line(uvec2 pixel);
// Returns whether the line meets a splat, and where.
bool meets_line(uint id, out float at);
// Blends a splat that the line meets.
void blend_on_line(uint id, inout vec4 sum, inout float transmittance);
// Returns the least depth at which the line may meet what follows in its bin a splat that it meets `at`.
float followed_from(uint id, float at);

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

// Draws a listed pixel. (The includer passes the invocation's number, which depends on its own workgroup.)
void repair(uint number) {
    if (number >= pixels[PIXELS_COUNT]) return;
    uint word = pixels[PIXELS_FIRST + number];
    uvec2 pixel = uvec2(word & 0xffffu, word >> 16);
    uint across = (sides_of(push.sides).x + TILE - 1u) / TILE;
    uvec2 bin = bin_of(pixel.y / TILE * across + pixel.x / TILE - push.band);
    begin_line(pixel);
    // The last that is blended, by its place among those as near, and the first that is left.
    uint begin_at = PIXELS_FIRST + push.tiles * TILE_PIXELS + number;
    float last_at = RESUMES ? uintBitsToFloat(splat_state[number].x) : -BEHIND_ALL;
    uint last = RESUMES ? splat_state[number].y : 0u, begin = RESUMES ? pixels[begin_at] : bin.x;
    vec4 sum = RESUMES ? imageLoad(accumulation, ivec2(pixel)) : vec4(0.0);
    float transmittance = 1.0 - sum.a, opaque = push.opaque;
    if (last_at == BEHIND_ALL) return;
    if (!RESUMES) forget_hit(number_of(pixel));
    // Iterations that are left, of which a sweep's other loops take some.
    const uint OTHERS = SWEPT + 2u;
    uint room = MOST;
    bool left = begin < bin.y, stuck = false;
    while (left && transmittance > opaque && room > OTHERS) {
        EACH_SWEPT(EMPTY)
        uint first_left = bin.y, i = begin, stop = begin + min(bin.y - begin, room - OTHERS);
        bool passed = false;
        for (; i < stop && !passed; ++i) {
            float at;
            bool there = meets_line(bins[i], at);
            passed = there && followed_from(bins[i], at) > swept_at[SWEPT - 1u];
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
            float before = transmittance;
            blend_on_line(bins[swept[j]], sum, transmittance);
            last_at = swept_at[j];
            note_drawn(pixel, drawn_depths(pixel), before, transmittance, last_at, last_at);
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

#endif
