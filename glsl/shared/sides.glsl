// The sides of an image in one word.
#ifndef SIDES_GLSL
#define SIDES_GLSL

// Returns width and height, or x and y of a place that is coded alike, in pixels.
uvec2 sides_of(uint sides) {
    return uvec2(sides & 0xffffu, sides >> 16);
}

// Returns half the sides, in pixels.
vec2 half_of(uint sides) {
    return 0.5 * vec2(sides_of(sides));
}

#endif
