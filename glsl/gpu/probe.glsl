// entry compute LOOP
// entry compute FILTER
//
// Start-up probes: they measure what Vulkan leaves open, and what drivers are known to get wrong.
//
//   LOOP    counts to `count` in one loop, with a body that compilers cannot fold into arithmetic: some drivers silently leave a
//           loop after a fixed number of iterations
//   FILTER  samples a 2x2x2 volume along x at `count` evenly spaced positions
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"

layout(push_constant, std430) uniform ProbePush {
    uint count;
} push;

layout(set = 0, binding = BINDING_RESULT, std430) buffer Result {
    uint words[];
} result;

#ifdef LOOP
layout(local_size_x = 1) in;
void main() {
    uint state = push.count;
    uint turns = 0u;
    for (uint i = 0u; i < push.count; ++i) {
        state = state * 1664525u + 1013904223u;
        turns += 1u + (state >> 31) * 0x10000000u; // the high bits keep the loop from being folded
    }
    result.words[0] = turns & 0x0fffffffu;
}
#endif

#ifdef FILTER
layout(local_size_x = 64) in;
layout(set = 0, binding = BINDING_VOLUME) uniform sampler3D volume;
void main() {
    uint i = INVOCATION.x;
    if (i >= push.count) return;
    float x = float(i) / float(push.count - 1u);
    result.words[i] = floatBitsToUint(textureLod(volume, sampled_at(vec3((x + 0.5) / 2.0, 0.5, 0.5), vec3(2.0)), 0.0).r);
}
#endif
