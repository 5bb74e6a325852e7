//! What a program does with a device, from data to pictures, and the same with a call that fails on the way.
//!
//! `tests/failures.rs` has it too: it needs nothing but the library.

use std::collections::BTreeMap;
use std::sync::Arc;

use volraster::Offscreen;
use volraster::ash::vk;
use volraster::glam::DVec3;
use volraster::gpu::{Gpu, GpuOptions, Injection, Validation, ValidationLog};
use volraster::scene::{
    Camera, Clip, Field, Points, Projection, Scene, Surface, TetScalars, TransferFunction, View,
};
use volraster::technique::Method;
use volraster::{Error, GpuScene, Renderer, Result, TargetDesc, TargetMode, Technique};

/// A technique with a scene that it draws.
#[derive(Clone, Debug)]
pub(crate) struct Session {
    /// A name for messages.
    pub(crate) name: &'static str,
    technique: Technique,
    scene: Scene,
}

const ROWS: [[f64; 5]; 4] = [
    [0.0, 0.1, 0.2, 0.7, 0.0],
    [0.3, 0.2, 0.6, 0.9, 1.0],
    [0.6, 0.9, 0.85, 0.3, 3.0],
    [1.0, 1.0, 0.25, 0.1, 8.0],
];

/// Techniques by kind of data and route.
const SPECS: [(&str, &str); 9] = [
    ("grid-raster", "slices-3d:route=raster,target=rgba8,dither=blue"),
    ("grid-compute", "raycast:integrator=integral"),
    ("grid-warp", "shear-warp:route=raster"),
    ("mesh-lists", "havs:k=2,chunk=9"),
    ("mesh-raster", "projected-tets:route=raster"),
    ("points-ellipses", "splat-ewa:"),
    ("points-sheets", "splat-sheets:"),
    ("grid-cut", "slabs:"),
    ("mesh-cut", "havs:"),
];

/// Names and results, in bytes: pictures, an overflow map, the image of a caller.
pub(crate) type Pictures = Vec<(&'static str, Vec<u8>)>;

/// The sessions, each with data of a few samples, cells or points.
///
/// # Errors
///
/// None, unless a constant above is wrong.
pub(crate) fn sessions() -> Result<Vec<Session>> {
    let transfer = TransferFunction::from_rows(&ROWS)?;
    // 8-bit samples ask the device how it filters.
    let bytes = ROWS.map(|[scalar, r, g, b, tau]| [255.0 * scalar, r, g, b, tau]);
    let grid = Scene::new(Field::Blobs.sample([6, 5, 4], "u8")?, TransferFunction::from_rows(&bytes)?);
    let mesh = Field::Blobs.tets(2)?;
    let points = Points::of_vertices(&mesh)?.with_estimated_radius();
    let scenes = [grid, Scene::new(mesh, transfer.clone()), Scene::new(points, transfer)];
    let mut sessions = Vec::new();
    for (name, spec) in SPECS {
        let technique = Technique::parse(spec)?;
        if let Some(scene) =
            scenes.iter().find(|scene| technique.method().draws(&scene.data) && fits(name, scene))
        {
            let mut scene = scene.clone();
            if name.ends_with("cut") {
                scene = scene.with_surfaces(surfaces()?);
            }
            sessions.push(Session { name, technique, scene });
        }
    }
    Ok(sessions)
}

fn fits(name: &str, scene: &Scene) -> bool {
    name.starts_with(scene.data.kind())
}

/// An opaque box, and a translucent ball around it.
fn surfaces() -> Result<Vec<Surface>> {
    let low = DVec3::splat(-0.3);
    Ok(vec![
        Surface::cuboid(low, -low, [0.9, 0.4, 0.1, 1.0])?,
        Surface::sphere(DVec3::ZERO, 0.8, [0.2, 0.5, 0.9, 0.4], 1)?,
    ])
}

/// A device with an injection, validated into `log`, whose pipelines are kept nowhere.
///
/// # Errors
///
/// As [`Gpu::new`].
pub(crate) fn open(
    device: Option<&str>,
    validation: Validation,
    log: &Arc<ValidationLog>,
    injection: &Injection,
) -> Result<Gpu> {
    Gpu::new(&GpuOptions {
        device: device.map(str::to_string),
        validation,
        validation_log: Some(Arc::clone(log)),
        inject: Some(injection.clone()),
        no_pipeline_cache: true,
        ..GpuOptions::default()
    })
}

fn bytes(image: &volraster::Image) -> Vec<u8> {
    image.pixels().iter().flatten().flat_map(|value| value.to_bits().to_ne_bytes()).collect()
}

impl Session {
    fn view(&self, eye: [f64; 3], width: u32, height: u32) -> Result<View> {
        let projection = Projection::Perspective { fov_y_deg: 42.0 };
        let camera = Camera { eye: DVec3::from(eye), target: DVec3::ZERO, up: DVec3::Y, projection };
        let view = View::new(camera, width, height)?;
        if self.scene.surfaces.is_empty() {
            return Ok(view);
        }
        Ok(view.with_clip(Clip::none().with_plane(DVec3::new(0.6, 0.0, 0.0), DVec3::new(-1.0, 0.3, 0.0))?))
    }

    /// The technique.
    pub(crate) fn method(&self) -> Method {
        self.technique.method()
    }

    /// Uploads, draws, reads back; another view, another size, another transfer function, other scalars and surfaces; into images as a
    /// caller has them, two frames in flight. Everything is dropped at the end.
    ///
    /// # Errors
    ///
    /// What fails.
    pub(crate) fn run(&self, gpu: &Gpu) -> Result<Pictures> {
        let mut pictures = Pictures::new();
        let (first, second) = (self.view([2.0, 1.5, 3.8], 20, 14)?, self.view([-3.0, 1.0, 2.0], 20, 14)?);
        let scene = GpuScene::new(gpu, self.scene.clone());
        let renderer = Renderer::new(&scene, self.technique);
        let mut frames = renderer.frames(&first)?;
        for (name, view) in [("first view", &first), ("second view", &second)] {
            frames.draw(view)?;
            pictures.push((name, bytes(&frames.read_back()?)));
        }
        if let Some(map) = frames.overflow_map()? {
            pictures.push(("overflow map", map.into_iter().map(u8::from).collect()));
        }
        drop(frames);
        pictures.push(("another size", bytes(&renderer.render(&self.view([2.0, 1.5, 3.8], 9, 31)?)?)));
        // From white to black, over the same scalars.
        let [low, high] = self.scene.transfer.domain();
        let other = [[low, 1.0, 1.0, 1.0, 0.5], [high, 0.0, 0.0, 0.0, 4.0]];
        let other = TransferFunction::from_rows(&other)?;
        let recoloured = scene.with_transfer(other.clone());
        pictures.push((
            "another transfer function",
            bytes(&Renderer::new(&recoloured, self.technique).render(&first)?),
        ));
        if let Some(mesh) = self.scene.mesh() {
            let scalars = mesh.scalars().values().iter().map(|scalar| 1.0 - scalar).collect();
            let turned = scene.with_scalars(TetScalars::Point(scalars), other)?;
            pictures.push(("other scalars", bytes(&Renderer::new(&turned, self.technique).render(&first)?)));
        }
        if !self.scene.surfaces.is_empty() {
            let moved = scene.with_surfaces(self.scene.surfaces[..1].to_vec());
            pictures.push(("other surfaces", bytes(&Renderer::new(&moved, self.technique).render(&first)?)));
        }
        let format = vk::Format::R8G8B8A8_UNORM;
        let mut flying = Vec::new();
        for view in [&first, &second] {
            let mut plan = renderer.prepare(view, &TargetDesc::caller(format, TargetMode::Over))?;
            let mut image = Offscreen::new(gpu, format, view.extent())?;
            image.draw(&mut plan, [0.0, 0.5, 0.25, 1.0])?;
            flying.push((plan, image));
        }
        for (_, image) in &mut flying {
            let (_, texels) = image.finish()?;
            pictures.push(("a caller's image", texels));
        }
        Ok(pictures)
    }

    /// One frame of the first view.
    fn frame(&self, gpu: &Gpu) -> Result<Pictures> {
        let scene = GpuScene::new(gpu, self.scene.clone());
        let image = Renderer::new(&scene, self.technique).render(&self.view([2.0, 1.5, 3.8], 20, 14)?)?;
        Ok(vec![("first view", bytes(&image))])
    }
}

/// Calls whose failure need not be told, and what is done instead.
pub(crate) const HARMLESS: [(&str, &str); 7] = [
    ("vkSetDebugUtilsObjectNameEXT", "the object has no name"),
    (
        "vkAllocateMemory",
        "staging memory is asked for a second time, of a kind that the device need not be fast at",
    ),
    ("vkMapMemory", "the same"),
    ("vkGetPipelineCacheData", "pipelines are built anew the next time"),
    ("vkDeviceWaitIdle", "before the device's end, when every submission has been waited for already"),
    ("vkWaitForFences", "where an object is dropped with a submission that may run: waited for again"),
    ("vkEndCommandBuffer", "between the parts of a frame: it goes on in the same command buffer"),
];

/// Where sessions with failures are run.
#[derive(Clone, Debug)]
pub(crate) struct Place {
    pub(crate) device: Option<String>,
    pub(crate) validation: Validation,
}

/// What a sweep has gone through.
#[derive(Debug, Default)]
pub(crate) struct Swept {
    /// Calls of the session.
    pub(crate) calls: u64,
    /// Calls that were made to fail, by name.
    pub(crate) failed: BTreeMap<&'static str, u32>,
    /// Those of them after which the session went on.
    pub(crate) harmless: u32,
}

/// What is wrong, in one line.
pub(crate) type Finding = String;

/// What came of a session with failures in the way.
type Outcome<T> = std::result::Result<T, Finding>;

/// The errors that take turns; what a call may not return becomes what it may.
const RESULTS: [vk::Result; 4] = [
    vk::Result::ERROR_OUT_OF_DEVICE_MEMORY,
    vk::Result::ERROR_OUT_OF_HOST_MEMORY,
    vk::Result::ERROR_OUT_OF_POOL_MEMORY,
    vk::Result::ERROR_INITIALIZATION_FAILED,
];

/// A device on which calls fail, with what is heard of it.
struct Bench<'a> {
    place: &'a Place,
    session: &'a Session,
    injection: Injection,
    log: Arc<ValidationLog>,
}

impl<'a> Bench<'a> {
    fn new(place: &'a Place, session: &'a Session) -> Self {
        Self { place, session, injection: Injection::new(), log: Arc::default() }
    }

    fn open(&self) -> Result<Gpu> {
        open(self.place.device.as_deref(), self.place.validation, &self.log, &self.injection)
    }

    fn at<T>(&self, what: &str, result: Result<T>) -> Outcome<T> {
        result.map_err(|error| format!("{}: {what}: {error}", self.session.name))
    }

    /// A finding, unless nothing is held and nothing was said.
    fn clean(&self, what: &str, gpu: Option<&Gpu>) -> Outcome<()> {
        let held = gpu.map(Gpu::memory_report).unwrap_or_default();
        if !held.is_empty() {
            return Err(format!("{}: {what}: memory is held: {held:?}", self.session.name));
        }
        match self.log.take().first() {
            Some(message) => Err(format!("{}: {what}: {message}", self.session.name)),
            None => Ok(()),
        }
    }

    fn same(&self, what: &str, pictures: &Pictures, expected: &Pictures) -> Outcome<()> {
        for (name, picture) in pictures {
            // Frames in flight have the same name: each must be one of them.
            if !expected.iter().any(|(other, bytes)| other == name && bytes == picture) {
                return Err(format!("{}: {what}: {name} is another picture", self.session.name));
            }
        }
        Ok(())
    }

    /// Whether an error is what is to be told of a call that failed on request.
    fn told(&self, what: &str, error: &Error) -> Outcome<()> {
        let failed = self.injection.last_failed().unwrap_or("none");
        let fits = match error {
            Error::Vulkan { call, result } => {
                *call == failed && Some(*result) == self.injection.last_result()
            }
            Error::Allocation { .. } => ["vkAllocateMemory", "vkMapMemory"].contains(&failed),
            Error::Unsupported { .. } => failed == "vkGetPhysicalDeviceImageFormatProperties",
            _ => false,
        };
        if fits { Ok(()) } else { Err(format!("{}: {what}: told as: {error}", self.session.name)) }
    }
}

fn name_of(names: &[&'static str], call: u64) -> &'static str {
    usize::try_from(call)
        .ok()
        .and_then(|i| names.get(i.checked_sub(1)?))
        .copied()
        .unwrap_or("beyond the last call")
}

/// At most `most` calls of each name, as far from each other as can be, the last one among them. Two namings of objects stand
/// for all.
fn spread(names: &[&'static str], most: usize, wanted: impl Fn(u64, &str) -> bool) -> Vec<u64> {
    let mut of: BTreeMap<&str, Vec<u64>> = BTreeMap::new();
    for (call, name) in (1..).zip(names).filter(|(call, name)| wanted(*call, name)) {
        of.entry(name).or_default().push(call);
    }
    let few = |(name, calls): (&str, Vec<u64>)| {
        let most = if name == "vkSetDebugUtilsObjectNameEXT" { most.min(2) } else { most };
        let step = calls.len().div_ceil(most.max(1)).max(1);
        calls.into_iter().rev().step_by(step).collect::<Vec<_>>()
    };
    let mut calls: Vec<u64> = of.into_iter().flat_map(few).collect();
    calls.sort_unstable();
    calls
}

/// Lets each call of a session fail in turn, but at most `most` of a name, on a device that has all pipelines: each failure is told or harmless, nothing
/// stays behind, and the next frame is right to the bit.
///
/// # Errors
///
/// The first thing that is wrong.
pub(crate) fn fail_each(place: &Place, session: &Session, most: usize) -> Outcome<Swept> {
    let bench = Bench::new(place, session);
    let gpu = bench.at("open", bench.open())?;
    let expected = bench.at("first run", session.run(&gpu))?;
    bench.injection.rewind();
    bench.injection.keep_names(true);
    let again = bench.at("second run", session.run(&gpu))?;
    bench.same("second run", &again, &expected)?;
    bench.clean("second run", Some(&gpu))?;
    let names = bench.injection.names();
    bench.injection.keep_names(false);
    let mut swept = Swept { calls: bench.injection.calls(), ..Swept::default() };
    for (call, result) in spread(&names, most, |_, _| true).into_iter().zip(RESULTS.iter().cycle()) {
        let name = name_of(&names, call);
        let what = format!("call {call}, {name}");
        bench.injection.rewind();
        bench.injection.fail_at(call, *result);
        let run = session.run(&gpu);
        if bench.injection.failures() == 0 {
            continue;
        }
        if bench.injection.last_failed() != Some(name) {
            return Err(format!("{}: {what}: another call came", session.name));
        }
        swept.tell(&bench, &what, run, &expected)?;
        bench.clean(&what, Some(&gpu))?;
        if gpu.is_lost() {
            return Err(format!("{}: {what}: the device is given up", session.name));
        }
        let frame = bench.at(&format!("the frame after {what}"), session.frame(&gpu))?;
        bench.same(&format!("the frame after {what}"), &frame, &expected)?;
        bench.clean(&format!("the frame after {what}"), Some(&gpu))?;
    }
    bench.injection.rewind();
    drop(gpu);
    bench.clean("the end of the device", None)?;
    Ok(swept)
}

impl Swept {
    fn tell(
        &mut self,
        bench: &Bench<'_>,
        what: &str,
        run: Result<Pictures>,
        expected: &Pictures,
    ) -> Outcome<()> {
        let name = bench.injection.last_failed().unwrap_or("none");
        *self.failed.entry(name).or_default() += 1;
        match run {
            Ok(pictures) => {
                if !HARMLESS.iter().any(|(harmless, _)| *harmless == name) {
                    return Err(format!("{}: {what}: failed, and nobody was told", bench.session.name));
                }
                self.harmless += 1;
                bench.same(what, &pictures, expected)
            }
            Err(error) => bench.told(what, &error),
        }
    }
}

/// Lets each call of a frame fail in turn, on a plan that is drawn again afterwards, of another view and then of the same: what it
/// holds has not grown, and the pictures are right to the bit.
///
/// # Errors
///
/// The first thing that is wrong.
pub(crate) fn fail_frames(place: &Place, session: &Session, most: usize) -> Outcome<Swept> {
    let bench = Bench::new(place, session);
    let gpu = bench.at("open", bench.open())?;
    let scene = GpuScene::new(&gpu, session.scene.clone());
    let views = [[2.0, 1.5, 3.8], [-3.0, 1.0, 2.0]].map(|eye| session.view(eye, 20, 14));
    let [first, second] = views;
    let (first, second) = (bench.at("view", first)?, bench.at("view", second)?);
    let mut frames = bench.at("prepare", Renderer::new(&scene, session.technique).frames(&first))?;
    let mut picture = |view: &View| -> Result<Pictures> {
        frames.draw(view)?;
        Ok(vec![(
            if std::ptr::eq(view, &raw const first) { "first view" } else { "second view" },
            bytes(&frames.read_back()?),
        )])
    };
    let mut expected = Pictures::new();
    // Room for both views, once and for all.
    for view in [&second, &first, &second, &first] {
        expected = [expected, bench.at("first frames", picture(view))?].concat();
    }
    let held = gpu.memory_report().len();
    bench.injection.rewind();
    bench.injection.keep_names(true);
    bench.at("a frame", picture(&first))?;
    let names = bench.injection.names();
    bench.injection.keep_names(false);
    let mut swept = Swept { calls: bench.injection.calls(), ..Swept::default() };
    for (call, result) in spread(&names, most, |_, _| true).into_iter().zip(RESULTS.iter().cycle()) {
        let what = format!("call {call} of a frame, {}", name_of(&names, call));
        bench.injection.rewind();
        bench.injection.fail_at(call, *result);
        let run = picture(&first);
        swept.tell(&bench, &what, run, &expected)?;
        for view in [&second, &first] {
            let again = bench.at(&format!("the frame after {what}"), picture(view))?;
            bench.same(&format!("the frame after {what}"), &again, &expected)?;
        }
        let holds = gpu.memory_report();
        if holds.len() != held {
            return Err(format!("{}: {what}: {} objects were held, now {holds:?}", session.name, held));
        }
        if let Some(message) = bench.log.take().first() {
            return Err(format!("{}: {what}: {message}", session.name));
        }
    }
    bench.injection.rewind();
    drop((frames, scene));
    bench.clean("the end of the plan", Some(&gpu))?;
    drop(gpu);
    bench.clean("the end of the device", None)?;
    Ok(swept)
}

/// Calls that a device makes once, which [`fail_each`] does not see.
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

/// Lets each call fail in turn that opens or ends a device or is made once for it, but at most `most` of a name, on a fresh
/// device each time.
///
/// # Errors
///
/// The first thing that is wrong.
pub(crate) fn fail_opening(place: &Place, session: &Session, most: usize) -> Outcome<Swept> {
    let bench = Bench::new(place, session);
    bench.injection.keep_names(true);
    let gpu = bench.at("open", bench.open())?;
    let opened = bench.injection.calls();
    let expected = bench.at("first run", session.run(&gpu))?;
    let ran = bench.injection.calls();
    drop(gpu);
    bench.clean("first run", None)?;
    let names = bench.injection.names();
    bench.injection.keep_names(false);
    let mut swept = Swept { calls: bench.injection.calls(), ..Swept::default() };
    let calls = spread(&names, most, |call, name| call <= opened || call > ran || ONCE.contains(&name));
    for (call, result) in calls.into_iter().zip(RESULTS.iter().cycle()) {
        let name = name_of(&names, call);
        let what = format!("call {call} of a fresh device, {name}");
        bench.injection.rewind();
        bench.injection.fail_at(call, *result);
        let gpu = match bench.open() {
            Ok(gpu) => gpu,
            Err(error) => {
                *swept.failed.entry(name).or_default() += 1;
                bench.told(&what, &error)?;
                bench.clean(&what, None)?;
                continue;
            }
        };
        let run = session.run(&gpu);
        let at_the_end = bench.injection.failures() == 0;
        if at_the_end {
            bench.at(&what, run)?;
        } else {
            swept.tell(&bench, &what, run, &expected)?;
        }
        bench.clean(&what, Some(&gpu))?;
        if !at_the_end {
            let again = bench.at(&format!("the session after {what}"), session.run(&gpu))?;
            bench.same(&format!("the session after {what}"), &again, &expected)?;
        }
        drop(gpu);
        bench.clean(&format!("the end after {what}"), None)?;
        if at_the_end && bench.injection.failures() > 0 {
            swept.tell(&bench, &what, Ok(Pictures::new()), &expected)?;
        }
    }
    Ok(swept)
}

/// Loses the device at calls that can tell of it, at most `most` of a name, on a fresh one each time: the session ends with
/// [`Error::DeviceLost`], so does whatever is asked of the device afterwards, before it makes any call; nothing stays behind,
/// and the device can be opened again.
///
/// # Errors
///
/// The first thing that is wrong.
pub(crate) fn lose(place: &Place, session: &Session, most: usize) -> Outcome<Swept> {
    let bench = Bench::new(place, session);
    bench.injection.keep_names(true);
    let gpu = bench.at("open", bench.open())?;
    let opened = bench.injection.calls();
    let expected = bench.at("first run", session.run(&gpu))?;
    let mut swept = Swept { calls: bench.injection.calls(), ..Swept::default() };
    let names = bench.injection.names();
    drop(gpu);
    bench.clean("first run", None)?;
    bench.injection.keep_names(false);
    let tells =
        |call: u64, name: &str| (opened + 1..=swept.calls).contains(&call) && Injection::tells_of_loss(name);
    for call in spread(&names, most, tells) {
        let what = format!("lost at call {call}, {}", name_of(&names, call));
        bench.injection.rewind();
        let gpu = bench.at(&what, bench.open())?;
        bench.injection.lose_at(call);
        match session.run(&gpu) {
            Err(Error::DeviceLost { call })
                if Some(call) == bench.injection.last_failed() || Injection::tells_of_loss(call) =>
            {
                *swept.failed.entry(call).or_default() += 1;
            }
            Err(error) => return Err(format!("{}: {what}: told as: {error}", session.name)),
            Ok(_) => return Err(format!("{}: {what}: nobody was told", session.name)),
        }
        if !gpu.is_lost() {
            return Err(format!("{}: {what}: not known to be lost", session.name));
        }
        bench.clean(&what, Some(&gpu))?;
        let calls = bench.injection.calls();
        if !matches!(session.run(&gpu), Err(Error::DeviceLost { .. })) {
            return Err(format!("{}: {what}: the next session is not refused", session.name));
        }
        if bench.injection.calls() != calls {
            return Err(format!("{}: {what}: the next session makes calls", session.name));
        }
        drop(gpu);
        bench.clean(&format!("the end after {what}"), None)?;
    }
    // Lost is a device, not the machine.
    bench.injection.rewind();
    let gpu = bench.at("open again", bench.open())?;
    let frame = bench.at("the frame of another device", session.frame(&gpu))?;
    bench.same("the frame of another device", &frame, &expected)?;
    drop(gpu);
    bench.clean("the end of another device", None)?;
    Ok(swept)
}
