// The k-buffer: a window of K pairs that sorts a nearly sorted stream. Each arrival takes its place; the least of the K + 1 leaves.
// What leaves is sorted if and only if no arrival comes after more than K that lie beyond it; else, and only then, something leaves
// that is less than what left before it.
//
// Source: Callahan, Ikits, Comba and Silva, TVCG 11(3), 2005. There the order is tested against the
// pair that leaves next, here against the pair that left last.
#ifndef KBUFFER_GLSL
#define KBUFFER_GLSL

#include "interface.glsl"

layout(constant_id = SPEC_K) const uint K = 7;

const float NOTHING = -3.402823e38;
const float EVERYTHING = 3.402823e38;

// A distance along the line, in the direction of ranks, and what is known there.
struct Pair {
    float at;
    uint what;
};

Pair window[K]; // ascending

void clear_window() {
    for (uint j = 0u; j < K; ++j) window[j] = Pair(NOTHING, 0u);
}

// Puts a pair into the window; returns what leaves.
Pair pass_through(Pair pair) {
    for (uint j = 0u; j < K; ++j) {
        bool before = pair.at < window[j].at;
        Pair kept = window[j];
        window[j] = Pair(before ? pair.at : kept.at, before ? pair.what : kept.what);
        pair = Pair(before ? kept.at : pair.at, before ? kept.what : pair.what);
    }
    Pair leaves = window[0];
    for (uint j = 1u; j < K; ++j) window[j - 1u] = window[j];
    window[K - 1u] = pair;
    return leaves;
}

#endif
