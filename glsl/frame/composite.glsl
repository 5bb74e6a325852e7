// entry vertex   VERTEX
// entry fragment FRAGMENT
//
// Composites a technique's image into a rectangle of a colour attachment of any format: one triangle that covers it, one fetch per pixel,
// premultiplied "over" by fixed-function blending, or a plain copy.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "interface.glsl"

#ifdef VERTEX
void main() {
    gl_Position = vec4(gl_VertexIndex == 1 ? 3.0 : -1.0, gl_VertexIndex == 2 ? 3.0 : -1.0, 0.0, 1.0);
}
#endif

#ifdef FRAGMENT
layout(set = 0, binding = BINDING_SOURCE) uniform sampler2D source;
layout(location = 0) out vec4 colour;

layout(push_constant, std430) uniform CompositePush {
    ivec2 corner; // first pixel of the rectangle that is drawn
} push;

void main() {
    colour = texelFetch(source, ivec2(gl_FragCoord.xy) - push.corner, 0);
}
#endif
