//! Devices made by the caller.

use std::any::Any;
use std::ffi::CStr;
use std::sync::Arc;

use ash::{ext, vk};

use ash::vk::Handle as _;

use super::device::Gpu;
use super::feature::Enabled;
use super::instance::{Instance, version_text};
use super::open::Opened;
use super::options::GpuOptions;
use super::queue::{Queue, QueueLock};
use super::select::inspect;
use super::validation::Validation;
use crate::error::{Error, Result};

/// The parts of a [`Gpu::from_raw`]: an instance, a device and a queue of the caller.
///
/// A caller without `ash`, or with another version of it, makes them from handles with the types of
/// [`volraster::ash`](crate::ash): [`ash::Entry::from_static_fn`] from its `vkGetInstanceProcAddr`,
/// [`ash::Instance::load`], [`ash::Device::load`], and `from_raw` of [`vk::Handle`].
#[derive(Clone)]
pub struct GpuParts {
    /// The loader. The last clone unloads it: the caller keeps a clone for as long as it uses instance or device
    /// itself.
    pub entry: ash::Entry,
    /// The instance.
    pub instance: ash::Instance,
    /// Vulkan version in the `VkApplicationInfo` of the instance, at least 1.3.
    pub api_version: u32,
    /// Enabled instance extensions. The crate uses `VK_EXT_debug_utils` for
    /// [`OptionalFeature::DebugNames`](super::OptionalFeature::DebugNames), and ignores others.
    pub instance_extensions: Vec<&'static CStr>,
    /// A physical device of that instance, for Vulkan 1.3 or later.
    pub physical_device: vk::PhysicalDevice,
    /// The device.
    pub device: ash::Device,
    /// The enabled extensions and features. The crate does not use what is not named here.
    pub enabled: Enabled,
    /// The family of the queue, for graphics and compute.
    pub queue_family: u32,
    /// The queue.
    pub queue: vk::Queue,
    /// Lock that the crate holds around every submission to the queue. Without it the crate serialises its own
    /// submissions, and the caller uses the queue only through [`Gpu::with_queue`]. A thread that holds the lock must not
    /// call into this crate, except to record.
    pub queue_lock: Option<Arc<dyn QueueLock>>,
    /// Owner of device and instance: a value whose `Drop` destroys them, or shares of it. The crate drops it after the
    /// last object that it has made from the device.
    ///
    /// `None` is sound only where something else guarantees that device and instance outlive the last clone of the
    /// [`Gpu`] and everything made from it, for instance because they are never destroyed. Plans, scenes and recordings
    /// hold clones of the [`Gpu`]: a caller that destroys its device while one of them is alive crashes when that one is
    /// dropped.
    pub keep: Option<Arc<dyn Any + Send + Sync>>,
}

impl std::fmt::Debug for GpuParts {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GpuParts")
            .field("physical_device", &self.physical_device)
            .field("device", &self.device.handle())
            .field("enabled", &self.enabled)
            .field("queue", &self.queue)
            .finish_non_exhaustive()
    }
}

/// Functions of Vulkan 1.3 that the crate calls. Drivers do not return them for devices of older instances.
const FUNCTIONS: [&CStr; 5] = [
    c"vkCmdPipelineBarrier2",
    c"vkQueueSubmit2",
    c"vkCmdBeginRendering",
    c"vkCmdEndRendering",
    c"vkCmdWriteTimestamp2",
];

impl Gpu {
    /// Adopts a device that the caller made. The crate destroys neither device nor instance. Dropping the last clone of the
    /// [`Gpu`] and the last object made from it destroys everything that the crate has made, without a wait.
    ///
    /// Required are an instance and a device for Vulkan 1.3 with `synchronization2` and `dynamicRendering`, and a queue for
    /// graphics and compute. For optional features that are not enabled the crate uses the fallback; see [`Gpu::has`].
    ///
    /// `options` must leave `device` and `validation` unset. Messages of the validation layer go to the caller's messenger:
    /// [`Gpu::validation_log`] stays empty.
    ///
    /// # Errors
    ///
    /// [`Error::Unsupported`] names a missing requirement; [`Error::Invalid`] reports a null handle, a physical device of
    /// another instance, an enabled feature that the device does not offer, or options that must be unset;
    /// [`Error::Vulkan`] a failed call.
    ///
    /// # Safety
    ///
    /// - The functions of `entry`, `instance` and `device` are Vulkan's, loaded for these handles; the device was made from
    ///   the instance and the physical device; the queue belongs to the device and the family, and is not protected;
    /// - `api_version`, `instance_extensions` and `enabled` name only what instance and device were made with;
    /// - instance, device and queue live until the last clone of the [`Gpu`] and everything made from it is dropped, which
    ///   is when the crate drops `keep`;
    /// - while this crate may submit, the queue is used, and the whole device waited for, only through
    ///   [`Gpu::with_queue`] or under `queue_lock`.
    pub unsafe fn from_raw(parts: GpuParts, options: &GpuOptions) -> Result<Self> {
        let own = options.device.is_some() || options.validation != Validation::Off;
        if own || options.shader_statistics {
            return Err(Error::invalid(
                "options of Gpu::from_raw",
                "device, validation and shader_statistics are for a device that the crate opens: leave them unset",
            ));
        }
        parts.check_handles()?;
        if parts.api_version < vk::API_VERSION_1_3 {
            return Err(missing(format!(
                "an instance for Vulkan {} is older than the required 1.3",
                version_text(parts.api_version)
            )));
        }
        // SAFETY: the caller promises an instance of this loader for at least Vulkan 1.3.
        let devices = unsafe { parts.instance.enumerate_physical_devices() }
            .map_err(|result| Error::Vulkan { call: "vkEnumeratePhysicalDevices", result })?;
        if !devices.contains(&parts.physical_device) {
            return Err(invalid("the physical device is not of this instance"));
        }
        let mut candidate =
            inspect(&parts.instance, parts.physical_device, Some(crate::num::index(parts.queue_family)));
        if let Some(lack) = &candidate.refused {
            return Err(missing(lack.clone()));
        }
        parts.check_enabled()?;
        candidate.report.chosen = true;
        candidate.report.reason = "the caller's".to_string();
        let GpuParts { entry, instance, device, mut enabled, keep, .. } = parts;
        enabled.fragment_shader_pixel_interlock &= enabled.has(ext::fragment_shader_interlock::NAME);
        let debug_utils = parts.instance_extensions.contains(&ext::debug_utils::NAME);
        let reports = vec![candidate.report.clone()];
        let opened = Opened {
            instance: Instance::adopt(entry, instance, debug_utils, keep),
            device,
            candidate,
            enabled,
            queue: Queue::new(parts.queue, parts.queue_lock),
            reports,
            owned: false,
        };
        Self::assemble(options, opened)
    }
}

impl GpuParts {
    fn check_handles(&self) -> Result<()> {
        let null = [
            ("instance", self.instance.handle().is_null()),
            ("physical device", self.physical_device.is_null()),
            ("device", self.device.handle().is_null()),
            ("queue", self.queue.is_null()),
        ];
        match null.iter().find(|(_, null)| *null) {
            Some((name, _)) => Err(invalid(format!("the {name} is null"))),
            None => Ok(()),
        }
    }

    /// Checks that requirements are enabled, and that the device offers what is said to be enabled.
    fn check_enabled(&self) -> Result<()> {
        // SAFETY: the physical device is of this instance, and both are for Vulkan 1.3: that was checked.
        let offered = unsafe { Enabled::useful(&self.instance, self.physical_device) }?;
        if let Some(what) = self.enabled.beyond(&offered) {
            return Err(invalid(format!("{what} is said to be enabled, and the device does not offer it")));
        }
        let Enabled { synchronization2, dynamic_rendering, .. } = self.enabled;
        for (on, name) in [(synchronization2, "synchronization2"), (dynamic_rendering, "dynamicRendering")] {
            if !on {
                return Err(missing(format!("the required feature {name} is not enabled")));
            }
        }
        let get = self.instance.fp_v1_0().get_device_proc_addr;
        for name in FUNCTIONS {
            // SAFETY: a device of this instance, and the name of a function.
            if unsafe { get(self.device.handle(), name.as_ptr()) }.is_none() {
                let name = name.to_string_lossy();
                return Err(missing(format!("the device has no {name}: it was not made for Vulkan 1.3")));
            }
        }
        Ok(())
    }
}

fn missing(what: String) -> Error {
    Error::unsupported("the caller's device", what)
}

fn invalid(why: impl Into<String>) -> Error {
    Error::invalid("the caller's device", why)
}
