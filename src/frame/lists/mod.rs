//! Lists of the fragments of each pixel, for the faces or cells of a mesh and for the triangles of surfaces.
//!
//! A frame ranks its primitives ([`Ranking`]), bins them to tiles, and lists the fragments of each pixel by rank
//! ([`Lists`]). [`measure`] counts what a view needs when it is prepared, [`measure_flagged`] what one needs that only draws some of its
//! pixels from lists.

mod capacity;
mod fragments;
mod ranking;

pub(crate) use capacity::{Measured, measure, measure_flagged};
pub(crate) use fragments::{Band, Lists, cut_into_bands, tiles_across};
pub(crate) use ranking::{Geometry, Ranking};
