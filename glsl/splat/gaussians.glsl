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
#include "splat/meet.glsl"

layout(constant_id = SPEC_SPLAT_BY_PIXEL) const bool BY_PIXEL = false;

layout(local_size_x = 64 / ROWS) in;

// Of the first program: the greatest opacity, and the transmittance that a splat must leave.
const bool THRESHOLDS = RULE == RULE_INRIA || RULE == RULE_ANTIALIASED;
const float MOST_OPACITY = 0.99, LEAST_LEFT = 1e-4;

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
    vec2 from = vec2(origin) + 0.5 - half_image();
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
#define BLEND_LAST(r) BLEND_NEAREST(r, origin + uvec2(0, r), drawn[r], Piece(BEHIND_ALL, 0.0, vec3(0.0)), sum[r], transmittance[r], last[r])
    float live = 1.0;
#define IS_LIVE ANY(BY_PIXEL ? ended != (1u << ROWS) - 1u : live > opaque)
    for (; i < stop && IS_LIVE; ++i) {
        uint at = record_of(bins[i], RAYS);
        Record record;
        if (RAYS) {
            FETCH_RAY_RECORD(at, record)
        } else {
            FETCH_TWO(records, at, record.form, record.limits)
            record.colour = FETCH(records, at + 2u);
        }
        vec2 reference = RAYS ? reference_of(record.form.xy, half_image()) : vec2(0.0);
        live = 0.0;
#define BLEND(r) { \
            Met met = meet(from + vec2(0.0, float(r)), record, reference, drawn[r]); \
            if (BY_PIXEL) { \
                if (met.there) { \
                    Piece own = Piece(met.depth, exp2(record.limits.y - met.bits), record.colour.rgb); \
                    BLEND_NEAREST(r, origin + uvec2(0, r), drawn[r], own, sum[r], transmittance[r], last[r]) \
                    bool over = transmittance[r] <= opaque && followed_from(record.limits.z) > last[r]; \
                    ended |= uint(over || last[r] == BEHIND_ALL) << r; \
                } \
            } else { \
                float opacity = met.there ? exp2(record.limits.y - met.bits) : 0.0; \
                if (THRESHOLDS) opacity = min(opacity, MOST_OPACITY); \
                float share = transmittance[r] * opacity, left = transmittance[r] - share; \
                bool ends = THRESHOLDS && left < LEAST_LEFT && met.there; \
                sum[r] = fma(vec4(ends ? 0.0 : share), vec4(record.colour.rgb, 1.0), sum[r]); \
                note_hit(number_of(origin + uvec2(0, r)), transmittance[r], left, met.depth, met.depth); \
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
    from = vec2(pixel) + 0.5 - half_image();
    drawn = drawn_depths(pixel);
}

Met meet_on_line(Record record) {
    return meet(from, record, reference_of(record.form.xy, half_image()), drawn);
}

bool meets_line(uint id, out float at) {
    Met met = meet_on_line(record_at(id));
    at = met.depth;
    return met.there;
}

void blend_on_line(uint id, inout vec4 sum, inout float transmittance) {
    Record record = record_at(id);
    blend_behind(sum, transmittance, record.colour.rgb, exp2(record.limits.y - meet_on_line(record).bits));
}

float followed_from(uint id, float at) {
    return followed_from(records[record_of(id, RAYS) + 1u].z);
}

void main() {
    repair(INVOCATION_NUMBER);
}
#endif
