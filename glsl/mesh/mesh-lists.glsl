// entry compute POINTS
// entry compute BOXES
// entry compute LISTS
//
// The lists that techniques for meshes draw from: for each pixel the faces or cells that its line meets, in order of rank.
//
//   POINTS  one invocation a point: as the view sees it
//   BOXES   one invocation a primitive: the pixels that it may cover, and a key of visibility, the signed distance of its centroid
//           from the eye less the depth of the plane through the mesh's centre
//   LISTS   one invocation a tile, from its bin (bins.glsl): which pixels of the tile its primitives do cover, and where; counted, then written. No other
//           invocation has these pixels: ranks stay in order.
//
//   cost  LISTS finds the pixels of a tile that a primitive covers from where its edges cross rows, twice
//
// Where pixels were drawn otherwise and only those that are flagged need lists (FLAGGED), the others have none.
//
// What has no room is counted, and the frame repeated with more.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"
#include "mesh/mesh.glsl"
#include "shared/keys.glsl"

layout(constant_id = SPEC_CELLS) const bool CELLS = false;
layout(constant_id = SPEC_CELL_SCALARS) const bool CELL_SCALARS = false;
layout(constant_id = SPEC_BACK_TO_FRONT) const bool BACK_TO_FRONT = false;
layout(constant_id = SPEC_FILL) const bool FILL = false;
layout(constant_id = SPEC_FLAGGED) const bool FLAGGED = false;

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
    vec4 a = view_points[primitives[at]], b = view_points[primitives[at + 1u]], c = view_points[primitives[at + 2u]];
    vec4 e = CELLS ? view_points[primitives[at + 3u]] : c;
    vec2 half_size = push.half_extent * push.pixel;
    vec4 covered = vec4(half_size, -half_size);
    for (uint lobe = 0u; lobe < 2u; ++lobe) {
        // Cells behind the eye are not listed. Faces are: they tell whether the eye is inside the mesh.
        float front = lobe == 0u ? 1.0 : -1.0;
        if (lobe == 1u && (CELLS || push.w1 == 0.0)) break;
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
    bool there = all(lessThan(low, high));
    boxes[i] = there ? uvec2(low.x | high.x << 16, low.y | high.y << 16) : uvec2(0u);

    // dist - |z| without the difference.
    vec3 middle = CELLS ? (a.xyz + b.xyz + c.xyz + e.xyz) * 0.25 : (a.xyz + b.xyz + c.xyz) * (1.0 / 3.0);
    float r2 = dot(middle.xy, middle.xy), z = abs(middle.z - push.forward.w);
    float further = push.w1 == 0.0 ? 0.0 : r2 / max(sqrt(r2 + z * z) + z, 1e-30);
    float key = middle.z + (middle.z < push.forward.w ? -further : further);
    if (isnan(key)) atomicAdd(status[STATUS_NAN_KEYS], 1u);
    // What is not there goes last.
    sort_keys[i] = there ? float_key(BACK_TO_FRONT ? -key : key) : 0xffffffffu;
    order[i] = i;
}
#endif

#ifdef LISTS
layout(local_size_x = 8) in;
layout(set = 0, binding = BINDING_PRIMITIVES, std430) readonly buffer Primitives { uint primitives[]; };
layout(set = 0, binding = BINDING_MESH_SCALARS, std430) readonly buffer MeshScalars { float mesh_scalars[]; };
layout(set = 0, binding = BINDING_VIEW_POINTS, std430) readonly buffer ViewPoints { vec4 view_points[]; };
layout(set = 0, binding = BINDING_BOXES, std430) readonly buffer Boxes { uvec2 boxes[]; };
layout(set = 0, binding = BINDING_BIN_TABLE, std430) readonly buffer BinTable { uint bin_table[]; };
layout(set = 0, binding = BINDING_BINS, std430) readonly buffer Bins { uint bins[]; };
layout(set = 0, binding = BINDING_CURSORS, std430) buffer Cursors { uint cursors[]; };
layout(set = 0, binding = BINDING_LISTS, std430) writeonly buffer Lists { uvec2 lists[]; }; // a face's fragment in one, a cell's in two
layout(set = 0, binding = BINDING_STATUS, std430) buffer Status { uint status[]; };
layout(set = 0, binding = BINDING_FLAGS, std430) readonly buffer Flags { uint flags[]; };

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

// The pixels of the tile where the side is positive: a bit each, row by row. Where the edge crosses a row is computed once, so that what
// is not on one side is on the other.
uvec2 positive(Edge edge) {
    bool along = edge.dx == 0.0; // the row runs along the edge: all of it is on one side
    // A power of two, so that what is zero stays zero.
    float inverse = mix(-1.0 / edge.dx, -1.2676506e30, along);
    precise float e = edge.e + edge.aside;
    precise float from0 = e * inverse;
    precise float slope = edge.dy * inverse;
    uvec2 mask = uvec2(0u);
    for (int y = 0; y < TILE / 2; ++y) {
        precise vec2 from = fma(vec2(y, y + TILE / 2), vec2(slope), vec2(from0));
        uvec2 first = uvec2(ceil(min(max(from, 0.0), float(TILE))));
        mask |= (uvec2(0xffu) << first & 0xffu) << (8 * y);
    }
    return mix(mask, ~mask, bvec2(edge.dx < 0.0));
}

// The pixels whose lines pass through a face, turning one way or the other.
struct Cover {
    uvec2 left, right;
};

Cover cover(uvec2 bc, uvec2 ac, uvec2 ab) {
    return Cover(bc & ~ac & ab, ~bc & ac & ~ab);
}

// What a pixel's line meets on a face that it passes through: depth and scalar. Where it does so only when it is moved aside, that is
// where it does.
vec2 on_face(float bc, float ac, float ab, vec3 aside, vec4 a, vec4 b, vec4 c, float turn) {
    vec3 weight = vec3(bc, -ac, ab) * turn;
    bool passes = min(min(weight.x, weight.y), weight.z) >= 0.0;
    weight = max(mix(weight + vec3(aside.x, -aside.y, aside.z) * turn, weight, bvec3(passes)), 0.0);
    float sum = weight.x + weight.y + weight.z;
    weight = mix(vec3(1.0 / 3.0), weight / sum, bvec3(sum > 0.0));
    return vec2(weight.x * a.z + weight.y * b.z + weight.z * c.z, scalar_between(weight, a.w, b.w, c.w));
}

bool has(uvec2 mask, uint bit) {
    return (mix(mask.y, mask.x, bit < 32u) >> (bit & 31u) & 1u) != 0u;
}

// A face, or a cell, of which the face is one, as a tile sees it.
struct Primitive {
    vec4 a, b, c, e; // its corners in the view
    Edge ab, ac, bc, ae, be, ce;
    Cover abc, abe, ace, bce;
};

Primitive primitive_of(uint id, vec2 line0) {
    Primitive p;
    uint at = id * (CELLS ? CELL_WORDS : FACE_WORDS);
    p.a = view_points[primitives[at]];
    p.b = view_points[primitives[at + 1u]];
    p.c = view_points[primitives[at + 2u]];
    Corner a = corner_of(p.a, line0), b = corner_of(p.b, line0), c = corner_of(p.c, line0);
    p.ab = edge_of(a, b);
    p.ac = edge_of(a, c);
    p.bc = edge_of(b, c);
    uvec2 on_ab = positive(p.ab), on_ac = positive(p.ac), on_bc = positive(p.bc);
    p.abc = cover(on_bc, on_ac, on_ab);
    if (CELLS) {
        p.e = view_points[primitives[at + 3u]];
        Corner e = corner_of(p.e, line0);
        p.ae = edge_of(a, e);
        p.be = edge_of(b, e);
        p.ce = edge_of(c, e);
        uvec2 on_ae = positive(p.ae), on_be = positive(p.be), on_ce = positive(p.ce);
        p.abe = cover(on_be, on_ae, on_ab);
        p.ace = cover(on_ce, on_ae, on_ac);
        p.bce = cover(on_ce, on_be, on_bc);
    }
    return p;
}

uvec2 all_of(Cover there) {
    return there.left | there.right;
}

// The pixels of a tile in a primitive's box. It keeps out what is behind the eye, and the image's edge.
uvec2 pixels_of_box(uvec2 box, uvec2 origin) {
    uvec2 low = clamp(uvec2(box.x & 0xffffu, box.y & 0xffffu), origin, origin + TILE) - origin;
    uvec2 high = clamp(uvec2(box.x >> 16, box.y >> 16), origin, origin + TILE) - origin;
    uint columns = ((0xffu << low.x) & ~(0xffffu << high.x) & 0xffu) * 0x01010101u;
    // A bit a row, spread to a byte a row.
    uint row_bits = (0xffu << low.y) & ~(0xffffu << high.y) & 0xffu;
    uvec2 rows = (uvec2(row_bits & 15u, row_bits >> 4) * 0x204081u & 0x1010101u) * 0xffu;
    return rows & columns;
}

// The pixels of a tile that are to have lists.
uvec2 pixels_wanted(uint tile) {
    uvec2 wanted = uvec2(0u);
    uint flag = CELLS ? FLAG_OVERLAPS : FLAG_UNSORTED, at = tile * TILE_PIXELS;
    for (uint bit = 0u; bit < 32u; ++bit) {
        uvec2 word = uvec2(flags[at + bit], flags[at + bit + 32u]) & flag;
        wanted |= uvec2(notEqual(word, uvec2(0u))) << bit;
    }
    return wanted;
}

// Counters of all pixels, a bit of each in a mask.
uvec2 counts[COUNT_BITS];

// Counts pixels: adds with carry.
void count(uvec2 covered) {
    for (uint j = 0u; j < COUNT_BITS; ++j) {
        uvec2 carry = counts[j] & covered;
        counts[j] ^= covered;
        covered = carry;
    }
}

uint count_of(uint bit) {
    uint number = 0u;
    for (uint j = 0u; j < COUNT_BITS; ++j) number |= uint(has(counts[j], bit)) << j;
    return number;
}

float side_at(Edge edge, vec2 pixel) {
    return edge.e + pixel.y * edge.dy + pixel.x * edge.dx;
}

// Returns depth and scalar where the line of a pixel meets the face of corners a, b and c.
vec2 meet_at(uint bit, vec2 pixel, Edge bc, Edge ac, Edge ab, Cover abc, vec4 a, vec4 b, vec4 c) {
    float turn = mix(-1.0, 1.0, has(abc.left, bit));
    vec3 aside = vec3(bc.aside, ac.aside, ab.aside);
    return on_face(side_at(bc, pixel), side_at(ac, pixel), side_at(ab, pixel), aside, a, b, c, turn);
}

// Adds a face to a piece of a line.
void add_face(inout Piece piece, Cover there, uint bit, vec2 met) {
    bool hit = has(all_of(there), bit);
    bool first = all(bvec2(hit, met.x < piece.d0)), last = all(bvec2(hit, met.x > piece.d1));
    piece.d0 = mix(piece.d0, met.x, first);
    piece.s0 = mix(piece.s0, met.y, first);
    piece.d1 = mix(piece.d1, met.x, last);
    piece.s1 = mix(piece.s1, met.y, last);
}

// The piece of a pixel's line inside a cell.
Piece piece_of(Primitive p, uint bit, vec2 pixel, uvec2 origin) {
    Piece piece = Piece(3e38, -3e38, 0.0, 0.0);
    add_face(piece, p.abc, bit, meet_at(bit, pixel, p.bc, p.ac, p.ab, p.abc, p.a, p.b, p.c));
    add_face(piece, p.abe, bit, meet_at(bit, pixel, p.be, p.ae, p.ab, p.abe, p.a, p.b, p.e));
    add_face(piece, p.ace, bit, meet_at(bit, pixel, p.ce, p.ae, p.ac, p.ace, p.a, p.c, p.e));
    add_face(piece, p.bce, bit, meet_at(bit, pixel, p.ce, p.be, p.bc, p.bce, p.b, p.c, p.e));
    // Rounding at a corner has the line enter and never leave, or the other way round: it does so at the corner.
    bool on_abc = has(all_of(p.abc), bit), on_abe = has(all_of(p.abe), bit);
    bool on_ace = has(all_of(p.ace), bit), on_bce = has(all_of(p.bce), bit);
    vec4 corner = mix(mix(mix(p.a, p.b, bvec4(on_ace)), p.c, bvec4(on_abe)), p.e, bvec4(on_abc));
    vec2 aside = abs(corner_of(corner, line_at(vec2(origin) + 0.5 + pixel)).at);
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
    return piece;
}

// Writes the fragment of a cell: depths of its ends, then scalars.
void write_cell(uint slot, uint id, Piece piece) {
    vec2 s = vec2(piece.s0, piece.s1);
    if (CELL_SCALARS) s = vec2(mesh_scalars[id]);
    lists[2u * slot] = floatBitsToUint(vec2(piece.d0, max(piece.d1, piece.d0)));
    lists[2u * slot + 1u] = floatBitsToUint(s);
}

// Writes the fragment of a face: depth, then scalar, of which two bits tell on which sides there is a cell.
void write_face(uint slot, uint id, vec2 met, bool left) {
    uint ahead = primitives[id * FACE_WORDS + 3u], behind = primitives[id * FACE_WORDS + 4u];
    // The view's axes are left-handed: a face that turns counterclockwise has its normal along the line's way back.
    uint next = left ? behind : ahead, last = left ? ahead : behind;
    float s = met.y;
    if (CELL_SCALARS) {
        // Back to front the line comes from behind.
        uint entered = BACK_TO_FRONT ? last : next;
        s = entered != NO_CELL ? mesh_scalars[entered] : 0.0;
    }
    uint sides = uint(last != NO_CELL) | uint(next != NO_CELL) << 1;
    lists[slot] = uvec2(floatBitsToUint(met.x), (floatBitsToUint(s) & 0xfffffffcu) | sides);
}

void main() {
    uint in_band = INVOCATION.x, tile = push.band + in_band;
    if (in_band >= push.count) return;
    uvec2 origin = pixel_of(tile, 0u);
    vec2 line0 = line_at(vec2(origin) + 0.5);
    // After the bins are written, places are where runs end.
    uint begin = tile == 0u ? 0u : bin_table[tile * push.runs - 1u];
    uint bin_end = bin_table[tile * push.runs + push.runs - 1u];
    // All of it, also of what has no room.
    if (!FILL) atomicMax(status[STATUS_LONGEST_BIN], bin_end - begin);
    bin_end = min(bin_end, push.bins);
    uint first = min(begin + push.first, bin_end), end = min(bin_end, first + push.number);
    uvec2 wanted = uvec2(0xffffffffu);
    if (FLAGGED) wanted = pixels_wanted(tile);
    if ((wanted.x | wanted.y) == 0u) return;
    for (uint j = 0u; j < COUNT_BITS; ++j) counts[j] = uvec2(0u);

    uint lost = 0u, filled = 0u;
    for (uint i = first; i < end; ++i) {
        uint id = bins[i];
        Primitive primitive = primitive_of(id, line0);
        uvec2 covered = all_of(primitive.abc);
        if (CELLS) covered |= all_of(primitive.abe) | all_of(primitive.ace) | all_of(primitive.bce);
        covered &= pixels_of_box(boxes[id], origin) & wanted;
        if (!FILL) {
            count(covered);
            continue;
        }
        filled += uint(bitCount(covered.x) + bitCount(covered.y));
        for (uint turn = 0u; turn < TILE_PIXELS && (covered.x | covered.y) != 0u; ++turn) {
            bool lower = covered.x != 0u;
            uint word = mix(covered.y, covered.x, lower), bit = uint(findLSB(word)) + mix(32u, 0u, lower);
            covered = mix(uvec2(0u, word & word - 1u), uvec2(word & word - 1u, covered.y), bvec2(lower));
            vec2 pixel = vec2(bit % TILE, bit / TILE);
            uint slot = cursors[in_band * TILE_PIXELS + bit]++;
            if (slot >= push.capacity) {
                ++lost;
            } else if (CELLS) {
                write_cell(slot, id, piece_of(primitive, bit, pixel, origin));
            } else {
                vec2 met = meet_at(bit, pixel, primitive.bc, primitive.ac, primitive.ab, primitive.abc, primitive.a, primitive.b, primitive.c);
                write_face(slot, id, met, has(primitive.abc.left, bit));
            }
        }
    }
    if (!FILL) {
        for (uint bit = 0u; bit < TILE_PIXELS; ++bit) cursors[in_band * TILE_PIXELS + bit] += count_of(bit);
    }
    if (lost > 0u) atomicAdd(status[STATUS_LOST], lost);
    if (filled > 0u) atomicAdd(status[STATUS_FILLED], filled);
}
#endif
