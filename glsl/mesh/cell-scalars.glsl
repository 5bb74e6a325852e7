// To whom the scalars of a mesh belong, and how its faces are stored for that.
#ifndef CELL_SCALARS_GLSL
#define CELL_SCALARS_GLSL

#include "interface.glsl"

layout(constant_id = SPEC_CELL_SCALARS) const bool CELL_SCALARS = false; // to cells; else to points

// Words of a face: its corners, of which the first has the sides with a cell in its uppermost bits (FACE_*). Where scalars belong to cells
// two more follow: the cell that the normal points to, and the one on the other side.
const uint FACE_WORDS = CELL_SCALARS ? 5u : 3u;

#endif
