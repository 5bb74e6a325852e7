// entry compute COMPUTE
//
// Upsamples an image to one with more pixels, which shows the same part of the image plane: cubic convolution of the 4 x 4
// pixels around a position, limited to the range of the nearest four, so that edges do not ring.
//
//   COMPUTE  one invocation per pixel of the target
//
//   in    the image with fewer pixels, premultiplied
//   out   accumulation image
//   error third order in the distance of pixels where the image is smooth; edges become as wide as the larger pixels
//   cost  16 fetches per pixel
//
// Source: Keys, 1981, with a = -1/2.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = BINDING_SOURCE) uniform sampler2D source;
layout(set = 0, binding = BINDING_ACCUMULATION, rgba32f) uniform writeonly image2D accumulation;

layout(push_constant, std430) uniform UpsamplingPush {
    vec2 half_extent; // half the target, pixels
    vec2 half_source; // half the source, pixels
    float scale;      // side of a pixel of the target, in pixels of the source
    uint pad0;
} push;

// Returns the weights of four pixels for a position at a fraction t between the two in the middle.
vec4 weights_at(float t) {
    float u = 1.0 - t;
    return vec4(-0.5 * t * u * u, 1.0 + t * t * (1.5 * t - 2.5), 1.0 + u * u * (1.5 * u - 2.5), -0.5 * u * t * t);
}

void main() {
    ivec2 pixel = ivec2(INVOCATION.xy);
    if (any(greaterThanEqual(pixel, ivec2(2.0 * push.half_extent + 0.5)))) return;
    vec2 place = fma(vec2(pixel) + 0.5 - push.half_extent, vec2(push.scale), push.half_source) - 0.5;
    vec2 base = floor(place);
    vec4 across = weights_at(place.x - base.x), down = weights_at(place.y - base.y);
    ivec2 first = ivec2(base) - 1, last = ivec2(2.0 * push.half_source + 0.5) - 1;
    vec4 sum = vec4(0.0), least = vec4(3e38), most = vec4(-3e38);
    for (int y = 0; y < 4; ++y) {
        vec4 row = vec4(0.0);
        for (int x = 0; x < 4; ++x) {
            vec4 texel = texelFetch(source, clamp(first + ivec2(x, y), ivec2(0), last), 0);
            row = fma(vec4(across[x]), texel, row);
            if ((x == 1 || x == 2) && (y == 1 || y == 2)) {
                least = min(least, texel);
                most = max(most, texel);
            }
        }
        sum = fma(vec4(down[y]), row, sum);
    }
    imageStore(accumulation, pixel, clamp(sum, least, most));
}
