//! Images by one technique each, with errors, times and memory.

use std::path::Path;

use serde_json::{Value, json};
use volraster::io::{write_exr, write_png};
use volraster::measure::{ImageErrors, heat_map_f64};
use volraster::reference::ReferenceImage;
use volraster::scene::{Scene, SplatRule, View};
use volraster::technique::{FrameTime, Method};
use volraster::{Gpu, GpuScene, Image, Renderer, Result, Technique};

use super::row::Row;
use crate::cli::input::{self, Settings, Wanted, all_routes, is_refusal};
use crate::cli::memory::device_bytes;
use crate::cli::output;
use crate::cli::timing::{Quantiles, pass_medians};

/// Timed frames per technique, after one warm-up frame.
pub(super) const FRAMES: u32 = 5;

/// An image drawn by one technique.
pub(super) struct Entry {
    technique: Technique,
    route: &'static str,
    /// The rule of trained splats.
    pub(super) rule: Option<SplatRule>,
    /// Name of its files, without the ending.
    stem: String,
    image: Image,
    frames: Vec<FrameTime>,
    /// Counters of the plan and of the last frame.
    counters: Vec<(&'static str, u64)>,
    device_bytes: u64,
}

/// Techniques of `all` that do not draw the scene here: technique, route and reason.
type Refused = Vec<[String; 3]>;

/// Draws the scene with every wanted technique. Skips techniques of `all` that do not support the device or scene.
pub(super) fn draw(
    gpu: &Gpu,
    scene: &Scene,
    settings: &Settings,
    list: &[Wanted],
) -> Result<(Vec<Entry>, Refused)> {
    let draw = |technique, others: &[Entry]| Entry::draw(gpu, scene, &settings.view, technique, others);
    let (mut entries, mut refused, mut skipped) = (Vec::new(), Vec::new(), None);
    for wanted in list {
        if let Wanted::One(request) = *wanted {
            let technique = settings.choose(Some(request), scene)?;
            entries.push(draw(technique, &entries)?);
            continue;
        }
        for (method, route, rule) in all(scene) {
            let too_slow = input::too_many_splats(method, &scene.data).filter(|_| scene.kernels.is_none());
            let why = if let Some(why) = too_slow {
                why
            } else {
                // The technique of the scene file keeps its other options.
                let given = settings.choice.as_ref().filter(|choice| choice.name == method.name());
                let rule: Vec<_> = rule.iter().map(|rule| ("rule", rule.name())).collect();
                let technique =
                    input::by_route(method, route, given.map_or(&[], |choice| &choice.options), &rule);
                match technique.and_then(|technique| draw(technique, &entries)) {
                    Ok(entry) => {
                        entries.push(entry);
                        continue;
                    }
                    // `all` does not require each single technique: skip it.
                    Err(error) if is_refusal(&error) => skipped.insert(error).to_string(),
                    Err(error) => return Err(error),
                }
            };
            let name = named(method, rule);
            output::print(&format!("skipped: {name}/{route}: {why}"))?;
            refused.push([name, route.to_string(), why]);
        }
    }
    match skipped {
        Some(error) if entries.is_empty() => Err(error),
        _ => Ok((entries, refused)),
    }
}

/// Returns every technique that suits a scene, by every route, and trained splats by every rule.
fn all(scene: &Scene) -> impl Iterator<Item = (Method, &'static str, Option<SplatRule>)> {
    let rules = match scene.splat_rule() {
        Some(_) => SplatRule::ALL.map(|(_, rule)| Some(rule)).to_vec(),
        None => vec![None],
    };
    let routes = all_routes().filter(|(method, _)| method.fits(scene));
    routes.flat_map(move |(method, route)| rules.clone().into_iter().map(move |rule| (method, route, rule)))
}

/// Returns a technique's name, with the rule of trained splats.
fn named(method: Method, rule: Option<SplatRule>) -> String {
    rule.map_or_else(|| method.name().to_string(), |rule| format!("{}-{}", method.name(), rule.name()))
}

impl Entry {
    /// Draws with a scene of its own, so that the measured memory is all that the technique needs. The files are named
    /// after technique and route: `slices-3d-compute`, then `slices-3d-compute-2`; techniques of one route have no such part, those of
    /// trained splats the rule instead.
    fn draw(gpu: &Gpu, scene: &Scene, view: &View, technique: Technique, others: &[Self]) -> Result<Self> {
        let method = technique.method();
        let rule = technique.splat_rule().or(scene.splat_rule());
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
        let mut name = named(method, rule);
        if method.routes().len() > 1 {
            name = format!("{name}-{route}");
        }
        let same =
            |entry: &&Self| entry.technique.method() == method && entry.route == route && entry.rule == rule;
        let stem = match others.iter().filter(same).count() {
            0 => name,
            n => format!("{name}-{}", n + 1),
        };
        Ok(Self { technique, route, rule, stem, image, frames, counters, device_bytes })
    }

    /// Writes the image and its heat map, and returns the row of the report.
    pub(super) fn row(&self, folder: &Path, truth: &ReferenceImage, background: [f64; 4]) -> Result<Row> {
        let errors = ImageErrors::between_f64(&self.image, truth)?;
        let file = |ending: &str| folder.join(format!("{}.{ending}", self.stem));
        write_exr(file("exr"), &self.image)?;
        write_png(file("png"), &self.image, background)?;
        write_png(file("heat.png"), &heat_map_f64(&self.image, truth)?, [0.0, 0.0, 0.0, 1.0])?;
        Ok(Row {
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
            pictures: [read(&file("png"))?, read(&file("heat.png"))?],
        })
    }

    /// Returns the entry of errors.json.
    pub(super) fn json(&self, row: &Row) -> Value {
        // The serialised form writes infinity in a way that JSON can represent.
        let errors = json!(row.errors);
        let all = &errors["all"];
        let median = |times: &Option<Quantiles>| times.as_ref().map(|times| times.median);
        output::without_nulls(json!({
            "technique": row.technique,
            "route": row.route,
            "options": input::options_json(&self.technique),
            "image": format!("{}.exr", row.stem),
            "rmse": all["rmse"], "max": all["max_abs"], "bias": all["bias"], "p99": all["p99"], "p999": all["p999"],
            "above_1_255": row.errors.above_1_255,
            "wall_ms": median(&row.wall),
            "gpu_ms": median(&row.gpu),
            "passes_ms": row.passes.iter().cloned().collect::<Value>(),
            "device_bytes": row.device_bytes,
            "counters": row.counters.iter().cloned().collect::<Value>(),
            "errors": errors,
        }))
    }
}

/// Reads a file.
pub(super) fn read(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).map_err(output::unreadable(path))
}
