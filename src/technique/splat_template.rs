//! The one footprint that all kernels of a lattice have in parallel lines, as a table (Westover 1990).

use std::sync::Arc;

use ash::vk;

use super::gpu_scene::{GpuScene, TABLE_FORMAT};
use super::splat_data::SplatSet;
use crate::error::{Error, Result};
use crate::gpu::{Image, ImageDesc};
use crate::scene::View;

/// A table over the footprint's extent, and what leads from offsets in pixels to it.
#[derive(Clone, Debug)]
pub(super) struct SplatTemplate {
    pub(super) image: Arc<Image>,
    pub(super) scale: [f32; 4],
}

impl GpuScene {
    /// The footprint of the kernels of a set for the lines of a view, with `size` entries a side; without one a stand-in.
    pub(super) fn splat_template(
        &self,
        _set: &SplatSet,
        size: Option<u32>,
        _view: &View,
    ) -> Result<SplatTemplate> {
        let Some(_size) = size else {
            let desc = ImageDesc::flat(
                TABLE_FORMAT,
                [1, 1],
                vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST,
            );
            let image =
                Image::with_data(self.gpu(), "splats.no-template", &desc, |_, _, memory| memory.fill(0))?;
            return Ok(SplatTemplate { image, scale: [0.0; 4] });
        };
        Err(Error::unsupported("template", "todo"))
    }
}
