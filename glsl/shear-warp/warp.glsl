// entry compute  COMPUTE
// entry compute  BOUNDED
// entry vertex   VERTEX
// entry fragment FRAGMENT
// entry compute  HALVE
//
// The warp of the shear-warp factorisation: resamples the intermediate images on the base planes to the image, by an affine map for
// parallel rays, a projective map in perspective. A pixel belongs to the base plane whose slices its ray crosses most steeply.
//
//   COMPUTE   one invocation owns a pixel
//   BOUNDED   the same, and stores the texel position of each pixel (shear-bounds.glsl)
//   FRAGMENT  the same as COMPUTE, drawn as one quad
//   HALVE     one invocation owns a texel of a level of half the size: the mean of four texels
//
//   in    intermediate image, its texels row by row
//   out   accumulation image, or colour attachment 0: premultiplied linear RGBA
//   error that of resampling an image: bilinear second order in the spacing of texels, bicubic third; mip blurs where texels are
//         smaller than pixels, so that it skips none
//   cost  four texels per pixel (bilinear), eight (mip), sixteen (bicubic)
//
// Source: Lacroute and Levoy, SIGGRAPH 1994; bicubic: Keys, Cubic convolution interpolation, 1981.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"

layout(constant_id = SPEC_WARP) const uint WARP = 0;

layout(push_constant, std430) uniform WarpPush {
    vec4 to_x;        // xyz: maps (x, y, 1), pixels from the image's centre, y down, to a texel's x w
    vec4 to_y;        // y w
    vec4 to_w;        // w, positive in front of the eye; component w, as bits: texel 0 of the level of half the size
    vec4 ahead;       // xyz: maps (x, y, 1) to the steepness at which the ray crosses this plane's slices
    vec4 aside_u;     // and those of the two other axes
    vec4 aside_v;
    vec2 half_extent; // half the image, pixels
    uvec2 size;       // texels
    uint offset;      // of texel 0
    uint stride;      // of rows
    uint levels;      // of the intermediate image
    uint flags;       // WARP_SHARED, WARP_LATER, WARP_YIELDS_U, WARP_YIELDS_V
} push;

#ifdef HALVE
layout(set = 0, binding = BINDING_INTERMEDIATE, std430) buffer Intermediate {
    vec4 intermediate[];
};
#else
layout(set = 0, binding = BINDING_INTERMEDIATE, std430) readonly buffer Intermediate {
    vec4 intermediate[];
};

// A level of the intermediate image.
struct Level {
    ivec2 last;
    int offset;
    int stride;
    int below; // offset of the next
};

vec4 texel_of(ivec2 at, Level level) {
    at = clamp(at, ivec2(0), level.last);
    return intermediate[level.offset + at.y * level.stride + at.x];
}

vec4 bilinear(vec2 at, Level level) {
    vec2 base = floor(at), w = at - base;
    ivec2 i = ivec2(base);
    vec4 low = mix(texel_of(i, level), texel_of(i + ivec2(1, 0), level), w.x);
    vec4 high = mix(texel_of(i + ivec2(0, 1), level), texel_of(i + ivec2(1, 1), level), w.x);
    return mix(low, high, w.y);
}

// Returns the weights of four texels in a row (Keys, a = -1/2).
vec4 cubic(float x) {
    vec4 far = vec4(1.0 + x, x, 1.0 - x, 2.0 - x);
    vec4 inner = fma(far * far, fma(far, vec4(1.5), vec4(-2.5)), vec4(1.0));
    vec4 outer = fma(far, fma(far, fma(far, vec4(-0.5), vec4(2.5)), vec4(-4.0)), vec4(2.0));
    return vec4(outer.x, inner.yz, outer.w);
}

vec4 bicubic(vec2 at, Level level) {
    vec2 base = floor(at);
    ivec2 i = ivec2(base) - 1;
    vec4 across = cubic(at.x - base.x), down = cubic(at.y - base.y);
    vec4 sum = vec4(0.0);
    for (int y = 0; y < 4; ++y) {
        vec4 row = vec4(0.0);
        for (int x = 0; x < 4; ++x) row += across[x] * texel_of(i + ivec2(x, y), level);
        sum += down[y] * row;
    }
    // The filter overshoots: clamp negative values, and scale colour and opacity where opacity exceeds 1.
    if (!(sum.a > 0.0)) return vec4(0.0);
    return vec4(max(sum.rgb, 0.0), sum.a) / max(sum.a, 1.0);
}

// Returns the next level, of half the size.
Level halved(Level level) {
    ivec2 size = (level.last + 2) / 2;
    return Level(size - 1, level.below, size.x, level.below + size.x * size.y);
}

// Returns whether the pixel belongs to this plane, its colour, and its texel position.
bool shown(vec2 pixel, out vec4 colour, out vec2 at) {
    colour = vec4(0.0);
    at = vec2(-3e38);
    vec3 p = vec3(pixel, 1.0);
    if (push.flags != 0u) {
        precise float ahead = push.ahead.x * p.x + push.ahead.y * p.y + push.ahead.z;
        precise float u = push.aside_u.x * p.x + push.aside_u.y * p.y + push.aside_u.z;
        precise float v = push.aside_v.x * p.x + push.aside_v.y * p.y + push.aside_v.z;
        u = abs(u);
        v = abs(v);
        // Exactly one of two planes owns a pixel on their seam.
        bool beyond_u = (push.flags & WARP_YIELDS_U) != 0u ? ahead <= u : ahead < u;
        bool beyond_v = (push.flags & WARP_YIELDS_V) != 0u ? ahead <= v : ahead < v;
        if (beyond_u || beyond_v) return false;
    }
    float w = dot(push.to_w.xyz, p);
    if (!(w > 0.0)) return push.flags == 0u;
    vec2 place = vec2(dot(push.to_x.xyz, p), dot(push.to_y.xyz, p)) / w;
    Level level = Level(ivec2(push.size) - 1, int(push.offset), int(push.stride), floatBitsToInt(push.to_w.w));
    // Nothing is drawn around the texels; the outermost texels are empty.
    if (any(lessThan(place, vec2(-1.0))) || any(greaterThan(place, vec2(push.size)))) return true;
    at = place;
    if (WARP == WARP_BICUBIC) {
        colour = bicubic(place, level);
    } else if (WARP == WARP_MIP) {
        // The texel steps of one pixel step.
        vec2 dx = (vec2(push.to_x.x, push.to_y.x) - place * push.to_w.x) / w;
        vec2 dy = (vec2(push.to_x.y, push.to_y.y) - place * push.to_w.y) / w;
        // An interpolated mean of a level's texels has the variance 1/4, the area of a pixel 1/12.
        float step = max(dot(dx, dx), dot(dy, dy)) / 3.0;
        float wanted = clamp(0.5 * log2(max(step, 1e-30)), 0.0, float(push.levels - 1u));
        float share = wanted - floor(wanted);
        for (int i = 0; i < int(wanted); ++i) {
            level = halved(level);
            place = 0.5 * place - 0.25;
        }
        colour = bilinear(place, level);
        if (share > 0.0) colour = mix(colour, bilinear(0.5 * place - 0.25, halved(level)), share);
    } else {
        colour = bilinear(place, level);
    }
    return true;
}
#endif

#if defined(COMPUTE) || defined(BOUNDED)
layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = BINDING_ACCUMULATION, rgba32f) uniform image2D accumulation;
#ifdef BOUNDED
layout(set = 0, binding = BINDING_EDGES, std430) writeonly buffer Edges { vec4 edges[]; };
#endif

void main() {
    ivec2 pixel = ivec2(INVOCATION.xy), extent = ivec2(2.0 * push.half_extent + 0.5);
    if (any(greaterThanEqual(pixel, extent))) return;
    vec4 colour;
    vec2 at;
    bool own = shown(vec2(pixel) + 0.5 - push.half_extent, colour, at);
#ifdef BOUNDED
    edges[pixel.y * extent.x + pixel.x] = vec4(own ? at : vec2(-3e38), vec2(float(EDGE_NONE)));
#endif
    // The first plane clears the pixels of the others.
    if (own || (push.flags & WARP_LATER) == 0u) imageStore(accumulation, pixel, colour);
}
#endif

#ifdef VERTEX
void main() {
    gl_Position = vec4(2.0 * vec2(gl_VertexIndex & 1, gl_VertexIndex >> 1) - 1.0, 0.0, 1.0);
}
#endif

#ifdef FRAGMENT
layout(location = 0) out vec4 colour_out;

void main() {
    vec4 colour;
    vec2 at;
    if (!shown(gl_FragCoord.xy - push.half_extent, colour, at)) discard;
    colour_out = colour;
}
#endif

#ifdef HALVE
layout(local_size_x = 8, local_size_y = 8) in;

void main() {
    ivec2 at = ivec2(INVOCATION.xy), size = (ivec2(push.size) + 1) / 2;
    if (any(greaterThanEqual(at, size))) return;
    ivec2 i = 2 * at, j = min(i + 1, ivec2(push.size) - 1);
    int from = int(push.offset), row = int(push.stride), to = floatBitsToInt(push.to_w.w);
    intermediate[to + at.y * size.x + at.x] =
        0.25 * (intermediate[from + i.y * row + i.x] + intermediate[from + i.y * row + j.x] +
                intermediate[from + j.y * row + i.x] + intermediate[from + j.y * row + j.x]);
}
#endif
