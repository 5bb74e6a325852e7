// The march of the compute routes: one invocation owns a pixel and goes front to back in registers, perhaps in
// several dispatches, past bricks in which nothing is visible. For grid.glsl's rays.

layout(local_size_x = 8, local_size_y = 8) in;
layout(constant_id = SPEC_RESUME) const bool RESUME = false;

#if defined(BASE_PLANE) && !defined(EDGE)
layout(set = 0, binding = BINDING_INTERMEDIATE, std430) buffer Intermediate {
    vec4 intermediate[];
};

bool in_image(ivec2 texel) {
    return all(lessThan(texel, ivec2(push.size)));
}

vec4 kept(ivec2 texel) {
    return intermediate[push.offset + uint(texel.y) * push.size.x + uint(texel.x)];
}

void keep(ivec2 texel, vec4 sum) {
    intermediate[push.offset + uint(texel.y) * push.size.x + uint(texel.x)] = sum;
}
#else
layout(set = 0, binding = BINDING_ACCUMULATION, rgba32f) uniform image2D accumulation;

bool in_image(ivec2 pixel) {
#ifdef EDGE
    return all(lessThan(pixel, imageSize(accumulation)));
#else
    return all(lessThan(pixel, ivec2(2.0 * push.half_extent + 0.5)));
#endif
}

vec4 kept(ivec2 pixel) {
    return imageLoad(accumulation, pixel);
}

void keep(ivec2 pixel, vec4 sum) {
    imageStore(accumulation, pixel, sum);
}
#endif

#ifndef BASE_PLANE
#define MARCH_LAYERS
#include "frame/layers.glsl"

// The translucent surfaces that lie before `begin`, where this dispatch begins, have been passed by the one before.
LayersAhead begin_layers(ivec2 pixel, float begin) {
    return layers_from(uvec2(pixel), uint(2.0 * push.half_extent.x + 0.5), push.first > 0u ? begin : -3e38);
}

// Where another dispatch goes on; never where none does.
float layers_end(float end) {
    return (push.order & 4u) != 0u ? end : 3e38;
}
#endif

// Ends the march, or leaves for the next dispatch opacity where it is small and else the transmittance, negative, so
// that neither loses digits.
void end_march(ivec2 pixel, vec4 sum, float transmittance) {
    bool more = (push.order & 4u) != 0u;
    if (more && sum.a > 0.5) sum.a = -max(transmittance, 1e-37);
    keep(pixel, sum);
}

// Begins the march, or reads back what the dispatch before has left: what was summed, and the transmittance.
vec4 begin_march(ivec2 pixel, out float transmittance) {
    vec4 sum = RESUME ? kept(pixel) : vec4(0.0);
    transmittance = 1.0 - sum.a;
    if (sum.a < 0.0) {
        transmittance = -sum.a;
        sum.a = 1.0 - transmittance;
    }
    return sum;
}

layout(constant_id = SPEC_EMPTY_SPACE) const bool EMPTY_SPACE = false;

layout(set = 0, binding = BINDING_BRICKS, std430) readonly buffer Bricks {
    uint visible[];
} bricks;

struct BrickGrid {
    ivec3 count;
    ivec3 stride;
    vec3 half_size;
};

BrickGrid load_bricks() {
    vec3 half_size = push.half_scale.xyz;
    ivec3 count = max(ivec3(ceil(2.0 * half_size / float(BRICK) - 1e-3)), ivec3(1));
    // Strides are those of the grid's own axes, whichever of them is z here.
    uint axis = push.order & 3u;
    ivec3 stride = axis == 2u ? ivec3(1, count.x, count.x * count.y)
                 : axis == 0u ? ivec3(count.z, count.z * count.x, 1)
                                   : ivec3(count.y * count.z, 1, count.y);
    return BrickGrid(count, stride, half_size);
}

// Slabs, some h cells thick, that are walked before the next look at the bricks: two bricks' worth. All invocations walk equally
// many, so that those that run in step do not wait for each other.
uint slabs_between_looks(float h) {
    return uint(clamp(2.0 * float(BRICK) / h, 4.0, 64.0));
}

// Depth up to which nothing is visible on the ray, from depth z on; z where the brick around it shows something.
//
// Positions may fall into a neighbouring brick by rounding, and a corner of a brick thinner than the nudge may
// be passed over: bricks know the samples of one cell around them.
float empty_until(Ray ray, float z, float far, BrickGrid grid) {
    const float NUDGE = 0.01; // cells
    float speed = max(max(abs(ray.d.x), abs(ray.d.y)), abs(ray.d.z));
    float nudge = NUDGE / max(speed, 1e-30);
    float at = z;
    for (int turn = 0; turn < 64; ++turn) {
        vec3 place = (fma(vec3(at + nudge), ray.d, ray.q) + grid.half_size) / float(BRICK);
        ivec3 brick = clamp(ivec3(floor(place)), ivec3(0), grid.count - 1);
        ivec3 word = brick * grid.stride;
        if (bricks.visible[word.x + word.y + word.z] != 0u) break;
        vec3 face = (vec3(brick) + mix(vec3(0.0), vec3(1.0), greaterThan(ray.inverse, vec3(0.0)))) * float(BRICK);
        vec3 leave = (face - grid.half_size - ray.q) * ray.inverse;
        at = max(min(min(leave.x, leave.y), leave.z), at + nudge);
        if (at >= far) break;
    }
    return at;
}

// Passes over those of the slabs from `slab` to `end` that show nothing, slab i being that of depths z0 + i h and
// the first of them beginning at depth z of the ray. Returns the slab before which to look again.
uint pass_empty(inout uint slab, uint end, float z, float z0, float h, uint walk, Ray ray, float far, BrickGrid grid) {
    if (!EMPTY_SPACE) return end;
    // Slabs that end before there show nothing.
    float until = empty_until(ray, z, far, grid);
    slab = clamp(uint(max(floor((until - z0) / h), 0.0)), slab, end);
    return min(slab + walk, end);
}
