// entry compute PLANES
// entry compute DEPTH
//
// Where each pixel's line is cut: by half-spaces, whose intersection is convex, so that one interval is left, and by
// an opaque surface, which a depth image shows.
//
//   PLANES    one invocation a pixel. Six half-spaces in one dispatch, others in a second one that goes on (RESUME)
//   DEPTH     the same, and the depth image
//
//   in    depth image
//   out   two depths a pixel, in units of the technique that reads them, from the plane through its data's centre; the second
//         is not above the first where nothing is left
//   error of float32 and of the depth image's own format
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"

layout(constant_id = SPEC_RESUME) const bool RESUME = false;

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = BINDING_LINE_BOUNDS, std430) buffer LineBounds { vec2 line_bounds[]; };

layout(push_constant, std430) uniform BoundsPush {
    // On a line the height above plane i is h(z) = w + kq L + z (z + kd L), L = x px + y py, by the components of planes[i]: x and
    // y for pixels from the image's centre, y down.
    vec4 planes[6];
    vec2 half_extent; // of the image, pixels
    vec2 inverse;     // perspective: of the distances from the eye where 0 and where 1 is stored
    vec2 depths;      // those depths, in perspective times the same: z = (between depths) / (between inverses), whose parts are small
                      // where the eye is far
    float kq;
    uint count;       // planes; 16 more for perspective, 32 more where the far end is stored as 1
} push;

#ifdef DEPTH
layout(set = 0, binding = BINDING_DEPTH) uniform sampler2D depth_image;

// Depth of what the image shows.
float surface_depth(float stored) {
    // No number shows no surface. By its bits: float tests may be optimised away.
    if ((floatBitsToUint(stored) & 0x7fffffffu) > 0x7f800000u) return 3e38;
    // The far end itself is what the image was cleared with.
    if (stored == ((push.count & 32u) != 0u ? 1.0 : 0.0)) return 3e38;
    stored = clamp(stored, -1e15, 1e15); // infinite ones have products with nothing
    vec2 share = vec2(1.0 - stored, stored);
    float depth = dot(share, push.depths), inverse = dot(share, push.inverse);
    if ((push.count & 16u) == 0u) return depth;
    return inverse > 0.0 ? depth / inverse : 3e38;
}
#endif

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    uvec2 size = uvec2(2.0 * push.half_extent + 0.5);
    if (any(greaterThanEqual(pixel, size))) return;
    uint word = pixel.y * size.x + pixel.x;
    vec2 bounds = RESUME ? line_bounds[word] : vec2(-3e38, 3e38);
#ifdef DEPTH
    bounds.y = min(bounds.y, surface_depth(texelFetch(depth_image, ivec2(pixel), 0).r));
#endif
    vec2 xy = vec2(pixel) + 0.5 - push.half_extent;
    float kd = (push.count & 16u) != 0u ? 1.0 : 0.0;
    for (uint i = 0u; i < 6u; ++i) {
        if (i >= (push.count & 15u)) break;
        vec4 plane = push.planes[i];
        float lateral = dot(xy, plane.xy);
        float height = fma(push.kq, lateral, plane.w), rise = fma(kd, lateral, plane.z);
        float z = -height / (rise != 0.0 ? rise : 1.0);
        if (rise > 0.0) bounds.x = max(bounds.x, z);
        if (rise < 0.0) bounds.y = min(bounds.y, z);
        if (rise == 0.0 && height < 0.0) bounds.y = -3e38;
    }
    line_bounds[word] = clamp(bounds, -3e38, 3e38);
}
