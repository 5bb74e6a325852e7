// Segments between two places on a ray through a grid. For grid.glsl's rays and segments.glsl's integrators.

// A place on the ray with what the integration needs of it.
struct Face {
    float texel;
    End end;
};

Face face_at(Ray ray, float z, Lattice lattice) {
    float texel = stored_at(ray, z, lattice);
    return Face(texel, end_at(HAS_NAN && is_nan(texel) ? 0.0 : scalar_of(texel, lattice)));
}

// Premultiplied colour and opacity of what lies between two places; vacuum where either touches a NaN.
vec4 between_faces(Face front, Face back, float len, uint knots) {
    if (HAS_NAN && (is_nan(front.texel) || is_nan(back.texel))) return vec4(0.0);
    return segment(front.end, back.end, len, knots);
}
