// Trained splats as the lines of pixels meet them: records that gaussians-project.glsl has written.
#ifndef MEET_GLSL
#define MEET_GLSL

#include "interface.glsl"
#include "splat/band.glsl"
#include "splat/records.glsl"

layout(constant_id = SPEC_SPLAT_RULE) const uint RULE = RULE_KHR;

layout(set = 0, binding = BINDING_SPLAT_RECORDS, std430) readonly buffer TrainedRecords { vec4 records[]; };

const bool RAYS = RULE >= RULE_RAY;
const float CUT_BITS = 6.4921277; // half of the squared distance at which splats end, to base 2

// 1 in perspective, 0 where lines are parallel.
#define PERSPECTIVE push.unit

// A splat as a pixel meets it.
struct Met {
    float bits;  // half the squared distance, to base 2
    float depth; // of the nearest point of the pixel's line, from the plane through the middle of all splats
    float sigma; // by rules of rays: standard deviation along the line, in depth
    bool there;  // whether it is drawn
};

// A splat's record.
struct Record {
    vec4 form;    // place, L
    vec4 limits;  // L, logarithm of the opacity, end or key, depth at r
    vec4 colour;  // a: sigma at r
    vec3 bend;    // C
    vec4 turn;    // b, e
};

Record record_at(uint id) {
    uint at = record_of(id, RAYS);
    Record record = Record(records[at], records[at + 1u], records[at + 2u], vec3(0.0), vec4(0.0));
    if (RAYS) {
        record.bend = records[at + 3u].xyz;
        record.turn = records[at + 4u];
    }
    return record;
}

// Reads a record of rules of rays, by lanes that share it.
#define FETCH_RAY_RECORD(at, record) { \
        vec4 bend; \
        FETCH_TWO(records, at, record.form, record.limits) \
        FETCH_TWO(records, (at) + 2u, record.colour, bend) \
        record.turn = FETCH(records, (at) + 4u); \
        record.bend = bend.xyz; \
    }

// Meets a splat with the line of a pixel, which is drawn between two depths.
Met meet(vec2 pixel, Record record, vec2 reference, vec2 drawn) {
    vec2 d = pixel - record.form.xy, own = vec2(fma(record.form.z, d.x, record.form.w * d.y), record.limits.x * d.y);
    Met met = Met(dot(own, own), record.limits.w, 0.0, true);
    if (RAYS) {
        vec2 f = pixel - reference;
        float change = PERSPECTIVE * (2.0 * dot(record.turn.xy, f) + f.x * fma(record.bend.x, f.x, 2.0 * record.bend.y * f.y) + record.bend.z * f.y * f.y);
        float inverse = 1.0 / max(1.0 + change, 1e-30);
        met.bits *= inverse;
        met.depth += (dot(record.turn.zw, f) - (record.limits.w + push.h) * change) * inverse;
        met.sigma = record.colour.a * sqrt(inverse);
        if (RULE == RULE_RAY) met.there = met.depth > drawn.x && met.depth < drawn.y;
    }
    met.there = met.there && met.bits <= (RAYS ? CUT_BITS : record.limits.z);
    return met;
}

// Returns the least depth at which the line may meet what follows a splat in its bin: bins ascend by the key of each, from which no line meets it
// farther before than by most reaches.
float followed_from(float key) {
    return key - push.forward_reach.w;
}

#endif
