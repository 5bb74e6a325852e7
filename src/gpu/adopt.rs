//! A device that the caller made.

use std::any::Any;
use std::ffi::{CStr, CString};
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

/// What [`Gpu::from_raw`] is made of: an instance, a device and a queue of the caller.
///
/// A caller without `ash`, or with another version of it, makes the first ones from handles, with the types of
/// [`volraster::ash`](crate::ash): [`ash::Entry::from_static_fn`] from its `vkGetInstanceProcAddr`,
/// [`ash::Instance::load`], [`ash::Device::load`], and `from_raw` of [`vk::Handle`].
#[derive(Clone)]
pub struct GpuParts {
    /// The loader, which is unloaded with the last clone: the caller keeps one for as long as it uses instance or device
    /// itself.
    pub entry: ash::Entry,
    /// The instance.
    pub instance: ash::Instance,
    /// Version in the `VkApplicationInfo` that the instance was made with: at least 1.3.
    pub api_version: u32,
    /// Instance extensions that are enabled; those without a use are ignored. Used is `VK_EXT_debug_utils`:
    /// [`OptionalFeature::DebugNames`](super::OptionalFeature::DebugNames).
    pub instance_extensions: Vec<CString>,
    /// The physical device of that instance: Vulkan 1.3 or later.
    pub physical_device: vk::PhysicalDevice,
    /// The device.
    pub device: ash::Device,
    /// What is enabled on it. What is not named here is not used, even if it is there.
    pub enabled: Enabled,
    /// The queue's family: graphics and compute.
    pub queue_family: u32,
    /// The queue.
    pub queue: vk::Queue,
    /// Held around every submission to the queue. Without it, threads of this crate take turns among themselves, and the
    /// caller uses the queue through [`Gpu::with_queue`] alone, or not at all. It must not be held by a thread that calls
    /// into this crate, unless to record.
    pub queue_lock: Option<Arc<dyn QueueLock>>,
    /// Let go after the last thing that was made from the device: whatever destroys device and instance may be put here.
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

/// Functions of Vulkan 1.3 that are called. A driver does not give them to a device of an instance for less.
const FUNCTIONS: [&CStr; 5] = [
    c"vkCmdPipelineBarrier2",
    c"vkQueueSubmit2",
    c"vkCmdBeginRendering",
    c"vkCmdEndRendering",
    c"vkCmdWriteTimestamp2",
];

impl Gpu {
    /// Takes a device that the caller made. Neither device nor instance is destroyed by this crate; all that it makes from
    /// them is gone with the last clone of the [`Gpu`] and the last of what was made from it, without a wait.
    ///
    /// What is enabled is checked against what is needed: required are instance and device for Vulkan 1.3,
    /// `synchronization2`, `dynamicRendering`, and a queue for graphics and compute. What else is not enabled the device does
    /// not [have](Gpu::has), and its fallback is taken.
    ///
    /// Of `options`, `device` and `validation` must not be set. Messages of validation layers go to the caller's messenger:
    /// [`Gpu::validation_log`] stays empty.
    ///
    /// # Errors
    ///
    /// [`Error::Unsupported`] naming what is required and missing, [`Error::Invalid`] for a null handle, a physical device
    /// of another instance, what is said to be enabled and cannot be, and options that are not the caller's to set;
    /// [`Error::Vulkan`] when a call fails.
    ///
    /// # Safety
    ///
    /// - The functions of `entry`, `instance` and `device` are Vulkan's, loaded for these handles; the device was made from
    ///   the instance and its physical device, the queue is of the device and its family, and not a protected one;
    /// - `api_version`, `instance_extensions` and `enabled` name nothing that the instance or the device was not made with;
    /// - instance, device and queue live until the last clone of the [`Gpu`] and everything that was made from it is gone:
    ///   at the latest when `keep` is let go;
    /// - while this crate may submit, the queue is used through [`Gpu::with_queue`] or under `queue_lock` alone, and nobody
    ///   waits for the whole device to be idle except so.
    pub unsafe fn from_raw(parts: GpuParts, options: &GpuOptions) -> Result<Self> {
        if options.device.is_some() || options.validation != Validation::Off {
            return Err(Error::invalid(
                "options of Gpu::from_raw",
                "device and validation are for a device that the crate opens: leave them unset",
            ));
        }
        let family = crate::num::index(parts.queue_family);
        parts.check_handles()?;
        if parts.api_version < vk::API_VERSION_1_3 {
            return Err(missing(format!(
                "an instance for Vulkan {} is older than the required 1.3",
                version_text(parts.api_version)
            )));
        }
        // SAFETY: by the caller's promise an instance of this loader for at least Vulkan 1.3.
        let devices = unsafe { parts.instance.enumerate_physical_devices() }
            .map_err(|result| Error::Vulkan { call: "vkEnumeratePhysicalDevices", result })?;
        if !devices.contains(&parts.physical_device) {
            return Err(invalid("the physical device is not of this instance"));
        }
        let mut candidate = inspect(&parts.instance, parts.physical_device, Some(family));
        if let Some(lack) = &candidate.refused {
            return Err(missing(lack.clone()));
        }
        parts.check_enabled()?;
        candidate.queue_family = parts.queue_family;
        candidate.report.chosen = true;
        candidate.report.reason = "the caller's".to_string();
        let GpuParts { entry, instance, device, mut enabled, keep, .. } = parts;
        enabled.fragment_shader_pixel_interlock &= enabled.has(ext::fragment_shader_interlock::NAME);
        let debug_utils =
            parts.instance_extensions.iter().any(|name| name.as_c_str() == ext::debug_utils::NAME);
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

    /// What is required, and that nothing is claimed that cannot be.
    fn check_enabled(&self) -> Result<()> {
        // SAFETY: the physical device is of this instance, and both are for Vulkan 1.3: that was checked.
        let offered = unsafe { Enabled::useful(&self.instance, self.physical_device) }?;
        if let Some(what) = self.enabled.beyond(&offered) {
            return Err(invalid(format!("{what} is said to be enabled, and the device does not offer it")));
        }
        if !self.enabled.synchronization2 {
            return Err(missing("the required feature synchronization2 is not enabled".to_string()));
        }
        if !self.enabled.dynamic_rendering {
            return Err(missing("the required feature dynamicRendering is not enabled".to_string()));
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
