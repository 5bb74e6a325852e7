//! Descriptor sets: the resources bound to a pipeline, with their samplers.

use std::sync::PoisonError;

use ash::vk;

use super::addressing::ADDRESSES;
use super::buffer::{Buffer, BufferUse};
use super::depth::DepthImage;
use super::device::Gpu;
use super::inputs::{Bound, Resource};
use super::pipeline::Pipeline;
use crate::error::{Error, Result};
use crate::num;

/// Filter for images of the caller.
const EXTERNAL_FILTER: vk::Filter = vk::Filter::NEAREST;

/// A descriptor set that keeps its resources alive.
#[derive(Debug)]
pub(crate) struct Descriptors {
    gpu: Gpu,
    pool: vk::DescriptorPool,
    pub(super) set: vk::DescriptorSet,
    /// The resources by binding.
    pub(super) resources: Vec<(u32, Resource)>,
    /// The addresses of buffers that have no descriptor.
    addresses: Option<Buffer>,
}

impl Descriptors {
    /// Makes a set for `pipeline` of the resources in `bound`.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] when `bound` belongs to another pipeline; the errors of Vulkan.
    pub(crate) fn new(gpu: &Gpu, pipeline: &Pipeline, bound: &Bound) -> Result<Self> {
        gpu.alive()?;
        let given = |binding: u32| {
            bound.resources.iter().find(|(number, _)| *number == binding).cloned().ok_or_else(|| {
                let what = format!("descriptors of {}", pipeline.name);
                Error::invalid(what, format!("binding {binding} is not given"))
            })
        };
        let (mut resources, mut sizes) = (Vec::new(), Vec::new());
        for &(binding, ty) in &pipeline.bindings {
            if binding != ADDRESSES {
                resources.push(given(binding)?);
            }
            sizes.push(vk::DescriptorPoolSize { ty, descriptor_count: 1 });
        }
        let addressed = pipeline.key.addressed.iter().map(|&binding| given(binding));
        let addressed = addressed.collect::<Result<Vec<_>>>()?;
        let addresses = (!addressed.is_empty()).then(|| addresses(gpu, &addressed)).transpose()?;
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        // SAFETY: the device is alive; every pipeline of this crate has at least one binding, so the sizes
        // are not empty.
        let pool = unsafe { gpu.device().create_descriptor_pool(&info, gpu.host_callbacks()) }
            .map_err(|result| gpu.failed("vkCreateDescriptorPool", result))?;
        let set = vk::DescriptorSet::null();
        let mut descriptors = Self { gpu: gpu.clone(), pool, set, resources, addresses };
        let layouts = [pipeline.set_layout];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        // SAFETY: the pool has the capacity for one set of this layout.
        let sets = unsafe { gpu.device().allocate_descriptor_sets(&info) }
            .map_err(|result| gpu.failed("vkAllocateDescriptorSets", result))?;
        descriptors.set = sets.first().copied().unwrap_or_default();
        for ((binding, resource), &(_, kind)) in descriptors.resources.iter().zip(&pipeline.bindings) {
            let write = vk::WriteDescriptorSet::default().dst_binding(*binding).descriptor_type(kind);
            let image = match resource {
                Resource::Read(buffer) | Resource::Write(buffer) => {
                    // A uniform block may cover only the start of a larger buffer.
                    let most = match kind {
                        vk::DescriptorType::UNIFORM_BUFFER => gpu.limits().max_uniform_buffer_range.into(),
                        _ => u64::MAX,
                    };
                    let range = buffer.size().min(most);
                    let info = vk::DescriptorBufferInfo { buffer: buffer.raw, offset: 0, range };
                    descriptors.update(write.buffer_info(&[info]));
                    continue;
                }
                Resource::Sampled(image, filter) => vk::DescriptorImageInfo {
                    sampler: gpu.sampler(*filter, image.desc().levels > 1)?,
                    image_view: image.view,
                    image_layout: vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL,
                },
                Resource::Stored(image) => vk::DescriptorImageInfo {
                    sampler: vk::Sampler::null(),
                    image_view: image.view,
                    image_layout: vk::ImageLayout::GENERAL,
                },
                Resource::External => {
                    // Creates the sampler now, since recording must not create objects.
                    gpu.sampler(EXTERNAL_FILTER, false)?;
                    continue;
                }
            };
            descriptors.update(write.image_info(&[image]));
        }
        if let Some(addresses) = &descriptors.addresses {
            let write = vk::WriteDescriptorSet::default()
                .dst_binding(ADDRESSES)
                .descriptor_type(vk::DescriptorType::UNIFORM_BUFFER);
            let info = vk::DescriptorBufferInfo { buffer: addresses.raw, offset: 0, range: addresses.size() };
            descriptors.update(write.buffer_info(&[info]));
        }
        descriptors.resources.extend(addressed);
        Ok(descriptors)
    }

    /// Sets the image of the caller. No submission that uses the set may be pending.
    pub(crate) fn sample_external(&self, depth: &DepthImage) -> Result<()> {
        let is_external = |(_, resource): &&(u32, Resource)| matches!(resource, Resource::External);
        let Some(&(binding, _)) = self.resources.iter().find(is_external) else { return Ok(()) };
        let image = vk::DescriptorImageInfo {
            sampler: self.gpu.sampler(EXTERNAL_FILTER, false)?,
            image_view: depth.view,
            image_layout: depth.layout,
        };
        let write = vk::WriteDescriptorSet::default()
            .dst_binding(binding)
            .descriptor_type(vk::DescriptorType::COMBINED_IMAGE_SAMPLER);
        self.update(write.image_info(&[image]));
        Ok(())
    }

    fn update(&self, write: vk::WriteDescriptorSet<'_>) {
        // SAFETY: the set is not in use: it is new, or the caller of `sample_external` has exclusive access to the plan, whose
        // last recording has completed. The resources are alive: this object keeps them, or the contract of
        // `DepthImage::from_raw` says so.
        unsafe { self.gpu.device().update_descriptor_sets(&[write.dst_set(self.set)], &[]) };
    }
}

impl Drop for Descriptors {
    fn drop(&mut self) {
        // SAFETY: a submission holds its descriptors until its fence has signalled; sets go with the pool.
        unsafe { self.gpu.device().destroy_descriptor_pool(self.pool, self.gpu.host_callbacks()) };
    }
}

/// Makes the block of the addresses of buffers.
fn addresses(gpu: &Gpu, addressed: &[(u32, Resource)]) -> Result<Buffer> {
    let address = |(_, resource): &(u32, Resource)| match resource {
        Resource::Read(buffer) | Resource::Write(buffer) => buffer.address(),
        _ => 0,
    };
    let words: Vec<u64> = addressed.iter().map(address).collect();
    let bytes: &[u8] = bytemuck::cast_slice(&words);
    let mut table = Buffer::new(gpu, "addresses", num::wide(bytes.len()), BufferUse::Addresses)?;
    if let Some(place) = table.bytes_mut().and_then(|place| place.get_mut(..bytes.len())) {
        place.copy_from_slice(bytes);
    }
    Ok(table)
}

impl Gpu {
    /// Returns the bindings of storage blocks that shaders find by address, ascending.
    pub(super) fn addressed(&self, bound: &Bound) -> Vec<u32> {
        let blocks = bound.shaders.iter().flat_map(|shader| shader.bindings);
        let blocks = blocks.filter(|(_, kind)| *kind == vk::DescriptorType::STORAGE_BUFFER);
        let is_large = |binding: &u32| {
            bound.resources.iter().any(|(number, resource)| match resource {
                Resource::Read(buffer) | Resource::Write(buffer) => {
                    number == binding && self.is_addressed(buffer.size())
                }
                _ => false,
            })
        };
        let mut addressed: Vec<u32> = blocks.map(|&(binding, _)| binding).filter(is_large).collect();
        addressed.sort_unstable();
        addressed.dedup();
        addressed
    }

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
        let sampler = unsafe { self.device().create_sampler(&info, self.host_callbacks()) }
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
