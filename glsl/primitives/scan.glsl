// entry compute LANES_REDUCE
// entry compute LANES_SCAN
// entry compute GROUPS_REDUCE
// entry compute GROUPS_SCAN
//
// Exclusive prefix sums of words, in place: reduce, then scan. The words are divided into at most SCAN_CHUNKS chunks of equal length.
// The first dispatch sums each chunk in 64 bits. In the second, each chunk adds up the sums of the chunks before it and scans its
// words from there. No workgroup waits for another.
//
//   LANES   one invocation per chunk, no barrier: for devices that emulate workgroups
//   GROUPS  one workgroup per chunk, tile by tile
//
//   in    push.count words
//   out   words; total: the sum modulo 2^32, and its upper 32 bits (not 0 where the prefix sums have wrapped)
//   cost  each word is read twice and written once
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"

layout(push_constant, std430) uniform ScanPush {
    uint count;
    uint chunk; // words per chunk
    uint chunks;
} push;

#if defined(LANES_SCAN) || defined(GROUPS_SCAN)
#define OF_REDUCE
#define OF_SCAN readonly
#else
#define OF_REDUCE readonly
#define OF_SCAN
#endif

layout(set = 0, binding = BINDING_SCAN_WORDS, std430) OF_REDUCE buffer Words {
    uint word[];
} words;

layout(set = 0, binding = BINDING_SCAN_SUMS, std430) OF_SCAN buffer Sums {
    uint word[]; // lower and upper half of each chunk's sum
} sums;

// Adds 64-bit numbers in two words.
void add(inout uvec2 sum, uvec2 more) {
    uint carry;
    sum.x = uaddCarry(sum.x, more.x, carry);
    sum.y += more.y + carry;
}

uvec2 sum_of(uint chunk) {
    return uvec2(sums.word[2u * chunk], sums.word[2u * chunk + 1u]);
}

#if defined(LANES_SCAN) || defined(GROUPS_SCAN)
layout(set = 0, binding = BINDING_SCAN_TOTAL, std430) buffer Total {
    uint word[];
} total;

void write_total(uvec2 before, uint chunk) {
    if (chunk != push.chunks - 1u) return;
    add(before, sum_of(chunk));
    total.word[0] = before.x;
    total.word[1] = before.y;
}
#endif

#if defined(LANES_REDUCE) || defined(LANES_SCAN)

layout(local_size_x = LANE_GROUP) in;

void main() {
    uint chunk = INVOCATION.x;
    if (chunk >= push.chunks) return;
    uint begin = min(chunk * push.chunk, push.count);
    uint end = min(begin + push.chunk, push.count);
#ifdef LANES_REDUCE
    uvec2 sum = uvec2(0u);
    for (uint turn = 0u; turn < SCAN_LANE_WORDS; turn++) {
        uint i = begin + turn;
        if (i >= end) break;
        add(sum, uvec2(words.word[i], 0u));
    }
    sums.word[2u * chunk] = sum.x;
    sums.word[2u * chunk + 1u] = sum.y;
#else
    uvec2 before = uvec2(0u);
    for (uint other = 0u; other < SCAN_CHUNKS; other++) {
        if (other >= chunk) break;
        add(before, sum_of(other));
    }
    uint prefix = before.x;
    for (uint turn = 0u; turn < SCAN_LANE_WORDS; turn++) {
        uint i = begin + turn;
        if (i >= end) break;
        uint value = words.word[i];
        words.word[i] = prefix;
        prefix += value;
    }
    write_total(before, chunk);
#endif
}

#else

#include "shared/group-scan.glsl"

layout(local_size_x = WIDE_GROUP) in;

shared uvec2 parts[WIDE_GROUP];

// Returns the sum over the workgroup to all of its invocations.
uvec2 group_sum(uvec2 value) {
    uint self = gl_LocalInvocationID.x;
    parts[self] = value;
    for (uint half_way = WIDE_GROUP / 2u; half_way > 0u; half_way /= 2u) {
        barrier();
        if (self < half_way) add(parts[self], parts[self + half_way]);
    }
    barrier();
    return parts[0];
}

void main() {
    uint self = gl_LocalInvocationID.x;
    uint chunk = WORKGROUP.x;
    uint begin = min(chunk * push.chunk, push.count);
    uint end = min(begin + push.chunk, push.count);
    uvec2 sum = uvec2(0u);
#ifdef GROUPS_REDUCE
    for (uint turn = 0u; turn < SCAN_GROUP_TURNS * SCAN_ITEMS; turn++) {
        uint i = begin + turn * WIDE_GROUP + self;
        if (i >= end) break;
        add(sum, uvec2(words.word[i], 0u));
    }
    sum = group_sum(sum);
    if (self == 0u) {
        sums.word[2u * chunk] = sum.x;
        sums.word[2u * chunk + 1u] = sum.y;
    }
#else
    for (uint turn = 0u; turn < SCAN_CHUNKS / WIDE_GROUP; turn++) {
        uint other = turn * WIDE_GROUP + self;
        if (other >= chunk) break;
        add(sum, sum_of(other));
    }
    uvec2 before = group_sum(sum);
    uint prefix = before.x;
    // Scan tile after tile, a few consecutive words per invocation. The loop's bounds are uniform over the workgroup.
    for (uint turn = 0u; turn < SCAN_GROUP_TURNS; turn++) {
        uint first = begin + turn * (WIDE_GROUP * SCAN_ITEMS);
        if (first >= end) break;
        uint own = first + self * SCAN_ITEMS;
        uint value[SCAN_ITEMS];
        uint of_own = 0u;
        for (uint item = 0u; item < SCAN_ITEMS; item++) {
            value[item] = own + item < end ? words.word[own + item] : 0u;
            of_own += value[item];
        }
        uint of_tile;
        uint at = prefix + group_exclusive(of_own, of_tile);
        for (uint item = 0u; item < SCAN_ITEMS; item++) {
            if (own + item < end) words.word[own + item] = at;
            at += value[item];
        }
        prefix += of_tile;
        barrier();
    }
    if (self == 0u) write_total(before, chunk);
#endif
}

#endif
