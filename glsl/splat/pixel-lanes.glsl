// Invocations that own one pixel. column-lanes.glsl is the alternative.
#ifndef PIXEL_LANES_GLSL
#define PIXEL_LANES_GLSL

#include "splat/splats.glsl"

#define WAITING 4u // places of a row's window
#define EACH_WAITING(f, r) f(r * 4) f(r * 4 + 1) f(r * 4 + 2) f(r * 4 + 3)
#define AS_MANY(f, r) f(r) f(r) f(r) f(r)
#define ROWS 1
#define EACH_ROW(f) f(0)
#define LANE gl_LocalInvocationID.x
#define ANY(condition) (condition)
#define FETCH(list, at) list[at]
#define FETCH_TWO(list, at, a, b) { a = list[at]; b = list[(at) + 1u]; }

Read read_splat(uint id) {
    Read read = Read(vec4(0.0), vec4(0.0));
    if (SHAPE == SHAPE_ALIKE && !DENSITY) {
        read.point = FETCH(splat_points, id);
    } else {
        FETCH_TWO(splat_points, 2u * id, read.point, read.value)
    }
    return read;
}

#endif
