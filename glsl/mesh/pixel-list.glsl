// The pixel of an invocation and its list (mesh-lists.glsl), for techniques that resolve lists: one invocation a pixel, one workgroup a tile
// of the band.
#ifndef PIXEL_LIST_GLSL
#define PIXEL_LIST_GLSL

#include "interface.glsl"
#include "shared/device.glsl"
#include "mesh/mesh.glsl"

layout(set = 0, binding = BINDING_CURSORS, std430) readonly buffer Cursors { uint cursors[]; };

struct PixelList {
    bool exists;     // tiles reach beyond the image, and workgroups beyond the band
    uvec2 pixel;
    uint word;       // of the pixel's flags
    uint begin, end; // entries of the list
    uint from, to;   // entries that this dispatch takes
    float world;     // length of a unit of depth along the line
};

PixelList list_of_invocation() {
    PixelList list;
    uint in_band = WORKGROUP_NUMBER, tile = push.band + in_band;
    list.pixel = pixel_of(tile, gl_LocalInvocationIndex);
    list.exists = in_band < push.count && all(lessThan(vec2(list.pixel), 2.0 * push.half_extent));
    if (!list.exists) return list;
    list.word = tile * TILE_PIXELS + gl_LocalInvocationIndex;
    // After the lists are written, each cursor is where its list ends.
    uint slot = in_band * TILE_PIXELS + gl_LocalInvocationIndex;
    list.begin = slot == 0u ? 0u : min(cursors[slot - 1u], push.capacity);
    list.end = min(cursors[slot], push.capacity);
    list.from = min(list.begin + push.first, list.end);
    list.to = min(list.end, list.begin + push.first + push.number);
    list.world = length_of_depth(line_at(vec2(list.pixel) + 0.5));
    return list;
}

// Opacity at which a line ends; from behind it does not end.
float end_of_line(bool back_to_front) {
    return back_to_front ? 2.0 : 1.0 - push.opaque;
}

#endif
