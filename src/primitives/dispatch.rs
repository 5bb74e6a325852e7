//! What techniques that draw from lists are made of: passes, their buffers, and words that come back.

use std::sync::Arc;

use bytemuck::Pod;

use crate::error::Result;
use crate::gpu::shader::Shader;
use crate::gpu::{
    Buffer, BufferUse, ComputeDesc, Descriptors, Gpu, Pipeline, Recorder, Resource, SpecConstant,
};

/// A pipeline with what it binds.
#[derive(Debug)]
pub(crate) struct Dispatch {
    pub(crate) name: String,
    pub(crate) pipeline: Arc<Pipeline>,
    pub(crate) descriptors: Arc<Descriptors>,
}

impl Dispatch {
    /// Records `groups` workgroups.
    pub(crate) fn record(&self, recorder: &mut Recorder<'_>, push: &impl Pod, groups: [u32; 3]) {
        recorder.dispatch(&self.name, &self.pipeline, &self.descriptors, bytemuck::bytes_of(push), groups);
    }
}

/// A compute pass.
pub(crate) fn pass(
    gpu: &Gpu,
    name: &str,
    shader: &'static Shader,
    constants: &[SpecConstant],
    resources: &[(u32, Resource)],
) -> Result<Dispatch> {
    let pipeline = gpu.compute_pipeline(name, &ComputeDesc { shader, constants })?;
    let descriptors = Arc::new(Descriptors::new(gpu, &pipeline, resources)?);
    Ok(Dispatch { name: name.to_string(), pipeline, descriptors })
}

/// Bytes as words.
pub(crate) fn words(bytes: &[u8]) -> Vec<u32> {
    bytes.chunks_exact(4).map(|b| u32::from_ne_bytes([b[0], b[1], b[2], b[3]])).collect()
}

/// The sum that a scan has left, all 64 bits of it.
pub(crate) fn total(buffer: &Buffer) -> Result<u64> {
    let words = words(&buffer.host_copy()?);
    let at = |i: usize| u64::from(words.get(i).copied().unwrap_or(0));
    Ok(at(0) | at(1) << 32)
}

/// Workgroups of `size` for `count` invocations, within what every device allows along each side.
pub(crate) fn groups_of(count: u32, size: u32) -> [u32; 3] {
    // At least this many workgroups are allowed along each side.
    let groups = count.div_ceil(size).max(1);
    let across = groups.min(65_535);
    [across, groups.div_ceil(across), 1]
}

/// Workgroups of 8 x 8 invocations, one each for a pixel or a texel.
pub(crate) fn tiles_of([width, height]: [u32; 2]) -> [u32; 3] {
    [width.div_ceil(8), height.div_ceil(8), 1]
}

/// Words that shaders write.
pub(crate) fn buffer(gpu: &Gpu, name: &str, words: u64) -> Result<Arc<Buffer>> {
    Buffer::new(gpu, name, 4 * words.max(1), BufferUse::ShaderWrite).map(Arc::new)
}

/// Bytes that come back.
pub(crate) fn download(gpu: &Gpu, name: &str, bytes: u64) -> Result<Arc<Buffer>> {
    Buffer::new(gpu, name, bytes.max(4), BufferUse::Download).map(Arc::new)
}
