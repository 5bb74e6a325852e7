//! An engine: its own instance and device under validation, with the features that a test asks for.

use std::ffi::{CStr, c_void};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use volraster::ash::{self, ext, vk};
use volraster::gpu::{Enabled, Gpu, GpuOptions, GpuParts, PipelineCache, devices};

/// The layer keeps its devices in a table without a lock: tests with devices take turns.
pub fn turn() -> MutexGuard<'static, ()> {
    static TURN: Mutex<()> = Mutex::new(());
    TURN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The loader of the process, which stays, as that of an engine does.
static LOADER: OnceLock<ash::Entry> = OnceLock::new();

/// What the validation layers said.
#[derive(Default)]
pub struct Log(Mutex<Vec<String>>);

impl Log {
    pub fn messages(&self) -> Vec<String> {
        self.0.lock().unwrap().clone()
    }
}

unsafe extern "system" fn on_message(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes a valid structure.
    let data = unsafe { &*data };
    // SAFETY: the layer's id ends with zero.
    let id = unsafe { CStr::from_ptr(data.p_message_id_name) }.to_string_lossy();
    // Drivers ask a device for commands of the instance.
    if id == "WARNING-vkGetDeviceProcAddr-device" {
        return vk::FALSE;
    }
    // SAFETY: the layer's text ends with zero.
    let text = unsafe { CStr::from_ptr(data.p_message) }.to_string_lossy().into_owned();
    eprintln!("validation: {text}");
    // SAFETY: the log outlives the messenger: the engine holds both.
    let log = unsafe { &*user.cast::<Log>() };
    log.0.lock().unwrap().push(text);
    vk::FALSE
}

/// Instance and device of the caller; both are destroyed with it.
pub struct Engine {
    pub entry: ash::Entry,
    pub instance: ash::Instance,
    messenger: (ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT),
    pub physical: vk::PhysicalDevice,
    pub device: ash::Device,
    pub family: u32,
    pub queue: vk::Queue,
    pub enabled: Enabled,
    pub log: Arc<Log>,
}

impl Engine {
    /// An engine on the device that the crate would take. `choose` says what of all that is useful shall be enabled.
    pub fn new(choose: impl FnOnce(Enabled) -> Enabled) -> Self {
        Self::for_version(vk::API_VERSION_1_3, choose)
    }

    /// One whose instance is for another version; an older one has nothing that is useful.
    pub fn for_version(version: u32, choose: impl FnOnce(Enabled) -> Enabled) -> Self {
        // SAFETY: loads the system's loader.
        let load = || unsafe { ash::Entry::load() }.unwrap();
        let entry = LOADER.get_or_init(load).clone();
        let log = Arc::new(Log::default());
        let mut info = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::ERROR | vk::DebugUtilsMessageSeverityFlagsEXT::WARNING,
            )
            .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
            .pfn_user_callback(Some(on_message))
            .user_data(Arc::as_ptr(&log).cast_mut().cast());
        let messenger_info = info;
        let app = vk::ApplicationInfo::default().api_version(version);
        let layers = [c"VK_LAYER_KHRONOS_validation".as_ptr()];
        let names = [ext::debug_utils::NAME.as_ptr(), ext::validation_features::NAME.as_ptr()];
        let checks = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut checks = vk::ValidationFeaturesEXT::default().enabled_validation_features(&checks);
        let create = vk::InstanceCreateInfo::default()
            .application_info(&app)
            .enabled_layer_names(&layers)
            .enabled_extension_names(&names)
            .push_next(&mut checks)
            .push_next(&mut info);
        // SAFETY: every pointer refers to a local.
        let instance = unsafe { entry.create_instance(&create, None) }.unwrap();
        let utils = ext::debug_utils::Instance::new(&entry, &instance);
        // SAFETY: the log lives as long as the engine.
        let messenger = unsafe { utils.create_debug_utils_messenger(&messenger_info, None) }.unwrap();
        let chosen = devices(None).unwrap().iter().position(|report| report.chosen).unwrap();
        // SAFETY: the instance is alive.
        let physical = unsafe { instance.enumerate_physical_devices() }.unwrap()[chosen];
        // SAFETY: the physical device is of this instance.
        let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
        let both = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
        let family = families.iter().position(|family| family.queue_flags.contains(both)).unwrap() as u32;
        let new = version >= vk::API_VERSION_1_3;
        let useful = if new {
            // SAFETY: of this instance, for Vulkan 1.3: the device was chosen.
            unsafe { Enabled::useful(&instance, physical) }.unwrap()
        } else {
            Enabled::default()
        };
        let enabled = choose(useful);

        let names: Vec<_> = enabled.extensions.iter().map(|name| name.as_ptr()).collect();
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
        let features = enabled.features();
        let mut structures = enabled.structures();
        let mut timeline = vk::PhysicalDeviceTimelineSemaphoreFeatures::default().timeline_semaphore(true);
        let mut create = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&names)
            .enabled_features(&features);
        if new {
            create = create.push_next(&mut timeline);
        }
        let create = structures.chain(create);
        // SAFETY: every pointer refers to a local.
        assert_eq!(unsafe { Enabled::from_create_info(&create) }, enabled);
        // SAFETY: the same; all that is enabled is offered.
        let device = unsafe { instance.create_device(physical, &create, None) }.unwrap();
        // SAFETY: one queue of this family was asked for.
        let queue = unsafe { device.get_device_queue(family, 0) };
        let messenger = (utils, messenger);
        Self { entry, instance, messenger, physical, device, family, queue, enabled, log }
    }

    /// One with all that is useful.
    pub fn full() -> Self {
        Self::new(|useful| useful)
    }

    /// One with the least that the crate takes.
    pub fn least() -> Self {
        Self::new(|_| Enabled { synchronization2: true, dynamic_rendering: true, ..Enabled::default() })
    }

    /// What [`Gpu::from_raw`] takes of it.
    pub fn parts(&self) -> GpuParts {
        GpuParts {
            entry: self.entry.clone(),
            instance: self.instance.clone(),
            api_version: vk::API_VERSION_1_3,
            instance_extensions: vec![ext::debug_utils::NAME],
            physical_device: self.physical,
            device: self.device.clone(),
            enabled: self.enabled.clone(),
            queue_family: self.family,
            queue: self.queue,
            queue_lock: None,
            keep: None,
        }
    }

    /// The crate's part on it.
    pub fn gpu(&self) -> Gpu {
        adopt(self.parts()).unwrap()
    }

    /// Ends it. The layers have said nothing, and say nothing of the end.
    #[track_caller]
    pub fn end_silently(self) {
        let log = Arc::clone(&self.log);
        drop(self);
        assert_eq!(log.messages(), [""; 0]);
    }
}

/// Without a pipeline cache on disk.
pub fn adopt(parts: GpuParts) -> volraster::Result<Gpu> {
    let options = GpuOptions { pipeline_cache: PipelineCache::Off, ..GpuOptions::default() };
    // SAFETY: the parts are an engine's, which outlives what is made from it.
    unsafe { Gpu::from_raw(parts, &options) }
}

impl Drop for Engine {
    fn drop(&mut self) {
        // SAFETY: nothing is pending, and all that was made from the device is gone.
        unsafe { self.device.destroy_device(None) };
        // SAFETY: made from this instance.
        unsafe { self.messenger.0.destroy_debug_utils_messenger(self.messenger.1, None) };
        // SAFETY: the device is gone.
        unsafe { self.instance.destroy_instance(None) };
    }
}
