//! Arguments of `view`, and the steps until the window opens.

use std::path::PathBuf;
use std::time::Instant;

use volraster::gpu::{GpuOptions, Validation};
use volraster::{Gpu, GpuScene};
use winit::event_loop::EventLoop;

use super::app::{App, Script};
use super::panel::Panel;
use super::session::Session;
use crate::cli::input::{ArraysArgs, ChoiceArgs, DeviceArgs, Input, LookArgs, Size, positive};
use crate::cli::outcome::{Failure, Outcome, check_validation};
use crate::cli::output;

/// Arguments of `view`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A scene file (.json) or a data file.
    #[arg(value_name = "SCENE|DATA")]
    scene: PathBuf,
    #[command(flatten)]
    arrays: ArraysArgs,
    #[command(flatten)]
    look: LookArgs,
    #[command(flatten)]
    choice: ChoiceArgs,
    /// Milliseconds of a frame while the picture moves: it is as coarse as that needs.
    #[arg(long, value_name = "MS", default_value_t = 100.0, allow_negative_numbers = true, value_parser = positive)]
    frame: f64,
    /// Size of the picture at the beginning [default: that of the scene].
    #[arg(long, value_name = "WxH", value_parser = Size::parse)]
    size: Option<Size>,
    #[command(flatten)]
    device: DeviceArgs,
    /// Enable core and synchronization validation; any message makes the exit code 1.
    #[arg(long)]
    validate: bool,
    /// For tests: drag the mouse over the picture in this many frames, and report their rate.
    #[arg(long, hide = true, value_name = "N")]
    drag: Option<u32>,
    /// For tests: write the complete picture and beside it its scene file, and close the window.
    #[arg(long, hide = true, value_name = "FILE")]
    save: Option<PathBuf>,
}

impl Args {
    /// Runs the command.
    pub(crate) fn run(&self, quiet: bool) -> Outcome {
        let begin = Instant::now();
        let request = self.choice.request()?;
        if let Some(path) = &self.save {
            output::check_image(path)?;
        }
        let no_window =
            |error: &dyn std::fmt::Display| Failure::Finding(format!("cannot open a window: {error}"));
        let events = EventLoop::new().map_err(|error| no_window(&error))?;
        let input = Input::load(&self.scene, self.size, &self.arrays, quiet)?;
        let Input { scene, settings } = self.look.apply(input)?;
        let technique = settings.choose(request, &scene)?;
        let validation = if self.validate { Validation::On } else { Validation::Off };
        let mut options = GpuOptions { validation, window: true, ..self.device.options() };
        self.arrays.limit(&mut options);
        let gpu = Gpu::new(&options)?;
        let log = gpu.validation_log();
        let mut session = Session::new(GpuScene::new(&gpu, scene), &settings, technique, self.frame);
        let goal = self.choice.goal();
        if let Some(goal) = goal {
            session.search(goal);
        }
        let panel = Panel::new(&self.scene, &self.arrays, goal);
        let script = Script::new(begin, self.drag, self.save.clone());
        let mut app = App::new(gpu, session, panel, script);
        let ran = events.run_app(&mut app);
        app.outcome()?;
        drop(app);
        ran.map_err(|error| no_window(&error))?;
        check_validation(&log)
    }
}
