//! Uploads and downloads through staging buffers.

use std::sync::Arc;

use super::buffer::{Buffer, BufferUse};
use super::device::Gpu;
use super::image::{Image, ImageDesc};
use super::submit::Commands;
use crate::error::{Error, Result};
use crate::num;

impl Buffer {
    /// Makes a buffer for shaders to read, and uploads `bytes` into it.
    pub(crate) fn with_data(gpu: &Gpu, name: &str, bytes: &[u8]) -> Result<Arc<Self>> {
        let size = num::wide(bytes.len());
        let buffer = Arc::new(Self::new(gpu, name, size, BufferUse::ShaderRead)?);
        let staging = staging(gpu, name, bytes.len(), |memory| memory.copy_from_slice(bytes))?;
        Commands::new(gpu)?.run("upload", |recorder| {
            recorder.copy_buffer("upload", &staging, &buffer, size);
            recorder.release_buffer(&buffer);
        })?;
        Ok(buffer)
    }

    /// Copies the contents of a buffer that is visible to the host.
    pub(crate) fn host_copy(&self) -> Result<Vec<u8>> {
        let length = usize::try_from(self.size()).unwrap_or(usize::MAX);
        let bytes = self.bytes().and_then(|bytes| bytes.get(..length));
        bytes.map(<[u8]>::to_vec).ok_or_else(|| Error::invalid(&self.name, "is not visible to the host"))
    }
}

impl Image {
    /// Makes an image and uploads its texels, level by level, a group of planes at a time. `fill(level, first, memory)`
    /// writes the planes of a volume, or the layers of an array, from `first` on until `memory` is full. Every later shader
    /// may sample the image.
    pub(crate) fn with_data(
        gpu: &Gpu,
        name: &str,
        desc: &ImageDesc,
        fill: impl Fn(u32, usize, &mut [u8]),
    ) -> Result<Arc<Self>> {
        let image = Arc::new(Self::new(gpu, name, desc)?);
        let mut commands = Commands::new(gpu)?;
        for level in 0..desc.levels {
            let (planes, plane_bytes) = (desc.planes(level), desc.plane_bytes(level));
            let group =
                num::count(usize::try_from(gpu.inner.staging_bytes / plane_bytes.max(1)).unwrap_or(1))
                    .clamp(1, planes);
            let mut first = 0;
            while first < planes {
                let count = group.min(planes - first);
                let bytes = usize::try_from(plane_bytes * u64::from(count)).unwrap_or(usize::MAX);
                let buffer = staging(gpu, name, bytes, |memory| fill(level, num::index(first), memory))?;
                commands.run("upload", |recorder| {
                    if level > 0 || first > 0 {
                        recorder.assume_ready(&image);
                    }
                    recorder.copy_buffer_to_image("upload", &buffer, &image, level, [first, count]);
                    recorder.release_image(&image);
                })?;
                first += count;
            }
        }
        Ok(image)
    }
}

/// Makes a staging buffer of `size` bytes and fills it.
fn staging(gpu: &Gpu, name: &str, size: usize, fill: impl FnOnce(&mut [u8])) -> Result<Arc<Buffer>> {
    let mut buffer = Buffer::new(gpu, &format!("{name} (staging)"), num::wide(size), BufferUse::Upload)?;
    let Some(memory) = buffer.bytes_mut().and_then(|memory| memory.get_mut(..size)) else {
        return Err(Error::invalid(name, "staging memory is not visible to the host"));
    };
    fill(memory);
    Ok(Arc::new(buffer))
}
