//! Descriptor sets: the resources bound to a pipeline.

use ash::vk;

use super::depth::DepthImage;
use super::device::Gpu;
use super::inputs::{Bound, Resource};
use super::pipeline::{Pipeline, descriptor_type};
use super::spirv::BindingKind;
use super::sync::Use;
use crate::error::{Error, Result};

/// Filter for images of the caller.
const EXTERNAL_FILTER: vk::Filter = vk::Filter::NEAREST;

/// A descriptor set that keeps its resources alive.
#[derive(Debug)]
pub(crate) struct Descriptors {
    gpu: Gpu,
    pool: vk::DescriptorPool,
    set: vk::DescriptorSet,
    resources: Vec<(u32, BindingKind, Resource)>,
}

impl Descriptors {
    /// Makes a set for `pipeline` of the resources in `bound`.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] when `bound` belongs to another pipeline; the errors of Vulkan.
    pub(crate) fn new(gpu: &Gpu, pipeline: &Pipeline, bound: &Bound) -> Result<Self> {
        gpu.alive()?;
        let missing = |binding: u32| {
            Error::invalid(
                format!("descriptors of {}", pipeline.name),
                format!("binding {binding} is not given"),
            )
        };
        let mut resources = Vec::new();
        for &(binding, kind) in &pipeline.bindings {
            let mut given = bound.inputs.resources.iter();
            let found = given.find(|(number, _)| *number == binding).ok_or_else(|| missing(binding))?;
            resources.push((binding, kind, found.1.clone()));
        }
        let sizes: Vec<_> = pipeline
            .bindings
            .iter()
            .map(|&(_, kind)| vk::DescriptorPoolSize { ty: descriptor_type(kind), descriptor_count: 1 })
            .collect();
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        // SAFETY: the device is alive; every pipeline of this crate has at least one binding, so the sizes
        // are not empty.
        let pool = unsafe { gpu.device().create_descriptor_pool(&info, None) }
            .map_err(|result| gpu.failed("vkCreateDescriptorPool", result))?;
        let mut descriptors =
            Self { gpu: gpu.clone(), pool, set: vk::DescriptorSet::null(), resources: Vec::new() };
        let layouts = [pipeline.set_layout];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        // SAFETY: the pool has the capacity for one set of this layout.
        let sets = unsafe { gpu.device().allocate_descriptor_sets(&info) }
            .map_err(|result| gpu.failed("vkAllocateDescriptorSets", result))?;
        descriptors.set = sets.first().copied().unwrap_or_default();
        for (binding, kind, resource) in &resources {
            let write = vk::WriteDescriptorSet::default()
                .dst_set(descriptors.set)
                .dst_binding(*binding)
                .descriptor_type(descriptor_type(*kind));
            let (buffer, image);
            let write = match resource {
                Resource::Read(b) | Resource::Write(b) => {
                    // A uniform block may cover only the start of a larger buffer.
                    let most = u64::from(gpu.inner.properties.limits.max_uniform_buffer_range);
                    let range =
                        if *kind == BindingKind::UniformBuffer { b.size().min(most) } else { b.size() };
                    buffer = [vk::DescriptorBufferInfo { buffer: b.raw(), offset: 0, range }];
                    write.buffer_info(&buffer)
                }
                Resource::Sampled(i, filter) => {
                    image = [vk::DescriptorImageInfo {
                        sampler: gpu.sampler(*filter, i.desc().levels > 1)?,
                        image_view: i.view(),
                        image_layout: vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL,
                    }];
                    write.image_info(&image)
                }
                Resource::Stored(i) => {
                    image = [vk::DescriptorImageInfo {
                        sampler: vk::Sampler::null(),
                        image_view: i.view(),
                        image_layout: vk::ImageLayout::GENERAL,
                    }];
                    write.image_info(&image)
                }
                Resource::External => {
                    // Creates the sampler now, since recording must not create objects.
                    gpu.sampler(EXTERNAL_FILTER, false)?;
                    continue;
                }
            };
            // SAFETY: the set is not in use; the resources are alive and `descriptors` keeps them so.
            unsafe { gpu.device().update_descriptor_sets(&[write], &[]) };
        }
        descriptors.resources = resources;
        Ok(descriptors)
    }

    /// Sets the image of the caller. No submission that uses the set may be pending.
    pub(crate) fn sample_external(&self, depth: &DepthImage) -> Result<()> {
        let is_external =
            |(_, _, resource): &&(u32, BindingKind, Resource)| matches!(resource, Resource::External);
        let Some(&(binding, ..)) = self.resources.iter().find(is_external) else { return Ok(()) };
        let image = [vk::DescriptorImageInfo {
            sampler: self.gpu.sampler(EXTERNAL_FILTER, false)?,
            image_view: depth.view,
            image_layout: depth.layout,
        }];
        let write = vk::WriteDescriptorSet::default()
            .dst_set(self.set)
            .dst_binding(binding)
            .descriptor_type(vk::DescriptorType::COMBINED_IMAGE_SAMPLER)
            .image_info(&image);
        // SAFETY: the set is not in use: the only caller has exclusive access to the plan, whose last recording has
        // completed; the view is alive by the contract of `DepthImage::from_raw`.
        unsafe { self.gpu.device().update_descriptor_sets(&[write], &[]) };
        Ok(())
    }

    pub(crate) fn set(&self) -> vk::DescriptorSet {
        self.set
    }

    /// Iterates over the resources with their use by a pass of this bind point.
    pub(crate) fn uses(&self, compute: bool) -> impl Iterator<Item = (&Resource, Use)> {
        self.resources.iter().filter_map(move |(_, _, resource)| {
            let usage = match (resource, compute) {
                // The caller promises that it is ready.
                (Resource::External, _) => return None,
                (Resource::Sampled(..), true) => Use::ComputeSample,
                (Resource::Sampled(..), false) => Use::FragmentSample,
                (Resource::Stored(_) | Resource::Write(_), true) => Use::ComputeReadWrite,
                (Resource::Stored(_) | Resource::Write(_), false) => Use::FragmentReadWrite,
                (Resource::Read(_), true) => Use::ComputeRead,
                (Resource::Read(_), false) => Use::FragmentRead,
            };
            Some((resource, usage))
        })
    }
}

impl Drop for Descriptors {
    fn drop(&mut self) {
        // SAFETY: a submission holds its descriptors until its fence has signalled; sets go with the pool.
        unsafe { self.gpu.device().destroy_descriptor_pool(self.pool, None) };
    }
}
