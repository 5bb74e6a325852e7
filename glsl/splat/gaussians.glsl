// entry compute DRAW
// entry compute DRAW_WIDE
// entry compute REPAIR
//
// Trained splats blended front to back.
//
//   DRAW       one invocation owns a column of a tile and blends the splats of its bin in registers
//   DRAW_WIDE  one invocation a pixel, for devices whose workgroups should be wide
//   REPAIR     one invocation for each listed pixel, in whose line the order of the bin is too far from its own
//
// BY_PIXEL, for rules of rays: splats are blended in the order of the places where the pixel's line is nearest to them (by-pixel.glsl).
//
//   in    bins of splats in the order of blending, records of the view (gaussians-project.glsl)
//   out   accumulation image: premultiplied RGBA, as trained: display-referred colours
//   error that of float32; where the rules of the first program have thresholds, a splat on one may count or not
//   cost  per splat and pixel a quadratic form and one exponential, by RULE_RAY another form and a division
//
// Source: Kerbl et al. 2023, with its thresholds; KHR_gaussian_splatting, which has none.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"
#ifdef DRAW
#include "splat/column-lanes.glsl"
#else
#include "splat/pixel-lanes.glsl"
#endif
#include "splat/band.glsl"
#include "splat/by-pixel.glsl"
#include "splat/records.glsl"

layout(constant_id = SPEC_SPLAT_RULE) const uint RULE = RULE_KHR;
layout(constant_id = SPEC_SPLAT_BY_PIXEL) const bool BY_PIXEL = false;

layout(local_size_x = 64 / ROWS) in;
layout(set = 0, binding = BINDING_SPLAT_RECORDS, std430) readonly buffer TrainedRecords { vec4 records[]; };

const bool RAYS = RULE >= RULE_RAY;
const float CUT_BITS = 6.4921277; // half of the squared distance at which splats end, to base 2
// Of the first program: the greatest opacity, and the transmittance that a splat must leave.
const bool THRESHOLDS = RULE == RULE_INRIA || RULE == RULE_ANTIALIASED;
const float MOST_OPACITY = 0.99, LEAST_LEFT = 1e-4;

// 1 in perspective, 0 where lines are parallel.
#define PERSPECTIVE push.unit

// A splat as a pixel meets it.
struct Met {
    float bits;  // half the squared distance, to base 2
    float depth; // of the nearest point of the pixel's line, from the plane through the middle of all splats
    bool there;  // whether it is drawn
};

// A splat's record.
struct Record {
    vec4 form;    // place, L
    vec4 limits;  // L, logarithm of the opacity, end or key, depth at r
    vec3 colour;
    vec3 bend;    // C
    vec4 turn;    // b, e
};

// Meets a splat with the line of a pixel, which is drawn between two depths.
Met meet(vec2 pixel, Record record, vec2 reference, vec2 drawn) {
    vec2 d = pixel - record.form.xy, own = vec2(fma(record.form.z, d.x, record.form.w * d.y), record.limits.x * d.y);
    Met met = Met(dot(own, own), record.limits.w, true);
    if (RAYS) {
        vec2 f = pixel - reference;
        float change = PERSPECTIVE * (2.0 * dot(record.turn.xy, f) + f.x * fma(record.bend.x, f.x, 2.0 * record.bend.y * f.y) + record.bend.z * f.y * f.y);
        float inverse = 1.0 / max(1.0 + change, 1e-30);
        met.bits *= inverse;
        met.depth += (dot(record.turn.zw, f) - (record.limits.w + push.h) * change) * inverse;
        met.there = met.depth > drawn.x && met.depth < drawn.y;
    }
    met.there = met.there && met.bits <= (RAYS ? CUT_BITS : record.limits.z);
    return met;
}

// Returns the least depth at which the line may meet what follows a splat in its bin: bins ascend by the key of each, from which no line meets it
// farther before than by most reaches.
float followed_from(float key) {
    return key - push.forward_reach.w;
}

#ifndef REPAIR
void main() {
    uint lane = LANE;
    uint in_band = WORKGROUP_NUMBER;
    if (in_band >= push.tiles) return;
    uvec2 bin = bin_of(in_band);
    uint place = in_band * TILE_PIXELS + lane;
    uint i = RESUME ? splat_state[place].x : bin.x;
    uint end = bin.y, stop = min(end, i + MOST);
    if (RESUME && i >= end) return;
    uvec2 origin = first_pixel(in_band, lane);
    vec2 from = vec2(origin) + 0.5 - push.half_extent;
    vec2 drawn[ROWS];
    vec4 sum[ROWS];
    float transmittance[ROWS]; // 0 once a pixel has ended, except BY_PIXEL
    float last[ROWS];          // BY_PIXEL: the farthest piece that is blended; BEHIND_ALL once one came too late
    float opaque = push.opaque;
    // BY_PIXEL: rows that are opaque and lie behind nothing that follows, or are listed; bit by bit.
    uint ended = 0u;
#define BEGIN(r) { \
        drawn[r] = drawn_depths(origin + uvec2(0, r)); \
        load_pixel(origin + uvec2(0, r), sum[r], transmittance[r]); \
        float state = RESUME ? uintBitsToFloat(splat_state[place + r * TILE].y) : -BEHIND_ALL; \
        if (BY_PIXEL) { \
            last[r] = state; \
            EMPTY_WINDOW(r, state) \
            if (!in_image(origin + uvec2(0, r))) ended |= 1u << r; \
        } else if (RESUME) { \
            transmittance[r] = state; \
        } \
    }
    EACH_ROW(BEGIN)
#define BLEND_LAST(r) BLEND_NEAREST(r, Piece(BEHIND_ALL, 0.0, vec3(0.0)), sum[r], transmittance[r], last[r])
    float live = 1.0;
#define IS_LIVE ANY(BY_PIXEL ? ended != (1u << ROWS) - 1u : live > opaque)
    for (; i < stop && IS_LIVE; ++i) {
        uint at = record_of(bins[i], RAYS);
        Record record;
        FETCH_TWO(records, at, record.form, record.limits)
        if (RAYS) {
            vec4 colour, bend;
            FETCH_TWO(records, at + 2u, colour, bend)
            record.turn = FETCH(records, at + 4u);
            record.colour = colour.rgb;
            record.bend = bend.xyz;
        } else {
            vec4 colour = FETCH(records, at + 2u);
            record.colour = colour.rgb;
        }
        vec2 reference = RAYS ? reference_of(record.form.xy, push.half_extent) : vec2(0.0);
        live = 0.0;
#define BLEND(r) { \
            Met met = meet(from + vec2(0.0, float(r)), record, reference, drawn[r]); \
            if (BY_PIXEL) { \
                if (met.there) { \
                    Piece own = Piece(met.depth, exp2(record.limits.y - met.bits), record.colour); \
                    BLEND_NEAREST(r, own, sum[r], transmittance[r], last[r]) \
                    bool over = transmittance[r] <= opaque && followed_from(record.limits.z) > last[r]; \
                    ended |= uint(over || last[r] == BEHIND_ALL) << r; \
                } \
            } else { \
                float opacity = met.there ? exp2(record.limits.y - met.bits) : 0.0; \
                if (THRESHOLDS) opacity = min(opacity, MOST_OPACITY); \
                float share = transmittance[r] * opacity, left = transmittance[r] - share; \
                bool ends = THRESHOLDS && left < LEAST_LEFT && met.there; \
                sum[r] = fma(vec4(ends ? 0.0 : share), vec4(record.colour, 1.0), sum[r]); \
                transmittance[r] = ends ? 0.0 : left; \
            } \
            live = max(live, transmittance[r]); \
        }
        EACH_ROW(BLEND)
    }
    // Opaque pixels have ended; all invocations of a subgroup agree.
    bool unfinished = i < end && IS_LIVE;
    splat_state[place].x = unfinished ? i : end;
    if (unfinished && IS_LAST) atomicAdd(status[STATUS_UNFINISHED], 1u);
    // What waits is blended: what another dispatch puts before it lists the pixel.
#define END(r) { \
        uvec2 pixel = origin + uvec2(0, r); \
        if (BY_PIXEL) { \
            AS_MANY(BLEND_LAST, r) \
            if (!unfinished && last[r] == BEHIND_ALL && in_image(pixel)) pixels[room_for(1u, TILE_PIXELS)] = pixel.x | pixel.y << 16; \
        } \
        splat_state[place + r * TILE].y = floatBitsToUint(BY_PIXEL ? last[r] : transmittance[r]); \
        store_pixel(pixel, sum[r]); \
    }
    EACH_ROW(END)
}
#else
vec2 from, drawn;

void begin_line(uvec2 pixel) {
    from = vec2(pixel) + 0.5 - push.half_extent;
    drawn = drawn_depths(pixel);
}

Record record_on_line(uint id) {
    uint at = record_of(id, RAYS);
    return Record(records[at], records[at + 1u], records[at + 2u].rgb, records[at + 3u].xyz, records[at + 4u]);
}

Met meet_on_line(Record record) {
    return meet(from, record, reference_of(record.form.xy, push.half_extent), drawn);
}

bool meets_line(uint id, out float at) {
    Met met = meet_on_line(record_on_line(id));
    at = met.depth;
    return met.there;
}

void blend_on_line(uint id, inout vec4 sum, inout float transmittance) {
    Record record = record_on_line(id);
    blend_behind(sum, transmittance, record.colour, exp2(record.limits.y - meet_on_line(record).bits));
}

float followed_from(uint id, float at) {
    return followed_from(records[record_of(id, RAYS) + 1u].z);
}

void main() {
    repair(INVOCATION_NUMBER);
}
#endif
