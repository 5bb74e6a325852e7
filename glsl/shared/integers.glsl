// Integers by way of floats. Mesa's software driver converts floats to integers lane by lane, with some eight instructions each.
#ifndef INTEGERS_GLSL
#define INTEGERS_GLSL

// Returns the integer part of a float in [0, 2^23): the last bits of its sum with 2^23, where floats are whole numbers. Others, and NaN, give any
// number in [0, 2^23).
#define WHOLE_OF(INTEGER, FLOAT) \
INTEGER whole_of(FLOAT x) { \
    precise FLOAT sum = floor(x) + 8388608.0; \
    return INTEGER(floatBitsToInt(sum)) & 0x7fffff; \
}
WHOLE_OF(int, float)
WHOLE_OF(ivec2, vec2)
WHOLE_OF(ivec3, vec3)
WHOLE_OF(ivec4, vec4)
#undef WHOLE_OF

// Returns a / b for a below 2^24 and a quotient below 2^23. Processors have no division of vectors of integers, and GPUs take some twenty instructions.
uint quotient(uint a, uint b) {
    uint q = uint(whole_of(float(a) / float(b)));
    // Devices may be off by a few units in the last place, to either side of a whole number.
    q -= uint(q * b > a);
    return q + uint((q + 1u) * b <= a);
}

#endif
