//! Device buffers that hold one part of the data at a time, and the memory that the host writes parts into.

use std::sync::Arc;

use crate::error::Result;
use crate::gpu::{Buffer, BufferUse, Gpu, Recorder};

/// The buffers of one part on the device, and two sets in which the host writes: of the part that frames begin with, and of another.
#[derive(Debug)]
pub(crate) struct PartBuffers {
    pub(crate) buffers: Vec<Arc<Buffer>>,
    staging: [Staged; 2],
}

#[derive(Debug)]
struct Staged {
    part: Option<u32>,
    buffers: Vec<Arc<Buffer>>,
}

impl PartBuffers {
    /// Makes buffers with these names and room for so many bytes.
    pub(crate) fn new(gpu: &Gpu, of: &[(&str, u64)]) -> Result<Self> {
        let all = |suffix: &str, purpose| -> Result<Vec<_>> {
            let make = |(name, bytes): &(&str, u64)| {
                Buffer::new(gpu, &format!("{name}{suffix}"), (*bytes).max(4), purpose).map(Arc::new)
            };
            of.iter().map(make).collect()
        };
        let staged = || all(" (staging)", BufferUse::Upload).map(|buffers| Staged { part: None, buffers });
        Ok(Self { buffers: all("", BufferUse::ShaderRead)?, staging: [staged()?, staged()?] })
    }

    /// Has a part written where the host does, for the begin of a frame or for what follows. Returns `false`, and changes nothing, while a
    /// recording reads another part there.
    pub(crate) fn stage(&mut self, part: u32, begins: bool, write: impl FnOnce(Vec<&mut [u8]>)) -> bool {
        let staged = &mut self.staging[usize::from(!begins)];
        if staged.part == Some(part) {
            return true;
        }
        let bytes = staged.buffers.iter_mut().map(|buffer| Arc::get_mut(buffer).and_then(Buffer::bytes_mut));
        let Some(bytes) = bytes.collect::<Option<Vec<_>>>() else { return false };
        write(bytes);
        staged.part = Some(part);
        true
    }

    /// Forgets which parts are written: the same numbers are other parts from now on.
    pub(crate) fn forget(&mut self) {
        self.staging.iter_mut().for_each(|staged| staged.part = None);
    }

    /// Records the upload of the staged part.
    pub(crate) fn record(&self, recorder: &mut Recorder<'_>, begins: bool) {
        for (from, to) in self.staging[usize::from(!begins)].buffers.iter().zip(&self.buffers) {
            recorder.copy_buffer("part", from, to, to.size());
        }
    }
}
