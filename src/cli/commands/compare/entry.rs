//! Images by one technique each, with errors, times and memory.

use std::path::Path;

use serde_json::{Map, Value, json};
use volraster::io::{write_exr, write_png};
use volraster::measure::{ImageErrors, heat_map_f64};
use volraster::reference::ReferenceImage;
use volraster::scene::{Scene, View};
use volraster::technique::{FrameTime, Method};
use volraster::{Error, Gpu, GpuScene, Image, Renderer, Result, Technique};

use super::row::Row;
use crate::cli::input::{self, Settings, Wanted, all_routes, is_refusal};
use crate::cli::memory::device_bytes;
use crate::cli::output;
use crate::cli::timing::{Quantiles, pass_medians};

/// Timed frames per technique, after one warm-up frame.
pub(super) const FRAMES: u32 = 5;

/// An image drawn by one technique.
pub(super) struct Entry {
    pub(super) technique: Technique,
    pub(super) route: &'static str,
    /// Name of its files, without the ending.
    pub(super) stem: String,
    pub(super) image: Image,
    pub(super) frames: Vec<FrameTime>,
    /// Counters of the plan and of the last frame.
    pub(super) counters: Vec<(&'static str, u64)>,
    pub(super) device_bytes: u64,
}

/// Results of a list of techniques.
pub(super) struct Drawn {
    pub(super) entries: Vec<Entry>,
    /// Techniques of `all` that do not draw the scene here: technique, route and reason.
    pub(super) refused: Vec<[String; 3]>,
}

/// Draws the scene with every wanted technique. Skips techniques of `all` that do not support the device or scene.
pub(super) fn draw(gpu: &Gpu, scene: &Scene, settings: &Settings, list: &[Wanted]) -> Result<Drawn> {
    let mut entries: Vec<Entry> = Vec::new();
    let mut refused = Vec::new();
    let mut skipped = None;
    for wanted in list {
        let Wanted::One(request) = *wanted else {
            for (method, route) in all_routes().filter(|(method, _)| method.fits(scene)) {
                if let (Some(why), None) = (input::too_many_splats(method, &scene.data), &scene.kernels) {
                    output::print(&format!("skipped: {}/{route}: {why}", method.name()))?;
                    refused.push([method.name().to_string(), route.to_string(), why]);
                    continue;
                }
                let drawn = with_route(settings, method, route).and_then(|technique| {
                    Entry::draw(gpu, scene, &settings.view, technique, stem(&entries, technique))
                });
                match drawn {
                    Ok(entry) => entries.push(entry),
                    // `all` does not require each single technique: skip it.
                    Err(error) if is_refusal(&error) => {
                        output::print(&format!("skipped: {}/{route}: {error}", method.name()))?;
                        refused.push([method.name().to_string(), route.to_string(), error.to_string()]);
                        skipped = Some(error);
                    }
                    Err(error) => return Err(error),
                }
            }
            continue;
        };
        let technique = settings.choose(Some(request), scene)?;
        let stem = stem(&entries, technique);
        entries.push(Entry::draw(gpu, scene, &settings.view, technique, stem)?);
    }
    match skipped {
        Some(error) if entries.is_empty() => Err(error),
        _ => Ok(Drawn { entries, refused }),
    }
}

/// Returns a technique by one route. The technique of the scene file keeps its other options.
fn with_route(settings: &Settings, method: Method, route: &str) -> Result<Technique> {
    let given = settings.choice.as_ref().filter(|choice| choice.name == method.name());
    input::by_route(method, route, given.map_or(&[], |choice| &choice.options), &[])
}

/// Returns an unused name for the files of a technique: `slices-3d`, then `slices-3d-2`.
fn stem(entries: &[Entry], technique: Technique) -> String {
    let method = technique.method();
    match entries.iter().filter(|entry| entry.technique.method() == method).count() {
        0 => method.name().to_string(),
        n => format!("{}-{}", method.name(), n + 1),
    }
}

impl Entry {
    /// Draws with a scene of its own, so that the measured memory is all that the technique needs.
    pub(super) fn draw(
        gpu: &Gpu,
        scene: &Scene,
        view: &View,
        technique: Technique,
        stem: String,
    ) -> Result<Self> {
        let scene = GpuScene::new(gpu, scene.clone());
        let (mut drawing, device_bytes) = device_bytes(&scene, || {
            let mut drawing = Renderer::new(&scene, technique).frames(view)?;
            drawing.draw(view)?;
            Ok(drawing)
        })?;
        let frames: Vec<FrameTime> = (0..FRAMES).map(|_| drawing.draw(view)).collect::<Result<_>>()?;
        let last = frames.last().map_or(&[][..], |frame| &frame.counters);
        let counters = drawing.plan().counters().into_iter().chain(last.iter().copied()).collect();
        let (route, image) = (drawing.plan().route(), drawing.read_back()?);
        Ok(Self { technique, route, stem, image, frames, counters, device_bytes })
    }

    /// Writes the image and its heat map, and returns both as PNG.
    pub(super) fn write(
        &self,
        folder: &Path,
        truth: &ReferenceImage,
        background: [f64; 4],
    ) -> Result<[Vec<u8>; 2]> {
        let file = |ending: &str| folder.join(format!("{}.{ending}", self.stem));
        write_exr(file("exr"), &self.image)?;
        write_png(file("png"), &self.image, background)?;
        write_png(file("heat.png"), &heat_map_f64(&self.image, truth)?, [0.0, 0.0, 0.0, 1.0])?;
        Ok([read(&file("png"))?, read(&file("heat.png"))?])
    }

    /// Returns the row of the report.
    pub(super) fn row(&self, errors: ImageErrors, pictures: [Vec<u8>; 2]) -> Row {
        Row {
            stem: self.stem.clone(),
            technique: self.technique.method().name().to_string(),
            route: self.route.to_string(),
            options: input::options_text(&self.technique),
            errors,
            wall: Quantiles::wall(&self.frames),
            gpu: Quantiles::gpu(&self.frames),
            passes: pass_medians(&self.frames),
            counters: self.counters.iter().map(|(name, n)| ((*name).to_string(), *n)).collect(),
            device_bytes: self.device_bytes,
            pictures,
        }
    }

    /// Returns the row of the table on stdout.
    pub(super) fn line(&self, errors: &ImageErrors) -> Vec<String> {
        let all = errors.all;
        vec![
            self.technique.method().name().to_string(),
            self.route.to_string(),
            input::options_text(&self.technique),
            format!("{:.2e}", all.rmse),
            format!("{:.2e}", all.max_abs),
            format!("{:+.2e}", all.bias),
            format!("{:.2e}", all.p99),
            format!("{:.2e}", all.p999),
            format!("{:.2} %", 100.0 * errors.above_1_255),
            Quantiles::wall(&self.frames).map_or_else(String::new, |times| format!("{:.1}", times.median)),
        ]
    }

    /// Returns the entry of errors.json.
    pub(super) fn json(&self, errors: &ImageErrors) -> Value {
        let full = json!(errors);
        let mut entry = Map::new();
        let mut put = |key: &str, value: Value| entry.insert(key.to_string(), value);
        put("technique", json!(self.technique.method().name()));
        put("route", json!(self.route));
        put("options", input::options_json(&self.technique));
        put("image", json!(format!("{}.exr", self.stem)));
        for (key, statistic) in
            [("rmse", "rmse"), ("max", "max_abs"), ("bias", "bias"), ("p99", "p99"), ("p999", "p999")]
        {
            // The serialised form writes infinity in a way that JSON can represent.
            put(key, full["all"][statistic].clone());
        }
        put("above_1_255", json!(errors.above_1_255));
        for (key, times) in
            [("wall_ms", Quantiles::wall(&self.frames)), ("gpu_ms", Quantiles::gpu(&self.frames))]
        {
            if let Some(times) = times {
                put(key, json!(times.median));
            }
        }
        let passes = pass_medians(&self.frames).into_iter().map(|(name, ms)| (name, json!(ms)));
        put("passes_ms", passes.collect::<Map<_, _>>().into());
        put("device_bytes", json!(self.device_bytes));
        let counters = self.counters.iter().map(|(name, n)| ((*name).to_string(), json!(n)));
        put("counters", counters.collect::<Map<_, _>>().into());
        put("errors", full);
        Value::Object(entry)
    }
}

/// Reads a file.
pub(super) fn read(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).map_err(|source| Error::Io {
        path: path.to_path_buf(),
        action: "cannot read",
        source,
    })
}
