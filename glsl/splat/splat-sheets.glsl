// entry compute IMAGE
// entry compute IMAGE_WIDE
// entry compute AXIS
// entry compute AXIS_WIDE
//
// Sheet buffers: what kernels give to a sheet is added up, in any order; sheets are composited front to back.
//
//   IMAGE   sheets are slabs of equal depth, parallel to the image, and kernels give each what their integral between its planes is.
//           Nothing jumps when the camera turns, and the sum converges to the integral along the line as slabs get thinner.
//           SHEETS slabs are in registers at a time; splats come in the order of their nearest depths
//   AXIS    sheets are the voxel layers along the axis that is nearest to the line of sight, and get whole kernels (Westover's)
//
//   (one invocation owns a column of a tile; in the WIDE entries, for devices whose workgroups should be wide, a pixel)
//
//   in    bins of splats by nearest depth, or by layer (splat-project.glsl); transfer function where scalars are interpolated
//   out   accumulation image: premultiplied linear RGBA
//   error IMAGE second order in the slabs' thickness where the transfer function is smooth, first at jumps. AXIS bleeds over the kernels' reach
//         and jumps where the axis changes
//   cost  IMAGE per splat, pixel and window of SHEETS slabs one exponential and SHEETS + 1 error functions. AXIS one of each
//
// Source: Westover 1990; Mueller and Crawfis 1998; Mueller, Moeller, Crawfis 1999 (classified in the sheet).
#version 460
#extension GL_GOOGLE_include_directive : require

#if defined(IMAGE) || defined(IMAGE_WIDE)
#define SLABS
#endif

#include "interface.glsl"
#include "shared/device.glsl"
#if defined(IMAGE) || defined(AXIS)
#include "splat/column-lanes.glsl"
#else
#include "splat/pixel-lanes.glsl"
#endif
#include "shared/optics.glsl"
#include "splat/splats.glsl"

layout(constant_id = SPEC_SPLAT_AXIS) const uint AXIS_OF_SHEETS = 0;
layout(constant_id = SPEC_SPLAT_TABULATED) const bool TEMPLATE = false;

layout(local_size_x = 64 / ROWS) in;
layout(set = 0, binding = BINDING_SPLAT_RECORDS, std430) readonly buffer SplatRecords { vec4 splat_records[]; };

// What a sheet makes of its sum: of extinction, with colours; or of scalar and weight. `depths` lie between its planes.
vec4 sheet(vec4 sum, float depths, float unit, uint knots, float origin) {
    if (DENSITY) return sum.a > 0.0 ? emission_of(sum.rgb / sum.a, sum.a) : vec4(0.0);
    bool shows = depths > 0.0 && sum.y >= push.least * depths;
    vec4 optics = classify(origin + (shows ? sum.x / sum.y : 0.0), knots);
    return emission_of(optics.rgb, shows ? optics.a * depths * unit : 0.0);
}

// A scalar of the tile that others are told from: what is everywhere the same is interpolated without rounding.
float origin_of(uvec2 bin) {
    if (DENSITY || bin.x >= bin.y) return 0.0;
    uint id = bins[bin.x];
    return SHAPE == SHAPE_ALIKE ? splat_points[id].w : splat_points[2u * id + 1u].x;
}

// What a kernel's integral in depth is multiplied by.
vec4 share_of(Read read, float amplitude, float origin) {
    if (DENSITY) {
        float extinction = read.value.a * amplitude;
        return vec4(read.value.rgb * extinction, extinction);
    }
    if (SHAPE == SHAPE_ALIKE) return vec4((read.point.w - origin) * amplitude, amplitude, 0.0, 0.0);
    return vec4((read.value.x - origin) * read.value.y, read.value.y, 0.0, 0.0);
}

#ifdef SLABS
// Depths that a kernel spans.
vec2 span_of(uint id, vec4 point) {
    if (SHAPE == SHAPE_COVARIANCES) return splat_records[2u * id].xy;
    float middle = dot(point.xyz, push.forward_reach.xyz);
    float reach = SHAPE == SHAPE_RADII ? push.forward_reach.w / point.w : push.forward_reach.w;
    return vec2(middle - reach, middle + reach);
}

struct Row {
    Line line;
    vec2 range;              // depths in the domain
    vec4 sum;                // colour and opacity so far
    float transmittance;
    vec4 slab0, slab1, slab2, slab3;
    float unit;              // of depth: of lengths where extinction adds up
};

void add_to(inout Row row, Splat splat, vec4 share, float z0, float h) {
    Meeting met = meet(row.line, splat);
    if (!meets(met)) return;
    vec2 range = row.range;
    if (KERNEL != KERNEL_GAUSSIAN) {
        vec2 support = support_of(met);
        range = vec2(max(range.x, support.x), min(range.y, support.y));
        if (range.x >= range.y) return;
    }
    float a = clamp(z0, range.x, range.y), b = clamp(z0 + h, range.x, range.y), c = clamp(fma(2.0, h, z0), range.x, range.y);
    float d = clamp(fma(3.0, h, z0), range.x, range.y), e = clamp(fma(4.0, h, z0), range.x, range.y);
    vec4 parts;
    if (KERNEL == KERNEL_GAUSSIAN) {
        float most = most_of(met);
        vec4 from = clamp((vec4(a, b, c, d) - met.u) * met.along, -most, most);
        float last = clamp((e - met.u) * met.along, -most, most);
        float ea = error_function(from.x), eb = error_function(from.y), ec = error_function(from.z), ed = error_function(from.w), ee = error_function(last);
        parts = peak_of(met) * vec4(eb - ea, ec - eb, ed - ec, ee - ed);
    } else {
        parts = vec4(sampled(met, a, b), sampled(met, b, c), sampled(met, c, d), sampled(met, d, e));
    }
    parts *= row.unit;
    row.slab0 += parts.x * share;
    row.slab1 += parts.y * share;
    row.slab2 += parts.z * share;
    row.slab3 += parts.w * share;
}

// Composites the first of the slabs and moves the others up.
void take_slab(uvec2 pixel, inout Row row, float z0, float z1, uint knots, float origin) {
    float depths = max(clamp(z1, row.range.x, row.range.y) - clamp(z0, row.range.x, row.range.y), 0.0);
    float before = row.transmittance;
    add_behind(row.sum, row.transmittance, sheet(row.slab0, depths, row.line.unit, knots, origin));
    note_drawn(pixel, row.range, before, row.transmittance, z0, z1);
    row.slab0 = row.slab1;
    row.slab1 = row.slab2;
    row.slab2 = row.slab3;
    row.slab3 = vec4(0.0);
}

void main() {
    uint lane = LANE;
    uint in_band = WORKGROUP_NUMBER;
    if (in_band >= push.tiles) return;
    uvec2 bin = bin_of(in_band);
    uint place = in_band * (64u / ROWS) + lane;
    uvec2 origin = first_pixel(in_band, lane);
    float h = push.h, amplitude = push.amplitude, opaque = push.opaque, origin_scalar = origin_of(bin);
    uint knots = push.knots, budget = MOST / 2u, turn = 0u;
    load_knots();
    Row rows[ROWS];
#define BEGIN(r) { \
        rows[r].line = line_of(vec2(origin + uvec2(0, r)) + 0.5); \
        rows[r].range = domain_of(rows[r].line, drawn_depths(origin + uvec2(0, r))); \
        load_pixel(origin + uvec2(0, r), rows[r].sum, rows[r].transmittance); \
        rows[r].slab0 = rows[r].slab1 = rows[r].slab2 = rows[r].slab3 = vec4(0.0); \
        rows[r].unit = DENSITY ? rows[r].line.unit : 1.0; \
        if (rows[r].range.x >= rows[r].range.y) rows[r].transmittance = 0.0; \
    }
    EACH_ROW(BEGIN)

    uint i = RESUME ? splat_state[place].x : bin.x, end = bin.y;
    // Planes are counted from the centre of the data: they stay with it when the camera turns.
    float k = RESUME ? uintBitsToFloat(splat_state[place].y) : -3e38;
    float live = 1.0;
    while (i < end && turn < budget && ANY(live > opaque)) {
        // Splats that end before the next slab.
        uint id = bins[i];
        Read read = read_splat(id);
        vec2 span = span_of(id, read.point);
        while (turn < MOST && i < end && span.y <= k * h) {
            ++turn;
            ++i;
            id = bins[min(i, end - 1u)];
            read = read_splat(id);
            span = span_of(id, read.point);
        }
        if (i >= end) break;
        // Where nothing is, slabs are passed over.
        k = max(k, floor(max(span.x, nearest_depth()) / h));
        float z0 = k * h, z1 = fma(float(SHEETS), h, z0);
        uint next = i, going_on = 0u;
        while (turn < MOST && next < end && span.x < z1) {
            ++turn;
            going_on += uint(span.y > z1);
            vec4 share = share_of(read, amplitude, origin_scalar);
            Splat splat = splat_of(id, read.point);
            // One that has ended before the slabs gives nothing to them.
#define ADD(r) add_to(rows[r], splat, share, z0, h);
            EACH_ROW(ADD)
            ++next;
            id = bins[min(next, end - 1u)];
            read = read_splat(id);
            span = span_of(id, read.point);
        }
#if ROWS == 8
        // Large splats keep small ones in the list that have long ended: now and then those that go on are moved together, to the others that
        // are to come. The invocations of the subgroup write the same, and nobody else has this bin.
        if (next - i > 32u + 3u * going_on) {
            uint to = next;
            for (uint from = next; from > i && turn < MOST; --from) {
                ++turn;
                id = bins[from - 1u];
                read = read_splat(id);
                if (span_of(id, read.point).y > z1) bins[--to] = id;
            }
            i = to;
        }
#endif
        live = 0.0;
        for (uint s = 0u; s < SHEETS; ++s) {
            ++turn;
#define TAKE(r) take_slab(origin + uvec2(0, r), rows[r], z0 + float(s) * h, z0 + float(s + 1u) * h, knots, origin_scalar);
            EACH_ROW(TAKE)
        }
#define LIVE(r) live = max(live, rows[r].transmittance);
        EACH_ROW(LIVE)
        k += float(SHEETS);
    }
    // The device ended a loop before it was through.
    if (turn >= MOST) atomicAdd(status[STATUS_CUT], 1u);
    // The same for all that go on together.
    bool unfinished = i < end && ANY(live > opaque);
    splat_state[place] = uvec2(unfinished ? i : end, floatBitsToUint(k));
    if (unfinished && IS_LAST) atomicAdd(status[STATUS_UNFINISHED], 1u);
#define END(r) store_pixel(origin + uvec2(0, r), rows[r].sum);
    EACH_ROW(END)
}
#else
layout(set = 0, binding = BINDING_SPLAT_TEMPLATE) uniform sampler2D splat_template; // the footprint of all kernels, parallel lines

// Number of a splat's sheet, counted from the centre of the data.
float sheet_of(vec4 point) {
    return floor(point[AXIS_OF_SHEETS] / push.h + 0.25);
}

struct Row {
    Line line;
    vec2 drawn;              // depths that are drawn
    vec2 range;              // those in the domain
    vec4 sum;
    float transmittance;
    vec4 sheet;
    float unit;
};

void main() {
    uint lane = LANE;
    uint in_band = WORKGROUP_NUMBER;
    if (in_band >= push.tiles) return;
    uvec2 bin = bin_of(in_band);
    uint place = in_band * (64u / ROWS) + lane;
    uvec2 origin = first_pixel(in_band, lane);
    float h = push.h, amplitude = push.amplitude, opaque = push.opaque, origin_scalar = origin_of(bin);
    uint knots = push.knots, budget = MOST / 2u, turn = 0u;
    load_knots();
    Row rows[ROWS];
#define BEGIN(r) { \
        rows[r].line = line_of(vec2(origin + uvec2(0, r)) + 0.5); \
        rows[r].drawn = drawn_depths(origin + uvec2(0, r)); \
        rows[r].range = domain_of(rows[r].line, rows[r].drawn); \
        load_pixel(origin + uvec2(0, r), rows[r].sum, rows[r].transmittance); \
        rows[r].unit = DENSITY ? rows[r].line.unit : 1.0; \
        if (rows[r].range.x >= rows[r].range.y) rows[r].transmittance = 0.0; \
    }
    EACH_ROW(BEGIN)
    // Offsets from the line at a pixel to a kernel's centre, in pixels, and from there to the template: the inverse of (px, py, d) by its rows.
    vec3 to_x = vec3(0.0), to_y = vec3(0.0);
    vec2 scale = vec2(0.0);
    if (TEMPLATE) {
        vec3 px = push.px_slope.xyz, py = push.py_slope.xyz, d = push.d0_slope.xyz;
        float inverse = 1.0 / dot(px, cross(py, d));
        to_x = cross(py, d) * inverse;
        to_y = cross(d, px) * inverse;
        scale = splat_domain[1].xy;
    }

    uint i = RESUME ? splat_state[place].x : bin.x, end = bin.y;
    float live = 1.0;
    while (i < end && turn < budget && ANY(live > opaque)) {
        uint id = bins[i];
        Read read = read_splat(id);
        float number = sheet_of(read.point);
#define EMPTY(r) rows[r].sheet = vec4(0.0);
        EACH_ROW(EMPTY)
        while (turn < MOST && i < end && sheet_of(read.point) == number) {
            ++turn;
            vec4 share = share_of(read, amplitude, origin_scalar);
            Splat splat = splat_of(id, read.point);
#define ADD(r) { \
                float part; \
                if (TEMPLATE) { \
                    vec3 b = rows[r].line.q - splat.centre; \
                    vec2 place = vec2(dot(b, to_x), dot(b, to_y)) * scale; \
                    part = max(abs(place.x), abs(place.y)) < 1.0 ? textureLod(splat_template, sampled_at(vec3(0.5 * splat_domain[1].zw * place + 0.5, 0.5), vec3(textureSize(splat_template, 0), 1)).xy, 0.0).x : 0.0; \
                } else { \
                    Meeting met = meet(rows[r].line, splat); \
                    part = 0.0; \
                    if (meets(met)) part = footprint(met, rows[r].drawn); \
                } \
                rows[r].sheet += part * rows[r].unit * share; \
            }
            EACH_ROW(ADD)
            ++i;
            id = bins[min(i, end - 1u)];
            read = read_splat(id);
        }
        live = 0.0;
        float middle = h * (number + splat_domain[0].w);
#define TAKE(r) { \
            float along = rows[r].line.d[AXIS_OF_SHEETS], inverse = 1.0 / (abs(along) > 1e-6 ? along : 1e-6); \
            float z = (middle - rows[r].line.q[AXIS_OF_SHEETS]) * inverse, half_depth = abs(0.5 * h * inverse); \
            float depths = clamp(z + half_depth, rows[r].range.x, rows[r].range.y) - clamp(z - half_depth, rows[r].range.x, rows[r].range.y); \
            float before = rows[r].transmittance; \
            add_behind(rows[r].sum, rows[r].transmittance, sheet(rows[r].sheet, depths, rows[r].line.unit, knots, origin_scalar)); \
            note_drawn(origin + uvec2(0, r), rows[r].range, before, rows[r].transmittance, z - half_depth, z + half_depth); \
            live = max(live, rows[r].transmittance); \
        }
        EACH_ROW(TAKE)
    }
    if (turn >= MOST) atomicAdd(status[STATUS_CUT], 1u);
    // The same for all that go on together.
    bool unfinished = i < end && ANY(live > opaque);
    splat_state[place] = uvec2(unfinished ? i : end, 0u);
    if (unfinished && IS_LAST) atomicAdd(status[STATUS_UNFINISHED], 1u);
#define END(r) store_pixel(origin + uvec2(0, r), rows[r].sum);
    EACH_ROW(END)
}
#endif
