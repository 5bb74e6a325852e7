// Invocations that own one pixel. column-lanes.glsl is the alternative.
#ifndef PIXEL_LANES_GLSL
#define PIXEL_LANES_GLSL

#define WAITING 4u // places of a row's window
#define EACH_WAITING(f, r) f(r * 4) f(r * 4 + 1) f(r * 4 + 2) f(r * 4 + 3)
#define AS_MANY(f, r) f(r) f(r) f(r) f(r)
#define ROWS 1
#define EACH_ROW(f) f(0)
#define LANE gl_LocalInvocationID.x
#define ANY(condition) (condition)
#define FETCH(list, at) list[at]
#define FETCH_TWO(list, at, a, b) { a = list[at]; b = list[(at) + 1u]; }

#endif
