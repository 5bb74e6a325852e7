//! A validated device for unit tests.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::{
    Buffer, BufferUse, Commands, Gpu, GpuOptions, PipelineCache, Recorder, Validation, ValidationLog,
};

/// Serialises tests with devices: the layer keeps its devices in a table without a lock.
static TURN: Mutex<()> = Mutex::new(());

/// A device that fails the test on drop if there were validation messages or memory is still allocated.
pub(crate) struct TestGpu {
    gpu: Option<Gpu>,
    log: Arc<ValidationLog>,
    _turn: MutexGuard<'static, ()>,
}

impl TestGpu {
    /// Opens a device with core and synchronization validation.
    pub(crate) fn new() -> Self {
        Self::with(Validation::On)
    }

    /// Opens a device with another validation; measurements use none.
    pub(crate) fn with(validation: Validation) -> Self {
        let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        let options = GpuOptions {
            validation,
            pipeline_cache: PipelineCache::Off,
            poison: true,
            ..GpuOptions::default()
        };
        let gpu = Gpu::new(&options).unwrap();
        let log = gpu.validation_log();
        Self { gpu: Some(gpu), log, _turn: turn }
    }

    /// Makes a buffer of at least one word that shaders write, and uploads `words`.
    pub(crate) fn upload(&self, words: &[u32]) -> Arc<Buffer> {
        let bytes = 4 * words.len().max(1) as u64;
        let buffer = Arc::new(Buffer::new(self, "test.words", bytes, BufferUse::ShaderWrite).unwrap());
        self.write(&buffer, words);
        buffer
    }

    /// Replaces the first words of a buffer.
    pub(crate) fn write(&self, buffer: &Arc<Buffer>, words: &[u32]) {
        if words.is_empty() {
            return;
        }
        let bytes = 4 * words.len() as u64;
        let mut staging = Buffer::new(self, "test.staging", bytes, BufferUse::Upload).unwrap();
        staging.bytes_mut().unwrap()[..4 * words.len()].copy_from_slice(bytemuck::cast_slice(words));
        let staging = Arc::new(staging);
        self.record(|recorder| {
            recorder.copy_buffer("upload", &staging, buffer, bytes);
            recorder.release_buffer(buffer);
        });
    }

    /// Downloads the words of a buffer.
    pub(crate) fn download(&self, buffer: &Arc<Buffer>) -> Vec<u32> {
        let host = Arc::new(Buffer::new(self, "test.download", buffer.size(), BufferUse::Download).unwrap());
        self.record(|recorder| {
            recorder.copy_buffer("download", buffer, &host, buffer.size());
            recorder.release_to_host(&host);
        });
        host.host_copy().unwrap().chunks_exact(4).map(|b| u32::from_ne_bytes(b.try_into().unwrap())).collect()
    }

    /// Records, submits and waits.
    pub(crate) fn record(&self, work: impl FnOnce(&mut Recorder<'_>)) {
        Commands::new(self).unwrap().run("test", work).unwrap();
    }
}

impl std::ops::Deref for TestGpu {
    type Target = Gpu;
    fn deref(&self) -> &Gpu {
        self.gpu.as_ref().unwrap()
    }
}

impl Drop for TestGpu {
    fn drop(&mut self) {
        let held = self.gpu.as_ref().map(Gpu::memory_report).unwrap_or_default();
        drop(self.gpu.take());
        let messages = self.log.messages();
        if !std::thread::panicking() {
            assert!(held.is_empty(), "still held when the test ends: {held:?}");
            assert!(messages.is_empty(), "validation messages: {messages:#?}");
        }
    }
}
