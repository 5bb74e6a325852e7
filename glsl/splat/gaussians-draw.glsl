// entry compute DRAW
// entry compute DRAW_WIDE
//
// Trained splats blended front to back in the order of their centres.
//
//   DRAW       one invocation owns a column of a tile and blends the splats of its bin in registers
//   DRAW_WIDE  one invocation a pixel, for devices whose workgroups should be wide
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

layout(constant_id = SPEC_SPLAT_RULE) const uint RULE = RULE_KHR;

layout(local_size_x = 64 / ROWS) in;
layout(set = 0, binding = BINDING_SPLAT_RECORDS, std430) readonly buffer TrainedRecords { vec4 records[]; };

const bool RAYS = RULE >= RULE_RAY;
// Of the first program: the greatest opacity, and the transmittance that a splat must leave.
const bool THRESHOLDS = RULE == RULE_INRIA || RULE == RULE_ANTIALIASED;
const float MOST_OPACITY = 0.99, LEAST_LEFT = 1e-4;

// A splat as a pixel meets it.
struct Met {
    float bits;  // half the squared distance, to base 2
    float depth; // of the nearest point of the pixel's line
};

Met meet(vec2 d, vec4 record0, vec4 record1, vec4 record2, vec4 record3) {
    vec2 own = vec2(fma(record0.z, d.x, record0.w * d.y), record1.x * d.y);
    Met met = Met(dot(own, own), record1.w);
    if (RAYS) {
        float turn = record2.w * d.x + record3.w * d.y, bend = d.x * fma(record3.x, d.x, 2.0 * record3.y * d.y) + record3.z * d.y * d.y;
        float inverse = 1.0 / max(1.0 + 2.0 * turn + bend, 1e-30);
        met.bits *= inverse;
        met.depth *= (1.0 + turn) * inverse;
    }
    return met;
}

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
    float transmittance[ROWS]; // 0 once the pixel has ended
    float opaque = push.opaque;
#define BEGIN(r) { \
        drawn[r] = drawn_depths(origin + uvec2(0, r)) + push.h; \
        load_pixel(origin + uvec2(0, r), sum[r], transmittance[r]); \
        if (RESUME) transmittance[r] = uintBitsToFloat(splat_state[place + r * TILE].y); \
    }
    EACH_ROW(BEGIN)
    float live = 1.0;
    for (; i < stop && ANY(live > opaque); ++i) {
        uint at = TRAINED_RECORD * bins[i];
        vec4 record0, record1, record2, record3 = vec4(0.0);
        FETCH_TWO(records, at, record0, record1)
        if (RAYS) {
            FETCH_TWO(records, at + 2u, record2, record3)
        } else {
            record2 = FETCH(records, at + 2u);
        }
        live = 0.0;
#define BLEND(r) { \
            Met met = meet(from + vec2(0.0, float(r)) - record0.xy, record0, record1, record2, record3); \
            bool there = met.bits <= record1.z && (!RAYS || (met.depth > drawn[r].x && met.depth < drawn[r].y)); \
            float opacity = there ? exp2(record1.y - met.bits) : 0.0; \
            if (THRESHOLDS) opacity = min(opacity, MOST_OPACITY); \
            float share = transmittance[r] * opacity, left = transmittance[r] - share; \
            bool ends = THRESHOLDS && left < LEAST_LEFT && there; \
            sum[r] = fma(vec4(ends ? 0.0 : share), vec4(record2.rgb, 1.0), sum[r]); \
            transmittance[r] = ends ? 0.0 : left; \
            live = max(live, transmittance[r]); \
        }
        EACH_ROW(BLEND)
    }
    // Opaque pixels have ended; all invocations of a subgroup agree.
    bool unfinished = i < end && ANY(live > opaque);
    splat_state[place].x = unfinished ? i : end;
    if (unfinished && IS_LAST) atomicAdd(status[STATUS_UNFINISHED], 1u);
#define END(r) { \
        splat_state[place + r * TILE].y = floatBitsToUint(transmittance[r]); \
        store_pixel(origin + uvec2(0, r), sum[r]); \
    }
    EACH_ROW(END)
}
