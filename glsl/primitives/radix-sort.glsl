// entry compute LANES_COUNT
// entry compute LANES_COUNT_MIXED
// entry compute LANES_SCATTER
// entry compute LANES_SCATTER_FIRST
// entry compute LANES_SCATTER_MIXED
// entry compute LANES_SCATTER_LAST
// entry compute GROUPS_COUNT
// entry compute GROUPS_SCATTER
// entry compute FLOAT_KEYS
//
// One pass of a stable radix sort of pairs, least significant digit first: count, scan, scatter. The pairs are divided into runs. The
// first dispatch counts the digits of each run, digit-major. The prefix sums of the counts (scan.glsl) are the positions of each
// run's first pair of each digit. The second dispatch moves the pairs there in their order. No workgroup waits for another.
//
//   LANES   one invocation per run, no barrier: for devices that emulate workgroups. Counters are private to the invocation, a load
//           reads four keys or values. Between the first pass and the last, pairs are interleaved (MIXED: key, value, key, value,
//           ...), so that a pair takes one store. The stores limit the speed: there are as many streams as digits times invocations
//           in flight
//   GROUPS  one workgroup per run of SORT_TILE pairs, sorted in shared memory so that neighbouring invocations store neighbouring
//           pairs
//
//   in    keys and values; their number, of which at most push.capacity are sorted
//   out   the same pairs, ordered by one digit of the key
//   cost  a key is read twice, a value once, a pair is written once
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"
#include "shared/keys.glsl"

#if defined(LANES_COUNT_MIXED) || defined(LANES_SCATTER_MIXED) || defined(LANES_SCATTER_LAST)
#define FROM_MIXED
#endif
#if defined(LANES_SCATTER_FIRST) || defined(LANES_SCATTER_MIXED)
#define TO_MIXED
#endif
#if defined(LANES_COUNT) || defined(LANES_COUNT_MIXED) || defined(GROUPS_COUNT)
#define COUNTS
#endif

layout(push_constant, std430) uniform SortPush {
    uint capacity;
    uint runs;
    uint shift; // lowest bit of the digit
    uint mask;  // greatest value of the digit
} push;

layout(set = 0, binding = BINDING_SORT_COUNT, std430) readonly buffer Count {
    uint word[];
} count;

uint digit_of(uint key) {
    return key >> push.shift & push.mask;
}

#ifdef FLOAT_KEYS
layout(set = 0, binding = BINDING_SORTED_KEYS, std430) buffer Keys {
    uint key[];
} keys;

layout(local_size_x = LANE_GROUP) in;

void main() {
    uint i = INVOCATION_NUMBER;
    if (i < min(count.word[0], push.capacity)) keys.key[i] = float_key(uintBitsToFloat(keys.key[i]));
}
#else

layout(set = 0, binding = BINDING_SORT_DIGITS, std430) buffer Digits {
    uint word[]; // counts, then positions: run by run for digit 0, then for digit 1, ...
} digits;

#ifdef FROM_MIXED
layout(set = 0, binding = BINDING_SORT_KEYS, std430) readonly buffer PairsIn {
    uvec4 two[];
} from;
#else
layout(set = 0, binding = BINDING_SORT_KEYS, std430) readonly buffer KeysIn {
    uint key[];
} from_keys;

layout(set = 0, binding = BINDING_SORT_KEYS, std430) readonly buffer KeysInFours {
    uvec4 four[];
} from_keys_in_fours;

#ifndef COUNTS
layout(set = 0, binding = BINDING_SORT_VALUES, std430) readonly buffer ValuesIn {
    uint value[];
} from_values;

layout(set = 0, binding = BINDING_SORT_VALUES, std430) readonly buffer ValuesInFours {
    uvec4 four[];
} from_values_in_fours;
#endif
#endif

#ifndef COUNTS
#ifdef TO_MIXED
layout(set = 0, binding = BINDING_SORTED_KEYS, std430) writeonly buffer PairsOut {
    uvec2 pair[];
} to;
#else
layout(set = 0, binding = BINDING_SORTED_KEYS, std430) writeonly buffer KeysOut {
    uint key[];
} to_keys;

layout(set = 0, binding = BINDING_SORTED_VALUES, std430) writeonly buffer ValuesOut {
    uint value[];
} to_values;
#endif
#endif

#if !defined(GROUPS_COUNT) && !defined(GROUPS_SCATTER)

layout(local_size_x = LANE_GROUP) in;

// Counts or positions of this run, by digit.
uint places[SORT_LANE_DIGITS];

#ifdef COUNTS
void take(uint key) {
    places[digit_of(key)]++;
}
#else
void take(uint key, uint value) {
    uint digit = digit_of(key);
    uint place = places[digit];
    places[digit] = place + 1u;
#ifdef TO_MIXED
    to.pair[place] = uvec2(key, value);
#else
    to_keys.key[place] = key;
    to_values.value[place] = value;
#endif
}
#endif

void take_four(uint i) {
#ifdef FROM_MIXED
    uvec4 a = from.two[i / 2u];
    uvec4 b = from.two[i / 2u + 1u];
    uvec4 keys = uvec4(a.xz, b.xz);
    uvec4 values = uvec4(a.yw, b.yw);
#else
    uvec4 keys = from_keys_in_fours.four[i / 4u];
#endif
#ifdef COUNTS
    take(keys.x);
    take(keys.y);
    take(keys.z);
    take(keys.w);
#else
#ifndef FROM_MIXED
    uvec4 values = from_values_in_fours.four[i / 4u];
#endif
    take(keys.x, values.x);
    take(keys.y, values.y);
    take(keys.z, values.z);
    take(keys.w, values.w);
#endif
}

void take_one(uint i) {
#ifdef FROM_MIXED
    uvec4 two = from.two[i / 2u];
    uvec2 pair = (i & 1u) == 0u ? two.xy : two.zw;
    uint key = pair.x;
    uint value = pair.y;
#else
    uint key = from_keys.key[i];
#endif
#ifdef COUNTS
    take(key);
#else
#ifndef FROM_MIXED
    uint value = from_values.value[i];
#endif
    take(key, value);
#endif
}

void main() {
    uint run = INVOCATION.x;
    uint pairs = min(count.word[0], push.capacity);
    // Runs begin at multiples of four.
    uint length = 4u * ((pairs + 4u * push.runs - 1u) / (4u * push.runs));
    uint begin = min(run * length, pairs);
    uint end = min(begin + length, pairs);
    for (uint digit = 0u; digit < SORT_LANE_DIGITS; digit++) {
        if (digit > push.mask) break;
#ifdef COUNTS
        places[digit] = 0u;
#else
        places[digit] = digits.word[digit * push.runs + run];
#endif
    }
    for (uint turn = 0u; turn < SORT_LANE_FOURS; turn++) {
        uint i = begin + 4u * turn;
        if (i + 4u > end) break;
        take_four(i);
    }
    for (uint turn = 0u; turn < 3u; turn++) {
        uint i = (end & ~3u) + turn;
        if (i >= end || i < begin) break;
        take_one(i);
    }
#ifdef COUNTS
    for (uint digit = 0u; digit < SORT_LANE_DIGITS; digit++) {
        if (digit > push.mask) break;
        digits.word[digit * push.runs + run] = places[digit];
    }
#endif
}

#else

layout(local_size_x = WIDE_GROUP) in;

#ifdef GROUPS_COUNT
shared uint counts[WIDE_GROUP];

void main() {
    uint self = gl_LocalInvocationID.x;
    uint pairs = min(count.word[0], push.capacity);
    uint first = WORKGROUP.x * SORT_TILE;
    counts[self] = 0u;
    barrier();
    for (uint item = 0u; item < SORT_TILE / WIDE_GROUP; item++) {
        uint i = first + item * WIDE_GROUP + self;
        if (i < pairs) atomicAdd(counts[digit_of(from_keys.key[i])], 1u);
    }
    barrier();
    if (self <= push.mask) digits.word[self * push.runs + WORKGROUP.x] = counts[self];
}
#else

#include "shared/group-scan.glsl"

#define ITEMS (SORT_TILE / WIDE_GROUP)

// Counters of 4-bit digits, or a tile of words in transit. One word in 32 is unused, against bank conflicts.
shared uint tile[SORT_TILE + SORT_TILE / 32];
// Where each digit begins in the sorted tile.
shared uint starts[WIDE_GROUP];

uint padded(uint i) {
    return i + i / 32u;
}

// Ranks this invocation's keys in the tile by a digit of four bits, stably. Each invocation counts in eight words of its own, two
// digits per word: digits 0 to 7 in the lower halves, 8 to 15 in the upper ones.
void rank(uint nibble[ITEMS], out uint ranks[ITEMS]) {
    uint self = gl_LocalInvocationID.x;
    for (uint i = 0u; i < 8u; i++) tile[padded(i * WIDE_GROUP + self)] = 0u;
    for (uint item = 0u; item < ITEMS; item++) {
        uint at = padded((nibble[item] & 7u) * WIDE_GROUP + self);
        uint half_word = nibble[item] >> 3 << 4;
        ranks[item] = bitfieldExtract(tile[at], int(half_word), 16);
        tile[at] += 1u << half_word;
    }
    barrier();
    // Prefix sums over all counters, eight consecutive ones per invocation. No half exceeds SORT_TILE.
    uint own = 0u;
    for (uint i = 0u; i < 8u; i++) own += tile[padded(self * 8u + i)];
    uint total;
    uint before = group_exclusive(own, total);
    // The digits of the upper halves follow all those of the lower ones.
    before += total << 16;
    for (uint i = 0u; i < 8u; i++) {
        uint at = padded(self * 8u + i);
        uint value = tile[at];
        tile[at] = before;
        before += value;
    }
    barrier();
    for (uint item = 0u; item < ITEMS; item++) {
        uint at = padded((nibble[item] & 7u) * WIDE_GROUP + self);
        ranks[item] += bitfieldExtract(tile[at], int(nibble[item] >> 3 << 4), 16);
    }
    barrier();
}

void main() {
    uint self = gl_LocalInvocationID.x;
    uint pairs = min(count.word[0], push.capacity);
    uint first = WORKGROUP.x * SORT_TILE;
    // Uniform over the workgroup.
    if (first >= pairs) return;
    uint valid = min(SORT_TILE, pairs - first);

    // Each invocation loads consecutive pairs. Keys beyond the last pair have the highest digits, so that they remain last.
    uint keys[ITEMS];
    uint values[ITEMS];
    for (uint item = 0u; item < ITEMS; item++) {
        uint i = self * ITEMS + item;
        keys[item] = i < valid ? from_keys.key[first + i] : 0xffffffffu;
        values[item] = i < valid ? from_values.value[first + i] : 0u;
    }
    uint nibble[ITEMS];
    uint ranks[ITEMS];
    // Sort the tile by the lower half of the digit, then by the upper one.
    for (uint item = 0u; item < ITEMS; item++) nibble[item] = digit_of(keys[item]) & 15u;
    rank(nibble, ranks);
    if (push.mask > 15u) {
        for (uint item = 0u; item < ITEMS; item++) tile[padded(ranks[item])] = keys[item];
        barrier();
        for (uint item = 0u; item < ITEMS; item++) keys[item] = tile[padded(self * ITEMS + item)];
        barrier();
        for (uint item = 0u; item < ITEMS; item++) tile[padded(ranks[item])] = values[item];
        barrier();
        for (uint item = 0u; item < ITEMS; item++) values[item] = tile[padded(self * ITEMS + item)];
        barrier();
        for (uint item = 0u; item < ITEMS; item++) nibble[item] = digit_of(keys[item]) >> 4;
        rank(nibble, ranks);
    }

    // Store in sorted order: neighbouring invocations store neighbouring pairs.
    for (uint item = 0u; item < ITEMS; item++) tile[padded(ranks[item])] = keys[item];
    barrier();
    for (uint item = 0u; item < ITEMS; item++) {
        uint i = item * WIDE_GROUP + self;
        keys[item] = tile[padded(i)];
        uint digit = digit_of(keys[item]);
        if (i == 0u || digit_of(tile[padded(i - 1u)]) != digit) starts[digit] = i;
    }
    barrier();
    uint places[ITEMS];
    for (uint item = 0u; item < ITEMS; item++) {
        uint i = item * WIDE_GROUP + self;
        uint digit = digit_of(keys[item]);
        places[item] = digits.word[digit * push.runs + WORKGROUP.x] + i - starts[digit];
        if (i < valid) to_keys.key[places[item]] = keys[item];
        tile[padded(ranks[item])] = values[item];
    }
    barrier();
    for (uint item = 0u; item < ITEMS; item++) {
        uint i = item * WIDE_GROUP + self;
        if (i < valid) to_values.value[places[item]] = tile[padded(i)];
    }
}
#endif
#endif
#endif
