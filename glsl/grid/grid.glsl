// Push constants of the techniques for grids, and the rays of pixels in index space.
//
// Depth z is measured along the view from the plane through the domain's centre, and positions from that centre in grid indices, so
// that a far eye loses no precision. Depth is in units of the smallest voxel spacing, so that the world's scale loses none either.
// The ray of a pixel is p(z) = q + z d with
//   q = q0 + kq (x px + y py),  d = d0 + kd (x px + y py),
// x and y in pixels from the image's centre, y down. Perspective: kq = depth of the centre plane from
// the eye, kd = 1. Orthographic: kq = 1, kd = 0. The tangents of the angle between a ray and the view are linear in x and in y.
#ifndef GRID_GLSL
#define GRID_GLSL

#include "interface.glsl"
#include "shared/sides.glsl"
#include "grid/ray.glsl"
#include "grid/lattice.glsl"

layout(push_constant, std430) uniform GridPush {
    vec4 q0_kq;       // w: kq
    vec4 px_slope;    // w: change of the tangent with x; 0 for orthographic
    vec4 py_z0;       // w: where slab 0 begins, in the technique's own measure
    vec4 d0_h;        // w: thickness of a slab, in the same measure
    vec4 half_slope;  // half the domain, indices; w: change of the tangent with y
    vec2 slopes;      // tangents of the central ray
    uint sides;       // of the image (sides.glsl)
    float value_scale; // scalar = value_scale * texel + value_offset
    float value_offset;
    uint knots;       // number of knots
    uint first;       // first slab of this draw or dispatch; PILOT: number of the level
    uint count;       // number of slabs of this draw or dispatch
    uint order;       // raster: RASTER_*; compute: MARCH_*
    float unit;       // world length of one unit of depth: the smallest voxel spacing
    float opaque;     // transmittance at which a ray ends
    uint seed;        // of dithering; PILOT: bits of the squared change of colour that ends a ray; PAGED: most slabs of a dispatch
} push;

float kd_of_view() {
    return push.px_slope.w > 0.0 ? 1.0 : 0.0;
}

// Returns half the image, in pixels.
vec2 half_image() {
    return half_of(push.sides);
}

// Returns the smallest depth to draw: that of the eye for perspective.
float nearest_depth() {
    return push.px_slope.w > 0.0 ? -push.q0_kq.w : -1e30;
}

// Returns the number of a pixel's tile in the image.
uint tile_of(ivec2 pixel) {
    uint across = (sides_of(push.sides).x + TILE - 1u) / TILE;
    return uint(pixel.y) / TILE * across + uint(pixel.x) / TILE;
}

// Returns the ray through a point of the image, in pixels.
Ray ray_of(vec2 pixel) {
    vec2 xy = pixel - half_image();
    vec3 lateral = fma(vec3(xy.x), push.px_slope.xyz, xy.y * push.py_z0.xyz);
    vec2 slope = fma(xy, vec2(push.px_slope.w, push.half_slope.w), push.slopes);
    vec3 q = fma(vec3(push.q0_kq.w), lateral, push.q0_kq.xyz);
    vec3 d = fma(vec3(kd_of_view()), lateral, push.d0_h.xyz);
    return Ray(q, d, finite_inverse(d), push.unit * sqrt(1.0 + dot(slope, slope)));
}

// Returns the parameters of reconstruction. A stack of 2D textures has mip levels along its slices only.
Lattice lattice_of_view(bool stack) {
    vec3 px = push.px_slope.xyz, py = push.py_z0.xyz;
    if (stack) px.z = py.z = 0.0;
    float footprint = max(dot(px, px), dot(py, py));
    return Lattice(push.half_slope.xyz, push.value_scale, push.value_offset, push.q0_kq.w, kd_of_view(),
                   PREFILTER ? 0.5 * log2(footprint) : 0.0, push.order & MARCH_AXIS, ivec4(0), vec3(0.0));
}

#endif
