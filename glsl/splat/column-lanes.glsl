// Invocations that own a column of eight pixels: what they read of a splat serves all of them. Code for each row is written out by
// EACH_ROW, so that its values stay in registers. pixel-lanes.glsl is the alternative.
//
// The eight invocations of a workgroup read eight words at once, one each, and broadcast them: a load of one word that all share
// would cost as much. They continue together as long as one of them does (ANY).
#ifndef COLUMN_LANES_GLSL
#define COLUMN_LANES_GLSL

#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_vote : require

#define WAITING 2u // places of a row's window
#define EACH_WAITING(f, r) f(r * 2) f(r * 2 + 1)
#define AS_MANY(f, r) f(r) f(r)
#define ROWS 8
#define EACH_ROW(f) f(0) f(1) f(2) f(3) f(4) f(5) f(6) f(7)
#define LANE gl_SubgroupInvocationID
#define ANY(condition) subgroupAny(condition)

vec4 words_from(float word, uint first) {
    return first == 0u ? vec4(subgroupBroadcast(word, 0), subgroupBroadcast(word, 1), subgroupBroadcast(word, 2), subgroupBroadcast(word, 3))
                       : vec4(subgroupBroadcast(word, 4), subgroupBroadcast(word, 5), subgroupBroadcast(word, 6), subgroupBroadcast(word, 7));
}

#define FETCH(list, at) words_from(list[at][LANE & 3u], 0u)
#define FETCH_TWO(list, at, a, b) { float word = list[(at) + (LANE >> 2 & 1u)][LANE & 3u]; a = words_from(word, 0u); b = words_from(word, 4u); }

#endif
