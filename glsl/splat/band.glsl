// A band of tiles whose bins are drawn: the tiles, the pixels of their invocations, and where a dispatch goes on.
#ifndef BAND_GLSL
#define BAND_GLSL

#include "interface.glsl"
#include "frame/bounded.glsl"
#include "frame/hit-depths.glsl"
#include "shared/sides.glsl"

layout(constant_id = SPEC_RESUME) const bool RESUME = false;

layout(push_constant) uniform SplatPush {
    vec4 q0_kq;
    vec4 px_slope;      // w: change of the tangent of the angle between line and view with x; 0 for parallel lines
    vec4 py_slope;      // w: with y
    vec4 d0_slope;      // w: x of that tangent at the image's middle
    vec4 forward_reach; // depth of a centre: dot of it with xyz; w: half the depth that a kernel spans, of sigma 1
    float slope_y;      // y of that tangent
    uint sides;         // of the image (sides.glsl)
    float unit;         // world length of a unit of depth
    float h;            // in depth: thickness of a slab, or reach of the largest footprint; of trained splats: the middle's, from the eye
    float cut;          // distance at which kernels end, in sigmas
    float least;        // sum of weights that shows anything; of trained splats: the least standard deviation along a line
    float amplitude;    // weight of a kernel on a lattice, times its integral's unit
    float opaque;       // transmittance at which a line ends
    uint knots;
    uint band;          // first tile of the band
    uint tiles;         // their number
    uint turns;         // of a dispatch's loops; the highest bit where no other follows, the next where another came before
} push;

layout(set = 0, binding = BINDING_BIN_ENDS, std430) readonly buffer BinEnds { uint bin_ends[]; };
layout(set = 0, binding = BINDING_BINS, std430) buffer Bins { uint bins[]; };
layout(set = 0, binding = BINDING_SPLAT_STATE, std430) buffer SplatState { uvec2 splat_state[]; };
layout(set = 0, binding = BINDING_STATUS, std430) buffer Status { uint status[]; };
layout(set = 0, binding = BINDING_ACCUMULATION, rgba32f) uniform image2D accumulation;

#define MOST (push.turns & 0x3fffffffu)
#define IS_LAST ((push.turns >> 31) != 0u)

vec2 half_image() {
    return half_of(push.sides);
}

// Depth of the eye, where lines begin.
float nearest_depth() {
    return push.px_slope.w > 0.0 ? -push.q0_kq.w / push.unit : -3e38;
}

// Depths between which a pixel's line is drawn: from the eye on, and where anything else bounds it.
vec2 drawn_depths(uvec2 pixel) {
    uvec2 size = sides_of(push.sides);
    vec2 bounds = bounds_of(min(pixel, size - 1u), size.x);
    return vec2(max(bounds.x, nearest_depth()), bounds.y);
}

// The bin of a tile of the band.
uvec2 bin_of(uint in_band) {
    return uvec2(in_band == 0u ? 0u : bin_ends[in_band - 1u], bin_ends[in_band]);
}

// An invocation's first pixel.
uvec2 first_pixel(uint in_band, uint lane) {
    uint tile = push.band + in_band, across = (sides_of(push.sides).x + TILE - 1u) / TILE;
    return uvec2(tile % across, tile / across) * TILE + uvec2(lane % TILE, lane / TILE);
}

// The number of a pixel in the image.
uint number_of(uvec2 pixel) {
    return pixel.y * sides_of(push.sides).x + pixel.x;
}

// Notes what is blended between two depths, of which the line of a pixel is drawn between `drawn`.
void note_drawn(uvec2 pixel, vec2 drawn, float before, float after, float begin, float end) {
    note_hit(number_of(pixel), before, after, clamp(begin, drawn.x, drawn.y), clamp(end, drawn.x, drawn.y));
}

bool in_image(uvec2 pixel) {
    return all(lessThan(pixel, sides_of(push.sides)));
}

void load_pixel(uvec2 pixel, out vec4 sum, out float transmittance) {
    sum = RESUME && in_image(pixel) ? imageLoad(accumulation, ivec2(pixel)) : vec4(0.0);
    transmittance = in_image(pixel) ? 1.0 - sum.a : 0.0;
}

void store_pixel(uvec2 pixel, vec4 sum) {
    if (in_image(pixel)) imageStore(accumulation, ivec2(pixel), sum);
}

#endif
