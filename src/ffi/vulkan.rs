//! Vulkan's types by their C names. The header includes them from `<vulkan/vulkan_core.h>`.

use ash::vk;

/// `VkBool32`: 0 is false, other values are true.
pub type VkBool32 = vk::Bool32;
/// `VkInstance`.
pub type VkInstance = vk::Instance;
/// `VkPhysicalDevice`.
pub type VkPhysicalDevice = vk::PhysicalDevice;
/// `VkDevice`.
pub type VkDevice = vk::Device;
/// `VkQueue`.
pub type VkQueue = vk::Queue;
/// `VkCommandBuffer`.
pub type VkCommandBuffer = vk::CommandBuffer;
/// `VkImage`.
pub type VkImage = vk::Image;
/// `VkImageView`.
pub type VkImageView = vk::ImageView;
/// `VkFormat`.
pub type VkFormat = vk::Format;
/// `VkImageLayout`.
pub type VkImageLayout = vk::ImageLayout;
/// `VkExtent2D`.
pub type VkExtent2D = vk::Extent2D;
/// `VkResult`.
pub type VkResult = vk::Result;
/// `VkDeviceCreateInfo`.
pub type VkDeviceCreateInfo = vk::DeviceCreateInfo<'static>;
/// `PFN_vkGetInstanceProcAddr`, which may be null.
pub type PFN_vkGetInstanceProcAddr = Option<vk::PFN_vkGetInstanceProcAddr>;
