//! Vulkan's types by their C names. The header includes them from `<vulkan/vulkan_core.h>`.

use ash::vk;

pub use ash::vk::{
    Bool32 as VkBool32, CommandBuffer as VkCommandBuffer, Device as VkDevice, DeviceMemory as VkDeviceMemory,
    Extent2D as VkExtent2D, Format as VkFormat, Image as VkImage, ImageLayout as VkImageLayout,
    ImageView as VkImageView, Instance as VkInstance, PhysicalDevice as VkPhysicalDevice,
    PipelineCache as VkPipelineCache, Queue as VkQueue, Result as VkResult,
};

/// `VkAllocationCallbacks`.
pub type VkAllocationCallbacks = vk::AllocationCallbacks<'static>;
/// `VkDeviceCreateInfo`.
pub type VkDeviceCreateInfo = vk::DeviceCreateInfo<'static>;
/// `PFN_vkGetInstanceProcAddr`, which may be null.
pub type PFN_vkGetInstanceProcAddr = Option<vk::PFN_vkGetInstanceProcAddr>;
