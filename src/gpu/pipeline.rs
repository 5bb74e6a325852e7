//! Shaders, pipelines and their descriptions.

use std::hash::{Hash, Hasher};
use std::sync::{Mutex, OnceLock};
use std::time::Duration;

use ash::vk;

use super::addressing::by_address;

/// A specialisation constant: its number and its value; booleans are 0 and 1.
pub(crate) type SpecConstant = (u32, u32);

/// A property of the device that shaders read as a specialisation constant, `DEVICE_*` in `glsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DeviceConstant {
    /// Loop iterations of one invocation.
    Turns,
    /// Bits of a pixel's fraction to which the rasteriser rounds corners.
    SubpixelBits,
    /// Bits of emulated filter weights; 0 where the sampler's own are used.
    WeightBits,
    /// Whether workgroups take their work in reverse order.
    Permuted,
}

/// A compiled entry of a GLSL file, with what `build.rs` has read from its SPIR-V.
#[derive(Debug)]
pub(crate) struct Shader {
    /// File and entry, such as `SLICES_3D_FRAGMENT`; unique.
    pub(super) name: &'static str,
    pub(super) stage: vk::ShaderStageFlags,
    /// Size of the push constants in bytes; 0 if there are none.
    pub(super) push_bytes: u32,
    /// Bindings of set 0, ascending.
    pub(super) bindings: &'static [(u32, vk::DescriptorType)],
    /// Keys of options with the numbers of the specialisation constants that take their values.
    pub(super) options: &'static [(&'static str, u32)],
    /// Properties of the device with the numbers of the constants that take them.
    pub(super) device: &'static [(DeviceConstant, u32)],
    /// SPIR-V, little endian.
    pub(super) code: &'static [u8],
}

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

impl Shader {
    /// Returns the words of the module.
    pub(super) fn words(&self) -> Vec<u32> {
        self.code.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
    }
}

impl PartialEq for Shader {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for Shader {}

impl Hash for Shader {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.name.hash(state);
    }
}

/// Identifies a pipeline: equal keys mean the same pipeline.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) struct PipelineKey {
    pub(super) shaders: Vec<&'static Shader>,
    pub(super) constants: Vec<SpecConstant>,
    /// Bindings of storage blocks that shaders find by address, ascending.
    pub(super) addressed: Vec<u32>,
    pub(super) state: Option<GraphicsState>,
}

impl PipelineKey {
    /// Returns the words of a shader's module, in which large buffers are found by address.
    pub(super) fn words(&self, shader: &Shader) -> Vec<u32> {
        let words = shader.words();
        // It could be rewritten for the layouts, too.
        if self.addressed.is_empty() { words } else { by_address(&words, &self.addressed).unwrap_or(words) }
    }
}

/// A pipeline with its layout. The device's table owns it, for the life of the device. It is built before the first recording that
/// uses it, together with the others of the recording.
#[derive(Debug, Default)]
pub(crate) struct Pipeline {
    pub(super) name: String,
    pub(super) key: PipelineKey,
    pub(super) raw: OnceLock<vk::Pipeline>,
    /// How long the driver took to build it.
    pub(super) build_time: OnceLock<Duration>,
    /// Held while the pipeline is being built.
    pub(super) building: Mutex<()>,
    pub(super) layout: vk::PipelineLayout,
    pub(super) set_layout: vk::DescriptorSetLayout,
    pub(super) bind_point: vk::PipelineBindPoint,
    pub(super) stages: vk::ShaderStageFlags,
    pub(super) push_bytes: u32,
    pub(super) bindings: Vec<(u32, vk::DescriptorType)>,
}

impl Pipeline {
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    pub(crate) fn is_built(&self) -> bool {
        self.raw.get().is_some()
    }

    /// Returns the handle, which is null until the pipeline is built.
    pub(super) fn raw(&self) -> vk::Pipeline {
        self.raw.get().copied().unwrap_or_default()
    }

    /// Destroys the handles. Called by the destructor of the device, and for a pipeline that could not be built.
    pub(super) fn destroy(&self, device: &ash::Device, callbacks: Option<&vk::AllocationCallbacks<'_>>) {
        // SAFETY: made from this device, which is idle; null is allowed.
        unsafe { device.destroy_pipeline(self.raw(), callbacks) };
        // SAFETY: as above.
        unsafe { device.destroy_pipeline_layout(self.layout, callbacks) };
        // SAFETY: as above; every set of this layout is destroyed.
        unsafe { device.destroy_descriptor_set_layout(self.set_layout, callbacks) };
    }
}
