// entry vertex VERTEX
// entry fragment INTERLOCK
// entry fragment IMPLEMENTATION
// entry compute EMPTY
//
// Hardware-assisted visibility sorting by rasterisation: each face is drawn once, in the order of ranks, and each of its fragments
// passes through the pixel's k-buffer, which is in four storage images.
//
//   VERTEX          one invocation a corner of a triangle that covers a face: reads which face has this rank, its corners and its plane
//   INTERLOCK       one invocation a fragment: reads the pixel's k-buffer, composites what leaves it, writes it back. Fragments of
//                   one pixel exclude each other and come in the order of primitives.
//   IMPLEMENTATION  the same without interlock, for drivers that are known to work so
//   EMPTY           one invocation a pixel: takes what is left out of the k-buffer
//
//   in    faces by rank (mesh-rank.glsl), transfer function or its table
//   out   accumulation image: premultiplied linear RGBA; for each pixel whether what left the k-buffer was not in order
//
// Rasterisers move corners to a grid, of 1/16 pixel at worst. If that decided which faces a line meets, it would meet some that it
// misses by a hair, at depths that say nothing of their order: with scalars of cells, a piece would get the scalar of a neighbour. So
// triangles reach a little further than faces, and the fragment decides as the lists do. Then a triangle need not be the face's
// projection either: what crosses the eye's plane is covered by its box, and what a line meets behind the eye, from which follows
// what it begins in, is drawn like everything else.
//
// Source: Callahan, Ikits, Comba and Silva, TVCG 11(3), 2005. What left last is kept as the pair after the window.
#version 460
#extension GL_GOOGLE_include_directive : require
#ifdef INTERLOCK
#extension GL_ARB_fragment_shader_interlock : require
#endif

#include "interface.glsl"
#include "mesh/cell-scalars.glsl"
#include "mesh/face-planes.glsl"
#include "shared/device.glsl"
#include "mesh/mesh.glsl"

#ifdef VERTEX
layout(set = 0, binding = BINDING_ORDER, std430) readonly buffer Order { uint order[]; };
layout(set = 0, binding = BINDING_BOXES, std430) readonly buffer Boxes { uvec2 boxes[]; };
layout(set = 0, binding = BINDING_PRIMITIVES, std430) readonly buffer Primitives { uint primitives[]; };
layout(set = 0, binding = BINDING_VIEW_POINTS, std430) readonly buffer ViewPoints { vec4 view_points[]; };
layout(set = 0, binding = BINDING_MESH_SCALARS, std430) readonly buffer MeshScalars { float mesh_scalars[]; };
layout(set = 0, binding = BINDING_PLANES, std430) readonly buffer Planes { vec4 planes[]; };

layout(location = 0) flat out vec4 corner_0;
layout(location = 1) flat out vec4 corner_1;
layout(location = 2) flat out vec4 corner_2;
layout(location = 3) flat out vec2 cells; // scalars of the cells ahead and behind
layout(location = 4) flat out uint sides; // 1: there is a cell ahead, 2: behind
layout(location = 5) flat out vec4 place_of_plane; // as stored
layout(location = 6) flat out vec4 change_of_plane;

// How far beyond a face its triangle reaches, in pixels: rounding to the coarsest grid that is allowed moves it by half of that.
const float REACH = 0.0625;
// Corners further from the image's centre, in pixels, lose the digits for that.
const float FAR = 32768.0;

// Corner `which` of the triangle p0 p1 p2 with each side moved outwards.
vec2 grown(vec2 p0, vec2 p1, vec2 p2, uint which) {
    vec2 a = p1 - p0, b = p2 - p1, c = p0 - p2;
    float aa = length(a), bb = length(b), cc = length(c);
    float way = a.x * b.y - a.y * b.x < 0.0 ? -1.0 : 1.0;
    vec2 na = vec2(a.y, -a.x) * (way / aa), nb = vec2(b.y, -b.x) * (way / bb), nc = vec2(c.y, -c.x) * (way / cc);
    vec3 angles = 1.0 + vec3(dot(nc, na), dot(na, nb), dot(nb, nc));
    // Not with sharp corners, which would move far, nor with sides without a direction.
    if (all(greaterThan(angles, vec3(0.02)))) {
        if (which == 0u) return p0 + (nc + na) * (REACH / angles.x);
        if (which == 1u) return p1 + (na + nb) * (REACH / angles.y);
        return p2 + (nb + nc) * (REACH / angles.z);
    }
    // Along the longest side lies a rectangle around it; the triangle of twice its sides.
    vec2 from = aa >= max(bb, cc) ? p0 : bb >= cc ? p1 : p2;
    vec2 side = aa >= max(bb, cc) ? a : bb >= cc ? b : c;
    vec2 other = (aa >= max(bb, cc) ? p2 : bb >= cc ? p0 : p1) - from;
    float len = max(aa, max(bb, cc));
    vec2 u = len > 0.0 ? side / len : vec2(1.0, 0.0);
    vec2 n = vec2(-u.y, u.x);
    float height = dot(other, n);
    if (height < 0.0) n = -n;
    vec2 corner = from - REACH * (u + n);
    if (which == 1u) corner += u * (2.0 * len + 4.0 * REACH);
    if (which == 2u) corner += n * (2.0 * abs(height) + 4.0 * REACH);
    return corner;
}

void main() {
    uint vertex = uint(gl_VertexIndex), which = vertex % 3u;
    uint id = order[vertex / 3u];
    uint at = id * FACE_WORDS;
    uint first = primitives[at];
    corner_0 = view_points[first & ~(FACE_AHEAD | FACE_BEHIND)];
    corner_1 = view_points[primitives[at + 1u]];
    corner_2 = view_points[primitives[at + 2u]];
    bvec2 there_are = cells_at_face(first);
    sides = uint(there_are.x) | uint(there_are.y) << 1;
    cells = vec2(0.0);
    if (CELL_SCALARS) {
        uint mirrored = push.aspect < 0.0 ? 1u : 0u;
        cells.x = there_are.x ? mesh_scalars[primitives[at + 3u + mirrored]] : 0.0;
        cells.y = there_are.y ? mesh_scalars[primitives[at + 4u - mirrored]] : 0.0;
    }
    place_of_plane = BY_PLANES ? planes[2u * id] : vec4(0.0);
    change_of_plane = BY_PLANES ? planes[2u * id + 1u] : vec4(0.0);
    uvec2 box = boxes[id];
    vec3 w = push.w0 + push.w1 * vec3(corner_0.z, corner_1.z, corner_2.z);
    bool before = all(greaterThan(w, vec3(0.0))), after = all(lessThan(w, vec3(0.0)));
    bool there = box != uvec2(0u) && !(after && push.number == 1u);
    // Places in the image, pixels from its centre.
    vec3 x = vec3(corner_0.x, corner_1.x, corner_2.x) / (w * push.pixel), y = vec3(corner_0.y, corner_1.y, corner_2.y) / (w * -push.pixel);
    vec2 place;
    if ((before || after) && all(lessThan(abs(x), vec3(FAR))) && all(lessThan(abs(y), vec3(FAR)))) {
        place = grown(vec2(x.x, y.x), vec2(x.y, y.y), vec2(x.z, y.z), which);
    } else {
        vec2 low = vec2(box.x & 0xffffu, box.y & 0xffffu), high = vec2(box.x >> 16, box.y >> 16);
        place = low - push.half_extent;
        if (which == 1u) place.x += 2.0 * (high.x - low.x);
        if (which == 2u) place.y += 2.0 * (high.y - low.y);
    }
    // What is not there is beyond the far plane.
    gl_Position = there ? vec4(place / push.half_extent, 0.5, 1.0) : vec4(0.0, 0.0, 2.0, 1.0);
}
#else

#include "shared/optics.glsl"
#include "shared/segments.glsl"
#include "mesh/mesh-segments.glsl"
#include "mesh/sweep-images.glsl"

layout(set = 0, binding = BINDING_FLAGS, std430) coherent buffer Flags { uint flags[]; };

// The word of a pixel, as the lists have it: tile by tile.
uint word_of(uvec2 pixel) {
    uvec2 tile = pixel / TILE, inner = pixel % TILE;
    return (tile.y * tiles_across() + tile.x) * TILE_PIXELS + inner.y * TILE + inner.x;
}

#ifdef EMPTY
layout(local_size_x = TILE_PIXELS) in;
layout(set = 0, binding = BINDING_STATUS, std430) buffer Status { uint status[]; };

void main() {
    uint tile = WORKGROUP_NUMBER;
    if (tile >= push.count) return;
    uvec2 place = pixel_of(tile, gl_LocalInvocationIndex);
    if (any(greaterThanEqual(vec2(place), 2.0 * push.half_extent))) return;
    load_segments(push.knots);
    uint knots = push.knots;
    float world = length_of_depth(line_at(vec2(place) + 0.5));
    uint word = word_of(place);
    Sweep sweep = load_sweep(ivec2(place), unpack_state(flags[word]));
    float opaque = BACK_TO_FRONT ? 2.0 : 1.0 - push.opaque; // from behind a line does not end
    Pending pending;
    begin_segment(pending, sweep.end, sweep.end, 0.0, 0.0);
    uint j = 0u;
    while ((j < K || pending.len > 0.0) && sweep.sum.a < opaque) {
        if (pending.len == 0.0) {
            // What is greater than all lets the least out.
            leave(sweep, pending, pass_through(Pair(EVERYTHING, 0u)), drawn_depths(place), world);
            ++j;
        }
        if (pending.len > 0.0) take_piece(sweep.sum, pending, BACK_TO_FRONT, knots);
    }
    bool over = overlaps(sweep, opaque);
    flags[word] = (sweep.state.unsorted ? FLAG_UNSORTED : 0u) | (over ? FLAG_OVERLAPS : 0u);
    if (over) atomicAdd(status[STATUS_OVERLAPS], 1u);
    if (sweep.state.unsorted) atomicAdd(status[STATUS_OVERFLOW_PIXELS], 1u);
    imageStore(accumulation, ivec2(place), sweep.sum);
}
#else

layout(location = 0) flat in vec4 corner_0;
layout(location = 1) flat in vec4 corner_1;
layout(location = 2) flat in vec4 corner_2;
layout(location = 3) flat in vec2 cells;
layout(location = 4) flat in uint sides;
layout(location = 5) flat in vec4 place_of_plane;
layout(location = 6) flat in vec4 change_of_plane;

#ifdef INTERLOCK
layout(pixel_interlock_ordered) in;
#endif

// On which side of an edge the line passes, as `side_of`; decided for the line moved aside, as the lists have it.
struct Side {
    float size, aside;
    bool positive;
};

Side side(Corner a, Corner b) {
    precise float p = a.at.x * b.at.y;
    precise float q = a.at.y * b.at.x;
    precise float size = p - q;
    float aside = aside_of(a.at, b.at);
    return Side(size, aside, size + aside > 0.0);
}

// Where the pixel's line meets the face; nothing where it does not.
Pair arrival(vec2 line) {
    Corner a = corner_of(corner_0, line), b = corner_of(corner_1, line), c = corner_of(corner_2, line);
    Side ab = side(a, b), bc = side(b, c), ac = side(a, c);
    bool left = bc.positive && !ac.positive && ab.positive, right = !bc.positive && ac.positive && !ab.positive;
    float turn = left ? 1.0 : -1.0;
    vec3 weight = vec3(bc.size, -ac.size, ab.size) * turn;
    bool passes = min(min(weight.x, weight.y), weight.z) >= 0.0;
    weight = max(passes ? weight : weight + vec3(bc.aside, -ac.aside, ab.aside) * turn, 0.0);
    float sum = weight.x + weight.y + weight.z;
    weight = sum > 0.0 ? weight / sum : vec3(1.0 / 3.0);
    float d = dot(weight, vec3(a.d, b.d, c.d)), s = scalar_between(weight, a.s, b.s, c.s);
    FacePlane plane = unpacked_plane(place_of_plane, change_of_plane);
    if (BY_PLANES && plane.side != SIDE_UNKNOWN) {
        vec2 met = meet_plane(plane, line, vec2(push.w0, push.w1));
        d = met.x;
        s = met.y;
    }
    // Outside of the mesh a line begins with nothing behind it.
    if (!(left || right) || (push.number == 1u && d < push.forward.w)) return Pair(NOTHING, 0u);
    // The view's axes are left-handed: a face that turns counterclockwise has its normal along the line's way back.
    bool ahead_next = turn < 0.0;
    uint next = ahead_next ? sides & 1u : sides >> 1, last = ahead_next ? sides >> 1 : sides & 1u;
    if (CELL_SCALARS) {
        float s_next = ahead_next ? cells.x : cells.y, s_last = ahead_next ? cells.y : cells.x;
        // Back to front the line comes from behind.
        s = BACK_TO_FRONT ? s_last : s_next;
    }
    return Pair(BACK_TO_FRONT ? -d : d, (floatBitsToUint(s) & 0xfffffffcu) | last | next << 1);
}

void main() {
    load_segments(push.knots);
    uint knots = push.knots;
    vec2 line = line_at(gl_FragCoord.xy);
    float world = length_of_depth(line);
    Pair pair = arrival(line);
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    uint word = word_of(uvec2(pixel));
    float opaque = BACK_TO_FRONT ? 2.0 : 1.0 - push.opaque; // from behind a line does not end
#ifdef INTERLOCK
    beginInvocationInterlockARB();
#endif
    Sweep sweep = load_sweep(pixel, unpack_state(flags[word]));
    if (pair.at != NOTHING && sweep.sum.a < opaque) {
        Pending pending;
        begin_segment(pending, sweep.end, sweep.end, 0.0, 0.0);
        leave(sweep, pending, pass_through(pair), drawn_depths(uvec2(pixel)), world);
        while (pending.len > 0.0 && sweep.sum.a < opaque) take_piece(sweep.sum, pending, BACK_TO_FRONT, knots);
        store_window(pixel, sweep.last);
        imageStore(accumulation, pixel, sweep.sum);
        sweep.state.begun = true;
        flags[word] = pack_state(sweep.state);
    }
#ifdef INTERLOCK
    endInvocationInterlockARB();
#endif
}
#endif
#endif
