// The depths between which a pixel's ray is drawn.
#ifndef INTERVAL_GLSL
#define INTERVAL_GLSL

#include "frame/bounded.glsl"
#include "grid/grid.glsl"

// Returns the depths at which the ray enters and leaves the domain in front of the eye, within the bounds of the pixel's ray; the
// first is greater where nothing is left.
vec2 interval_of(Ray ray, vec2 pixel) {
    vec2 interval = domain_of(ray, push.half_slope.xyz, nearest_depth());
    vec2 bounds = bounds_of(uvec2(pixel), sides_of(push.sides).x);
    return BOUNDED ? vec2(max(interval.x, bounds.x), min(interval.y, bounds.y)) : interval;
}

#endif
