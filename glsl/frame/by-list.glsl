// A list of what a march draws: pixels that are drawn once more (upsampling.glsl lists them), or the tiles that show anything
// (tile-intervals.glsl), x in the lower half of a word. listed.glsl writes such a list.
#ifndef BY_LIST_GLSL
#define BY_LIST_GLSL

#include "interface.glsl"

layout(constant_id = SPEC_REDRAWN) const bool REDRAWN = false; // only these pixels are drawn
layout(constant_id = SPEC_BY_TILE_LIST) const bool BY_TILE_LIST = false; // only these tiles are drawn

layout(set = 0, binding = BINDING_PIXELS, std430) readonly buffer Pixels { uint pixels[]; };

#endif
