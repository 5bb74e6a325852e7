// entry compute PLANES
// entry compute DEPTH
//
// Bounds each pixel's ray by half-spaces, whose intersection is convex and leaves one interval, and by the opaque surfaces of a depth
// image.
//
//   PLANES    one invocation per pixel; six half-spaces per dispatch, RESUME continues with more
//   DEPTH     the same, and the depth image
//
//   in    depth image
//   out   two depths per pixel, in the unit of the technique that reads them, from the plane through its data's centre; where the
//         second does not exceed the first, nothing is left of the ray
//   error rounding to float32, and the precision of the depth image's format
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"
#include "shared/sides.glsl"

layout(constant_id = SPEC_RESUME) const bool RESUME = false;

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = BINDING_LINE_BOUNDS, std430) buffer LineBounds { vec2 line_bounds[]; };

layout(push_constant, std430) uniform BoundsPush {
    // With p = planes[i] the height of a ray at depth z above plane i is p.w + kq L + z (p.z + kd L), L = p.x x + p.y y. The pixel
    // (x, y) is counted from the image's centre, y down; kd is 1 for perspective, else 0.
    vec4 planes[6];
    uint sides;       // of the image (sides.glsl)
    uint corner;      // of its rectangle in the depth image, coded as its sides
    vec2 inverse;     // perspective: inverse distances from the eye of the stored values 0 and 1
    vec2 depths;      // depths of the stored values 0 and 1; in perspective times those inverses, so that depth = mix(depths) /
                      // mix(inverses) has small terms also for a far eye
    float kq;
    uint count;       // BOUNDS_*: number of planes, and what the depth image stores
} push;

#ifdef DEPTH
layout(set = 0, binding = BINDING_DEPTH) uniform sampler2D depth_image;

// Returns the depth of the surface for a value of the depth image; 3e38 without a surface.
float surface_depth(float stored) {
    // NaN is no surface. Test the bits, because compilers may remove float tests.
    if ((floatBitsToUint(stored) & 0x7fffffffu) > 0x7f800000u) return 3e38;
    // The image was cleared with the far end.
    if (stored == ((push.count & BOUNDS_FAR_AT_ONE) != 0u ? 1.0 : 0.0)) return 3e38;
    stored = clamp(stored, -1e15, 1e15); // an infinity times 0 would be NaN
    vec2 share = vec2(1.0 - stored, stored);
    float depth = dot(share, push.depths), inverse = dot(share, push.inverse);
    if ((push.count & BOUNDS_PERSPECTIVE) == 0u) return depth;
    return inverse > 0.0 ? depth / inverse : 3e38;
}
#endif

void main() {
    uvec2 pixel = INVOCATION.xy;
    uvec2 size = sides_of(push.sides), corner = sides_of(push.corner);
    if (any(greaterThanEqual(pixel, size))) return;
    uint word = pixel.y * size.x + pixel.x;
    vec2 bounds = RESUME ? line_bounds[word] : vec2(-3e38, 3e38);
#ifdef DEPTH
    bounds.y = min(bounds.y, surface_depth(texelFetch(depth_image, ivec2(pixel + corner), 0).r));
#endif
    vec2 xy = vec2(pixel) + 0.5 - half_of(push.sides);
    float kd = (push.count & BOUNDS_PERSPECTIVE) != 0u ? 1.0 : 0.0;
    for (uint i = 0u; i < 6u; ++i) {
        if (i >= (push.count & BOUNDS_PLANES)) break;
        vec4 plane = push.planes[i];
        float lateral = dot(xy, plane.xy);
        float height = fma(push.kq, lateral, plane.w), rise = fma(kd, lateral, plane.z);
        float z = -height / (rise != 0.0 ? rise : 1.0);
        if (rise > 0.0) bounds.x = max(bounds.x, z);
        if (rise < 0.0) bounds.y = min(bounds.y, z);
        // Of the two sides of a plane that a ray lies in, one owns it.
        bool other = (push.count & BOUNDS_OWNED) != 0u
            && (plane.x != 0.0 ? plane.x < 0.0 : plane.y < 0.0);
        if (rise == 0.0 && (height < 0.0 || height == 0.0 && other)) bounds.y = -3e38;
    }
    line_bounds[word] = clamp(bounds, -3e38, 3e38);
}
