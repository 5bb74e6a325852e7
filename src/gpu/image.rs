//! Images that own their memory and one view.

use ash::vk;

use super::device::Gpu;
use super::host::{MemoryAccess, MemoryRequest};
use super::memory::Memory;
use crate::error::{Error, Result};

/// Describes an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ImageDesc {
    pub(crate) format: vk::Format,
    /// Width, height, depth in texels. Depth 1 makes a 2D image, or with more than one of `layers` an array.
    pub(crate) extent: [u32; 3],
    pub(crate) layers: u32,
    /// Mip levels.
    pub(crate) levels: u32,
    /// Whether the image is three-dimensional, even with depth 1.
    pub(crate) volume: bool,
    pub(crate) usage: vk::ImageUsageFlags,
}

impl ImageDesc {
    /// Describes a volume to sample.
    pub(crate) fn sampled_volume(format: vk::Format, extent: [u32; 3]) -> Self {
        let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST;
        Self { format, extent, layers: 1, levels: 1, volume: true, usage }
    }

    /// Describes a stack of slices to sample, one layer each.
    pub(crate) fn sampled_stack(format: vk::Format, extent: [u32; 2], layers: u32) -> Self {
        let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST;
        Self { layers, ..Self::flat(format, extent, usage) }
    }

    /// Returns the size of one texel, in bytes.
    pub(crate) fn bytes_each(&self) -> u64 {
        format_bytes(self.format)
    }

    /// Returns the extent of a mip level.
    pub(crate) fn level_extent(&self, level: u32) -> [u32; 3] {
        self.extent.map(|side| (side >> level).max(1))
    }

    /// Returns the number of planes of a level: z slices of a volume, or layers of an array.
    pub(crate) fn planes(&self, level: u32) -> u32 {
        if self.volume { self.level_extent(level)[2] } else { self.layers }
    }

    /// Returns the size of one plane of a level, in bytes.
    pub(crate) fn plane_bytes(&self, level: u32) -> u64 {
        let [w, h, _] = self.level_extent(level).map(u64::from);
        w.saturating_mul(h).saturating_mul(format_bytes(self.format))
    }

    /// Describes a 2D image.
    pub(crate) fn flat(format: vk::Format, extent: [u32; 2], usage: vk::ImageUsageFlags) -> Self {
        Self { format, extent: [extent[0], extent[1], 1], layers: 1, levels: 1, volume: false, usage }
    }

    /// Returns the size of all texels in bytes, without the driver's padding.
    pub(crate) fn texel_bytes(&self) -> u64 {
        (0..self.levels)
            .map(|level| self.plane_bytes(level).saturating_mul(u64::from(self.planes(level))))
            .fold(0, u64::saturating_add)
    }
}

/// Returns the size of one texel in bytes, for the formats that this crate uses.
pub(crate) fn format_bytes(format: vk::Format) -> u64 {
    match format {
        vk::Format::R8_UNORM => 1,
        vk::Format::R16_UNORM => 2,
        vk::Format::R32_SFLOAT
        | vk::Format::R8G8B8A8_UNORM
        | vk::Format::R8G8B8A8_SRGB
        | vk::Format::B8G8R8A8_UNORM
        | vk::Format::B8G8R8A8_SRGB
        | vk::Format::A2B10G10R10_UNORM_PACK32 => 4,
        vk::Format::R16G16B16A16_SFLOAT | vk::Format::R16G16B16A16_UNORM => 8,
        // R32G32B32A32_SFLOAT, and an upper bound for other uncompressed formats of 32-bit channels.
        _ => 16,
    }
}

/// An image with its memory and a view of the whole image.
#[derive(Debug)]
pub(crate) struct Image {
    gpu: Gpu,
    pub(super) raw: vk::Image,
    pub(super) view: vk::ImageView,
    /// `None` until the memory is allocated. Dropped after the image is destroyed.
    memory: Option<Memory>,
    desc: ImageDesc,
    pub(super) name: String,
}

impl Image {
    /// Whether shaders may store to it.
    pub(super) fn is_storage(&self) -> bool {
        self.desc.usage.contains(vk::ImageUsageFlags::STORAGE)
    }

    pub(crate) fn new(gpu: &Gpu, name: &str, desc: &ImageDesc) -> Result<Self> {
        gpu.check_image(name, desc)?;
        let [width, height, depth] = desc.extent;
        let poisoned = gpu.inner.poison && desc.usage.contains(vk::ImageUsageFlags::STORAGE);
        let usage = if poisoned { desc.usage | vk::ImageUsageFlags::TRANSFER_DST } else { desc.usage };
        let info = vk::ImageCreateInfo::default()
            .image_type(if desc.volume { vk::ImageType::TYPE_3D } else { vk::ImageType::TYPE_2D })
            .format(desc.format)
            .extent(vk::Extent3D { width, height, depth })
            .mip_levels(desc.levels)
            .array_layers(desc.layers)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(usage);
        // SAFETY: the device is alive; the extent was checked against the limits; `info` points at
        // nothing.
        let raw = unsafe { gpu.device().create_image(&info, gpu.host_callbacks()) }
            .map_err(|result| gpu.failed("vkCreateImage", result))?;
        // `image` owns `raw` from here on, so every `?` below destroys it.
        let mut image = Self {
            gpu: gpu.clone(),
            raw,
            view: vk::ImageView::null(),
            memory: None,
            desc: *desc,
            name: name.to_string(),
        };
        gpu.name(raw, name);
        // SAFETY: `raw` was just made from this device.
        let requirements = unsafe { gpu.device().get_image_memory_requirements(raw) };
        let access = MemoryAccess::Device;
        let request = MemoryRequest { name, requirements, access, is_buffer: false, addressed: false };
        let memory = image.memory.insert(Memory::new(gpu, &request)?);
        let (memory, offset) = memory.place();
        // SAFETY: the image is unbound; memory type, size and alignment come from its requirements.
        unsafe { gpu.device().bind_image_memory(raw, memory, offset) }
            .map_err(|result| gpu.failed("vkBindImageMemory", result))?;
        let kind = match (desc.volume, desc.layers) {
            (true, _) => vk::ImageViewType::TYPE_3D,
            (false, 1) => vk::ImageViewType::TYPE_2D,
            (false, _) => vk::ImageViewType::TYPE_2D_ARRAY,
        };
        let info = vk::ImageViewCreateInfo::default()
            .image(raw)
            .view_type(kind)
            .format(desc.format)
            .subresource_range(whole(vk::ImageAspectFlags::COLOR));
        // SAFETY: the image is bound to memory and outlives its view.
        image.view = unsafe { gpu.device().create_image_view(&info, gpu.host_callbacks()) }
            .map_err(|result| gpu.failed("vkCreateImageView", result))?;
        gpu.name(image.view, name);
        Ok(image)
    }

    pub(crate) fn desc(&self) -> &ImageDesc {
        &self.desc
    }
}

impl Drop for Image {
    fn drop(&mut self) {
        // SAFETY: a submission holds every resource it names until its fence has signalled, so no
        // pending command refers to the view (VUID-vkDestroyImageView-imageView-01026); null is allowed.
        unsafe { self.gpu.device().destroy_image_view(self.view, self.gpu.host_callbacks()) };
        // SAFETY: the same for the image (VUID-vkDestroyImage-image-01000).
        unsafe { self.gpu.device().destroy_image(self.raw, self.gpu.host_callbacks()) };
    }
}

/// Returns the range of all levels and layers of an aspect.
pub(crate) fn whole(aspect: vk::ImageAspectFlags) -> vk::ImageSubresourceRange {
    vk::ImageSubresourceRange::default()
        .aspect_mask(aspect)
        .level_count(vk::REMAINING_MIP_LEVELS)
        .layer_count(vk::REMAINING_ARRAY_LAYERS)
}

impl Gpu {
    /// Checks the size of an image to draw into against the limits of framebuffers and viewports.
    pub(crate) fn check_drawing(&self, name: &str, [w, h]: [u32; 2]) -> Result<()> {
        let limits = self.limits();
        let [view_w, view_h] = limits.max_viewport_dimensions;
        let most = [limits.max_framebuffer_width.min(view_w), limits.max_framebuffer_height.min(view_h)];
        if w > most[0] || h > most[1] {
            return Err(Error::unsupported(
                name,
                format!("{w} x {h} exceeds the limit of {} x {} for drawing", most[0], most[1]),
            ));
        }
        Ok(())
    }

    /// Checks limits and budget for an image before its texels are computed.
    pub(crate) fn check_image(&self, name: &str, desc: &ImageDesc) -> Result<()> {
        self.alive()?;
        check_limits(self, name, desc)?;
        self.check_allocation(name, desc.texel_bytes())?;
        self.inner.budget.check(name, desc.texel_bytes())
    }
}

fn check_limits(gpu: &Gpu, name: &str, desc: &ImageDesc) -> Result<()> {
    let limits = gpu.limits();
    let [w, h, d] = desc.extent;
    let (largest, limit, shown, kind) = if desc.volume {
        (w.max(h).max(d), limits.max_image_dimension3_d, "3D image", vk::ImageType::TYPE_3D)
    } else {
        (w.max(h), limits.max_image_dimension2_d, "2D image", vk::ImageType::TYPE_2D)
    };
    if desc.usage.contains(vk::ImageUsageFlags::COLOR_ATTACHMENT) {
        gpu.check_drawing(name, [w, h])?;
    }
    let lacks = |why: String| Err(Error::unsupported(name, why));
    if largest > limit {
        return lacks(format!("an extent of {largest} exceeds the limit of {limit} for a {shown}"));
    }
    let most = limits.max_image_array_layers;
    if desc.layers > most {
        return lacks(format!("{} layers exceed the limit of {most}", desc.layers));
    }
    // Drivers may limit the size of an image in bytes below the limits of its extents.
    let (instance, physical) = (&gpu.inner.instance.raw, gpu.inner.candidate.raw);
    let (tiling, flags) = (vk::ImageTiling::OPTIMAL, vk::ImageCreateFlags::empty());
    let ImageDesc { format, usage, .. } = *desc;
    // SAFETY: the physical device belongs to this instance.
    let properties = unsafe {
        instance.get_physical_device_image_format_properties(physical, format, kind, tiling, usage, flags)
    };
    let bytes = desc.texel_bytes();
    match properties.map(|properties| properties.max_resource_size) {
        Ok(most) if bytes <= most => Ok(()),
        Ok(most) => lacks(format!("{bytes} bytes exceed the limit of {most} for one image")),
        Err(vk::Result::ERROR_FORMAT_NOT_SUPPORTED) => {
            lacks(format!("no images of format {format:?} with {usage:?}"))
        }
        Err(result) => Err(gpu.failed("vkGetPhysicalDeviceImageFormatProperties", result)),
    }
}
