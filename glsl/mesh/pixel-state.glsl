// The state of a pixel's sweep between two dispatches or two fragments, as one word. When the frame is drawn, its lowest bits are left:
// FLAG_UNSORTED, FLAG_REPAIRED and FLAG_OVERLAPS.
#ifndef PIXEL_STATE_GLSL
#define PIXEL_STATE_GLSL

#include "interface.glsl"

struct PixelState {
    bool unsorted; // pairs have left the k-buffer out of order
    bool overlaps; // cells overlap: faces do not tell which cell the line is in
    bool begun;    // the images hold this frame's k-buffer
    int inside;    // entries of the line into the mesh less its exits
    uint passed;   // translucent surfaces that are composited, at most MOST_LAYERS
};

uint pack_state(PixelState state) {
    uint bits = (state.unsorted ? FLAG_UNSORTED : 0u) | (state.overlaps ? FLAG_OVERLAPS : 0u) | (state.begun ? STATE_BEGUN : 0u);
    uint inside = uint(state.inside) & ((1u << STATE_INSIDE_BITS) - 1u);
    return bits | inside << STATE_INSIDE_SHIFT | state.passed << STATE_PASSED_SHIFT;
}

PixelState unpack_state(uint word) {
    return PixelState((word & FLAG_UNSORTED) != 0u, (word & FLAG_OVERLAPS) != 0u, (word & STATE_BEGUN) != 0u,
                      bitfieldExtract(int(word), STATE_INSIDE_SHIFT, STATE_INSIDE_BITS), word >> STATE_PASSED_SHIFT);
}

#endif
