//! The inputs of shaders: resources and specialisation constants. `build.rs` writes a structure of them for every entry.

use std::marker::PhantomData;
use std::sync::Arc;

use ash::vk;

use super::buffer::Buffer;
use super::image::Image;
use super::pipeline::{Shader, SpecConstant};
use crate::error::Result;

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
pub(crate) struct Uniform(pub(super) Resource);

/// A storage block that the shader only reads.
#[derive(Clone, Debug)]
pub(crate) struct Read(pub(super) Resource);

/// A storage block that the shader writes.
#[derive(Clone, Debug)]
pub(crate) struct Write(pub(super) Resource);

/// An image that the shader samples.
#[derive(Clone, Debug)]
pub(crate) struct Sampled(pub(super) Resource);

/// A storage image.
#[derive(Clone, Debug)]
pub(crate) struct Stored(pub(super) Resource);

impl Sampled {
    /// An image of the caller.
    pub(crate) fn external() -> Self {
        Self(Resource::External)
    }
}

impl Buffer {
    /// Binds the buffer as a uniform block.
    pub(crate) fn uniform(self: &Arc<Self>) -> Uniform {
        Uniform(Resource::Read(Arc::clone(self)))
    }

    /// Binds the buffer as a storage block that is only read.
    pub(crate) fn read(self: &Arc<Self>) -> Read {
        Read(Resource::Read(Arc::clone(self)))
    }

    /// Binds the buffer as a storage block that is written.
    pub(crate) fn write(self: &Arc<Self>) -> Write {
        Write(Resource::Write(Arc::clone(self)))
    }

    /// Binds the buffer for a variant of a shader that does not write: something must be bound.
    pub(crate) fn unwritten(self: &Arc<Self>) -> Write {
        Write(Resource::Read(Arc::clone(self)))
    }
}

impl Image {
    /// Binds the image for sampling.
    pub(crate) fn sampled(self: &Arc<Self>, filter: vk::Filter) -> Sampled {
        Sampled(Resource::Sampled(Arc::clone(self), filter))
    }

    /// Binds the image for loads and stores.
    pub(crate) fn stored(self: &Arc<Self>) -> Stored {
        Stored(Resource::Stored(Arc::clone(self)))
    }
}

/// The shaders of a pipeline with all their inputs by number.
#[derive(Debug)]
pub(crate) struct Bound {
    pub(super) shaders: Vec<&'static Shader>,
    pub(super) resources: Vec<(u32, Resource)>,
    pub(super) constants: Vec<SpecConstant>,
}

/// A structure of the inputs of an entry, or of a header.
pub(crate) trait Inputs {
    /// Appends the inputs with their numbers.
    fn list(&self, to: &mut Bound);
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

    #[cfg(any(test, feature = "testing"))]
    pub(crate) fn shader(&self) -> &'static Shader {
        self.shader
    }

    /// Returns the shader with its inputs, for a pipeline.
    pub(crate) fn with(&self, inputs: &I) -> Bound {
        let mut bound = Bound { shaders: vec![self.shader], resources: Vec::new(), constants: Vec::new() };
        inputs.list(&mut bound);
        bound
    }
}

impl Bound {
    /// Adds the next stage of the pipeline. Inputs that both stages read are the same.
    #[must_use]
    pub(crate) fn and(mut self, next: Self) -> Self {
        self.shaders.extend(next.shaders);
        self.resources.extend(next.resources);
        next.constants.into_iter().for_each(|constant| add(&mut self.constants, constant));
        self
    }

    /// Sets the constants that take the values of options; `value` returns the value of the option of a key.
    pub(crate) fn with_options(mut self, value: impl Fn(&'static str) -> Result<u32>) -> Result<Self> {
        for &(key, number) in self.shaders.iter().flat_map(|shader| shader.options) {
            add(&mut self.constants, (number, value(key)?));
        }
        Ok(self)
    }
}

/// Adds a constant, which stages of one pipeline may share.
pub(super) fn add(constants: &mut Vec<SpecConstant>, constant: SpecConstant) {
    let differs = |&(number, value): &SpecConstant| number == constant.0 && value != constant.1;
    debug_assert!(!constants.iter().any(differs), "constant {} has two values", constant.0);
    if !constants.contains(&constant) {
        constants.push(constant);
    }
}
