//! A compiled shader module with its bindings, which `build.rs` has read from the SPIR-V.

/// A specialisation constant: its number and its value; booleans are 0 and 1.
pub(crate) type SpecConstant = (u32, u32);

/// Pipeline stage of a module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Stage {
    Vertex,
    Fragment,
    Compute,
}

/// Kind of a descriptor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum BindingKind {
    UniformBuffer,
    StorageBuffer,
    SampledImage,
    StorageImage,
}

/// One entry of one GLSL file, compiled.
#[derive(Debug)]
pub(crate) struct Shader {
    /// File and entry, such as `SLICES_3D_FRAGMENT`; unique.
    pub(crate) name: &'static str,
    pub(crate) stage: Stage,
    /// Size of the push constants in bytes; 0 if there are none.
    pub(crate) push_bytes: u32,
    /// Bindings of set 0, ascending.
    pub(crate) bindings: &'static [(u32, BindingKind)],
    /// SPIR-V, little endian.
    pub(crate) code: &'static [u8],
}
