// Boxes without vertex buffers: 36 vertices each, computed from their index.
#version 460

layout(push_constant) uniform Push {
    mat4 to_clip;
    vec4 centre;
    vec4 half_size;
    vec4 colour;
};

#ifdef VERTEX
layout(location = 0) flat out vec3 normal;

void main() {
    int face = gl_VertexIndex / 6, corner = int[](0, 1, 2, 2, 1, 3)[gl_VertexIndex % 6];
    int axis = face / 2;
    float side = face % 2 == 0 ? -1.0 : 1.0;
    vec3 at = vec3(0.0);
    at[axis] = side;
    normal = at;
    at[(axis + 1) % 3] = (corner & 1) == 0 ? -1.0 : 1.0;
    at[(axis + 2) % 3] = (corner & 2) == 0 ? -1.0 : 1.0;
    gl_Position = to_clip * vec4(centre.xyz + half_size.xyz * at, 1.0);
}
#endif

#ifdef FRAGMENT
layout(location = 0) flat in vec3 normal;
layout(location = 0) out vec4 shaded;

void main() {
    float light = 0.55 + 0.45 * dot(normal, normalize(vec3(0.4, 0.8, 0.5)));
    shaded = vec4(colour.rgb * light, 1.0);
}
#endif
