//! Inputs of shaders that classify scalars and integrate segments.

use ash::vk;

use crate::error::Result;
use crate::gpu::Sampled;
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
    /// wanted and the device can. `unread` is bound in the place of a table that no variant reads; else that is a texel of its own.
    pub(crate) fn segments(
        &self,
        options: &SegmentOptions,
        hardware: bool,
        unread: Option<Sampled>,
    ) -> Result<Segments> {
        let linear = vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR;
        let table_filter = hardware
            && options.integrator == Integrator::Full
            && self.gpu().image_features(TABLE_FORMAT).contains(linear);
        let filter = if table_filter { vk::Filter::LINEAR } else { vk::Filter::NEAREST };
        let (table, table_head) = match (self.table(options)?, unread) {
            (Some(table), _) => (table.image.sampled(filter), table.buffer.read()),
            (None, Some(unread)) => (unread, self.knots()?.buffer.read()),
            (None, None) => (self.no_table()?.sampled(filter), self.knots()?.buffer.read()),
        };
        Ok(Segments { table, table_head, integrator: options.integrator.code(), table_filter })
    }
}
