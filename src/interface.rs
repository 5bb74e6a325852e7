//! Structures that Rust writes and shaders read. `build.rs` asserts that both sides agree on every
//! offset and size.

use bytemuck::{Pod, Zeroable};

/// One knot of the transfer function (`optics.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct Knot {
    pub(crate) value: [f32; 4],
    pub(crate) rise: [f32; 4],
    pub(crate) s: f32,
    pub(crate) inverse_ds: f32,
    pub(crate) pad0: f32,
    pub(crate) pad1: f32,
}

/// Push constants of `slices-3d.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct Slices3dPush {
    pub(crate) q0_kq: [f32; 4],
    pub(crate) px_kd: [f32; 4],
    pub(crate) py_z0: [f32; 4],
    pub(crate) d0_h: [f32; 4],
    pub(crate) half_scale: [f32; 4],
    pub(crate) half_extent: [f32; 2],
    pub(crate) near: f32,
    pub(crate) value_scale: f32,
    pub(crate) value_offset: f32,
    pub(crate) knots: u32,
    pub(crate) slab_first: u32,
    pub(crate) slab_count: u32,
    pub(crate) backwards: u32,
    pub(crate) unit: f32,
    pub(crate) opaque: f32,
}

/// Push constants of `probe.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct ProbePush {
    pub(crate) count: u32,
}
