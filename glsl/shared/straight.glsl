// Right-angled coordinates of a view, whose X, Y and depth are counted from the ray of the image's middle (src/scene/camera.rs).
#ifndef STRAIGHT_GLSL
#define STRAIGHT_GLSL

// Returns an offset from the eye, or along a line, at right angles.
vec3 straight(vec3 v, float aspect, vec2 skew) {
    return vec3(fma(v.z, skew.x, v.x * aspect), fma(v.z, skew.y, v.y), v.z);
}

// Returns by how much a place is farther from the eye than it is deep, without the difference; `from_eye` is at right angles.
float further_than_deep(vec3 from_eye) {
    float r2 = dot(from_eye.xy, from_eye.xy), z = abs(from_eye.z);
    return r2 / max(sqrt(r2 + z * z) + z, 1e-30);
}

#endif
