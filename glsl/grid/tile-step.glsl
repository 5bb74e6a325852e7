// The step of each tile of the image, where they differ (steps.glsl).
#ifndef TILE_STEP_GLSL
#define TILE_STEP_GLSL

#include "interface.glsl"
#include "grid/grid.glsl"

layout(constant_id = SPEC_BY_STEPS) const bool BY_STEPS = false;

layout(set = 0, binding = BINDING_TILE_STEPS, std430) readonly buffer TileSteps {
    float tile_steps[];
};

// Returns the step of the tile of a pixel, in units of the smallest voxel spacing.
float step_of(ivec2 pixel) {
    if (!BY_STEPS) return push.d0_h.w;
    return tile_steps[tile_of(pixel)];
}

#endif
