//! Techniques that splat kernels, and the frame that they share.

mod desc;
pub mod ewa;
mod frame;
pub mod options;
mod outcome;
pub mod sheets;
mod template;
mod view;
