// Tetrahedral meshes in the coordinates of a view, and where a pixel's line meets their faces and cells.
//
// A point is (X, Y, d, s): offsets to the right and up from the ray of the image's middle, depth relative to the mesh's centre, scalar; lengths
// in radii of the mesh, so that neither a far eye nor the world's unit costs digits. A pixel's line passes (P w, d) with w = w0 +
// w1 d: w is 1 for parallel rays, else proportional to the depth before the eye. Seen from the line a point lies at the offset a =
// (X, Y) - w P, and the line passes between two of them on the side that the sign of a x b tells: the same number for all faces
// that share the edge, so that they neither overlap nor leave gaps. The three numbers of a face, if their signs agree, are
// its barycentric coordinates on the line, perspective included (Olano and Greer, 1997); points behind the eye need no case
// of their own. Where a face's plane tells its place well, covered pixels are met by it (face-planes.glsl) instead.
#ifndef MESH_GLSL
#define MESH_GLSL

#include "interface.glsl"
#include "shared/integers.glsl"
#include "shared/straight.glsl"

layout(push_constant) uniform MeshPush {
    vec4 right;       // X of a point: dot of xyz with it, + w
    vec4 up;          // Y
    vec4 forward;     // d; w: depth of the eye, where lines begin
    vec2 half_extent; // of the image, pixels
    float pixel;      // change of P from pixel to pixel
    float w0, w1;
    float slope;      // tangent of the angle between line and axis, for a unit of P
    float unit;       // radius of the mesh, world units
    uint count;       // primitives, or points
    uint first;       // of what this dispatch does; of lists the first tile
    uint number;      // of what it does; of lists 1 to add to what was counted before
    uint capacity;    // entries that a list has room for
    uint band;        // first tile of the band
    uint knots;
    float opaque;     // transmittance at which a line ends
    float smoke;      // extinction per scalar of the smoke model
    float alike;      // scalars this far apart show the same
    uint last_round;  // repair: 1 in the last round, whose unsorted pixels count
    float aspect;     // offsets of X, Y and depth from the eye are (X aspect + skew.x depth, Y + skew.y depth, depth) at right angles
    vec2 skew;        // 0 for parallel rays
} push;

// Whether there is a cell that a face's normal points to, and one on the other side, as the view sees them: a mirrored view has them the
// other way round.
bvec2 cells_at_face(uint first) {
    bvec2 there = bvec2((first & FACE_AHEAD) != 0u, (first & FACE_BEHIND) != 0u);
    return push.aspect < 0.0 ? there.yx : there;
}

// Tiles in a row of the image.
uint tiles_across() {
    return (uint(2.0 * push.half_extent.x) + TILE - 1u) / TILE;
}

// The pixel with a number in a tile, row by row. It may lie beyond the image's edge.
uvec2 pixel_of(uint tile, uint number) {
    uint across = tiles_across(), row = quotient(tile, across);
    return uvec2(tile - row * across, row) * TILE + uvec2(number % TILE, number / TILE);
}

// A line: the place of a pixel's centre.
vec2 line_at(vec2 pixel) {
    return vec2(pixel.x - push.half_extent.x, push.half_extent.y - pixel.y) * push.pixel;
}

// An offset from the eye, or along a line, in right-angled coordinates.
vec3 straight(vec3 v) {
    return straight(v, push.aspect, push.skew);
}

// By how much a place (X, Y, d) is farther from the eye than its plane of equal depth; 0 for parallel rays.
float further_of(vec3 place) {
    return push.w1 == 0.0 ? 0.0 : further_than_deep(straight(vec3(place.xy, place.z - push.forward.w)));
}

// World length of a unit of depth along a line.
float length_of_depth(vec2 line) {
    vec2 t = straight(vec3(line * push.slope, 1.0)).xy;
    return sqrt(1.0 + dot(t, t)) * push.unit;
}

// The step by which lines are moved aside to tell sides: more than places are rounded by, and along no line that meshes are likely to
// have. Lines that pass through corners and edges, as they do where a camera looks along the axes of a lattice, so pass all cells
// there on one side, of which rounding alone would not make sure.
const vec2 ASIDE = vec2(4e-7, 1.5e-7);

// By how much the side of an edge is greater for the line moved aside.
float aside_of(vec2 a, vec2 b) {
    precise vec2 along = b - a;
    precise float step = ASIDE.y * along.x - ASIDE.x * along.y;
    return step;
}

// On which side of the edge a-b the line passes. `a` is the corner of the lower index: both faces of an edge must compute the same.
// A line through the edge is taken for one beside it, the same for all.
float side_of(vec2 a, vec2 b) {
    precise float p = a.x * b.y;
    precise float q = a.y * b.x;
    precise float side = p - q;
    return side != 0.0 ? side : aside_of(a, b);
}

// What depths may be apart by rounding, in radii of the mesh.
const float ROUNDING = 2e-6;

// What a line has of a corner.
struct Corner {
    vec2 at;
    float w;
    float d;
    float s;
};

Corner corner_of(vec4 point, vec2 line) {
    precise float w = push.w0 + push.w1 * point.z;
    precise vec2 at = point.xy - w * line;
    return Corner(at, w, point.z, point.w);
}

// Where a line meets a face; `hit` is 0 where it does not, else the sign of the face's turn as the view sees it.
struct Hit {
    float hit;
    float d;
    float s;
};

// Three scalars by weights that sum to 1. Equal ones stay equal: they may lie on a jump.
float scalar_between(vec3 weight, float a, float b, float c) {
    precise float up = weight.y * (b - a) + weight.z * (c - a);
    return a + up;
}

Hit meet(float e0, float e1, float e2, Corner a, Corner b, Corner c) {
    bool inside = (e0 > 0.0 && e1 > 0.0 && e2 > 0.0) || (e0 < 0.0 && e1 < 0.0 && e2 < 0.0);
    float sum = e0 + e1 + e2;
    float scale = 1.0 / (inside ? sum : 1.0);
    vec3 weight = vec3(e0, e1, e2) * scale;
    Hit hit;
    hit.hit = inside ? (sum > 0.0 ? 1.0 : -1.0) : 0.0;
    hit.d = dot(weight, vec3(a.d, b.d, c.d));
    hit.s = scalar_between(weight, a.s, b.s, c.s);
    return hit;
}

// The piece of a line inside a cell: depths and scalars of its ends, front first. Empty (d1 <= d0) where it misses.
struct Piece {
    float d0, d1, s0, s1;
};

void take(inout Piece piece, Hit hit) {
    if (hit.hit != 0.0 && hit.d < piece.d0) {
        piece.d0 = hit.d;
        piece.s0 = hit.s;
    }
    if (hit.hit != 0.0 && hit.d > piece.d1) {
        piece.d1 = hit.d;
        piece.s1 = hit.s;
    }
}

// Middle of a piece as lists have it, in the direction of ranks. It tells pieces apart whose ends meet within rounding.
float middle_of(vec4 piece, bool back_to_front) {
    return (piece.x + piece.y) * (back_to_front ? -0.5 : 0.5);
}

// A cell of corners with ascending indices, before the eye.
Piece meet_cell(vec4 p0, vec4 p1, vec4 p2, vec4 p3, vec2 line) {
    Corner a = corner_of(p0, line), b = corner_of(p1, line), c = corner_of(p2, line), e = corner_of(p3, line);
    float ab = side_of(a.at, b.at), ac = side_of(a.at, c.at), ae = side_of(a.at, e.at);
    float bc = side_of(b.at, c.at), be = side_of(b.at, e.at), ce = side_of(c.at, e.at);
    Piece piece = Piece(3e38, -3e38, 0.0, 0.0);
    take(piece, meet(bc, -ac, ab, a, b, c));
    take(piece, meet(be, -ae, ab, a, b, e));
    take(piece, meet(ce, -ae, ac, a, c, e));
    take(piece, meet(ce, -be, bc, b, c, e));
    if (piece.d0 < push.forward.w) {
        // The line begins inside.
        float x = clamp((push.forward.w - piece.d0) / max(piece.d1 - piece.d0, 1e-30), 0.0, 1.0);
        piece.s0 += (piece.s1 - piece.s0) * x;
        piece.d0 = push.forward.w;
    }
    return piece;
}

#endif
