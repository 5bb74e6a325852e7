//! Properties of kernels that the documents state, computed from their formulas.

mod flatness;
mod frequency;
