// entry compute POINTS
// entry compute BOXES
// entry compute LISTS
//
// The lists that techniques for meshes draw from: for each pixel the faces or cells that its line meets, in order of rank.
//
//   POINTS  one invocation a point: as the view sees it
//   BOXES   one invocation a primitive: the pixels that it may cover, and a key of visibility, the signed distance of its centroid
//           from the eye less that of the mesh's centre
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
    uint i = gl_GlobalInvocationID.x + gl_GlobalInvocationID.y * (gl_NumWorkGroups.x * 64u);
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
    uint i = gl_GlobalInvocationID.x + gl_GlobalInvocationID.y * (gl_NumWorkGroups.x * 64u);
    if (i >= push.count) return;
    uint at = i * (CELLS ? CELL_WORDS : FACE_WORDS);
    vec4 a = view_points[primitives[at]], b = view_points[primitives[at + 1u]], c = view_points[primitives[at + 2u]];
    vec4 e = CELLS ? view_points[primitives[at + 3u]] : c;
    vec2 half_size = push.half_extent * push.pixel;
    vec4 covered = vec4(half_size, -half_size);
    for (uint lobe = 0u; lobe < 2u; ++lobe) {
        // Lines have no other side of cells; of faces they have, from which what lies around the eye follows.
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
    float inverse = along ? -1.2676506e30 : -1.0 / edge.dx;
    precise float e = edge.e + edge.aside;
    precise float from0 = e * inverse;
    precise float slope = edge.dy * inverse;
    ivec2 mask = ivec2(0);
    for (int y = 0; y < TILE; ++y) {
        precise float from = fma(float(y), slope, from0);
        int first = int(ceil(min(max(from, 0.0), float(TILE))));
        if (y < 4) mask.x |= (0xff << first & 0xff) << (8 * y); else mask.y |= (0xff << first & 0xff) << (8 * y - 32);
    }
    return uvec2(edge.dx < 0.0 ? ~mask : mask);
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
    weight = max(passes ? weight : weight + vec3(aside.x, -aside.y, aside.z) * turn, 0.0);
    float sum = weight.x + weight.y + weight.z;
    weight = sum > 0.0 ? weight / sum : vec3(1.0 / 3.0);
    return vec2(weight.x * a.z + weight.y * b.z + weight.z * c.z, scalar_between(weight, a.w, b.w, c.w));
}

bool has(uvec2 mask, uint bit) {
    return ((bit < 32u ? mask.x >> bit : mask.y >> (bit - 32u)) & 1u) != 0u;
}

// Adds a face to a piece of a line.
void add_face(inout Piece piece, Cover there, uint bit, vec2 met) {
    bool hit = has(there.left | there.right, bit);
    bool first = hit && met.x < piece.d0, last = hit && met.x > piece.d1;
    piece.d0 = first ? met.x : piece.d0;
    piece.s0 = first ? met.y : piece.s0;
    piece.d1 = last ? met.x : piece.d1;
    piece.s1 = last ? met.y : piece.s1;
}

void main() {
    uint in_band = gl_GlobalInvocationID.x;
    uint tile = push.band + in_band, runs = push.runs, capacity = push.capacity;
    if (in_band >= push.count) return;
    uvec2 origin = pixel_of(tile, 0u);
    vec2 line0 = line_at(vec2(origin) + 0.5);
    // After the bins are written, places are where runs end.
    uint begin = tile == 0u ? 0u : bin_table[tile * runs - 1u];
    uint bin_end = bin_table[tile * runs + runs - 1u];
    // All of it, also of what has no room.
    if (!FILL && push.first == 0u) atomicMax(status[STATUS_LONGEST_BIN], bin_end - begin);
    bin_end = min(bin_end, push.bins);
    uint first = min(begin + push.first, bin_end), end = min(bin_end, first + push.number);
    uint lost = 0u;
    uvec2 wanted = uvec2(0xffffffffu);
    if (FLAGGED) {
        wanted = uvec2(0u);
        for (uint bit = 0u; bit < TILE_PIXELS; ++bit) {
            uint flag = uint((flags[tile * TILE_PIXELS + bit] & (CELLS ? FLAG_OVERLAPS : FLAG_UNSORTED)) != 0u) << (bit & 31u);
            if (bit < 32u) wanted.x |= flag; else wanted.y |= flag;
        }
        if ((wanted.x | wanted.y) == 0u) return;
    }
    // Counters of all pixels, a bit of each in a mask: to count is to add with carry.
    uvec2 counts[COUNT_BITS];
    for (uint j = 0u; j < COUNT_BITS; ++j) counts[j] = uvec2(0u);

    for (uint i = first; i < end; ++i) {
        uint id = bins[i];
        uvec2 box = boxes[id];
        uint at = id * (CELLS ? CELL_WORDS : FACE_WORDS);
        vec4 pa = view_points[primitives[at]], pb = view_points[primitives[at + 1u]], pc = view_points[primitives[at + 2u]], pe = pc;
        Corner a = corner_of(pa, line0), b = corner_of(pb, line0), c = corner_of(pc, line0), e;
        Edge ab = edge_of(a, b), ac = edge_of(a, c), bc = edge_of(b, c), ae, be, ce;
        uvec2 on_ab = positive(ab), on_ac = positive(ac), on_bc = positive(bc), on_ae, on_be, on_ce;
        Cover abc = cover(on_bc, on_ac, on_ab), abe, ace, bce;
        uvec2 covered = abc.left | abc.right;
        if (CELLS) {
            pe = view_points[primitives[at + 3u]];
            e = corner_of(pe, line0);
            ae = edge_of(a, e);
            be = edge_of(b, e);
            ce = edge_of(c, e);
            on_ae = positive(ae);
            on_be = positive(be);
            on_ce = positive(ce);
            abe = cover(on_be, on_ae, on_ab);
            ace = cover(on_ce, on_ae, on_ac);
            bce = cover(on_ce, on_be, on_bc);
            covered |= abe.left | abe.right | ace.left | ace.right | bce.left | bce.right;
        }
        // The box keeps out what is behind the eye, and the image's edge.
        uvec2 low = clamp(uvec2(box.x & 0xffffu, box.y & 0xffffu), origin, origin + TILE) - origin;
        uvec2 high = clamp(uvec2(box.x >> 16, box.y >> 16), origin, origin + TILE) - origin;
        uint columns = ((0xffu << low.x) & ~(0xffffu << high.x) & 0xffu) * 0x01010101u;
        uvec2 rows = uvec2(low.y < 4u ? 0xffffffffu << (8u * low.y) : 0u, 0xffffffffu << (8u * max(low.y, 4u) - 32u));
        rows &= uvec2(high.y >= 4u ? 0xffffffffu : ~(0xffffffffu << (8u * high.y)),
                      high.y >= 8u ? 0xffffffffu : ~(0xffffffffu << (8u * max(high.y, 4u) - 32u)));
        // A shift by a whole word is none.
        if (low.y >= 8u) rows.y = 0u;
        covered &= rows & columns & wanted;

        if (!FILL) {
            uvec2 carry = covered;
            for (uint j = 0u; j < COUNT_BITS; ++j) {
                uvec2 both = counts[j] & carry;
                counts[j] ^= carry;
                carry = both;
            }
            continue;
        }
        uint ahead = 0u, behind = 0u;
        if (!CELLS) {
            ahead = primitives[at + 3u];
            behind = primitives[at + 4u];
        }
        for (uint turn = 0u; turn < TILE_PIXELS && (covered.x | covered.y) != 0u; ++turn) {
            uint bit = covered.x != 0u ? uint(findLSB(covered.x)) : 32u + uint(findLSB(covered.y));
            if (covered.x != 0u) covered.x &= covered.x - 1u; else covered.y &= covered.y - 1u;
            float x = float(bit % TILE), y = float(bit / TILE);
            uint pixel = in_band * TILE_PIXELS + bit;
            uint slot = cursors[pixel];
            cursors[pixel] = slot + 1u;
            bool fits = slot < capacity;
            lost += uint(!fits);
            float side_ab = ab.e + y * ab.dy + x * ab.dx, side_ac = ac.e + y * ac.dy + x * ac.dx, side_bc = bc.e + y * bc.dy + x * bc.dx;
            float turn_abc = has(abc.left, bit) ? 1.0 : -1.0;
            vec2 met = on_face(side_bc, side_ac, side_ab, vec3(bc.aside, ac.aside, ab.aside), pa, pb, pc, turn_abc);
            if (CELLS) {
                float side_ae = ae.e + y * ae.dy + x * ae.dx, side_be = be.e + y * be.dy + x * be.dx, side_ce = ce.e + y * ce.dy + x * ce.dx;
                Piece piece = Piece(3e38, -3e38, 0.0, 0.0);
                add_face(piece, abc, bit, met);
                add_face(piece, abe, bit, on_face(side_be, side_ae, side_ab, vec3(be.aside, ae.aside, ab.aside), pa, pb, pe, has(abe.left, bit) ? 1.0 : -1.0));
                add_face(piece, ace, bit, on_face(side_ce, side_ae, side_ac, vec3(ce.aside, ae.aside, ac.aside), pa, pc, pe, has(ace.left, bit) ? 1.0 : -1.0));
                add_face(piece, bce, bit, on_face(side_ce, side_be, side_bc, vec3(ce.aside, be.aside, bc.aside), pb, pc, pe, has(bce.left, bit) ? 1.0 : -1.0));
                bool on_abc = has(abc.left | abc.right, bit), on_abe = has(abe.left | abe.right, bit);
                bool on_ace = has(ace.left | ace.right, bit), on_bce = has(bce.left | bce.right, bit);
                if (uint(on_abc) + uint(on_abe) + uint(on_ace) + uint(on_bce) == 1u) {
                    // Rounding at a corner has the line enter and never leave, or the other way round: it does so at the corner.
                    vec4 corner = on_abc ? pe : on_abe ? pc : on_ace ? pb : pa;
                    vec2 aside = abs(corner_of(corner, line_at(vec2(origin) + 0.5 + vec2(x, y))).at);
                    if (max(aside.x, aside.y) < 1e-6) {
                        bool before = corner.z < piece.d0;
                        if (before) piece.d0 = corner.z; else piece.d1 = corner.z;
                        if (before) piece.s0 = corner.w; else piece.s1 = corner.w;
                    }
                }
                if (piece.d0 < push.forward.w) {
                    // The line begins inside.
                    float cut = clamp((push.forward.w - piece.d0) / max(piece.d1 - piece.d0, 1e-30), 0.0, 1.0);
                    piece.s0 += (piece.s1 - piece.s0) * cut;
                    piece.d0 = push.forward.w;
                }
                vec2 s = vec2(piece.s0, piece.s1);
                if (CELL_SCALARS) s = vec2(mesh_scalars[id]);
                if (fits) {
                    lists[2u * slot] = floatBitsToUint(vec2(piece.d0, max(piece.d1, piece.d0)));
                    lists[2u * slot + 1u] = floatBitsToUint(s);
                }
            } else {
                // The view's axes are left-handed: a face that turns counterclockwise has its normal along the line's way back.
                uint next = turn_abc < 0.0 ? ahead : behind, last = turn_abc < 0.0 ? behind : ahead;
                float s = met.y;
                if (CELL_SCALARS) {
                    // Back to front the line comes from behind.
                    uint entered = BACK_TO_FRONT ? last : next;
                    s = entered != NO_CELL ? mesh_scalars[entered] : 0.0;
                }
                // Two bits of the scalar tell on which sides there is a cell.
                uint sides = uint(last != NO_CELL) | uint(next != NO_CELL) << 1;
                if (fits) {
                    lists[slot] = uvec2(floatBitsToUint(met.x), (floatBitsToUint(s) & 0xfffffffcu) | sides);
                }
            }
        }
    }
    if (!FILL) {
        for (uint bit = 0u; bit < TILE_PIXELS; ++bit) {
            uint count = 0u;
            for (uint j = 0u; j < COUNT_BITS; ++j) count |= ((bit < 32u ? counts[j].x >> bit : counts[j].y >> (bit - 32u)) & 1u) << j;
            cursors[in_band * TILE_PIXELS + bit] += count;
        }
    }
    if (lost > 0u) atomicAdd(status[STATUS_LOST], lost);
}
#endif
