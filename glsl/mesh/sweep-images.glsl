// The sweep of a pixel in images, between two dispatches or two fragments: the pairs of the window, then the one that left last, two to a
// texel. Images 0 to 3 hold eight pairs; K above 7 takes two texels side by side.
#ifndef SWEEP_IMAGES_GLSL
#define SWEEP_IMAGES_GLSL

#include "interface.glsl"
#include "mesh/havs-sweep.glsl"

layout(set = 0, binding = BINDING_ACCUMULATION, rgba32f) coherent uniform image2D accumulation;
// Integers: images of floats may lose subnormal numbers, which the bits of a pair can be.
layout(set = 0, binding = BINDING_KBUFFER_0, rgba32ui) coherent uniform uimage2D kbuffer_0;
layout(set = 0, binding = BINDING_KBUFFER_1, rgba32ui) coherent uniform uimage2D kbuffer_1;
layout(set = 0, binding = BINDING_KBUFFER_2, rgba32ui) coherent uniform uimage2D kbuffer_2;
layout(set = 0, binding = BINDING_KBUFFER_3, rgba32ui) coherent uniform uimage2D kbuffer_3;

// Returns the sweep of a pixel, and fills its window. A sweep that has not begun is empty.
Sweep load_sweep(ivec2 pixel, PixelState state) {
    ivec2 at = K > 7u ? ivec2(pixel.x * 2, pixel.y) : pixel;
    uvec4 texels[8];
    texels[0] = imageLoad(kbuffer_0, at);
    texels[1] = K >= 2u ? imageLoad(kbuffer_1, at) : uvec4(0u);
    texels[2] = K >= 4u ? imageLoad(kbuffer_2, at) : uvec4(0u);
    texels[3] = K >= 6u ? imageLoad(kbuffer_3, at) : uvec4(0u);
    if (K > 7u) {
        at.x += 1;
        texels[4] = imageLoad(kbuffer_0, at);
        texels[5] = imageLoad(kbuffer_1, at);
        texels[6] = imageLoad(kbuffer_2, at);
        texels[7] = imageLoad(kbuffer_3, at);
    }
    Sweep sweep = empty_sweep();
    for (uint j = 0u; j <= K; ++j) {
        uvec2 both = (j & 1u) == 0u ? texels[j / 2u].xy : texels[j / 2u].zw;
        Pair pair = Pair(state.begun ? uintBitsToFloat(both.x) : NOTHING, state.begun ? both.y : 0u);
        if (j < K) window[j] = pair; else sweep.last = pair;
    }
    // Nothing is accumulated before something has left.
    vec4 sum = imageLoad(accumulation, pixel);
    sweep.sum = sweep.last.at == NOTHING ? vec4(0.0) : sum;
    sweep.end = end_at(scalar_of_pair(sweep.last));
    sweep.state = state;
    return sweep;
}

// Stores the window and the pair that left last. The sum and the state are left to the caller.
void store_window(ivec2 pixel, Pair last) {
    uvec4 texels[8];
    for (uint j = 0u; j <= K; ++j) {
        Pair pair = last;
        if (j < K) pair = window[j];
        uvec2 both = uvec2(floatBitsToUint(pair.at), pair.what);
        if ((j & 1u) == 0u) texels[j / 2u].xy = both; else texels[j / 2u].zw = both;
    }
    ivec2 at = K > 7u ? ivec2(pixel.x * 2, pixel.y) : pixel;
    imageStore(kbuffer_0, at, texels[0]);
    if (K >= 2u) imageStore(kbuffer_1, at, texels[1]);
    if (K >= 4u) imageStore(kbuffer_2, at, texels[2]);
    if (K >= 6u) imageStore(kbuffer_3, at, texels[3]);
    if (K > 7u) {
        at.x += 1;
        imageStore(kbuffer_0, at, texels[4]);
        imageStore(kbuffer_1, at, texels[5]);
        imageStore(kbuffer_2, at, texels[6]);
        imageStore(kbuffer_3, at, texels[7]);
    }
}

#endif
