// entry compute  OVERRUN
// entry compute  COPY
// entry compute  STORE
// entry compute  SAMPLE
// entry fragment COLOUR
// entry fragment KBUFFER
//
// Shaders of deliberate faults. Each is right by itself; the fault is in how the host uses it, except
//
//   OVERRUN  writes a word behind the end of its list
//   KBUFFER  updates a pixel of a storage image without a critical section
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"

#ifdef OVERRUN
layout(local_size_x = 1) in;
layout(set = 0, binding = BINDING_RESULT, std430) buffer Result {
    uint words[];
} result;
void main() {
    result.words[result.words.length() + 16] = 1u;
}
#endif

#ifdef COPY
layout(local_size_x = 1) in;
layout(set = 0, binding = BINDING_LISTS, std430) readonly buffer Lists {
    uint words[];
} lists;
layout(set = 0, binding = BINDING_RESULT, std430) writeonly buffer Result {
    uint words[];
} result;
layout(push_constant, std430) uniform ProbePush {
    uint count;
} push;
void main() {
    result.words[0] = lists.words[0] + push.count;
}
#endif

#ifdef STORE
layout(local_size_x = 1) in;
layout(set = 0, binding = BINDING_ACCUMULATION, rgba32f) writeonly uniform image2D accumulation;
void main() {
    imageStore(accumulation, ivec2(gl_GlobalInvocationID.xy), vec4(1.0));
}
#endif

#ifdef SAMPLE
layout(local_size_x = 1) in;
layout(set = 0, binding = BINDING_SOURCE) uniform sampler2D source;
layout(set = 0, binding = BINDING_RESULT, std430) writeonly buffer Result {
    uint words[];
} result;
void main() {
    result.words[0] = floatBitsToUint(textureLod(source, vec2(0.5), 0.0).r);
}
#endif

#ifdef COLOUR
layout(location = 0) out vec4 colour;
void main() {
    colour = vec4(1.0);
}
#endif

#ifdef KBUFFER
layout(set = 0, binding = BINDING_ACCUMULATION, rgba32f) coherent uniform image2D accumulation;
void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    imageStore(accumulation, pixel, imageLoad(accumulation, pixel) + vec4(1.0));
}
#endif
