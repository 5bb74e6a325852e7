// entry compute TEXELS
// entry compute EDGES
//
// Bounds for the rays of a base plane's texels, where clip planes or surfaces bound the rays of pixels (line-bounds.glsl).
//
//   TEXELS  one invocation per texel: interpolates the bounds of the four pixels around it and converts them to depths along the stack
//   EDGES   one invocation per pixel, after the warp: compares the interpolated bounds of its four texels with the bounds of its own
//           ray. Where they differ, as at outlines, the pixel's own ray is marched (shear-warp.glsl)
//
//   in    bounds of pixels; texel positions of pixels (warp.glsl)
//   out   bounds of texels; bounds of the pixels that are marched
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"

layout(push_constant, std430) uniform ShearBoundsPush {
    vec4 q0_step;    // rays of texels, as in base-plane.glsl
    vec4 d0_step;
    vec4 ahead_sign; // xyz: gradient of the view's depth, per index; w: sign of the rays' direction along the stack
    vec4 to_x;       // xyz: maps (x, y, 1), texels, to pixels from the image's centre, x w; w: half the image's width
    vec4 to_y;       // y w; w: half the image's height
    vec4 to_w;       // w; w: half the stack, indices
    uvec2 size;      // texels
    uint offset;     // of texel 0
    uint stride;     // of rows
    float tolerance; // largest accepted difference between the interpolated depth and the pixel's own, along the stack
    float spread;    // largest accepted difference among texels: colour is not linear in depth
    float pad0, pad1;
} push;

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = BINDING_LINE_BOUNDS, std430) readonly buffer LineBounds { vec2 line_bounds[]; };

// Converts the view's depths on the ray of a texel, or of a position between texels, to depths along the stack, clamped to just
// beyond the stack.
vec2 along_stack(vec2 depths, vec2 texel) {
    vec2 t = texel - vec2(push.size / 2u);
    vec2 q = fma(push.q0_step.zw, t, push.q0_step.xy), d = fma(push.d0_step.zw, t, push.d0_step.xy);
    vec2 z = (depths - dot(push.ahead_sign.xy, q)) / dot(push.ahead_sign.xyz, vec3(d, push.ahead_sign.w));
    return clamp(z, -push.to_w.w - 1.0, push.to_w.w + 1.0);
}

#ifdef TEXELS
layout(set = 0, binding = BINDING_TEXEL_BOUNDS, std430) writeonly buffer TexelBounds { vec2 texel_bounds[]; };

void main() {
    uvec2 texel = INVOCATION.xy;
    if (any(greaterThanEqual(texel, push.size))) return;
    vec3 p = vec3(texel, 1.0);
    float w = dot(push.to_w.xyz, p);
    vec2 half_extent = vec2(push.to_x.w, push.to_y.w);
    vec2 place = vec2(dot(push.to_x.xyz, p), dot(push.to_y.xyz, p)) / w + half_extent - 0.5;
    // Texels outside of the image take the bounds at its edge.
    vec2 last = 2.0 * half_extent - 1.0;
    place = w > 0.0 ? clamp(place, vec2(0.0), last) : vec2(0.0);
    vec2 base = floor(place), share = place - base;
    uvec2 i = uvec2(base), j = min(i + 1u, uvec2(last));
    uint width = uint(last.x) + 1u;
    vec2 low = mix(line_bounds[i.y * width + i.x], line_bounds[i.y * width + j.x], share.x);
    vec2 high = mix(line_bounds[j.y * width + i.x], line_bounds[j.y * width + j.x], share.x);
    texel_bounds[push.offset + texel.y * push.stride + texel.x] = along_stack(mix(low, high, share.y), vec2(texel));
}
#endif

#ifdef EDGES
layout(constant_id = SPEC_WARP) const uint WARP = 0;
layout(set = 0, binding = BINDING_TEXEL_BOUNDS, std430) readonly buffer TexelBounds { vec2 texel_bounds[]; };
layout(set = 0, binding = BINDING_EDGES, std430) buffer Edges { vec4 edges[]; };

vec2 texel_of(ivec2 at) {
    at = clamp(at, ivec2(0), ivec2(push.size) - 1);
    return texel_bounds[push.offset + uint(at.y) * push.stride + uint(at.x)];
}

void main() {
    uvec2 pixel = INVOCATION.xy, extent = uvec2(2.0 * vec2(push.to_x.w, push.to_y.w) + 0.5);
    if (any(greaterThanEqual(pixel, extent))) return;
    uint word = pixel.y * extent.x + pixel.x;
    vec2 at = edges[word].xy;
    vec2 bounds = vec2(float(EDGE_NONE));
    if (at.x > -1e30) {
        vec2 base = floor(at), share = at - base;
        ivec2 i = ivec2(base);
        vec2 a = texel_of(i), b = texel_of(i + ivec2(1, 0)), c = texel_of(i + ivec2(0, 1)), d = texel_of(i + ivec2(1, 1));
        vec2 own = along_stack(line_bounds[word], at);
        vec2 between = mix(mix(a, b, share.x), mix(c, d, share.x), share.y);
        vec2 least = min(min(a, b), min(c, d)), most = max(max(a, b), max(c, d));
        if (WARP != WARP_BILINEAR) {
            // Filters that reach further: bicubic one texel, mip as far as the texel of the next pixel.
            int reach = 1;
            if (WARP == WARP_MIP) {
                vec2 beside = edges[pixel.x + 1u < extent.x ? word + 1u : word - min(pixel.x, 1u)].xy;
                vec2 below = edges[pixel.y + 1u < extent.y ? word + extent.x : word - (pixel.y > 0u ? extent.x : 0u)].xy;
                vec2 step = max(beside.x > -1e30 ? abs(beside - at) : vec2(0.0), below.x > -1e30 ? abs(below - at) : vec2(0.0));
                reach = int(clamp(ceil(max(step.x, step.y)), 1.0, 64.0));
            }
            for (int k = 0; k < 16; ++k) {
                ivec2 offset = ivec2(k & 3, k >> 2);
                vec2 far = texel_of(i + mix(mix(ivec2(0), ivec2(1), equal(offset, ivec2(2))), mix(ivec2(-reach), ivec2(1 + reach), equal(offset, ivec2(3))),
                                            bvec2(offset.x == 0 || offset.x == 3, offset.y == 0 || offset.y == 3)));
                least = min(least, far);
                most = max(most, far);
            }
        }
        vec2 spread = most - least;
        bool interpolated = all(lessThanEqual(abs(between - own), vec2(push.tolerance))) && all(lessThanEqual(spread, vec2(push.spread)));
        if (!interpolated) bounds = own;
    }
    edges[word].zw = bounds;
}
#endif
