//! A case of `bench`: one technique with its options in one view, checked first, then timed.

use std::sync::Arc;

use serde_json::{Value, json};
use volraster::measure::ImageErrors;
use volraster::reference::ReferenceImage;
use volraster::scene::{Data, View};
use volraster::technique::{FrameTime, Method};
use volraster::{GpuScene, Renderer, Result, Technique};

use super::record::Record;
use super::required_k::RequiredK;
use super::sweeps::Setting;
use crate::cli::in_flight::InFlight;
use crate::cli::input::{self, is_refusal};
use crate::cli::memory::device_bytes;
use crate::cli::timing::{Quantiles, pass_medians};

/// Time after which a case is not timed further, in milliseconds, once it has [`FEWEST`] frames.
const ENOUGH_MS: f64 = 4000.0;

/// Minimum number of timed frames per case.
const FEWEST: usize = 5;

/// Above this RMSE an image is wrong, not merely coarse: half of the range.
const WRONG: f64 = 0.5;

/// One technique with its options in one view.
pub(super) struct Case {
    technique: Technique,
    /// What draws it, if it is to be timed: its image is right, or wrong only for the known lack of precision of its
    /// target format.
    drawing: Option<Box<InFlight>>,
    frames: Vec<FrameTime>,
    /// Counters of a frame that was drawn to count.
    counts: Vec<(&'static str, u64)>,
    /// Frames in flight, one or two.
    in_flight: u8,
    record: Record,
}

impl Case {
    /// Creates a case that is not yet checked. `view` has the properties that all cases of the view share.
    pub(super) fn new(Setting { sweep, technique, route }: Setting, view: &Record, in_flight: u8) -> Self {
        let options = match input::options_json(&technique) {
            Value::Object(options) => options,
            _ => serde_json::Map::new(),
        };
        let record = Record {
            sweep: sweep.to_string(),
            technique: technique.method().name().to_string(),
            route: route.to_string(),
            // Techniques that draw the slices of the grid have no step.
            step: options.get("step").filter(|step| step.is_number()).cloned(),
            options,
            ..view.clone()
        };
        Self { technique, drawing: None, frames: Vec::new(), counts: Vec::new(), in_flight, record }
    }

    /// Returns technique and route; after the check, the route is that of the plan.
    pub(super) fn kind(&self) -> (Method, String) {
        (self.technique.method(), self.record.route.clone())
    }

    /// Returns whether the case has a time, or a reason for having none.
    pub(super) fn is_done(&self) -> bool {
        self.drawing.is_none() || !self.frames.is_empty()
    }

    fn draw(&self, scene: &Arc<GpuScene>, view: &View) -> Result<InFlight> {
        let mut frames = InFlight::new(scene, self.technique, view, self.in_flight)?;
        frames.draw(view)?;
        Ok(frames)
    }

    /// Draws the warm-up frame and compares it with the reference.
    ///
    /// # Errors
    ///
    /// Errors that would affect every setting.
    pub(super) fn check(&mut self, scene: &Arc<GpuScene>, view: &View, truth: &ReferenceImage) -> Result<()> {
        let drawn = self.draw(scene, view).and_then(|mut frames| Ok((frames.first().read_back()?, frames)));
        let (image, mut frames) = match drawn {
            Err(error) if is_refusal(&error) => {
                self.record.skipped = Some(error.to_string());
                return Ok(());
            }
            drawn => drawn?,
        };
        self.record.route = frames.first().plan().route().to_string();
        let errors = ImageErrors::between_f64(&image, truth)?;
        self.record.errors = Some(json!(errors));
        // A NaN sample makes the RMSE infinite.
        let (non_finite, rmse) = (errors.non_finite, errors.all.rmse);
        self.record.wrong = rmse > WRONG;
        // Other target formats than float32 lose thin media, which is a known limit and no failure.
        let pairs = self.technique.option_pairs();
        let is_precise = pairs.iter().all(|(key, value)| *key != "target" || value == "rgba32f");
        if non_finite > 0 {
            self.record.failed = Some(format!("{non_finite} samples NaN or infinite"));
        } else if self.record.wrong && is_precise {
            self.record.failed = Some(format!("rmse {rmse:.2e} is above {WRONG}"));
        } else {
            self.drawing = Some(Box::new(frames));
        }
        Ok(())
    }

    /// Measures the device memory of a frame with a scene of its own; `None` if it does not fit.
    pub(super) fn measure_memory(&mut self, scene: &GpuScene, view: &View) {
        if self.drawing.is_some() {
            let alone = GpuScene::new(scene.gpu(), scene.scene().clone());
            let measured = device_bytes(&alone, || self.draw(&alone, view));
            self.record.device_bytes = measured.ok().map(|(_, bytes)| bytes);
        }
    }

    /// Counts samples and fetches of a grid, in a frame that is not timed.
    pub(super) fn count(&mut self, scene: &Arc<GpuScene>, view: &View) -> Result<()> {
        if self.drawing.is_some() && matches!(scene.scene().data, Data::Grid(_)) {
            self.counts = match Renderer::new(scene, self.technique).count(view) {
                // One more frame may not fit the memory of the device.
                Err(error) if is_refusal(&error) => Vec::new(),
                counted => counted?,
            };
        }
        Ok(())
    }

    /// Times one frame, unless the case has taken enough time.
    pub(super) fn time(&mut self, view: &View) -> Result<()> {
        if let Some(drawing) = &mut self.drawing {
            let spent: f64 = self.frames.iter().map(|frame| frame.wall_ms).sum();
            if self.frames.len() < FEWEST || spent < ENOUGH_MS {
                self.frames.push(drawing.draw(view)?);
            }
        }
        Ok(())
    }

    /// Returns the record of the case.
    pub(super) fn finish(mut self, required_k: Option<&RequiredK>) -> Record {
        let of_plan = self.drawing.iter_mut().flat_map(|drawing| drawing.first().plan().counters());
        let of_frame = self.frames.last().into_iter().flat_map(|frame| frame.counters.iter().copied());
        let counted = self.counts.into_iter();
        let counters =
            of_plan.chain(of_frame).chain(counted).map(|(name, n)| (name.to_string(), json!(n))).collect();
        let passes = pass_medians(&self.frames).into_iter().map(|(name, ms)| (name, json!(ms)));
        let required_k = required_k.filter(|_| self.technique.method() == Method::Havs);
        Record {
            counters,
            required_k: required_k.map(|required| json!(required)),
            frames: self.drawing.as_ref().map(|_| self.frames.len()),
            wall_ms: Quantiles::wall(&self.frames),
            gpu_ms: Quantiles::gpu(&self.frames),
            passes_ms: passes.collect(),
            ..self.record
        }
    }
}

/// Returns the number of voxels, tetrahedra, points or splats.
pub(super) fn elements(data: &Data) -> u64 {
    match data {
        Data::Grid(grid) => grid.dims().into_iter().map(u64::from).product(),
        Data::Mesh(mesh) => mesh.cells().len() as u64,
        Data::Points(points) => points.centres().len() as u64,
        Data::Gaussians(splats) => splats.len() as u64,
        _ => 0,
    }
}
