//! `volraster render`: draws an image and measures frame times, or draws the frames of a film.
//!
//! `picture` draws one image; `film` draws the frames of a camera that moves or of a series of time steps, and `sink` is
//! where they go; `present` presents them; `stats` reports what was measured, and `chosen` an automatic choice.

mod chosen;
#[cfg(feature = "mpi")]
mod distributed;
mod film;
mod picture;
mod present;
mod sink;
mod stats;

use std::path::PathBuf;
use std::time::Instant;

use serde_json::json;
use volraster::choice::Profile;
use volraster::scene::View;
use volraster::{Error, GpuScene, Result, choice};

use self::film::{Film, Steps};
use self::present::{Presenter, Target};
use self::sink::Sink;
use crate::cli::annotate::AnnotationArgs;
use crate::cli::input::{ArraysArgs, ChoiceArgs, DeviceArgs, Input, LookArgs, Size, finite, positive};
use crate::cli::load::Load;
use crate::cli::nothing::why_nothing;
use crate::cli::outcome::{Outcome, check_validation};
use crate::cli::output;
use crate::cli::timing::milliseconds_since;

/// Arguments of `render`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A scene file (.json) or a data file; or the time steps of a series: several data files, in the order of the
    /// numbers in their names, or a .pvd or .series file, or a name with `*`.
    #[arg(value_name = "SCENE|DATA", required = true)]
    scenes: Vec<PathBuf>,
    #[command(flatten)]
    arrays: ArraysArgs,
    #[command(flatten)]
    look: LookArgs,
    #[command(flatten)]
    annotations: AnnotationArgs,
    /// Output image: .exr (32-bit float, linear) or .png (for viewing). With a `%d` or `%04d` in its name, an image of
    /// each frame or time step, from 0. A name that ends in .mp4, .mkv, .webm, .mov, .avi or .gif is a film of them,
    /// which the program `ffmpeg` encodes.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    choice: ChoiceArgs,
    /// Image size [default: that of the scene].
    #[arg(long, value_name = "WxH", value_parser = Size::parse)]
    size: Option<Size>,
    /// Frames to draw into numbered images or a film; else frames to time after one warm-up frame [default: 1 with
    /// --stats, else 0, which reports the time of the warm-up frame].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    frames: Option<u32>,
    /// Frames in flight: with 2 the host records one while the device draws the other, and the time of a frame is the mean of four.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2))]
    in_flight: u8,
    /// Degrees by which the eye orbits the target around `up` from frame to frame, or from time step to time step.
    /// Frame 0 has angle 0, and so has a single image.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = finite)]
    orbit: Option<f64>,
    /// Frames per second of a film.
    #[arg(long, value_name = "N", default_value_t = 25.0, allow_negative_numbers = true, value_parser = positive)]
    fps: f64,
    /// Write times, memory and counters as JSON.
    #[arg(long, value_name = "FILE")]
    stats: Option<PathBuf>,
    /// Write an image of the k-buffer overflow: white where the k-buffer did not sort the faces of a pixel, whether
    /// repaired or not.
    #[arg(long, value_name = "FILE.png")]
    overflow_map: Option<PathBuf>,
    /// Present each frame, too, for tools that capture what a program presents (tools/captures.sh). A window needs a build with the
    /// feature `window`.
    #[arg(long, value_name = "TARGET")]
    present: Option<Target>,
    #[command(flatten)]
    device: DeviceArgs,
    /// Draw with all processes that `mpirun` has started: each reads and draws a part of a grid, draws a part of a mesh, or draws a part
    /// of the image (of points, of scenes with surfaces, of maxima); the first writes the image.
    #[cfg(feature = "mpi")]
    #[arg(long)]
    distributed: bool,
    /// Enable core and synchronization validation; any message makes the exit code 1.
    #[arg(long)]
    validate: bool,
}

impl Args {
    /// Runs the command.
    pub(crate) fn run(&self, quiet: bool) -> Outcome {
        #[cfg(feature = "mpi")]
        if self.distributed {
            return self.distribute(quiet);
        }
        let files = volraster::io::in_order(self.scenes.clone());
        let sink = Sink::of(&self.output, self.fps)?;
        self.check(&files, sink.as_ref())?;
        let request = self.choice.request()?;
        let load = if sink.is_some() { Input::load_step } else { Input::load };
        let input = load(&files[0], self.size, &self.arrays, quiet)?;
        let steps = Steps::new(&files, &self.arrays, &input.settings.report);
        let Input { scene, settings } = self.look.apply(input)?;
        let mut technique = settings.choose(request, &scene)?;
        let array = settings.report.shown_name();
        let annotations = self.annotations.prepare(&scene, array, settings.background)?;
        let annotations = annotations.as_ref();
        let views = self.views(&settings.view, sink.is_some(), &steps)?;
        if let Some(sink) = &sink {
            sink.check(settings.background)?;
        }

        let start = Instant::now();
        let (gpu, log) = self.device.open_with(self.validate, |options| {
            self.arrays.limit(options);
            if let Some(target) = self.present {
                target.ask(options);
            }
        })?;
        let mut presenter = Presenter::new(&gpu, self.present, &settings.view, settings.background)?;
        let open_ms = milliseconds_since(start);
        let scene = GpuScene::new(&gpu, scene);
        let mut chosen = None;
        if let Some(goal) = self.choice.goal() {
            let profile = Profile::load(&gpu);
            let (start, load) = (Instant::now(), Load::watch());
            let choice = choice::choose(&scene, &settings.view, goal, &profile)?;
            technique = choice.technique;
            chosen = Some((choice, milliseconds_since(start), load));
        }
        drop(gpu);
        let load_and_open = [settings.load_ms, open_ms];
        let (drawn, map) = match &sink {
            None => self.draw(&scene, technique, &settings.view, &views, load_and_open, &mut presenter)?,
            Some(sink) => {
                let range = (settings.transfer_is_automatic && !quiet).then(|| scene.scene().data.range());
                let background = settings.background;
                let film = Film { technique, views: &views, steps, sink, background, annotations };
                (film.draw(&scene, range, load_and_open, &mut presenter)?, None)
            }
        };
        let nothing = why_nothing(&drawn.image, scene.scene(), &settings.view);
        drop((scene, presenter));
        let mut stats = drawn.stats;
        if let Some((choice, ms, load)) = &chosen {
            stats["choice"] = chosen::json(choice, self.choice.goal(), *ms, load.as_ref());
        }
        stats["validation_messages"] = json!(log.messages().len());

        if sink.is_none() {
            let own = annotations.map(|notes| notes.draw(&drawn.image, &settings.view)).transpose()?;
            let image = own.as_ref().unwrap_or(&drawn.image);
            volraster::io::write_image(&self.output, image, settings.background)?;
        }
        if let (Some(path), Some(map)) = (&self.overflow_map, map) {
            volraster::io::write_image(path, &map, [0.0, 0.0, 0.0, 1.0])?;
        }
        if let Some(path) = &self.stats {
            output::write_json(path, &stats)?;
        }
        if !quiet {
            if let Some(why) = nothing {
                let what = if sink.is_some() { "the first picture" } else { "the picture" };
                output::complain(&format!("warning: {what} shows nothing: {why}"));
            }
            if let Some((choice, _, load)) = &chosen {
                output::print(&chosen::line(choice, load.as_ref()))?;
            }
            let files = sink.as_ref().and_then(|sink| sink.names(views.len()));
            let files = files.unwrap_or_else(|| self.output.display().to_string());
            output::print(&format!("{}: {files}", drawn.line))?;
        }
        check_validation(&log)
    }

    /// Checks what clap cannot: arguments that do not go together, and the output paths.
    fn check(&self, files: &[PathBuf], sink: Option<&Sink>) -> Result<()> {
        let wrong = |what: &str, why: &str| {
            let (what, why) = (what.to_string(), why.to_string());
            Err(Error::Invalid { what, why })
        };
        if sink.is_none() {
            output::check_image(&self.output)?;
            if files.len() > 1 {
                return wrong(
                    "--output",
                    "several time steps need a number in its name, such as %04d, or a film",
                );
            }
            if self.orbit.is_some() && self.frames.is_none() {
                return wrong("--orbit", "needs --frames");
            }
        } else if self.in_flight > 1 {
            return wrong("--in-flight", "numbered images and films are drawn frame by frame");
        } else if self.overflow_map.is_some() {
            return wrong("--overflow-map", "is for a single image");
        }
        if self.present.is_some() && self.in_flight > 1 {
            return wrong("--in-flight", "frames are presented one by one");
        }
        let mut taken = vec![(&self.output, "the image")];
        taken.extend(files.iter().map(|file| (file, "the input")));
        output::check_apart("--output", &self.output, &taken[1..])?;
        if let Some(stats) = &self.stats {
            volraster::io::check_writable(stats)?;
            output::check_apart("--stats", stats, &taken)?;
            taken.push((stats, "the file of --stats"));
        }
        if let Some(map) = &self.overflow_map {
            output::check_image(map)?;
            output::check_apart("--overflow-map", map, &taken)?;
        }
        Ok(())
    }

    /// Returns the view of each frame of a film, or of each timed frame.
    fn views(&self, first: &View, is_film: bool, steps: &Steps) -> Result<Vec<View>> {
        let wrong = |why: &str| Error::Invalid { what: "--frames".to_string(), why: why.to_string() };
        let count = match (self.frames, steps.count()) {
            (None, Some(count)) if is_film => count,
            (Some(_), Some(_)) if is_film => return Err(wrong("a series has one frame for each time step")),
            (None, None) if is_film => {
                return Err(wrong("missing: the number of numbered images, or of frames of a film"));
            }
            (frames, _) => frames.unwrap_or(u32::from(self.stats.is_some())),
        };
        let angle = self.orbit.unwrap_or(0.0);
        let view = |i: u32| {
            if i == 0 || angle == 0.0 {
                return Ok(*first);
            }
            first.with_camera(first.camera().orbit(angle * f64::from(i))?)
        };
        (0..count).map(view).collect()
    }
}
