//! Probes: small dispatches that measure properties of a device that Vulkan does not report. Each runs once per device, when a
//! technique needs its result.

use std::sync::Arc;

use ash::vk;

use super::buffer::{Buffer, BufferUse};
use super::descriptors::Descriptors;
use super::device::Gpu;
use super::image::{Image, ImageDesc};
use super::inputs::Bound;
use super::shader::{PROBE_FILTER, PROBE_LOOP, ProbeFilter, ProbeLoop};
use super::submit::Commands;
use crate::error::Result;
use crate::interface::ProbePush;
use crate::num;

/// Iterations of the loop probe. Mesa 22.3's software driver silently ends an invocation after 65,535.
const PROBED_ITERATIONS: u32 = 70_000;

/// Iterations subtracted from a measured limit, for loops of a shader that are not counted.
const MARGIN: u32 = 512;

impl Gpu {
    /// Returns how many loop iterations one shader invocation may make, summed over all its loops; [`u32::MAX`] where the
    /// device has no limit.
    ///
    /// # Errors
    ///
    /// [`Error::Vulkan`](crate::Error::Vulkan) when the probe cannot run.
    pub fn loop_limit(&self) -> Result<u32> {
        if let Some(&limit) = self.inner.loop_limit.get() {
            return Ok(limit);
        }
        let counted = self.probe_loop(PROBED_ITERATIONS)?;
        let limit =
            if counted == PROBED_ITERATIONS { u32::MAX } else { counted.saturating_sub(MARGIN).max(1) };
        Ok(*self.inner.loop_limit.get_or_init(|| limit))
    }

    /// Returns whether the limit has been neither set nor measured.
    pub(crate) fn loop_limit_is_unknown(&self) -> bool {
        self.inner.loop_limit.get().is_none()
    }

    /// Returns whether the device filters 8-bit volumes in 8-bit fixed point although it filters 16-bit volumes more
    /// finely. 8-bit data is then widened before upload.
    ///
    /// # Errors
    ///
    /// [`Error::Vulkan`](crate::Error::Vulkan) when the probe cannot run.
    pub fn filters_in_8_bit(&self) -> Result<bool> {
        let [coarse, fine] = self.filter_errors()?;
        // Rounding to 8 bits adds an error of at least half of 1/255. Weights of 8 bits, common in hardware, affect both formats alike:
        // widening would not help.
        Ok(coarse - fine > 0.3 / 255.0)
    }

    /// Returns the largest error of a linear filter between two samples, in units of their difference: 0.002 where weights are rounded to 8
    /// bits; `filter=exact` has none.
    ///
    /// # Errors
    ///
    /// [`Error::Vulkan`](crate::Error::Vulkan) when the probe cannot run.
    pub fn filter_error(&self) -> Result<f64> {
        Ok(self.filter_errors()?[1])
    }

    /// Returns the largest errors of the filters of 8-bit and 16-bit volumes; zeros where the device does not filter both.
    fn filter_errors(&self) -> Result<[f64; 2]> {
        if let Some(&errors) = self.inner.filter_errors.get() {
            return Ok(errors);
        }
        let linear = vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR;
        let formats = [vk::Format::R8_UNORM, vk::Format::R16_UNORM];
        let errors = if formats.iter().all(|&format| self.image_features(format).contains(linear)) {
            [self.probe_filter(formats[0])?, self.probe_filter(formats[1])?]
        } else {
            [0.0; 2]
        };
        Ok(*self.inner.filter_errors.get_or_init(|| errors))
    }

    /// Returns how many of `count` iterations of one loop an invocation makes.
    fn probe_loop(&self, count: u32) -> Result<u32> {
        let bind = |result: &Arc<Buffer>| PROBE_LOOP.with(&ProbeLoop { result: result.write() });
        Ok(self.run_probe("probe.loop", bind, count, [1, 1])?.first().copied().unwrap_or(0))
    }

    /// Returns the largest error of the linear filter between a texel of 0 and one of 1.
    fn probe_filter(&self, format: vk::Format) -> Result<f64> {
        const POSITIONS: u32 = 1024;
        let desc = ImageDesc::sampled_volume(format, [2, 2, 2]);
        let texel = desc.texel_bytes() / 8;
        let volume = Image::with_data(self, "probe.volume", &desc, |_, _, memory| {
            let texel = usize::try_from(texel).unwrap_or(1);
            for (i, bytes) in memory.chunks_exact_mut(texel).enumerate() {
                bytes.fill(if i % 2 == 1 { 0xff } else { 0 });
            }
        })?;
        let volume = volume.sampled(vk::Filter::LINEAR);
        let bind = |result: &Arc<Buffer>| PROBE_FILTER.with(&ProbeFilter { volume, result: result.write() });
        let words = self.run_probe("probe.filter", bind, POSITIONS, [POSITIONS, POSITIONS / 64])?;
        let error = |(i, &bits): (usize, &u32)| {
            (f64::from(f32::from_bits(bits)) - num::f64_of(i) / f64::from(POSITIONS - 1)).abs()
        };
        Ok(words.iter().enumerate().map(error).fold(0.0, f64::max))
    }

    /// Runs `groups` workgroups of the shader that `bind` binds to a result of `words` words, which are returned.
    fn run_probe(
        &self,
        name: &str,
        bind: impl FnOnce(&Arc<Buffer>) -> Bound,
        count: u32,
        [words, groups]: [u32; 2],
    ) -> Result<Vec<u32>> {
        let size = 4 * u64::from(words);
        let result = Arc::new(Buffer::new(self, "probe.result", size, BufferUse::ShaderWrite)?);
        let bound = bind(&result);
        let pipeline = self.compute_pipeline(name, &bound)?;
        let descriptors = Arc::new(Descriptors::new(self, &pipeline, &bound)?);
        let mut commands = Commands::new(self)?;
        let host = Arc::new(Buffer::new(self, "probe.host", size, BufferUse::Download)?);
        commands.run("probe", |recorder| {
            let push = ProbePush { count };
            recorder.dispatch("probe", &pipeline, &descriptors, bytemuck::bytes_of(&push), [groups, 1, 1]);
            recorder.copy_buffer("download", &result, &host, size);
            recorder.release_to_host(&host);
        })?;
        Ok(host.host_copy()?.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
    }
}
