// Blending by the fragment shader, into packed texels of low precision with stochastic rounding: the expected value equals that of
// exact arithmetic.
//
// Fixed-function blending rounds to nearest, so an opacity below half a step is lost however often it occurs. Noise on the source
// cannot help, because the destination's share is rounded too. Barriers between draws must order the fragments of a pixel.
//
// Source: alpha-dithering in Peikert, Object Space Volume Rendering, SciVis 2007, page 4-28: x -> floor(x) + (x - floor(x) >= rand).
#ifndef BLEND_GLSL
#define BLEND_GLSL

#include "interface.glsl"
#include "grid/grid.glsl"

layout(constant_id = OPTION_TARGET) const uint TARGET = 0;
layout(constant_id = OPTION_DITHER) const uint DITHER = DITHER_BLUE;
layout(constant_id = SPEC_UNDER) const bool UNDER = false;

layout(set = 0, binding = BINDING_TEXELS, std430) buffer Texels {
    uint words[];
} texels;

layout(set = 0, binding = BINDING_THRESHOLDS, std430) readonly buffer Thresholds {
    float tile[];
} thresholds;

// Returns the first word of a hash of three words (Jarzynski and Olano, JCGT 2020: pcg3d).
uint hash(uvec3 v) {
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v ^= v >> 16u;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    return v.x;
}

// Maps a word to [0, 1).
float unit_of(uint word) {
    return float(word >> 8) * (1.0 / 16777216.0);
}

// Returns a number in [0, 1), uniform over seeds. All four channels share it, so that colour stays below opacity.
float random_of(uvec2 pixel, uint slab) {
    if (DITHER != DITHER_BLUE) return unit_of(hash(uvec3(pixel.x | pixel.y << 16, slab, push.seed)));
    // Each slab shifts the tile by another offset and adds a random phase, so that slabs are independent.
    uint shift = hash(uvec3(slab, push.seed, 0x9e3779b9u));
    uvec2 at = (pixel + uvec2(shift, shift >> 16)) % uint(THRESHOLD_SIDE);
    return fract(thresholds.tile[at.y * uint(THRESHOLD_SIDE) + at.x] + unit_of(hash(uvec3(shift, slab, push.seed))));
}

// Rounds non-negative numbers stochastically to float16.
vec4 round_half(vec4 value, float random) {
    const float SMALLEST = 16777216.0; // one over the step of subnormal numbers
    uvec4 bits = floatBitsToUint(value) + uint(random * 8192.0);
    vec4 normal = uintBitsToFloat(bits & ~8191u);
    vec4 subnormal = floor(value * SMALLEST + random) / SMALLEST;
    return min(mix(normal, subnormal, lessThan(value, vec4(6.103515625e-5))), 65504.0);
}

// Returns the blended code in a normalised format of `steps` steps. Codes are integers, exact in float32: only their change is
// rounded.
vec4 round_code(vec4 code, vec4 source, float steps, float random) {
    vec4 change = UNDER ? source * (steps - code.a) : source * steps - source.a * code;
    return clamp(code + floor(change + random), 0.0, steps);
}

// Blends premultiplied colour and opacity of a slab into the fragment's texel.
void blend(vec4 emission, uint slab) {
    if (emission.a == 0.0) return;
    uvec2 pixel = uvec2(gl_FragCoord.xy);
    uint place = pixel.y * sides_of(push.sides).x + pixel.x;
    float random = random_of(pixel, slab);
    if (TARGET == TARGET_RGBA8) {
        uint word = texels.words[place];
        vec4 code = vec4(word & 255u, word >> 8 & 255u, word >> 16 & 255u, word >> 24);
        uvec4 next = uvec4(round_code(code, emission, 255.0, random));
        texels.words[place] = next.r | next.g << 8 | next.b << 16 | next.a << 24;
    } else if (TARGET == TARGET_RGBA16) {
        uint low = texels.words[2u * place], high = texels.words[2u * place + 1u];
        vec4 code = vec4(low & 65535u, low >> 16, high & 65535u, high >> 16);
        uvec4 next = uvec4(round_code(code, emission, 65535.0, random));
        texels.words[2u * place] = next.r | next.g << 16;
        texels.words[2u * place + 1u] = next.b | next.a << 16;
    } else {
        vec4 old = vec4(unpackHalf2x16(texels.words[2u * place]), unpackHalf2x16(texels.words[2u * place + 1u]));
        vec4 next = UNDER ? old + (1.0 - old.a) * emission : emission + (1.0 - emission.a) * old;
        next = round_half(max(next, 0.0), random);
        texels.words[2u * place] = packHalf2x16(next.rg);
        texels.words[2u * place + 1u] = packHalf2x16(next.ba);
    }
}

#endif
