//! Uploads and downloads through staging buffers.

use std::sync::Arc;

use super::buffer::{Buffer, BufferUse};
use super::device::Gpu;
use super::image::{Image, ImageDesc};
use super::recorder::Recorder;
use super::submit::Commands;
use super::sync::Use;
use crate::error::{Error, Result};
use crate::num;

impl Buffer {
    /// Makes a buffer for shaders to read, and uploads `bytes` into it.
    pub(crate) fn with_data(gpu: &Gpu, name: &str, bytes: &[u8]) -> Result<Arc<Self>> {
        let size = num::wide(bytes.len());
        let buffer = Arc::new(Self::new(gpu, name, size, BufferUse::ShaderRead)?);
        let staging = Self::staging(gpu, name, bytes)?;
        Commands::new(gpu)?.run("upload", |recorder| {
            recorder.copy_buffer("upload", &staging, &buffer, size);
            recorder.release_buffer(&buffer);
        })?;
        Ok(buffer)
    }

    /// Makes a staging buffer with `bytes`.
    pub(crate) fn staging(gpu: &Gpu, name: &str, bytes: &[u8]) -> Result<Arc<Self>> {
        let size = num::wide(bytes.len());
        let mut buffer = Arc::new(Self::new(gpu, &format!("{name} (staging)"), size, BufferUse::Upload)?);
        fill_staging(name, &mut buffer, size, |memory| memory.copy_from_slice(bytes))?;
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
    /// Makes an image and uploads its texels, level by level, a group of planes at a time: while the device copies one group, the next
    /// is filled. `fill(level, first, memory)` writes the planes of a volume, or the layers of an array, from `first` on until `memory` is
    /// full. Every later shader may sample the image.
    pub(crate) fn with_data(
        gpu: &Gpu,
        name: &str,
        desc: &ImageDesc,
        fill: impl Fn(u32, usize, &mut [u8]),
    ) -> Result<Arc<Self>> {
        let image = Arc::new(Self::new(gpu, name, desc)?);
        let groups = groups(gpu, desc);
        let most = groups.iter().map(|group| group.bytes).max().unwrap_or(0);
        let mut slots = Vec::new();
        for (number, group) in groups.iter().enumerate() {
            if slots.len() < SLOTS {
                let buffer = Buffer::new(gpu, &format!("{name} (staging)"), most, BufferUse::Upload)?;
                slots.push((Arc::new(buffer), Commands::new(gpu)?));
            }
            let (buffer, commands) = &mut slots[number % SLOTS];
            // The device no longer reads the buffer then.
            commands.settle()?;
            fill_staging(name, buffer, group.bytes, |memory| {
                fill(group.level, num::index(group.first), memory)
            })?;
            let mut recorder = Recorder::new(gpu, commands.begin()?, None);
            if number > 0 {
                recorder.assume_after(&image, Use::TransferWrite);
            }
            recorder.copy_buffer_to_image("upload", buffer, &image, group.level, [group.first, group.count]);
            if number + 1 == groups.len() {
                recorder.release_image(&image);
            }
            let (_, keep) = recorder.finish()?;
            commands.send(keep)?;
        }
        slots.iter_mut().try_for_each(|(_, commands)| commands.settle())?;
        Ok(image)
    }
}

/// Staging buffers of an upload: one is filled while the device reads the other.
const SLOTS: usize = 2;

/// Planes or layers of a level that one submission uploads.
struct Group {
    level: u32,
    first: u32,
    count: u32,
    bytes: u64,
}

/// Returns the groups of an image, none larger than a staging buffer unless it is a single plane.
fn groups(gpu: &Gpu, desc: &ImageDesc) -> Vec<Group> {
    let mut groups = Vec::new();
    for level in 0..desc.levels {
        let (planes, plane_bytes) = (desc.planes(level), desc.plane_bytes(level));
        let most =
            u32::try_from(gpu.inner.staging_bytes / plane_bytes.max(1)).unwrap_or(u32::MAX).clamp(1, planes);
        for first in (0..planes).step_by(num::index(most)) {
            let count = most.min(planes - first);
            groups.push(Group { level, first, count, bytes: plane_bytes * u64::from(count) });
        }
    }
    groups
}

/// Fills the first `size` bytes of a staging buffer that no submission reads.
fn fill_staging(name: &str, buffer: &mut Arc<Buffer>, size: u64, fill: impl FnOnce(&mut [u8])) -> Result<()> {
    let size = usize::try_from(size).unwrap_or(usize::MAX);
    let memory = Arc::get_mut(buffer).and_then(Buffer::bytes_mut).and_then(|memory| memory.get_mut(..size));
    let Some(memory) = memory else {
        return Err(Error::invalid(name, "staging memory is not visible to the host"));
    };
    fill(memory);
    Ok(())
}
