// The end of a raster fragment: its emission becomes the colour attachment's, or (SHADER_BLEND) is blended here
// into packed texels of low precision, rounded at random so that what is lost on one fragment is made up for on
// another: an expected value is what exact arithmetic gives.
//
// Fixed-function blending rounds to nearest, so an opacity below half a step is lost however often it comes;
// noise on the source cannot help, for the destination's own share is rounded too. Fragments of one pixel must
// be ordered by barriers between draws.
//
// Source: alpha-dithering in Peikert, Object Space Volume Rendering, SciVis 2007, page 4-28: x -> floor(x) + (x - floor(x) >= rand).

#ifdef SHADER_BLEND
layout(constant_id = SPEC_TARGET) const uint TARGET = 0;
layout(constant_id = SPEC_BLUE_NOISE) const bool BLUE_NOISE = false;
layout(constant_id = SPEC_UNDER) const bool UNDER = false;

layout(set = 0, binding = BINDING_TEXELS, std430) buffer Texels {
    uint words[];
} texels;

layout(set = 0, binding = BINDING_THRESHOLDS, std430) readonly buffer Thresholds {
    float tile[];
} thresholds;

// Hash of three words (Jarzynski and Olano, JCGT 2020: pcg3d), first word.
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

float unit_of(uint word) {
    return float(word >> 8) * (1.0 / 16777216.0);
}

// A number in [0, 1), uniform over seeds: one for all four channels, so that colour stays below opacity.
float random_of(uvec2 pixel, uint slab) {
    if (!BLUE_NOISE) return unit_of(hash(uvec3(pixel.x | pixel.y << 16, slab, push.seed)));
    // The tile, shifted anew for every slab so that slabs are independent, and turned by a random phase.
    uint shift = hash(uvec3(slab, push.seed, 0x9e3779b9u));
    uvec2 at = (pixel + uvec2(shift, shift >> 16)) % uint(THRESHOLD_SIDE);
    return fract(thresholds.tile[at.y * uint(THRESHOLD_SIDE) + at.x] + unit_of(hash(uvec3(shift, slab, push.seed))));
}

// Rounds non-negative numbers to float16 at random.
vec4 round_half(vec4 value, float random) {
    const float SMALLEST = 16777216.0; // one over the step of subnormal numbers
    uvec4 bits = floatBitsToUint(value) + uint(random * 8192.0);
    vec4 normal = uintBitsToFloat(bits & ~8191u);
    vec4 subnormal = floor(value * SMALLEST + random) / SMALLEST;
    return min(mix(normal, subnormal, lessThan(value, vec4(6.103515625e-5))), 65504.0);
}

// The new code of a normalised format of `steps` steps. Codes are whole numbers, exact in float32: only the change
// is rounded.
vec4 round_code(vec4 code, vec4 source, float steps, float random) {
    vec4 change = UNDER ? source * (steps - code.a) : source * steps - source.a * code;
    return clamp(code + floor(change + random), 0.0, steps);
}

void blend(vec4 emission, uint slab) {
    if (emission.a == 0.0) return;
    uvec2 pixel = uvec2(gl_FragCoord.xy);
    uint place = pixel.y * uint(2.0 * push.half_extent.x + 0.5) + pixel.x;
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
#else
layout(location = 0) out vec4 colour;

void blend(vec4 emission, uint slab) {
    colour = emission;
}
#endif
