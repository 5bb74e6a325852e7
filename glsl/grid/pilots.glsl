// How the colour of the ray of each tile's centre changes with the step: PILOT of raycast.glsl writes it, steps.glsl reads it.
#ifndef PILOTS_GLSL
#define PILOTS_GLSL

#include "interface.glsl"

struct Pilot {
    vec4 colour;                 // of the last level
    float changes[PILOT_LEVELS]; // mean square change from the level before, which has twice the step; of level 0 the greatest of all
    uint levels;                 // number of levels drawn: level l has the step PILOT_COARSEST / 2^l
};

layout(set = 0, binding = BINDING_PILOTS, std430) buffer Pilots { Pilot pilots[]; };

#endif
