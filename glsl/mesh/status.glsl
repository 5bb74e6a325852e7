// The status of a frame of a mesh.
#ifndef STATUS_GLSL
#define STATUS_GLSL

#include "interface.glsl"

layout(set = 0, binding = BINDING_STATUS, std430) buffer Status { uint status[]; };

// Counts the fragments of a pixel, in 64 bits.
void count_fragments(uint number) {
    if (number == 0u) return;
    uint before = atomicAdd(status[STATUS_FRAGMENTS], number);
    if (before + number < before) atomicAdd(status[STATUS_FRAGMENTS_HIGH], 1u);
}

#endif
