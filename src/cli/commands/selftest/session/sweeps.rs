//! Sweeps of failures: sessions in which each call fails in turn, or in which the device is lost.

use std::ops::RangeInclusive;

use volraster::gpu::Injection;
use volraster::scene::View;
use volraster::{Error, GpuScene, Renderer, Result};

use super::harness::{Harness, Outcome, Place, Swept, spread};
use super::sessions::{Pictures, Session, bytes};

/// Lets each call of a session fail in turn, at most `most` calls of each function, on a device that has all
/// pipelines. Checks that each failure is reported or harmless, that nothing stays allocated, and that the next frame
/// is identical to the bit.
pub(crate) fn fail_each(place: &Place, session: &Session, most: usize) -> Outcome<Swept> {
    let harness = Harness::new(place, session);
    let gpu = harness.at("open", harness.open())?;
    let expected = harness.at("first run", session.run(&gpu))?;
    let (again, names) = harness.recorded(|| harness.at("second run", session.run(&gpu)))?;
    harness.same("second run", &again, &expected)?;
    harness.clean("second run", Some(&gpu))?;
    let mut swept = Swept { calls: names.len() as u64, ..Swept::default() };
    for (call, name, result) in spread(&names, most, |_, _| true) {
        let what = format!("call {call}, {name}");
        harness.injection.rewind();
        harness.injection.fail_at(call, result);
        let run = session.run(&gpu);
        if harness.injection.failures() == 0 {
            continue;
        }
        if harness.injection.last_failed() != Some(name) {
            return harness.finding(&what, "a different call failed");
        }
        swept.count_failure(&harness, &what, run, &expected)?;
        harness.clean(&what, Some(&gpu))?;
        if gpu.is_lost() {
            return harness.finding(&what, "the device counts as lost");
        }
        let next = format!("the frame after {what}");
        harness.same(&next, &harness.at(&next, session.frame(&gpu))?, &expected)?;
        harness.clean(&next, Some(&gpu))?;
    }
    harness.injection.rewind();
    drop(gpu);
    harness.clean("the end of the device", None)?;
    Ok(swept)
}

/// Lets each call of a frame fail in turn on a plan that draws again afterwards, first another view, then the same.
/// Checks that its allocations have not grown and that the images are identical to the bit.
pub(crate) fn fail_frames(place: &Place, session: &Session, most: usize) -> Outcome<Swept> {
    let harness = Harness::new(place, session);
    let gpu = harness.at("open", harness.open())?;
    let scene = GpuScene::new(&gpu, session.scene.clone());
    let [first, second] = harness.at("view", session.views())?;
    let (first, second) = (("first view", first), ("second view", second));
    let mut frames = harness.at("prepare", Renderer::new(&scene, session.technique).frames(&first.1))?;
    let mut picture = |(name, view): &(&'static str, View)| -> Result<Pictures> {
        frames.draw(view)?;
        Ok(vec![(*name, bytes(&frames.read_back()?))])
    };
    let mut expected = Pictures::new();
    // Draw until the capacities fit both views.
    for view in [&second, &first, &second, &first] {
        expected.extend(harness.at("first frames", picture(view))?);
    }
    let held = gpu.memory_report().len();
    let (_, names) = harness.recorded(|| harness.at("a frame", picture(&first)))?;
    let mut swept = Swept { calls: names.len() as u64, ..Swept::default() };
    for (call, name, result) in spread(&names, most, |_, _| true) {
        let what = format!("call {call} of a frame, {name}");
        harness.injection.rewind();
        harness.injection.fail_at(call, result);
        let run = picture(&first);
        swept.count_failure(&harness, &what, run, &expected)?;
        let next = format!("the frame after {what}");
        for view in [&second, &first] {
            harness.same(&next, &harness.at(&next, picture(view))?, &expected)?;
        }
        let holds = gpu.memory_report();
        if holds.len() != held {
            return harness.finding(&what, format!("{held} objects were allocated, now {holds:?}"));
        }
        harness.silent(&what)?;
    }
    harness.injection.rewind();
    drop((frames, scene));
    harness.clean("the end of the plan", Some(&gpu))?;
    drop(gpu);
    harness.clean("the end of the device", None)?;
    Ok(swept)
}

/// Functions that are called once per device, so that [`fail_each`] does not reach them.
const ONCE: [&str; 9] = [
    "vkCreateDescriptorSetLayout",
    "vkCreatePipelineLayout",
    "vkCreateShaderModule",
    "vkCreateGraphicsPipelines",
    "vkCreateComputePipelines",
    "vkCreateSampler",
    "vkAllocateMemory",
    "vkMapMemory",
    "vkGetPipelineCacheData",
];

/// Runs a session on a new device, without failures. Returns its pictures, the names of its calls, and the numbers of the
/// calls between opening and destroying the device.
fn first_run(harness: &Harness<'_>) -> Outcome<(Pictures, Vec<&'static str>, RangeInclusive<u64>)> {
    let ((pictures, inner), names) = harness.recorded(|| {
        let gpu = harness.at("open", harness.open())?;
        let opened = harness.injection.calls();
        let pictures = harness.at("first run", harness.session.run(&gpu))?;
        Ok((pictures, opened + 1..=harness.injection.calls()))
    })?;
    harness.clean("first run", None)?;
    Ok((pictures, names, inner))
}

/// Lets each call fail in turn that opens or destroys a device or is made once for it, at most `most` calls of each
/// function, each time on a new device.
pub(crate) fn fail_opening(place: &Place, session: &Session, most: usize) -> Outcome<Swept> {
    let harness = Harness::new(place, session);
    let (expected, names, inner) = first_run(&harness)?;
    let mut swept = Swept { calls: names.len() as u64, ..Swept::default() };
    let outside = |call: u64, name: &str| !inner.contains(&call) || ONCE.contains(&name);
    for (call, name, result) in spread(&names, most, outside) {
        let what = format!("call {call} of a fresh device, {name}");
        harness.injection.rewind();
        harness.injection.fail_at(call, result);
        let gpu = match harness.open() {
            Ok(gpu) => gpu,
            Err(error) => {
                *swept.failed.entry(name).or_default() += 1;
                harness.check_error(&what, &error)?;
                harness.clean(&what, None)?;
                continue;
            }
        };
        let run = session.run(&gpu);
        let at_the_end = harness.injection.failures() == 0;
        if at_the_end {
            harness.at(&what, run)?;
        } else {
            swept.count_failure(&harness, &what, run, &expected)?;
        }
        harness.clean(&what, Some(&gpu))?;
        if !at_the_end {
            let next = format!("the session after {what}");
            harness.same(&next, &harness.at(&next, session.run(&gpu))?, &expected)?;
        }
        drop(gpu);
        harness.clean(&format!("the end after {what}"), None)?;
        if at_the_end && harness.injection.failures() > 0 {
            swept.count_failure(&harness, &what, Ok(Pictures::new()), &expected)?;
        }
    }
    Ok(swept)
}

/// Loses the device at calls that can report it, at most `most` calls of each function, each time on a new device.
/// Checks that the session ends with [`Error::DeviceLost`], that later requests return the same error without a
/// Vulkan call, that nothing stays allocated, and that the device can be opened again.
pub(crate) fn lose(place: &Place, session: &Session, most: usize) -> Outcome<Swept> {
    let harness = Harness::new(place, session);
    let (expected, names, inner) = first_run(&harness)?;
    let mut swept = Swept { calls: *inner.end(), ..Swept::default() };
    let tells = |call: u64, name: &str| inner.contains(&call) && Injection::tells_of_loss(name);
    for (call, name, _) in spread(&names, most, tells) {
        let what = format!("lost at call {call}, {name}");
        harness.injection.rewind();
        let gpu = harness.at(&what, harness.open())?;
        harness.injection.lose_at(call);
        match session.run(&gpu) {
            Err(Error::DeviceLost { call })
                if Some(call) == harness.injection.last_failed() || Injection::tells_of_loss(call) =>
            {
                *swept.failed.entry(call).or_default() += 1;
            }
            Err(error) => return harness.finding(&what, format!("reported as: {error}")),
            Ok(_) => return harness.finding(&what, "no error was returned"),
        }
        if !gpu.is_lost() {
            return harness.finding(&what, "the device does not count as lost");
        }
        harness.clean(&what, Some(&gpu))?;
        let calls = harness.injection.calls();
        if !matches!(session.run(&gpu), Err(Error::DeviceLost { .. })) {
            return harness.finding(&what, "the next session is not refused");
        }
        if harness.injection.calls() != calls {
            return harness.finding(&what, "the next session calls Vulkan");
        }
        drop(gpu);
        harness.clean(&format!("the end after {what}"), None)?;
    }
    // A lost device can be opened again.
    harness.injection.rewind();
    let gpu = harness.at("open again", harness.open())?;
    let frame = harness.at("the frame of another device", session.frame(&gpu))?;
    harness.same("the frame of another device", &frame, &expected)?;
    drop(gpu);
    harness.clean("the end of another device", None)?;
    Ok(swept)
}
