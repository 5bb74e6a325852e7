// Prefix sums over a one-dimensional workgroup of WIDE_GROUP invocations, without subgroup operations.
#ifndef GROUP_SCAN_GLSL
#define GROUP_SCAN_GLSL

#include "interface.glsl"

shared uint group_scratch[2][WIDE_GROUP];

// Returns the sum of the values of the invocations before this one; `total` is the sum of all. Hillis and Steele 1986, with two
// copies so that a step needs one barrier. Call it in uniform control flow, with a barrier between two calls.
uint group_exclusive(uint value, out uint total) {
    uint self = gl_LocalInvocationID.x;
    uint from = 0u;
    group_scratch[0][self] = value;
    barrier();
    for (uint reach = 1u; reach < WIDE_GROUP; reach *= 2u) {
        uint sum = group_scratch[from][self];
        if (self >= reach) sum += group_scratch[from][self - reach];
        from ^= 1u;
        group_scratch[from][self] = sum;
        barrier();
    }
    total = group_scratch[from][WIDE_GROUP - 1u];
    return group_scratch[from][self] - value;
}

#endif
