//! The surface of a window, or one that nothing shows, and its swapchain.
//!
//! The host waits for a fence before it draws into an image, and presents it only after the submission has ended. So no semaphores
//! are needed, and nothing is in flight between two frames.

use std::any::Any;
#[cfg(feature = "window")]
use std::ffi::CStr;
use std::sync::Arc;

use ash::{ext, khr, vk};
#[cfg(feature = "window")]
use raw_window_handle::{HasDisplayHandle, HasWindowHandle};

use super::device::Gpu;
use super::external::TargetImage;
use super::image::whole;
use crate::error::{Error, Result};

/// Time limit of a wait for an image, in nanoseconds. A hidden window may get none.
const PATIENCE: u64 = 1_000_000_000;

/// A surface with its swapchain. It keeps the window alive.
pub(crate) struct Surface {
    gpu: Gpu,
    instance: khr::surface::Instance,
    device: khr::swapchain::Device,
    raw: vk::SurfaceKHR,
    format: vk::SurfaceFormatKHR,
    swapchain: vk::SwapchainKHR,
    images: Vec<TargetImage>,
    extent: [u32; 2],
    /// Whether the window has changed since the swapchain was made.
    stale: bool,
    /// Signalled when an image is handed over.
    acquired: vk::Fence,
    _window: Option<Arc<dyn Any + Send + Sync>>,
}

impl std::fmt::Debug for Surface {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Surface")
            .field("format", &self.format)
            .field("extent", &self.extent)
            .finish_non_exhaustive()
    }
}

impl Surface {
    /// Makes the surface of a window, for a device that [`GpuOptions::window`](super::GpuOptions::window) has opened.
    #[cfg(feature = "window")]
    pub(crate) fn new<W>(gpu: &Gpu, window: Arc<W>) -> Result<Self>
    where
        W: HasDisplayHandle + HasWindowHandle + Send + Sync + 'static,
    {
        gpu.alive()?;
        let own = &gpu.inner.instance;
        let gone = |error: raw_window_handle::HandleError| Error::invalid("window", error.to_string());
        let (display, handle) =
            (window.display_handle().map_err(gone)?.as_raw(), window.window_handle().map_err(gone)?.as_raw());
        let needed = ash_window::enumerate_required_extensions(display)
            .map_err(|result| gpu.failed("vkCreateSurfaceKHR", result))?;
        for &name in needed {
            // SAFETY: a constant string that ends with zero.
            let name = unsafe { CStr::from_ptr(name) };
            if !own.surfaces.contains(&name) {
                let why =
                    format!("{}: GpuOptions::window enables it where it is there", name.to_string_lossy());
                return Err(Error::unsupported("a window", why));
            }
        }
        // SAFETY: the extensions of this kind of display are enabled; both handles are of one window, which `_window` keeps until after the surface is destroyed. The surface holds the
        // `Gpu`, and so the instance.
        let raw = unsafe { ash_window::create_surface(own.entry(), &own.raw, display, handle, None) }
            .map_err(|result| gpu.failed("vkCreateSurfaceKHR", result))?;
        Self::of(gpu, raw, Some(window))
    }

    /// Makes a surface that nothing shows, for a device that [`GpuOptions::headless_surface`](super::GpuOptions::headless_surface)
    /// has opened.
    pub(crate) fn headless(gpu: &Gpu) -> Result<Self> {
        gpu.alive()?;
        let own = &gpu.inner.instance;
        if !own.surfaces.contains(&ext::headless_surface::NAME) {
            let why = "VK_EXT_headless_surface: GpuOptions::headless_surface enables it where it is there";
            return Err(Error::unsupported("a headless surface", why));
        }
        let functions = ext::headless_surface::Instance::new(own.entry(), &own.raw);
        // SAFETY: the extension is enabled; the surface holds the `Gpu`, and so the instance.
        let raw =
            unsafe { functions.create_headless_surface(&vk::HeadlessSurfaceCreateInfoEXT::default(), None) }
                .map_err(|result| gpu.failed("vkCreateHeadlessSurfaceEXT", result))?;
        Self::of(gpu, raw, None)
    }

    /// Wraps a surface of the device's instance, whose format is chosen here.
    fn of(gpu: &Gpu, raw: vk::SurfaceKHR, window: Option<Arc<dyn Any + Send + Sync>>) -> Result<Self> {
        let own = &gpu.inner.instance;
        // `surface` owns `raw` from here on, so every `?` below destroys it.
        let mut surface = Self {
            gpu: gpu.clone(),
            instance: khr::surface::Instance::new(own.entry(), &own.raw),
            device: khr::swapchain::Device::new(&own.raw, gpu.device()),
            raw,
            format: vk::SurfaceFormatKHR::default(),
            swapchain: vk::SwapchainKHR::null(),
            images: Vec::new(),
            extent: [0; 2],
            stale: true,
            acquired: vk::Fence::null(),
            _window: window,
        };
        surface.format = surface.choose_format()?;
        // SAFETY: the device is alive.
        surface.acquired = unsafe { gpu.device().create_fence(&vk::FenceCreateInfo::default(), None) }
            .map_err(|result| gpu.failed("vkCreateFence", result))?;
        Ok(surface)
    }

    /// Returns the format of its images: 8-bit, which shaders encode as sRGB.
    pub(crate) fn format(&self) -> vk::Format {
        self.format.format
    }

    /// Returns the first suitable format of the device, if it can present here at all.
    fn choose_format(&self) -> Result<vk::SurfaceFormatKHR> {
        let (gpu, device) = (&self.gpu, self.gpu.inner.candidate.raw);
        let family = gpu.inner.candidate.queue_family;
        // SAFETY: device and surface are of one instance; the family is one of the device.
        let presents = unsafe { self.instance.get_physical_device_surface_support(device, family, self.raw) }
            .map_err(|result| gpu.failed("vkGetPhysicalDeviceSurfaceSupportKHR", result))?;
        if !presents {
            let why =
                format!("{} does not present on this display: --device selects another", gpu.report().name);
            return Err(Error::unsupported("a surface", why));
        }
        // SAFETY: device and surface are of one instance, and the device presents on the surface.
        let formats = unsafe { self.instance.get_physical_device_surface_formats(device, self.raw) }
            .map_err(|result| gpu.failed("vkGetPhysicalDeviceSurfaceFormatsKHR", result))?;
        let fits = |format: &&vk::SurfaceFormatKHR| {
            matches!(format.format, vk::Format::B8G8R8A8_UNORM | vk::Format::R8G8B8A8_UNORM)
                && format.color_space == vk::ColorSpaceKHR::SRGB_NONLINEAR
        };
        let lacks = || Error::unsupported("a surface", format!("8-bit RGBA surfaces: there are {formats:?}"));
        formats.iter().find(fits).copied().ok_or_else(lacks)
    }

    /// Waits for an image of about the window's size in pixels. `None` while the window shows nothing, or where its size is just changing:
    /// try again later.
    pub(crate) fn acquire(&mut self, size: [u32; 2]) -> Result<Option<(u32, TargetImage)>> {
        self.gpu.alive()?;
        if (self.stale || size != self.extent) && !self.rebuild(size)? {
            return Ok(None);
        }
        // SAFETY: the swapchain is not retired; the fence is unsignalled and unused; all images acquired before were presented.
        let acquired = unsafe {
            self.device.acquire_next_image(self.swapchain, PATIENCE, vk::Semaphore::null(), self.acquired)
        };
        let index = match acquired {
            Ok((index, suboptimal)) => {
                self.stale |= suboptimal;
                index
            }
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => {
                self.stale = true;
                return Ok(None);
            }
            Err(vk::Result::TIMEOUT | vk::Result::NOT_READY) => return Ok(None),
            Err(result) => return Err(self.gpu.failed("vkAcquireNextImageKHR", result)),
        };
        let device = self.gpu.device();
        // SAFETY: the call above signals the fence.
        unsafe { device.wait_for_fences(&[self.acquired], true, u64::MAX) }
            .map_err(|result| self.gpu.failed("vkWaitForFences", result))?;
        // SAFETY: the fence is signalled and not in use.
        unsafe { device.reset_fences(&[self.acquired]) }
            .map_err(|result| self.gpu.failed("vkResetFences", result))?;
        Ok(self.images.get(crate::num::index(index)).map(|image| (index, *image)))
    }

    /// Shows an acquired image. Its contents are complete: the submission that draws it has ended.
    pub(crate) fn present(&mut self, index: u32) -> Result<()> {
        let (swapchains, indices) = ([self.swapchain], [index]);
        let info = vk::PresentInfoKHR::default().swapchains(&swapchains).image_indices(&indices);
        // SAFETY: the queue is locked; the image was acquired, is in the layout PRESENT_SRC, and nothing uses it.
        match self.gpu.with_queue(|queue| unsafe { self.device.queue_present(queue, &info) }) {
            Ok(suboptimal) => self.stale |= suboptimal,
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => self.stale = true,
            Err(result) => return Err(self.gpu.failed("vkQueuePresentKHR", result)),
        }
        Ok(())
    }

    /// Makes the swapchain for the present size of the window; returns `false` if that is zero.
    fn rebuild(&mut self, [width, height]: [u32; 2]) -> Result<bool> {
        let (gpu, device) = (self.gpu.clone(), self.gpu.inner.candidate.raw);
        // SAFETY: device and surface are of one instance, and the device presents on the surface.
        let can = unsafe { self.instance.get_physical_device_surface_capabilities(device, self.raw) }
            .map_err(|result| gpu.failed("vkGetPhysicalDeviceSurfaceCapabilitiesKHR", result))?;
        let (least, most) = (can.min_image_extent, can.max_image_extent);
        let extent = match can.current_extent {
            // The swapchain decides.
            vk::Extent2D { width: u32::MAX, .. } => vk::Extent2D {
                width: width.max(least.width).min(most.width),
                height: height.max(least.height).min(most.height),
            },
            current => current,
        };
        if [width, height, extent.width, extent.height].contains(&0) {
            return Ok(false);
        }
        let images = (can.min_image_count + 1).min(if can.max_image_count == 0 {
            u32::MAX
        } else {
            can.max_image_count
        });
        let opaque = vk::CompositeAlphaFlagsKHR::OPAQUE;
        let alpha = if can.supported_composite_alpha.contains(opaque) {
            opaque
        } else {
            vk::CompositeAlphaFlagsKHR::INHERIT
        };
        let old = self.swapchain;
        let info = vk::SwapchainCreateInfoKHR::default()
            .surface(self.raw)
            .min_image_count(images)
            .image_format(self.format.format)
            .image_color_space(self.format.color_space)
            .image_extent(extent)
            .image_array_layers(1)
            .image_usage(vk::ImageUsageFlags::COLOR_ATTACHMENT)
            .pre_transform(can.current_transform)
            .composite_alpha(alpha)
            .present_mode(vk::PresentModeKHR::FIFO)
            .clipped(true)
            .old_swapchain(old);
        // SAFETY: the surface is alive and the device presents on it; extent, count and transform are from its capabilities; every device has
        // FIFO and colour attachments; no image of the old swapchain is acquired.
        let made = unsafe { self.device.create_swapchain(&info, None) };
        self.clear_images();
        // SAFETY: retired by the call above; the host waits for every submission that names its images.
        unsafe { self.device.destroy_swapchain(old, None) };
        self.swapchain = vk::SwapchainKHR::null();
        self.swapchain = made.map_err(|result| gpu.failed("vkCreateSwapchainKHR", result))?;
        // SAFETY: the swapchain was just made.
        let raw = unsafe { self.device.get_swapchain_images(self.swapchain) }
            .map_err(|result| gpu.failed("vkGetSwapchainImagesKHR", result))?;
        self.extent = [width, height];
        for image in raw {
            let info = vk::ImageViewCreateInfo::default()
                .image(image)
                .view_type(vk::ImageViewType::TYPE_2D)
                .format(self.format.format)
                .subresource_range(whole(vk::ImageAspectFlags::COLOR));
            // SAFETY: the image belongs to the swapchain, which outlives the view.
            let view = unsafe { gpu.device().create_image_view(&info, None) }
                .map_err(|result| gpu.failed("vkCreateImageView", result))?;
            // SAFETY: image and view are of this device, format and extent, and live until the next `rebuild`, before which the host waits for
            // every submission. `Recorder::assume_acquired` sees to the layout.
            let target = unsafe {
                TargetImage::from_raw(&gpu, image, view, self.format.format, [extent.width, extent.height])
            };
            self.images.push(target);
        }
        self.stale = false;
        Ok(true)
    }

    /// Destroys the views of its images, once nothing shows these.
    fn clear_images(&mut self) {
        // SAFETY: the queue is locked. A failure means a lost device, which shows nothing.
        let _ = self.gpu.with_queue(|queue| unsafe { self.gpu.device().queue_wait_idle(queue) });
        for image in self.images.drain(..) {
            // SAFETY: made from this device; the host has waited for every submission that names it.
            unsafe { self.gpu.device().destroy_image_view(image.view, None) };
        }
    }
}

impl Drop for Surface {
    fn drop(&mut self) {
        self.clear_images();
        // SAFETY: no submission names its images, as above; null is allowed.
        unsafe { self.device.destroy_swapchain(self.swapchain, None) };
        // SAFETY: the swapchain is destroyed, the window alive.
        unsafe { self.instance.destroy_surface(self.raw, None) };
        // SAFETY: the host has waited for each call that signals it; null is allowed.
        unsafe { self.gpu.device().destroy_fence(self.acquired, None) };
    }
}
