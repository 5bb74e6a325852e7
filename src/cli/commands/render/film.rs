//! The frames of a film: views of one scene, or the time steps of a series.
//!
//! Three stages run at once: the next time step is read and uploaded, this frame is drawn, the last ones are encoded.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::{self, ScopedJoinHandle};
use std::time::Instant;

use volraster::io::scene_file::LoadedScene;
use volraster::io::{Data, ReadOptions, Report};
use volraster::scene::View;
use volraster::technique::{FrameTime, Frames};
use volraster::{GpuScene, Image, Renderer, Result, Technique};

use super::present::Presenter;
use super::sink::{Pictures, Sink};
use super::stats::{Drawn, Setup};
use crate::cli::annotate::Annotations;
use crate::cli::input::ArraysArgs;
use crate::cli::interrupt;
use crate::cli::numbers::number;
use crate::cli::outcome::Failure;
use crate::cli::output;

/// The part of the range of the first time step by which others may exceed it without a warning.
const MOST_BEYOND: f64 = 0.02;

/// The time steps of a series.
pub(super) struct Steps<'a> {
    /// One file for each step, or one that names all.
    files: &'a [PathBuf],
    options: ReadOptions,
    /// The number of steps; `None` for a scene at one time.
    count: Option<u32>,
}

impl<'a> Steps<'a> {
    /// Takes the files of the command line and the report on the first.
    pub(super) fn new(files: &'a [PathBuf], arrays: &ArraysArgs, first: &Report) -> Self {
        let options = arrays.options();
        let count = if files.len() > 1 { files.len() } else { first.steps.len() };
        let count = u32::try_from(count).unwrap_or(u32::MAX);
        Self { files, count: (count > 0 && options.step.is_none()).then_some(count), options }
    }

    pub(super) fn count(&self) -> Option<u32> {
        self.count
    }

    /// Reads a step.
    fn read(&self, step: u32) -> Result<Data> {
        let several = self.files.len() > 1;
        let place = if several { usize::try_from(step).unwrap_or(usize::MAX) } else { 0 };
        let options = ReadOptions { step: (!several).then_some(step), ..self.options.clone() };
        Ok(LoadedScene::read_data(&self.files[place], &options)?.data)
    }
}

/// The range of the scalars of a time step.
type StepRange = (u32, [f64; 2]);

/// Warns if scalars lie far outside of those of step 0, for which a transfer function was chosen.
fn warn_of_others([low, high]: [f64; 2], ranges: &[StepRange]) {
    let beyond = |[own_low, own_high]: [f64; 2]| (low - own_low).max(own_high - high) / (high - low);
    let furthest = ranges.iter().max_by(|a, b| beyond(a.1).total_cmp(&beyond(b.1)));
    let Some((step, [own_low, own_high])) = furthest.filter(|(_, range)| beyond(*range) > MOST_BEYOND) else {
        return;
    };
    let [low, high, own_low, own_high] = [low, high, *own_low, *own_high].map(number);
    output::complain(&format!(
        "warning: time step {step} ranges from {own_low} to {own_high}, beyond the {low} to {high} of step 0, which the \
         transfer function is for: --range LO..HI sets another"
    ));
}

/// A film: its frames, how they are drawn, and where they go.
pub(super) struct Film<'a> {
    pub(super) technique: Technique,
    /// The view of each frame; at least one.
    pub(super) views: &'a [View],
    pub(super) steps: Steps<'a>,
    pub(super) sink: &'a Sink,
    pub(super) background: [f64; 4],
    pub(super) annotations: Option<&'a Annotations<'a>>,
}

/// Frames of the next time step.
type Prepared = Result<Frames>;

impl Film<'_> {
    /// Draws and writes all frames; the first shows `scene`. `range` is that of an automatic transfer function.
    pub(super) fn draw(
        &self,
        scene: &Arc<GpuScene>,
        range: Option<[f64; 2]>,
        load_and_open_ms: [f64; 2],
        presenter: &mut Presenter,
    ) -> std::result::Result<Drawn, Failure> {
        interrupt::watch();
        let view = &self.views[0];
        let start = Instant::now();
        let mut frames = Renderer::new(scene, self.technique).frames(view)?;
        let setup = Setup::of(scene, self.technique, start, frames.plan());
        let first = frames.draw(view)?;
        presenter.present(&frames)?;
        let image = frames.read_back()?;
        let (drawn, pictures) = sync_channel(1);
        // Writers own the end that receives, so that sending fails when all have ended.
        let pictures = Arc::new(Mutex::new(pictures));
        let is_series = self.steps.count().is_some();
        let (times, ranges) = thread::scope(|scope| {
            let writer = |pictures: Arc<Pictures>| {
                scope.spawn(move || self.sink.write(&pictures, self.views.len(), self.background))
            };
            let writers: Vec<_> = (0..self.sink.writers()).map(|_| writer(Arc::clone(&pictures))).collect();
            drop(pictures);
            let (prepared, next) = sync_channel(0);
            let reader = is_series.then(|| scope.spawn(|| self.read_steps(scene, prepared)));
            let next = is_series.then_some(next);
            let times = self.draw_frames(frames, next, (&first, &image), drawn, presenter);
            let ranges = reader.map(joined).unwrap_or_default();
            // An error of writing ends drawing.
            writers.into_iter().map(joined).collect::<Result<Vec<()>>>()?;
            times.map(|times| (times, ranges))
        })?;
        if times.len() < self.views.len() {
            let text = format!("stopped after {} of {} frames", times.len(), self.views.len());
            return Err(Failure::Interrupted(text));
        }
        if let Some(range) = range {
            warn_of_others(range, &ranges);
        }
        Ok(setup.report(scene, image, (view, first), &times, load_and_open_ms, false)?)
    }

    /// Reads the time steps after the first, and uploads each as soon as the one before is taken.
    fn read_steps(&self, first: &GpuScene, prepared: SyncSender<Prepared>) -> Vec<StepRange> {
        let mut ranges = Vec::new();
        for (step, view) in (0..).zip(self.views).skip(1) {
            let made = self.steps.read(step).and_then(|data| {
                ranges.push((step, data.range()));
                Renderer::new(&first.with_data(data)?, self.technique).frames(view)
            });
            let failed = made.is_err();
            // Nobody receives after an error of another stage.
            if prepared.send(made).is_err() || failed {
                break;
            }
        }
        ranges
    }

    /// Draws frame after frame. The first is drawn already; `next` has the time steps after it.
    fn draw_frames(
        &self,
        mut frames: Frames,
        next: Option<Receiver<Prepared>>,
        (first, image): (&FrameTime, &Image),
        drawn: SyncSender<(usize, Image)>,
        presenter: &mut Presenter,
    ) -> Result<Vec<FrameTime>> {
        let bar = output::progress(self.views.len() as u64, "frames");
        let mut times = vec![first.clone()];
        let annotated = |image: Image, view: &View| match self.annotations {
            Some(annotations) => annotations.draw(&image, view),
            None => Ok(image),
        };
        let mut sent = drawn.send((0, annotated(image.clone(), &self.views[0])?));
        for (i, view) in self.views.iter().enumerate().skip(1) {
            // Nobody receives after an error of writing.
            if sent.is_err() || interrupt::requested() {
                break;
            }
            bar.inc(1);
            match next.as_ref().map(Receiver::recv) {
                None => {}
                Some(Ok(prepared)) => frames = prepared?,
                // Reading has panicked.
                Some(Err(_)) => break,
            }
            times.push(frames.draw(view)?);
            presenter.present(&frames)?;
            sent = drawn.send((i, annotated(frames.read_back()?, view)?));
        }
        bar.finish_and_clear();
        Ok(times)
    }
}

/// Waits for a thread.
fn joined<T>(thread: ScopedJoinHandle<T>) -> T {
    thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}
