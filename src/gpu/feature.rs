//! Extensions and features: those enabled on a device, and the optional ones with their fallbacks.

use std::ffi::CStr;

use ash::{ext, vk};

use crate::error::{Error, Result};

/// An optional feature of a device, beyond Vulkan 1.3 with synchronization2 and dynamic rendering. Each has a fallback.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OptionalFeature {
    /// Linear filtering of 32-bit float volumes. Fallback: eight fetches in the shader.
    LinearFilterR32f,
    /// Linear filtering of 16-bit volumes. Fallback: eight fetches in the shader.
    LinearFilterR16,
    /// Blending into 32-bit float images. Fallback: accumulation in registers (compute).
    BlendRgba32f,
    /// Fragment shaders that write buffers. Fallback: no dithering.
    FragmentStores,
    /// Critical sections for the fragments of a pixel, ordered by primitive (`VK_EXT_fragment_shader_interlock`).
    /// Fallback: `havs` by compute.
    FragmentInterlock,
    /// A driver known to order the stores of fragments by primitive, which Vulkan does not promise. Only the route
    /// `implementation-ordered` uses it. Fallback: that route is not offered.
    OrderedStores,
    /// Buffers that shaders find by address, of any size (`bufferDeviceAddress`). Fallback: those that a descriptor shows whole.
    BufferAddresses,
    /// The free device memory, reported by the driver. Fallback: nine tenths of the heap.
    MemoryBudget,
    /// Timestamps. Fallback: wall time only.
    Timestamps,
    /// Names and labels for captures and messages. Fallback: none.
    DebugNames,
    /// Marks of the ends of frames for captures (`VK_EXT_frame_boundary`). A device that presents, or that the caller made,
    /// has none: there presents and the caller end frames. Fallback: none.
    FrameBoundary,
}

impl OptionalFeature {
    /// All features.
    pub const ALL: [Self; 11] = [
        Self::LinearFilterR32f,
        Self::LinearFilterR16,
        Self::BlendRgba32f,
        Self::FragmentStores,
        Self::FragmentInterlock,
        Self::OrderedStores,
        Self::BufferAddresses,
        Self::MemoryBudget,
        Self::Timestamps,
        Self::DebugNames,
        Self::FrameBoundary,
    ];

    /// Returns the name in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.texts()[0]
    }

    /// Returns the fallback on a device without the feature.
    #[must_use]
    pub fn fallback(self) -> &'static str {
        self.texts()[1]
    }

    /// Returns the format and the features of its images that this feature consists of.
    pub(super) fn of_format(self) -> Option<(vk::Format, vk::FormatFeatureFlags)> {
        use vk::FormatFeatureFlags as F;
        match self {
            Self::LinearFilterR32f => Some((vk::Format::R32_SFLOAT, F::SAMPLED_IMAGE_FILTER_LINEAR)),
            Self::LinearFilterR16 => Some((vk::Format::R16_UNORM, F::SAMPLED_IMAGE_FILTER_LINEAR)),
            Self::BlendRgba32f => Some((vk::Format::R32G32B32A32_SFLOAT, F::COLOR_ATTACHMENT_BLEND)),
            _ => None,
        }
    }

    /// Returns name and fallback.
    fn texts(self) -> [&'static str; 2] {
        match self {
            Self::LinearFilterR32f => ["linear-filter-r32f", "eight fetches in the shader"],
            Self::LinearFilterR16 => ["linear-filter-r16", "eight fetches in the shader"],
            Self::BlendRgba32f => ["blend-rgba32f", "accumulation in registers"],
            Self::FragmentStores => ["fragment-stores", "no dithering"],
            Self::FragmentInterlock => ["fragment-interlock", "havs by compute"],
            Self::OrderedStores => ["ordered-stores", "no route implementation-ordered"],
            Self::BufferAddresses => ["buffer-addresses", "buffers that a descriptor shows whole"],
            Self::MemoryBudget => ["memory-budget", "nine tenths of the device-local heap"],
            Self::Timestamps => ["timestamps", "wall time only"],
            Self::DebugNames => ["debug-names", "no names or labels"],
            Self::FrameBoundary => ["frame-boundary", "no marks of frames' ends"],
        }
    }
}

/// The extensions and features enabled on a device that this crate uses.
///
/// A caller that makes the device enables [`Enabled::useful`] or a part of it, and reports what it has enabled, by hand or
/// with [`Enabled::from_create_info`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Enabled {
    /// Device extensions. The crate uses `VK_EXT_memory_budget` and `VK_EXT_fragment_shader_interlock`, and ignores
    /// others.
    pub extensions: Vec<&'static CStr>,
    /// The feature `synchronization2`, which is required.
    pub synchronization2: bool,
    /// The feature `dynamicRendering`, which is required.
    pub dynamic_rendering: bool,
    /// The feature `bufferDeviceAddress`: [`OptionalFeature::BufferAddresses`].
    pub buffer_device_address: bool,
    /// The feature `fragmentStoresAndAtomics`: [`OptionalFeature::FragmentStores`].
    pub fragment_stores_and_atomics: bool,
    /// The feature `fragmentShaderPixelInterlock`; together with its extension [`OptionalFeature::FragmentInterlock`].
    pub fragment_shader_pixel_interlock: bool,
}

impl Enabled {
    /// Returns everything that a physical device offers and this crate uses. The caller may enable more.
    ///
    /// # Errors
    ///
    /// [`Error::Vulkan`] when the extensions cannot be enumerated.
    ///
    /// # Safety
    ///
    /// `physical` belongs to `instance`, which was made for Vulkan 1.3 or later, and supports Vulkan 1.3.
    pub unsafe fn useful(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Result<Self> {
        // SAFETY: `physical` belongs to this instance.
        let offered = unsafe { extensions(instance, physical) }?;
        // SAFETY: the caller's promise.
        Ok(unsafe { Self::of_offered(instance, physical, &offered) })
    }

    /// Returns everything that the crate uses of a device that offers these extensions.
    ///
    /// # Safety
    ///
    /// As for [`Enabled::useful`].
    unsafe fn of_offered(
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        offered: &[vk::ExtensionProperties],
    ) -> Self {
        let has = |name: &CStr| offers(offered, name);
        let has_interlock = has(ext::fragment_shader_interlock::NAME);
        let mut interlock = vk::PhysicalDeviceFragmentShaderInterlockFeaturesEXT::default();
        let mut features13 = vk::PhysicalDeviceVulkan13Features::default();
        let mut features12 = vk::PhysicalDeviceVulkan12Features::default();
        let mut features =
            vk::PhysicalDeviceFeatures2::default().push_next(&mut features13).push_next(&mut features12);
        if has_interlock {
            features = features.push_next(&mut interlock);
        }
        // SAFETY: `physical` belongs to this instance; the chained structures are core or their extension is present.
        unsafe { instance.get_physical_device_features2(physical, &mut features) };
        let stores = features.features.fragment_stores_and_atomics == vk::TRUE;
        let pixel_interlock = interlock.fragment_shader_pixel_interlock == vk::TRUE;
        let mut extensions = Vec::new();
        // Vulkan requires that the portability subset is enabled where a device offers it.
        for name in [ext::memory_budget::NAME, ash::khr::portability_subset::NAME] {
            if has(name) {
                extensions.push(name);
            }
        }
        if pixel_interlock {
            extensions.push(ext::fragment_shader_interlock::NAME);
        }
        Self {
            extensions,
            synchronization2: features13.synchronization2 == vk::TRUE,
            dynamic_rendering: features13.dynamic_rendering == vk::TRUE,
            buffer_device_address: features12.buffer_device_address == vk::TRUE,
            fragment_stores_and_atomics: stores,
            fragment_shader_pixel_interlock: pixel_interlock,
        }
    }

    /// Returns what the crate enables on a device of its own: everything useful except for the features `without`, and marks of frames
    /// unless presents end them.
    ///
    /// # Safety
    ///
    /// As for [`Enabled::useful`].
    pub(super) unsafe fn for_own(
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        presents: bool,
        without: &[OptionalFeature],
    ) -> Result<Self> {
        // SAFETY: the caller's promise.
        let offered = unsafe { extensions(instance, physical) }?;
        // SAFETY: the caller's promise.
        let mut enabled = unsafe { Self::of_offered(instance, physical, &offered) };
        if !presents && offers(&offered, ext::frame_boundary::NAME) {
            enabled.extensions.push(ext::frame_boundary::NAME);
        }
        Ok(enabled.without(without))
    }

    /// Adds everything that `other` enables, such as what an engine has enabled beside [`Enabled::useful`].
    pub fn merge(&mut self, other: &Self) {
        let new = other.extensions.iter().filter(|name| !self.has(name));
        let new: Vec<_> = new.copied().collect();
        self.extensions.extend(new);
        for (on, too) in [
            (&mut self.synchronization2, other.synchronization2),
            (&mut self.dynamic_rendering, other.dynamic_rendering),
            (&mut self.buffer_device_address, other.buffer_device_address),
            (&mut self.fragment_stores_and_atomics, other.fragment_stores_and_atomics),
            (&mut self.fragment_shader_pixel_interlock, other.fragment_shader_pixel_interlock),
        ] {
            *on |= too;
        }
    }

    /// Returns the core features, for [`vk::DeviceCreateInfo::enabled_features`] or [`vk::PhysicalDeviceFeatures2`].
    pub fn features(&self) -> vk::PhysicalDeviceFeatures {
        vk::PhysicalDeviceFeatures::default().fragment_stores_and_atomics(self.fragment_stores_and_atomics)
    }

    /// Returns the structures of all other features, one structure a feature.
    #[must_use]
    pub fn structures(&self) -> FeatureStructures {
        FeatureStructures {
            synchronization2: self
                .synchronization2
                .then(|| vk::PhysicalDeviceSynchronization2Features::default().synchronization2(true)),
            dynamic_rendering: self
                .dynamic_rendering
                .then(|| vk::PhysicalDeviceDynamicRenderingFeatures::default().dynamic_rendering(true)),
            addresses: self.buffer_device_address.then(|| {
                vk::PhysicalDeviceBufferDeviceAddressFeatures::default().buffer_device_address(true)
            }),
            interlock: self.fragment_shader_pixel_interlock.then(|| {
                vk::PhysicalDeviceFragmentShaderInterlockFeaturesEXT::default()
                    .fragment_shader_pixel_interlock(true)
            }),
        }
    }

    /// Reads what a device was made with: the extensions that the crate uses, and features in any of the structures that may hold
    /// them. What is added to `info` later is not read: [`Enabled::merge`] adds it.
    ///
    /// # Safety
    ///
    /// `info` is valid for `vkCreateDevice`: its pointers are, and those of its chain.
    #[must_use]
    pub unsafe fn from_create_info(info: &vk::DeviceCreateInfo<'_>) -> Self {
        let mut enabled = Self::default();
        let count = crate::num::index(info.enabled_extension_count);
        if count > 0 {
            // SAFETY: there are as many names as the structure counts.
            let names = unsafe { std::slice::from_raw_parts(info.pp_enabled_extension_names, count) };
            for &name in names {
                // SAFETY: a string that ends with zero.
                let name = unsafe { CStr::from_ptr(name) };
                enabled.extensions.extend(USED.iter().find(|used| **used == name));
            }
        }
        // SAFETY: null or valid.
        if let Some(features) = unsafe { info.p_enabled_features.as_ref() } {
            enabled.fragment_stores_and_atomics = features.fragment_stores_and_atomics == vk::TRUE;
        }
        let mut next = info.p_next.cast::<vk::BaseInStructure<'_>>();
        // SAFETY: every structure of a chain begins with its type and the next one's address.
        while let Some(&base) = unsafe { next.as_ref() } {
            let link = Link { kind: base.s_type, address: next.cast() };
            if let Some(it) = link.get::<vk::PhysicalDeviceFeatures2<'_>>() {
                enabled.fragment_stores_and_atomics |= it.features.fragment_stores_and_atomics == vk::TRUE;
            }
            if let Some(it) = link.get::<vk::PhysicalDeviceVulkan13Features<'_>>() {
                enabled.synchronization2 |= it.synchronization2 == vk::TRUE;
                enabled.dynamic_rendering |= it.dynamic_rendering == vk::TRUE;
            }
            if let Some(it) = link.get::<vk::PhysicalDeviceVulkan12Features<'_>>() {
                enabled.buffer_device_address |= it.buffer_device_address == vk::TRUE;
            }
            if let Some(it) = link.get::<vk::PhysicalDeviceBufferDeviceAddressFeatures<'_>>() {
                enabled.buffer_device_address |= it.buffer_device_address == vk::TRUE;
            }
            if let Some(it) = link.get::<vk::PhysicalDeviceSynchronization2Features<'_>>() {
                enabled.synchronization2 |= it.synchronization2 == vk::TRUE;
            }
            if let Some(it) = link.get::<vk::PhysicalDeviceDynamicRenderingFeatures<'_>>() {
                enabled.dynamic_rendering |= it.dynamic_rendering == vk::TRUE;
            }
            if let Some(it) = link.get::<vk::PhysicalDeviceFragmentShaderInterlockFeaturesEXT<'_>>() {
                enabled.fragment_shader_pixel_interlock |= it.fragment_shader_pixel_interlock == vk::TRUE;
            }
            next = base.p_next;
        }
        enabled
    }

    /// Leaves out what only some optional features need.
    fn without(mut self, features: &[OptionalFeature]) -> Self {
        for feature in features {
            match feature {
                OptionalFeature::FragmentStores => self.fragment_stores_and_atomics = false,
                OptionalFeature::FragmentInterlock => {
                    self.fragment_shader_pixel_interlock = false;
                    self.extensions.retain(|name| *name != ext::fragment_shader_interlock::NAME);
                }
                OptionalFeature::BufferAddresses => self.buffer_device_address = false,
                OptionalFeature::MemoryBudget => {
                    self.extensions.retain(|name| *name != ext::memory_budget::NAME);
                }
                OptionalFeature::FrameBoundary => {
                    self.extensions.retain(|name| *name != ext::frame_boundary::NAME);
                }
                _ => {}
            }
        }
        self
    }

    /// Returns whether an extension is enabled.
    pub(super) fn has(&self, name: &CStr) -> bool {
        self.extensions.contains(&name)
    }

    /// Returns the first extension or feature that `offered` lacks.
    pub(super) fn beyond(&self, offered: &Self) -> Option<&'static str> {
        let features = |of: &Self| {
            [
                ("VK_EXT_memory_budget", of.has(ext::memory_budget::NAME)),
                ("synchronization2", of.synchronization2),
                ("dynamicRendering", of.dynamic_rendering),
                ("bufferDeviceAddress", of.buffer_device_address),
                ("fragmentStoresAndAtomics", of.fragment_stores_and_atomics),
                ("fragmentShaderPixelInterlock", of.fragment_shader_pixel_interlock),
            ]
        };
        let pairs = features(self).into_iter().zip(features(offered));
        pairs.filter(|((_, on), (_, there))| *on && !there).map(|((name, _), _)| name).next()
    }
}

/// Structures of features for the chain of `vkCreateDevice`, from [`Enabled::structures`].
#[derive(Clone, Copy, Debug)]
pub struct FeatureStructures {
    synchronization2: Option<vk::PhysicalDeviceSynchronization2Features<'static>>,
    dynamic_rendering: Option<vk::PhysicalDeviceDynamicRenderingFeatures<'static>>,
    addresses: Option<vk::PhysicalDeviceBufferDeviceAddressFeatures<'static>>,
    interlock: Option<vk::PhysicalDeviceFragmentShaderInterlockFeaturesEXT<'static>>,
}

impl FeatureStructures {
    /// Puts the structures in front of the chain of `info`.
    ///
    /// Vulkan allows each structure once in a chain, and none of these beside `VkPhysicalDeviceVulkan12Features` or
    /// `VkPhysicalDeviceVulkan13Features`, which hold the same features: a caller whose chain has these sets their fields instead.
    pub fn chain<'a>(&'a mut self, mut info: vk::DeviceCreateInfo<'a>) -> vk::DeviceCreateInfo<'a> {
        if let Some(it) = &mut self.synchronization2 {
            info = info.push_next(it);
        }
        if let Some(it) = &mut self.dynamic_rendering {
            info = info.push_next(it);
        }
        if let Some(it) = &mut self.addresses {
            info = info.push_next(it);
        }
        if let Some(it) = &mut self.interlock {
            info = info.push_next(it);
        }
        info
    }
}

/// The device extensions that the crate uses.
const USED: [&CStr; 4] = [
    ext::memory_budget::NAME,
    ash::khr::portability_subset::NAME,
    ext::fragment_shader_interlock::NAME,
    ext::frame_boundary::NAME,
];

/// Returns the extensions that a device offers.
///
/// # Safety
///
/// `physical` belongs to `instance`.
unsafe fn extensions(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
) -> Result<Vec<vk::ExtensionProperties>> {
    // SAFETY: the caller's promise; no layer is named.
    unsafe { instance.enumerate_device_extension_properties(physical) }
        .map_err(|result| Error::Vulkan { call: "vkEnumerateDeviceExtensionProperties", result })
}

/// Returns whether an extension is among those that a device offers.
fn offers(offered: &[vk::ExtensionProperties], name: &CStr) -> bool {
    offered.iter().any(|extension| extension.extension_name_as_c_str() == Ok(name))
}

/// A valid structure of a chain of `vkCreateDevice`, with the type that it names.
struct Link {
    kind: vk::StructureType,
    address: *const std::ffi::c_void,
}

impl Link {
    /// Returns the structure if it is of type `T`.
    fn get<T: vk::TaggedStructure>(&self) -> Option<&T> {
        // SAFETY: the address is valid, and the type says what is there.
        (self.kind == T::STRUCTURE_TYPE).then(|| unsafe { &*self.address.cast::<T>() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_structure_that_may_hold_a_feature_is_read() {
        let names = [ext::memory_budget::NAME.as_ptr(), c"VK_KHR_swapchain".as_ptr()];
        let plain = vk::PhysicalDeviceFeatures::default().fragment_stores_and_atomics(true);
        let mut features2 = vk::PhysicalDeviceFeatures2::default().features(plain);
        let mut sync = vk::PhysicalDeviceSynchronization2Features::default().synchronization2(true);
        let mut dynamic = vk::PhysicalDeviceDynamicRenderingFeatures::default().dynamic_rendering(true);
        let mut core = vk::PhysicalDeviceVulkan13Features::default().synchronization2(true);
        let mut other = vk::PhysicalDeviceVulkan12Features::default().timeline_semaphore(true);
        let mut addresses =
            vk::PhysicalDeviceBufferDeviceAddressFeatures::default().buffer_device_address(true);
        let mut core12 = vk::PhysicalDeviceVulkan12Features::default().buffer_device_address(true);
        let mut interlock = vk::PhysicalDeviceFragmentShaderInterlockFeaturesEXT::default()
            .fragment_shader_pixel_interlock(true);
        // SAFETY: every pointer refers to a local.
        let read = |info: vk::DeviceCreateInfo<'_>| unsafe { Enabled::from_create_info(&info) };
        let none = Enabled::default();
        let info = vk::DeviceCreateInfo::default;
        assert_eq!(read(info()), none);
        let extensions = read(info().enabled_extension_names(&names)).extensions;
        // The crate has no use for the other.
        assert_eq!(extensions, [ext::memory_budget::NAME]);
        let stores = Enabled { fragment_stores_and_atomics: true, ..none.clone() };
        assert_eq!(read(info().enabled_features(&plain)), stores);
        assert_eq!(read(info().push_next(&mut features2)), stores);
        let synchronization2 = Enabled { synchronization2: true, ..none.clone() };
        assert_eq!(read(info().push_next(&mut core)), synchronization2);
        assert_eq!(read(info().push_next(&mut sync)), synchronization2);
        let buffer_device_address = Enabled { buffer_device_address: true, ..none.clone() };
        assert_eq!(read(info().push_next(&mut addresses)), buffer_device_address);
        assert_eq!(read(info().push_next(&mut core12)), buffer_device_address);
        // In one chain, behind a structure that is ignored.
        let all = info()
            .push_next(&mut dynamic)
            .push_next(&mut core)
            .push_next(&mut interlock)
            .push_next(&mut other);
        let want =
            Enabled { dynamic_rendering: true, fragment_shader_pixel_interlock: true, ..synchronization2 };
        assert_eq!(read(all), want);
    }

    fn everything() -> Enabled {
        Enabled {
            extensions: vec![ext::memory_budget::NAME],
            synchronization2: true,
            dynamic_rendering: true,
            buffer_device_address: true,
            fragment_stores_and_atomics: true,
            fragment_shader_pixel_interlock: true,
        }
    }

    /// Each feature alone, and all together, are read back from the chain that they make, and merged to the same.
    #[test]
    fn the_chain_of_what_is_enabled_is_read_back_as_it() {
        let (all, none) = (everything(), Enabled::default);
        let single = [
            Enabled { extensions: all.extensions.clone(), ..none() },
            Enabled { synchronization2: true, ..none() },
            Enabled { dynamic_rendering: true, ..none() },
            Enabled { buffer_device_address: true, ..none() },
            Enabled { fragment_stores_and_atomics: true, ..none() },
            Enabled { fragment_shader_pixel_interlock: true, ..none() },
        ];
        let mut merged = none();
        for enabled in &single {
            merged.merge(enabled);
        }
        assert_eq!(merged, all);
        merged.merge(&all);
        assert_eq!(merged, all);
        for enabled in single.iter().chain([&all, &none()]) {
            let names: Vec<_> = enabled.extensions.iter().map(|name| name.as_ptr()).collect();
            let (features, mut structures) = (enabled.features(), enabled.structures());
            let info =
                vk::DeviceCreateInfo::default().enabled_extension_names(&names).enabled_features(&features);
            let info = structures.chain(info);
            // SAFETY: every pointer refers to a local.
            assert_eq!(unsafe { Enabled::from_create_info(&info) }, *enabled);
        }
    }

    #[test]
    fn what_a_device_does_not_offer_cannot_be_enabled() {
        let all = everything();
        assert_eq!(all.beyond(&all), None);
        assert_eq!(Enabled::default().beyond(&Enabled::default()), None);
        for (offered, want) in [
            (Enabled { extensions: Vec::new(), ..all.clone() }, "VK_EXT_memory_budget"),
            (Enabled { synchronization2: false, ..all.clone() }, "synchronization2"),
            (Enabled { buffer_device_address: false, ..all.clone() }, "bufferDeviceAddress"),
            (Enabled { dynamic_rendering: false, ..all.clone() }, "dynamicRendering"),
            (Enabled { fragment_stores_and_atomics: false, ..all.clone() }, "fragmentStoresAndAtomics"),
            (
                Enabled { fragment_shader_pixel_interlock: false, ..all.clone() },
                "fragmentShaderPixelInterlock",
            ),
        ] {
            assert_eq!(all.beyond(&offered), Some(want));
            assert_eq!(offered.beyond(&all), None);
        }
    }
}
