// The depth at which the ray of each pixel becomes opaque enough, for passes after the frame: where its transmittance falls to a threshold.
#ifndef HIT_DEPTHS_GLSL
#define HIT_DEPTHS_GLSL

#include "interface.glsl"

layout(constant_id = SPEC_HIT_AT) const uint HIT_AT = 0u;

// A depth for each pixel, in the technique's unit of depth, from the plane through the data's centre; 0: none so far.
layout(set = 0, binding = BINDING_HIT_DEPTHS, std430) buffer HitDepths { float hit_depths[]; };

// Notes a piece of the ray of a pixel, in which the transmittance falls from `before` to `after` between two depths, as in constant extinction.
// Between two dispatches it may be rounded across the threshold: then the first piece that follows counts.
void note_hit(uint pixel, float before, float after, float begin, float end) {
    float at = uintBitsToFloat(HIT_AT);
    float x = clamp(log2(before / at) / log2(before / max(after, 1e-30)), 0.0, 1.0);
    float depth = fma(x, end - begin, begin);
    // (One branch: compilers of software devices search through all that follow each other in a loop.)
    if (all(bvec3(HIT_AT != 0u, after <= at, before > 0.0))) {
        float noted = hit_depths[pixel];
        hit_depths[pixel] = before <= at && noted != 0.0 ? noted : depth == 0.0 ? 1e-30 : depth;
    }
}

// Forgets what was noted of a pixel that is drawn again.
void forget_hit(uint pixel) {
    if (HIT_AT != 0u) hit_depths[pixel] = 0.0;
}

#endif
