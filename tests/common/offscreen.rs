//! What an engine has for a frame: a colour image, a buffer to read it back, a command buffer.

use volraster::ash::{self, vk};
use volraster::gpu::{CommandBuffer, Gpu, Handles, TargetImage};

/// How the end of a submission is seen.
#[derive(Clone, Copy, Debug)]
pub enum Signal {
    Fence,
    /// A timeline semaphore and the value that it gets.
    Timeline(vk::Semaphore, u64),
}

/// An off-screen frame of one size and format, of four floats a pixel.
pub struct Offscreen {
    device: ash::Device,
    image: vk::Image,
    image_memory: vk::DeviceMemory,
    view: vk::ImageView,
    buffer: vk::Buffer,
    buffer_memory: vk::DeviceMemory,
    pool: vk::CommandPool,
    commands: vk::CommandBuffer,
    fence: vk::Fence,
    extent: [u32; 2],
}

/// The format of [`Offscreen`].
pub const FORMAT: vk::Format = vk::Format::R32G32B32A32_SFLOAT;

const WHOLE: vk::ImageSubresourceRange = vk::ImageSubresourceRange {
    aspect_mask: vk::ImageAspectFlags::COLOR,
    base_mip_level: 0,
    level_count: 1,
    base_array_layer: 0,
    layer_count: 1,
};

fn allocate(handles: &Handles, requirements: vk::MemoryRequirements, host: bool) -> vk::DeviceMemory {
    // SAFETY: the physical device belongs to the instance.
    let types = unsafe { handles.instance.get_physical_device_memory_properties(handles.physical_device) };
    let wanted = if host {
        vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT
    } else {
        vk::MemoryPropertyFlags::empty()
    };
    let index = (0..types.memory_type_count)
        .find(|&i| {
            requirements.memory_type_bits & (1 << i) != 0
                && types.memory_types[i as usize].property_flags.contains(wanted)
        })
        .unwrap();
    let info = vk::MemoryAllocateInfo::default().allocation_size(requirements.size).memory_type_index(index);
    // SAFETY: the type was found among those allowed.
    unsafe { handles.device.allocate_memory(&info, None) }.unwrap()
}

impl Offscreen {
    pub fn new(handles: &Handles, extent: [u32; 2]) -> Self {
        let device = handles.device.clone();
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(FORMAT)
            .extent(vk::Extent3D { width: extent[0], height: extent[1], depth: 1 })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .usage(
                vk::ImageUsageFlags::COLOR_ATTACHMENT
                    | vk::ImageUsageFlags::TRANSFER_SRC
                    | vk::ImageUsageFlags::TRANSFER_DST,
            );
        // SAFETY: valid description of a small 2D image.
        let image = unsafe { device.create_image(&info, None) }.unwrap();
        // SAFETY: just made.
        let image_memory = allocate(handles, unsafe { device.get_image_memory_requirements(image) }, false);
        // SAFETY: fresh image and memory of its size.
        unsafe { device.bind_image_memory(image, image_memory, 0) }.unwrap();
        let info = vk::ImageViewCreateInfo::default()
            .image(image)
            .view_type(vk::ImageViewType::TYPE_2D)
            .format(FORMAT)
            .subresource_range(WHOLE);
        // SAFETY: the image is bound.
        let view = unsafe { device.create_image_view(&info, None) }.unwrap();
        let bytes = 16 * u64::from(extent[0]) * u64::from(extent[1]);
        let info = vk::BufferCreateInfo::default().size(bytes).usage(vk::BufferUsageFlags::TRANSFER_DST);
        // SAFETY: not empty.
        let buffer = unsafe { device.create_buffer(&info, None) }.unwrap();
        // SAFETY: just made.
        let buffer_memory = allocate(handles, unsafe { device.get_buffer_memory_requirements(buffer) }, true);
        // SAFETY: fresh buffer and memory of its size.
        unsafe { device.bind_buffer_memory(buffer, buffer_memory, 0) }.unwrap();
        let info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(handles.queue_family)
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
        // SAFETY: valid.
        let pool = unsafe { device.create_command_pool(&info, None) }.unwrap();
        let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        // SAFETY: the pool is alive.
        let commands = unsafe { device.allocate_command_buffers(&info) }.unwrap()[0];
        // SAFETY: valid.
        let fence = unsafe { device.create_fence(&vk::FenceCreateInfo::default(), None) }.unwrap();
        Self { device, image, image_memory, view, buffer, buffer_memory, pool, commands, fence, extent }
    }

    /// Begins, fills the image with `clear`, and leaves it as the contract of `TargetImage` asks. Nothing is pending.
    pub fn begin(&self, clear: [f32; 4]) {
        // SAFETY: nothing is pending; the pool resets its buffers as they begin.
        unsafe { self.device.begin_command_buffer(self.commands, &vk::CommandBufferBeginInfo::default()) }
            .unwrap();
        self.transition(vk::ImageLayout::UNDEFINED, vk::ImageLayout::TRANSFER_DST_OPTIMAL);
        let (layout, colour) =
            (vk::ImageLayout::TRANSFER_DST_OPTIMAL, vk::ClearColorValue { float32: clear });
        // SAFETY: recording; the layout is the one just set.
        unsafe { self.device.cmd_clear_color_image(self.commands, self.image, layout, &colour, &[WHOLE]) };
        self.transition(vk::ImageLayout::TRANSFER_DST_OPTIMAL, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL);
    }

    fn transition(&self, old: vk::ImageLayout, new: vk::ImageLayout) {
        let all = vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE;
        let barriers = [vk::ImageMemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
            .src_access_mask(all)
            .dst_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
            .dst_access_mask(all)
            .old_layout(old)
            .new_layout(new)
            .image(self.image)
            .subresource_range(WHOLE)];
        let info = vk::DependencyInfo::default().image_memory_barriers(&barriers);
        // SAFETY: recording, outside of rendering.
        unsafe { self.device.cmd_pipeline_barrier2(self.commands, &info) };
    }

    /// What a plan records into.
    pub fn command_buffer(&self, gpu: &Gpu) -> CommandBuffer {
        // SAFETY: recording, of this device's queue family, used by this thread alone.
        unsafe { CommandBuffer::from_raw(gpu, self.commands) }
    }

    /// What a plan draws into.
    pub fn target(&self, gpu: &Gpu) -> TargetImage {
        // SAFETY: image and view live until every submission was seen to end; the layout is as asked.
        unsafe { TargetImage::from_raw(gpu, self.image, self.view, FORMAT, self.extent) }
    }

    /// Copies out and submits.
    pub fn submit(&self, gpu: &Gpu, signal: Signal) {
        self.transition(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
        let region = vk::BufferImageCopy {
            image_subresource: vk::ImageSubresourceLayers {
                aspect_mask: vk::ImageAspectFlags::COLOR,
                layer_count: 1,
                ..Default::default()
            },
            image_extent: vk::Extent3D { width: self.extent[0], height: self.extent[1], depth: 1 },
            ..Default::default()
        };
        let layout = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
        // SAFETY: recording; the buffer holds the image.
        unsafe {
            self.device.cmd_copy_image_to_buffer(self.commands, self.image, layout, self.buffer, &[region]);
        }
        let barriers = [vk::BufferMemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER)
            .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::HOST)
            .dst_access_mask(vk::AccessFlags2::HOST_READ)
            .buffer(self.buffer)
            .size(vk::WHOLE_SIZE)];
        let info = vk::DependencyInfo::default().buffer_memory_barriers(&barriers);
        // SAFETY: recording.
        unsafe { self.device.cmd_pipeline_barrier2(self.commands, &info) };
        // SAFETY: recording.
        unsafe { self.device.end_command_buffer(self.commands) }.unwrap();
        let buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(self.commands)];
        let submit = vk::SubmitInfo2::default().command_buffer_infos(&buffers);
        let (mut signals, mut fence) = (Vec::new(), vk::Fence::null());
        match signal {
            Signal::Fence => fence = self.fence,
            Signal::Timeline(semaphore, value) => signals.push(
                vk::SemaphoreSubmitInfo::default()
                    .semaphore(semaphore)
                    .value(value)
                    .stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS),
            ),
        }
        let submits = [submit.signal_semaphore_infos(&signals)];
        let result = gpu.with_queue(|queue| {
            // SAFETY: the command buffer is complete, the queue is held, the fence unsignalled, the semaphore a timeline
            // whose value only grows.
            unsafe { self.device.queue_submit2(queue, &submits, fence) }
        });
        result.unwrap();
    }

    /// Waits for a submission with [`Signal::Fence`].
    pub fn wait(&self) {
        // SAFETY: submitted.
        unsafe { self.device.wait_for_fences(&[self.fence], true, 60_000_000_000) }.unwrap();
        // SAFETY: signalled.
        unsafe { self.device.reset_fences(&[self.fence]) }.unwrap();
    }

    /// The bytes of the last frame, which has ended.
    pub fn bytes(&self) -> Vec<u8> {
        let count = 16 * self.extent[0] as usize * self.extent[1] as usize;
        let (memory, flags) = (self.buffer_memory, vk::MemoryMapFlags::empty());
        // SAFETY: host-visible, not mapped.
        let pointer = unsafe { self.device.map_memory(memory, 0, vk::WHOLE_SIZE, flags) }.unwrap();
        // SAFETY: mapped for at least this many bytes, written by the device, which is done.
        let bytes = unsafe { std::slice::from_raw_parts(pointer.cast::<u8>(), count) }.to_vec();
        // SAFETY: mapped above.
        unsafe { self.device.unmap_memory(memory) };
        bytes
    }
}

impl Drop for Offscreen {
    fn drop(&mut self) {
        // Every submission was waited for; each object is destroyed once, after what it is part of.
        // SAFETY: not in use.
        unsafe { self.device.destroy_fence(self.fence, None) };
        // SAFETY: its command buffer is not pending.
        unsafe { self.device.destroy_command_pool(self.pool, None) };
        // SAFETY: not in use.
        unsafe { self.device.destroy_buffer(self.buffer, None) };
        // SAFETY: its buffer is gone.
        unsafe { self.device.free_memory(self.buffer_memory, None) };
        // SAFETY: not in use.
        unsafe { self.device.destroy_image_view(self.view, None) };
        // SAFETY: its view is gone.
        unsafe { self.device.destroy_image(self.image, None) };
        // SAFETY: its image is gone.
        unsafe { self.device.free_memory(self.image_memory, None) };
    }
}
