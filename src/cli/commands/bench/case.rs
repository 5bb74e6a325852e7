//! A case of `bench`: one technique with its options in one view, checked first, then timed.

use std::sync::Arc;

use serde_json::{Value, json};
use volraster::measure::ImageErrors;
use volraster::reference::ReferenceImage;
use volraster::scene::{Data, View};
use volraster::technique::{FrameTime, Method};
use volraster::{GpuScene, Image, Renderer, Result, Technique};

use super::record::Record;
use super::required_k::RequiredK;
use super::series::{Limits, Series};
use super::sweeps::Setting;
use crate::cli::in_flight::InFlight;
use crate::cli::input::{self, is_refusal};
use crate::cli::memory::device_bytes;
use crate::cli::output;
use crate::cli::sensors::Reading;
use crate::cli::timing::{Quantiles, Times, pass_medians};

/// Above this RMSE an image is wrong, not merely coarse: half of the range.
const WRONG: f64 = 0.5;

/// One technique with its options in one view.
pub(super) struct Case {
    technique: Technique,
    /// What draws it, if it is to be timed: its image is right, or wrong only for the known lack of precision of its
    /// target format.
    drawing: Option<Box<InFlight>>,
    frames: Vec<FrameTime>,
    series: Series,
    /// Why frames were disturbed, the last reason.
    why_disturbed: String,
    readings: Vec<Reading>,
    /// Counters of a frame that was drawn to count.
    counts: Vec<(&'static str, u64)>,
    /// Frames in flight, one or two.
    in_flight: u8,
    record: Record,
}

impl Case {
    /// Creates a case that is not yet checked. `view` has the properties that all cases of the view share.
    pub(super) fn new(
        Setting { sweep, technique, route }: Setting,
        view: &Record,
        in_flight: u8,
        limits: Limits,
    ) -> Self {
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
        Self {
            technique,
            drawing: None,
            frames: Vec::new(),
            series: Series::new(limits),
            why_disturbed: String::new(),
            readings: Vec::new(),
            counts: Vec::new(),
            in_flight,
            record,
        }
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
        self.record.image = Some(digest(&image));
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

    /// Returns whether more frames are to be timed, `elapsed_ms` after the first of the view.
    pub(super) fn wants_more(&self, elapsed_ms: f64) -> bool {
        self.drawing.is_some() && self.series.wants_more(elapsed_ms)
    }

    /// Times a frame and returns its number, if the case is drawn.
    pub(super) fn time(&mut self, view: &View) -> Result<Option<usize>> {
        let Some(drawing) = &mut self.drawing else { return Ok(None) };
        let frame = drawing.draw(view)?;
        let number = self.series.add(frame.wall_ms);
        self.frames.push(frame);
        Ok(Some(number))
    }

    /// Marks a frame as disturbed.
    pub(super) fn disturb(&mut self, frame: usize, why: &str) {
        self.series.disturb(frame);
        self.why_disturbed = why.to_string();
    }

    /// Notes a reading of sensors during the frames.
    pub(super) fn sensed(&mut self, reading: Reading) {
        self.readings.push(reading);
    }

    /// Returns the medians of the readings of sensors.
    fn sensors(&self) -> Option<Reading> {
        let middle = |of: fn(&Reading) -> Option<f64>| {
            Times::new(self.readings.iter().filter_map(of).collect()).map(|values| values.median())
        };
        let last = self.readings.last()?;
        let reading = Reading {
            clock_mhz: middle(|reading| reading.clock_mhz),
            temperature_c: middle(|reading| reading.temperature_c),
            power_w: middle(|reading| reading.power_w),
            throttled: self.readings.iter().find_map(|reading| reading.throttled.clone()),
            governor: last.governor.clone(),
        };
        (reading != Reading::default()).then_some(reading)
    }

    /// Returns the record of the case; `pulse` is the fastest one while it was timed.
    pub(super) fn finish(mut self, required_k: Option<&RequiredK>, pulse: f64) -> Record {
        let sensors = self.sensors();
        let bytes = self.drawing.as_mut().map(|drawing| {
            let passes = drawing.first().plan().pass_bytes();
            passes.into_values().fold([0; 2], |sum, pass| [sum[0] + pass[0], sum[1] + pass[1]])
        });
        let of_plan = self.drawing.iter_mut().flat_map(|drawing| drawing.first().plan().counters());
        let of_frame = self.frames.last().into_iter().flat_map(|frame| frame.counters.iter().copied());
        let counted = self.counts.into_iter();
        let counters =
            of_plan.chain(of_frame).chain(counted).map(|(name, n)| (name.to_string(), json!(n))).collect();
        let [after, disturbed] = self.series.disturbances();
        let frames: Vec<FrameTime> =
            self.series.counted().into_iter().map(|frame| self.frames[frame].clone()).collect();
        let passes = pass_medians(&frames).into_iter().map(|(name, ms)| (name, json!(ms)));
        let required_k = required_k.filter(|_| self.technique.method() == Method::Havs);
        Record {
            counters,
            bytes,
            required_k: required_k.map(|required| json!(required)),
            frames: self.drawing.as_ref().map(|_| frames.len()),
            warm: self.series.warm(),
            noisy: self.series.is_noisy(),
            disturbed: (disturbed > 0)
                .then(|| format!("{disturbed} of {after} frames, the last as {}", self.why_disturbed)),
            sensors,
            pulse: self.drawing.as_ref().map(|_| pulse),
            wall_ms: Quantiles::wall(&frames),
            gpu_ms: Quantiles::gpu(&frames),
            passes_ms: passes.collect(),
            ..self.record
        }
    }
}

/// Returns the digest of an image's size and samples.
fn digest(image: &Image) -> String {
    let size = [image.width(), image.height()].into_iter().flat_map(u32::to_le_bytes);
    let samples = image.pixels().iter().flatten().flat_map(|sample| sample.to_le_bytes());
    output::digest(&size.chain(samples).collect::<Vec<u8>>())
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
