//! The Vulkan instance, with its loader, the validation layer and its messenger. Tests hook the loader to count its calls and make
//! them fail.

use std::any::Any;
use std::ffi::{CStr, CString};
use std::sync::Arc;

use ash::{ext, vk};

#[cfg(feature = "testing")]
use super::inject::Hook;
use super::options::GpuOptions;
use super::validation::{Validation, ValidationLog, messenger_info};
use crate::error::{Error, Result};

const LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// The extensions for surfaces of windows, of which a system has some.
#[cfg(feature = "window")]
const SURFACES: [&CStr; 6] = [
    ash::khr::surface::NAME,
    ash::khr::wayland_surface::NAME,
    ash::khr::xcb_surface::NAME,
    ash::khr::xlib_surface::NAME,
    ash::khr::win32_surface::NAME,
    ext::metal_surface::NAME,
];

/// A Vulkan instance. An instance of the crate's own destroys itself and its messenger.
pub(crate) struct Instance {
    pub(crate) raw: ash::Instance,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    /// Whether object names and labels are available.
    pub(crate) debug_utils: bool,
    /// Version of the validation layer, if the crate has enabled it.
    pub(crate) layer_version: Option<String>,
    pub(crate) log: Arc<ValidationLog>,
    /// The enabled extensions for surfaces.
    #[cfg(feature = "cli")]
    pub(super) surfaces: Vec<&'static CStr>,
    /// Whether the crate has made it.
    owned: bool,
    /// Owner of the caller's instance and device.
    _keep: Option<Arc<dyn Any + Send + Sync>>,
    // Last: the library is unloaded after everything that calls into it is gone.
    loader: Loader,
}

impl std::fmt::Debug for Instance {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Instance")
            .field("handle", &self.raw.handle())
            .field("layer_version", &self.layer_version)
            .finish_non_exhaustive()
    }
}

impl Instance {
    /// Makes an instance for Vulkan 1.3, with the validation layer and its messenger where `options` ask for them.
    pub(crate) fn new(options: &GpuOptions) -> Result<Self> {
        let validation = options.validation;
        let loader = Loader::load(options)?;
        let entry = &loader.entry;
        let mut layer = if validation == Validation::Off { None } else { Some(find_layer(entry)?) };
        let log = options.validation_log.clone().unwrap_or_default();
        if validation.best_practices() {
            log.keep_advice();
        }

        // SAFETY: the loader is loaded; no layer is named.
        let extensions = unsafe { entry.enumerate_instance_extension_properties(None) }
            .map_err(|result| Error::vulkan("vkEnumerateInstanceExtensionProperties", result))?;
        let has = |name: &CStr| extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
        let debug_utils = layer.is_some() || has(ext::debug_utils::NAME);
        let portability = has(ash::khr::portability_enumeration::NAME);
        #[cfg(feature = "cli")]
        let surfaces = surfaces(options, has)?;
        #[cfg(not(feature = "cli"))]
        let surfaces: [&CStr; 0] = [];
        let create = |layer: Option<&Layer>| {
            create(entry, validation, layer, &log, [debug_utils, portability], &surfaces)
        };
        let mut raw = create(layer.as_ref());
        // Older loaders do not know VK_EXT_layer_settings, and refuse it.
        if let (Err(vk::Result::ERROR_EXTENSION_NOT_PRESENT), Some(layer)) =
            (&raw, layer.as_mut().filter(|layer| layer.settings))
        {
            layer.settings = false;
            raw = create(Some(layer));
        }
        let raw = raw.map_err(|result| Error::vulkan("vkCreateInstance", result))?;
        let mut instance = Self {
            raw,
            messenger: None,
            debug_utils,
            layer_version: layer.as_ref().map(|layer| layer.version.clone()),
            log,
            #[cfg(feature = "cli")]
            surfaces,
            owned: true,
            _keep: None,
            loader,
        };
        if layer.is_some() {
            let loader = ext::debug_utils::Instance::new(&instance.loader.entry, &instance.raw);
            let info = messenger_info(&instance.log);
            // SAFETY: VK_EXT_debug_utils is enabled; the log that `info` points at is owned by
            // `instance`, which destroys the messenger first.
            let messenger = unsafe { loader.create_debug_utils_messenger(&info, None) }
                .map_err(|result| Error::vulkan("vkCreateDebugUtilsMessengerEXT", result))?;
            instance.messenger = Some((loader, messenger));
        }
        Ok(instance)
    }

    /// Wraps an instance of the caller, which this does not destroy; drops `keep` with it.
    pub(super) fn adopt(
        entry: ash::Entry,
        raw: ash::Instance,
        debug_utils: bool,
        keep: Option<Arc<dyn Any + Send + Sync>>,
    ) -> Self {
        Self {
            raw,
            messenger: None,
            debug_utils,
            layer_version: None,
            log: Arc::default(),
            #[cfg(feature = "cli")]
            surfaces: Vec::new(),
            owned: false,
            _keep: keep,
            loader: Loader::of(entry),
        }
    }
}

#[cfg(feature = "cli")]
impl Instance {
    /// The entry points that the instance was made with.
    pub(super) fn entry(&self) -> &ash::Entry {
        &self.loader.entry
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        if !self.owned {
            return;
        }
        if let Some((loader, messenger)) = self.messenger.take() {
            // SAFETY: created from this instance, destroyed once, before it.
            unsafe { loader.destroy_debug_utils_messenger(messenger, None) };
        }
        // SAFETY: the device was destroyed before: its owner drops this instance afterwards.
        unsafe { self.raw.destroy_instance(None) };
    }
}

/// A loaded library with the entry points that the crate calls: the library's own, or those of a hook.
struct Loader {
    entry: ash::Entry,
    #[cfg(feature = "testing")]
    _hook: Option<Hook>,
    // Last: the library is unloaded after everything that calls into it is gone.
    _library: ash::Entry,
}

impl Loader {
    /// Loads the system's loader and hooks it where `options` ask for that.
    #[cfg_attr(not(feature = "testing"), expect(unused_variables, reason = "no option without the feature"))]
    fn load(options: &GpuOptions) -> Result<Self> {
        // SAFETY: loading the system's Vulkan loader runs its initialisers; the crate relies on the
        // installed loader being sound, as every Vulkan program does.
        let library = unsafe { ash::Entry::load() }.map_err(|error| Error::NoDevice {
            why: format!(
                "the Vulkan loader cannot be loaded ({error}); install libvulkan1 or a driver that brings it"
            ),
        })?;
        #[cfg(feature = "testing")]
        if let Some(injection) = &options.inject {
            let (hook, entry) = Hook::new(injection, &library)?;
            return Ok(Self { entry, _hook: Some(hook), _library: library });
        }
        Ok(Self::of(library))
    }

    /// Wraps a loader that the caller has loaded.
    fn of(entry: ash::Entry) -> Self {
        Self {
            entry: entry.clone(),
            #[cfg(feature = "testing")]
            _hook: None,
            _library: entry,
        }
    }
}

/// Returns the extensions to enable for the surfaces that `options` ask for.
#[cfg(feature = "cli")]
fn surfaces(options: &GpuOptions, has: impl Fn(&CStr) -> bool) -> Result<Vec<&'static CStr>> {
    let mut wanted = Vec::new();
    #[cfg(feature = "window")]
    if options.window {
        wanted.extend(SURFACES);
    }
    if options.headless_surface {
        wanted.extend([ash::khr::surface::NAME, ext::headless_surface::NAME]);
        if !has(ext::headless_surface::NAME) {
            return Err(Error::unsupported("a headless surface", "VK_EXT_headless_surface"));
        }
    }
    wanted.retain(|name| has(name));
    wanted.sort_unstable();
    wanted.dedup();
    match options.presents() {
        Some(what) if !wanted.contains(&ash::khr::surface::NAME) => {
            Err(Error::unsupported(what, "VK_KHR_surface"))
        }
        _ => Ok(wanted),
    }
}

struct Layer {
    version: String,
    /// Whether it takes settings by `VK_EXT_layer_settings`, else by `VK_EXT_validation_features`.
    settings: bool,
}

fn find_layer(entry: &ash::Entry) -> Result<Layer> {
    // SAFETY: the loader is loaded.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }
        .map_err(|result| Error::vulkan("vkEnumerateInstanceLayerProperties", result))?;
    let layer = layers.iter().find(|layer| layer.layer_name_as_c_str() == Ok(LAYER)).ok_or_else(|| {
        Error::unsupported(
            "validation",
            "the layer VK_LAYER_KHRONOS_validation is not installed (Debian and Ubuntu: vulkan-validationlayers)",
        )
    })?;
    // SAFETY: the layer's name was just enumerated.
    let extensions = unsafe { entry.enumerate_instance_extension_properties(Some(LAYER)) }
        .map_err(|result| Error::vulkan("vkEnumerateInstanceExtensionProperties", result))?;
    let settings = extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(ext::layer_settings::NAME));
    Ok(Layer { version: version_text(layer.spec_version), settings })
}

/// Calls `vkCreateInstance` with the layer, its settings and a messenger for the call itself.
fn create(
    entry: &ash::Entry,
    validation: Validation,
    layer: Option<&Layer>,
    log: &ValidationLog,
    [debug_utils, portability]: [bool; 2],
    surfaces: &[&CStr],
) -> ash::prelude::VkResult<ash::Instance> {
    let mut names: Vec<_> = surfaces.iter().map(|name| name.as_ptr()).collect();
    if debug_utils {
        names.push(ext::debug_utils::NAME.as_ptr());
    }
    if portability {
        names.push(ash::khr::portability_enumeration::NAME.as_ptr());
    }
    let mut layers = Vec::new();
    let app = vk::ApplicationInfo::default()
        .application_name(c"volraster")
        .engine_name(c"volraster")
        .api_version(vk::API_VERSION_1_3);

    let (features, settings) = checks(validation);
    let mut features_info = vk::ValidationFeaturesEXT::default().enabled_validation_features(&features);
    let on = 1_u32.to_ne_bytes();
    let settings: Vec<_> = settings.into_iter().map(|name| setting(name, &on)).collect();
    let mut settings_info = vk::LayerSettingsCreateInfoEXT::default().settings(&settings);
    let mut messenger = messenger_info(log);
    let mut info = vk::InstanceCreateInfo::default();
    if let Some(layer) = layer {
        layers.push(LAYER.as_ptr());
        info = info.push_next(&mut messenger);
        if layer.settings {
            names.push(ext::layer_settings::NAME.as_ptr());
            info = info.push_next(&mut settings_info);
        } else {
            names.push(ext::validation_features::NAME.as_ptr());
            info = info.push_next(&mut features_info);
        }
    }
    if portability {
        info = info.flags(vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR);
    }
    let info = info.application_info(&app).enabled_extension_names(&names).enabled_layer_names(&layers);
    // SAFETY: every pointer in `info` refers to a local that lives past the call; layer and
    // extensions were found by enumeration.
    unsafe { entry.create_instance(&info, None) }
}

/// Returns the checks to enable, as layers without `VK_EXT_layer_settings` take them, and as layers with it do.
fn checks(validation: Validation) -> (Vec<vk::ValidationFeatureEnableEXT>, Vec<&'static CStr>) {
    let mut features = vec![vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
    let mut settings = vec![c"validate_sync", c"syncval_shader_accesses_heuristic"];
    if validation.gpu_assisted() {
        features.push(vk::ValidationFeatureEnableEXT::GPU_ASSISTED);
        settings.push(c"gpuav_enable");
    }
    if validation.best_practices() {
        features.push(vk::ValidationFeatureEnableEXT::BEST_PRACTICES);
        settings.push(c"validate_best_practices");
    }
    (features, settings)
}

fn setting<'a>(name: &'a CStr, value: &'a [u8; 4]) -> vk::LayerSettingEXT<'a> {
    let mut setting = vk::LayerSettingEXT::default()
        .layer_name(LAYER)
        .setting_name(name)
        .ty(vk::LayerSettingTypeEXT::BOOL32)
        .values(value);
    // ash counts bytes, Vulkan values.
    setting.value_count = 1;
    setting
}

/// Formats a Vulkan version number as `major.minor.patch`.
pub(crate) fn version_text(version: u32) -> String {
    format!(
        "{}.{}.{}",
        vk::api_version_major(version),
        vk::api_version_minor(version),
        vk::api_version_patch(version)
    )
}

/// Converts a name for Vulkan; it ends at the first NUL.
pub(crate) fn c_name(name: &str) -> CString {
    let bytes: Vec<u8> = name.bytes().take_while(|&byte| byte != 0).collect();
    CString::new(bytes).unwrap_or_default()
}
