// Sets of pixels of a tile, as 64 bits.
#ifndef TILE_PIXELS_GLSL
#define TILE_PIXELS_GLSL

#include "interface.glsl"

// The pixels of a tile in a box, a bit each, row by row. `origin` is the tile's first pixel; a box holds its ends in x and in y, 16 bits each.
uvec2 pixels_of_box(uvec2 box, uvec2 origin) {
    uvec2 low = clamp(uvec2(box.x & 0xffffu, box.y & 0xffffu), origin, origin + TILE) - origin;
    uvec2 high = clamp(uvec2(box.x >> 16, box.y >> 16), origin, origin + TILE) - origin;
    uint columns = ((0xffu << low.x) & ~(0xffffu << high.x) & 0xffu) * 0x01010101u;
    // A bit a row, spread to a byte a row.
    uint row_bits = (0xffu << low.y) & ~(0xffffu << high.y) & 0xffu;
    uvec2 rows = (uvec2(row_bits & 15u, row_bits >> 4) * 0x204081u & 0x1010101u) * 0xffu;
    return rows & columns;
}

#endif
