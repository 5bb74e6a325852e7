// The planes of faces as the lines of a view meet them, so that a fragment costs eight words of one place instead of three indices and
// three corners.
//
// The line of a face's reference P meets the plane at depth d, where w and the scalar s belong to it. Along the line at P + o the plane lies
// v / u deeper, with v = g.o and u = 1 - v w1 / w. From there the scalar is an affine function of place, whose gradient may have any part
// along the normal: that with no part along the axis that the normal is nearest to stays of the scalar's own size on faces that are seen
// edge-on, where g is large. Rounding of g then moves depth and scalar along the line together.
#ifndef FACE_PLANES_GLSL
#define FACE_PLANES_GLSL

#include "interface.glsl"
#include "mesh/mesh.glsl"

layout(constant_id = SPEC_BY_PLANES) const bool BY_PLANES = false; // faces have planes: scalars belong to points, and a buffer holds all

struct FacePlane {
    vec2 at; // P: the line through the centroid
    float d;
    float s;
    vec2 slope; // g: change of depth with P
    vec2 rise;  // the other two parts of the scalar's gradient
    uint side;  // SIDE_*
    uint axis;  // that the normal is nearest to
};

// On which sides of the face there is a cell, along lines: before it, behind it, on both sides. Of slivers, of faces that are seen nearly
// edge-on, and of those that cross the eye's plane, a plane tells too little: lines have to meet their corners.
const uint SIDE_UNKNOWN = 0u, SIDE_BEFORE = 1u, SIDE_BEHIND = 2u, SIDE_BOTH = 3u;

// Returns the plane of a face; `cells` (cells_at_face) are on the side of its normal, and on the other one.
FacePlane plane_of(vec4 a, vec4 b, vec4 c, bvec2 cells) {
    vec3 w = push.w0 + push.w1 * vec3(a.z, b.z, c.z);
    bool one_side = min(min(w.x, w.y), w.z) > 0.0 || max(max(w.x, w.y), w.z) < 0.0; // of the eye
    vec4 p = vec4((a.xyz + b.xyz + c.xyz) * (1.0 / 3.0), a.w + ((b.w - a.w) + (c.w - a.w)) * (1.0 / 3.0));
    float depth = one_side ? push.w0 + push.w1 * p.z : 1.0;
    vec2 at = p.xy / depth;

    // Edges in units of their own.
    vec3 ab = b.xyz - a.xyz, ac = c.xyz - a.xyz, most = max(abs(ab), abs(ac));
    float scale = 1.0 / max(max(max(most.x, most.y), most.z), 1e-30);
    ab *= scale;
    ac *= scale;
    vec3 normal = cross(ab, ac), line = vec3(at * push.w1, 1.0);
    float along = dot(normal, line);
    vec3 reach = max(max(abs(a.xyz), abs(b.xyz)), abs(c.xyz));
    float rounding = 2.5e-7 * max(max(reach.x, reach.y), reach.z) * scale * length(line);
    vec3 size = abs(normal);
    uint axis = size.x > max(size.y, size.z) ? 0u : size.y > size.z ? 1u : 2u;
    // Changes of the scalar along the two edges; coordinates other than the axis.
    vec2 change = vec2(b.w - a.w, c.w - a.w) * scale;
    vec2 e = axis == 0u ? ab.yz : axis == 1u ? ab.xz : ab.xy, f = axis == 0u ? ac.yz : axis == 1u ? ac.xz : ac.xy;
    float area = e.x * f.y - e.y * f.x;
    vec2 rise = vec2(change.x * f.y - change.y * e.y, change.y * e.x - change.x * f.x) / (area == 0.0 ? 1e30 : area);
    // Where the plane is good, no line can meet the face from its other side by rounding.
    bool good = one_side && abs(along) > 64.0 * rounding && max(max(size.x, size.y), size.z) > 0.01;
    uint side = !good ? SIDE_UNKNOWN : all(cells) ? SIDE_BOTH : cells.x == (along > 0.0) ? SIDE_BEFORE : SIDE_BEHIND;
    return FacePlane(at, p.z, p.w, normal.xy * (-depth / (good ? along : 1.0)), rise, side, axis);
}

// As stored: two bits of each slope make room for the side and the axis.
vec4[2] packed_plane(FacePlane plane) {
    uvec2 slope = (floatBitsToUint(plane.slope) & 0xfffffffcu) | uvec2(plane.side, plane.axis);
    return vec4[2](vec4(plane.at, plane.d, plane.s), vec4(uintBitsToFloat(slope), plane.rise));
}

FacePlane unpacked_plane(vec4 place, vec4 change) {
    uvec2 bits = floatBitsToUint(change.xy);
    vec2 slope = uintBitsToFloat(bits & 0xfffffffcu);
    return FacePlane(place.xy, place.z, place.w, slope, change.zw, bits.x & 3u, bits.y & 3u);
}

// Returns depth and scalar where a line meets the plane. `ws` are the numbers w0 and w1 of the view.
vec2 meet_plane(FacePlane plane, vec2 line, vec2 ws) {
    vec2 from = line - plane.at;
    float w = fma(ws.y, plane.d, ws.x), v = dot(plane.slope, from);
    float u = fma(-ws.y, v, w);
    float scale = w / (u == 0.0 ? 1e-30 : u);
    vec3 gradient = vec3(plane.axis == 0u ? 0.0 : plane.rise.x, plane.axis == 1u ? 0.0 : plane.axis == 0u ? plane.rise.x : plane.rise.y, plane.axis == 2u ? 0.0 : plane.rise.y);
    float rise = fma(w, dot(gradient.xy, from), v * fma(ws.y, dot(gradient.xy, plane.at), gradient.z));
    return vec2(clamp(fma(v, scale, plane.d), -1e30, 1e30), fma(rise, scale, plane.s));
}

#endif
