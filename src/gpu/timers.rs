//! Timestamps of passes.

use std::sync::Arc;

use ash::vk;

use super::device::Gpu;
use super::feature::OptionalFeature;
use crate::error::Result;

/// Timestamps of one recording: one before each pass, and one after the last.
#[derive(Debug)]
pub(crate) struct Timers {
    gpu: Gpu,
    pub(super) pool: vk::QueryPool,
    pub(super) passes: u32,
}

impl Timers {
    /// Makes timers for `passes` passes; `None` where the device has no timestamps.
    pub(crate) fn new(gpu: &Gpu, passes: u32) -> Result<Option<Arc<Self>>> {
        if !gpu.has(OptionalFeature::Timestamps) {
            return Ok(None);
        }
        let info =
            vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(passes + 1);
        // SAFETY: the device is alive and its queue has timestamps.
        let pool = unsafe { gpu.device().create_query_pool(&info, gpu.host_callbacks()) }
            .map_err(|result| gpu.failed("vkCreateQueryPool", result))?;
        gpu.name(pool, "pass timers");
        Ok(Some(Arc::new(Self { gpu: gpu.clone(), pool, passes })))
    }

    /// Returns the milliseconds of each of the first `passes` passes, after their submission has ended. A pass lasts until the next
    /// one begins, so that the time in which its results become visible counts for it.
    pub(crate) fn read(&self, passes: usize) -> Result<Vec<f64>> {
        debug_assert!(passes <= crate::num::index(self.passes), "{passes} passes, {} timers", self.passes);
        let mut stamps = vec![0_u64; passes.min(crate::num::index(self.passes)) + 1];
        // SAFETY: every query read here was written by a submission that has ended.
        unsafe {
            self.gpu.device().get_query_pool_results(self.pool, 0, &mut stamps, vk::QueryResultFlags::TYPE_64)
        }
        .map_err(|result| self.gpu.failed("vkGetQueryPoolResults", result))?;
        let bits = self.gpu.inner.candidate.timestamp_bits;
        let mask = if bits >= 64 { u64::MAX } else { (1 << bits) - 1 };
        let nanoseconds = f64::from(self.gpu.limits().timestamp_period);
        let ms =
            |pair: &[u64]| crate::num::f64_of_u64(pair[1].wrapping_sub(pair[0]) & mask) * nanoseconds * 1e-6;
        Ok(stamps.windows(2).map(ms).collect())
    }
}

impl Drop for Timers {
    fn drop(&mut self) {
        // SAFETY: a submission holds its timers until its fence has signalled.
        unsafe { self.gpu.device().destroy_query_pool(self.pool, self.gpu.host_callbacks()) };
    }
}
