// The pixel of an invocation: one workgroup a tile of the band, one invocation a pixel.
#ifndef OWN_PIXEL_GLSL
#define OWN_PIXEL_GLSL

#include "interface.glsl"
#include "shared/device.glsl"
#include "mesh/mesh.glsl"

struct OwnPixel {
    bool exists;  // tiles reach beyond the image, and workgroups beyond the band
    uvec2 pixel;
    uint in_band; // its tile there
    uint tile;
    uint word;    // of the pixel's flags
    float world;  // length of a unit of depth along the line
};

OwnPixel own_pixel() {
    OwnPixel own;
    own.in_band = WORKGROUP_NUMBER;
    own.tile = push.band + own.in_band;
    own.pixel = pixel_of(own.tile, gl_LocalInvocationIndex);
    own.exists = own.in_band < push.count && all(lessThan(vec2(own.pixel), 2.0 * push.half_extent));
    own.word = own.tile * TILE_PIXELS + gl_LocalInvocationIndex;
    own.world = length_of_depth(line_at(vec2(own.pixel) + 0.5));
    return own;
}

// Place of the end of the pixel's list, among those of the tiles from `first` on.
uint cursor_of(OwnPixel own) {
    return own.word - push.first * TILE_PIXELS;
}

// Opacity at which a line ends; from behind it does not end.
float end_of_line(bool back_to_front) {
    return back_to_front ? 2.0 : 1.0 - push.opaque;
}

#endif
