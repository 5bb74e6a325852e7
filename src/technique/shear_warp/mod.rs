//! Shear-warp: composites the slices of a grid in a base plane along rays, and warps the result to the image (Lacroute and Levoy 1994;
//! Peikert, Object Space Volume Rendering, SciVis 2007, pages 4-5 to 4-17).
//!
//! `build` builds a frame and `frame` records it: `factorisation`, `region` and `base_planes` choose base planes, `planes` makes their push
//! constants, `march` and `bounds` are the steps of compute. The room uses `technique::grid` (rays, options, dispatch limits), `frame`,
//! `resident`, `primitives`, `gpu` and `scene`; `technique::registry` builds its frames. `options` describes the algorithm.

mod base_plane;
mod base_planes;
mod bounds;
mod build;
mod factorisation;
mod frame;
mod march;
mod options;
mod planes;
mod region;

pub use options::{Intermediate, Options, Warp};
