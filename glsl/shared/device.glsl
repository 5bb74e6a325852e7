// Properties of the device: Rust sets these constants for every shader that reads them (src/gpu/constants.rs).
#ifndef DEVICE_GLSL
#define DEVICE_GLSL

layout(constant_id = DEVICE_TURNS) const uint MOST_TURNS = 1;    // iterations that an invocation completes, over all its loops
layout(constant_id = DEVICE_WEIGHT_BITS) const uint WEIGHT_BITS = 0; // bits of emulated weights of samplers; 0: their own
layout(constant_id = DEVICE_PERMUTED) const bool PERMUTED = false; // workgroups take their work in reverse order

// Place of the workgroup or invocation in a dispatch, and its number there. (Macros: only compute shaders have these variables.)
#define WORKGROUP (PERMUTED ? gl_NumWorkGroups - 1u - gl_WorkGroupID : gl_WorkGroupID)
#define WORKGROUP_NUMBER (WORKGROUP.x + WORKGROUP.y * gl_NumWorkGroups.x)
#define INVOCATION (WORKGROUP * gl_WorkGroupSize + gl_LocalInvocationID)
#define INVOCATION_NUMBER (WORKGROUP_NUMBER * gl_WorkGroupSize.x + gl_LocalInvocationID.x)

// Returns a texture coordinate of an image of `size` texels, rounded as a sampler rounds it whose weights have WEIGHT_BITS.
vec3 sampled_at(vec3 coordinate, vec3 size) {
    if (WEIGHT_BITS == 0u) return coordinate;
    float steps = float(1u << WEIGHT_BITS);
    return (round((coordinate * size - 0.5) * steps) / steps + 0.5) / size;
}

#endif
