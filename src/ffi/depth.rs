//! Depth images of the caller.

use ash::vk;
use ash::vk::Handle as _;
use glam::DMat4;

use super::argument::{Structure, choice};
use super::vulkan::{VkExtent2D, VkFormat, VkImageLayout, VkImageView};
use crate::error::{Error, Result};
use crate::gpu::{DepthImage, DepthProjection, Gpu};

/// Kind of the mapping from depth to stored values.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vr_depth_kind {
    /// A perspective camera: at_zero and at_one are distances from the eye along the view.
    VR_DEPTH_PERSPECTIVE = 1,
    /// A camera with parallel rays: at_zero and at_one are distances from the eye along the view, negative behind it.
    VR_DEPTH_ORTHOGRAPHIC = 2,
    /// The mapping of `matrix`.
    VR_DEPTH_MATRIX = 3,
}

/// A depth image of the caller.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_depth_image {
    /// sizeof(vr_depth_image).
    pub struct_size: usize,
    /// A two-dimensional view with one level, one layer and only the depth aspect. Its image has one sample per texel and the
    /// usage VK_IMAGE_USAGE_SAMPLED_BIT.
    pub view: VkImageView,
    /// Format of the view, with depth.
    pub format: VkFormat,
    /// Layout when the commands run. VK_IMAGE_LAYOUT_UNDEFINED stands for VK_IMAGE_LAYOUT_DEPTH_READ_ONLY_OPTIMAL. The commands
    /// leave the image in that layout, last read in the compute shader stage.
    pub layout: VkImageLayout,
    /// Size of the image, equal to that of the plan's view.
    pub extent: VkExtent2D,
    /// A vr_depth_kind.
    pub kind: u32,
    /// Depth along the view, in world units, that is stored as 0: near for the usual projection, far for a reversed one,
    /// INFINITY for a reversed one without a far plane. A pixel that stores the far end shows no surface.
    pub at_zero: f64,
    /// Depth along the view, in world units, that is stored as 1.
    pub at_one: f64,
    /// Matrix from view coordinates to clip coordinates with depths from 0 to 1, column by column.
    pub matrix: [f64; 16],
}

// SAFETY: repr(C), numbers and handles, the first its size.
unsafe impl Structure for vr_depth_image {
    const FIRST: usize = size_of::<Self>();
}

impl vr_depth_image {
    fn projection(&self) -> Result<DepthProjection> {
        let kinds = [
            vr_depth_kind::VR_DEPTH_PERSPECTIVE,
            vr_depth_kind::VR_DEPTH_ORTHOGRAPHIC,
            vr_depth_kind::VR_DEPTH_MATRIX,
        ];
        match choice(self.kind, &kinds.map(|kind| (kind, kind as u32)), "depth kind")? {
            vr_depth_kind::VR_DEPTH_PERSPECTIVE => DepthProjection::perspective(self.at_zero, self.at_one),
            vr_depth_kind::VR_DEPTH_ORTHOGRAPHIC => DepthProjection::orthographic(self.at_zero, self.at_one),
            vr_depth_kind::VR_DEPTH_MATRIX => {
                DepthProjection::from_matrix(&DMat4::from_cols_array(&self.matrix))
            }
        }
    }

    /// # Safety
    ///
    /// As [`DepthImage::from_raw`].
    pub(super) unsafe fn image(&self, gpu: &Gpu) -> Result<DepthImage> {
        if self.view.is_null() {
            return Err(Error::invalid("depth view", "is VK_NULL_HANDLE"));
        }
        let (projection, extent) = (self.projection()?, [self.extent.width, self.extent.height]);
        // SAFETY: the caller's promise.
        let image = unsafe { DepthImage::from_raw(gpu, self.view, self.format, extent, projection) };
        let given = self.layout != vk::ImageLayout::UNDEFINED;
        Ok(if given { image.in_layout(self.layout) } else { image })
    }
}
