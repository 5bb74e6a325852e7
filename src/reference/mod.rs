//! The reference: images in float64 on the CPU, exact up to rounding.
//!
//! Rays are cut at the faces of cells, at the knots of the transfer function and at surfaces. On each piece
//! the scalar is a cubic or linear, and optical depth has a closed form; emission is integrated by
//! Gauss-Legendre quadrature over panels of bounded optical depth. Sums of kernels are integrated numerically
//! between the places where kernels begin and end.
//!
//! Rays pass over blocks of cells without extinction, and end where nothing behind can change a bit. Neither changes a
//! bit of the image.
//!
//! This room uses `scene` and `image`, and shares no code with shaders or pre-integration tables. The choice
//! of settings, the measures, the program and the tests use it.

mod cells;
mod cover;
mod decay;
mod draw;
mod gaussians;
mod grid;
mod image;
mod index_space;
mod kernels;
mod march;
mod polynomial;
mod surfaces;
mod tets;
mod tree;
mod view_ray;
mod walk;

pub use draw::{ReferenceOptions, depth, pieces, pixels, ray, render};
pub use image::ReferenceImage;
pub use tets::Piece;

#[cfg(test)]
mod tests;
