//! A plan: everything that one frame needs, fixed, and recorded into command buffers.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::frame::composite::Composite;
use crate::frame::dry_run::dry_run;
use crate::frame::prepared::{Outcome, Prepared};
use crate::frame::ray_bounds::{RayBounds, bounds_buffer};
use crate::frame::surfaces::{SurfaceFrame, SurfaceLists};
use crate::frame::target::{Canvas, TargetDesc, TargetMode};
use crate::gpu::sync::Use;
use crate::gpu::{CommandBuffer, DepthImage, Gpu, Image, Keep, PassTime, Recorder, TargetImage, Timers};
use crate::resident::surfaces::SurfaceData;
use crate::scene::View;

/// Everything that one frame needs, fixed. Belongs to one frame in flight.
///
/// `Send` and `Sync`: it may be prepared, recorded and completed on different threads, and plans of one scene or device be
/// recorded at the same time, each into a command buffer of its own pool.
#[derive(Debug)]
pub struct Plan {
    pub(crate) gpu: Gpu,
    pub(crate) prepared: Box<dyn Prepared>,
    composite: Option<Composite>,
    bounds: Option<RayBounds>,
    surfaces: Option<SurfaceFrame>,
    timers: Option<Arc<Timers>>,
    /// Most passes of the technique, and of the frame: each has a timer.
    technique_passes: u32,
    most_passes: u32,
    target: TargetDesc,
    pub(crate) extent: [u32; 2],
    /// Shared with the recording that is in flight.
    in_flight: Arc<()>,
}

/// What a completed recording reports. `Send` and `Sync`.
#[derive(Clone, Debug)]
pub struct Status {
    /// Whether everything was drawn. `false` when a capacity was short: prepare anew and repeat.
    pub complete: bool,
    /// Passes with their times on the device; empty where the device has no timestamps.
    pub passes: Vec<PassTime>,
    /// Work of the frame that only the device knows, counted.
    pub counters: Vec<(&'static str, u64)>,
}

/// Owns what a recording names, until the caller says through [`Recorded::completed`] that its submission
/// has ended, or through [`Recorded::discarded`] that there is none. Dropped
/// without that, it frees nothing, for the device may still read it: the memory is lost. `Send` and `Sync`.
#[derive(Debug)]
#[must_use = "holds what the device reads until the submission has ended"]
pub struct Recorded {
    held: std::mem::ManuallyDrop<Held>,
}

/// What a recording holds.
#[derive(Debug)]
struct Held {
    gpu: Gpu,
    keep: Keep,
    timers: Option<Arc<Timers>>,
    passes: Vec<String>,
    outcomes: Vec<Arc<dyn Outcome>>,
    _in_flight: Arc<()>,
}

impl Recorded {
    /// The caller has seen the submission end (a fence, a timeline semaphore, an idle queue). Reads the
    /// status and frees what the recording held.
    ///
    /// # Errors
    ///
    /// [`Error::Vulkan`] when the timestamps cannot be read, [`Error::DeviceLost`] when the device is known to be lost. What
    /// was held is freed all the same.
    pub fn completed(self) -> Result<Status> {
        let held = std::mem::ManuallyDrop::into_inner(self.held);
        held.gpu.alive()?;
        let times = match &held.timers {
            Some(timers) => timers.read(held.passes.len())?,
            None => Vec::new(),
        };
        let passes = held.passes.into_iter().zip(times).map(|(name, ms)| PassTime { name, ms }).collect();
        let (mut complete, mut counters) = (true, Vec::new());
        for outcome in &held.outcomes {
            let (fits, counted) = outcome.read()?;
            complete &= fits;
            counters.extend(counted);
        }
        Ok(Status { complete, passes, counters })
    }

    /// What must live until the submission has ended.
    pub(crate) fn keep(&self) -> Keep {
        self.held.keep.clone()
    }

    /// The caller will never submit what was recorded, or never again: its command buffer was reset, freed or forgotten
    /// (a frame that was dropped because the window changed). Frees what the recording held; the plan can be recorded again.
    pub fn discarded(self) {
        drop(std::mem::ManuallyDrop::into_inner(self.held));
    }

    pub(crate) fn last_pass(&self) -> &str {
        self.held.passes.last().map_or("none", String::as_str)
    }
}

impl Plan {
    /// Builds the plan of a view: what bounds its rays, the frame of the technique that `prepare` makes, the composite.
    pub(crate) fn new(
        gpu: &Gpu,
        surfaces: Option<&Arc<SurfaceData>>,
        view: &View,
        target: &TargetDesc,
        prepare: impl FnOnce(&Canvas) -> Result<Box<dyn Prepared>>,
    ) -> Result<Self> {
        let lists = match surfaces {
            Some(data) => Some(SurfaceLists::new(gpu, data, view)?),
            None => None,
        };
        let bounds = match target.depth || lists.is_some() || !view.clip().is_none() {
            true => Some(bounds_buffer(gpu, view)?),
            false => None,
        };
        let layers = lists.as_ref().and_then(SurfaceLists::layers);
        let canvas = Canvas { target: *target, bounds, layers, behind: lists.is_some() };
        let prepared = prepare(&canvas)?;
        let measure = prepared.measure();
        let surfaces = match (lists, &canvas.bounds, prepared.image()) {
            (Some(lists), Some(bounds), Some(image)) => {
                let mut frame = SurfaceFrame::new(gpu, lists, view, bounds, target.depth, &measure)?;
                frame.put_behind(gpu, image, &canvas)?;
                Some(frame)
            }
            _ => None,
        };
        let bounds = match &canvas.bounds {
            Some(bounds) => Some(RayBounds::new(gpu, bounds, target.depth, measure, view)?),
            None => None,
        };
        let image = surfaces.as_ref().map_or(prepared.image(), SurfaceFrame::image);
        let composite = match (image, target.caller) {
            (Some(image), Some((format, mode))) => Some(Composite::new(gpu, image, format, mode)?),
            _ => None,
        };
        let technique = dry_run(gpu, |recorder, target| prepared.record_most(recorder, target));
        let mut plan = Self {
            gpu: gpu.clone(),
            bounds,
            surfaces,
            timers: None,
            technique_passes: technique.passes,
            most_passes: technique.passes,
            prepared,
            composite,
            target: *target,
            extent: view.extent(),
            in_flight: Arc::new(()),
        };
        let shared = dry_run(gpu, |recorder, target| {
            if let Some(bounds) = &plan.bounds {
                bounds.record_most(recorder, plan.surfaces.as_ref());
            }
            plan.record_after(recorder, Some(target));
        });
        plan.most_passes += shared.passes;
        plan.timers = Timers::new(gpu, plan.most_passes)?;
        Ok(plan)
    }

    /// Records the steps after the technique: opaque surfaces behind its image, and the composite into the caller's image.
    fn record_after(&self, recorder: &mut Recorder<'_>, target: Option<&TargetImage>) {
        if let Some(surfaces) = &self.surfaces {
            surfaces.record_behind(recorder);
        }
        if let (Some(composite), Some(target)) = (&self.composite, target) {
            composite.record(recorder, target);
        }
    }

    /// Records the frame into the caller's command buffer: no submission, no wait, no allocation of
    /// device memory.
    ///
    /// `target` is the image that [`TargetDesc::caller`] announced, and `None` for
    /// [`TargetDesc::own`]; `depth` the one that [`TargetDesc::with_depth`] did.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] when `target` or `depth` is not what the plan was made for, or when an earlier recording
    /// of this plan has not been completed; [`Error::Unsupported`] for a depth image of a format that the device
    /// cannot sample.
    pub fn record(
        &mut self,
        commands: &mut CommandBuffer,
        target: Option<&TargetImage>,
        depth: Option<&DepthImage>,
    ) -> Result<Recorded> {
        self.gpu.alive()?;
        let device = self.gpu.device().handle();
        let strange = target.is_some_and(|target| target.device != device)
            || depth.is_some_and(|depth| depth.device != device);
        if commands.device() != device || strange {
            return Err(Error::invalid(
                "command buffer, target or depth image",
                "belongs to another device than the plan",
            ));
        }
        if Arc::strong_count(&self.in_flight) > 1 {
            return Err(Error::invalid("plan", "its last recording has not been completed"));
        }
        match (self.target.format(), target) {
            (None, None) => {}
            (Some(format), Some(target)) if target.format == format && target.extent == self.extent => {}
            (wanted, given) => {
                return Err(Error::invalid(
                    "target",
                    format!(
                        "the plan is for {wanted:?} of {:?}, given is {:?}",
                        self.extent,
                        given.map(|target| (target.format, target.extent))
                    ),
                ));
            }
        }
        match &self.bounds {
            Some(bounds) => bounds.check_depth(&self.gpu, depth)?,
            None if depth.is_some() => {
                return Err(Error::invalid(
                    "depth image",
                    "the plan is for none: see TargetDesc::with_depth",
                ));
            }
            None => {}
        }
        let mut recorder = Recorder::new(&self.gpu, commands, self.timers.clone());
        if let Some(bounds) = &self.bounds {
            bounds.record(&mut recorder, depth, self.surfaces.as_ref())?;
        }
        self.prepared.record(&mut recorder, target, self.target.mode() == TargetMode::Clear);
        self.record_after(&mut recorder, target);
        let counted = recorder.counted().passes;
        debug_assert!(counted <= self.most_passes, "{counted} passes, {} timers", self.most_passes);
        let (passes, keep) = recorder.finish();
        let held = Held {
            gpu: self.gpu.clone(),
            keep,
            timers: self.timers.clone(),
            passes,
            outcomes: self
                .prepared
                .outcome()
                .into_iter()
                .chain(self.surfaces.as_ref().map(SurfaceFrame::outcome))
                .collect(),
            _in_flight: Arc::clone(&self.in_flight),
        };
        Ok(Recorded { held: std::mem::ManuallyDrop::new(held) })
    }

    /// Turns the plan to another view of the same image size, without allocating. `false` when the plan
    /// has no room for it: prepare anew.
    ///
    /// # Errors
    ///
    /// As [`Renderer::prepare`].
    pub fn set_view(&mut self, view: &View) -> Result<bool> {
        self.gpu.alive()?;
        if view.extent() != self.extent || (self.bounds.is_none() && !view.clip().is_none()) {
            return Ok(false);
        }
        let Some(bounds) = &mut self.bounds else {
            return self.prepared.set_view(view, self.technique_passes);
        };
        bounds.check(view)?;
        let seen = match &self.surfaces {
            Some(surfaces) => Some(surfaces.pushes(view)?),
            None => None,
        };
        // Nothing has been changed where anything is refused.
        let fits = self.prepared.set_view(view, self.technique_passes)?;
        if fits {
            bounds.set_view(view);
            if let (Some(surfaces), Some(seen)) = (&mut self.surfaces, seen) {
                surfaces.set_view(seen);
            }
        }
        Ok(fits)
    }

    /// The image that a frame leaves, and how it has used it last.
    pub(crate) fn image(&self) -> Option<(&Arc<Image>, Use)> {
        match &self.surfaces {
            Some(surfaces) => surfaces.image().map(|image| (image, Use::ComputeReadWrite)),
            None => self.prepared.image().map(|image| (image, self.prepared.last_use())),
        }
    }

    /// The route that the technique takes on this device.
    #[must_use]
    pub fn route(&self) -> &'static str {
        self.prepared.route()
    }

    /// Work of the frame, counted.
    #[must_use]
    pub fn counters(&self) -> Vec<(&'static str, u64)> {
        self.prepared.counters()
    }
}
