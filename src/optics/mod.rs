//! Tables of the optical model for the device, built in float64: knots, pre-integration tables and kernels.
//!
//! This room uses `scene`, `interface` (layouts of the tables) and `gpu::shader` (the size of the uniform
//! block). The device's copy of a scene and the splatting techniques use it.

pub(crate) mod cumulative;
mod density;
pub(crate) mod full;
pub(crate) mod kernel;
mod knots;

pub(crate) use knots::DeviceKnots;
