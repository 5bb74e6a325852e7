// entry fragment FRAGMENT
//
// Writes the depths at which rays become opaque (hit-depths.glsl) into a rectangle of an image of the caller's, as a projection stores depths. Pixels
// without one get the far end. The vertex shader is that of composite.glsl.
//
//   error that of float32: a few units in the last place of the stored value
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"

layout(set = 0, binding = BINDING_HIT_DEPTHS, std430) readonly buffer HitDepths { float hit_depths[]; };
layout(location = 0) out vec4 stored;

layout(push_constant, std430) uniform HitDepthsPush {
    ivec2 corner;     // first pixel of the rectangle that is drawn
    vec2 numerator;   // the stored value of a depth z is (numerator.x + numerator.y z) / (denominator.x + denominator.y z)
    vec2 denominator; // positive in front of the eye
    uint width;       // of the rectangle
    float far;        // stored where there is no depth
} push;

void main() {
    uvec2 pixel = uvec2(ivec2(gl_FragCoord.xy) - push.corner);
    float z = hit_depths[pixel.y * push.width + pixel.x];
    float denominator = fma(push.denominator.y, z, push.denominator.x);
    float value = clamp(fma(push.numerator.y, z, push.numerator.x) / denominator, 0.0, 1.0);
    // A splat around the eye may be densest behind it.
    if (denominator <= 0.0) value = 1.0 - push.far;
    stored = vec4(z == 0.0 ? push.far : value, 0.0, 0.0, 0.0);
}
