//! The plan of a frame: pipelines, buffers and images of one view, which are recorded into command buffers.

use std::any::Any;
use std::collections::BTreeMap;
use std::sync::Arc;

use ash::vk;

use crate::error::{Error, Result};
use crate::frame::counts::Counts;
use crate::frame::dry_run::{dry_run, last_use, passes};
use crate::frame::hit_depths::{HitDepthFrame, hit_depths_buffer};
use crate::frame::prepared::{ErrorBound, Outcome, Prepared};
use crate::frame::ray_bounds::{BOUNDS, OWNED, RayBounds, bounds_buffer};
use crate::frame::surfaces::{SurfaceFrame, SurfaceLists};
use crate::frame::target::{Canvas, Composite, TargetDesc, TargetMode};
use crate::frame::upsampling::{Drawn, Upsampling};
use crate::gpu::sync::Use;
use crate::gpu::{
    Buffer, CommandBuffer, DepthImage, DepthProjection, Gpu, Image, Keep, PassTime, Recorder, Step,
    TargetImage, Timers, Used,
};
use crate::resident::surfaces::SurfaceData;
use crate::scene::View;

/// Holds everything that one frame needs. A plan serves one frame in flight.
///
/// `Send` and `Sync`: a plan may be prepared, recorded and completed on different threads. Several plans of one scene or device may
/// be recorded at the same time, each into a command buffer of its own pool.
///
/// [`Renderer::render`](crate::Renderer::render) prepares, records, submits and waits. An engine prepares and records plans itself:
///
/// ```no_run
/// # use volraster::ash::vk;
/// # use volraster::gpu::{CommandBuffer, Gpu, TargetImage};
/// # use volraster::scene::View;
/// # use volraster::{GpuScene, Renderer, Result, TargetDesc, TargetMode, Technique};
/// # use std::sync::Arc;
/// # fn frame(
/// #     gpu: &Gpu, scene: &Arc<GpuScene>, view: &View, commands: vk::CommandBuffer, image: vk::Image,
/// #     image_view: vk::ImageView, extent: [u32; 2],
/// # ) -> Result<()> {
/// // Once: may allocate, compile, upload, submit and wait.
/// let renderer = Renderer::new(scene, Technique::parse("slices-3d:step=0.5")?);
/// let format = vk::Format::B8G8R8A8_SRGB;
/// let mut plan = renderer.prepare(view, &TargetDesc::caller(format, TargetMode::Over))?;
///
/// // Each frame: only records, into the engine's own command buffer and image.
/// if !plan.set_view(view)? {
///     plan = renderer.prepare(view, &TargetDesc::caller(format, TargetMode::Over))?;
/// }
/// // SAFETY: the command buffer is recording, on this thread, for this device's queue family.
/// let mut commands = unsafe { CommandBuffer::from_raw(gpu, commands) };
/// // SAFETY: the image is in the layout COLOR_ATTACHMENT_OPTIMAL and outlives the submission.
/// let target = unsafe { TargetImage::from_raw(gpu, image, image_view, format, extent) };
/// let recorded = plan.record(&mut commands, Some(&target), None)?;
///
/// // The engine submits, and later sees the submission end.
/// let status = recorded.completed()?;
/// for pass in status.passes {
///     println!("{}: {:.3} ms", pass.name, pass.ms);
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Plan {
    pub(crate) gpu: Gpu,
    pub(crate) prepared: Box<dyn Prepared>,
    composite: Option<Composite>,
    bounds: Option<RayBounds>,
    /// Where rays pass the box whose pieces the view owns.
    owned: Option<RayBounds>,
    /// Whether its views own a box.
    owns: bool,
    /// Whether it can own pieces; else it is clipped to what it owns.
    pieces: bool,
    surfaces: Option<SurfaceFrame>,
    upsampling: Option<Upsampling>,
    counts: Option<Counts>,
    hit_depths: Option<HitDepthFrame>,
    /// Side of the squares of pixels that are drawn as one.
    side: u32,
    /// The size of the image that the technique draws.
    pub(crate) drawn: [u32; 2],
    timers: Option<Arc<Timers>>,
    /// Most passes of the technique in a frame.
    technique_passes: u32,
    /// Most passes of a frame; each has a timer.
    most_passes: u32,
    target: TargetDesc,
    /// Last uses of the image and of the overflow words in the last recording.
    last_uses: [Option<Use>; 2],
    /// Images that a recording may go on with, with their last uses.
    kept: Vec<(Arc<Image>, Use)>,
    pub(crate) extent: [u32; 2],
    view: View,
    /// Whether the view has changed while a recording was in flight, which the next one does not go on with.
    turned: bool,
    /// Shared with the recording in flight.
    in_flight: Arc<()>,
}

/// All that a recording is given.
#[derive(Clone, Debug, Default)]
pub struct RecordInfo<'a> {
    /// The image that [`TargetDesc::caller`] announced.
    pub target: Option<&'a TargetImage>,
    /// The image that [`TargetDesc::with_depth`] announced.
    pub depth: Option<&'a DepthImage>,
    /// The image that [`TargetDesc::with_hit_depths`] announced, in the state of a target, and the projection that it stores depths by, as a
    /// depth image of that projection would; where there is none, its far end.
    pub hit_depths: Option<(&'a TargetImage, DepthProjection)>,
    /// Is kept until the recording is [completed](Recorded::completed) or [discarded](Recorded::discarded): for instance the owner of
    /// the views that the commands name, where nothing else of the engine's keeps them until the submission has ended.
    pub owner: Option<Arc<dyn Any + Send + Sync>>,
}

/// The report of a completed recording. `Send` and `Sync`.
#[derive(Clone, Debug)]
pub struct Status {
    /// Whether everything was drawn. `false` when data of a grid in pages was missing, or parts of a mesh or of
    /// points are still to come: [`Plan::load`] them,
    /// and record again; else when a buffer was too small: prepare anew, which allocates more, and record again.
    pub complete: bool,
    /// Passes with their times on the device, in the order of recording. Empty where the device has no timestamps, and for
    /// [`TargetDesc::without_times`].
    pub passes: Vec<PassTime>,
    /// Counts of work that only the device knows.
    pub counters: Vec<(&'static str, u64)>,
    /// How far the image is from the complete one at most, where it is not and data of a grid in pages is missing.
    pub bound: Option<ErrorBound>,
}

/// Owns the resources of a recording until the caller reports that its submission has ended ([`Recorded::completed`]) or that
/// there is none ([`Recorded::discarded`]). A `Recorded` that is dropped without either leaks them, because the device may still
/// read them. `Send` and `Sync`.
#[derive(Debug)]
#[must_use = "holds what the device reads until the submission has ended"]
pub struct Recorded {
    held: std::mem::ManuallyDrop<Held>,
}

/// The resources of a recording.
#[derive(Debug)]
struct Held {
    gpu: Gpu,
    keep: Keep,
    timers: Option<Arc<Timers>>,
    passes: Vec<String>,
    outcomes: Vec<Arc<dyn Outcome>>,
    _in_flight: Arc<()>,
    // Last: the caller's, which may own the device.
    _owner: Option<Arc<dyn Any + Send + Sync>>,
}

impl Recorded {
    /// Reads the status and frees the resources, after the caller has seen the submission end (by a fence, a timeline semaphore or
    /// an idle queue).
    ///
    /// # Errors
    ///
    /// [`Error::Vulkan`] when the timestamps cannot be read, [`Error::DeviceLost`] when the device is known to be lost. The
    /// resources are freed all the same.
    pub fn completed(self) -> Result<Status> {
        let held = std::mem::ManuallyDrop::into_inner(self.held);
        held.gpu.alive()?;
        let times = held.timers.as_ref().map_or(Ok(vec![]), |timers| timers.read(held.passes.len()))?;
        let passes = held.passes.into_iter().zip(times).map(|(name, ms)| PassTime { name, ms }).collect();
        let mut status = Status { complete: true, passes, counters: Vec::new(), bound: None };
        for outcome in &held.outcomes {
            let (fits, counters) = outcome.read()?;
            status.counters.extend(counters);
            if !fits {
                // Where two things are lacking, neither bounds the error alone.
                status.bound = if status.complete { outcome.bound()? } else { None };
                status.complete = false;
            }
        }
        Ok(status)
    }

    /// The resources that must live until the submission has ended.
    pub(crate) fn keep(&self) -> Keep {
        self.held.keep.clone()
    }

    /// Frees the resources of a recording that the caller will never submit, or never again: its command buffer was reset or freed,
    /// for example because the window changed. The plan can be recorded again.
    pub fn discarded(self) {
        drop(std::mem::ManuallyDrop::into_inner(self.held));
    }

    /// The name of the last pass.
    pub(crate) fn last_pass(&self) -> &str {
        self.held.passes.last().map_or("none", String::as_str)
    }
}

impl Plan {
    /// Builds the plan of a view: bounds of rays, the frame of the technique, which `prepare` makes, surfaces, and the composite.
    pub(crate) fn new(
        gpu: &Gpu,
        surfaces: Option<&Arc<SurfaceData>>,
        view: &View,
        target: &TargetDesc,
        Drawn { side, refine, pieces }: Drawn,
        prepare: impl Fn(&View, &Canvas) -> Result<Box<dyn Prepared>>,
    ) -> Result<Self> {
        if side > 1 && (target.depth || surfaces.is_some()) {
            let why =
                "full is the only one with surfaces or a depth image, whose edges fewer pixels would blur";
            return Err(Error::invalid("technique option resolution", why));
        }
        if target.hit_depths.is_some() && (side > 1 || surfaces.is_some()) {
            let why = "scenes with surfaces and resolutions below full do not tell them";
            return Err(Error::invalid("hit depths", why));
        }
        let owns = view.owned().is_some();
        let view = &if pieces { *view } else { view.clipped_to_owned() };
        let drawn = view.reduced(side)?;
        let lists = surfaces.map(|data| SurfaceLists::new(gpu, data, view)).transpose()?;
        let bounded = target.depth || lists.is_some() || !view.clip().is_none();
        let bounds = bounded.then(|| bounds_buffer(gpu, BOUNDS, &drawn)).transpose()?;
        let owned = view.owned().map(|_| bounds_buffer(gpu, OWNED, &drawn)).transpose()?;
        let counts = target.counted.then(|| Counts::new(gpu)).transpose()?;
        let sums = counts.as_ref().map(|counts| Arc::clone(&counts.sums));
        let hit_depths = hit_depths_buffer(gpu, view, target.hit_depths.is_some())?;
        let canvas = Canvas {
            target: *target,
            bounds,
            owned,
            layers: lists.as_ref().and_then(SurfaceLists::layers),
            sampled: lists.is_some() || side > 1,
            redrawn: None,
            counts: sums,
            hit_depths,
        };
        let prepared = prepare(&drawn, &canvas)?;
        let measure = prepared.measure();
        let hit_depths = match target.hit_depths {
            Some((format, _)) => {
                prepared.hit_depths().map_err(|why| Error::invalid("hit depths", why))?;
                Some(HitDepthFrame::new(gpu, &canvas.hit_depths, format, measure, view)?)
            }
            None => None,
        };
        let surfaces = match (lists, &canvas.bounds, prepared.image()) {
            (Some(lists), Some(bounds), Some(image)) => {
                Some(SurfaceFrame::new(gpu, lists, view, target, bounds, image, &measure)?)
            }
            _ => None,
        };
        let bounds = canvas.bounds.as_ref();
        let bounds = bounds
            .map(|bounds| RayBounds::new(gpu, BOUNDS, bounds, target.depth, measure, &drawn))
            .transpose()?;
        let bounds = bounds.map(|bounds| bounds.sharing(owns));
        let owned = canvas.owned.as_ref();
        let owned = owned
            .map(|owned| RayBounds::new(gpu, OWNED, owned, false, measure, &drawn.of_owned()))
            .transpose()?;
        let owned = owned.map(|owned| owned.sharing(true));
        let smaller = prepared.image().filter(|_| side > 1);
        let upsampling =
            smaller.map(|image| Upsampling::new(gpu, image, view, &canvas, refine, prepare)).transpose()?;
        let image = final_image(surfaces.as_ref(), upsampling.as_ref(), &*prepared);
        let composite = match (image, target.caller) {
            (Some(image), Some((format, mode))) => Some(Composite::new(gpu, image, format, mode)?),
            _ => None,
        };
        let own = dry_run(gpu, |recorder, target| prepared.record_most(recorder, target));
        let most = passes(&own);
        let mut plan = Self {
            gpu: gpu.clone(),
            bounds,
            owned,
            owns,
            pieces,
            surfaces,
            upsampling,
            counts: counts.filter(|_| prepared.counts()),
            hit_depths,
            side,
            drawn: drawn.extent(),
            timers: None,
            technique_passes: most,
            most_passes: most,
            prepared,
            composite,
            target: *target,
            last_uses: [None; 2],
            kept: Vec::new(),
            extent: view.extent(),
            view: *view,
            turned: false,
            in_flight: Arc::new(()),
        };
        let shared = dry_run(gpu, |recorder, target| {
            plan.record_most_before(recorder);
            plan.record_after(recorder, Some(target), Some(dry_hit_depths(target)), true);
        });
        plan.most_passes += passes(&shared);
        gpu.build(own.iter().chain(&shared).filter_map(|step| step.work.pipeline()))?;
        if !target.untimed {
            plan.timers = Timers::new(gpu, plan.most_passes)?;
        }
        Ok(plan)
    }

    /// Records what clears before all other steps.
    fn record_begin(&self, recorder: &mut Recorder<'_>) {
        // A recording that goes on with an image adds to what the last one has found.
        if self.prepared.resumes() {
            return;
        }
        if let Some(counts) = &self.counts {
            counts.record_begin(recorder);
        }
        if let Some(hit_depths) = &self.hit_depths {
            hit_depths.record_begin(recorder);
        }
    }

    /// Records the steps before the technique for a dry run, of the view that has most of them.
    fn record_most_before(&self, recorder: &mut Recorder<'_>) {
        self.record_begin(recorder);
        if let Some(bounds) = &self.bounds {
            bounds.record_most(recorder, self.surfaces.as_ref());
        }
        if let Some(owned) = &self.owned {
            owned.record_most(recorder, None);
        }
    }

    /// Records the steps after the technique: upsampling of its image, opaque surfaces behind it, and the composite into the
    /// caller's image. `most` asks for the passes of the view that has most of them, for a dry run.
    fn record_after(
        &self,
        recorder: &mut Recorder<'_>,
        target: Option<&TargetImage>,
        hit_depths: Option<(&TargetImage, DepthProjection)>,
        most: bool,
    ) {
        if let Some(upsampling) = &self.upsampling {
            upsampling.record(recorder, target.filter(|_| most));
        }
        if let Some(surfaces) = &self.surfaces {
            surfaces.record_behind(recorder);
        }
        if let (Some(composite), Some(target)) = (&self.composite, target) {
            composite.record(recorder, target);
        }
        if let (Some(frame), Some((image, projection))) = (&self.hit_depths, hit_depths) {
            frame.record(recorder, image, &projection);
        }
        if let Some(counts) = &self.counts {
            counts.record_end(recorder);
        }
    }

    /// Records the frame into the caller's command buffer. Does not submit, wait or allocate device memory.
    ///
    /// `target` is the image that [`TargetDesc::caller`] announced, and `None` for [`TargetDesc::own`]. `depth` is the image that
    /// [`TargetDesc::with_depth`] announced. They and the command buffer must live until the submission has ended;
    /// [`Plan::record_with`] keeps their owner.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] when `target` or `depth` differs from what the plan was made for, or when an earlier recording
    /// of this plan has not been completed; [`Error::Unsupported`] for a depth image of a format that the device
    /// cannot sample.
    pub fn record(
        &mut self,
        commands: &mut CommandBuffer,
        target: Option<&TargetImage>,
        depth: Option<&DepthImage>,
    ) -> Result<Recorded> {
        self.record_with(commands, RecordInfo { target, depth, ..RecordInfo::default() })
    }

    /// Records as [`Plan::record`], with all that a recording may be given.
    ///
    /// # Errors
    ///
    /// As [`Plan::record`].
    pub fn record_with(&mut self, commands: &mut CommandBuffer, info: RecordInfo<'_>) -> Result<Recorded> {
        self.check(commands, &info)?;
        let steps = self.steps_of(commands, &info)?;
        let recorder = Recorder::new(&self.gpu, commands, self.timers.clone());
        let (passes, keep) = recorder.finish_together(vec![steps], 0)?;
        Ok(self.recorded(self.timers.clone(), passes, keep, info.owner))
    }

    /// Records the frames of several plans of one device into one command buffer: the eyes of a stereo pair, the faces of a cube, or
    /// different scenes. Their passes lie side by side, each beside those of the other plans with the same number, and none waits for
    /// another of these unless they share a target. A device that one frame does not fill draws them in less than the sum of their times. The
    /// images are those of single recordings, to the bit.
    ///
    /// Each recording is completed on its own. Of the plans with times, [`Status::passes`] of the one with the most passes has them: under the
    /// names of its passes, with those beside them. The others have none.
    ///
    /// # Errors
    ///
    /// As [`Plan::record`], and [`Error::Invalid`] for plans of several devices. After an error nothing was recorded.
    pub fn record_together(
        commands: &mut CommandBuffer,
        plans: &mut [(&mut Plan, RecordInfo<'_>)],
    ) -> Result<Vec<Recorded>> {
        plans.iter().try_for_each(|(plan, info)| plan.check(commands, info))?;
        let lists = plans.iter_mut().map(|(plan, info)| plan.steps_of(commands, info));
        let lists = lists.collect::<Result<Vec<_>>>()?;
        let rank = |&i: &usize| (plans[i].0.timers.is_some(), passes(&lists[i]), usize::MAX - i);
        let Some(longest) = (0..lists.len()).max_by_key(rank) else { return Ok(Vec::new()) };
        let (first, _) = &plans[longest];
        let timers = first.timers.clone();
        let (names, keep) =
            Recorder::new(&first.gpu, commands, timers.clone()).finish_together(lists, longest)?;
        let of_plan = |(i, (plan, info)): (usize, &mut (&mut Plan, RecordInfo<'_>))| {
            let (timers, names) =
                if i == longest { (timers.clone(), names.clone()) } else { Default::default() };
            plan.recorded(timers, names, keep.clone(), info.owner.take())
        };
        Ok(plans.iter_mut().enumerate().map(of_plan).collect())
    }

    /// Checks what a recording is given.
    fn check(&self, commands: &CommandBuffer, info: &RecordInfo<'_>) -> Result<()> {
        let &RecordInfo { target, depth, hit_depths, .. } = info;
        self.gpu.alive()?;
        let device = self.gpu.device().handle();
        let strange = target.is_some_and(|target| target.device != device)
            || hit_depths.is_some_and(|(image, _)| image.device != device)
            || depth.is_some_and(|depth| depth.device != device);
        if commands.device() != device || strange {
            let what = "command buffer, target, depth image or image of hit depths";
            return Err(Error::invalid(what, "belongs to another device than the plan"));
        }
        if Arc::strong_count(&self.in_flight) > 1 {
            return Err(Error::invalid("plan", "its last recording has not been completed"));
        }
        self.check_image("target", self.target.format(), target)?;
        let wanted = self.target.hit_depths.map(|(format, _)| format);
        self.check_image("image of hit depths", wanted, hit_depths.map(|(image, _)| image))?;
        match (depth, &self.bounds) {
            (Some(depth), Some(bounds)) if self.target.depth => bounds.check_depth(&self.gpu, depth)?,
            (Some(_), _) => {
                let why = "the plan expects none: see TargetDesc::with_depth";
                return Err(Error::invalid("depth image", why));
            }
            (None, _) if self.target.depth => {
                return Err(Error::invalid("depth image", "the plan expects one: none is given"));
            }
            (None, _) => {}
        }
        Ok(())
    }

    /// Returns the steps of a recording that has been checked.
    fn steps_of(&mut self, commands: &CommandBuffer, info: &RecordInfo<'_>) -> Result<Vec<Step>> {
        let &RecordInfo { target, depth, hit_depths, .. } = info;
        self.turned = false;
        let mut recorder = Recorder::new(&self.gpu, commands, None);
        if self.prepared.resumes() {
            for (image, last) in &self.kept {
                recorder.assume_after(image, *last);
            }
        }
        self.record_begin(&mut recorder);
        if let Some(owned) = &self.owned {
            owned.record_planes(&mut recorder);
        }
        if let Some(bounds) = &self.bounds {
            bounds.record(&mut recorder, depth, self.surfaces.as_ref())?;
        }
        self.prepared.record(&mut recorder, target, self.target.mode() == TargetMode::Clear);
        self.record_after(&mut recorder, target, hit_depths, false);
        let steps = recorder.into_steps();
        let used = |resource: Used| last_use(&steps, resource.key());
        self.last_uses = [
            self.final_image().and_then(|image| used(Used::Image(Arc::clone(image)))),
            self.prepared.overflow().and_then(|words| used(Used::Buffer(Arc::clone(words)))),
        ];
        // An image that this recording does not use stays as it was.
        let last = |image: Arc<Image>| {
            let known = self.kept.iter().find(|(kept, _)| Arc::ptr_eq(kept, &image)).map(|(_, last)| *last);
            used(Used::Image(Arc::clone(&image))).or(known).map(|last| (image, last))
        };
        self.kept = self.prepared.kept().into_iter().filter_map(last).collect();
        let counted = passes(&steps);
        debug_assert!(counted <= self.most_passes, "{counted} passes, {} timers", self.most_passes);
        debug_assert!(
            steps.iter().filter_map(|step| step.work.pipeline()).all(|pipeline| pipeline.is_built()),
            "a pipeline is not built yet"
        );
        Ok(steps)
    }

    /// Returns what a recording holds until its submission has ended.
    fn recorded(
        &self,
        timers: Option<Arc<Timers>>,
        passes: Vec<String>,
        keep: Keep,
        owner: Option<Arc<dyn Any + Send + Sync>>,
    ) -> Recorded {
        let surfaces = self.surfaces.as_ref().map(SurfaceFrame::outcome);
        let refined = self.upsampling.as_ref().and_then(Upsampling::outcome);
        let counts = self.counts.as_ref().map(Counts::outcome);
        let outcomes = self.prepared.outcome().into_iter().chain(surfaces).chain(refined).chain(counts);
        let held = Held {
            gpu: self.gpu.clone(),
            keep,
            timers,
            passes,
            outcomes: outcomes.collect(),
            _in_flight: Arc::clone(&self.in_flight),
            _owner: owner,
        };
        Recorded { held: std::mem::ManuallyDrop::new(held) }
    }

    /// Checks that an image is the one that the plan was made for.
    fn check_image(&self, what: &str, wanted: Option<vk::Format>, image: Option<&TargetImage>) -> Result<()> {
        match (wanted, image) {
            (None, None) => {}
            (Some(format), Some(image)) if image.format == format && image.extent == self.extent => {}
            (wanted, given) => {
                let named =
                    |format, [width, height]: [u32; 2]| format!("an image of {format:?}, {width}x{height}");
                let wanted = wanted.map_or_else(
                    || if what == "target" { "an image of its own" } else { "none" }.to_string(),
                    |format| named(format, self.extent),
                );
                let given =
                    given.map_or_else(|| "none".to_string(), |image| named(image.format, image.extent));
                return Err(Error::invalid(what, format!("the plan is for {wanted}, given is {given}")));
            }
        }
        let Some(TargetImage { corner, .. }) = image else { return Ok(()) };
        if *corner != [0; 2] && !self.target.part {
            let why = format!("begins at {corner:?}: the plan is for a whole image, see TargetDesc::in_part");
            return Err(Error::invalid(what, why));
        }
        if (0..2).any(|axis| corner[axis].saturating_add(self.extent[axis]) > View::MAX_SIDE) {
            let why = format!("its rectangle from {corner:?} on reaches beyond {} pixels", View::MAX_SIDE);
            return Err(Error::invalid(what, why));
        }
        Ok(())
    }

    /// Changes the plan to another view of the same image size, without allocating. Returns `false`, and changes nothing, when the
    /// plan does not suit the view: prepare anew. Reasons are another image size, a capacity that is too small, an eye that enters
    /// a mesh, and clip planes where the plan was prepared without bounds of rays.
    ///
    /// # Errors
    ///
    /// Those of [`Renderer::prepare`](crate::Renderer::prepare).
    pub fn set_view(&mut self, view: &View) -> Result<bool> {
        self.gpu.alive()?;
        let owns = self.owns == view.owned().is_some();
        let view = &if self.pieces { *view } else { view.clipped_to_owned() };
        if view.extent() != self.extent || (self.bounds.is_none() && !view.clip().is_none()) || !owns {
            return Ok(false);
        }
        let drawn = &view.reduced(self.side)?;
        let owned = &drawn.of_owned();
        for (bounds, view) in [(&self.bounds, drawn), (&self.owned, owned)] {
            bounds.as_ref().map_or(Ok(()), |bounds| bounds.check(view))?;
        }
        let seen = self.surfaces.as_ref().map(|surfaces| surfaces.pushes(drawn)).transpose()?;
        let redrawn = self.upsampling.as_ref().map_or(Ok(true), |upsampling| upsampling.suits(view))?;
        // Everything is checked before anything changes.
        if !redrawn || !self.prepared.set_view(drawn, self.technique_passes)? {
            return Ok(false);
        }
        if let Some(upsampling) = &mut self.upsampling {
            upsampling.set_view(view)?;
        }
        for (bounds, view) in [(&mut self.bounds, drawn), (&mut self.owned, owned)] {
            if let Some(bounds) = bounds {
                bounds.set_view(view);
            }
        }
        if let Some(hit_depths) = &mut self.hit_depths {
            hit_depths.set_view(view);
        }
        if let (Some(surfaces), Some(seen)) = (&mut self.surfaces, seen) {
            surfaces.set_view(seen);
        }
        self.turned |= self.view != *view && Arc::strong_count(&self.in_flight) > 1;
        self.view = *view;
        Ok(true)
    }

    /// Loads what the last recording lacked of a grid that is kept in pages, or the next part of a mesh or of points, since the device
    /// has no room for the whole. Returns whether the next recording goes on with the image, or begins anew where the view has changed since the last one: until every ray has ended, it shows
    /// what rays have met so far, in the order of compositing. Reads the source of the data, submits and waits.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] while a recording is in flight; those of the data's source; [`Error::Memory`] and [`Error::Vulkan`] when the upload
    /// fails.
    pub fn load(&mut self) -> Result<bool> {
        self.gpu.alive()?;
        if Arc::strong_count(&self.in_flight) > 1 {
            return Err(Error::invalid("plan", "its last recording has not been completed"));
        }
        // The last recording lacked data of another view; the next one begins anew.
        if std::mem::take(&mut self.turned) { Ok(true) } else { self.prepared.load() }
    }

    /// Whether its target is a rectangle of a larger image.
    #[cfg(feature = "capi")]
    pub(crate) fn is_in_part(&self) -> bool {
        self.target.part
    }

    /// The format of its images of hit depths.
    #[cfg(feature = "capi")]
    pub(crate) fn hit_depth_format(&self) -> vk::Format {
        self.target.hit_depths.map_or(vk::Format::UNDEFINED, |(format, _)| format)
    }

    fn final_image(&self) -> Option<&Arc<Image>> {
        final_image(self.surfaces.as_ref(), self.upsampling.as_ref(), &*self.prepared)
    }

    /// The image that the last recording leaves, and its last use.
    pub(crate) fn image(&self) -> Option<(&Arc<Image>, Use)> {
        self.final_image().zip(self.last_uses[0])
    }

    /// The words of [`Prepared::overflow`] that the last recording leaves, and their last use.
    pub(crate) fn overflow(&self) -> Option<(&Arc<Buffer>, Use)> {
        self.prepared.overflow().zip(self.last_uses[1])
    }

    /// Returns the passes of a frame of the present view, one line each: the name, the work, and the resources that it reads and
    /// writes. Of equal passes in a row there is one line with their number.
    #[must_use]
    pub fn steps(&self) -> Vec<String> {
        let steps = self.dry_steps();
        let mut lines: Vec<(String, u32)> = Vec::new();
        for line in steps.iter().filter(|step| !step.leaves()).map(ToString::to_string) {
            match lines.last_mut() {
                Some((last, times)) if *last == line => *times += 1,
                _ => lines.push((line, 1)),
            }
        }
        let counted = |(line, times)| if times == 1 { line } else { format!("{line} ({times} times)") };
        lines.into_iter().map(counted).collect()
    }

    /// Returns the bytes that each pass of a frame of the present view reads and writes, those of passes of one name summed.
    ///
    /// They are the sizes of the buffers and images that a pass is given, each once: what must be moved where nothing is read twice and all is
    /// needed; less where a buffer has room that a frame leaves. What a shader may write counts as written only; the caller's image does not
    /// count. Over the time of the pass they are a bandwidth to compare with the device's.
    #[must_use]
    pub fn pass_bytes(&self) -> BTreeMap<String, [u64; 2]> {
        let mut passes: BTreeMap<String, [u64; 2]> = BTreeMap::new();
        for step in self.dry_steps().iter().filter(|step| step.is_pass()) {
            let sum = passes.entry(step.name.clone()).or_default();
            for (sum, bytes) in sum.iter_mut().zip(step.bytes()) {
                *sum += bytes;
            }
        }
        passes
    }

    fn dry_steps(&self) -> Vec<Step> {
        dry_run(&self.gpu, |recorder, target| {
            self.record_most_before(recorder);
            self.prepared.record(recorder, Some(target), self.target.mode() == TargetMode::Clear);
            self.record_after(recorder, Some(target), Some(dry_hit_depths(target)), false);
        })
    }

    /// The route that the technique takes on this device.
    #[must_use]
    pub fn route(&self) -> &'static str {
        self.prepared.route()
    }

    /// Counts of work that are known before the frame is drawn.
    #[must_use]
    pub fn counters(&self) -> Vec<(&'static str, u64)> {
        self.prepared.counters()
    }
}

/// Returns an image of hit depths for dry runs.
fn dry_hit_depths(target: &TargetImage) -> (&TargetImage, DepthProjection) {
    (target, DepthProjection { at_zero: 0.0, at_one: 1.0, perspective: false, image: None })
}

/// Returns the image that the last pass before the composite leaves; `None` where the technique draws into the caller's image.
fn final_image<'a>(
    surfaces: Option<&'a SurfaceFrame>,
    upsampling: Option<&'a Upsampling>,
    prepared: &'a dyn Prepared,
) -> Option<&'a Arc<Image>> {
    let own = || upsampling.map_or(prepared.image(), |upsampling| Some(&upsampling.image));
    surfaces.map_or_else(own, |surfaces| Some(&surfaces.image))
}
