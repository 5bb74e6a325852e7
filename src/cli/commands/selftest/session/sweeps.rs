//! Sweeps of failures: sessions in which each call fails in turn, or in which the device is lost.

use volraster::gpu::Injection;
use volraster::scene::View;
use volraster::{Error, GpuScene, Renderer, Result};

use super::harness::{Harness, Outcome, Place, RESULTS, Swept, name_of, spread};
use super::sessions::{Pictures, Session, bytes};

/// Lets each call of a session fail in turn, at most `most` calls of each function, on a device that has all
/// pipelines. Checks that each failure is reported or harmless, that nothing stays allocated, and that the next frame
/// is identical to the bit.
///
/// # Errors
///
/// The first finding.
pub(crate) fn fail_each(place: &Place, session: &Session, most: usize) -> Outcome<Swept> {
    let harness = Harness::new(place, session);
    let gpu = harness.at("open", harness.open())?;
    let expected = harness.at("first run", session.run(&gpu))?;
    harness.injection.rewind();
    harness.injection.keep_names(true);
    let again = harness.at("second run", session.run(&gpu))?;
    harness.same("second run", &again, &expected)?;
    harness.clean("second run", Some(&gpu))?;
    let names = harness.injection.names();
    harness.injection.keep_names(false);
    let mut swept = Swept { calls: harness.injection.calls(), ..Swept::default() };
    for (call, result) in spread(&names, most, |_, _| true).into_iter().zip(RESULTS.iter().cycle()) {
        let name = name_of(&names, call);
        let what = format!("call {call}, {name}");
        harness.injection.rewind();
        harness.injection.fail_at(call, *result);
        let run = session.run(&gpu);
        if harness.injection.failures() == 0 {
            continue;
        }
        if harness.injection.last_failed() != Some(name) {
            return Err(format!("{}: {what}: a different call failed", session.name));
        }
        swept.count_failure(&harness, &what, run, &expected)?;
        harness.clean(&what, Some(&gpu))?;
        if gpu.is_lost() {
            return Err(format!("{}: {what}: the device counts as lost", session.name));
        }
        let frame = harness.at(&format!("the frame after {what}"), session.frame(&gpu))?;
        harness.same(&format!("the frame after {what}"), &frame, &expected)?;
        harness.clean(&format!("the frame after {what}"), Some(&gpu))?;
    }
    harness.injection.rewind();
    drop(gpu);
    harness.clean("the end of the device", None)?;
    Ok(swept)
}

/// Lets each call of a frame fail in turn on a plan that draws again afterwards, first another view, then the same.
/// Checks that its allocations have not grown and that the images are identical to the bit.
///
/// # Errors
///
/// The first finding.
pub(crate) fn fail_frames(place: &Place, session: &Session, most: usize) -> Outcome<Swept> {
    let harness = Harness::new(place, session);
    let gpu = harness.at("open", harness.open())?;
    let scene = GpuScene::new(&gpu, session.scene.clone());
    let views = [[2.0, 1.5, 3.8], [-3.0, 1.0, 2.0]].map(|eye| session.view(eye, 20, 14));
    let [first, second] = views;
    let (first, second) = (harness.at("view", first)?, harness.at("view", second)?);
    let mut frames = harness.at("prepare", Renderer::new(&scene, session.technique).frames(&first))?;
    let mut picture = |view: &View| -> Result<Pictures> {
        frames.draw(view)?;
        Ok(vec![(
            if std::ptr::eq(view, &raw const first) { "first view" } else { "second view" },
            bytes(&frames.read_back()?),
        )])
    };
    let mut expected = Pictures::new();
    // Draw until the capacities fit both views.
    for view in [&second, &first, &second, &first] {
        expected = [expected, harness.at("first frames", picture(view))?].concat();
    }
    let held = gpu.memory_report().len();
    harness.injection.rewind();
    harness.injection.keep_names(true);
    harness.at("a frame", picture(&first))?;
    let names = harness.injection.names();
    harness.injection.keep_names(false);
    let mut swept = Swept { calls: harness.injection.calls(), ..Swept::default() };
    for (call, result) in spread(&names, most, |_, _| true).into_iter().zip(RESULTS.iter().cycle()) {
        let what = format!("call {call} of a frame, {}", name_of(&names, call));
        harness.injection.rewind();
        harness.injection.fail_at(call, *result);
        let run = picture(&first);
        swept.count_failure(&harness, &what, run, &expected)?;
        for view in [&second, &first] {
            let again = harness.at(&format!("the frame after {what}"), picture(view))?;
            harness.same(&format!("the frame after {what}"), &again, &expected)?;
        }
        let holds = gpu.memory_report();
        if holds.len() != held {
            return Err(format!("{}: {what}: {} objects were allocated, now {holds:?}", session.name, held));
        }
        if let Some(message) = harness.log.take().first() {
            return Err(format!("{}: {what}: {message}", session.name));
        }
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

/// Lets each call fail in turn that opens or destroys a device or is made once for it, at most `most` calls of each
/// function, each time on a new device.
///
/// # Errors
///
/// The first finding.
pub(crate) fn fail_opening(place: &Place, session: &Session, most: usize) -> Outcome<Swept> {
    let harness = Harness::new(place, session);
    harness.injection.keep_names(true);
    let gpu = harness.at("open", harness.open())?;
    let opened = harness.injection.calls();
    let expected = harness.at("first run", session.run(&gpu))?;
    let ran = harness.injection.calls();
    drop(gpu);
    harness.clean("first run", None)?;
    let names = harness.injection.names();
    harness.injection.keep_names(false);
    let mut swept = Swept { calls: harness.injection.calls(), ..Swept::default() };
    let calls = spread(&names, most, |call, name| call <= opened || call > ran || ONCE.contains(&name));
    for (call, result) in calls.into_iter().zip(RESULTS.iter().cycle()) {
        let name = name_of(&names, call);
        let what = format!("call {call} of a fresh device, {name}");
        harness.injection.rewind();
        harness.injection.fail_at(call, *result);
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
            let again = harness.at(&format!("the session after {what}"), session.run(&gpu))?;
            harness.same(&format!("the session after {what}"), &again, &expected)?;
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
///
/// # Errors
///
/// The first finding.
pub(crate) fn lose(place: &Place, session: &Session, most: usize) -> Outcome<Swept> {
    let harness = Harness::new(place, session);
    harness.injection.keep_names(true);
    let gpu = harness.at("open", harness.open())?;
    let opened = harness.injection.calls();
    let expected = harness.at("first run", session.run(&gpu))?;
    let mut swept = Swept { calls: harness.injection.calls(), ..Swept::default() };
    let names = harness.injection.names();
    drop(gpu);
    harness.clean("first run", None)?;
    harness.injection.keep_names(false);
    let tells =
        |call: u64, name: &str| (opened + 1..=swept.calls).contains(&call) && Injection::tells_of_loss(name);
    for call in spread(&names, most, tells) {
        let what = format!("lost at call {call}, {}", name_of(&names, call));
        harness.injection.rewind();
        let gpu = harness.at(&what, harness.open())?;
        harness.injection.lose_at(call);
        match session.run(&gpu) {
            Err(Error::DeviceLost { call })
                if Some(call) == harness.injection.last_failed() || Injection::tells_of_loss(call) =>
            {
                *swept.failed.entry(call).or_default() += 1;
            }
            Err(error) => return Err(format!("{}: {what}: reported as: {error}", session.name)),
            Ok(_) => return Err(format!("{}: {what}: no error was returned", session.name)),
        }
        if !gpu.is_lost() {
            return Err(format!("{}: {what}: the device does not count as lost", session.name));
        }
        harness.clean(&what, Some(&gpu))?;
        let calls = harness.injection.calls();
        if !matches!(session.run(&gpu), Err(Error::DeviceLost { .. })) {
            return Err(format!("{}: {what}: the next session is not refused", session.name));
        }
        if harness.injection.calls() != calls {
            return Err(format!("{}: {what}: the next session calls Vulkan", session.name));
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
