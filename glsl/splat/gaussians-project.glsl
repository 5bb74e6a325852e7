// entry compute COMPUTE
//
// Trained splats as a view sees them: the pixels that each may cover, its key in the order of blending, and the record that is drawn.
//
//   COMPUTE  one invocation a splat
//
//   in    splats as resident/splats/trained.rs packs them, coefficients of their harmonics
//   out   boxes of pixels, keys, records
//
// A record holds a place of the image u, in pixels from its middle, y down, and with d = pixel - u the squared distance to the splat
//
//     D² = |L d|² / W,    L = (l.x l.y; 0 l.z),    W = 1 + 2 b·f + f' C f,    f = pixel - r.
//
// Rules of the image (KHR, INRIA, ANTIALIASED) have W = 1: L is a root of the inverse of the affine image A A' of M = R diag(s), whose
// determinant is a sum of squared minors. The entries of the inverse itself would cancel for splats that are long and thin. By RULE_RAY D is
// the distance of a pixel's line to the splat in units of M, exact: there the line through the eye and u goes through the centre c, so that p × w
// has no constant term, and nothing cancels. W is w² over that at the place r, which is u, or where u lies far from the image a place nearer to it:
// from far away W would cancel. With U = R' and the cofactors K = diag(sy sz, sx sz, sx sy) U, which need no inverse of a flat splat, the line
// along v at r, the view's axes e, and the focal length F in pixels:
//
//     L'L = Gram(diag(s) U (c × e)) / (F² |K v|²),   b = K v · K e / (F |K v|²),   C = Gram(K e) / (F² |K v|²).
//
// The depth of the nearest point is (K c · K v / |K v|² + K c · K e f / (F |K v|²)) / W. Parallel lines have W = 1, v in the place of c, and a depth
// that is linear in f.
//
// Sources: Zwicker et al. 2001 (affine image); Kerbl et al. 2023; Yu et al. 2024; KHR_gaussian_splatting.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"
#include "shared/device.glsl"
#include "shared/keys.glsl"
#include "shared/sides.glsl"
#include "splat/boxes.glsl"
#include "splat/records.glsl"

layout(constant_id = SPEC_SPLAT_RULE) const uint RULE = RULE_KHR;
layout(constant_id = SPEC_SPLAT_ORDER) const uint ORDER = ORDER_DEPTHS;

layout(push_constant) uniform TrainedPush {
    vec4 right;       // to the place in the image of a place in the data; w: what the eye's rounding takes from it
    vec4 down;
    vec4 forward;
    vec4 eye;         // rounded; w: focal length in pixels, for parallel lines pixels in a unit of length
    vec4 middle;      // of all centres: depths are told from there, as splats near each other differ by less than they are far; w: width of a
                      // pixel over its height
    vec2 skew;        // to the right and down, of the ray of the image's middle
    vec2 from_whole;  // pixels from the middle of the image that this is a part of, to the right and down
    uint sides;
    uint whole;       // the sides of that image
    float scale_low;  // logarithm to base 2 of the shortest length, and of a step of its code
    float scale_step;
    float reach;      // by which most splats reach before and behind their centres, at most
    uint count;
    uint degree;      // of the harmonics
    uint perspective;
} push;

layout(local_size_x = 64) in;
layout(set = 0, binding = BINDING_SPLAT_POINTS, std430) readonly buffer TrainedSplats { uvec2 splats[]; };
layout(set = 0, binding = BINDING_SPLAT_HARMONICS, std430) readonly buffer SplatHarmonics { uint harmonics[]; };
layout(set = 0, binding = BINDING_SPLAT_RECORDS, std430) writeonly buffer TrainedRecords { vec4 records[]; };
layout(set = 0, binding = BINDING_RANK_KEYS, std430) writeonly buffer Keys { uint sort_keys[]; };
layout(set = 0, binding = BINDING_ORDER, std430) writeonly buffer Order { uint order[]; };
layout(set = 0, binding = BINDING_BOXES, std430) writeonly buffer Boxes { uvec2 boxes[]; };

const bool RAYS = RULE >= RULE_RAY;
const float HALF_LOG2E = 0.72134752; // turns squared distances into bits
const float MOST_OPACITY = 0.99;      // of rules that cap it
const float CUT = 9.0;               // squared distance at which splats end
const float MOST_SLOPE = 1.3;        // rules of the first program limit x / z and y / z in the affine image to this many of the image's half sides

struct Trained {
    vec3 centre;  // from the eye, in the axes of the view
    vec3 seen;    // direction from the eye, in those of the data
    float depth;  // from the plane through the middle of all
    float beyond; // distance from the eye, less that of the middle
    vec3 lengths;
    mat3 rotation; // columns: own axes in the data's
    float opacity;
    vec3 dc;
};

// Standard deviation of a code; 0 is flat.
float length_of(uint code) {
    return code == 0u ? 0.0 : exp2(fma(float(code - 1u), push.scale_step, push.scale_low));
}

mat3 rotation_of(uint a, uint b) {
    // Three components of 20 bits; the greatest, of which two bits tell the place, makes up the unit.
    vec3 parts = (vec3(a & 0xfffffu, (a >> 20 | b << 12) & 0xfffffu, b >> 8 & 0xfffffu) * (2.0 / 1048575.0) - 1.0) * 0.70710678;
    float last = sqrt(max(1.0 - dot(parts, parts), 0.0));
    uint place = b >> 28 & 3u;
    vec4 q = place == 0u ? vec4(last, parts) : place == 1u ? vec4(parts.x, last, parts.yz) : place == 2u ? vec4(parts.xy, last, parts.z) : vec4(parts, last);
    float w = q.x, x = q.y, y = q.z, z = q.w;
    return mat3(
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y),
        2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x),
        2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y));
}

Trained trained(uint i) {
    const uint VECTORS = TRAINED_WORDS / 2;
    uvec2 a = splats[VECTORS * i], b = splats[VECTORS * i + 1u], c = splats[VECTORS * i + 2u], d = splats[VECTORS * i + 3u], e = splats[VECTORS * i + 4u];
    Trained splat;
    vec3 place = uintBitsToFloat(uvec3(a, b.x)), relative = place - push.eye.xyz;
    splat.centre = vec3(dot(push.right.xyz, relative) + push.right.w, dot(push.down.xyz, relative) + push.down.w, dot(push.forward.xyz, relative) + push.forward.w);
    vec3 from_middle = place - push.middle.xyz, middle = push.middle.xyz - push.eye.xyz;
    splat.depth = dot(push.forward.xyz, from_middle);
    splat.beyond = dot(from_middle, relative + middle) / max(length(relative) + length(middle), 1e-30);
    splat.seen = push.perspective != 0u ? relative / max(length(relative), 1e-30) : push.forward.xyz;
    splat.lengths = vec3(length_of(b.y & 0x1fffffu), length_of((b.y >> 21 | c.x << 11) & 0x1fffffu), length_of(c.x >> 10 & 0x1fffffu));
    splat.rotation = rotation_of(c.y, d.x);
    // The last six bits of each colour's constant are a third of the opacity.
    uvec3 dc = uvec3(d.y, e);
    splat.opacity = float(dc.x & 63u | (dc.y & 63u) << 6 | (dc.z & 63u) << 12) * (1.0 / 262143.0);
    splat.dc = uintBitsToFloat(dc & ~63u);
    return splat;
}

// Returns a coefficient of three channels beyond the constant.
vec3 coefficient(uint first, uint i) {
    uint at = first + 3u * i / 2u;
    vec2 low = unpackHalf2x16(harmonics[at]), high = unpackHalf2x16(harmonics[at + 1u]);
    return (i & 1u) == 0u ? vec3(low, high.x) : vec3(low.y, high);
}

// Returns the colour of a splat from a direction: src/scene/harmonics.rs has the functions and their factors.
vec3 colour_of(uint i, Trained splat) {
    vec3 sum = fma(vec3(0.28209479), splat.dc, vec3(0.5));
    if (push.degree > 0u) {
        uint rest = (push.degree + 1u) * (push.degree + 1u) - 1u, first = i * ((3u * rest + 1u) / 2u);
        float x = splat.seen.x, y = splat.seen.y, z = splat.seen.z;
        float xx = x * x, yy = y * y, zz = z * z;
#define ADD(n, value) sum = fma(vec3(value), coefficient(first, n), sum);
        ADD(0u, -0.48860251 * y)
        ADD(1u, 0.48860251 * z)
        ADD(2u, -0.48860251 * x)
        if (push.degree > 1u) {
            ADD(3u, 1.0925485 * x * y)
            ADD(4u, -1.0925485 * y * z)
            ADD(5u, 0.31539157 * (2.0 * zz - xx - yy))
            ADD(6u, -1.0925485 * x * z)
            ADD(7u, 0.54627422 * (xx - yy))
        }
        if (push.degree > 2u) {
            ADD(8u, -0.59004359 * y * (3.0 * xx - yy))
            ADD(9u, 2.8906114 * x * y * z)
            ADD(10u, -0.4570458 * y * (4.0 * zz - xx - yy))
            ADD(11u, 0.37317633 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy))
            ADD(12u, -0.4570458 * x * (4.0 * zz - xx - yy))
            ADD(13u, 1.4453057 * z * (xx - yy))
            ADD(14u, -0.59004359 * x * (xx - 3.0 * yy))
        }
        if (push.degree > 3u) {
            ADD(15u, 2.5033429 * x * y * (xx - yy))
            ADD(16u, -1.7701308 * y * z * (3.0 * xx - yy))
            ADD(17u, 0.94617470 * x * y * (7.0 * zz - 1.0))
            ADD(18u, -0.66904654 * y * z * (7.0 * zz - 3.0))
            ADD(19u, 0.10578555 * (35.0 * zz * zz - 30.0 * zz + 3.0))
            ADD(20u, -0.66904654 * x * z * (7.0 * zz - 3.0))
            ADD(21u, 0.47308735 * (xx - yy) * (7.0 * zz - 1.0))
            ADD(22u, -1.7701308 * x * z * (xx - 3.0 * yy))
            ADD(23u, 0.62583574 * (xx * (xx - 3.0 * yy) - yy * (3.0 * xx - yy)))
        }
    }
    return max(sum, vec3(0.0));
}

// A splat in the image: its place, L, b, C and e, and the box of pixels that it may cover. L is 0 where nothing is drawn.
struct Drawn {
    vec2 place;
    vec3 l;
    vec2 b;
    vec3 c;
    vec2 e;
    float at;      // by rays: the depth where the line of the place r is nearest
    vec4 box;
    float end;     // squared distance, in bits, at which it ends
    float opacity;
    float reach;   // by rays: from the depth of the centre to where lines meet it
    float sigma;   // and the standard deviation along the line of the place r, in depth
};

Drawn by_image(Trained splat) {
    float focal = push.eye.w, z = splat.centre.z;
    bool perspective = push.perspective != 0u, khr = RULE == RULE_KHR;
    vec2 slopes = perspective ? splat.centre.xy / z : vec2(0.0), place = perspective ? slopes * focal : splat.centre.xy * focal;
    vec2 limits = MOST_SLOPE * half_of(push.whole) / focal, aside = push.from_whole / focal;
    if (!khr && perspective) slopes = clamp(slopes + aside, -limits, limits) - aside;
    float scale = perspective ? focal / z : focal;
    mat3 root = mat3(splat.rotation[0] * splat.lengths.x, splat.rotation[1] * splat.lengths.y, splat.rotation[2] * splat.lengths.z);
    vec3 ahead = push.forward.xyz * root;
    vec3 x = scale * (push.right.xyz * root - slopes.x * ahead), y = scale * (push.down.xyz * root - slopes.y * ahead), minors = cross(x, y);
    float lowpass = khr ? 0.0 : 0.3, bare = dot(minors, minors);
    float xx = dot(x, x) + lowpass, xy = dot(x, y), yy = dot(y, y) + lowpass;
    float det = bare + lowpass * (dot(x, x) + dot(y, y) + lowpass);
    Drawn drawn;
    drawn.place = place;
    drawn.l = vec3(0.0);
    drawn.b = vec2(0.0);
    drawn.c = vec3(0.0);
    drawn.e = vec2(0.0);
    drawn.at = splat.depth;
    drawn.box = vec4(0.0);
    drawn.end = HALF_LOG2E * CUT;
    drawn.opacity = splat.opacity;
    drawn.reach = 0.0;
    drawn.sigma = 0.0;
    if ((perspective && z <= 0.2) || !(det > 0.0) || det > 1e37) return drawn;
    drawn.l = vec3(sqrt(yy / det) * vec2(1.0, -xy / yy), inversesqrt(yy)) * sqrt(HALF_LOG2E);
    if (RULE == RULE_ANTIALIASED) drawn.opacity *= sqrt(max(bare / det, 2.5e-5));
    vec2 side;
    if (khr) {
        side = sqrt(CUT * vec2(xx, yy));
        drawn.box = vec4(place - side, place + side);
    } else {
        // Where opacity falls below 1 / 255, in the tiles of 16 pixels that meet the square around.
        float middle = 0.5 * (xx + yy), longest = middle + sqrt(max(middle * middle - det, 0.1)), reach = ceil(3.0 * sqrt(longest));
        drawn.end = log2(max(255.0 * drawn.opacity, 1e-20));
        side = sqrt(max(drawn.end, 0.0) / HALF_LOG2E * vec2(xx, yy));
        vec2 corner = half_of(push.whole) + push.from_whole;
        vec2 low = trunc((place + corner - 0.5 - reach) / 16.0), high = trunc((place + corner + 14.5 + reach) / 16.0);
        drawn.box = vec4(max(place - side, 16.0 * low - corner), min(place + side, 16.0 * high - corner));
        if (drawn.end < 0.0) drawn.l = vec3(0.0);
    }
    return drawn;
}

// Returns the least and the greatest place of an ellipsoid: of the planes x = s z that touch it. The discriminant is a difference of squares of
// `across` = m_x Z - m_z X and `minors` = m_x × m_z, which does not cancel for small splats.
vec2 places(float x, float z, vec3 row, vec3 ahead, float depth) {
    vec3 across = row * z - ahead * x, minors = cross(row, ahead);
    float middle = x * z - dot(row, ahead), root = sqrt(max(dot(across, across) - dot(minors, minors), 0.0));
    return vec2(middle - root, middle + root) / depth;
}

Drawn by_rays(Trained splat) {
    float focal = push.eye.w;
    bool perspective = push.perspective != 0u;
    float most = max(max(splat.lengths.x, splat.lengths.y), max(splat.lengths.z, 1e-30));
    vec3 s = splat.lengths / most, k = vec3(s.y * s.z, s.x * s.z, s.x * s.y), c = splat.centre;
    // Where the centre lies beside the eye, a little before it.
    float z = abs(c.z) < 1e-6 * length(c) ? 1e-6 * length(c) : c.z;
    if (perspective) c.z = z;
    // Directions of x, y and depth in the view, and their duals: cross products of directions are combinations of these, times the
    // determinant of those, the aspect.
    mat3 duals = mat3(push.right.xyz, push.down.xyz, push.forward.xyz);
    vec3 across = push.middle.w * push.right.xyz + push.skew.x * push.forward.xyz, down_ward = push.down.xyz + push.skew.y * push.forward.xyz;
    mat3 directions = mat3(push.middle.w * across, down_ward, push.forward.xyz + push.skew.x * across + push.skew.y * down_ward);
    mat3 own = transpose(splat.rotation) * directions, own_duals = push.middle.w * (transpose(splat.rotation) * duals);
    // At the place r of W lines go along `way`, and turn by ex and ey a pixel; parallel lines move instead.
    Drawn drawn;
    drawn.place = perspective ? c.xy / z * focal : c.xy * focal;
    vec2 reference = reference_of(drawn.place, half_of(push.sides));
    bool own_place = reference == drawn.place;
    vec3 way = perspective ? own_place ? c / z : vec3(reference / focal, 1.0) : vec3(0.0, 0.0, 1.0);
    vec3 ex = vec3(1.0, 0.0, 0.0), ey = vec3(0.0, 1.0, 0.0), kw = k * (own * way), kx = k * (own * ex), ky = k * (own * ey);
    float along = max(dot(kw, kw), 1e-37), unit = 1.0 / (focal * along);
    vec3 base = perspective ? c : way, kb = k * (own * base), ax = s * (own_duals * cross(base, ex)), ay = s * (own_duals * cross(base, ey));
    float weight = sqrt(HALF_LOG2E) / (focal * sqrt(along) * most), side = max(length(ax), 1e-30);
    drawn.l = vec3(side, dot(ax, ay) / side, length(cross(ax, ay)) / side) * weight;
    drawn.b = vec2(dot(kw, kx), dot(kw, ky)) * unit;
    drawn.c = vec3(dot(kx, kx), dot(kx, ky), dot(ky, ky)) * (unit / focal);
    drawn.e = vec2(dot(kb, kx), dot(kb, ky)) * (perspective ? unit : -unit);
    drawn.at = splat.depth + (own_place ? 0.0 : perspective ? dot(kb, kw) / along - z : dot(drawn.e, reference - drawn.place));
    drawn.end = 0.0;
    drawn.opacity = splat.opacity;
    drawn.sigma = most * k.x * s.x * inversesqrt(along);
    mat3 root = mat3(splat.rotation[0] * splat.lengths.x, splat.rotation[1] * splat.lengths.y, splat.rotation[2] * splat.lengths.z);
    vec3 right = 3.0 * (push.right.xyz * root), down = 3.0 * (push.down.xyz * root), ahead = 3.0 * (push.forward.xyz * root);
    float depth = z * z - dot(ahead, ahead);
    drawn.reach = length(ahead);
    if (!perspective) {
        vec2 reach = vec2(length(right), length(down)) * focal;
        drawn.box = vec4(drawn.place - reach, drawn.place + reach);
    } else if (z > 0.0 && depth > 1e-4 * z * z) {
        vec2 x = places(c.x, z, right, ahead, depth), y = places(c.y, z, down, ahead, depth);
        drawn.box = vec4(x.x, y.x, x.y, y.y) * focal;
    } else {
        drawn.box = vec4(-1e30, -1e30, 1e30, 1e30);
        if (c.z + length(ahead) < 0.0) drawn.l = vec3(0.0);
    }
    return drawn;
}

void main() {
    uint i = INVOCATION_NUMBER;
    if (i >= push.count) return;
    Trained splat = trained(i);
    Drawn drawn;
    if (RAYS) drawn = by_rays(splat); else drawn = by_image(splat);
    bool finite = all(lessThan(abs(drawn.l), vec3(1e18))) && all(lessThan(abs(drawn.place), vec2(1e30)));
    uvec2 box = finite && drawn.opacity > 0.0 && drawn.l != vec3(0.0) ? packed_box(drawn.box, half_of(push.sides)) : uvec2(0u);
    bool there = box != uvec2(0u);
    boxes[i] = box;
    order[i] = i;
    // By pixels: splats whose centres are as deep, and those of great reach earlier by what others have not.
    float key = ORDER == ORDER_DISTANCES && push.perspective != 0u ? splat.beyond : splat.depth;
    if (ORDER == ORDER_PIXELS) key -= max(drawn.reach - push.reach, 0.0);
    sort_keys[i] = there ? float_key(key) : 0xffffffffu;
    if (!there) return;
    uint first = record_of(i, RAYS);
    records[first] = vec4(drawn.place, drawn.l.xy);
    // Of an extinction that is Gaussian the optical depth, else the opacity.
    float peak = RULE == RULE_INTEGRAL ? -log(1.0 - min(drawn.opacity, MOST_OPACITY)) : drawn.opacity;
    records[first + 1u] = vec4(drawn.l.z, log2(peak), RAYS ? key : drawn.end, drawn.at);
    records[first + 2u] = vec4(colour_of(i, splat), drawn.sigma);
    if (RAYS) {
        records[first + 3u] = vec4(drawn.c, 0.0);
        records[first + 4u] = vec4(drawn.b, drawn.e);
    }
}
