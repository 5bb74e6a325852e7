// Sums over a workgroup of WIDE_GROUP invocations in one dimension, without subgroup operations; include only.

shared uint group_scratch[2][WIDE_GROUP];

// Sum of the values of the invocations before this one, and of all (Hillis and Steele 1986, two copies so that a
// step takes one barrier). In uniform control flow only. The caller has a barrier before it calls again.
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
