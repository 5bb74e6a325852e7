// entry compute COMPUTE
//
// Upsamples an image to one with more pixels, which shows the same part of the image plane: cubic convolution of the 4 x 4
// pixels around a position, limited to the range of the nearest four, so that edges do not ring. Where that may be too coarse (REFINES),
// the pixels of the target are listed, to be drawn once more.
//
//   COMPUTE  one invocation per square between the centres of four pixels of the source: it owns the pixels of the target in it
//
//   in    the image with fewer pixels, premultiplied
//   out   accumulation image; list of pixels
//   error third order in the distance of pixels where the image is smooth; edges become as wide as the larger pixels
//   cost  16 fetches per square
//
// Source: Keys, 1981, with a = -1/2.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "frame/listed.glsl"
#include "shared/device.glsl"

layout(constant_id = SPEC_REFINES) const bool REFINES = false;

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = BINDING_SOURCE) uniform sampler2D source;
layout(set = 0, binding = BINDING_ACCUMULATION, rgba32f) uniform writeonly image2D accumulation;

layout(push_constant, std430) uniform UpsamplingPush {
    vec2 half_extent; // half the target, pixels
    vec2 half_source; // half the source, pixels
    float scale;      // side of a pixel of the target, in pixels of the source
    float inverse;    // 1 / scale
    float refine;     // second difference of colour in the source beyond which pixels are listed
    uint pad0;
} push;

// Returns the weights of four pixels for a position at a fraction t between the two in the middle.
vec4 weights_at(float t) {
    float u = 1.0 - t;
    return vec4(-0.5 * t * u * u, 1.0 + t * t * (1.5 * t - 2.5), 1.0 + u * u * (1.5 * u - 2.5), -0.5 * u * t * t);
}

// Returns the first pixel of the target at or beyond the centre of a pixel of the source: the same for both squares that meet there.
vec2 first_beyond(vec2 texel) {
    precise vec2 place = (texel + 0.5 - push.half_source) * push.inverse + push.half_extent - 0.5;
    return clamp(ceil(place), vec2(0.0), 2.0 * push.half_extent);
}

// Returns the greatest second difference of three pixels in a row.
float second_difference(vec4 a, vec4 b, vec4 c) {
    vec4 difference = abs((a - b) + (c - b));
    return max(max(difference.r, difference.g), max(difference.b, difference.a));
}

// Pixels that a workgroup lists, and where these begin.
shared uint group_count;
shared uint group_begin;

void main() {
    vec2 last = 2.0 * push.half_source - 1.0;
    // The squares at the source's edge reach beyond it, to the target's edge.
    vec2 square = vec2(INVOCATION.xy) - 1.0;
    vec2 begin = mix(first_beyond(square), vec2(0.0), lessThan(square, vec2(0.0)));
    vec2 end = max(mix(first_beyond(square + 1.0), 2.0 * push.half_extent, greaterThanEqual(square, last)), begin);
    vec4 taps[4][4];
    for (int y = 0; y < 4; ++y) {
        for (int x = 0; x < 4; ++x) {
            taps[y][x] = texelFetch(source, ivec2(clamp(square + vec2(x, y) - 1.0, vec2(0.0), last)), 0);
        }
    }
    vec4 least = min(min(taps[1][1], taps[1][2]), min(taps[2][1], taps[2][2]));
    vec4 most = max(max(taps[1][1], taps[1][2]), max(taps[2][1], taps[2][2]));
    for (float y = begin.y; y < end.y; y += 1.0) {
        for (float x = begin.x; x < end.x; x += 1.0) {
            vec2 t = fma(vec2(x, y) + 0.5 - push.half_extent, vec2(push.scale), push.half_source) - 0.5 - square;
            vec4 across = weights_at(t.x), down = weights_at(t.y), sum = vec4(0.0);
            for (int j = 0; j < 4; ++j) {
                vec4 row = vec4(0.0);
                for (int i = 0; i < 4; ++i) row = fma(vec4(across[i]), taps[j][i], row);
                sum = fma(vec4(down[j]), row, sum);
            }
            imageStore(accumulation, ivec2(x, y), clamp(sum, least, most));
        }
    }
    if (!REFINES) return;
    float bend = 0.0;
    for (int i = 1; i < 3; ++i) {
        for (int j = 1; j < 3; ++j) {
            bend = max(bend, second_difference(taps[j][i - 1], taps[j][i], taps[j][i + 1]));
            bend = max(bend, second_difference(taps[j - 1][i], taps[j][i], taps[j + 1][i]));
        }
    }
    uvec2 first = uvec2(begin), size = bend > push.refine ? uvec2(end - begin) : uvec2(0u);
    // The pixels of a workgroup follow each other, so that those drawn side by side lie side by side.
    if (gl_LocalInvocationIndex == 0u) group_count = 0u;
    barrier();
    uint at = size.x * size.y > 0u ? atomicAdd(group_count, size.x * size.y) : 0u;
    barrier();
    if (gl_LocalInvocationIndex == 0u) group_begin = group_count > 0u ? room_for(group_count, TILE_PIXELS) : 0u;
    barrier();
    at += group_begin;
    for (uint y = 0u; y < size.y; ++y) {
        for (uint x = 0u; x < size.x; ++x) pixels[at++] = first.x + x | first.y + y << 16;
    }
}
