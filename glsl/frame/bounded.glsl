// The depths that bound a pixel's ray, where clip planes or surfaces do (line-bounds.glsl).
#ifndef BOUNDED_GLSL
#define BOUNDED_GLSL

#include "interface.glsl"

layout(constant_id = SPEC_BOUNDED) const bool BOUNDED = false;

layout(set = 0, binding = BINDING_LINE_BOUNDS, std430) readonly buffer LineBounds {
    vec2 line_bounds[];
};

// Returns the bounds of a pixel's ray in an image `width` pixels wide, in the technique's unit of depth, from the plane through the
// data's centre. The index is clamped because helper invocations may lie outside of the image.
vec2 bounds_of(uvec2 pixel, uint width) {
    if (!BOUNDED) return vec2(-3e38, 3e38);
    return line_bounds[min(pixel.y * width + pixel.x, uint(line_bounds.length()) - 1u)];
}

#endif
