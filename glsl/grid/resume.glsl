// The state of a ray between two dispatches of a march: one vec4 per pixel.
#ifndef RESUME_GLSL
#define RESUME_GLSL

#include "interface.glsl"

layout(constant_id = SPEC_RESUME) const bool RESUME = false;

// Returns the vec4 to store at the end of a dispatch. Where another one resumes, alpha is the opacity while that is small, and else
// the negative transmittance, so that neither loses precision.
vec4 packed_state(vec4 sum, float transmittance, bool more) {
    if (more && sum.a > 0.5) sum.a = -max(transmittance, 1e-37);
    return sum;
}

// Returns colour and opacity so far from the stored vec4, and the transmittance.
vec4 unpacked_state(vec4 state, out float transmittance) {
    vec4 sum = state;
    transmittance = 1.0 - sum.a;
    if (sum.a < 0.0) {
        transmittance = -sum.a;
        sum.a = 1.0 - transmittance;
    }
    return sum;
}

#endif
