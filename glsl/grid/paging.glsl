// A march through a grid in pages: a ray stops where it misses a page, which it then wants, and goes on in the next dispatch or frame.
#ifndef PAGING_GLSL
#define PAGING_GLSL

#include "interface.glsl"
#include "grid/pages.glsl"

// How far the ray of a pixel has come.
struct RayState {
    uint slab;           // the next; RAY_ENDED
    float transmittance; // in front of it; of maximum intensity projection the greatest scalar
    float reached;       // depth at which a surface has split the slab
    float layer;         // depth of the next surface
    uint front;          // bits of the stored values on the front and the back of the slab; UNKNOWN
    uint back;
};

layout(set = 0, binding = BINDING_WANTED, std430) buffer Wanted { uint wanted[]; };
layout(set = 0, binding = BINDING_RAYS, std430) buffer Rays { RayState rays[]; };

const uint RAY_ENDED = 0xffffffffu;

// No sample has these bits.
const uint UNKNOWN = 0xffffffffu;
const RayState FIRST_STATE = RayState(0u, 1.0, -3e38, -3e38, UNKNOWN, UNKNOWN);

// Notes that a ray has not ended, how much may still come from behind, and the page that it has missed.
void note_unfinished(float transmittance) {
    if (wanted[WANTED_UNFINISHED] == 0u) wanted[WANTED_UNFINISHED] = 1u;
    uint bits = floatBitsToUint(transmittance), square = uint(ceil(transmittance * transmittance * 65536.0));
    if (wanted[WANTED_GREATEST] < bits) atomicMax(wanted[WANTED_GREATEST], bits);
    uint sum = atomicAdd(wanted[WANTED_SQUARES], square) + square;
    if (sum < square) atomicAdd(wanted[WANTED_SQUARES + 1], 1u);
    if (missed_page == 0u) return;
    uint mark = WANTED_FIRST + WANTED_MOST + missed_page - 1u;
    if (wanted[mark] != 0u || atomicExchange(wanted[mark], 1u) != 0u) return;
    uint place = atomicAdd(wanted[WANTED_COUNT], 1u);
    if (place < WANTED_MOST) wanted[WANTED_FIRST + place] = missed_page - 1u;
}

#endif
