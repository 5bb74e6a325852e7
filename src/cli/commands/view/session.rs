//! The state of a window, without the window itself: the scene, camera and technique, pictures that begin coarse and end equal to
//! those of `render`, and work beside them.

use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use volraster::choice::{self, Choice, Estimate, Goal, Profile};
use volraster::glam::DQuat;
use volraster::scene::{Camera, Grid, Mode, Projection, Scene, TransferFunction, View, auto};
use volraster::technique::{Frames, Method};
use volraster::{Error, ErrorBound, GpuScene, Renderer, Result, Technique};

use super::pace::{LEVELS, Pace, REFINEMENT, reduced, side};
use crate::cli::histogram::Histogram;
use crate::cli::input::{ArraysArgs, Settings, edited, with_options};
use crate::cli::output;
use crate::cli::timing::milliseconds_since;

/// Time without a change after which a coarse picture is refined.
const PATIENCE: Duration = Duration::from_millis(150);

/// Smallest angle between the viewing direction and `up`, in degrees.
const LEAST_ANGLE: f64 = 1.0;

/// The state of a window.
#[derive(Debug)]
pub(super) struct Session {
    scene: Arc<GpuScene>,
    /// The scene of pictures before the complete one, of a grid that is drawn in parts; once there was one.
    overview: Option<Arc<GpuScene>>,
    view: View,
    /// The camera at the beginning.
    home: Camera,
    technique: Technique,
    background: [f64; 4],
    /// Whether the transfer function is the automatic one.
    is_automatic: bool,
    pub(super) pace: Pace,
    /// Plans by level, with the setup that they are for.
    plans: [Option<(u64, Frames)>; LEVELS],
    /// Number of changes of scene, technique and size, which plans are for.
    setup: u64,
    /// The level of the picture, unless it shows an earlier state.
    level: Option<usize>,
    /// The level of the last picture, of whatever state.
    shown: Option<usize>,
    /// Whether the technique refused the present state.
    is_refused: bool,
    /// Number of changes of what the picture shows.
    version: u64,
    /// The version of which a part was drawn last.
    part_of: Option<u64>,
    /// The version whose error is known or being estimated.
    estimated: Option<u64>,
    changed: Option<Instant>,
    /// Milliseconds of the last picture.
    pub(super) ms: f64,
    /// The error of the complete picture.
    pub(super) error: Option<Estimate>,
    /// The samples by scalar.
    pub(super) histogram: Option<Histogram>,
    work: Vec<JoinHandle<()>>,
    /// Whether a technique is being searched.
    pub(super) is_searching: bool,
    found: (Sender<Found>, Receiver<Found>),
}

/// A result of work beside the pictures.
#[derive(Debug)]
enum Found {
    Histogram(Histogram),
    /// Of the picture of a version.
    Error(u64, Result<Estimate>),
    Choice(Result<Choice>),
}

impl Session {
    /// Takes a scene on a device; draws nothing yet. `budget` is the time of a frame while the picture moves, in milliseconds.
    pub(super) fn new(scene: Arc<GpuScene>, settings: &Settings, technique: Technique, budget: f64) -> Self {
        let mut session = Self {
            scene,
            overview: None,
            view: settings.view,
            home: *settings.view.camera(),
            technique,
            background: settings.background,
            is_automatic: settings.transfer_is_automatic,
            pace: Pace::new(budget),
            plans: Default::default(),
            setup: 0,
            level: None,
            shown: None,
            is_refused: false,
            version: 0,
            part_of: None,
            estimated: None,
            changed: None,
            ms: 0.0,
            error: None,
            histogram: None,
            work: Vec::new(),
            is_searching: false,
            found: channel(),
        };
        let scene = Arc::clone(&session.scene);
        session.beside(move || Histogram::of_data(&scene.scene().data).map(Found::Histogram));
        session
    }

    pub(super) fn scene(&self) -> &Scene {
        self.scene.scene()
    }

    pub(super) fn view(&self) -> &View {
        &self.view
    }

    pub(super) fn technique(&self) -> &Technique {
        &self.technique
    }

    pub(super) fn background(&self) -> [f64; 4] {
        self.background
    }

    /// Returns the last picture, which may be of an earlier state.
    pub(super) fn picture(&self) -> Option<&Frames> {
        self.plans[self.shown?].as_ref().map(|(_, frames)| frames)
    }

    /// Returns the size in which the last picture was drawn.
    pub(super) fn drawn_size(&self) -> [u32; 2] {
        self.shown.map_or([0, 0], |level| reduced(self.view.extent(), level))
    }

    /// Returns whether the picture is that of `render`, or the technique refused it.
    pub(super) fn is_complete(&self) -> bool {
        self.level == Some(0) || self.is_refused
    }

    /// Returns how far the part that is drawn of the complete picture of a grid in pages is from it at most.
    pub(super) fn part(&self) -> Option<ErrorBound> {
        let (_, frames) = self.plans[0].as_ref().filter(|_| self.part_of == Some(self.version))?;
        frames.bound()
    }

    /// Returns whether work beside the pictures has yet to end.
    pub(super) fn is_busy(&self) -> bool {
        !self.work.is_empty()
    }

    /// Returns when to call [`Session::step`] again to draw, unless something changes.
    pub(super) fn due(&self) -> Option<Instant> {
        let is_done = self.is_complete() && (self.is_refused || self.estimated == Some(self.version));
        (!is_done).then(|| match (self.level, self.changed) {
            (Some(_), Some(changed)) => changed + PATIENCE,
            _ => Instant::now(),
        })
    }

    /// Draws if the picture is of an earlier state, or coarse and nothing changes any more. Returns the milliseconds that this took, 0 if
    /// nothing was drawn. Takes results of work beside the pictures; an error is of such work or of the technique.
    pub(super) fn step(&mut self, now: Instant) -> Result<f64> {
        let taken = self.take_results();
        let is_still = self.changed.is_none_or(|changed| now.duration_since(changed) >= PATIENCE);
        let level = match self.level {
            _ if self.is_complete() => None,
            None => Some(self.pace.level().max(usize::from(self.is_in_parts()))),
            Some(level) => is_still.then(|| level.saturating_sub(REFINEMENT)),
        };
        let is_first = self.level.is_none();
        let mut ms = 0.0;
        if let Some(level) = level {
            let (begin, compiled) = (Instant::now(), self.scene.gpu().pipeline_ms());
            let drawn = self.draw(level);
            self.is_refused = drawn.is_err();
            drawn?;
            ms = milliseconds_since(begin);
            self.ms = ms;
            if is_first {
                // Pipelines are built once.
                self.pace.learn(ms - (self.scene.gpu().pipeline_ms() - compiled));
            }
        }
        if is_still && self.level == Some(0) && self.estimated != Some(self.version) {
            self.estimate()?;
        }
        taken.map(|()| ms)
    }

    /// Returns whether the complete picture is drawn in parts, between which samples are read. Until then an overview is shown.
    fn is_in_parts(&self) -> bool {
        self.scene().grid().is_some_and(Grid::is_on_demand)
    }

    /// Draws the picture at a level, or a part of it.
    fn draw(&mut self, level: usize) -> Result<()> {
        let [width, height] = reduced(self.view.extent(), level);
        let view = View::new(*self.view.camera(), width, height)?.with_clip(*self.view.clip());
        let in_parts = self.is_in_parts();
        if self.plans[level].as_ref().is_none_or(|(setup, _)| *setup != self.setup) {
            let coarse = in_parts && level > 0;
            if coarse && self.overview.is_none() {
                self.overview = Some(self.scene.overview()?);
            }
            let scene = self.overview.as_ref().filter(|_| coarse).unwrap_or(&self.scene);
            let frames = Renderer::new(scene, coarser(&self.technique, side(level))?).frames(&view)?;
            self.plans[level] = Some((self.setup, frames));
        }
        let Some((_, frames)) = &mut self.plans[level] else { return Ok(()) };
        if !in_parts || level > 0 {
            frames.draw(&view)?;
        } else {
            self.part_of = Some(self.version);
            if frames.draw_part(&view)?.is_none() {
                return Ok(());
            }
        }
        (self.level, self.shown) = (Some(level), Some(level));
        // The last picture was shown until now.
        for plan in
            self.plans.iter_mut().filter(|plan| plan.as_ref().is_some_and(|(of, _)| *of != self.setup))
        {
            *plan = None;
        }
        Ok(())
    }

    /// Begins to estimate the error of the complete picture.
    fn estimate(&mut self) -> Result<()> {
        let Some((_, frames)) = &mut self.plans[0] else { return Ok(()) };
        let (image, scene, view, version) =
            (frames.read_back()?, Arc::clone(&self.scene), self.view, self.version);
        self.estimated = Some(version);
        self.beside(move || Some(Found::Error(version, choice::estimate(scene.scene(), &view, &image))));
        Ok(())
    }

    /// Begins to search a technique for a goal; the choice replaces the present one.
    pub(super) fn search(&mut self, goal: Goal) {
        let (scene, view) = (Arc::clone(&self.scene), self.view);
        self.is_searching = true;
        self.beside(move || {
            let profile = Profile::load(scene.gpu());
            Some(Found::Choice(choice::choose(&scene, &view, goal, &profile)))
        });
    }

    /// Runs work on a thread of its own.
    fn beside(&mut self, work: impl FnOnce() -> Option<Found> + Send + 'static) {
        let sender = self.found.0.clone();
        self.work.push(std::thread::spawn(move || {
            // Nobody listens any more while the window closes.
            let _ = work().is_some_and(|found| sender.send(found).is_ok());
        }));
    }

    fn take_results(&mut self) -> Result<()> {
        self.work.retain(|thread| !thread.is_finished());
        let mut outcome = Ok(());
        while let Ok(found) = self.found.1.try_recv() {
            match found {
                Found::Histogram(histogram) => self.histogram = Some(histogram),
                Found::Error(version, error) if version == self.version => match error {
                    Ok(error) => self.error = Some(error),
                    Err(error) => outcome = Err(error),
                },
                Found::Error(..) => {}
                Found::Choice(choice) => {
                    self.is_searching = false;
                    match choice {
                        Ok(choice) => self.set_technique(choice.technique),
                        Err(error) => outcome = Err(error),
                    }
                }
            }
        }
        outcome
    }

    /// Notes that the picture is of an earlier state.
    fn change(&mut self) {
        (self.level, self.error, self.is_refused) = (None, None, false);
        self.version += 1;
        self.changed = Some(Instant::now());
    }

    /// Sets the camera, unless that would be none: too near, or along `up`.
    fn look(&mut self, camera: Camera) {
        if let Ok(view) = self.view.with_camera(camera) {
            self.view = view;
            self.change();
        }
    }

    /// Turns the camera about the target, by degrees to the right and upwards.
    pub(super) fn turn(&mut self, [right, up]: [f64; 2]) {
        let camera = *self.view.camera();
        let arm = camera.eye - camera.target;
        let height = 90.0 - arm.angle_between(camera.up).to_degrees();
        let most = 90.0 - LEAST_ANGLE;
        let up = (height + up).clamp(-most, most) - height;
        let raised = DQuat::from_axis_angle(self.view.right(), -up.to_radians()) * arm;
        if let Ok(camera) = (Camera { eye: camera.target + raised, ..camera }).orbit(right) {
            self.look(camera);
        }
    }

    /// Moves the camera and its target in the image plane, such that things at the target move by so many pixels to the right and downwards.
    pub(super) fn pan(&mut self, [right, down]: [f64; 2]) {
        let camera = *self.view.camera();
        let distance = if self.view.is_perspective() { camera.eye.distance(camera.target) } else { 1.0 };
        let pixel = self.view.pixel_size() * distance;
        let shift = pixel * (self.view.up() * down - self.view.right() * right);
        self.look(Camera { eye: camera.eye + shift, target: camera.target + shift, ..camera });
    }

    /// Shows things at the target so many times as large: from nearer, or in parallel rays with smaller pixels.
    pub(super) fn zoom(&mut self, factor: f64) {
        let camera = *self.view.camera();
        match camera.projection {
            Projection::Perspective { .. } => {
                self.look(Camera { eye: camera.target + (camera.eye - camera.target) / factor, ..camera });
            }
            Projection::Orthographic { .. } => {
                if let Ok(camera) = camera.zoomed(factor) {
                    self.look(camera);
                }
            }
        }
    }

    /// Returns the camera to where it was at the beginning.
    pub(super) fn go_home(&mut self) {
        self.look(self.home);
    }

    /// Sets the size of the picture; sides of 0 are of a hidden window and change nothing.
    pub(super) fn resize(&mut self, [width, height]: [u32; 2]) -> Result<()> {
        if [width, height] == self.view.extent() || width == 0 || height == 0 {
            return Ok(());
        }
        self.view = View::new(*self.view.camera(), width, height)?.with_clip(*self.view.clip());
        self.pace.forget();
        self.renew();
        Ok(())
    }

    /// Notes that all plans are of an earlier state.
    fn renew(&mut self) {
        self.setup += 1;
        self.change();
    }

    pub(super) fn set_technique(&mut self, technique: Technique) {
        if technique != self.technique {
            self.technique = technique;
            self.pace.forget();
            self.renew();
        }
    }

    /// Returns the techniques that draw the scene.
    pub(super) fn methods(&self) -> impl Iterator<Item = Method> + '_ {
        Method::ALL.into_iter().filter(|method| method.draws_scene(self.scene()))
    }

    pub(super) fn set_transfer(&mut self, transfer: TransferFunction) {
        self.is_automatic = false;
        self.show(self.scene.with_transfer(transfer));
    }

    /// Sets the mode. An automatic transfer function follows it, and a technique that does not draw it gives way to the default.
    pub(super) fn set_mode(&mut self, mode: Mode) -> Result<()> {
        let mut scene = self.scene.with_mode(mode)?;
        if self.is_automatic {
            let Scene { data, kernels, .. } = scene.scene();
            scene = scene.with_transfer(auto::transfer_in(data, kernels.as_ref(), mode)?);
        }
        let method = self.technique.method();
        if !method.draws_scene(scene.scene()) {
            let Some(method) = Method::default_for(scene.scene()) else {
                let why = format!("no technique draws mode {} of this scene", mode.name());
                return Err(Error::Invalid { what: "mode".to_string(), why });
            };
            self.set_technique(Technique::new(method, &[])?);
        }
        self.show(scene);
        Ok(())
    }

    /// Replaces the scene by another look at the same data. Times stay about the same.
    fn show(&mut self, scene: Arc<GpuScene>) {
        // The overview has the same look, and its samples stay on the device.
        let look = |overview: Arc<GpuScene>| {
            let Scene { transfer, mode, .. } = scene.scene();
            overview.with_transfer(transfer.clone()).with_mode(*mode).ok()
        };
        self.overview = self.overview.take().and_then(look);
        self.scene = scene;
        self.renew();
    }

    /// Writes the complete picture, which is drawn now if need be, as `render` does.
    pub(super) fn save_picture(&mut self, path: &Path) -> Result<()> {
        output::check_image(path)?;
        while self.level != Some(0) {
            self.draw(0)?;
        }
        let Some((_, frames)) = &mut self.plans[0] else { return Ok(()) };
        volraster::io::write_image(path, &frames.read_back()?, self.background)
    }

    /// Writes the scene file that draws the picture. `input` is the file that was opened, with the arrays taken from it.
    pub(super) fn save_scene(&self, path: &Path, input: &Path, arrays: &ArraysArgs) -> Result<()> {
        output::check_apart("scene", path, &[(&input.to_path_buf(), "the input")])?;
        let scene = edited(input, arrays, self.scene(), &self.view, self.background, &self.technique)?;
        output::write_json(path, &scene)
    }
}

/// Returns a technique for pictures with sides that are smaller by a factor: its samples are as much farther apart, at most a voxel.
fn coarser(technique: &Technique, side: f64) -> Result<Technique> {
    let all: Vec<(String, String)> =
        technique.option_pairs().into_iter().map(|(key, value)| (key.to_string(), value)).collect();
    let step = all.iter().find(|(key, _)| key == "step").and_then(|(_, step)| step.parse::<f64>().ok());
    match step {
        Some(step) if step < 1.0 && side < 1.0 => {
            with_options(technique.method(), &all, &[("step", &(step / side).min(1.0).to_string())])
        }
        _ => Ok(*technique),
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        // Threads use the device.
        for thread in self.work.drain(..) {
            let _ = thread.join();
        }
    }
}
