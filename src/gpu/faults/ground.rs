//! What faults stand on: objects made with right calls, by the bare functions of Vulkan, so that the fault alone is wrong.

use std::sync::Arc;

use ash::prelude::VkResult;
use ash::vk;

use crate::error::Result;
use crate::gpu::device::Gpu;
use crate::gpu::inputs::{Entry, Inputs};
use crate::gpu::pipeline::{Blend, GraphicsState, Pipeline, PipelineKey};

/// The side of images, in pixels.
pub(super) const SIDE: u32 = 8;

/// The format of images.
pub(super) const FORMAT: vk::Format = vk::Format::R32G32B32A32_SFLOAT;

/// The bytes of buffers.
pub(super) const BYTES: u64 = 256;

/// A device on which a fault is committed. The objects made here are not destroyed: nobody may know whether a fault still uses them.
pub(super) struct Ground<'a> {
    pub(super) gpu: &'a Gpu,
    pub(super) device: &'a ash::Device,
}

/// An image with its view.
#[derive(Clone, Copy)]
pub(super) struct Picture {
    pub(super) image: vk::Image,
    pub(super) view: vk::ImageView,
}

impl<'a> Ground<'a> {
    pub(super) fn new(gpu: &'a Gpu) -> Self {
        Self { gpu, device: gpu.device() }
    }

    /// Allocates memory of the first type that requirements allow.
    pub(super) fn memory(&self, needs: vk::MemoryRequirements) -> VkResult<vk::DeviceMemory> {
        let info = vk::MemoryAllocateInfo::default()
            .allocation_size(needs.size)
            .memory_type_index(needs.memory_type_bits.trailing_zeros());
        // SAFETY: the device is alive, the type is one of its own.
        unsafe { self.device.allocate_memory(&info, None) }
    }

    /// Makes a buffer without memory.
    pub(super) fn bare_buffer(&self, size: u64, usage: vk::BufferUsageFlags) -> VkResult<vk::Buffer> {
        let info = vk::BufferCreateInfo::default().size(size).usage(usage);
        // SAFETY: the device is alive.
        unsafe { self.device.create_buffer(&info, None) }
    }

    /// Makes a buffer for transfers and shaders.
    pub(super) fn buffer(&self, size: u64) -> VkResult<vk::Buffer> {
        use vk::BufferUsageFlags as Usage;
        let usage = Usage::STORAGE_BUFFER | Usage::TRANSFER_SRC | Usage::TRANSFER_DST;
        let buffer = self.bare_buffer(size, usage)?;
        // SAFETY: made from this device.
        let mut needs = unsafe { self.device.get_buffer_memory_requirements(buffer) };
        // More than needed: a fault may write behind the buffer.
        needs.size += BYTES;
        let memory = self.memory(needs)?;
        // SAFETY: the buffer has no memory yet, and the memory is of its size and type.
        unsafe { self.device.bind_buffer_memory(buffer, memory, 0) }?;
        Ok(buffer)
    }

    /// Describes a 2D image.
    pub(super) fn flat(format: vk::Format, usage: vk::ImageUsageFlags) -> vk::ImageCreateInfo<'static> {
        vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(format)
            .extent(vk::Extent3D { width: SIDE, height: SIDE, depth: 1 })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .usage(usage)
    }

    /// Makes an image with memory.
    pub(super) fn image(&self, info: &vk::ImageCreateInfo<'_>) -> VkResult<vk::Image> {
        // SAFETY: the device is alive; the extent is small.
        let image = unsafe { self.device.create_image(info, None) }?;
        // SAFETY: made from this device.
        let needs = unsafe { self.device.get_image_memory_requirements(image) };
        let memory = self.memory(needs)?;
        // SAFETY: the image has no memory yet, and the memory is of its size and type.
        unsafe { self.device.bind_image_memory(image, memory, 0) }?;
        Ok(image)
    }

    /// Describes a view of a 2D image.
    pub(super) fn whole(
        image: vk::Image,
        format: vk::Format,
        aspect: vk::ImageAspectFlags,
    ) -> vk::ImageViewCreateInfo<'static> {
        vk::ImageViewCreateInfo::default()
            .image(image)
            .view_type(vk::ImageViewType::TYPE_2D)
            .format(format)
            .subresource_range(range(aspect))
    }

    /// Makes a 2D colour image and its view.
    pub(super) fn picture(&self, format: vk::Format, usage: vk::ImageUsageFlags) -> VkResult<Picture> {
        let image = self.image(&Self::flat(format, usage))?;
        let info = Self::whole(image, format, vk::ImageAspectFlags::COLOR);
        // SAFETY: made from this device, with this format.
        let view = unsafe { self.device.create_image_view(&info, None) }?;
        Ok(Picture { image, view })
    }

    /// Makes a pool with a command buffer that records.
    pub(super) fn commands(&self) -> VkResult<(vk::CommandPool, vk::CommandBuffer)> {
        let info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(self.gpu.inner.candidate.queue_family)
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
        // SAFETY: the device has this queue family.
        let pool = unsafe { self.device.create_command_pool(&info, None) }?;
        let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        // SAFETY: the pool is of this device.
        let buffers = unsafe { self.device.allocate_command_buffers(&info) }?;
        let commands = buffers.first().copied().unwrap_or_default();
        // SAFETY: just allocated.
        unsafe { self.device.begin_command_buffer(commands, &vk::CommandBufferBeginInfo::default()) }?;
        Ok((pool, commands))
    }

    /// Ends a recording.
    pub(super) fn end(&self, commands: vk::CommandBuffer) -> VkResult<()> {
        // SAFETY: it records.
        unsafe { self.device.end_command_buffer(commands) }
    }

    /// Submits as `submit` says.
    pub(super) fn submit(&self, submit: vk::SubmitInfo2<'_>, fence: vk::Fence) -> VkResult<()> {
        // SAFETY: objects of this device; what is wrong with them is the fault.
        self.gpu.with_queue(|queue| unsafe { self.device.queue_submit2(queue, &[submit], fence) })
    }

    /// Ends a recording and submits it.
    pub(super) fn run(&self, commands: vk::CommandBuffer) -> VkResult<()> {
        self.end(commands)?;
        let infos = [vk::CommandBufferSubmitInfo::default().command_buffer(commands)];
        self.submit(vk::SubmitInfo2::default().command_buffer_infos(&infos), vk::Fence::null())
    }

    /// Waits until the queue has ended its work.
    pub(super) fn wait(&self) -> VkResult<()> {
        // SAFETY: the device is alive.
        self.gpu.with_queue(|queue| unsafe { self.device.queue_wait_idle(queue) })
    }

    /// Records a barrier for all stages and accesses, which also brings an image from one layout to another.
    pub(super) fn transition(
        &self,
        commands: vk::CommandBuffer,
        image: vk::Image,
        layouts: [vk::ImageLayout; 2],
    ) {
        let all = vk::PipelineStageFlags2::ALL_COMMANDS;
        self.barrier(commands, image, layouts, [all, all]);
    }

    /// Records a barrier between stages, which brings an image from one layout to another.
    pub(super) fn barrier(
        &self,
        commands: vk::CommandBuffer,
        image: vk::Image,
        layouts: [vk::ImageLayout; 2],
        stages: [vk::PipelineStageFlags2; 2],
    ) {
        use vk::AccessFlags2 as Access;
        let none = stages[0].is_empty();
        let barriers = [vk::ImageMemoryBarrier2::default()
            .src_stage_mask(stages[0])
            .src_access_mask(if none { Access::NONE } else { Access::MEMORY_WRITE })
            .dst_stage_mask(stages[1])
            .dst_access_mask(Access::MEMORY_READ | Access::MEMORY_WRITE)
            .old_layout(layouts[0])
            .new_layout(layouts[1])
            .image(image)
            .subresource_range(range(vk::ImageAspectFlags::COLOR))];
        let info = vk::DependencyInfo::default().image_memory_barriers(&barriers);
        // SAFETY: recording; the image is of this device.
        unsafe { self.device.cmd_pipeline_barrier2(commands, &info) };
    }

    /// Records a fill of a buffer.
    pub(super) fn fill(&self, commands: vk::CommandBuffer, buffer: vk::Buffer) {
        // SAFETY: recording; the size is a multiple of 4.
        unsafe { self.device.cmd_fill_buffer(commands, buffer, 0, BYTES, 0) };
    }

    /// Builds the pipeline of a compute shader.
    pub(super) fn compute<I: Inputs>(&self, entry: &Entry<I>) -> Result<Arc<Pipeline>> {
        let key = PipelineKey { shaders: vec![entry.shader()], ..PipelineKey::default() };
        self.built(key)
    }

    /// Builds the pipeline of a vertex and a fragment shader.
    pub(super) fn graphics<V: Inputs, F: Inputs>(
        &self,
        vertex: &Entry<V>,
        fragment: &Entry<F>,
        format: Option<vk::Format>,
    ) -> Result<Arc<Pipeline>> {
        let topology = vk::PrimitiveTopology::TRIANGLE_LIST;
        let state = Some(GraphicsState { topology, blend: Blend::Copy, format });
        self.built(PipelineKey {
            shaders: vec![vertex.shader(), fragment.shader()],
            state,
            ..PipelineKey::default()
        })
    }

    fn built(&self, key: PipelineKey) -> Result<Arc<Pipeline>> {
        let pipeline = self.gpu.pipeline("fault", key)?;
        self.gpu.build(std::iter::once(&pipeline))?;
        Ok(pipeline)
    }

    /// Allocates a descriptor set that is not written yet.
    pub(super) fn set(&self, pipeline: &Pipeline) -> VkResult<vk::DescriptorSet> {
        let size = |&(_, ty): &(u32, vk::DescriptorType)| vk::DescriptorPoolSize { ty, descriptor_count: 1 };
        let sizes: Vec<_> = pipeline.bindings.iter().map(size).collect();
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        // SAFETY: the device is alive.
        let pool = unsafe { self.device.create_descriptor_pool(&info, None) }?;
        let layouts = [pipeline.set_layout];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        // SAFETY: the pool has room for one set of this layout.
        let sets = unsafe { self.device.allocate_descriptor_sets(&info) }?;
        Ok(sets.first().copied().unwrap_or_default())
    }

    /// Writes a buffer into a set of a pipeline: that of its first or second storage block.
    pub(super) fn write_buffer(
        &self,
        pipeline: &Pipeline,
        set: vk::DescriptorSet,
        block: usize,
        info: vk::DescriptorBufferInfo,
    ) {
        let kind = vk::DescriptorType::STORAGE_BUFFER;
        let mut blocks = pipeline.bindings.iter().filter(|(_, of)| *of == kind).map(|(binding, _)| *binding);
        let infos = [info];
        let write = vk::WriteDescriptorSet::default()
            .dst_set(set)
            .dst_binding(blocks.nth(block).unwrap_or_default())
            .descriptor_type(kind)
            .buffer_info(&infos);
        // SAFETY: a set of this device; what is wrong with the buffer is the fault.
        unsafe { self.device.update_descriptor_sets(&[write], &[]) };
    }

    /// Writes an image into a set of a pipeline that has one image.
    pub(super) fn write_image(
        &self,
        pipeline: &Pipeline,
        set: vk::DescriptorSet,
        view: vk::ImageView,
        layout: vk::ImageLayout,
    ) -> Result<()> {
        let is_image = |(_, kind): &&(u32, vk::DescriptorType)| *kind != vk::DescriptorType::STORAGE_BUFFER;
        let (binding, kind) = pipeline.bindings.iter().find(is_image).copied().unwrap_or_default();
        let sampler = self.gpu.sampler(vk::Filter::LINEAR, false)?;
        let infos = [vk::DescriptorImageInfo { sampler, image_view: view, image_layout: layout }];
        let write = vk::WriteDescriptorSet::default()
            .dst_set(set)
            .dst_binding(binding)
            .descriptor_type(kind)
            .image_info(&infos);
        // SAFETY: a set of this device; what is wrong with the image is the fault.
        unsafe { self.device.update_descriptor_sets(&[write], &[]) };
        Ok(())
    }

    /// Records a dispatch of one workgroup with a set.
    pub(super) fn dispatch(&self, commands: vk::CommandBuffer, pipeline: &Pipeline, set: vk::DescriptorSet) {
        self.bind(commands, pipeline, Some(set));
        // SAFETY: recording; pipeline and set are bound.
        unsafe { self.device.cmd_dispatch(commands, 1, 1, 1) };
    }

    /// Records the binding of a pipeline and of a set, and its push constants.
    pub(super) fn bind(
        &self,
        commands: vk::CommandBuffer,
        pipeline: &Pipeline,
        set: Option<vk::DescriptorSet>,
    ) {
        let (point, layout) = (pipeline.bind_point, pipeline.layout);
        // SAFETY: recording; the pipeline is built.
        unsafe { self.device.cmd_bind_pipeline(commands, point, pipeline.raw()) };
        if let Some(set) = set {
            // SAFETY: the set has the pipeline's layout.
            unsafe { self.device.cmd_bind_descriptor_sets(commands, point, layout, 0, &[set], &[]) };
        }
        if pipeline.push_bytes > 0 {
            // SAFETY: the layout has these bytes.
            unsafe { self.device.cmd_push_constants(commands, layout, pipeline.stages, 0, &[0; 4]) };
        }
    }

    /// Begins rendering into a view in the layout `GENERAL`, or without an attachment.
    pub(super) fn begin_rendering(
        &self,
        commands: vk::CommandBuffer,
        view: Option<vk::ImageView>,
        side: u32,
    ) {
        let attachments = view.map(|view| {
            vk::RenderingAttachmentInfo::default()
                .image_view(view)
                .image_layout(vk::ImageLayout::GENERAL)
                .load_op(vk::AttachmentLoadOp::CLEAR)
                .store_op(vk::AttachmentStoreOp::STORE)
        });
        let extent = vk::Extent2D { width: side, height: side };
        let info = vk::RenderingInfo::default()
            .render_area(vk::Rect2D { offset: vk::Offset2D::default(), extent })
            .layer_count(1)
            .color_attachments(attachments.as_slice());
        // SAFETY: recording, outside of rendering; dynamic rendering is enabled.
        unsafe { self.device.cmd_begin_rendering(commands, &info) };
    }

    /// Sets viewport and scissor to the whole image.
    pub(super) fn viewport(&self, commands: vk::CommandBuffer) {
        let side = 8.0;
        let viewport = vk::Viewport { width: side, height: side, max_depth: 1.0, ..vk::Viewport::default() };
        let extent = vk::Extent2D { width: SIDE, height: SIDE };
        // SAFETY: recording.
        unsafe { self.device.cmd_set_viewport(commands, 0, &[viewport]) };
        let scissor = vk::Rect2D { offset: vk::Offset2D::default(), extent };
        // SAFETY: recording.
        unsafe { self.device.cmd_set_scissor(commands, 0, &[scissor]) };
    }
}

/// Returns the whole of an image's first level and layer.
pub(super) fn range(aspect: vk::ImageAspectFlags) -> vk::ImageSubresourceRange {
    vk::ImageSubresourceRange::default().aspect_mask(aspect).level_count(1).layer_count(1)
}

/// Returns the copy of an image's first rows from or into a buffer.
pub(super) fn rows(height: u32) -> vk::BufferImageCopy {
    let layers =
        vk::ImageSubresourceLayers::default().aspect_mask(vk::ImageAspectFlags::COLOR).layer_count(1);
    let extent = vk::Extent3D { width: SIDE, height, depth: 1 };
    vk::BufferImageCopy::default().image_subresource(layers).image_extent(extent)
}

/// Returns a whole buffer for a descriptor.
pub(super) fn all_of(buffer: vk::Buffer) -> vk::DescriptorBufferInfo {
    vk::DescriptorBufferInfo { buffer, offset: 0, range: vk::WHOLE_SIZE }
}
