// entry compute  BUILD
// entry vertex   VERTEX
// entry fragment FRAGMENT
// entry vertex   SHADED_VERTEX
// entry fragment SHADED_FRAGMENT
//
// Projected tetrahedra as fans of triangles around a thick vertex. Seen from the eye a cell covers a triangle or a quadrilateral of thin
// vertices, which are its corners; its longest piece of a ray, the thick segment, is where two of its edges cross, or where a
// corner lies before or behind a face. The thick vertex is anywhere on the ray of the thick segment: in the middle of it the fan
// stands in space and serves every view from the same eye.
//
//   BUILD            one invocation a cell: weights of the thick segment's ends, order of corners, what the thick segment emits
//   VERTEX           four triangles a cell, of which a triangular outline needs three
//   FRAGMENT         the faces before and behind, interpolated with perspective at the pixel's centre, and the cell integrated between
//                    them; blended by fixed function
//   SHADED_VERTEX    the same triangles with colours: those of the corners' scalars at thin vertices, with opacity 0; colour
//   SHADED_FRAGMENT  and opacity of the thick segment at the thick one; interpolated
//
//   in    points as the view sees them, cells, order; transfer function or its table
//   out   colour attachment 0: premultiplied linear RGBA
//   error FRAGMENT: that of the integrator and of the order, and where a rasteriser's grid of places gives a pixel to a neighbour, the change of
//         thickness on so much of a pixel; SHADED: opacity is taken as linear between vertices
//   cost  FRAGMENT: an integration a cell and pixel; SHADED: one a cell
//
// Source: Shirley and Tuchman, San Diego Workshop on Volume Visualization 1990; Peikert, SciVis 2007, pages 4-22 to 4-26.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "mesh/cell-scalars.glsl"
#include "shared/device.glsl"
#include "mesh/mesh.glsl"

layout(constant_id = SPEC_SPACE) const bool SPACE = false;

// Least w that is drawn: what begins nearer before the eye reaches further, or is nothing.
const float NEAREST = 1e-6;

// What is said of a fan beside its numbers.
const uint QUADRILATERAL = 1u << 8; // the outline has four corners
const uint AROUND_EYE = 1u << 9;    // the eye is in the cell: weights are its own, the triangles are the faces
const uint NOTHING = 1u << 10;      // not there
const uint REVERSED = 1u << 11;     // the outline turns the other way round

struct Fan {
    vec4 weights; // of the cell's corners: of one end of the thick segment those above 0, of the other minus those below 0
    vec4 thick;   // colour and opacity of the thick segment
    uint corners; // in the order of the outline, two bits each
    uint pad0, pad1, pad2;
};

// A corner, with w beside it.
vec3 homogeneous(vec4 point) {
    return vec3(point.xy, push.w0 + push.w1 * point.z);
}

#ifdef BUILD
#include "shared/optics.glsl"
#include "shared/segments.glsl"
#include "mesh/mesh-segments.glsl"
#include "mesh/outline.glsl"
#include "shared/keys.glsl"

layout(local_size_x = 64) in;
layout(set = 0, binding = BINDING_PRIMITIVES, std430) readonly buffer Primitives { uvec4 cells[]; };
layout(set = 0, binding = BINDING_MESH_SCALARS, std430) readonly buffer MeshScalars { float mesh_scalars[]; };
layout(set = 0, binding = BINDING_VIEW_POINTS, std430) readonly buffer ViewPoints { vec4 view_points[]; };
layout(set = 0, binding = BINDING_FANS, std430) writeonly buffer Fans { Fan fans[]; };
layout(set = 0, binding = BINDING_RANK_KEYS, std430) writeonly buffer SortKeys { uint sort_keys[]; };
layout(set = 0, binding = BINDING_ORDER, std430) writeonly buffer Order { uint order[]; };

layout(constant_id = SPEC_SHADED) const bool SHADED = false;
layout(constant_id = SPEC_BACK_TO_FRONT) const bool BACK_TO_FRONT = false;

// Corner of a cell relative to the first.
vec3 corner_of_outline(uint which, vec3 e1, vec3 e2, vec3 e3) {
    return which < 2u ? (which == 0u ? vec3(0.0) : e1) : (which == 2u ? e2 : e3);
}

void main() {
    uint i = INVOCATION_NUMBER;
    if (i >= push.count) return;
    uvec4 cell = cells[i];
    vec4 a = view_points[cell.x], b = view_points[cell.y], c = view_points[cell.z], d = view_points[cell.w];

    // The numbers m with sum m v = 0, for v from the eye: barycentric coordinates of the eye, up to a factor. By differences of
    // corners, which lose nothing.
    precise vec3 v = homogeneous(a);
    precise vec3 e1 = vec3(b.xy - a.xy, push.w1 * (b.z - a.z));
    precise vec3 e2 = vec3(c.xy - a.xy, push.w1 * (c.z - a.z));
    precise vec3 e3 = vec3(d.xy - a.xy, push.w1 * (d.z - a.z));
    float volume = dot(e1, cross(e2, e3));
    float m1 = -dot(v, cross(e2, e3)), m2 = -dot(v, cross(e3, e1)), m3 = -dot(v, cross(e1, e2));
    vec4 m = vec4(volume - (m1 + m2 + m3), m1, m2, m3);
    vec4 above = max(m, 0.0), below = max(-m, 0.0);
    float sum_above = dot(above, vec4(1.0)), sum_below = dot(below, vec4(1.0));

    Fan fan;
    bool there = cell.x != cell.y;
    bool crossed = sum_above > 0.0 && sum_below > 0.0;
    vec4 first = above / (crossed ? sum_above : 1.0), second = below / (crossed ? sum_below : 1.0);
    fan.weights = first - second;
    uint other = uint((m.y > 0.0) != (m.x > 0.0)) | uint((m.z > 0.0) != (m.x > 0.0)) << 1 | uint((m.w > 0.0) != (m.x > 0.0)) << 2;
    bool triangle = other == 1u || other == 2u || other == 4u || other == 7u;
    vec3 low = min(min(v, v + e1), min(v + e2, v + e3)), high = max(max(v, v + e1), max(v + e2, v + e3));
    bool around = push.w1 != 0.0 && all(lessThanEqual(low, vec3(0.0))) && all(greaterThanEqual(high, vec3(0.0)));
    fan.corners = OUTLINE_ORDER[other] | (triangle ? 0u : QUADRILATERAL);
    // Seen from the eye the corners of outlines all turn the same way.
    vec3 v0 = corner_of_outline(fan.corners & 3u, e1, e2, e3), v1 = corner_of_outline(fan.corners >> 2 & 3u, e1, e2, e3);
    vec3 v2 = corner_of_outline(fan.corners >> 4 & 3u, e1, e2, e3);
    if (dot(v + v0, cross(v1 - v0, v2 - v0)) < 0.0) fan.corners |= REVERSED;
    if (!crossed) {
        fan.corners |= around ? AROUND_EYE : NOTHING;
        fan.weights = volume != 0.0 ? m / volume : vec4(0.25);
    }
    if (!there) fan.corners |= NOTHING;

    fan.thick = vec4(0.0);
    if (SHADED) {
        load_segments(push.knots);
        mat3 edges = mat3(b.xyz - a.xyz, c.xyz - a.xyz, d.xyz - a.xyz);
        vec3 one = edges * first.yzw, two = edges * second.yzw;
        // From the eye; of parallel rays along them.
        vec3 ray = push.w1 == 0.0 ? vec3(0.0, 0.0, 1.0) : vec3(a.xy, v.z / push.w1) + one;
        vec2 s = vec2(dot(first, vec4(a.w, b.w, c.w, d.w)), dot(second, vec4(a.w, b.w, c.w, d.w)));
        if (CELL_SCALARS) s = vec2(mesh_scalars[i]);
        if (dot(two - one, ray) < 0.0) s = s.yx;
        if (!crossed) {
            // From the eye to the middle of the cell, for all of it.
            first = fan.weights;
            one = edges * first.yzw;
            two = edges * vec3(0.25);
            s = vec2(dot(first, vec4(a.w, b.w, c.w, d.w)), 0.25 * (a.w + b.w + c.w + d.w));
            if (CELL_SCALARS) s = vec2(mesh_scalars[i]);
        }
        vec4 emission = cell_segment(end_at(s.x), end_at(s.y), length(straight(two - one)) * push.unit, push.knots);
        fan.thick = emission.a > 0.0 ? vec4(emission.rgb / emission.a, emission.a) : vec4(0.0);
    }
    fan.pad0 = 0u;
    fan.pad1 = 0u;
    fan.pad2 = 0u;
    fans[i] = fan;

    if (SPACE) {
        // Ranks for every view from here: the distance of the centroid less that of the mesh's centre, also behind.
        vec3 middle = (a.xyz + b.xyz + c.xyz + d.xyz) * 0.25;
        float eye = push.forward.w, further = further_of(middle);
        float key = (middle.z < eye ? 2.0 * eye - middle.z : middle.z) + further;
        sort_keys[i] = there ? float_key(BACK_TO_FRONT ? -key : key) : 0xffffffffu;
        order[i] = i;
    }
}
#endif

#if defined(VERTEX) || defined(SHADED_VERTEX)
#ifdef SHADED_VERTEX
#include "shared/optics.glsl"
layout(location = 0) out vec4 colour_out;
#else
layout(location = 0) flat out vec4 a_out;
layout(location = 1) flat out vec4 b_out;
layout(location = 2) flat out vec4 c_out;
layout(location = 3) flat out vec4 d_out;
layout(location = 4) flat out vec3 depths_out;
#endif

layout(set = 0, binding = BINDING_PRIMITIVES, std430) readonly buffer Primitives { uvec4 cells[]; };
layout(set = 0, binding = BINDING_MESH_SCALARS, std430) readonly buffer MeshScalars { float mesh_scalars[]; };
layout(set = 0, binding = BINDING_VIEW_POINTS, std430) readonly buffer ViewPoints { vec4 view_points[]; };
layout(set = 0, binding = BINDING_ORDER, std430) readonly buffer Order { uint order[]; };
layout(set = 0, binding = BINDING_FANS, std430) readonly buffer Fans { Fan fans[]; };

vec4 corner_at(uint which, vec4 a, vec4 b, vec4 c, vec4 d) {
    return which < 2u ? (which == 0u ? a : b) : (which == 2u ? c : d);
}

void main() {
    uint vertex = uint(gl_VertexIndex);
    uint rank = vertex / FAN_VERTICES, number = vertex % FAN_VERTICES;
    uint id = order[rank];
    Fan fan = fans[id];
    uvec4 cell = cells[id];
    vec4 a = view_points[cell.x], b = view_points[cell.y], c = view_points[cell.z], d = view_points[cell.w];
    if (CELL_SCALARS) {
        float s = mesh_scalars[id];
        a.w = s;
        b.w = s;
        c.w = s;
        d.w = s;
    }
    // Each triangle is the thick vertex and two thin ones.
    uint size = (fan.corners & QUADRILATERAL) != 0u ? 4u : 3u;
    uint triangle = number / 3u, which = number % 3u;
    uint next = triangle + 1u == size ? 0u : triangle + 1u;
    bool reversed = (fan.corners & REVERSED) != 0u;
    vec4 thin1 = corner_at(fan.corners >> (2u * (reversed ? next : triangle)) & 3u, a, b, c, d);
    vec4 thin2 = corner_at(fan.corners >> (2u * (reversed ? triangle : next)) & 3u, a, b, c, d);
    vec4 first = max(fan.weights, 0.0), second = max(-fan.weights, 0.0);
    vec4 one = first.x * a + first.y * b + first.z * c + first.w * d;
    vec4 two = second.x * a + second.y * b + second.z * c + second.w * d;

    bool around = (fan.corners & AROUND_EYE) != 0u;
    if (around) {
        // From the eye the cell reaches to its faces.
        thin1 = corner_at((triangle + 1u) & 3u, a, b, c, d);
        thin2 = corner_at((triangle + 2u) & 3u, a, b, c, d);
    }
    vec4 thick = around ? corner_at((triangle + 3u) & 3u, a, b, c, d) : 0.5 * (one + two);
    vec4 at = which == 0u ? thick : (which == 1u ? thin1 : thin2);
    vec3 place = homogeneous(at);
    vec4 w = push.w0 + push.w1 * vec4(a.z, b.z, c.z, d.z);
    // A fan in the image, where all of it is before the eye.
    if (!SPACE && min(min(w.x, w.y), min(w.z, w.w)) > NEAREST) place = vec3(place.xy / place.z, 1.0);
    vec2 unit = vec2(1.0, -1.0) / (push.pixel * push.half_extent);
    gl_Position = vec4(place.xy * unit, place.z - NEAREST, place.z);

    if ((fan.corners & NOTHING) != 0u || (!around && triangle >= size)) gl_Position = vec4(0.0, 0.0, 0.0, 1.0);
#ifdef SHADED_VERTEX
    load_knots();
    colour_out = which == 0u || around ? fan.thick : vec4(classify(at.w, push.knots).rgb, 0.0);
#else
    // Depths between the ends by differences, which lose nothing.
    vec4 depths = vec4(0.0, b.z - a.z, c.z - a.z, d.z - a.z);
    float between = dot(second, depths) - dot(first, depths);
    a_out = vec4(homogeneous(thin1), thin1.w);
    b_out = vec4(homogeneous(thin2), thin2.w);
    c_out = around ? vec4(homogeneous(thick), thick.w) : vec4(homogeneous(one), one.w);
    d_out = around ? vec4(0.0, 1.0, one.w, 1.0) : vec4(between, homogeneous(two).z, two.w, 0.0);
    depths_out = vec3(thin1.z, thin2.z, one.z);
#endif
}
#endif

#ifdef FRAGMENT
#include "mesh/mesh-bounds.glsl"
#include "shared/optics.glsl"
#include "shared/segments.glsl"
#include "mesh/mesh-segments.glsl"

// X, Y, w and the scalar of two thin vertices and of one end of the thick segment; of the other its depth from there, w and the scalar.
// Around the eye: of a face's corners; and the scalar at the eye, with a 1.
layout(location = 0) flat in vec4 a_in;
layout(location = 1) flat in vec4 b_in;
layout(location = 2) flat in vec4 c_in;
layout(location = 3) flat in vec4 d_in;
layout(location = 4) flat in vec3 depths_in; // of the thin vertices and of the one end, where lines are bounded
layout(location = 0) out vec4 colour;

// What a line passes between the two triangles of thin vertices and either end of the thick segment: difference of depths, scalars in
// front and behind; and the depth in front. Both triangles have the same three numbers, as in mesh.glsl, but for the scale of what their third corners
// are seen with: m = k r, r the ratio of w. Numbers below 0 are a rasteriser's rounding: a neighbour has what is beyond.
vec4 between_faces(vec2 line) {
    vec2 a = a_in.xy - a_in.z * line, b = b_in.xy - b_in.z * line, c = c_in.xy - c_in.z * line;
    precise vec3 k = vec3(b.x * c.y - b.y * c.x, c.x * a.y - c.y * a.x, a.x * b.y - a.y * b.x);
    k = max(k.x + k.y + k.z < 0.0 ? -k : k, 0.0);
    float sum = k.x + k.y + k.z;
    k = sum > 0.0 ? k / sum : vec3(1.0, 0.0, 0.0);
    float r = d_in.y / c_in.z, rest = 1.0 / (r * (k.x + k.y) + k.z);
    // d2 - d1 = k3 D ((k1 wa + k2 wb) / wc + k3) / (r (k1 + k2) + k3), D along the thick segment: no difference of depths.
    float depth = k.z * d_in.x * ((k.x * a_in.z + k.y * b_in.z) / c_in.z + k.z) * rest;
    float thin = k.x * a_in.w + k.y * b_in.w;
    vec2 s = vec2(thin + k.z * c_in.w, (r * thin + k.z * d_in.z) * rest);
    // From the eye to a face w grows from 0. (Everything is done for all: software rasterisers run through every branch.)
    bool around = d_in.w > 0.0;
    depth = around ? (k.x * a_in.z + k.y * b_in.z + k.z * c_in.z) / push.w1 : depth;
    s = around ? vec2(d_in.z, s.x) : s;
    // Of the face that the one end lies on.
    float from = around ? push.forward.w : dot(k, depths_in);
    return vec4(abs(depth), depth < 0.0 ? s.yx : s, min(from, from + depth));
}

void main() {
    load_segments(push.knots);
    vec2 line = line_at(gl_FragCoord.xy);
    vec4 between = between_faces(line);
    float depth = between.x;
    vec2 s = between.yz;
    if (BOUNDED) {
        Piece piece = Piece(between.w, between.w + depth, s.x, s.y);
        cut(piece, bounds_at(uvec2(gl_FragCoord.xy)));
        depth = max(piece.d1 - piece.d0, 0.0);
        s = vec2(piece.s0, piece.s1);
    }
    End front = end_at(CELL_SCALARS ? a_in.w : s.x), back = front;
    if (!CELL_SCALARS) back = end_at(s.y);
    colour = cell_segment(front, back, depth * length_of_depth(line), push.knots);
    // A triangle that the rasteriser's grid turns over covers what others of the fan cover too.
    if (!gl_FrontFacing && d_in.w == 0.0) colour = vec4(0.0);
}
#endif

#ifdef SHADED_FRAGMENT
layout(location = 0) in vec4 colour_in;
layout(location = 0) out vec4 colour;

void main() {
    colour = vec4(colour_in.rgb, 1.0) * colour_in.a;
}
#endif
