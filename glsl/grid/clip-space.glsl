// Projection of index space to the image, for vertex stages.
#ifndef CLIP_SPACE_GLSL
#define CLIP_SPACE_GLSL

#include "grid/grid.glsl"

// Returns the clip coordinates of a position at depth z. (px, py, d0) is a basis of index space: in it the first two coordinates of
// the offset from the central ray are the pixel's x and y, times w.
vec4 clip_of(vec3 position, float z) {
    vec3 px = push.px_slope.xyz, py = push.py_z0.xyz, d0 = push.d0_h.xyz;
    vec3 lateral = position - push.q0_kq.xyz - z * d0;
    vec2 xy = vec2(dot(cross(py, d0), lateral), dot(cross(d0, px), lateral)) / dot(cross(px, py), d0);
    return vec4(xy / half_image(), 0.0, push.q0_kq.w + kd_of_view() * z);
}

// Returns whether the domain is so large in pixels, at the w of a slice, that float32 places its corners no better than to 1/64
// pixel. Then the caller covers the whole image instead of an outline.
bool magnified(float w) {
    const float MOST_PIXELS = 262144.0;
    vec3 px = push.px_slope.xyz, py = push.py_z0.xyz;
    return 2.0 * length(push.half_slope.xyz) > MOST_PIXELS * w * min(length(px), length(py));
}

#endif
