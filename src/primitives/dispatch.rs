//! Compute dispatches with their bindings, the buffers of their words, and numbers of workgroups.

use std::sync::Arc;

use bytemuck::Pod;

use crate::error::Result;
use crate::gpu::{Bound, Buffer, BufferUse, Descriptors, Gpu, Groups, Pipeline, Recorder};

/// A compute pipeline with the resources bound to it, ready to be recorded as a pass of its name.
#[derive(Debug)]
pub(crate) struct Dispatch {
    pub(crate) name: String,
    pub(crate) pipeline: Arc<Pipeline>,
    pub(crate) descriptors: Arc<Descriptors>,
}

impl Dispatch {
    /// Records a dispatch of `groups` workgroups with these push constants. Barriers follow from the bound resources.
    pub(crate) fn record(&self, recorder: &mut Recorder<'_>, push: &impl Pod, groups: impl Into<Groups>) {
        recorder.dispatch(&self.name, &self.pipeline, &self.descriptors, bytemuck::bytes_of(push), groups);
    }
}

/// Makes the dispatch of a shader with its inputs; `name` is both the pipeline's and the pass's.
///
/// # Errors
///
/// Errors of Vulkan when the pipeline or its descriptors cannot be made.
pub(crate) fn pass(gpu: &Gpu, name: &str, bound: &Bound) -> Result<Dispatch> {
    let pipeline = gpu.compute_pipeline(name, bound)?;
    let descriptors = Arc::new(Descriptors::new(gpu, &pipeline, bound)?);
    Ok(Dispatch { name: name.to_string(), pipeline, descriptors })
}

/// Converts bytes to words.
pub(crate) fn words(bytes: &[u8]) -> Vec<u32> {
    bytes.chunks_exact(4).map(|b| u32::from_ne_bytes([b[0], b[1], b[2], b[3]])).collect()
}

/// Reads the 64-bit total of a prefix sum from a buffer that is visible to the host.
pub(crate) fn total(buffer: &Buffer) -> Result<u64> {
    let words = words(&buffer.host_copy()?);
    let at = |i: usize| u64::from(words.get(i).copied().unwrap_or(0));
    Ok(at(0) | at(1) << 32)
}

/// Returns the workgroups of `size` for `count` invocations, in two dimensions where one has too many.
pub(crate) fn groups_of(count: u32, size: u32) -> [u32; 3] {
    // Every device allows this many workgroups in each dimension.
    let groups = count.div_ceil(size).max(1);
    let across = groups.min(65_535);
    [across, groups.div_ceil(across), 1]
}

/// Returns the workgroups of 8 x 8 invocations for one invocation per pixel or texel.
pub(crate) fn tiles_of([width, height]: [u32; 2]) -> [u32; 3] {
    [width.div_ceil(8), height.div_ceil(8), 1]
}

/// Makes a buffer of words that shaders write.
pub(crate) fn buffer(gpu: &Gpu, name: &str, words: u64) -> Result<Arc<Buffer>> {
    Buffer::new(gpu, name, 4 * words.max(1), BufferUse::ShaderWrite).map(Arc::new)
}

/// Makes a download buffer of at least 4 bytes.
pub(crate) fn download(gpu: &Gpu, name: &str, bytes: u64) -> Result<Arc<Buffer>> {
    Buffer::new(gpu, name, bytes.max(4), BufferUse::Download).map(Arc::new)
}
