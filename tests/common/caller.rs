//! What an engine has around the library: a colour image, a depth image, a command buffer, a fence.

#![allow(unsafe_code, reason = "plays the caller, who owns Vulkan objects")]

use std::sync::Arc;

use volraster::Image;
use volraster::ash::vk;
use volraster::gpu::{CommandBuffer, DepthImage, DepthProjection, Gpu, Handles, TargetImage};
use volraster::scene::View;
use volraster::technique::Renderer;
use volraster::{GpuScene, TargetDesc, TargetMode};

/// How the end of a submission is told.
#[derive(Clone, Copy, Debug)]
pub enum Signal {
    /// By the caller's fence.
    Fence,
    /// By a timeline semaphore, and the value that it gets.
    Timeline(vk::Semaphore, u64),
}

/// Memory of the first kind that fits.
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

/// A 2D image, its memory, and a view of one aspect.
fn image_of(
    handles: &Handles,
    format: vk::Format,
    extent: [u32; 2],
    usage: vk::ImageUsageFlags,
    aspect: vk::ImageAspectFlags,
) -> (vk::Image, vk::DeviceMemory, vk::ImageView) {
    let device = &handles.device;
    let info = vk::ImageCreateInfo::default()
        .image_type(vk::ImageType::TYPE_2D)
        .format(format)
        .extent(vk::Extent3D { width: extent[0], height: extent[1], depth: 1 })
        .mip_levels(1)
        .array_layers(1)
        .samples(vk::SampleCountFlags::TYPE_1)
        .usage(usage);
    // SAFETY: valid description of a small 2D image.
    let image = unsafe { device.create_image(&info, None) }.unwrap();
    // SAFETY: just made.
    let memory = allocate(handles, unsafe { device.get_image_memory_requirements(image) }, false);
    // SAFETY: fresh image and memory of its size.
    unsafe { device.bind_image_memory(image, memory, 0) }.unwrap();
    let info = vk::ImageViewCreateInfo::default()
        .image(image)
        .view_type(vk::ImageViewType::TYPE_2D)
        .format(format)
        .subresource_range(range_of(aspect));
    // SAFETY: the image is bound.
    (image, memory, unsafe { device.create_image_view(&info, None) }.unwrap())
}

/// A buffer that the host sees, with its memory.
pub fn host_buffer(
    handles: &Handles,
    size: u64,
    usage: vk::BufferUsageFlags,
) -> (vk::Buffer, vk::DeviceMemory) {
    let device = &handles.device;
    let info = vk::BufferCreateInfo::default().size(size).usage(usage);
    // SAFETY: not empty.
    let buffer = unsafe { device.create_buffer(&info, None) }.unwrap();
    // SAFETY: just made.
    let memory = allocate(handles, unsafe { device.get_buffer_memory_requirements(buffer) }, true);
    // SAFETY: fresh buffer and memory of its size.
    unsafe { device.bind_buffer_memory(buffer, memory, 0) }.unwrap();
    (buffer, memory)
}

/// Fills host-visible memory that nothing on the device uses.
pub fn write(device: &volraster::ash::Device, memory: vk::DeviceMemory, bytes: &[u8]) {
    let flags = vk::MemoryMapFlags::empty();
    // SAFETY: host-visible, not mapped.
    let pointer = unsafe { device.map_memory(memory, 0, vk::WHOLE_SIZE, flags) }.unwrap();
    // SAFETY: mapped for at least this many bytes; coherent.
    unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), pointer.cast::<u8>(), bytes.len()) };
    // SAFETY: mapped above.
    unsafe { device.unmap_memory(memory) };
}

fn range_of(aspect: vk::ImageAspectFlags) -> vk::ImageSubresourceRange {
    vk::ImageSubresourceRange::default().aspect_mask(aspect).level_count(1).layer_count(1)
}

/// The whole image, without gaps in the buffer.
fn region_of(extent: [u32; 2], aspect: vk::ImageAspectFlags) -> vk::BufferImageCopy {
    let layers = vk::ImageSubresourceLayers { aspect_mask: aspect, layer_count: 1, ..Default::default() };
    vk::BufferImageCopy {
        image_subresource: layers,
        image_extent: vk::Extent3D { width: extent[0], height: extent[1], depth: 1 },
        ..Default::default()
    }
}

/// Records a barrier after everything and before everything, which changes an image's layout.
fn transition(
    device: &volraster::ash::Device,
    commands: vk::CommandBuffer,
    (image, aspect): (vk::Image, vk::ImageAspectFlags),
    old: vk::ImageLayout,
    new: vk::ImageLayout,
) {
    let all = vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE;
    let barriers = [vk::ImageMemoryBarrier2::default()
        .src_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
        .src_access_mask(all)
        .dst_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
        .dst_access_mask(all)
        .old_layout(old)
        .new_layout(new)
        .image(image)
        .subresource_range(range_of(aspect))];
    let info = vk::DependencyInfo::default().image_memory_barriers(&barriers);
    // SAFETY: recording, outside of rendering.
    unsafe { device.cmd_pipeline_barrier2(commands, &info) };
}

/// What an engine has: a colour image, a buffer to read it back, a command buffer, a fence.
pub struct Caller {
    pub device: volraster::ash::Device,
    pub image: vk::Image,
    pub image_memory: vk::DeviceMemory,
    pub view: vk::ImageView,
    pub buffer: vk::Buffer,
    pub buffer_memory: vk::DeviceMemory,
    pub pool: vk::CommandPool,
    pub commands: vk::CommandBuffer,
    pub fence: vk::Fence,
    pub extent: [u32; 2],
    pub format: vk::Format,
    pub bytes: u64,
}

impl Caller {
    pub fn new(gpu: &Gpu, format: vk::Format, extent: [u32; 2], texel: u64) -> Self {
        let handles = gpu.handles();
        let device = handles.device.clone();
        let bytes = u64::from(extent[0]) * u64::from(extent[1]) * texel;
        let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT
            | vk::ImageUsageFlags::TRANSFER_SRC
            | vk::ImageUsageFlags::TRANSFER_DST;
        let (image, image_memory, view) =
            image_of(&handles, format, extent, usage, vk::ImageAspectFlags::COLOR);
        let (buffer, buffer_memory) = host_buffer(&handles, bytes, vk::BufferUsageFlags::TRANSFER_DST);
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
        Self {
            device,
            image,
            image_memory,
            view,
            buffer,
            buffer_memory,
            pool,
            commands,
            fence,
            extent,
            format,
            bytes,
        }
    }

    /// Begins, fills the image with `clear`, and leaves it as the contract of `TargetImage` asks.
    pub fn begin(&self, clear: [f32; 4]) {
        // SAFETY: nothing is pending.
        unsafe { self.device.begin_command_buffer(self.commands, &vk::CommandBufferBeginInfo::default()) }
            .unwrap();
        self.fill(self.commands, clear);
    }

    /// Records the same fill into another command buffer.
    pub fn fill(&self, commands: vk::CommandBuffer, clear: [f32; 4]) {
        self.transition(commands, vk::ImageLayout::UNDEFINED, vk::ImageLayout::TRANSFER_DST_OPTIMAL);
        let colour = vk::ClearColorValue { float32: clear };
        // SAFETY: recording; the layout is the one just set.
        unsafe {
            self.device.cmd_clear_color_image(
                commands,
                self.image,
                vk::ImageLayout::TRANSFER_DST_OPTIMAL,
                &colour,
                &[range_of(vk::ImageAspectFlags::COLOR)],
            )
        };
        let (old, new) = (vk::ImageLayout::TRANSFER_DST_OPTIMAL, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL);
        self.transition(commands, old, new);
    }

    fn transition(&self, commands: vk::CommandBuffer, old: vk::ImageLayout, new: vk::ImageLayout) {
        transition(&self.device, commands, (self.image, vk::ImageAspectFlags::COLOR), old, new);
    }

    /// Copies out, submits, waits, and gives the image's bytes.
    pub fn end(&self, gpu: &Gpu) -> Vec<u8> {
        self.submit(gpu, Signal::Fence);
        self.wait();
        self.read()
    }

    /// Copies out and submits.
    pub fn submit(&self, gpu: &Gpu, signal: Signal) {
        self.copy(self.commands);
        // SAFETY: recording.
        unsafe { self.device.end_command_buffer(self.commands) }.unwrap();
        let buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(self.commands)];
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
        let submit =
            [vk::SubmitInfo2::default().command_buffer_infos(&buffers).signal_semaphore_infos(&signals)];
        let submitted = gpu.with_queue(|queue| {
            // SAFETY: the command buffer is complete, the queue is held, the fence is unsignalled, the semaphore's value
            // only grows.
            unsafe { self.device.queue_submit2(queue, &submit, fence) }
        });
        submitted.unwrap();
    }

    /// Records the copy to the host, for [`Caller::read`].
    pub fn copy(&self, commands: vk::CommandBuffer) {
        let (old, new) = (vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
        self.transition(commands, old, new);
        let region = region_of(self.extent, vk::ImageAspectFlags::COLOR);
        // SAFETY: recording; the buffer holds the image.
        unsafe {
            self.device.cmd_copy_image_to_buffer(
                commands,
                self.image,
                vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
                self.buffer,
                &[region],
            )
        };
        let barriers = [vk::BufferMemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER)
            .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::HOST)
            .dst_access_mask(vk::AccessFlags2::HOST_READ)
            .buffer(self.buffer)
            .size(vk::WHOLE_SIZE)];
        let info = vk::DependencyInfo::default().buffer_memory_barriers(&barriers);
        // SAFETY: recording.
        unsafe { self.device.cmd_pipeline_barrier2(commands, &info) };
    }

    /// Waits for a submission with [`Signal::Fence`].
    pub fn wait(&self) {
        // SAFETY: submitted.
        unsafe { self.device.wait_for_fences(&[self.fence], true, 60_000_000_000) }.unwrap();
        // SAFETY: signalled.
        unsafe { self.device.reset_fences(&[self.fence]) }.unwrap();
    }

    /// The bytes of the image, whose submission has ended.
    pub fn read(&self) -> Vec<u8> {
        // SAFETY: host-visible, not mapped.
        let pointer =
            unsafe { self.device.map_memory(self.buffer_memory, 0, self.bytes, vk::MemoryMapFlags::empty()) }
                .unwrap();
        // SAFETY: mapped for this many bytes, written by the device, which is done.
        let bytes =
            unsafe { std::slice::from_raw_parts(pointer.cast::<u8>(), usize::try_from(self.bytes).unwrap()) }
                .to_vec();
        // SAFETY: mapped above.
        unsafe { self.device.unmap_memory(self.buffer_memory) };
        bytes
    }

    pub fn target(&self, gpu: &Gpu) -> TargetImage {
        // SAFETY: image and view live until the test's end, after every submission; the layout is as asked.
        unsafe { TargetImage::from_raw(gpu, self.image, self.view, self.format, self.extent) }
    }

    pub fn command_buffer(&self, gpu: &Gpu) -> CommandBuffer {
        // SAFETY: recording, of this device's queue family, used by this thread alone.
        unsafe { CommandBuffer::from_raw(gpu, self.commands) }
    }
}

impl Drop for Caller {
    fn drop(&mut self) {
        let device = &self.device;
        // Every submission was waited for; each object is destroyed once, images and buffers before their
        // memory.
        // SAFETY: not in use.
        unsafe { device.destroy_fence(self.fence, None) };
        // SAFETY: its command buffer is not pending.
        unsafe { device.destroy_command_pool(self.pool, None) };
        // SAFETY: not in use.
        unsafe { device.destroy_buffer(self.buffer, None) };
        // SAFETY: its buffer is gone.
        unsafe { device.free_memory(self.buffer_memory, None) };
        // SAFETY: not in use.
        unsafe { device.destroy_image_view(self.view, None) };
        // SAFETY: its view is gone.
        unsafe { device.destroy_image(self.image, None) };
        // SAFETY: its image is gone.
        unsafe { device.free_memory(self.image_memory, None) };
    }
}

/// A depth image of the caller, filled from the host.
pub struct Depth {
    device: volraster::ash::Device,
    pub image: vk::Image,
    image_memory: vk::DeviceMemory,
    pub view: vk::ImageView,
    buffer: vk::Buffer,
    buffer_memory: vk::DeviceMemory,
    format: vk::Format,
    extent: [u32; 2],
}

impl Depth {
    /// What is stored, from 0 to 1, row by row; rounded as the format does. `None` where the device has no such images.
    pub fn new(gpu: &Gpu, format: vk::Format, extent: [u32; 2], stored: &[f32]) -> Option<Self> {
        let handles = gpu.handles();
        let device = handles.device.clone();
        // SAFETY: the physical device belongs to the instance.
        let features = unsafe {
            handles.instance.get_physical_device_format_properties(handles.physical_device, format)
        };
        let wanted = vk::FormatFeatureFlags::SAMPLED_IMAGE | vk::FormatFeatureFlags::TRANSFER_DST;
        if !features.optimal_tiling_features.contains(wanted) {
            return None;
        }
        let bytes: Vec<u8> = match format {
            vk::Format::D16_UNORM => {
                stored.iter().flat_map(|s| ((s * 65535.0).round() as u16).to_ne_bytes()).collect()
            }
            vk::Format::X8_D24_UNORM_PACK32 | vk::Format::D24_UNORM_S8_UINT => {
                let fixed = |s: &f32| (f64::from(*s) * 16_777_215.0).round() as u32;
                stored.iter().flat_map(|s| fixed(s).to_ne_bytes()).collect()
            }
            _ => stored.iter().flat_map(|s| s.to_ne_bytes()).collect(),
        };
        let size = bytes.len() as u64;
        let usage = vk::ImageUsageFlags::SAMPLED
            | vk::ImageUsageFlags::TRANSFER_DST
            | vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT;
        let (image, image_memory, view) =
            image_of(&handles, format, extent, usage, vk::ImageAspectFlags::DEPTH);
        let (buffer, buffer_memory) = host_buffer(&handles, size, vk::BufferUsageFlags::TRANSFER_SRC);
        write(&device, buffer_memory, &bytes);
        Some(Self { device, image, image_memory, view, buffer, buffer_memory, format, extent })
    }

    /// Records the fill, and leaves the image as the contract of `DepthImage` asks.
    pub fn fill(&self, commands: vk::CommandBuffer) {
        self.transition(commands, vk::ImageLayout::UNDEFINED, vk::ImageLayout::TRANSFER_DST_OPTIMAL);
        let region = region_of(self.extent, vk::ImageAspectFlags::DEPTH);
        let layout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        // SAFETY: recording; the buffer holds the image's depths.
        unsafe { self.device.cmd_copy_buffer_to_image(commands, self.buffer, self.image, layout, &[region]) };
        self.transition(commands, layout, vk::ImageLayout::DEPTH_READ_ONLY_OPTIMAL);
    }

    fn transition(&self, commands: vk::CommandBuffer, old: vk::ImageLayout, new: vk::ImageLayout) {
        let aspect = match self.format {
            vk::Format::D24_UNORM_S8_UINT | vk::Format::D32_SFLOAT_S8_UINT => {
                vk::ImageAspectFlags::DEPTH | vk::ImageAspectFlags::STENCIL
            }
            _ => vk::ImageAspectFlags::DEPTH,
        };
        let new = match new {
            vk::ImageLayout::DEPTH_READ_ONLY_OPTIMAL if aspect.contains(vk::ImageAspectFlags::STENCIL) => {
                vk::ImageLayout::DEPTH_STENCIL_READ_ONLY_OPTIMAL
            }
            new => new,
        };
        transition(&self.device, commands, (self.image, aspect), old, new);
    }

    pub fn image(&self, gpu: &Gpu, projection: DepthProjection) -> DepthImage {
        // SAFETY: image and view live until the test's end, after every submission; the layout is as asked.
        let image = unsafe { DepthImage::from_raw(gpu, self.view, self.format, self.extent, projection) };
        match self.format {
            vk::Format::D24_UNORM_S8_UINT | vk::Format::D32_SFLOAT_S8_UINT => {
                image.in_layout(vk::ImageLayout::DEPTH_STENCIL_READ_ONLY_OPTIMAL)
            }
            _ => image,
        }
    }
}

impl Drop for Depth {
    fn drop(&mut self) {
        let device = &self.device;
        // Every submission was waited for; each object is destroyed once, before its memory.
        // SAFETY: not in use.
        unsafe { device.destroy_image_view(self.view, None) };
        // SAFETY: its view is gone.
        unsafe { device.destroy_image(self.image, None) };
        // SAFETY: its image is gone.
        unsafe { device.free_memory(self.image_memory, None) };
        // SAFETY: not in use.
        unsafe { device.destroy_buffer(self.buffer, None) };
        // SAFETY: its buffer is gone.
        unsafe { device.free_memory(self.buffer_memory, None) };
    }
}

/// Draws into an image of the caller, behind whose depths nothing shows.
pub fn draw_before(
    gpu: &Gpu,
    scene: &Arc<GpuScene>,
    view: &View,
    spec: &str,
    depth: Option<(&Depth, DepthProjection)>,
) -> Image {
    let format = vk::Format::R32G32B32A32_SFLOAT;
    let [width, height] = view.extent();
    let caller = Caller::new(gpu, format, [width, height], 16);
    let renderer = Renderer::new(scene, super::technique(spec));
    let mut target = TargetDesc::caller(format, TargetMode::Clear);
    if depth.is_some() {
        target = target.with_depth();
    }
    for _ in 0..8 {
        let mut plan = renderer.prepare(view, &target).unwrap_or_else(|error| panic!("{spec}: {error}"));
        caller.begin([0.25; 4]);
        if let Some((depth, _)) = depth {
            depth.fill(caller.commands);
        }
        let image = depth.map(|(depth, projection)| depth.image(gpu, projection));
        let mut commands = caller.command_buffer(gpu);
        let recorded = plan.record(&mut commands, Some(&caller.target(gpu)), image.as_ref()).unwrap();
        let bytes = caller.end(gpu);
        if recorded.completed().unwrap().complete {
            let float = |b: &[u8]| f32::from_ne_bytes([b[0], b[1], b[2], b[3]]);
            let pixel = |t: &[u8]| [float(t), float(&t[4..]), float(&t[8..]), float(&t[12..])];
            return Image::new(width, height, bytes.chunks_exact(16).map(pixel).collect()).unwrap();
        }
    }
    panic!("{spec}: never complete");
}
