// Between which depths a pixel's line is drawn (line-bounds.glsl), where anything bounds it. Include only.

layout(constant_id = SPEC_BOUNDED) const bool BOUNDED = false;

layout(set = 0, binding = BINDING_LINE_BOUNDS, std430) readonly buffer LineBounds {
    vec2 line_bounds[];
};

// For an image `width` pixels wide; in the technique's unit of depth, from the plane through the data's centre. Fragments that help
// others may lie beyond the image.
vec2 bounds_of(uvec2 pixel, uint width) {
    if (!BOUNDED) return vec2(-3e38, 3e38);
    return line_bounds[min(pixel.y * width + pixel.x, uint(line_bounds.length()) - 1u)];
}
