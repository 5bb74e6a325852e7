//! Everything that reaches under wgpu, to the objects of Vulkan.

#![allow(unsafe_code, reason = "uses the Vulkan objects behind wgpu's")]

use std::sync::Arc;

use volraster::ash::{ext, vk};
use volraster::gpu::{
    CommandBuffer, DepthImage, DepthProjection, Enabled, GpuOptions, GpuParts, TargetImage,
};
use volraster::{Gpu, Plan, RecordInfo, Recorded, Result};
use wgpu::hal::vulkan::Api as Vulkan;

use crate::unsupported;

/// A texture that a recording uses by a view of it.
pub(crate) struct Used<'a> {
    pub(crate) texture: &'a wgpu::Texture,
    pub(crate) view: Arc<wgpu::TextureView>,
    pub(crate) format: vk::Format,
}

/// Opens a device with what both libraries need, and returns what the library may use of it.
pub(crate) fn open(
    adapter: &wgpu::Adapter,
    descriptor: &wgpu::DeviceDescriptor<'_>,
) -> Result<(wgpu::Device, wgpu::Queue, Enabled)> {
    let failed = |error: &dyn std::fmt::Display| unsupported("device of the adapter", error.to_string());
    // SAFETY: the adapter is used here alone, and not destroyed.
    let hal =
        unsafe { adapter.as_hal::<Vulkan>() }.ok_or_else(|| failed(&"the adapter is not one of Vulkan"))?;
    let instance = hal.shared_instance();
    // SAFETY: the physical device belongs to the instance.
    let properties =
        unsafe { instance.raw_instance().get_physical_device_properties(hal.raw_physical_device()) };
    if instance.instance_api_version().min(properties.api_version) < vk::API_VERSION_1_3 {
        return Err(failed(&"instance and device must be for Vulkan 1.3"));
    }
    // SAFETY: the physical device belongs to the instance, and both are for Vulkan 1.3.
    let mut enabled = unsafe { Enabled::useful(instance.raw_instance(), hal.raw_physical_device()) }?;
    // wgpu fills in the core features, and does not tell which.
    enabled.fragment_stores_and_atomics = false;
    enabled.fragment_shader_pixel_interlock = false;
    enabled.extensions.retain(|&name| name != ext::fragment_shader_interlock::NAME);
    // It has this structure itself where rays are traced. A chain has one of each.
    let has_addresses = descriptor.required_features.intersects(
        wgpu::Features::EXPERIMENTAL_RAY_QUERY | wgpu::Features::EXPERIMENTAL_RAY_TRACING_PIPELINES,
    );
    let ours =
        Enabled { buffer_device_address: enabled.buffer_device_address && !has_addresses, ..enabled.clone() };
    let mut structures = ours.structures();
    let extensions = &enabled.extensions;
    let add: Box<wgpu::hal::vulkan::CreateDeviceCallback<'_>> = Box::new(|args| {
        for &name in extensions {
            if !args.extensions.contains(&name) {
                args.extensions.push(name);
            }
        }
        *args.create_info = structures.chain(std::mem::take(args.create_info));
    });
    let (features, limits) = (descriptor.required_features, &descriptor.required_limits);
    // SAFETY: what is added is offered by the device, and nothing is removed.
    let opened = unsafe { hal.open_with_callback(features, limits, &descriptor.memory_hints, Some(add)) };
    let opened = opened.map_err(|error| failed(&error))?;
    drop(hal);
    // SAFETY: the device was just made from this adapter, with the descriptor's features and limits.
    let (device, queue) =
        unsafe { adapter.create_device_from_hal(opened, descriptor) }.map_err(|error| failed(&error))?;
    Ok((device, queue, enabled))
}

/// Adopts a device of [`open`], which the result keeps alive.
pub(crate) fn adopt(device: &wgpu::Device, queue: &wgpu::Queue, enabled: Enabled) -> Result<Gpu> {
    // SAFETY: the device is not destroyed here.
    let hal = unsafe { device.as_hal::<Vulkan>() }
        .ok_or_else(|| unsupported("device", "a device of Vulkan, which is not lost"))?;
    let instance = hal.shared_instance();
    let parts = GpuParts {
        entry: instance.entry().clone(),
        instance: instance.raw_instance().clone(),
        // wgpu asks for this version where the loader has it or a later one.
        api_version: vk::API_VERSION_1_3,
        instance_extensions: instance.extensions().to_vec(),
        physical_device: hal.raw_physical_device(),
        device: hal.raw_device().clone(),
        enabled,
        queue_family: hal.queue_family_index(),
        queue: hal.raw_queue(),
        queue_lock: None,
        keep: Some(Arc::new((device.clone(), queue.clone()))),
    };
    drop(hal);
    // SAFETY: the parts belong together and were made with what `enabled` says; wgpu's device, of which the library holds a share,
    // destroys them last. The documentation of the crate says how the queue is shared.
    unsafe { Gpu::from_raw(parts, &GpuOptions::default()) }
}

/// Returns Vulkan's format of textures of a format.
pub(crate) fn raw_format(adapter: &wgpu::Adapter, format: wgpu::TextureFormat) -> Result<vk::Format> {
    // SAFETY: the adapter is not destroyed here.
    let hal = unsafe { adapter.as_hal::<Vulkan>() };
    let hal = hal.ok_or_else(|| unsupported("format", "an adapter of Vulkan"))?;
    Ok(hal.texture_format_as_raw(format))
}

/// Records a frame. The textures are in the states `COLOR_TARGET` and `RESOURCE` of the encoder, and stay in them.
pub(crate) fn record(
    gpu: &Gpu,
    encoder: &mut wgpu::CommandEncoder,
    plan: &mut Plan,
    colour: &Used<'_>,
    depth: Option<(&Used<'_>, DepthProjection)>,
) -> Result<Recorded> {
    let gone = || unsupported("texture", "a texture of Vulkan, which is not destroyed");
    let extent = |used: &Used<'_>| [used.texture.width(), used.texture.height()];
    let image = raw_image(colour).ok_or_else(gone)?;
    let target = raw_view(colour).ok_or_else(gone)?;
    // SAFETY: image and view belong to the device, fit each other by wgpu's checks and those of `composite`, and live until the recording is
    // completed, since it keeps the view; the layout of `COLOR_TARGET` is `COLOR_ATTACHMENT_OPTIMAL`.
    let target = unsafe { TargetImage::from_raw(gpu, image, target, colour.format, extent(colour)) };
    let mut owner = vec![Arc::clone(&colour.view)];
    let depth = match depth {
        Some((depth, projection)) => {
            owner.push(Arc::clone(&depth.view));
            let view = raw_view(depth).ok_or_else(gone)?;
            // SAFETY: as above; the view has the depth alone.
            let image = unsafe { DepthImage::from_raw(gpu, view, depth.format, extent(depth), projection) };
            // The layout that wgpu gives depth textures that are sampled.
            Some(image.in_layout(vk::ImageLayout::DEPTH_STENCIL_READ_ONLY_OPTIMAL))
        }
        None => None,
    };
    let record = |hal: Option<&mut wgpu::hal::vulkan::CommandEncoder>| {
        let hal = hal.ok_or_else(|| unsupported("command encoder", "an encoder of Vulkan"))?;
        // SAFETY: wgpu has begun it, outside of rendering.
        let raw = unsafe { hal.raw_handle() };
        // wgpu orders passes into one colour texture by no barrier.
        order_colours(gpu, raw, image);
        // SAFETY: it belongs to the device and records on this thread, which has the encoder alone; wgpu submits it once, to the queue.
        let mut commands = unsafe { CommandBuffer::from_raw(gpu, raw) };
        let info = RecordInfo {
            target: Some(&target),
            depth: depth.as_ref(),
            owner: Some(Arc::new(owner)),
            ..RecordInfo::default()
        };
        let recorded = plan.record_with(&mut commands, info);
        order_colours(gpu, raw, image);
        recorded
    };
    // SAFETY: the encoder has these commands alone.
    unsafe { encoder.as_hal_mut::<Vulkan, _, _>(record) }
}

/// Orders accesses to a colour attachment before and after this place.
fn order_colours(gpu: &Gpu, commands: vk::CommandBuffer, image: vk::Image) {
    let stage = vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT;
    let layout = vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL;
    let range = vk::ImageSubresourceRange::default()
        .aspect_mask(vk::ImageAspectFlags::COLOR)
        .level_count(1)
        .layer_count(1);
    let barriers = [vk::ImageMemoryBarrier2::default()
        .src_stage_mask(stage)
        .src_access_mask(vk::AccessFlags2::COLOR_ATTACHMENT_WRITE)
        .dst_stage_mask(stage)
        .dst_access_mask(vk::AccessFlags2::COLOR_ATTACHMENT_READ | vk::AccessFlags2::COLOR_ATTACHMENT_WRITE)
        .old_layout(layout)
        .new_layout(layout)
        .image(image)
        .subresource_range(range)];
    let info = vk::DependencyInfo::default().image_memory_barriers(&barriers);
    // SAFETY: recording, outside of rendering; the image is in this layout.
    unsafe { gpu.handles().device.cmd_pipeline_barrier2(commands, &info) };
}

// wgpu holds a lock while what `as_hal` returns is alive: one at a time.
fn raw_image(used: &Used<'_>) -> Option<vk::Image> {
    // SAFETY: the texture is not destroyed here.
    let texture = unsafe { used.texture.as_hal::<Vulkan>() }?;
    // SAFETY: the handle is not destroyed; the recording keeps the view, which keeps the texture.
    Some(unsafe { texture.raw_handle() })
}

fn raw_view(used: &Used<'_>) -> Option<vk::ImageView> {
    // SAFETY: the view is not destroyed here.
    let view = unsafe { used.view.as_hal::<Vulkan>() }?;
    // SAFETY: the handle is not destroyed; the recording keeps the view.
    Some(unsafe { view.raw_handle() })
}
