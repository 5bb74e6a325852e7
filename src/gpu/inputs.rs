//! The inputs of shaders: resources and specialisation constants. `build.rs` writes a structure of them for every entry.

use std::marker::PhantomData;
use std::sync::Arc;

use ash::vk;

use super::buffer::Buffer;
use super::image::Image;
use super::spirv::{Shader, SpecConstant};

/// A resource for a binding.
#[derive(Clone, Debug)]
pub(crate) enum Resource {
    /// A whole buffer that the shader only reads.
    Read(Arc<Buffer>),
    /// A whole buffer that the shader writes.
    Write(Arc<Buffer>),
    /// An image with a filter to sample it with.
    Sampled(Arc<Image>, vk::Filter),
    /// A storage image.
    Stored(Arc<Image>),
    /// An image of the caller, set by [`Descriptors::sample_external`](super::Descriptors::sample_external) before each recording.
    External,
}

/// A uniform block.
#[derive(Clone, Debug)]
pub(crate) struct Uniform(pub(crate) Arc<Buffer>);

/// A storage block that the shader only reads.
#[derive(Clone, Debug)]
pub(crate) struct Read(pub(crate) Arc<Buffer>);

/// A storage block that the shader writes.
#[derive(Clone, Debug)]
pub(crate) struct Write(pub(crate) Arc<Buffer>);

/// An image that the shader samples; `None` is one of the caller's.
#[derive(Clone, Debug)]
pub(crate) struct Sampled(pub(crate) Option<(Arc<Image>, vk::Filter)>);

impl Sampled {
    /// An image of the caller.
    pub(crate) fn external() -> Self {
        Self(None)
    }
}

/// A storage image.
#[derive(Clone, Debug)]
pub(crate) struct Stored(pub(crate) Arc<Image>);

impl Buffer {
    /// Binds the buffer as a uniform block.
    pub(crate) fn uniform(self: &Arc<Self>) -> Uniform {
        Uniform(Arc::clone(self))
    }

    /// Binds the buffer as a storage block that is only read.
    pub(crate) fn read(self: &Arc<Self>) -> Read {
        Read(Arc::clone(self))
    }

    /// Binds the buffer as a storage block that is written.
    pub(crate) fn write(self: &Arc<Self>) -> Write {
        Write(Arc::clone(self))
    }
}

impl Image {
    /// Binds the image for sampling.
    pub(crate) fn sampled(self: &Arc<Self>, filter: vk::Filter) -> Sampled {
        Sampled(Some((Arc::clone(self), filter)))
    }

    /// Binds the image for loads and stores.
    pub(crate) fn stored(self: &Arc<Self>) -> Stored {
        Stored(Arc::clone(self))
    }
}

impl From<Uniform> for Resource {
    fn from(Uniform(buffer): Uniform) -> Self {
        Self::Read(buffer)
    }
}

impl From<Read> for Resource {
    fn from(Read(buffer): Read) -> Self {
        Self::Read(buffer)
    }
}

impl From<Write> for Resource {
    fn from(Write(buffer): Write) -> Self {
        Self::Write(buffer)
    }
}

impl From<Sampled> for Resource {
    fn from(Sampled(image): Sampled) -> Self {
        image.map_or(Self::External, |(image, filter)| Self::Sampled(image, filter))
    }
}

impl From<Stored> for Resource {
    fn from(Stored(image): Stored) -> Self {
        Self::Stored(image)
    }
}

/// The inputs of a pipeline by number.
#[derive(Debug, Default)]
pub(crate) struct InputList {
    pub(crate) resources: Vec<(u32, Resource)>,
    pub(crate) constants: Vec<SpecConstant>,
}

/// A structure of the inputs of an entry, or of a header.
pub(crate) trait Inputs {
    /// Appends the inputs with their numbers.
    fn list(&self, to: &mut InputList);
}

/// An entry of a shader with the type of its inputs.
#[derive(Debug)]
pub(crate) struct Entry<I> {
    shader: &'static Shader,
    inputs: PhantomData<fn(&I)>,
}

impl<I: Inputs> Entry<I> {
    pub(crate) const fn new(shader: &'static Shader) -> Self {
        Self { shader, inputs: PhantomData }
    }

    /// Returns the shader with its inputs, for a pipeline.
    pub(crate) fn with(&self, inputs: &I) -> Bound {
        let mut list = InputList::default();
        inputs.list(&mut list);
        Bound { shaders: vec![self.shader], inputs: list }
    }
}

// Derived, these would need `I: Copy`.
impl<I> Clone for Entry<I> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<I> Copy for Entry<I> {}

/// The shaders of a pipeline with all their inputs.
#[derive(Debug)]
pub(crate) struct Bound {
    pub(super) shaders: Vec<&'static Shader>,
    pub(super) inputs: InputList,
}

impl Bound {
    /// Adds the next stage of the pipeline. Inputs that both stages read are the same.
    #[must_use]
    pub(crate) fn and(mut self, next: Self) -> Self {
        self.shaders.extend(next.shaders);
        self.inputs.resources.extend(next.inputs.resources);
        for constant in next.inputs.constants {
            let differs = |&(number, value): &SpecConstant| number == constant.0 && value != constant.1;
            debug_assert!(
                !self.inputs.constants.iter().any(differs),
                "constant {} has two values",
                constant.0
            );
            if !self.inputs.constants.contains(&constant) {
                self.inputs.constants.push(constant);
            }
        }
        self
    }
}
