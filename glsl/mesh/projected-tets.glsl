// entry compute  COMPUTE
// entry compute  OUTLINES
// entry vertex   VERTEX
// entry fragment FRAGMENT
//
// Projected tetrahedra: cells by rank, each integrated where a pixel's line passes through it.
//
//   OUTLINES  one invocation a cell: the polygon that it covers in the image, widened by what a rasteriser may move
//             a corner
//   VERTEX    two triangles a cell
//   FRAGMENT  one cell of one pixel: the piece of the line inside it, with the edge functions that all cells share;
//             blended by fixed function
//   COMPUTE   one invocation owns a pixel and walks through the cells that its line meets (mesh-tiles.glsl); whether pieces were in order
//             is known
//
//   in    points as the view sees them, cells, order, boxes; transfer function or its table
//   out   colour attachment 0 or the accumulation image: premultiplied linear RGBA
//   error that of the integrator and of the order
//   cost  an integration a cell and pixel
//
// A polygon covers no pixel's centre too few, and what it covers too many its cell does not meet: whatever the
// rasteriser's grid of places, cells neither overlap nor leave gaps.
//
// Source: Shirley and Tuchman, San Diego Workshop on Volume Visualization 1990; Peikert, SciVis 2007, pages 4-22 to 4-26.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "mesh/cell-scalars.glsl"
#include "shared/device.glsl"
#include "mesh/mesh.glsl"

layout(constant_id = SPEC_BACK_TO_FRONT) const bool BACK_TO_FRONT = false;
layout(constant_id = SPEC_RESUME) const bool RESUME = false;
layout(constant_id = SPEC_LAST_CHUNK) const bool LAST_CHUNK = true;

#ifdef COMPUTE
#include "shared/optics.glsl"
#include "mesh/mesh-bounds.glsl"
#include "shared/segments.glsl"
#include "mesh/mesh-hit-depths.glsl"
#include "mesh/mesh-segments.glsl"
#include "mesh/own-pixel.glsl"
#include "mesh/status.glsl"
#include "mesh/tile-walk.glsl"

layout(local_size_x = TILE_PIXELS) in;
layout(set = 0, binding = BINDING_FLAGS, std430) buffer Flags { uint flags[]; };
layout(set = 0, binding = BINDING_ACCUMULATION, rgba32f) uniform image2D accumulation;

// In place of a pixel's last place between two dispatches: its pieces came out of order.
const uint OUT_OF_ORDER = 0xffffffffu;

void main() {
    OwnPixel own = own_pixel();
    if (!own.exists) return;
    load_segments(push.knots);
    uint knots = push.knots, number = gl_LocalInvocationIndex;
    ivec2 pixel = ivec2(own.pixel);
    vec2 bounds = bounds_at(own.pixel);
    float opaque = end_of_line(BACK_TO_FRONT);
    Walk walk = walk_through(own.in_band, number, push.first, push.number);
    vec2 line0 = line_at(vec2(pixel_of(own.tile, 0u)) + 0.5), line = line_at(vec2(own.pixel) + 0.5);

    vec4 sum = RESUME ? imageLoad(accumulation, pixel) : vec4(0.0);
    bool unsorted = RESUME && flags[own.word] == OUT_OF_ORDER;
    float last = RESUME && !unsorted ? uintBitsToFloat(flags[own.word]) : -3e38;
    while (has_pair(walk) && sum.a < opaque) {
        uint id = next_primitive(walk, number);
        vec4 listed = piece_of(id, primitive_of(id, line0), uvec2(number % TILE, number / TILE), line);
        // What is left of a cell behind the eye has no place.
        float middle = listed.y > listed.x ? middle_of(listed, BACK_TO_FRONT) : last;
        unsorted = unsorted || middle < last - ROUNDING;
        last = max(last, middle);
        Piece piece = Piece(listed.x, listed.y, listed.z, listed.w);
        if (BOUNDED) cut(piece, bounds);
        End front = end_at(piece.s0), back = front;
        if (!CELL_SCALARS) back = end_at(piece.s1);
        float before = 1.0 - sum.a;
        composite(sum, cell_segment(front, back, max(piece.d1 - piece.d0, 0.0) * own.world, knots), BACK_TO_FRONT);
        note_segment(front, back, piece.d0, piece.d1, before, 1.0 - sum.a, knots, own);
    }
    // Devices may end a loop that takes too many turns, and go on after it. (Not the loop's own condition: compilers know that.)
    if ((has_pair(walk) || is_cut(walk)) && sum.a < opaque) atomicAdd(status[STATUS_CUT], 1u);
    flags[own.word] = LAST_CHUNK ? (unsorted ? FLAG_UNSORTED : 0u) : unsorted ? OUT_OF_ORDER : floatBitsToUint(last);
    if (LAST_CHUNK && unsorted) atomicAdd(status[STATUS_OVERFLOW_PIXELS], 1u);
    count_fragments(walk.met);
    imageStore(accumulation, pixel, sum);
}
#endif

#ifdef OUTLINES
#include "mesh/outline.glsl"

layout(local_size_x = 64) in;
layout(set = 0, binding = BINDING_PRIMITIVES, std430) readonly buffer Primitives { uvec4 cells[]; };
layout(set = 0, binding = BINDING_VIEW_POINTS, std430) readonly buffer ViewPoints { vec4 view_points[]; };
layout(set = 0, binding = BINDING_BOXES, std430) readonly buffer Boxes { uvec2 boxes[]; };
layout(set = 0, binding = BINDING_POLYGONS, std430) writeonly buffer Polygons { vec4 polygons[]; };

void main() {
    uint i = INVOCATION_NUMBER;
    if (i >= push.count) return;
    uvec4 cell = cells[i];
    Polygon polygon = outline_of(view_points[cell.x], view_points[cell.y], view_points[cell.z], view_points[cell.w], boxes[i]);
    polygons[2u * i] = vec4(polygon.a, polygon.b);
    polygons[2u * i + 1u] = vec4(polygon.c, polygon.d);
}
#endif

#ifdef VERTEX

layout(set = 0, binding = BINDING_PRIMITIVES, std430) readonly buffer Primitives { uvec4 cells[]; };
layout(set = 0, binding = BINDING_MESH_SCALARS, std430) readonly buffer MeshScalars { float mesh_scalars[]; };
layout(set = 0, binding = BINDING_VIEW_POINTS, std430) readonly buffer ViewPoints { vec4 view_points[]; };
layout(set = 0, binding = BINDING_ORDER, std430) readonly buffer Order { uint order[]; };
layout(set = 0, binding = BINDING_POLYGONS, std430) readonly buffer Polygons { vec2 polygons[]; };

layout(location = 0) flat out vec4 a_out;
layout(location = 1) flat out vec4 b_out;
layout(location = 2) flat out vec4 c_out;
layout(location = 3) flat out vec4 d_out;

void main() {
    uint vertex = uint(gl_VertexIndex);
    uint rank = vertex / OUTLINE_VERTICES, number = vertex % OUTLINE_VERTICES;
    uint id = order[rank];
    // Corners 0, 1, 2 and 0, 2, 3.
    uint corner = number < 3u ? number : (number == 3u ? 0u : number - 2u);
    gl_Position = vec4(polygons[4u * id + corner], 0.0, 1.0);
    uvec4 cell = cells[id];
    a_out = view_points[cell.x];
    b_out = view_points[cell.y];
    c_out = view_points[cell.z];
    d_out = view_points[cell.w];
    if (CELL_SCALARS) a_out.w = mesh_scalars[id];
}
#endif

#ifdef FRAGMENT
#include "shared/optics.glsl"
#include "mesh/mesh-bounds.glsl"
#include "shared/segments.glsl"
#include "mesh/mesh-segments.glsl"

layout(location = 0) flat in vec4 a_in;
layout(location = 1) flat in vec4 b_in;
layout(location = 2) flat in vec4 c_in;
layout(location = 3) flat in vec4 d_in;
layout(location = 0) out vec4 colour;

void main() {
    load_segments(push.knots);
    vec2 line = line_at(gl_FragCoord.xy);
    Piece piece = meet_cell(a_in, b_in, c_in, d_in, line);
    if (BOUNDED) cut(piece, bounds_at(uvec2(gl_FragCoord.xy)));
    bool meets = piece.d1 > piece.d0;
    float len = meets ? (piece.d1 - piece.d0) * length_of_depth(line) : 0.0;
    End front = end_at(CELL_SCALARS ? a_in.w : piece.s0), back = front;
    if (!CELL_SCALARS) back = end_at(piece.s1);
    vec4 emission = cell_segment(front, back, len, push.knots);
    colour = meets ? emission : vec4(0.0);
}
#endif
