//! Splats on the device.

mod lattice;
mod records;
mod scattered;
mod set;
mod sizes;
mod space;

pub(crate) use set::{SplatNeeds, SplatSet};
pub(crate) use space::Shape;
