//! Pipelines and what describes them.

use ash::vk;

use super::shader::{BindingKind, Shader};

/// A specialisation constant: its number and its value. Booleans are 0 and 1.
pub(crate) type SpecConstant = (u32, u32);

/// Fixed-function blending of premultiplied colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Blend {
    /// Replace.
    Copy,
    /// New in front of old: back to front.
    Over,
    /// New behind old: front to back.
    Under,
}

/// A graphics pipeline without vertex buffers: shaders make their vertices from indices.
#[derive(Debug)]
pub(crate) struct GraphicsDesc<'a> {
    pub(crate) vertex: &'static Shader,
    pub(crate) fragment: &'static Shader,
    pub(crate) topology: vk::PrimitiveTopology,
    pub(crate) blend: Blend,
    /// Format of the colour attachment; `None` where shaders write elsewhere.
    pub(crate) format: Option<vk::Format>,
    pub(crate) constants: &'a [SpecConstant],
}

/// A compute pipeline.
#[derive(Debug)]
pub(crate) struct ComputeDesc<'a> {
    pub(crate) shader: &'static Shader,
    pub(crate) constants: &'a [SpecConstant],
}

/// What makes two pipelines the same.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct PipelineKey {
    pub(super) shaders: Vec<&'static str>,
    pub(super) constants: Vec<SpecConstant>,
    pub(super) state: Option<(vk::PrimitiveTopology, Blend, Option<vk::Format>)>,
}

/// A pipeline with its layout. Owned by the device's table; lives as long as the device.
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

    /// Destroys the handles; only the device's destructor does.
    pub(super) fn destroy(&self, device: &ash::Device) {
        // SAFETY: made from this device, which is idle; null is allowed.
        unsafe { device.destroy_pipeline(self.raw, None) };
        // SAFETY: as above.
        unsafe { device.destroy_pipeline_layout(self.layout, None) };
        // SAFETY: as above; every set of this layout is gone.
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
