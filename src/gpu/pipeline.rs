//! Pipelines and their descriptions.

use ash::vk;

use super::spirv::{BindingKind, SpecConstant};

/// A fixed-function blend mode for premultiplied colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Blend {
    /// Replaces the old colour.
    Copy,
    /// Composites the new colour in front of the old: back to front.
    Over,
    /// Composites the new colour behind the old: front to back.
    Under,
}

/// The fixed state of a graphics pipeline without vertex buffers: shaders compute vertices from their index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct GraphicsState {
    pub(crate) topology: vk::PrimitiveTopology,
    pub(crate) blend: Blend,
    /// Format of the colour attachment; `None` where shaders write to buffers or storage images.
    pub(crate) format: Option<vk::Format>,
}

/// Identifies a pipeline: equal keys mean the same pipeline.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct PipelineKey {
    pub(super) shaders: Vec<&'static str>,
    pub(super) constants: Vec<SpecConstant>,
    pub(super) state: Option<GraphicsState>,
}

/// A pipeline with its layout. The device's table owns it, for the life of the device.
#[derive(Debug)]
pub(crate) struct Pipeline {
    pub(super) name: String,
    pub(super) raw: vk::Pipeline,
    pub(super) layout: vk::PipelineLayout,
    pub(super) set_layout: vk::DescriptorSetLayout,
    pub(super) bind_point: vk::PipelineBindPoint,
    pub(super) stages: vk::ShaderStageFlags,
    pub(super) push_bytes: u32,
    pub(super) bindings: Vec<(u32, BindingKind)>,
}

impl Pipeline {
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    pub(crate) fn raw(&self) -> vk::Pipeline {
        self.raw
    }

    pub(crate) fn layout(&self) -> vk::PipelineLayout {
        self.layout
    }

    pub(crate) fn bind_point(&self) -> vk::PipelineBindPoint {
        self.bind_point
    }

    pub(crate) fn stages(&self) -> vk::ShaderStageFlags {
        self.stages
    }

    pub(crate) fn push_bytes(&self) -> u32 {
        self.push_bytes
    }

    /// Destroys the handles. Called by the destructor of the device, and for a pipeline that could not be built.
    pub(super) fn destroy(&self, device: &ash::Device) {
        // SAFETY: made from this device, which is idle; null is allowed.
        unsafe { device.destroy_pipeline(self.raw, None) };
        // SAFETY: as above.
        unsafe { device.destroy_pipeline_layout(self.layout, None) };
        // SAFETY: as above; every set of this layout is destroyed.
        unsafe { device.destroy_descriptor_set_layout(self.set_layout, None) };
    }
}

pub(super) fn descriptor_type(kind: BindingKind) -> vk::DescriptorType {
    match kind {
        BindingKind::UniformBuffer => vk::DescriptorType::UNIFORM_BUFFER,
        BindingKind::StorageBuffer => vk::DescriptorType::STORAGE_BUFFER,
        BindingKind::SampledImage => vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
        BindingKind::StorageImage => vk::DescriptorType::STORAGE_IMAGE,
    }
}
