// entry compute FETCH
// entry compute TEXEL
// entry compute COPY
// entry compute IMAGE
// entry compute ATOMIC
// entry compute EXPONENTIAL
// entry fragment FRAGMENT
//
// Micro-benchmarks: each entry does one kind of work, and as little else as it can. Results are stored only under a condition that never
// holds and that no compiler can know.
//
//   FETCH        filters `count` samples of a volume along a ray, half a voxel apart; the rays of a workgroup are neighbours
//   TEXEL        fetches as many single texels, a voxel apart
//   COPY, IMAGE  copy a buffer and an image, 16 bytes per invocation
//   ATOMIC       adds to `count` words far apart
//   EXPONENTIAL  computes `count` of them, eight independent of each other at a time
//   FRAGMENT     has a faint colour, which fixed function blends
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#ifndef FRAGMENT
#include "shared/device.glsl"
layout(local_size_x = 64) in;
#endif

#if !defined(FRAGMENT) && !defined(IMAGE)
layout(push_constant, std430) uniform PeakPush {
    uint count; // of the work of an invocation; COPY: vectors of all
} push;
#endif

#if defined(FETCH) || defined(TEXEL) || defined(EXPONENTIAL) || defined(ATOMIC)
layout(set = 0, binding = BINDING_RESULT, std430) buffer Result {
    uint words[];
} result;
#endif

#if defined(FETCH) || defined(TEXEL)
layout(set = 0, binding = BINDING_VOLUME) uniform sampler3D volume;

// Returns where the ray of this invocation begins, in voxels: those of a workgroup are an 8 x 8 tile of pixels half a voxel apart.
vec2 ray() {
    uint tile = WORKGROUP_NUMBER & 127u;
    return vec2(tile & 15u, tile >> 4u) * 4.0 + vec2(gl_LocalInvocationIndex & 7u, gl_LocalInvocationIndex >> 3u) * 0.5 + 0.25;
}
#endif

#ifdef FETCH
void main() {
    float side = float(textureSize(volume, 0).z);
    vec3 at = vec3(ray(), 0.25) / side;
    float sum = 0.0;
    for (uint i = 0u; i < push.count; ++i) {
        sum += textureLod(volume, at, 0.0).r;
        at.z += 0.5 / side;
    }
    if (sum < 0.0) result.words[0] = 1u;
}
#endif

#ifdef TEXEL
void main() {
    int last = textureSize(volume, 0).z - 1;
    ivec3 at = ivec3(ray(), 0);
    float sum = 0.0;
    for (uint i = 0u; i < push.count; ++i) {
        sum += texelFetch(volume, at, 0).r;
        at.z = (at.z + 1) & last;
    }
    if (sum < 0.0) result.words[0] = 1u;
}
#endif

#ifdef COPY
layout(set = 0, binding = BINDING_STREAM, std430) readonly buffer Stream {
    vec4 vectors[];
} stream;
layout(set = 0, binding = BINDING_TEXELS, std430) buffer Texels {
    vec4 vectors[];
} copied;
void main() {
    uint i = INVOCATION_NUMBER;
    if (i < push.count) copied.vectors[i] = stream.vectors[i];
}
#endif

#ifdef IMAGE
layout(set = 0, binding = BINDING_SOURCE) uniform sampler2D source;
layout(set = 0, binding = BINDING_ACCUMULATION, rgba32f) uniform writeonly image2D copied;
void main() {
    uint across = uint(imageSize(copied).x) / 8u;
    uvec2 tile = uvec2(WORKGROUP_NUMBER % across, WORKGROUP_NUMBER / across);
    ivec2 at = ivec2(tile * 8u + uvec2(gl_LocalInvocationIndex & 7u, gl_LocalInvocationIndex >> 3u));
    imageStore(copied, at, texelFetch(source, at, 0));
}
#endif

#ifdef ATOMIC
void main() {
    uint i = INVOCATION_NUMBER, words = uint(result.words.length()); // a power of two
    for (uint turn = 0u; turn < push.count; ++turn) {
        i = i * 1664525u + 1013904223u;
        atomicAdd(result.words[(i >> 8) & (words - 1u)], 1u);
    }
}
#endif

#ifdef EXPONENTIAL
void main() {
    vec4 a = vec4(0.1, 0.2, 0.3, 0.4) + float(INVOCATION_NUMBER & 63u);
    vec4 b = a + 0.5;
    for (uint i = 0u; i < push.count / 8u; ++i) {
        a = exp(-a);
        b = exp(-b);
    }
    if (dot(a, b) < 0.0) result.words[0] = 1u;
}
#endif

#ifdef FRAGMENT
layout(location = 0) out vec4 colour;
void main() {
    colour = vec4(0.004);
}
#endif
