//! Collects the steps of a frame without a command buffer.

use ash::vk;

use crate::gpu::sync::Use;
use crate::gpu::{Gpu, Recorder, Step, TargetImage};

/// Returns the steps that `record` adds. Its second argument is a placeholder for the caller's target.
pub(crate) fn dry_run(gpu: &Gpu, record: impl FnOnce(&mut Recorder<'_>, &TargetImage)) -> Vec<Step> {
    // Collecting reads no handle.
    let target = TargetImage {
        image: vk::Image::null(),
        view: vk::ImageView::null(),
        format: vk::Format::UNDEFINED,
        corner: [0; 2],
        extent: [0; 2],
        device: gpu.device().handle(),
    };
    let mut recorder = Recorder::collecting(gpu);
    record(&mut recorder, &target);
    recorder.into_steps()
}

/// Returns the number of passes, each of which has a timer.
pub(crate) fn passes(steps: &[Step]) -> u32 {
    crate::num::count(steps.iter().filter(|step| step.is_pass()).count())
}

/// Returns the number of dispatches and draws.
pub(crate) fn draws(steps: &[Step]) -> u32 {
    steps.iter().map(|step| step.work.draws()).sum()
}

/// Returns the last use of a resource of a key.
pub(crate) fn last_use(steps: &[Step], key: (bool, u64)) -> Option<Use> {
    let uses = steps.iter().rev().flat_map(|step| step.uses.iter().rev());
    uses.filter(|(used, _)| used.key() == key).map(|(_, usage)| *usage).next()
}
