// entry compute COMPUTE
//
// Finds the depths between which each tile of 8 x 8 pixels shows anything, so that the marches of its pixels begin and end there.
//
// The ray of a tile's centre walks through the bricks, and looks at those around each as well. At equal depth the rays of the tile's
// pixels lie within a brick's side of it along each axis, so they are in bricks that it has looked at. Where that does not hold, because
// pixels are that large (MARCH_WIDE), the whole ray is shown.
//
//   in    whether anything is visible in each brick and those around it (bricks.glsl)
//   out   two depths per tile, the first greater where it shows nothing; LISTS: a list of those that do, with the workgroups that draw them,
//         and transparent pixels in the others
//   cost  a brick per 8 voxels along each tile's ray
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"
#include "shared/brick-codes.glsl"
#include "shared/integers.glsl"
#include "frame/listed.glsl"
#include "grid/grid.glsl"
#include "grid/empty-space.glsl"

layout(set = 0, binding = BINDING_AROUND, std430) readonly buffer Around {
    uint bits[];
} around;

layout(set = 0, binding = BINDING_TILE_INTERVALS, std430) buffer TileIntervals {
    vec2 of_tile[];
} intervals;

layout(set = 0, binding = BINDING_ACCUMULATION, rgba32f) uniform writeonly image2D accumulation;

layout(constant_id = SPEC_BY_TILE_LIST) const bool LISTS = false;

layout(local_size_x = TILE, local_size_y = TILE) in;

// Returns the depths between which a tile shows anything, the first greater where it shows nothing.
vec2 shown_by(uvec2 tile) {
    Ray ray = ray_of((vec2(tile) + 0.5) * float(TILE));
    BrickGrid grid = bricks_of(push.half_slope.xyz, push.order & MARCH_AXIS);

    const float SIDE = float(BRICK), NUDGE = 0.01; // cells
    vec2 interval = domain_of(ray, grid.half_size + SIDE, nearest_depth());
    if ((push.order & MARCH_WIDE) != 0u) return vec2(-3e38, 3e38);
    float speed = max(max(abs(ray.d.x), abs(ray.d.y)), abs(ray.d.z));
    float nudge = NUDGE / max(speed, 1e-30), at = interval.x;
    vec2 shown = vec2(3e38, -3e38);
    while (at < interval.y) {
        vec3 place = (fma(vec3(at + nudge), ray.d, ray.q) + grid.half_size) / SIDE;
        // Outside of the grid the nearest brick stands for its neighbours there.
        vec3 brick = floor(place);
        ivec3 code = whole_of(clamp(brick, vec3(0.0), vec3(grid.count - 1))) * grid.stride;
        int number = code.x + code.y + code.z;
        vec3 face = (brick + mix(vec3(0.0), vec3(1.0), greaterThan(ray.inverse, vec3(0.0)))) * SIDE;
        vec3 leave = (face - grid.half_size - ray.q) * ray.inverse;
        float next = max(min(min(leave.x, leave.y), leave.z), at + nudge);
        if (bit_of(around.bits[number / 32], number)) shown = vec2(min(shown.x, at), next + nudge);
        at = next;
    }
    return shown;
}

shared uint group_count, group_begin;
shared bool shows[TILE * TILE];

// Makes the pixels of the workgroup's tiles that show nothing transparent: a pixel per invocation, one tile after the other.
void clear_hidden(uvec2 first_tile, uvec2 sides) {
    for (uint i = 0u; i < TILE * TILE; ++i) {
        uvec2 pixel = (first_tile + uvec2(i % TILE, i / TILE)) * TILE + gl_LocalInvocationID.xy;
        if (!shows[i] && all(lessThan(pixel, sides))) imageStore(accumulation, ivec2(pixel), vec4(0.0));
    }
}

void main() {
    // A workgroup has a square of tiles, which follow each other in the list: tiles side by side share cache lines of the volume.
    uvec2 sides = sides_of(push.sides), tiles = (sides + TILE - 1u) / TILE;
    uvec2 tile = INVOCATION.xy;
    bool is_listed = false;
    if (all(lessThan(tile, tiles))) {
        vec2 shown = shown_by(tile);
        intervals.of_tile[tile.y * tiles.x + tile.x] = shown;
        is_listed = shown.x <= shown.y;
    }
    if (!LISTS) return;
    if (gl_LocalInvocationIndex == 0u) group_count = 0u;
    shows[gl_LocalInvocationIndex] = is_listed;
    barrier();
    clear_hidden(tile - gl_LocalInvocationID.xy, sides);
    uint place = is_listed ? atomicAdd(group_count, 1u) : 0u;
    barrier();
    if (gl_LocalInvocationIndex == 0u && group_count > 0u) group_begin = room_for(group_count, 1u);
    barrier();
    if (is_listed) pixels[group_begin + place] = tile.x | tile.y << 16;
}
