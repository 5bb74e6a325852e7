// entry compute DRAW
// entry compute DRAW_WIDE
// entry compute REPAIR
//
// Gaussians splatted whole, front to back: elliptical weighted average splats, or with the integral along each pixel's own line.
//
//   DRAW       one invocation owns a column of a tile and blends the splats of its bin in registers, in the order of their centres
//   DRAW_WIDE  one invocation a pixel, for devices whose workgroups should be wide
//   REPAIR     one invocation for each listed pixel, in whose line the order by centres is too far from its own
//
// BY_PIXEL: splats are blended in the order of the places where the pixel's own line is nearest to their centres (by-pixel.glsl).
//
//   in    bins of splats by distance of their centres, records of the view (splat-project.glsl)
//   out   accumulation image: premultiplied linear RGBA; BY_PIXEL: listed pixels, then for each the place of its bin at which REPAIR goes on
//   error opacity does not depend on the order: its only error is that of footprints. Colour mixes as if kernels did not overlap: two that do are wrong by at most the
//         product of their opacities times the difference of their colours
//   cost  per splat and pixel one exponential for the footprint and a series for opacity
//
// Source: Zwicker, Pfister, van Baar, Gross, EWA volume splatting, 2001.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"
#ifdef DRAW
#include "splat/column-lanes.glsl"
#else
#include "splat/pixel-lanes.glsl"
#endif
#include "shared/optics.glsl"
#include "splat/splats.glsl"
#include "splat/by-pixel.glsl"

layout(constant_id = SPEC_SPLAT_EWA) const bool EWA = false;
layout(constant_id = SPEC_SPLAT_BY_PIXEL) const bool BY_PIXEL = false;

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

// Returns whether a footprint covers a pixel; `form` is that of its ellipse, which ends at `end`.
bool covers(Meeting met, float form, float end) {
    return mix(met.beyond, end - form, EWA) > 0.0;
}

// Returns the optical depth of a splat whose footprint covers the pixel, between the depths that are drawn.
float optical_depth(Meeting met, float form, Line line, float extinction, vec2 drawn) {
    if (!EWA) return extinction * push.amplitude * line.unit * footprint(met, drawn);
    return exp2(-form) * (BOUNDED ? drawn_share(met, drawn) : 1.0);
}

// Returns the depth at which a line meets a splat in its order: where it is nearest to the centre. An ellipse covers lines that pass the kernel, and
// may be nearest to it anywhere.
float place_of(Meeting met, vec3 centre) {
    if (!EWA) return met.u;
    float z = dot(push.forward_reach.xyz, centre), most = 0.4 * push.h;
    return clamp(met.u, z - most, z + most);
}

// Returns the least depth at which the line may meet what follows in its bin a splat that it meets `at`. Bins ascend by the distance of centres, for
// parallel lines by their depth, and the line meets each within its reach: in distance along the line they are no nearer than twice the reach
// before, and depths differ by less. Ellipses near an eye inside have no bound.
float followed_from(uint id, float at) {
    return EWA && EYE_INSIDE ? -BEHIND_ALL : at - 2.0 * push.h;
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
    vec2 from = vec2(origin) + 0.5 - half_image();
    Line lines[ROWS];
    vec2 drawn[ROWS];
    vec4 sum[ROWS];
    float transmittance[ROWS];
    float last[ROWS]; // BY_PIXEL: the farthest piece that is blended; BEHIND_ALL once one came too late
    float opaque = push.opaque;
    // BY_PIXEL: rows that are opaque and lie behind nothing that follows, or are listed; bit by bit.
    uint ended = 0u;
#define BEGIN(r) { \
        lines[r] = line_of(vec2(origin + uvec2(0, r)) + 0.5); \
        drawn[r] = drawn_depths(origin + uvec2(0, r)); \
        load_pixel(origin + uvec2(0, r), sum[r], transmittance[r]); \
        if (BY_PIXEL) { \
            last[r] = RESUME ? uintBitsToFloat(splat_state[place + r * TILE].y) : -BEHIND_ALL; \
            EMPTY_WINDOW(r, last[r]) \
            if (!in_image(origin + uvec2(0, r))) ended |= 1u << r; \
        } \
    }
    EACH_ROW(BEGIN)
#define BLEND_LAST(r) BLEND_NEAREST(r, origin + uvec2(0, r), drawn[r], Piece(BEHIND_ALL, 0.0, vec3(0.0)), sum[r], transmittance[r], last[r])
    float live = 1.0;
#define IS_LIVE ANY(BY_PIXEL ? ended != (1u << ROWS) - 1u : live > opaque)
    for (; i < stop && IS_LIVE; ++i) {
        uint id = bins[i];
        Read read = read_splat(id);
        Splat splat = splat_of(id, read.point);
        vec4 value = read.value, record0 = vec4(0.0), record1 = vec4(0.0);
        if (EWA) FETCH_TWO(splat_records, 2u * id, record0, record1)
        live = 0.0;
#define BLEND(r) { \
            Meeting met = meet(lines[r], splat); \
            float form = form_of(record0, record1, from + vec2(0.0, float(r))); \
            if (covers(met, form, record1.z)) { \
                float depth = optical_depth(met, form, lines[r], value.a, drawn[r]); \
                float at = place_of(met, splat.centre); \
                if (BY_PIXEL) { \
                    BLEND_NEAREST(r, origin + uvec2(0, r), drawn[r], Piece(at, alpha_of(depth), value.rgb), sum[r], transmittance[r], last[r]) \
                    bool over = transmittance[r] <= opaque && followed_from(id, at) > last[r]; \
                    ended |= uint(over || last[r] == BEHIND_ALL) << r; \
                } else { \
                    float before = transmittance[r]; \
                    add_piece_behind(sum[r], transmittance[r], value.rgb, depth); \
                    note_drawn(origin + uvec2(0, r), drawn[r], before, transmittance[r], at, at); \
                } \
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
            splat_state[place + r * TILE].y = floatBitsToUint(last[r]); \
            if (!unfinished && last[r] == BEHIND_ALL && in_image(pixel)) pixels[room_for(1u, TILE_PIXELS)] = pixel.x | pixel.y << 16; \
        } \
        store_pixel(pixel, sum[r]); \
    }
    EACH_ROW(END)
}
#else
Line line;
vec2 from, drawn;

void begin_line(uvec2 pixel) {
    line = line_of(vec2(pixel) + 0.5);
    from = vec2(pixel) + 0.5 - half_image();
    drawn = drawn_depths(pixel);
}

// The form of a splat's ellipse, and where that ends.
vec2 ellipse_on_line(uint id) {
    if (!EWA) return vec2(0.0);
    vec4 record1 = splat_records[2u * id + 1u];
    return vec2(form_of(splat_records[2u * id], record1, from), record1.z);
}

bool meets_line(uint id, out float at) {
    vec4 point = splat_points[2u * id];
    Meeting met = meet(line, splat_of(id, point));
    vec2 ellipse = ellipse_on_line(id);
    at = place_of(met, point.xyz);
    return covers(met, ellipse.x, ellipse.y);
}

void blend_on_line(uint id, inout vec4 sum, inout float transmittance) {
    Read read = read_splat(id);
    Meeting met = meet(line, splat_of(id, read.point));
    add_piece_behind(sum, transmittance, read.value.rgb, optical_depth(met, ellipse_on_line(id).x, line, read.value.a, drawn));
}

void main() {
    repair(INVOCATION_NUMBER);
}
#endif
