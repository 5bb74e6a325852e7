//! Charts as SVG: curves over logarithmic axes and stacked bars.
//!
//! Uses `markup` and `numbers`. `bench` plots with it.

mod axis;
mod bars;
mod curves;
mod picture;

pub(crate) use axis::nice_step;
pub(crate) use bars::{Bar, bars};
pub(crate) use curves::{Series, Stroke, curves};
pub(crate) use picture::{Picture, Titles};
