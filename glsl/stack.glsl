// A stack of slices as techniques see it: the stored number on a slice and between two, and what a slice that stands
// for a slab emits. For grid.glsl's rays.

layout(constant_id = SPEC_BETWEEN) const bool BETWEEN = false;

#ifdef WORDS
// Samples as words of a storage buffer, slice by slice and row by row: whatever their type, a word a sample. A word has what
// bilinear interpolation needs of a neighbourhood of small samples, so that one load (8 bits), two (16 bits) or four (32 bits)
// serve a look-up. Stored numbers are codes, not fractions.
layout(constant_id = SPEC_WORD_BITS) const uint WORD_BITS = 8;
layout(set = 0, binding = BINDING_STACK_WORDS, std430) readonly buffer StackWords {
    uint stack_words[];
};

float on_slice(vec2 index, float slice, float level, Lattice lattice) {
    vec2 last = 2.0 * lattice.half_size.xy;
    index = clamp(index, vec2(0.0), last);
    vec2 base = min(floor(index), max(last - 1.0, 0.0));
    vec2 w = index - base;
    int row = int(last.x) + 1;
    int at = (int(slice) * (int(last.y) + 1) + int(base.y)) * row + int(base.x);
    if (WORD_BITS == 8) {
        uint four = stack_words[at];
        vec4 v = vec4(ivec4(four & 255u, (four >> 8) & 255u, (four >> 16) & 255u, four >> 24));
        return mix(mix(v.x, v.y, w.x), mix(v.z, v.w, w.x), w.y);
    }
    int up = last.y > 0.0 ? row : 0;
    if (WORD_BITS == 16) {
        uint two = stack_words[at], above = stack_words[at + up];
        vec4 v = vec4(ivec4(two & 65535u, two >> 16, above & 65535u, above >> 16));
        return mix(mix(v.x, v.y, w.x), mix(v.z, v.w, w.x), w.y);
    }
    int right = last.x > 0.0 ? 1 : 0;
    float v00 = uintBitsToFloat(stack_words[at]), v10 = uintBitsToFloat(stack_words[at + right]);
    float v01 = uintBitsToFloat(stack_words[at + up]), v11 = uintBitsToFloat(stack_words[at + up + right]);
    return mix(mix(v00, v10, w.x), mix(v01, v11, w.x), w.y);
}
#else
layout(set = 0, binding = BINDING_VOLUME) uniform sampler2DArray stack;

// Four fetches of a slice at one level, around an index of level 0.
float fetched(vec2 index, int slice, int level) {
    vec2 size = vec2(textureSize(stack, level).xy);
    if (PREFILTER) index = (index + 0.5) * (size / vec2(textureSize(stack, 0).xy)) - 0.5;
    index = clamp(index, vec2(0.0), size - 1.0);
    vec2 base = min(floor(index), max(size - 2.0, 0.0));
    vec2 w = index - base;
    ivec2 i = ivec2(base), j = min(i + 1, ivec2(size) - 1);
    float v00 = texelFetch(stack, ivec3(i, slice), level).r;
    float v10 = texelFetch(stack, ivec3(j.x, i.y, slice), level).r;
    float v01 = texelFetch(stack, ivec3(i.x, j.y, slice), level).r;
    float v11 = texelFetch(stack, ivec3(j, slice), level).r;
    return mix(mix(v00, v10, w.x), mix(v01, v11, w.x), w.y);
}

// The stored number of a slice, bilinear.
float on_slice(vec2 index, float slice, float level, Lattice lattice) {
    if (!FILTER_EXACT) {
        return textureLod(stack, vec3((index + 0.5) / (2.0 * lattice.half_size.xy + 1.0), slice), level).r;
    }
    if (!PREFILTER) return fetched(index, int(slice), 0);
    level = min(level, float(textureQueryLevels(stack) - 1));
    int below = int(level);
    float fine = fetched(index, int(slice), below);
    return level == float(below) ? fine : mix(fine, fetched(index, int(slice), below + 1), level - float(below));
}
#endif

// The stored number at an index, trilinear: two slices blended.
float between_slices(vec3 index, float level, Lattice lattice) {
    float last = 2.0 * lattice.half_size.z;
    float place = clamp(index.z, 0.0, last);
    float slice = max(min(floor(place), last - 1.0), 0.0);
    return mix(on_slice(index.xy, slice, level, lattice), on_slice(index.xy, min(slice + 1.0, last), level, lattice),
               place - slice);
}

// The stored number for a slab at depth z of the ray; NaN in a cell that touches a NaN sample.
float stored_at(Ray ray, float z, uint slab, Lattice lattice) {
    vec3 index = fma(vec3(z), ray.d, ray.q) + lattice.half_size;
    float level = PREFILTER ? level_at(z, lattice) : 0.0;
    if (!BETWEEN) return on_slice(index.xy, float(slab), level, lattice);
    return between_slices(index, level, lattice);
}

// Premultiplied colour and opacity of a piece of the ray.
vec4 slice_emission(Ray ray, vec2 piece, uint slab, Lattice lattice, uint knots) {
    float z = 0.5 * (piece.x + piece.y);
    float texel = stored_at(ray, z, slab, lattice);
    vec4 optics = classify(scalar_of(texel, lattice), knots);
    float tau = HAS_NAN && is_nan(texel) ? 0.0 : optics.a;
    float len = max(piece.y - piece.x, 0.0);
    if (HAS_NAN && !BETWEEN) {
        // The slice parts two cells, and either is vacuum where the slice on its other side has a NaN.
        vec2 index = fma(vec2(z), ray.d.xy, ray.q.xy) + lattice.half_size.xy;
        float last = 2.0 * lattice.half_size.z;
        float plane = clamp((float(slab) - lattice.half_size.z - ray.q.z) * ray.inverse.z, piece.x, max(piece.x, piece.y));
        float ahead = plane - piece.x, after = len - ahead;
        bool down = ray.d.z < 0.0;
        float below = on_slice(index, max(float(slab) - 1.0, 0.0), 0.0, lattice);
        float above = on_slice(index, min(float(slab) + 1.0, last), 0.0, lattice);
        if (is_nan(below)) len -= down ? after : ahead;
        if (is_nan(above)) len -= down ? ahead : after;
        len = max(len, 0.0);
    }
    // Lengths, then extinction: 0 * tau must stay 0.
    return emission_of(optics.rgb, tau * (len * ray.length_per_depth));
}
