//! A table of the footprint that all kernels of a lattice share under parallel rays (Westover 1990).

use std::sync::Arc;

use ash::vk;

use crate::error::{Error, Result};
use crate::gpu::{Image, ImageDesc};
use crate::num::f32_of;
use crate::optics::kernel::Template;
use crate::resident::GpuScene;
use crate::resident::splats::{Shape, SplatSet};
use crate::scene::{Kernel, View};

const FORMAT: vk::Format = vk::Format::R32_SFLOAT;

/// A table of the footprint over its extent.
#[derive(Clone, Debug)]
pub(crate) struct SplatTemplate {
    pub(crate) image: Arc<Image>,
    /// Scale from offsets in pixels to the table: inverse half extents, then the part of each side between the centres
    /// of the outermost entries.
    pub(crate) scale: [f32; 4],
}

impl GpuScene {
    /// Returns the footprint of a set's kernels under the rays of a view, with `size` entries along each side.
    ///
    /// Without a size it is one texel, for the binding of shaders that read no table.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] where footprints differ, [`Error::Unsupported`] where the device cannot filter the table.
    pub(crate) fn splat_template(
        &self,
        set: &SplatSet,
        size: Option<u32>,
        view: &View,
    ) -> Result<SplatTemplate> {
        let gpu = self.gpu();
        let flat = |side: u32| {
            let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST;
            ImageDesc::flat(FORMAT, [side; 2], usage)
        };
        let Some(size) = size else {
            let image = Image::with_data(gpu, "splats.no-template", &flat(1), |_, _, memory| memory.fill(0))?;
            return Ok(SplatTemplate { image, scale: [0.0; 4] });
        };
        if view.is_perspective() || set.shape != Shape::Alike {
            return Err(Error::invalid(
                "splat-sheets option template",
                "works only on a grid with parallel rays: under perspective, and among points, footprints differ",
            ));
        }
        if !gpu.image_features(FORMAT).contains(vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR) {
            return Err(Error::unsupported("splat-sheets option template", "linear filtering of R32_SFLOAT"));
        }
        let kernels = set.kernels;
        let sigma = if kernels.kernel == Kernel::Gaussian { kernels.sigma } else { 1.0 };
        let to_voxels = set.space.to_world.inverse() * sigma;
        let direction = to_voxels * view.forward() * set.space.unit;
        let pixel = view.pixel_size();
        let axes = [to_voxels * view.across() * pixel, to_voxels * view.up() * -pixel];
        let template = Template::new(kernels, direction, axes, size)?;
        // The shader multiplies by the amplitude.
        let texels: Vec<f32> =
            template.values.iter().map(|&v| f32_of(f64::from(v) / set.amplitude)).collect();
        let image = Image::with_data(gpu, "splats.template", &flat(size), |_, _, memory| {
            let bytes: &[u8] = bytemuck::cast_slice(&texels);
            memory.copy_from_slice(&bytes[..memory.len()]);
        })?;
        let inside = f64::from(size - 1) / f64::from(size);
        let [x, y] = template.half.map(|half| 1.0 / half);
        Ok(SplatTemplate { image, scale: [x, y, inside, inside].map(f32_of) })
    }
}
