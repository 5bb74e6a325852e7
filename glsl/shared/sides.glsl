// The sides of an image in one word.
#ifndef SIDES_GLSL
#define SIDES_GLSL

// Returns half the sides, in pixels.
vec2 half_of(uint sides) {
    return 0.5 * vec2(sides & 0xffffu, sides >> 16);
}

#endif
