//! Kernels in float64: line integrals (footprints), and the prefilter of interpolating B-splines.
//!
//! A kernel on a lattice lives in index space, where samples are one unit apart; its reach and its peak are
//! those of [`crate::scene::Kernels`]. Shares no code with the reference.

mod footprint;
mod prefilter;
mod template;

pub(crate) use prefilter::prefilter;
pub(crate) use template::Template;

#[cfg(test)]
mod tests;
