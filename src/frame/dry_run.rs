//! Counts the work of a frame by recording it without a command buffer.

use ash::vk;

use crate::gpu::{Counted, Gpu, Recorder, TargetImage};

/// Counts the work that `record` records, without a command buffer. Its second argument is a placeholder for the caller's target.
pub(crate) fn dry_run(gpu: &Gpu, record: impl FnOnce(&mut Recorder<'_>, &TargetImage)) -> Counted {
    // A recorder that counts reads no handle.
    let target = TargetImage {
        image: vk::Image::null(),
        view: vk::ImageView::null(),
        format: vk::Format::UNDEFINED,
        extent: [0; 2],
        device: gpu.device().handle(),
    };
    let mut recorder = Recorder::counting(gpu);
    record(&mut recorder, &target);
    recorder.counted()
}
