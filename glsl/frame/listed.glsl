// Lists pixels that are drawn once more, or tiles of pixels; by-list.glsl and REPAIR of splat-ewa.glsl read such a list.
#ifndef LISTED_GLSL
#define LISTED_GLSL

#include "interface.glsl"

layout(set = 0, binding = BINDING_PIXELS, std430) buffer Pixels { uint pixels[]; };

// Makes room for entries and for the workgroups that draw them, `in_group` entries each; returns where the first is to be written.
uint room_for(uint count, uint in_group) {
    uint first = atomicAdd(pixels[PIXELS_COUNT], count), groups = (first + count + in_group - 1u) / in_group;
    // Every device has 65,535 workgroups in a dimension.
    atomicMax(pixels[0], min(groups, 65535u));
    atomicMax(pixels[1], (groups + 65534u) / 65535u);
    atomicMax(pixels[2], 1u);
    return PIXELS_FIRST + first;
}

#endif
