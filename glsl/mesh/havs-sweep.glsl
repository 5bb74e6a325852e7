// What becomes of the pairs that leave a k-buffer: between two lies a piece of a cell, which is integrated. For havs.glsl and
// havs-raster.glsl.
#ifndef HAVS_SWEEP_GLSL
#define HAVS_SWEEP_GLSL

#include "interface.glsl"
#include "mesh/cell-scalars.glsl"
#include "mesh/kbuffer.glsl"
#include "mesh/mesh-bounds.glsl"
#include "mesh/mesh-segments.glsl"
#include "mesh/pixel-state.glsl"

layout(constant_id = SPEC_BACK_TO_FRONT) const bool BACK_TO_FRONT = false;
layout(constant_id = SPEC_EYE_INSIDE) const bool EYE_INSIDE = true;

// What left last, and what it left behind.
struct Sweep {
    vec4 sum;
    Pair last;
    End end;
    PixelState state;
};

Sweep empty_sweep() {
    return Sweep(vec4(0.0), Pair(NOTHING, 0u), no_end(), PixelState(false, false, false, 0, 0u));
}

// Faces that coincide may be this far apart by rounding, in radii of the mesh; inner faces where scalars belong to cells, by ROUNDING.
const float TOUCHING = 1e-5;

// The lowest two bits tell on which sides of the face there is a cell: bit 0 before it along the line, bit 1 behind it.
float scalar_of_pair(Pair pair) {
    return uintBitsToFloat(pair.what & 0xfffffffcu);
}

// Depths between which a pixel's line is drawn: from the eye on, and where anything else bounds it.
vec2 drawn_depths(uvec2 pixel) {
    vec2 bounds = bounds_at(pixel);
    return vec2(max(bounds.x, push.forward.w), bounds.y);
}

// Takes a pair from the window; begins the segment between it and the pair before. Returns its depths; equal: there is none.
vec2 leave(inout Sweep sweep, inout Pending pending, Pair pair, vec2 drawn, float world) {
    if (pair.at == NOTHING) return vec2(0.0);
    sweep.state.unsorted = sweep.state.unsorted || pair.at < sweep.last.at;
    End end = end_at(scalar_of_pair(pair));
    End first = sweep.end, second = end;
    if (CELL_SCALARS) second = first;
    float from = sweep.last.at, to = pair.at;
    if (BOUNDED) {
        from = max(from, BACK_TO_FRONT ? -drawn.y : drawn.x);
        to = min(to, BACK_TO_FRONT ? -drawn.x : drawn.y);
        if (!CELL_SCALARS) {
            float inverse = 1.0 / (pair.at - sweep.last.at), s = first.s, rise = second.s - first.s;
            if (from > sweep.last.at) first = end_at(s + rise * clamp((from - sweep.last.at) * inverse, 0.0, 1.0));
            if (to < pair.at) second = end_at(s + rise * clamp((to - sweep.last.at) * inverse, 0.0, 1.0));
        }
    } else if (EYE_INSIDE) {
        // Lines begin at the eye.
        if (BACK_TO_FRONT) to = min(to, -drawn.x); else from = max(from, drawn.x);
        if (!CELL_SCALARS) {
            bool cut = BACK_TO_FRONT ? to < pair.at : from > sweep.last.at;
            float x = ((BACK_TO_FRONT ? to : from) - sweep.last.at) / (pair.at - sweep.last.at);
            End between = end_at(cut ? first.s + (second.s - first.s) * clamp(x, 0.0, 1.0) : (BACK_TO_FRONT ? second.s : first.s));
            if (BACK_TO_FRONT) second = between; else first = between;
        }
    }
    float len = (to - from) * world;
    // Where two faces come in either order, the one that leaves last says what is behind: right if both say the same.
    bool inner = (pair.what & sweep.last.what & 3u) == 3u;
    float apart = pair.at - sweep.last.at;
    bool same = abs(end.s - sweep.end.s) <= push.alike;
    sweep.state.overlaps = sweep.state.overlaps || (!same && apart <= (inner ? (CELL_SCALARS ? ROUNDING : -1.0) : TOUCHING));
    sweep.state.overlaps = sweep.state.overlaps || ((sweep.state.inside > 1 || sweep.state.inside < 0) && to - from > TOUCHING);
    bool begins = sweep.state.inside > 0 && len > 0.0;
    if (begins) begin_segment(pending, first, second, len, to);
    int step = int(pair.what >> 1 & 1u) - int(pair.what & 1u);
    sweep.state.inside += BACK_TO_FRONT ? -step : step;
    sweep.last = pair;
    sweep.end = end;
    return begins ? vec2(from, to) : vec2(0.0);
}

// Whether cells overlap along the line, which ends when it is opaque. A sweep that was not in order tells nothing of that.
bool overlaps(Sweep sweep, float opaque) {
    bool open = sweep.state.inside != 0 && sweep.sum.a < opaque;
    return (sweep.state.overlaps || open) && !sweep.state.unsorted;
}

#endif
