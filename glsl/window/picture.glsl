// entry fragment FRAGMENT
//
// Draws a picture into a rectangle of a window: composited over a background, encoded as sRGB unless it is displayed as it is, magnified where it has fewer pixels
// than the rectangle. Around it the window has the colour of the background.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"

layout(set = 0, binding = BINDING_SOURCE) uniform sampler2D source;
layout(location = 0) out vec4 colour;

layout(push_constant, std430) uniform PicturePush {
    vec4 background; // premultiplied, of colours as the picture's
    vec2 corner;     // of the rectangle, pixels
    vec2 size;       // of the rectangle, pixels
    uint displayed;  // 1: colours are shown as they are; else they are linear
} push;

// Returns the picture at a position in pixels. The format may have no linear filter.
vec4 magnified(vec2 place) {
    ivec2 last = textureSize(source, 0) - 1;
    ivec2 first = ivec2(floor(place));
    vec2 w = place - vec2(first);
    ivec2 low = clamp(first, ivec2(0), last);
    ivec2 high = clamp(first + 1, ivec2(0), last);
    vec4 above = mix(texelFetch(source, low, 0), texelFetch(source, ivec2(high.x, low.y), 0), w.x);
    vec4 below = mix(texelFetch(source, ivec2(low.x, high.y), 0), texelFetch(source, high, 0), w.x);
    return mix(above, below, w.y);
}

void main() {
    vec2 at = gl_FragCoord.xy - push.corner;
    vec4 shown = vec4(0.0);
    if (all(greaterThanEqual(at, vec2(0.0))) && all(lessThan(at, push.size))) {
        vec2 pixels = vec2(textureSize(source, 0));
        shown = pixels == push.size ? texelFetch(source, ivec2(at), 0) : magnified(at * pixels / push.size - 0.5);
    }
    vec3 linear = clamp(shown.rgb + push.background.rgb * (1.0 - shown.a), 0.0, 1.0);
    vec3 curved = 1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055;
    bvec3 kept = lessThanEqual(linear, vec3(0.0031308));
    colour = vec4(push.displayed != 0u ? linear : mix(curved, 12.92 * linear, kept), 1.0);
}
