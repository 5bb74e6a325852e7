// A march through a grid in pages: a ray stops where it misses a page, which it then wants, and goes on in the next recording. One that its
// dispatch has not ended otherwise goes on in the next dispatch.
#ifndef PAGING_GLSL
#define PAGING_GLSL

#include "interface.glsl"
#include "grid/empty-space.glsl"
#include "grid/pages.glsl"

// How far the ray of a pixel, or of a texel of a base plane, has come.
struct RayState {
    uint slab;           // the next, and RAY_WAITS; RAY_ENDED
    float transmittance; // in front of it; of maximum intensity projection the greatest scalar
    float reached;       // depth at which a surface has split the slab
    float layer;         // depth of the next surface
    uint front;          // bits of the stored values on the front and the back of the slab; UNKNOWN
    uint back;
};

layout(set = 0, binding = BINDING_WANTED, std430) buffer Wanted { uint wanted[]; };
layout(set = 0, binding = BINDING_RAYS, std430) buffer Rays { RayState rays[]; };

const uint RAY_ENDED = 0xffffffffu;
const uint RAY_WAITS = 0x80000000u; // for a page

const uint UNKNOWN = 0xffffffffu;
const RayState FIRST_STATE = RayState(0u, 1.0, -3e38, -3e38, UNKNOWN, UNKNOWN);

// Returns the bits of a stored value; of a NaN with those of UNKNOWN another's.
uint bits_of(float value) {
    return min(floatBitsToUint(value), UNKNOWN - 1u);
}

// Notes that a ray has not ended, how much may still come from behind, and the page that it has missed. Of maximum intensity projection all may.
void note_unfinished(float transmittance) {
    if (GREATEST) transmittance = 1.0;
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

// Notes that a ray has come to a slab. Returns what the next dispatch finds.
RayState ray_at(bool ended, uint slab, float transmittance, float reached, float layer, uint front, uint back) {
    if (ended) return RayState(RAY_ENDED, transmittance, reached, layer, front, back);
    note_unfinished(transmittance);
    return RayState(slab | (has_missed() ? RAY_WAITS : 0u), transmittance, reached, layer, front, back);
}

// Returns whether a ray goes on from where the dispatch before has left it. One that waits for a page does once pages have been loaded.
bool goes_on(inout RayState ray, uint order) {
    if (ray.slab == RAY_ENDED) return false;
    if ((ray.slab & RAY_WAITS) != 0u && (order & MARCH_SAME_PAGES) != 0u) {
        note_unfinished(ray.transmittance);
        return false;
    }
    ray.slab &= ~RAY_WAITS;
    return true;
}

#endif
