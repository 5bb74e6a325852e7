//! Techniques that splat kernels, and the frame that they share.

pub mod ewa;
mod frame;
pub mod options;
pub mod sheets;
mod template;
