// Records of trained splats as a view sees them (gaussians-project.glsl).
#ifndef RECORDS_GLSL
#define RECORDS_GLSL

#include "interface.glsl"

// The first vector of a splat's record, which is longer for rules of rays.
uint record_of(uint i, bool rays) {
    return (rays ? TRAINED_RAY_RECORD : TRAINED_RECORD) * i;
}

// The place that W is told from: the splat's own, or the nearest within twice the image.
vec2 reference_of(vec2 place, vec2 half_extent) {
    return clamp(place, -2.0 * half_extent, 2.0 * half_extent);
}

#endif
