// Counts of samples and fetches of a frame. Shaders count in registers whether anybody asks or not: compilers remove what nobody reads.
#ifndef COUNTS_GLSL
#define COUNTS_GLSL

#include "interface.glsl"

layout(constant_id = SPEC_COUNTED) const bool COUNTED = false;

// Sums of 64 bits: samples, that is reconstructions of the field, and the fetches from textures that they took.
layout(set = 0, binding = BINDING_COUNTS, std430) buffer Counts { uint counts[]; };

uint taken_samples = 0u, taken_fetches = 0u;

void add_count(uint word, uint count) {
    uint before = atomicAdd(counts[word], count);
    if (before > ~count) atomicAdd(counts[word + 1u], 1u);
}

// Adds what an invocation has taken to the sums of the frame.
void add_counts() {
    if (!COUNTED) return;
    add_count(COUNTS_SAMPLES, taken_samples);
    add_count(COUNTS_FETCHES, taken_fetches);
}

#endif
