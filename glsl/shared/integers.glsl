// Integer division by floats: processors have no instruction for vectors of integers, and GPUs take some twenty.
#ifndef INTEGERS_GLSL
#define INTEGERS_GLSL

// Returns a / b for a below 2^24.
uint quotient(uint a, uint b) {
    uint q = uint(float(a) / float(b));
    // Devices may be off by a few units in the last place, to either side of a whole number.
    q -= uint(q * b > a);
    return q + uint((q + 1u) * b <= a);
}

#endif
