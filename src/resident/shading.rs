//! Inputs of shaders that classify scalars and integrate segments.

use std::sync::Arc;

use ash::vk;

use crate::error::Result;
use crate::gpu::shader::{Optics, Segments};
use crate::resident::gpu_scene::GpuScene;
use crate::resident::tables::{Integrator, Knots, SegmentOptions, TABLE_FORMAT};

impl Knots {
    /// Returns the inputs of shaders that classify scalars.
    pub(crate) fn optics(&self) -> Optics {
        Optics { knots: self.buffer.read(), knots_uniform: self.buffer.uniform(), knot_walk: self.walk }
    }
}

impl GpuScene {
    /// Returns the inputs of shaders that integrate segments. The sampler interpolates a full table where `hardware` filtering is
    /// wanted and the device can.
    pub(crate) fn segments(&self, options: &SegmentOptions, hardware: bool) -> Result<Segments> {
        let linear = vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR;
        let table_filter = hardware
            && options.integrator == Integrator::Full
            && self.gpu().image_features(TABLE_FORMAT).contains(linear);
        let filter = if table_filter { vk::Filter::LINEAR } else { vk::Filter::NEAREST };
        let (texels, head) = match self.table(options)? {
            Some(table) => (Arc::clone(&table.image), table.buffer.read()),
            None => (self.no_table()?, self.knots()?.buffer.read()),
        };
        Ok(Segments {
            table: texels.sampled(filter),
            table_head: head,
            integrator: options.integrator.code(),
            table_filter,
        })
    }
}
