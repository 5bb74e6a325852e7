// entry vertex   VERTEX
// entry fragment FRAGMENT
//
// Draws the triangles of a window's panel, cut at a rectangle each: colours of the corners times those of an atlas of glyphs, both
// premultiplied and encoded as sRGB, in which they are also blended.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"

#ifdef VERTEX
struct PanelCorner {
    vec2 position; // in the window, pixels
    vec2 place;    // in the atlas, 0 to 1
    uvec2 clip;    // corners of the rectangle, pixels: x in the lower half of a word, y in the upper
    uint colour;
    uint pad;
};

layout(set = 0, binding = BINDING_PANEL, std430) readonly buffer Panel {
    PanelCorner corners[];
};
layout(push_constant, std430) uniform PanelPush {
    vec2 size; // of the window, pixels
} push;
layout(location = 0) out vec2 place;
layout(location = 1) out vec4 tint;
layout(location = 2) flat out uvec2 clip;

void main() {
    PanelCorner corner = corners[gl_VertexIndex];
    place = corner.place;
    tint = unpackUnorm4x8(corner.colour);
    clip = corner.clip;
    gl_Position = vec4(2.0 * corner.position / push.size - 1.0, 0.0, 1.0);
}
#endif

#ifdef FRAGMENT
layout(set = 0, binding = BINDING_SOURCE) uniform sampler2D source;
layout(location = 0) in vec2 place;
layout(location = 1) in vec4 tint;
layout(location = 2) flat in uvec2 clip;
layout(location = 0) out vec4 colour;

void main() {
    uvec2 at = uvec2(gl_FragCoord.xy);
    uvec2 low = uvec2(clip.x & 0xffffu, clip.x >> 16);
    uvec2 high = uvec2(clip.y & 0xffffu, clip.y >> 16);
    if (any(lessThan(at, low)) || any(greaterThanEqual(at, high))) {
        discard;
    }
    colour = tint * textureLod(source, place, 0.0);
}
#endif
