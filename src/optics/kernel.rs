//! Kernels in float64: shapes, line integrals (footprints), and the flatness of their sum on a lattice.
//!
//! A kernel on a lattice lives in index space, where samples are one unit apart; its reach and its peak are
//! those of [`crate::scene::Kernels`]. Shares no code with the reference.
//!
//! # Frequency response
//!
//! Share of a wave's amplitude that remains at a quarter of the sampling rate (0.25 cycles per voxel, along
//! an axis); see [`response`].
//!
//! | kernel | remaining share |
//! |---|---|
//! | Gaussian, sigma 0.5 / 0.6 / 0.7 voxels | 0.73 / 0.64 / 0.55 |
//! | tent | 0.81 |
//! | cubic B-spline, without prefilter | 0.66 |
//! | cubic B-spline, prefiltered | 0.99 |
//! | Lanczos-3 | 1.01 |
//!
//! Tents and B-splines sum to one exactly. Gaussians do not; see [`ripple`] and [`deviation`].

mod erf;
mod flatness;
mod footprint;
mod frequency;
mod prefilter;
mod quadrature;
mod shape;
mod template;

pub(crate) use erf::erf;
pub(crate) use flatness::{Deviation, deviation, ripple};
pub(crate) use footprint::{Chord, Lattice, gaussian, spline};
pub(crate) use frequency::response;
pub(crate) use prefilter::prefilter;
pub(crate) use shape::{cubic, lanczos};
pub(crate) use template::Template;
