// Boxes of pixels, as bins take them.
#ifndef BOXES_GLSL
#define BOXES_GLSL

// Returns the pixels whose centres lie in a box, which is given by least and greatest place in pixels from the image's middle: their first and
// last column, then rows, the last ones exclusive. (0, 0) where there are none.
uvec2 packed_box(vec4 box, vec2 half_extent) {
    // A hundredth of a pixel and what the place itself may be rounded by.
    vec2 margin = vec2(0.01) + (abs(box.zw - box.xy) + abs(box.xy)) * 1e-6;
    vec2 size = 2.0 * half_extent;
    uvec2 low = uvec2(clamp(ceil(box.xy + half_extent - 0.5 - margin), vec2(0.0), size));
    uvec2 high = uvec2(clamp(floor(box.zw + half_extent + 0.5 + margin), vec2(0.0), size));
    return all(lessThan(low, high)) ? uvec2(low.x | high.x << 16, low.y | high.y << 16) : uvec2(0u);
}

#endif
