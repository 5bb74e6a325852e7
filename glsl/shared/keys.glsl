// Sort keys from floats. `float_key` of src/primitives/radix_sort.rs computes the same on the host.
#ifndef KEYS_GLSL
#define KEYS_GLSL

// Returns an unsigned key in the order of the float: -inf first, -0 equal to +0, +inf, then every NaN as 0xFFFFFFFF.
// Only bits are compared, so that subnormal numbers keep their order on devices that flush them to zero.
uint float_key(float value) {
    uint bits = floatBitsToUint(value);
    uint magnitude = bits & 0x7fffffffu;
    if (magnitude > 0x7f800000u) return 0xffffffffu;
    if (magnitude == 0u) return 0x80000000u;
    return bits == magnitude ? bits | 0x80000000u : ~bits;
}

#endif
