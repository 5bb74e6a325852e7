// Blending by fixed function: the fragment's emission goes to the colour attachment. blend.glsl is the alternative.
#ifndef BLEND_FIXED_GLSL
#define BLEND_FIXED_GLSL

layout(location = 0) out vec4 colour;

void blend(vec4 emission, uint slab) {
    colour = emission;
}

#endif
