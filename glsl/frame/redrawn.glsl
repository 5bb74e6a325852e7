// Pixels that are drawn once more: those for which fewer pixels do not suffice (upsampling.glsl lists them).
#ifndef REDRAWN_GLSL
#define REDRAWN_GLSL

#include "interface.glsl"

layout(constant_id = SPEC_REDRAWN) const bool REDRAWN = false; // only these pixels are drawn; else all are

layout(set = 0, binding = BINDING_PIXELS, std430) readonly buffer Pixels { uint pixels[]; };

#endif
