// Rays in the index space of a grid, and the domain that they cross.
#ifndef RAY_GLSL
#define RAY_GLSL

// The ray q + z d at depth z.
struct Ray {
    vec3 q;
    vec3 d;
    vec3 inverse;           // 1 / d, finite
    float length_per_depth; // world length of one unit of depth
};

// Returns the depth in the middle of a piece of a ray.
float middle_of(vec2 piece) {
    return 0.5 * (piece.x + piece.y);
}

// Returns 1 / d, finite: a zero component would give 0 * inf = NaN on a face of the domain itself.
vec3 finite_inverse(vec3 d) {
    vec3 safe = mix(d, vec3(1e-30), lessThan(abs(d), vec3(1e-30)));
    return 1.0 / safe;
}

// Returns the depths at which the ray enters and leaves the part of the domain beyond depth `nearest`; the first is greater where
// the ray misses it. `half_size` is half the domain, in indices.
vec2 domain_of(Ray ray, vec3 half_size, float nearest) {
    vec3 a = (-half_size - ray.q) * ray.inverse;
    vec3 b = (half_size - ray.q) * ray.inverse;
    vec3 near = min(a, b), far = max(a, b);
    // A ray parallel to a pair of faces lies between them everywhere, the faces included, or nowhere.
    vec3 between = mix(vec3(1e30), vec3(-1e30), lessThanEqual(abs(ray.q), half_size));
    near = mix(near, between, lessThan(abs(ray.d), vec3(1e-30)));
    far = mix(far, -between, lessThan(abs(ray.d), vec3(1e-30)));
    return vec2(max(max(max(near.x, near.y), near.z), nearest), min(min(far.x, far.y), far.z));
}

#endif
