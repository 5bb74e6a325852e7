//! Queries: identity, limits and optional features of a device, and the memory and pipelines in use.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use ash::{ext, vk};
use vk::FormatFeatureFlags as F;

use super::device::{Gpu, Handles, Inner};
use super::feature::OptionalFeature;
use super::instance::version_text;
use super::select::DeviceReport;
use super::validation::ValidationLog;

impl Gpu {
    /// Returns a report of every device of the system, with the reason why it was chosen or rejected; for a caller's
    /// device only its own.
    #[must_use]
    pub fn device_reports(&self) -> &[DeviceReport] {
        &self.inner.reports
    }

    /// Returns the report of this device.
    #[must_use]
    pub fn report(&self) -> &DeviceReport {
        &self.inner.candidate.report
    }

    /// Returns the version of the validation layer if the crate has enabled it; `None` for a caller's instance.
    #[must_use]
    pub fn validation_layer(&self) -> Option<&str> {
        self.inner.instance.layer_version.as_deref()
    }

    /// Returns the validation log. It stays readable after the last clone of the [`Gpu`] is dropped, and then also
    /// has the messages of the device's destruction (leaks). For a caller's instance it is always empty: messages go to
    /// the caller's messenger.
    #[must_use]
    pub fn validation_log(&self) -> Arc<ValidationLog> {
        Arc::clone(&self.inner.instance.log)
    }

    /// Returns the Vulkan objects behind this device.
    #[must_use]
    pub fn handles(&self) -> Handles {
        Handles {
            instance: self.inner.instance.raw.clone(),
            physical_device: self.inner.candidate.raw,
            device: self.inner.device.clone(),
            queue_family: self.inner.candidate.queue_family,
        }
    }

    /// Returns whether the device offers an optional feature.
    #[must_use]
    pub fn has(&self, feature: OptionalFeature) -> bool {
        let Inner { candidate, enabled, without, .. } = &*self.inner;
        if let Some((format, flags)) = feature.of_format() {
            return self.image_features(format).contains(flags);
        }
        let is_there = match feature {
            OptionalFeature::FragmentStores => enabled.fragment_stores_and_atomics,
            OptionalFeature::FragmentInterlock => enabled.fragment_shader_pixel_interlock,
            OptionalFeature::OrderedStores => enabled.fragment_stores_and_atomics && candidate.orders_stores,
            OptionalFeature::BufferAddresses => enabled.buffer_device_address,
            OptionalFeature::MemoryBudget => enabled.has(ext::memory_budget::NAME),
            OptionalFeature::Timestamps => candidate.timestamp_bits > 0,
            OptionalFeature::FrameBoundary => self.inner.owned && enabled.has(ext::frame_boundary::NAME),
            // Those of formats have returned.
            _ => self.inner.debug.is_some(),
        };
        is_there && !without.contains(&feature)
    }

    /// Returns whether the device was opened to present images.
    pub(crate) fn presents(&self) -> bool {
        self.inner.presents
    }

    /// Returns the device memory that this crate may use in total, in bytes.
    #[must_use]
    pub fn memory_budget(&self) -> u64 {
        self.inner.budget.total()
    }

    /// Returns the bytes of the budget that nothing takes.
    pub(crate) fn memory_left(&self) -> u64 {
        self.inner.budget.total().saturating_sub(self.inner.budget.used())
    }

    /// Returns the bytes of data that one submission uploads.
    pub(crate) fn staging_bytes(&self) -> u64 {
        self.inner.staging_bytes
    }

    /// Returns the bytes of the pool of a grid's pages, where the options give them.
    pub(crate) fn page_pool(&self) -> Option<u64> {
        self.inner.page_pool
    }

    /// Returns the live allocations of device memory: the name of each object and its bytes.
    #[must_use]
    pub fn memory_report(&self) -> Vec<(String, u64)> {
        self.inner.budget.entries()
    }

    /// Returns the names of the pipelines built so far, sorted.
    #[must_use]
    pub fn pipelines(&self) -> Vec<String> {
        let table = self.pipeline_table();
        let built = table.values().filter(|pipeline| pipeline.is_built());
        let mut names: Vec<String> = built.map(|pipeline| pipeline.name().to_string()).collect();
        names.sort();
        names
    }

    /// Returns the milliseconds spent so far on building pipelines. Drivers may defer a part of the work to the first
    /// use.
    #[must_use]
    pub fn pipeline_ms(&self) -> f64 {
        crate::num::f64_of_u64(self.inner.pipeline_us.load(Ordering::Relaxed)) * 1e-3
    }

    /// Returns the largest extent of a 3D image, in samples.
    #[must_use]
    pub fn max_image_3d(&self) -> u32 {
        self.limits().max_image_dimension3_d
    }

    /// Returns the largest side of a 2D image, in pixels.
    pub(crate) fn max_image_2d(&self) -> u32 {
        self.limits().max_image_dimension2_d
    }

    /// Returns whether the device is a software rasteriser.
    #[must_use]
    pub fn is_software(&self) -> bool {
        self.inner.candidate.properties.device_type == vk::PhysicalDeviceType::CPU
    }

    /// Returns the bits of the fraction of a pixel to which the rasteriser rounds corners; at least 4.
    #[must_use]
    pub fn subpixel_bits(&self) -> u32 {
        self.limits().sub_pixel_precision_bits
    }

    /// Returns whether passes are laid out for a device that emulates workgroups: it runs their lanes in step, suspends all at
    /// a barrier and emulates shared memory.
    pub(crate) fn emulates_groups(&self) -> bool {
        self.is_software() && !self.inner.as_hardware
    }

    /// Returns whether a workgroup of eight invocations fits one subgroup with ballot and vote operations.
    pub(crate) fn eight_share_words(&self) -> bool {
        let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut subgroup);
        // SAFETY: the physical device belongs to this instance; subgroup properties are core since 1.1.
        unsafe {
            self.inner
                .instance
                .raw
                .get_physical_device_properties2(self.inner.candidate.raw, &mut properties);
        }
        let needed = vk::SubgroupFeatureFlags::BASIC
            | vk::SubgroupFeatureFlags::BALLOT
            | vk::SubgroupFeatureFlags::VOTE;
        self.inner.subgroup_size.unwrap_or(u32::MAX).min(subgroup.subgroup_size) >= 8
            && subgroup.supported_operations.contains(needed)
            && subgroup.supported_stages.contains(vk::ShaderStageFlags::COMPUTE)
    }

    /// Returns the features of optimally tiled images of a format.
    pub(crate) fn image_features(&self, format: vk::Format) -> F {
        let instance = &self.inner.instance.raw;
        // SAFETY: the physical device belongs to this instance.
        let properties =
            unsafe { instance.get_physical_device_format_properties(self.inner.candidate.raw, format) };
        let lacks = self.inner.without.iter().filter_map(|feature| feature.of_format());
        let lacks = lacks.filter(|(of, _)| *of == format).fold(F::empty(), |sum, (_, flags)| sum | flags);
        properties.optimal_tiling_features & !lacks
    }

    /// Returns the Vulkan version of the device.
    #[must_use]
    pub fn api_version(&self) -> String {
        version_text(self.inner.candidate.properties.api_version)
    }
}
