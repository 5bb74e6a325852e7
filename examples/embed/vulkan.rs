//! The Vulkan objects of the program: instance, device, images, buffers.

use std::any::Any;
use std::error::Error;
use std::ffi::{CStr, c_void};
use std::sync::{Arc, Mutex, PoisonError};

use volraster::ash::{self, ext, vk};
use volraster::gpu::{Enabled, GpuParts};

pub(crate) type Result<T> = std::result::Result<T, Box<dyn Error>>;

const LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Messages of the validation layer.
#[derive(Default)]
pub(crate) struct Log(Mutex<Vec<String>>);

impl Log {
    pub(crate) fn count(&self) -> usize {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).len()
    }
}

unsafe extern "system" fn on_message(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes a valid structure.
    let data = unsafe { &*data };
    // SAFETY: the layer's text ends with NUL.
    let text = unsafe { CStr::from_ptr(data.p_message) }.to_string_lossy().into_owned();
    eprintln!("validation: {text}");
    // SAFETY: the log outlives the messenger.
    let log = unsafe { &*user.cast::<Log>() };
    log.0.lock().unwrap_or_else(PoisonError::into_inner).push(text);
    vk::FALSE
}

/// Owner of instance, device and queue, which it destroys on drop.
pub(crate) struct Vulkan {
    entry: ash::Entry,
    instance: ash::Instance,
    instance_extensions: Vec<&'static CStr>,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    physical: vk::PhysicalDevice,
    pub(crate) device: ash::Device,
    enabled: Enabled,
    pub(crate) family: u32,
    queue: vk::Queue,
    pub(crate) log: Arc<Log>,
}

impl Vulkan {
    /// Opens the first device with a queue for graphics and compute, a GPU before a software one. Validation is on where its
    /// layer is installed.
    pub(crate) fn new() -> Result<Self> {
        // SAFETY: loads the system's Vulkan loader.
        let entry = unsafe { ash::Entry::load() }?;
        // SAFETY: the loader is loaded.
        let layers = unsafe { entry.enumerate_instance_layer_properties() }?;
        let validated = layers.iter().any(|layer| layer.layer_name_as_c_str() == Ok(LAYER));
        println!("validation: {}", if validated { "on" } else { "the layer is not installed" });
        let log = Arc::new(Log::default());
        let mut names = Vec::new();
        let mut layers = Vec::new();
        if validated {
            names.extend([ext::debug_utils::NAME, ext::validation_features::NAME]);
            layers.push(LAYER.as_ptr());
        }
        let name_pointers: Vec<_> = names.iter().map(|name| name.as_ptr()).collect();
        let app = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
        let checks = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut checks = vk::ValidationFeaturesEXT::default().enabled_validation_features(&checks);
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&app)
            .enabled_layer_names(&layers)
            .enabled_extension_names(&name_pointers);
        if validated {
            info = info.push_next(&mut checks);
        }
        // SAFETY: every pointer refers to a local.
        let instance = unsafe { entry.create_instance(&info, None) }?;
        let messenger = if validated { Some(messenger(&entry, &instance, &log)?) } else { None };
        let (physical, family) = choose(&instance)?;
        // SAFETY: the physical device is of this instance, which is for Vulkan 1.3.
        let enabled = unsafe { Enabled::useful(&instance, physical) }?;

        // Everything that the library can use, and timeline semaphores for the program itself.
        let names_of_device: Vec<_> = enabled.extensions.iter().map(|name| name.as_ptr()).collect();
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
        let features = enabled.features();
        let mut structures = enabled.structures();
        let mut timeline = vk::PhysicalDeviceTimelineSemaphoreFeatures::default().timeline_semaphore(true);
        let info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&names_of_device)
            .enabled_features(&features)
            .push_next(&mut timeline);
        let info = structures.chain(info);
        // SAFETY: every pointer refers to a local; all that is enabled is offered.
        let device = unsafe { instance.create_device(physical, &info, None) }?;
        // SAFETY: the device was created with one queue of this family.
        let queue = unsafe { device.get_device_queue(family, 0) };
        let instance_extensions = names;
        Ok(Self {
            entry,
            instance,
            instance_extensions,
            messenger,
            physical,
            device,
            enabled,
            family,
            queue,
            log,
        })
    }

    /// Returns the parts that the library adopts, among them a share of the owner.
    pub(crate) fn parts(self: &Arc<Self>) -> GpuParts {
        GpuParts {
            entry: self.entry.clone(),
            instance: self.instance.clone(),
            api_version: vk::API_VERSION_1_3,
            instance_extensions: self.instance_extensions.clone(),
            physical_device: self.physical,
            device: self.device.clone(),
            enabled: self.enabled.clone(),
            queue_family: self.family,
            queue: self.queue,
            // This program submits through `Gpu::with_queue`, and has no lock of its own.
            queue_lock: None,
            // Device and instance outlive whatever of the library the program drops last.
            keep: Some(Arc::clone(self) as Arc<dyn Any + Send + Sync>),
        }
    }

    fn allocate(
        &self,
        needs: vk::MemoryRequirements,
        flags: vk::MemoryPropertyFlags,
    ) -> Result<vk::DeviceMemory> {
        // SAFETY: the physical device is of this instance.
        let types = unsafe { self.instance.get_physical_device_memory_properties(self.physical) };
        let fits = |&(i, kind): &(u32, &vk::MemoryType)| {
            needs.memory_type_bits & (1 << i) != 0 && kind.property_flags.contains(flags)
        };
        let (index, _) = (0..).zip(types.memory_types_as_slice()).find(fits).ok_or("no memory of a kind")?;
        let info = vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(index);
        // SAFETY: the type is one of the device's.
        Ok(unsafe { self.device.allocate_memory(&info, None) }?)
    }
}

impl Drop for Vulkan {
    fn drop(&mut self) {
        // SAFETY: nothing is pending, and everything made from the device is destroyed: the program borrows this, and the
        // library holds a share of it.
        unsafe { self.device.destroy_device(None) };
        if let Some((utils, messenger)) = self.messenger.take() {
            // SAFETY: made from this instance.
            unsafe { utils.destroy_debug_utils_messenger(messenger, None) };
        }
        // SAFETY: the device is gone.
        unsafe { self.instance.destroy_instance(None) };
    }
}

fn messenger(
    entry: &ash::Entry,
    instance: &ash::Instance,
    log: &Arc<Log>,
) -> Result<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)> {
    let utils = ext::debug_utils::Instance::new(entry, instance);
    let severities =
        vk::DebugUtilsMessageSeverityFlagsEXT::ERROR | vk::DebugUtilsMessageSeverityFlagsEXT::WARNING;
    let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(severities)
        .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
        .pfn_user_callback(Some(on_message))
        .user_data(Arc::as_ptr(log).cast_mut().cast());
    // SAFETY: the log lives as long as the messenger: the caller has both.
    let messenger = unsafe { utils.create_debug_utils_messenger(&info, None) }?;
    Ok((utils, messenger))
}

/// Chooses a device, and a queue family for graphics and compute.
fn choose(instance: &ash::Instance) -> Result<(vk::PhysicalDevice, u32)> {
    let both = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
    let mut best: Option<(bool, vk::PhysicalDevice, u32)> = None;
    // SAFETY: the instance is alive.
    for physical in unsafe { instance.enumerate_physical_devices() }? {
        // SAFETY: of this instance.
        let properties = unsafe { instance.get_physical_device_properties(physical) };
        // SAFETY: of this instance.
        let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
        let family = (0..).zip(&families).find(|(_, family)| family.queue_flags.contains(both));
        let software = properties.device_type == vk::PhysicalDeviceType::CPU;
        if let Some((family, _)) = family
            && properties.api_version >= vk::API_VERSION_1_3
            && best.is_none_or(|(other_is_software, ..)| other_is_software && !software)
        {
            best = Some((software, physical, family));
        }
    }
    let (_, physical, family) = best.ok_or("no device for Vulkan 1.3 with graphics and compute")?;
    Ok((physical, family))
}

/// An image with its memory and its views.
pub(crate) struct Image<'a> {
    vulkan: &'a Vulkan,
    pub(crate) raw: vk::Image,
    memory: vk::DeviceMemory,
    pub(crate) view: vk::ImageView,
    /// A view in the other format, where one is asked for.
    pub(crate) other: vk::ImageView,
    pub(crate) range: vk::ImageSubresourceRange,
}

impl<'a> Image<'a> {
    pub(crate) fn new(
        vulkan: &'a Vulkan,
        format: vk::Format,
        other: Option<vk::Format>,
        aspect: vk::ImageAspectFlags,
        usage: vk::ImageUsageFlags,
        [width, height]: [u32; 2],
    ) -> Result<Self> {
        let range = vk::ImageSubresourceRange::default().aspect_mask(aspect).level_count(1).layer_count(1);
        let mut image = Self {
            vulkan,
            raw: vk::Image::null(),
            memory: vk::DeviceMemory::null(),
            view: vk::ImageView::null(),
            other: vk::ImageView::null(),
            range,
        };
        let device = &vulkan.device;
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(format)
            .extent(vk::Extent3D { width, height, depth: 1 })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .flags(other.map_or(vk::ImageCreateFlags::empty(), |_| vk::ImageCreateFlags::MUTABLE_FORMAT))
            .usage(usage);
        // SAFETY: every device supports these formats and usages.
        image.raw = unsafe { device.create_image(&info, None) }?;
        // SAFETY: just made.
        let needs = unsafe { device.get_image_memory_requirements(image.raw) };
        image.memory = vulkan.allocate(needs, vk::MemoryPropertyFlags::DEVICE_LOCAL)?;
        // SAFETY: fresh image and memory of its size.
        unsafe { device.bind_image_memory(image.raw, image.memory, 0) }?;
        let view = |format| {
            let info = vk::ImageViewCreateInfo::default()
                .image(image.raw)
                .view_type(vk::ImageViewType::TYPE_2D)
                .format(format)
                .subresource_range(range);
            // SAFETY: the image is bound; another format is one of the same size, for which the image was made.
            unsafe { device.create_image_view(&info, None) }
        };
        image.view = view(format)?;
        if let Some(other) = other {
            image.other = view(other)?;
        }
        Ok(image)
    }
}

impl Drop for Image<'_> {
    fn drop(&mut self) {
        for view in [self.view, self.other] {
            // SAFETY: no submission that uses it is pending; null is allowed.
            unsafe { self.vulkan.device.destroy_image_view(view, None) };
        }
        // SAFETY: as above.
        unsafe { self.vulkan.device.destroy_image(self.raw, None) };
        // SAFETY: its image is gone.
        unsafe { self.vulkan.device.free_memory(self.memory, None) };
    }
}

/// A buffer that the host reads.
pub(crate) struct ReadBack<'a> {
    vulkan: &'a Vulkan,
    pub(crate) raw: vk::Buffer,
    memory: vk::DeviceMemory,
    bytes: usize,
}

impl<'a> ReadBack<'a> {
    pub(crate) fn new(vulkan: &'a Vulkan, bytes: usize) -> Result<Self> {
        let mut buffer = Self { vulkan, raw: vk::Buffer::null(), memory: vk::DeviceMemory::null(), bytes };
        let device = &vulkan.device;
        let info = vk::BufferCreateInfo::default()
            .size(u64::try_from(bytes)?)
            .usage(vk::BufferUsageFlags::TRANSFER_DST);
        // SAFETY: not empty.
        buffer.raw = unsafe { device.create_buffer(&info, None) }?;
        // SAFETY: just made.
        let needs = unsafe { device.get_buffer_memory_requirements(buffer.raw) };
        let flags = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        buffer.memory = vulkan.allocate(needs, flags)?;
        // SAFETY: fresh buffer and memory of its size.
        unsafe { device.bind_buffer_memory(buffer.raw, buffer.memory, 0) }?;
        Ok(buffer)
    }

    /// Copies the contents; no submission that writes the buffer may be pending.
    pub(crate) fn read(&self) -> Result<Vec<u8>> {
        let (device, flags) = (&self.vulkan.device, vk::MemoryMapFlags::empty());
        // SAFETY: host-visible, not mapped.
        let pointer = unsafe { device.map_memory(self.memory, 0, vk::WHOLE_SIZE, flags) }?;
        // SAFETY: mapped for at least this many bytes, which the device no longer writes.
        let bytes = unsafe { std::slice::from_raw_parts(pointer.cast::<u8>(), self.bytes) }.to_vec();
        // SAFETY: mapped above.
        unsafe { device.unmap_memory(self.memory) };
        Ok(bytes)
    }
}

impl Drop for ReadBack<'_> {
    fn drop(&mut self) {
        // SAFETY: no submission that uses it is pending; null is allowed.
        unsafe { self.vulkan.device.destroy_buffer(self.raw, None) };
        // SAFETY: its buffer is gone.
        unsafe { self.vulkan.device.free_memory(self.memory, None) };
    }
}
