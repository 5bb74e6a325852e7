//! Lists of the fragments of each pixel, for the faces or cells of a mesh and for the triangles of surfaces.
//!
//! A frame ranks its primitives ([`Ranking`]), bins them to tiles, and finds which of its tile's primitives the line of each pixel meets
//! ([`Hits`]). Pixels walk through these, or list their fragments by rank ([`Lists`]). [`measure`] counts what a view needs when it is
//! prepared, [`measure_lists`] the fragments of all its pixels.

mod bands;
mod capacity;
mod fragments;
mod hits;
mod ranking;

pub(crate) use bands::{Band, cut_into_bands};
pub(crate) use capacity::{Measured, measure, measure_lists, measured};
pub(crate) use fragments::Lists;
pub(crate) use hits::Hits;
pub(crate) use ranking::{Geometry, Ranking};
