//! A case of `bench`: one technique with its options in one view, checked first, then timed.

use std::sync::Arc;

use serde_json::{Map, Value, json};
use volraster::measure::ImageErrors;
use volraster::reference::ReferenceImage;
use volraster::scene::{Data, View};
use volraster::technique::{FrameTime, Frames};
use volraster::{GpuScene, Renderer, Result};

use super::record::Record;
use super::required_k::RequiredK;
use super::sweeps::Setting;
use crate::cli::input::{self, is_refusal};
use crate::cli::memory::device_bytes;
use crate::cli::timing::{Quantiles, Times, pass_medians};

/// Time after which a case is not timed further, in milliseconds, once it has [`FEWEST`] frames.
const ENOUGH_MS: f64 = 4000.0;

/// Minimum number of timed frames per case.
const FEWEST: usize = 5;

/// Above this RMSE an image is wrong, not merely coarse: half of the range.
const WRONG: f64 = 0.5;

/// One technique with its options in one view.
pub(crate) struct Case {
    pub(crate) setting: Setting,
    state: State,
    errors: Option<ImageErrors>,
    frames: Vec<FrameTime>,
    device_bytes: Option<u64>,
}

/// The state of a case.
enum State {
    /// It is timed: its image is right, or wrong only for the known lack of precision of its target format.
    Ready(Box<Frames>),
    /// Its image is wrong.
    Failed(String),
    /// The technique does not support the device or scene.
    Skipped(String),
}

/// Properties that all cases of a view share.
#[derive(Clone, Debug)]
pub(crate) struct ViewInfo {
    pub(crate) scene: String,
    pub(crate) family: Option<String>,
    pub(crate) projection: String,
    pub(crate) view: View,
}

impl Case {
    /// Creates a case that is not yet checked.
    pub(crate) fn new(setting: Setting) -> Self {
        let state = State::Skipped("was not tried".to_string());
        Self { setting, state, errors: None, frames: Vec::new(), device_bytes: None }
    }

    /// Returns whether colours stay in float32 until the image is done. Other formats of the option `target` lose
    /// thin media, which is a known limit and no failure.
    fn is_precise(&self) -> bool {
        let pairs = self.setting.technique.option_pairs();
        pairs.iter().all(|(key, value)| *key != "target" || value == "rgba32f")
    }

    /// Returns whether the error is too large for the image to count.
    fn is_wrong(&self) -> bool {
        // A NaN sample makes the RMSE infinite.
        self.errors.as_ref().is_some_and(|errors| errors.all.rmse > WRONG)
    }

    /// Returns whether the image is wrong.
    pub(crate) fn has_failed(&self) -> bool {
        matches!(self.state, State::Failed(_))
    }

    /// Returns whether the case has a time, or a reason for having none.
    pub(crate) fn is_done(&self) -> bool {
        !matches!(self.state, State::Ready(_)) || !self.frames.is_empty()
    }

    /// Draws the warm-up frame and compares it with the reference.
    ///
    /// # Errors
    ///
    /// Errors that would affect every setting.
    pub(crate) fn check(&mut self, scene: &Arc<GpuScene>, view: &View, truth: &ReferenceImage) -> Result<()> {
        let draw = || {
            let mut frames = Renderer::new(scene, self.setting.technique).frames(view)?;
            frames.draw(view)?;
            let image = frames.read_back()?;
            Ok((frames, image))
        };
        match draw() {
            Ok((frames, image)) => {
                self.setting.route = frames.plan().route();
                let errors = ImageErrors::between_f64(&image, truth)?;
                let (non_finite, rmse) = (errors.non_finite, errors.all.rmse);
                self.errors = Some(errors);
                self.state = if non_finite > 0 {
                    State::Failed(format!("{non_finite} samples NaN or infinite"))
                } else if self.is_wrong() && self.is_precise() {
                    State::Failed(format!("rmse {rmse:.2e} is above {WRONG}"))
                } else {
                    State::Ready(Box::new(frames))
                };
                Ok(())
            }
            Err(error) if is_refusal(&error) => {
                self.state = State::Skipped(error.to_string());
                Ok(())
            }
            Err(error) => Err(error),
        }
    }

    /// Measures the device memory of a frame with a scene of its own; `None` if it does not fit.
    pub(crate) fn measure_memory(&mut self, scene: &GpuScene, view: &View) {
        if let State::Ready(_) = self.state {
            let alone = GpuScene::new(scene.gpu(), scene.scene().clone());
            self.device_bytes = device_bytes(&alone, || {
                let mut frames = Renderer::new(&alone, self.setting.technique).frames(view)?;
                frames.draw(view)?;
                Ok(frames)
            })
            .ok()
            .map(|(_, bytes)| bytes);
        }
    }

    /// Times one frame, unless the case has taken enough time.
    ///
    /// # Errors
    ///
    /// As [`Frames::draw`].
    pub(crate) fn time(&mut self, view: &View) -> Result<()> {
        if let State::Ready(frames) = &mut self.state {
            let spent: f64 = self.frames.iter().map(|frame| frame.wall_ms).sum();
            if self.frames.len() < FEWEST || spent < ENOUGH_MS {
                self.frames.push(frames.draw(view)?);
            }
        }
        Ok(())
    }

    /// Returns the record of the case.
    pub(crate) fn record(&self, scene: &GpuScene, info: &ViewInfo, required_k: Option<&RequiredK>) -> Record {
        let Setting { sweep, technique, route } = &self.setting;
        let (gpu, device) = (scene.gpu(), scene.gpu().report());
        let options = match input::options_json(technique) {
            Value::Object(options) => options,
            _ => Map::new(),
        };
        let (mut counters, mut frames) = (Vec::new(), None);
        let (mut failed, mut skipped) = (None, None);
        match &self.state {
            State::Ready(drawing) => {
                counters.extend(drawing.plan().counters());
                frames = Some(self.frames.len());
            }
            State::Failed(why) => failed = Some(why.clone()),
            State::Skipped(why) => skipped = Some(why.clone()),
        }
        counters.extend(self.frames.last().iter().flat_map(|frame| frame.counters.iter().copied()));
        let required_k = required_k.filter(|_| technique.method() == volraster::technique::Method::Havs);
        let passes = pass_medians(&self.frames).into_iter().map(|(name, ms)| (name, json!(ms)));
        Record {
            version: env!("CARGO_PKG_VERSION").to_string(),
            device: device.name.clone(),
            driver: device.driver.clone(),
            api: device.api.clone(),
            software: gpu.is_software(),
            scene: info.scene.clone(),
            family: info.family.clone(),
            projection: info.projection.clone(),
            size: info.view.extent(),
            data: scene.scene().data.kind().to_string(),
            elements: elements(&scene.scene().data),
            sweep: (*sweep).to_string(),
            technique: technique.method().name().to_string(),
            route: (*route).to_string(),
            // Techniques that draw the slices of the grid have no step.
            step: options.get("step").filter(|step| step.is_number()).cloned(),
            options,
            errors: self.errors.as_ref().map(|errors| json!(errors)),
            counters: counters.into_iter().map(|(name, n)| (name.to_string(), json!(n))).collect(),
            required_k: required_k.map(RequiredK::json),
            device_bytes: self.device_bytes,
            frames,
            failed,
            skipped,
            wrong: self.is_wrong(),
            wall_ms: Quantiles::wall(&self.frames),
            gpu_ms: Quantiles::gpu(&self.frames),
            passes_ms: passes.collect(),
        }
    }

    /// Returns the row of the table on stdout.
    pub(crate) fn row(&self, info: &ViewInfo) -> Vec<String> {
        let Setting { technique, route, .. } = &self.setting;
        let error = |pick: fn(&ImageErrors) -> f64| {
            self.errors.as_ref().map_or_else(|| "-".to_string(), |errors| format!("{:.2e}", pick(errors)))
        };
        let number =
            |value: Option<f64>| value.map_or_else(|| "-".to_string(), |value| format!("{value:.1}"));
        let mut row =
            [&info.scene, &info.projection, technique.method().name(), route].map(str::to_string).to_vec();
        row.push(input::options_text(technique));
        row.extend([error(|e| e.all.rmse), error(|e| e.all.max_abs)]);
        match &self.state {
            State::Ready(_) => {
                let (wall, gpu_ms) = (Times::wall(&self.frames), Quantiles::gpu(&self.frames));
                let quantile = |per_cent| number(wall.as_ref().map(|times| times.quantile(per_cent)));
                row.extend([
                    quantile(50),
                    quantile(10),
                    quantile(90),
                    number(gpu_ms.map(|times| times.median)),
                ]);
                row.extend(self.is_wrong().then(|| "wrong".to_string()));
            }
            State::Failed(_) => row.push("FAILED".to_string()),
            State::Skipped(_) => row.push("skipped".to_string()),
        }
        row
    }
}

/// Headings of [`Case::row`].
pub(crate) const HEADING: [&str; 11] =
    ["scene", "projection", "technique", "route", "options", "rmse", "max", "ms", "p10", "p90", "gpu ms"];

/// Returns the number of voxels, tetrahedra or points.
pub(crate) fn elements(data: &Data) -> u64 {
    match data {
        Data::Grid(grid) => grid.dims().into_iter().map(u64::from).product(),
        Data::Mesh(mesh) => mesh.cells().len() as u64,
        Data::Points(points) => points.centres().len() as u64,
        _ => 0,
    }
}
