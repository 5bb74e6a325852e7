// Illumination of a grid: Phong's model with the central difference of the trilinear field as normal, one directional light, both sides
// alike.
//
//   error that of the sampler's weights, amplified where the gradient is small; the highlight also has its exponent times that of pow
//   cost  six fetches for each piece of a ray that shows anything
//
// Source: Levoy, Display of Surfaces from Volume Data, 1988; Phong, 1975.
#ifndef LIGHTING_GLSL
#define LIGHTING_GLSL

#include "interface.glsl"
#include "grid/grid.glsl"
#include "grid/volume.glsl"

layout(constant_id = SPEC_LIT) const bool LIT = false;

// A is the matrix from index to world, in voxel spacings, and l points to the light.
struct Light {
    vec4 squares;     // diagonal of (A^T A)^-1; w: ambient
    vec4 products;    // its elements yz, zx, xy; w: diffuse
    vec4 of_gradient; // A^-1 l; w: specular
    vec4 of_ray;      // A^T l; w: shininess
    float least;      // length of the gradient, in scalars per voxel spacing, up to which nothing is lit
    float from_eye;   // 1: l points to the eye, along each ray
    vec2 pad;
};

layout(set = 0, binding = BINDING_LIGHT, std140) uniform LightUniform {
    Light light;
};

// Returns the difference of scalars over two voxels along an axis of the grid.
float difference(vec3 position, vec3 axis, float level, Lattice lattice) {
    return stored_near(position, axis, level, lattice) - stored_near(position, -axis, level, lattice);
}

// Returns premultiplied colour and opacity of a piece that shows something, as the light shows them at depth z of the ray.
vec4 lit_at(vec4 emission, Ray ray, float z, Lattice lattice) {
    vec3 position = fma(vec3(z), ray.d, ray.q);
    float level = PREFILTER ? level_at(z, lattice) : 0.0;
    vec3 gradient = (0.5 * lattice.value_scale) * vec3(difference(position, vec3(1.0, 0.0, 0.0), level, lattice),
                                                       difference(position, vec3(0.0, 1.0, 0.0), level, lattice),
                                                       difference(position, vec3(0.0, 0.0, 1.0), level, lattice));
    // Its largest component scales it, so that no square overflows.
    float largest = max(max(abs(gradient.x), abs(gradient.y)), abs(gradient.z));
    bool known = largest > 0.0 && !(HAS_NAN && is_nan(gradient.x + gradient.y + gradient.z));
    vec3 g = known ? gradient / largest : vec3(1.0, 0.0, 0.0);
    float squared = max(dot(g * g, light.squares.xyz) + 2.0 * dot(g.yzx * g.zxy, light.products.xyz), 1e-37);
    float inverse_length = inversesqrt(squared), voxels = ray.length_per_depth / push.unit;
    if (!known || largest <= light.least * inverse_length) return emission;
    // Cosines between the normal, the light and the direction to the eye.
    float n_v = -dot(g, ray.d) * inverse_length / voxels;
    float n_l = dot(g, light.of_gradient.xyz) * inverse_length;
    float l_v = -dot(light.of_ray.xyz, ray.d) / voxels;
    float n_h = (n_l + n_v) * inversesqrt(max(2.0 + 2.0 * l_v, 1e-12));
    if (light.from_eye != 0.0) n_l = n_h = n_v;
    float seen = fma(light.products.w, min(abs(n_l), 1.0), light.squares.w);
    float highlight = light.of_gradient.w * pow(min(abs(n_h), 1.0), light.of_ray.w);
    return vec4(fma(emission.rgb, vec3(seen), vec3(highlight * emission.a)), emission.a);
}

// The same for any piece. (A loop, because software rasterisers execute branches that no invocation takes.)
vec4 lit(vec4 emission, Ray ray, float z, Lattice lattice) {
    vec4 seen = emission;
    for (uint once = 0u; once < uint(emission.a > 0.0); ++once) seen = lit_at(emission, ray, z, lattice);
    return seen;
}

#endif
