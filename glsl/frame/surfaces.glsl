// entry compute RESOLVE
// entry compute BEHIND
//
// Surfaces in the volume. Of the triangles along a pixel's ray (mesh-lists.glsl) the nearest opaque one ends the ray, and the
// translucent ones in front of it are composited with the volume.
//
//   RESOLVE  one invocation per pixel: drops triangles behind the eye, behind the nearest opaque one or behind the depth image, sorts
//            the rest, and bounds the ray
//   BEHIND   one invocation per pixel: composites the technique's image over the opaque surface
//
//   in    lists of triangles; bounds of rays by clip planes and the depth image
//   out   bounds of rays; per pixel the translucent surfaces within them, nearest first, as depths and premultiplied colours
//
// Depths are computed from the triangle's plane relative to the volume, so that a triangle far larger than the volume loses no
// precision.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"

#ifdef RESOLVE
layout(push_constant, std430) uniform SurfacePush {
    // A pixel's ray is q0 + kq L + z (forward + kd L), L = x right + y up, in units of the technique, from the data's centre.
    vec4 q0_kq;
    vec4 right_kd;
    vec4 up_near;       // w: depth of the eye
    vec4 forward_ratio; // w: ratio of the technique's depths to those of lists
    vec2 half_extent;   // of the image, pixels
    float offset;       // the technique's depth where that of lists is 0
    uint capacity;      // of the lists, entries
    uint across;        // tiles in a row
    uint tiles;
    float slack;        // error of the lists' depths where planes are seen edge-on, in units of the technique
    uint pad0;
} push;

layout(local_size_x = TILE_PIXELS) in;
layout(constant_id = SPEC_BOUNDED) const bool BOUNDED = false; // clip planes or a depth image bound the ray already

struct Triangle {
    vec4 plane;  // height of a point p above it: dot(xyz, p) + w
    vec4 colour; // not premultiplied; opacity, negative where the headlight shades the triangle
};

layout(set = 0, binding = BINDING_CURSORS, std430) readonly buffer Cursors { uint cursors[]; };
layout(set = 0, binding = BINDING_LISTS, std430) buffer Lists { uvec2 lists[]; };
layout(set = 0, binding = BINDING_STATUS, std430) buffer Status { uint status[]; };
layout(set = 0, binding = BINDING_TRIANGLES, std430) readonly buffer Triangles { Triangle triangles[]; };
layout(set = 0, binding = BINDING_LINE_BOUNDS, std430) buffer LineBounds { vec2 line_bounds[]; };
layout(set = 0, binding = BINDING_LAYERS, std430) writeonly buffer Layers { vec4 layers[]; };      // parallel to the lists
layout(set = 0, binding = BINDING_LAYER_ENDS, std430) writeonly buffer LayerEnds { uint layer_ends[]; };
layout(set = 0, binding = BINDING_BACKGROUND, std430) writeonly buffer Background { vec4 background[]; };

// Returns the triangle of a list's entry. The bits are those of the triangle's scalar, 0x40000000 | triangle << 2
// (src/resident/surfaces.rs), of which mesh-lists.glsl overwrites the lowest two.
uint triangle_of(uint bits) {
    return (bits & 0x3fffffffu) >> 2;
}

void main() {
    uint tile = WORKGROUP_NUMBER;
    if (tile >= push.tiles) return;
    uint number = gl_LocalInvocationIndex;
    uvec2 pixel = uvec2(tile % push.across, tile / push.across) * TILE + uvec2(number % TILE, number / TILE);
    if (any(greaterThanEqual(vec2(pixel), 2.0 * push.half_extent))) return;
    uint slot = tile * TILE_PIXELS + number, word = pixel.y * uint(2.0 * push.half_extent.x + 0.5) + pixel.x;
    // After the lists are written, each cursor is where its list ends.
    uint begin = slot == 0u ? 0u : min(cursors[slot - 1u], push.capacity), end = min(cursors[slot], push.capacity);

    vec2 xy = vec2(pixel) + 0.5 - push.half_extent;
    vec3 lateral = xy.x * push.right_kd.xyz - xy.y * push.up_near.xyz;
    vec3 q = push.q0_kq.xyz + push.q0_kq.w * lateral, d = push.forward_ratio.xyz + push.right_kd.w * lateral;
    float near = push.up_near.w, ratio = push.forward_ratio.w, offset = push.offset, slack = push.slack;
    float size = length(d);
    vec2 bounds = BOUNDED ? line_bounds[word] : vec2(-3e38, 3e38);
    float nearest = bounds.y;
    vec4 behind = vec4(0.0);
    uint opaque = 0xffffffffu;

    // Convert depths to the technique's unit and find the nearest opaque triangle; of several there, the first.
    for (uint i = begin; i < end; ++i) {
        uvec2 entry = lists[i];
        uint id = triangle_of(entry.y);
        float listed = fma(uintBitsToFloat(entry.x), ratio, offset);
        vec4 plane = triangles[id].plane;
        float height = dot(plane.xyz, q) + plane.w, rise = dot(plane.xyz, d);
        float z = -height / (rise != 0.0 ? rise : 1.0);
        // Seen edge-on, the plane gives no reliable depth: take the list's.
        if (rise == 0.0 || (abs(rise) < 1e-3 * size && abs(z - listed) > slack)) z = listed;
        lists[i].x = floatBitsToUint(z);
        bool first = z < nearest || (z == nearest && id < opaque);
        if (abs(triangles[id].colour.a) >= 1.0 && z > near && first) {
            nearest = z;
            opaque = id;
        }
    }
    vec3 ray = normalize(d);
    if (opaque != 0xffffffffu) {
        Triangle triangle = triangles[opaque];
        float shade = triangle.colour.a < 0.0 ? abs(dot(triangle.plane.xyz, ray)) : 1.0;
        behind = vec4(triangle.colour.rgb * shade, 1.0);
    }

    // Keep the translucent ones in front of it, sorted by insertion; equal depths by index.
    uint kept = begin, turns = 0u;
    for (uint i = begin; i < end && turns < MOST_TURNS / 2u; ++i) {
        ++turns;
        uvec2 entry = lists[i];
        uint id = triangle_of(entry.y);
        float z = uintBitsToFloat(entry.x);
        bool stays = z > near && z <= nearest && abs(triangles[id].colour.a) < 1.0 && !(z == nearest && id > opaque);
        if (!stays) continue;
        uint at = kept++;
        while (at > begin && turns < MOST_TURNS / 2u) {
            uvec2 before = lists[at - 1u];
            float other = uintBitsToFloat(before.x);
            if (other < z || (other == z && before.y < entry.y)) break;
            lists[at--] = before;
            ++turns;
        }
        lists[at] = entry;
    }
    if (turns >= MOST_TURNS / 2u || kept - begin > MOST_LAYERS) atomicAdd(status[STATUS_CUT], 1u);
    for (uint i = begin; i < kept; ++i) {
        Triangle triangle = triangles[triangle_of(lists[i].y)];
        float shade = triangle.colour.a < 0.0 ? abs(dot(triangle.plane.xyz, ray)) : 1.0, opacity = abs(triangle.colour.a);
        layers[i] = vec4(triangle.colour.rgb * (shade * opacity), opacity);
    }
    layer_ends[slot] = kept;
    line_bounds[word] = vec2(bounds.x, nearest);
    background[word] = behind;
}
#endif

#ifdef BEHIND
layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = BINDING_SOURCE) uniform sampler2D source;
layout(set = 0, binding = BINDING_ACCUMULATION, rgba32f) writeonly uniform image2D accumulation;
layout(set = 0, binding = BINDING_BACKGROUND, std430) readonly buffer Background { vec4 background[]; };

void main() {
    ivec2 pixel = ivec2(INVOCATION.xy), size = imageSize(accumulation);
    if (any(greaterThanEqual(pixel, size))) return;
    vec4 drawn = texelFetch(source, pixel, 0);
    imageStore(accumulation, pixel, drawn + (1.0 - drawn.a) * background[pixel.y * size.x + pixel.x]);
}
#endif
