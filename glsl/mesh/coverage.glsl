// Which pixels of a tile a face or a cell covers, and where a pixel's line meets it.
//
// A line passes through a face where it passes its three edges on the right sides. All faces of an edge compute the same, so that they
// neither overlap nor leave gaps.
#ifndef COVERAGE_GLSL
#define COVERAGE_GLSL

#include "interface.glsl"
#include "mesh/cell-scalars.glsl"
#include "mesh/face-planes.glsl"
#include "mesh/mesh.glsl"
#include "mesh/own-pixel.glsl"

layout(constant_id = SPEC_CELLS) const bool CELLS = false;

layout(set = 0, binding = BINDING_PRIMITIVES, std430) readonly buffer Primitives { uint primitives[]; };
layout(set = 0, binding = BINDING_MESH_SCALARS, std430) readonly buffer MeshScalars { float mesh_scalars[]; };
layout(set = 0, binding = BINDING_VIEW_POINTS, std430) readonly buffer ViewPoints { vec4 view_points[]; };
layout(set = 0, binding = BINDING_PLANES, std430) readonly buffer Planes { vec4 planes[]; };

// The corner whose index is the word at a place of the primitives.
vec4 corner(uint at) {
    return view_points[primitives[at]];
}

// The first corner of a primitive.
vec4 first_corner(uint at) {
    return view_points[primitives[at] & ~(FACE_AHEAD | FACE_BEHIND)];
}

// Functions that the loops over pixels call have no branches: SwiftShader's compiler takes twice the time for each that follows another in a
// loop.

// On which side of an edge the pixels of a tile pass: `side_of` is an affine function of the place, e + x dx + y dy from the tile's first
// pixel on. It is the same for all faces of the edge.
struct Edge {
    float e, dx, dy;
    float aside; // by how much `e` of the line moved aside is greater
};

Edge edge_of(Corner a, Corner b) {
    precise float p = a.at.x * b.at.y;
    precise float q = a.at.y * b.at.x;
    precise float dx = (b.w * a.at.y - a.w * b.at.y) * push.pixel;
    precise float dy = (b.w * a.at.x - a.w * b.at.x) * push.pixel;
    precise float e = p - q;
    return Edge(e, dx, dy, aside_of(a.at, b.at));
}

// Where an edge crosses the rows of a tile: that of its first pixel, and the change from row to row.
struct Crossing {
    float from0, slope;
};

Crossing crossing_of(Edge edge) {
    bool along = edge.dx == 0.0; // the row runs along the edge: all of it is on one side
    // A power of two, so that what is zero stays zero.
    precise float inverse = mix(-1.0 / edge.dx, -1.2676506e30, along);
    precise float e = edge.e + edge.aside;
    precise float from0 = e * inverse;
    precise float slope = edge.dy * inverse;
    return Crossing(from0, slope);
}

// Where the edge crosses rows, in pixels from the tile's first one on, in [0, TILE].
vec4 crossed_at(Crossing crossing, vec4 rows) {
    precise vec4 from = fma(rows, vec4(crossing.slope), vec4(crossing.from0));
    return min(max(from, 0.0), float(TILE));
}

// The first pixels of rows beyond the crossing.
uvec4 first_beyond(Crossing crossing, vec4 rows) {
    return uvec4(whole_of(ceil(crossed_at(crossing, rows))));
}

// The pixels of the tile where the side is positive: a bit each, row by row. Where the edge crosses a row is computed once, so that what
// is not on one side is on the other.
uvec2 positive(Edge edge) {
    Crossing crossing = crossing_of(edge);
    // (No loop: software rasterisers take as long for one as for all that it does.)
    uvec4 low = (uvec4(0xffu) << first_beyond(crossing, vec4(0.0, 1.0, 2.0, 3.0)) & 0xffu) << uvec4(0u, 8u, 16u, 24u);
    uvec4 high = (uvec4(0xffu) << first_beyond(crossing, vec4(4.0, 5.0, 6.0, 7.0)) & 0xffu) << uvec4(0u, 8u, 16u, 24u);
    uvec2 mask = uvec2(low.x | low.y | low.z | low.w, high.x | high.y | high.z | high.w);
    return mix(mask, ~mask, bvec2(edge.dx < 0.0));
}

// The same for one pixel.
bool is_positive(Edge edge, uvec2 pixel) {
    return (float(pixel.x) >= crossed_at(crossing_of(edge), vec4(pixel.y)).x) != (edge.dx < 0.0);
}

// A line passes through a face that turns left where it is on the positive sides of bc and ab and on the negative one of ac; the other way
// round it turns right.
uvec2 through(uvec2 bc, uvec2 ac, uvec2 ab) {
    return ~(bc ^ ab) & (bc ^ ac);
}

bool passes_through(bool bc, bool ac, bool ab) {
    return all(bvec2(bc == ab, bc != ac));
}

// Returns depth and scalar where a pixel's line meets a face that it passes through. A line that does so only when it is moved aside
// meets the face there.
vec2 on_face(float bc, float ac, float ab, vec3 aside, vec4 a, vec4 b, vec4 c, float turn) {
    vec3 weight = vec3(bc, -ac, ab) * turn;
    bool passes = min(min(weight.x, weight.y), weight.z) >= 0.0;
    weight = max(mix(weight + vec3(aside.x, -aside.y, aside.z) * turn, weight, bvec3(passes)), 0.0);
    float sum = weight.x + weight.y + weight.z;
    weight = mix(vec3(1.0 / 3.0), weight / sum, bvec3(sum > 0.0));
    return vec2(weight.x * a.z + weight.y * b.z + weight.z * c.z, scalar_between(weight, a.w, b.w, c.w));
}

// A face, or a cell, of which the face is one, as a tile sees it.
struct Primitive {
    vec4 a, b, c, e; // its corners in the view
    Edge ab, ac, bc, ae, be, ce;
};

Primitive primitive_of(uint id, vec2 line0) {
    Primitive p;
    uint at = id * (CELLS ? CELL_WORDS : FACE_WORDS);
    p.a = first_corner(at);
    p.b = corner(at + 1u);
    p.c = corner(at + 2u);
    Corner a = corner_of(p.a, line0), b = corner_of(p.b, line0), c = corner_of(p.c, line0);
    p.ab = edge_of(a, b);
    p.ac = edge_of(a, c);
    p.bc = edge_of(b, c);
    if (CELLS) {
        p.e = corner(at + 3u);
        Corner e = corner_of(p.e, line0);
        p.ae = edge_of(a, e);
        p.be = edge_of(b, e);
        p.ce = edge_of(c, e);
    }
    return p;
}

// The pixels of a tile that a primitive covers.
uvec2 pixels_of(Primitive p) {
    uvec2 ab = positive(p.ab), ac = positive(p.ac), bc = positive(p.bc), pixels = through(bc, ac, ab);
    if (CELLS) {
        uvec2 ae = positive(p.ae), be = positive(p.be), ce = positive(p.ce);
        pixels |= through(be, ae, ab) | through(ce, ae, ac) | through(ce, be, bc);
    }
    return pixels;
}

// Whether a primitive does not lie before the eye as a whole.
bool reaches_behind_eye(Primitive p) {
    vec4 depth = vec4(p.a.z, p.b.z, p.c.z, CELLS ? p.e.z : p.c.z), w = push.w0 + push.w1 * depth;
    return min(min(w.x, w.y), min(w.z, w.w)) <= 0.0;
}

float side_at(Edge edge, vec2 pixel) {
    return edge.e + pixel.y * edge.dy + pixel.x * edge.dx;
}

// Returns depth and scalar where the line of a pixel meets the face of corners a, b and c, which turns left or right.
vec2 meet_at(vec2 pixel, Edge bc, Edge ac, Edge ab, bool left, vec4 a, vec4 b, vec4 c) {
    float turn = mix(-1.0, 1.0, left);
    vec3 aside = vec3(bc.aside, ac.aside, ab.aside);
    return on_face(side_at(bc, pixel), side_at(ac, pixel), side_at(ab, pixel), aside, a, b, c, turn);
}

// The line of a pixel that walks through faces, and what a meeting needs besides.
struct FaceLine {
    vec2 line, line0; // its own, and that of the tile's first pixel
    vec2 ws;          // w0 and w1: software rasterisers gather a push constant again whenever it is read
    uvec2 pixel;      // in the tile
};

FaceLine face_line(OwnPixel own) {
    uint number = gl_LocalInvocationIndex;
    return FaceLine(line_at(vec2(own.pixel) + 0.5), line_at(vec2(pixel_of(own.tile, 0u)) + 0.5), vec2(push.w0, push.w1),
                    uvec2(number % TILE, number / TILE));
}

uvec2 pair_bits(vec2 met, uint sides) {
    return uvec2(floatBitsToUint(met.x), (floatBitsToUint(met.y) & 0xfffffffcu) | sides);
}

// Returns depth and scalar of a face that covers a line, as bits, from the face's plane. Two bits of the scalar tell on which sides of the
// face there is a cell; SIDE_UNKNOWN: the line has to meet the corners.
uvec2 pair_of(uint id, FaceLine line) {
    FacePlane plane = unpacked_plane(planes[2u * id], planes[2u * id + 1u]);
    return pair_bits(meet_plane(plane, line.line, line.ws), plane.side);
}

// The same from the face's corners, for every face.
uvec2 pair_by_corners(uint id, FaceLine line, bool back_to_front) {
    Primitive p = primitive_of(id, line.line0);
    bool left = is_positive(p.bc, line.pixel);
    vec2 met = meet_at(vec2(line.pixel), p.bc, p.ac, p.ab, left, p.a, p.b, p.c);
    uint first = primitives[id * FACE_WORDS];
    bool ahead = (first & FACE_AHEAD) != 0u, behind = (first & FACE_BEHIND) != 0u;
    // The view's axes are left-handed, unless it mirrors: a face that turns counterclockwise has its normal along the line's way back.
    bool back = left != (push.aspect < 0.0), next = back ? behind : ahead, last = back ? ahead : behind;
    if (CELL_SCALARS) {
        // Back to front the line comes from behind.
        bool exists = back_to_front ? last : next, on_normal = back_to_front == back;
        uint entered = primitives[id * FACE_WORDS + (on_normal ? 3u : 4u)];
        met.y = exists ? mesh_scalars[entered] : 0.0;
    }
    return pair_bits(met, (last ? SIDE_BEFORE : 0u) | (next ? SIDE_BEHIND : 0u));
}

// Adds a face to a piece of a line, if the line passes through it.
void add_face(inout Piece piece, bool hit, vec2 met) {
    bool first = all(bvec2(hit, met.x < piece.d0)), last = all(bvec2(hit, met.x > piece.d1));
    piece.d0 = mix(piece.d0, met.x, first);
    piece.s0 = mix(piece.s0, met.y, first);
    piece.d1 = mix(piece.d1, met.x, last);
    piece.s1 = mix(piece.s1, met.y, last);
}

// The piece of a pixel's line inside a cell that covers the pixel: depths of its ends, then scalars.
vec4 piece_of(uint id, Primitive p, uvec2 number, vec2 line) {
    vec2 pixel = vec2(number);
    bool ab = is_positive(p.ab, number), ac = is_positive(p.ac, number), ae = is_positive(p.ae, number);
    bool bc = is_positive(p.bc, number), be = is_positive(p.be, number), ce = is_positive(p.ce, number);
    bool on_abc = passes_through(bc, ac, ab), on_abe = passes_through(be, ae, ab);
    bool on_ace = passes_through(ce, ae, ac), on_bce = passes_through(ce, be, bc);
    Piece piece = Piece(3e38, -3e38, 0.0, 0.0);
    add_face(piece, on_abc, meet_at(pixel, p.bc, p.ac, p.ab, bc, p.a, p.b, p.c));
    add_face(piece, on_abe, meet_at(pixel, p.be, p.ae, p.ab, be, p.a, p.b, p.e));
    add_face(piece, on_ace, meet_at(pixel, p.ce, p.ae, p.ac, ce, p.a, p.c, p.e));
    add_face(piece, on_bce, meet_at(pixel, p.ce, p.be, p.bc, ce, p.b, p.c, p.e));
    // Rounding at a corner has the line enter and never leave, or the other way round: it does so at the corner.
    vec4 corner = mix(mix(mix(p.a, p.b, bvec4(on_ace)), p.c, bvec4(on_abe)), p.e, bvec4(on_abc));
    vec2 aside = abs(corner_of(corner, line).at);
    bool once = uint(on_abc) + uint(on_abe) + uint(on_ace) + uint(on_bce) == 1u;
    bool touches = all(bvec2(once, max(aside.x, aside.y) < 1e-6)), before = corner.z < piece.d0;
    bool enters = all(bvec2(touches, before)), leaves = all(bvec2(touches, !before));
    piece.d0 = mix(piece.d0, corner.z, enters);
    piece.s0 = mix(piece.s0, corner.w, enters);
    piece.d1 = mix(piece.d1, corner.z, leaves);
    piece.s1 = mix(piece.s1, corner.w, leaves);
    // The line may begin inside.
    bool inside = piece.d0 < push.forward.w;
    float cut = clamp((push.forward.w - piece.d0) / max(piece.d1 - piece.d0, 1e-30), 0.0, 1.0);
    piece.s0 = mix(piece.s0, piece.s0 + (piece.s1 - piece.s0) * cut, inside);
    piece.d0 = mix(piece.d0, push.forward.w, inside);
    vec2 s = vec2(piece.s0, piece.s1);
    if (CELL_SCALARS) s = vec2(mesh_scalars[id]);
    return vec4(piece.d0, max(piece.d1, piece.d0), s);
}

#endif
