//! A program of its own with a device of its own, which draws a tiny volume.

use std::error::Error;
use std::sync::Arc;

use volraster::ash::{self, vk};
use volraster::glam::DVec3;
use volraster::gpu::{Enabled, GpuOptions, GpuParts, OptionalFeature};
use volraster::scene::{Camera, Field, Projection, Scene, TransferFunction, View};
use volraster::{Gpu, GpuScene, Renderer, Technique};

fn main() -> Result<(), Box<dyn Error>> {
    // SAFETY: loads the system's Vulkan loader.
    let entry = unsafe { ash::Entry::load() }?;
    let app = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
    // SAFETY: the pointer refers to a local.
    let instance =
        unsafe { entry.create_instance(&vk::InstanceCreateInfo::default().application_info(&app), None) }?;
    // SAFETY: the instance is alive.
    let physical = *unsafe { instance.enumerate_physical_devices() }?.first().ok_or("no device")?;
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(0).queue_priorities(&[1.0])];
    let mut features =
        vk::PhysicalDeviceVulkan13Features::default().synchronization2(true).dynamic_rendering(true);
    let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).push_next(&mut features);
    // SAFETY: every pointer in `info` refers to a local.
    let enabled = unsafe { Enabled::from_create_info(&info) };
    // SAFETY: the same.
    let device = unsafe { instance.create_device(physical, &info, None) }?;
    // SAFETY: one queue of this family was asked for.
    let queue = unsafe { device.get_device_queue(0, 0) };
    let parts = GpuParts {
        // The library is unloaded with the last one: this program keeps its own to the end.
        entry: entry.clone(),
        instance: instance.clone(),
        api_version: vk::API_VERSION_1_3,
        instance_extensions: Vec::new(),
        physical_device: physical,
        device: device.clone(),
        enabled,
        queue_family: 0,
        queue,
        queue_lock: None,
        keep: Some(Arc::new(Owner { device, instance })),
    };
    // SAFETY: the parts belong together, and their owner goes last; nobody else uses the queue.
    let gpu = unsafe { Gpu::from_raw(parts, &GpuOptions::default()) }?;
    assert!(!gpu.has(OptionalFeature::FragmentStores));
    draw(&gpu)
}

/// Owner of device and instance, which go with the last object that the library has made from them.
struct Owner {
    device: ash::Device,
    instance: ash::Instance,
}

impl Drop for Owner {
    fn drop(&mut self) {
        // SAFETY: nothing is pending, and all that was made from it is gone.
        unsafe { self.device.destroy_device(None) };
        // SAFETY: the device is gone.
        unsafe { self.instance.destroy_instance(None) };
    }
}

fn draw(gpu: &Gpu) -> Result<(), Box<dyn Error>> {
    // A cube of side 2 with extinction 1: the line through its centre keeps exp(-2).
    let constant = TransferFunction::from_rows(&[[0.0, 1.0, 0.5, 0.25, 1.0], [1.0, 1.0, 0.5, 0.25, 1.0]])?;
    let scene = Scene::new(Field::Homogeneous(0.5).sample([8, 8, 8], "u8")?, constant);
    let camera = Camera {
        eye: DVec3::new(0.0, 0.0, 5.0),
        target: DVec3::ZERO,
        up: DVec3::Y,
        projection: Projection::Orthographic { half_height: 1.5 },
    };
    let renderer = Renderer::new(&GpuScene::new(gpu, scene), Technique::parse("slices-3d")?);
    let image = renderer.render(&View::new(camera, 33, 33)?)?;
    println!("{} {:?} {:?}", gpu.report().name, image.pixel(16, 16), image.pixel(0, 0));
    Ok(())
}
