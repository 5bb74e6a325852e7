// entry compute CENTRE
// entry compute CENTRE_WIDE
// entry compute WINDOW
//
// Gaussians splatted in the order of their centres, each composited as a whole: elliptical weighted average splats, or with the
// integral along each pixel's own line.
//
//   CENTRE       one invocation owns a column of a tile and blends in registers, front to back, the bin's splats as they come
//   CENTRE_WIDE  one invocation a pixel, for devices whose workgroups should be wide
//   WINDOW       one invocation a pixel; splats pass through a window that sorts them by where the pixel's own line is nearest to them
//
//   in    bins of splats by distance of their centres, records of the view (splat-project.glsl)
//   out   accumulation image: premultiplied linear RGBA
//   error opacity does not depend on the order: its only error is that of footprints. Colour mixes as if kernels did not overlap: two that do are wrong by at most the
//         product of their opacities times the difference of their colours
//   cost  per splat and pixel one exponential for the footprint and a series for opacity
//
// Source: Zwicker, Pfister, van Baar, Gross, EWA volume splatting, 2001. Windows: Radl et al., StopThePop, 2024 (the idea).
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"
#ifdef CENTRE
#include "splat/column-lanes.glsl"
#else
#include "splat/pixel-lanes.glsl"
#endif
#include "shared/optics.glsl"
#include "splat/splats.glsl"

layout(constant_id = SPEC_SPLAT_EWA) const bool EWA = false;

layout(local_size_x = 64 / ROWS) in;
layout(set = 0, binding = BINDING_SPLAT_RECORDS, std430) readonly buffer SplatRecords { vec4 splat_records[]; };

// Returns minus the logarithm to base 2 of an ellipse's optical depth at a pixel: a quadratic form less the logarithm of the peak.
float form_of(vec4 record0, vec4 record1, vec2 pixel) {
    vec2 from = pixel - record0.xy;
    return fma(from.x, record0.z * from.x, record1.y) + from.y * (record0.w * from.x + record1.x * from.y);
}

// Returns the share of an ellipse that is drawn: the same as of the kernel along the pixel's line.
float drawn_share(Meeting met, vec2 drawn) {
    if (met.beyond <= 0.0) return met.u >= drawn.x && met.u <= drawn.y ? 1.0 : 0.0;
    float most = most_of(met);
    vec2 ends = clamp((drawn - met.u) * met.along, -most, most);
    return max(error_function(ends.y) - error_function(ends.x), 0.0) / (2.0 * error_function(most));
}

#ifndef WINDOW
void main() {
    uint lane = LANE;
    uint in_band = WORKGROUP_NUMBER;
    if (in_band >= push.tiles) return;
    uvec2 bin = bin_of(in_band);
    uint place = in_band * (64u / ROWS) + lane;
    uint i = RESUME ? splat_state[place].x : bin.x;
    uint end = bin.y, stop = min(end, i + MOST);
    uvec2 origin = first_pixel(in_band, lane);
    vec2 from = vec2(origin) + 0.5 - push.half_extent;
    Line lines[ROWS];
    vec2 drawn[ROWS];
    vec4 sum[ROWS];
    float transmittance[ROWS];
    float opaque = push.opaque;
#define BEGIN(r) { \
        lines[r] = line_of(vec2(origin + uvec2(0, r)) + 0.5); \
        drawn[r] = drawn_depths(origin + uvec2(0, r)); \
        load_pixel(origin + uvec2(0, r), sum[r], transmittance[r]); \
    }
    EACH_ROW(BEGIN)
    float live = 1.0;
    for (; i < stop && ANY(live > opaque); ++i) {
        uint id = bins[i];
        vec4 value, record0 = vec4(0.0), record1 = vec4(0.0);
        Splat splat;
        if (EWA) {
            FETCH_TWO(splat_records, 2u * id, record0, record1)
            value = FETCH(splat_points, 2u * id + 1u);
            if (BOUNDED) splat = splat_of(id, FETCH(splat_points, 2u * id));
        } else {
            Read read = read_splat(id);
            value = read.value;
            splat = splat_of(id, read.point);
        }
        live = 0.0;
#define BLEND(r) { \
            if (EWA) { \
                float form = form_of(record0, record1, from + vec2(0.0, float(r))); \
                float share = 1.0; \
                if (BOUNDED) share = drawn_share(meet(lines[r], splat), drawn[r]); \
                if (form < record1.z) add_piece_behind(sum[r], transmittance[r], value.rgb, share * exp2(-form)); \
            } else { \
                Meeting met = meet(lines[r], splat); \
                if (met.beyond > 0.0) add_piece_behind(sum[r], transmittance[r], value.rgb, value.a * push.amplitude * lines[r].unit * footprint(met, drawn[r])); \
            } \
            live = max(live, transmittance[r]); \
        }
        EACH_ROW(BLEND)
    }
    // Opaque pixels have ended; all invocations of a subgroup agree.
    bool unfinished = i < end && ANY(live > opaque);
    splat_state[place] = uvec2(unfinished ? i : end, 0u);
    if (unfinished && IS_LAST) atomicAdd(status[STATUS_UNFINISHED], 1u);
#define END(r) store_pixel(origin + uvec2(0, r), sum[r]);
    EACH_ROW(END)
}
#else
// Splats that wait, nearest first: depth on the line, optical depth, number.
const uint HELD = SPLAT_WINDOW;
float held_at[HELD];
float held_depth[HELD];
uint held_id[HELD];

void main() {
    uint lane = LANE;
    uint in_band = WORKGROUP_NUMBER;
    if (in_band >= push.tiles) return;
    uvec2 bin = bin_of(in_band);
    uint place = in_band * 64u + lane;
    uint first = RESUME ? splat_state[place].x : bin.x, end = bin.y;
    uint stop = min(end, first + MOST);
    uvec2 pixel = first_pixel(in_band, lane);
    vec2 from = vec2(pixel) + 0.5 - push.half_extent;
    Line line = line_of(vec2(pixel) + 0.5);
    vec2 drawn = drawn_depths(pixel);
    vec4 sum;
    float transmittance, opaque = push.opaque;
    load_pixel(pixel, sum, transmittance);
    for (uint j = 0u; j < HELD; ++j) {
        held_at[j] = 3e38;
        held_depth[j] = 0.0;
        held_id[j] = 0u;
    }
    // The window is emptied at the end of a dispatch, and does not correct the order between the splats of two.
    uint i = first, through = stop + HELD;
    for (; i < through && transmittance > opaque; ++i) {
        bool more = i < stop;
        uint id = bins[more ? i : max(stop, 1u) - 1u];
        vec4 record0 = vec4(0.0), record1 = vec4(0.0);
        Read read = read_splat(id);
        Splat splat = splat_of(id, read.point);
        if (EWA) {
            record0 = splat_records[2u * id];
            record1 = splat_records[2u * id + 1u];
        }
        Meeting met = meet(line, splat);
        float depth = 0.0;
        if (EWA) {
            float form = form_of(record0, record1, from);
            if (more && form < record1.z) depth = exp2(-form) * (BOUNDED ? drawn_share(met, drawn) : 1.0);
        } else if (more && met.beyond > 0.0) {
            depth = read.value.a * push.amplitude * line.unit * footprint(met, drawn);
        }
        // Splats that the line misses must not push others out.
        float at = more ? (depth > 0.0 ? met.u : -3e38) : 3e38;
        for (uint j = 0u; j < HELD; ++j) {
            bool before = at < held_at[j];
            float kept_at = held_at[j], kept_depth = held_depth[j];
            uint kept_id = held_id[j];
            held_at[j] = before ? at : kept_at;
            held_depth[j] = before ? depth : kept_depth;
            held_id[j] = before ? id : kept_id;
            at = before ? kept_at : at;
            depth = before ? kept_depth : depth;
            id = before ? kept_id : id;
        }
        // The nearest leaves when the window is full, or with a splat that is missed, which is nothing.
        bool full = at < 3e38 || !more || held_depth[0] == 0.0;
        if (full) {
            vec3 colour = splat_points[2u * held_id[0] + 1u].rgb;
            add_piece_behind(sum, transmittance, colour, held_depth[0]);
            for (uint j = 1u; j < HELD; ++j) {
                held_at[j - 1u] = held_at[j];
                held_depth[j - 1u] = held_depth[j];
                held_id[j - 1u] = held_id[j];
            }
            held_at[HELD - 1u] = at;
            held_depth[HELD - 1u] = depth;
            held_id[HELD - 1u] = id;
        }
    }
    bool unfinished = stop < end && transmittance > opaque;
    splat_state[place] = uvec2(unfinished ? stop : end, 0u);
    if (unfinished && IS_LAST) atomicAdd(status[STATUS_UNFINISHED], 1u);
    store_pixel(pixel, sum);
}
#endif
