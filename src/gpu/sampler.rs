//! Samplers, made on first use.

use std::sync::PoisonError;

use ash::vk;

use super::device::Gpu;
use crate::error::Result;

impl Gpu {
    /// Returns the sampler of a filter, clamped to the edge. With `mips` it blends mip levels, else it reads only the
    /// first.
    pub(crate) fn sampler(&self, filter: vk::Filter, mips: bool) -> Result<vk::Sampler> {
        let mut samplers = self.inner.samplers.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(&sampler) = samplers.get(&(filter, mips)) {
            return Ok(sampler);
        }
        let clamp = vk::SamplerAddressMode::CLAMP_TO_EDGE;
        let info = vk::SamplerCreateInfo::default()
            .mag_filter(filter)
            .min_filter(filter)
            .address_mode_u(clamp)
            .address_mode_v(clamp)
            .address_mode_w(clamp)
            .mipmap_mode(if mips { vk::SamplerMipmapMode::LINEAR } else { vk::SamplerMipmapMode::NEAREST })
            .max_lod(if mips { vk::LOD_CLAMP_NONE } else { 0.0 });
        // SAFETY: the device is alive; `info` points at nothing.
        let sampler = unsafe { self.device().create_sampler(&info, None) }
            .map_err(|result| self.failed("vkCreateSampler", result))?;
        samplers.insert((filter, mips), sampler);
        let name = match (filter, mips) {
            (vk::Filter::LINEAR, true) => "mip sampler",
            (vk::Filter::LINEAR, false) => "linear sampler",
            _ => "nearest sampler",
        };
        self.name(sampler, name);
        Ok(sampler)
    }
}
