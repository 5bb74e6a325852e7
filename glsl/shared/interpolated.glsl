// Linear interpolation in arithmetic of its own: drivers expand `mix` as they like, even where the shader is `precise`.
#ifndef INTERPOLATED_GLSL
#define INTERPOLATED_GLSL

// Returns a where w is 0, and b where w is 1, exactly.
float interpolated(float a, float b, float w) {
    return fma(b, w, a * (1.0 - w));
}

vec4 interpolated(vec4 a, vec4 b, float w) {
    return fma(b, vec4(w), a * (1.0 - w));
}

#endif
