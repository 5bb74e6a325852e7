//! The Vulkan loader, and the hook through which tests count its calls and make them fail.

#[cfg(feature = "testing")]
use super::inject::Hook;
use super::options::GpuOptions;
use crate::error::{Error, Result};

/// A loaded library with the entry points that the crate calls: the library's own, or those of a hook.
pub(super) struct Loader {
    entry: ash::Entry,
    #[cfg(feature = "testing")]
    _hook: Option<Hook>,
    // Last: the library is unloaded after everything that calls into it is gone.
    _library: ash::Entry,
}

impl Loader {
    /// Loads the system's loader and hooks it where `options` ask for that.
    #[cfg_attr(not(feature = "testing"), expect(unused_variables, reason = "no option without the feature"))]
    pub(super) fn load(options: &GpuOptions) -> Result<Self> {
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
    pub(super) fn of(entry: ash::Entry) -> Self {
        Self {
            entry: entry.clone(),
            #[cfg(feature = "testing")]
            _hook: None,
            _library: entry,
        }
    }

    pub(super) fn entry(&self) -> &ash::Entry {
        &self.entry
    }
}
