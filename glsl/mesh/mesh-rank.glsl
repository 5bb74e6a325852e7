// entry compute POINTS
// entry compute BOXES
//
// The primitives of a mesh as a view sees them: faces or cells, which are then sorted by key (radix-sort.glsl) and binned to tiles
// (bins.glsl).
//
//   POINTS  one invocation a point: as the view sees it
//   BOXES   one invocation a primitive: the pixels that it may cover, the plane of a face, and a key of visibility, the signed distance of its centroid
//           from the eye less the depth of the plane through the mesh's centre
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "mesh/cell-scalars.glsl"
#include "shared/device.glsl"
#include "mesh/face-planes.glsl"
#include "mesh/mesh.glsl"
#include "shared/keys.glsl"

layout(constant_id = SPEC_CELLS) const bool CELLS = false;
layout(constant_id = SPEC_BACK_TO_FRONT) const bool BACK_TO_FRONT = false;

#ifdef POINTS
layout(local_size_x = 64) in;
layout(set = 0, binding = BINDING_MESH_POINTS, std430) readonly buffer MeshPoints { vec4 mesh_points[]; };
layout(set = 0, binding = BINDING_MESH_SCALARS, std430) readonly buffer MeshScalars { float mesh_scalars[]; };
layout(set = 0, binding = BINDING_VIEW_POINTS, std430) writeonly buffer ViewPoints { vec4 view_points[]; };

void main() {
    uint i = INVOCATION_NUMBER;
    if (i >= push.count) return;
    vec3 p = mesh_points[i].xyz;
    float s = CELL_SCALARS ? 0.0 : mesh_scalars[i];
    view_points[i] = vec4(dot(p, push.right.xyz) + push.right.w, dot(p, push.up.xyz) + push.up.w, dot(p, push.forward.xyz), s);
}
#endif

#ifdef BOXES
layout(local_size_x = 64) in;
layout(set = 0, binding = BINDING_PRIMITIVES, std430) readonly buffer Primitives { uint primitives[]; };
layout(set = 0, binding = BINDING_VIEW_POINTS, std430) readonly buffer ViewPoints { vec4 view_points[]; };
layout(set = 0, binding = BINDING_RANK_KEYS, std430) writeonly buffer SortKeys { uint sort_keys[]; };
layout(set = 0, binding = BINDING_ORDER, std430) writeonly buffer Order { uint order[]; };
layout(set = 0, binding = BINDING_BOXES, std430) writeonly buffer Boxes { uvec2 boxes[]; };
layout(set = 0, binding = BINDING_STATUS, std430) buffer Status { uint status[]; };
layout(set = 0, binding = BINDING_PLANES, std430) writeonly buffer Planes { vec4 planes[]; };

// The part of a polygon before the eye, or behind it (`front` -1), as a box of places in the image. An edge that crosses the eye's
// plane goes to infinity there.
void extend(inout vec4 box, vec4 a, vec4 b, float front) {
    float wa = (push.w0 + push.w1 * a.z) * front, wb = (push.w0 + push.w1 * b.z) * front;
    if (wa > 0.0) {
        vec2 p = a.xy / wa * front;
        box = vec4(min(box.xy, p), max(box.zw, p));
    }
    if ((wa > 0.0) != (wb > 0.0)) {
        vec2 across = mix(a.xy, b.xy, wa / (wa - wb)) * front;
        float rounding = 1e-5 * (abs(a.x) + abs(a.y) + abs(b.x) + abs(b.y));
        vec2 far = vec2(1e30);
        box = vec4(min(box.xy, mix(far, -far, lessThan(across, vec2(rounding)))),
                   max(box.zw, mix(-far, far, greaterThan(across, vec2(-rounding)))));
    }
}

void main() {
    uint i = INVOCATION_NUMBER;
    if (i >= push.count) return;
    uint at = i * (CELLS ? CELL_WORDS : FACE_WORDS);
    uint first = primitives[at];
    vec4 a = view_points[first & ~(FACE_AHEAD | FACE_BEHIND)], b = view_points[primitives[at + 1u]], c = view_points[primitives[at + 2u]];
    vec4 e = CELLS ? view_points[primitives[at + 3u]] : c;
    vec2 half_size = push.half_extent * push.pixel;
    vec4 covered = vec4(half_size, -half_size);
    vec4 w = push.w0 + push.w1 * vec4(a.z, b.z, c.z, e.z);
    bool all_before = min(min(w.x, w.y), min(w.z, w.w)) > 0.0;
    for (uint lobe = 0u; lobe < 2u; ++lobe) {
        // Cells behind the eye are not listed. Faces are: they tell whether the eye is inside the mesh.
        float front = lobe == 0u ? 1.0 : -1.0;
        if (lobe == 1u && (CELLS || all_before)) break;
        vec4 box = vec4(vec2(1e30), vec2(-1e30));
        extend(box, a, b, front);
        extend(box, b, c, front);
        extend(box, c, CELLS ? e : a, front);
        extend(box, CELLS ? e : a, a, front);
        if (CELLS) {
            extend(box, a, c, front);
            extend(box, b, e, front);
        }
        bool seen = all(lessThanEqual(box.xy, half_size)) && all(greaterThanEqual(box.zw, -half_size));
        if (seen) covered = vec4(min(covered.xy, max(box.xy, -half_size)), max(covered.zw, min(box.zw, half_size)));
    }
    // In pixels, whose centres are at halves; a hundredth of a pixel and what the place itself may be rounded by.
    vec4 places = vec4(covered.x, -covered.w, covered.z, -covered.y) / push.pixel + push.half_extent.xyxy;
    vec2 margin = vec2(0.01) + abs(places.zw - places.xy) * 1e-6;
    uvec2 low = uvec2(clamp(ceil(places.xy - 0.5 - margin), vec2(0.0), 2.0 * push.half_extent));
    uvec2 high = uvec2(clamp(floor(places.zw + 0.5 + margin), vec2(0.0), 2.0 * push.half_extent));
    bool there = all(lessThan(low, high)) && (CELLS || (first & (FACE_AHEAD | FACE_BEHIND)) != 0u);
    boxes[i] = there ? uvec2(low.x | high.x << 16, low.y | high.y << 16) : uvec2(0u);

    if (BY_PLANES) {
        vec4 plane[2] = packed_plane(plane_of(a, b, c, cells_at_face(first)));
        planes[2u * i] = plane[0];
        planes[2u * i + 1u] = plane[1];
    }

    vec3 middle = CELLS ? (a.xyz + b.xyz + c.xyz + e.xyz) * 0.25 : (a.xyz + b.xyz + c.xyz) * (1.0 / 3.0);
    float further = further_of(middle);
    float key = middle.z + (middle.z < push.forward.w ? -further : further);
    if (isnan(key)) atomicAdd(status[STATUS_NAN_KEYS], 1u);
    // Primitives outside of the image go last.
    sort_keys[i] = there ? float_key(BACK_TO_FRONT ? -key : key) : 0xffffffffu;
    order[i] = i;
}
#endif
