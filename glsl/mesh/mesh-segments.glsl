// Emission and absorption of what a line passes in cells, for segments.glsl's integrators and the smoke model.
#ifndef MESH_SEGMENTS_GLSL
#define MESH_SEGMENTS_GLSL

#include "interface.glsl"
#include "shared/segments.glsl"
#include "mesh/mesh.glsl"

// A segment that is being integrated. `exact` takes it piece by piece, each between two knots and of little optical depth, and the
// caller's loop takes one piece a turn: an inner loop would make all lanes wait for the one with most pieces.
struct Pending {
    End front, back; // in the direction of ranks
    float len;       // what is left, in the world; 0: nothing
    float least;     // no piece is cut shorter than this for its thickness; knots may cut shorter
    bool waits;      // for `thickest_piece`
    float end;       // depth at which it ends, front to back
};

// Begins a segment.
void begin_segment(inout Pending pending, End front, End back, float len, float end) {
    pending.front = front;
    pending.back = back;
    pending.len = len;
    pending.least = len * (1.0 / 64.0);
    pending.waits = false;
    pending.end = end;
}

// Premultiplied colour and opacity of the next piece of `exact`. One of the least length that is thick still takes many samples. It has to
// wait unless `any_depth`: a loop for it in the caller's loop costs software rasterisers a quarter of the frame, although hardly any
// piece needs it.
vec4 exact_piece(inout Pending pending, bool back_to_front, bool any_depth) {
    End front = pending.front, back = pending.back;
    float len = pending.len;
    bool crosses = front.knot != back.knot, rising = back.knot > front.knot;
    float s = 0.0;
    vec4 after = vec4(0.0);
    knot_at(rising ? front.knot + 1 : front.knot, s, after);
    after = crosses ? after : back.optics;
    float x = crosses ? clamp((s - front.s) / (back.s - front.s), 0.0, 1.0) : 1.0;
    // No thicker than a thin piece, unless of the least length.
    float thin = max(0.5 / (max(max(front.optics.a, after.a), 1e-30) * len), pending.least / len);
    bool thick = thin < x;
    float part = thick ? thin / x : 1.0;
    vec4 optics = thick ? mix(front.optics, after, part) : after;
    x = thick ? thin : x;
    vec4 ahead = back_to_front ? optics : front.optics, behind_it = back_to_front ? front.optics : optics;
    vec4 piece = thin_piece(ahead, behind_it, len * x).emission;
    bool opaque = max(ahead.a, behind_it.a) * (len * x) > 0.51;
    // (A loop: software rasterisers run through branches that no invocation takes.)
    if (any_depth) for (uint once = 0u; once < uint(opaque); ++once) piece = thick_piece(ahead, behind_it, len * x).emission;
    pending.waits = opaque && !any_depth;
    if (pending.waits) {
        piece = vec4(0.0);
    } else {
        pending.front.s = thick ? mix(front.s, back.s, x) : crosses ? s : back.s;
        pending.front.optics = optics;
        pending.front.knot = thick ? front.knot : crosses ? front.knot + (rising ? 1 : -1) : back.knot;
        pending.len = crosses || thick ? len * (1.0 - x) : 0.0;
    }
    return piece;
}

// Premultiplied colour and opacity of the next piece, or of the whole. `pending.waits` tells that the piece is left to `thickest_piece`.
vec4 next_piece(inout Pending pending, bool back_to_front, uint knots) {
    vec4 piece;
    if (INTEGRATOR == INTEGRATOR_EXACT) {
        piece = exact_piece(pending, back_to_front, false);
    } else if (INTEGRATOR == INTEGRATOR_SMOKE) {
        // One mean scalar, whose extinction is proportional to it.
        float mean = 0.5 * (pending.front.s + pending.back.s);
        piece = emission_of(classify(mean, knots).rgb, max(push.smoke * mean, 0.0) * pending.len);
        pending.len = 0.0;
    } else {
        End near = pending.front, far = pending.back;
        if (back_to_front) {
            near = pending.back;
            far = pending.front;
        }
        piece = segment(near, far, pending.len, knots);
        pending.len = 0.0;
    }
    return piece;
}

// Premultiplied colour and opacity of the piece that waits.
vec4 thickest_piece(inout Pending pending, bool back_to_front) {
    return exact_piece(pending, back_to_front, true);
}

// Adds a segment in the direction of ranks.
void composite(inout vec4 sum, vec4 emission, bool back_to_front) {
    sum = back_to_front ? emission + (1.0 - emission.a) * sum : sum + (1.0 - sum.a) * emission;
}

// Takes the next piece, whatever its depth.
void take_piece(inout vec4 sum, inout Pending pending, bool back_to_front, uint knots) {
    composite(sum, next_piece(pending, back_to_front, knots), back_to_front);
    for (uint once = 0u; once < uint(pending.waits); ++once) composite(sum, thickest_piece(pending, back_to_front), back_to_front);
}

// Premultiplied colour and opacity of a whole segment, its front nearer to the eye.
vec4 cell_segment(End front, End back, float len, uint knots) {
    Pending pending;
    begin_segment(pending, front, back, len, 0.0);
    vec4 sum = vec4(0.0);
    // Of a piece between two knots there are at most as many parts as of the least length.
    for (uint turn = 0u; turn < 128u + knots && pending.len > 0.0; ++turn) take_piece(sum, pending, false, knots);
    return sum;
}

#endif
