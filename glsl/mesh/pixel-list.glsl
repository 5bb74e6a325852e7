// The list of an invocation's pixel (mesh-lists.glsl), for passes that draw flagged pixels again.
#ifndef PIXEL_LIST_GLSL
#define PIXEL_LIST_GLSL

#include "interface.glsl"
#include "mesh/mesh.glsl"
#include "mesh/own-pixel.glsl"

layout(set = 0, binding = BINDING_CURSORS, std430) readonly buffer Cursors { uint cursors[]; };

struct PixelList {
    uint begin, end; // its entries
};

PixelList list_of(OwnPixel own) {
    // After the lists are written, each cursor is where its list ends.
    uint slot = cursor_of(own);
    PixelList list;
    list.begin = slot == 0u ? 0u : min(cursors[slot - 1u], push.capacity);
    list.end = min(cursors[slot], push.capacity);
    return list;
}

#endif
