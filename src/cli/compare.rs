//! `volraster compare`: several techniques against the truth.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::{Map, Value, json};
use volraster::io::{ReadOptions, read_exr, write_exr, write_png};
use volraster::measure::{ImageErrors, heat_map_f64};
use volraster::reference::ReferenceImage;
use volraster::scene::View;
use volraster::technique::{FrameTime, Method};
use volraster::{Error, GpuScene, Image, Renderer, Result, Technique};

use super::input::{self, ArrayArg, DeviceArgs, Input, Settings, Size, Wanted};
use super::timing::Times;
use super::{Outcome, output, reference, table};

/// Frames that are timed, after one that warms up.
const FRAMES: u32 = 5;

/// Arguments of `compare`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A scene file (.json) or a data file.
    #[arg(value_name = "SCENE|DATA")]
    scene: PathBuf,
    #[command(flatten)]
    array: ArrayArg,
    /// Folder for pictures, error pictures and errors.json.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Techniques with options, separated by `;` or `,`; may be repeated. The scene's own technique keeps
    /// the scene's options when none is given. `all`: every technique for the scene's kind
    /// of data, by every route that the device offers.
    #[arg(long, value_name = "all|NAME[:key=value,...];...", default_value = "all")]
    techniques: Vec<String>,
    /// The truth: the float64 reference, or an OpenEXR file.
    #[arg(long, value_name = "reference|FILE.exr", default_value = "reference")]
    against: PathBuf,
    /// Image size instead of the scene's.
    #[arg(long, value_name = "WxH", value_parser = Size::parse)]
    size: Option<Size>,
    #[command(flatten)]
    device: DeviceArgs,
    /// Turn core and synchronization validation on; any message makes the exit code 1.
    #[arg(long)]
    validate: bool,
}

/// A picture by one technique.
struct Entry {
    technique: Technique,
    route: &'static str,
    /// Name of its files, without the ending.
    stem: String,
    image: Image,
    frames: Vec<FrameTime>,
}

impl Args {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// What is wrong with the arguments, the input, the device or the output.
    pub(crate) fn run(&self, quiet: bool) -> Outcome {
        output::check_folder(&self.output)?;
        let lists =
            self.techniques.iter().map(|list| Wanted::parse_list(list)).collect::<Result<Vec<_>>>()?;
        let given = self.given_truth()?;
        let Input { scene, settings } = Input::load(&self.scene, self.size, &self.array, quiet)?;
        if let Some(truth) = &given {
            let [width, height] = settings.view.extent();
            if [truth.width(), truth.height()] != [width, height] {
                return Err(Error::File {
                    path: self.against.clone(),
                    place: "dataWindow".to_string(),
                    rule: format!(
                        "{} x {}: must be the picture's size, {width} x {height}",
                        truth.width(),
                        truth.height()
                    ),
                }
                .into());
            }
        }
        // What the file asks for may be wrong; `all` would only skip it.
        settings.technique()?;
        for wanted in lists.iter().flatten() {
            match *wanted {
                Wanted::All => input::drawn(&scene.data)?,
                Wanted::One(request) => drop(settings.choose(Some(request), &scene.data)?),
            }
        }
        let (gpu, log) = self.device.open(self.validate)?;
        let scene = GpuScene::new(&gpu, scene);
        drop(gpu);
        // Pictures first: what the device cannot do is found before the long work, and before anything
        // is written.
        let entries = draw(&scene, &settings, &lists.concat())?;
        let computed = given.is_none();
        let truth = match given {
            Some(truth) => truth,
            None => reference::draw(scene.scene(), &settings.view, 1)?,
        };
        // The messages of the device's destruction count.
        drop(scene);

        output::make_folder(&self.output)?;
        if computed {
            write_exr(self.output.join("reference.exr"), &truth.to_image()?)?;
        }
        let mut errors = Vec::new();
        let mut rows = vec![
            ["technique", "route", "options", "rmse", "max", "bias", "p99", "p99.9", ">1/255", "ms"]
                .map(str::to_string)
                .to_vec(),
        ];
        for entry in &entries {
            let measured = ImageErrors::between_f64(&entry.image, &truth)?;
            entry.write(&self.output, &truth, settings.background)?;
            rows.push(entry.row(&measured));
            errors.push(entry.json(&measured));
        }
        output::write_json(&self.output.join("errors.json"), &Value::Array(errors))?;
        if !quiet {
            output::print(&table::aligned(&rows, &[0, 1, 2]))?;
        }
        input::silent(&log)
    }

    fn given_truth(&self) -> Result<Option<ReferenceImage>> {
        if self.against == Path::new("reference") {
            return Ok(None);
        }
        let image = read_exr(&self.against, &ReadOptions::default())?;
        let pixels = image.pixels().iter().map(|pixel| pixel.map(f64::from)).collect();
        ReferenceImage::new(image.width(), image.height(), pixels).map(Some)
    }
}

/// Draws what is wanted.
fn draw(scene: &Arc<GpuScene>, settings: &Settings, list: &[Wanted]) -> Result<Vec<Entry>> {
    let data = &scene.scene().data;
    let mut entries: Vec<Entry> = Vec::new();
    let mut skipped = None;
    for wanted in list {
        let Wanted::One(request) = *wanted else {
            for (method, route) in by_route().filter(|(method, _)| method.draws(data)) {
                let drawn = with_route(settings, method, route).and_then(|technique| {
                    Entry::draw(scene, &settings.view, technique, stem(&entries, technique))
                });
                match drawn {
                    Ok(entry) => entries.push(entry),
                    // Nobody has asked for just this one.
                    Err(error) if is_refusal(&error) => {
                        output::print(&format!("skipped: {}/{route}: {error}", method.name()))?;
                        skipped = Some(error);
                    }
                    Err(error) => return Err(error),
                }
            }
            continue;
        };
        let technique = settings.choose(Some(request), data)?;
        let stem = stem(&entries, technique);
        entries.push(Entry::draw(scene, &settings.view, technique, stem)?);
    }
    match skipped {
        Some(error) if entries.is_empty() => Err(error),
        _ => Ok(entries),
    }
}

/// A technique by one route; the scene's technique has the scene's other options.
fn with_route(settings: &Settings, method: Method, route: &str) -> Result<Technique> {
    let given = settings.choice.as_ref().filter(|choice| choice.name == method.name());
    input::by_route(method, route, given.map_or(&[], |choice| &choice.options), &[])
}

/// Whether an error says that this technique, with these options, is not for this device or scene.
pub(crate) fn is_refusal(error: &Error) -> bool {
    matches!(error, Error::Invalid { .. } | Error::Unsupported { .. } | Error::Memory { .. })
}

/// Every technique with each of its routes.
pub(crate) fn by_route() -> impl Iterator<Item = (Method, &'static str)> {
    Method::ALL.into_iter().flat_map(|method| method.routes().iter().map(move |&route| (method, route)))
}

/// A name for a technique's files that none of the entries has: `slices-3d`, then `slices-3d-2`.
fn stem(entries: &[Entry], technique: Technique) -> String {
    let method = technique.method();
    match entries.iter().filter(|entry| entry.technique.method() == method).count() {
        0 => method.name().to_string(),
        n => format!("{}-{}", method.name(), n + 1),
    }
}

impl Entry {
    fn draw(scene: &Arc<GpuScene>, view: &View, technique: Technique, stem: String) -> Result<Self> {
        let mut drawing = Renderer::new(scene, technique).frames(view)?;
        drawing.draw(view)?;
        let frames = (0..FRAMES).map(|_| drawing.draw(view)).collect::<Result<_>>()?;
        Ok(Self { technique, route: drawing.plan().route(), stem, image: drawing.read_back()?, frames })
    }

    fn write(&self, folder: &Path, truth: &ReferenceImage, background: [f64; 4]) -> Result<()> {
        let file = |ending: &str| folder.join(format!("{}.{ending}", self.stem));
        write_exr(file("exr"), &self.image)?;
        write_png(file("png"), &self.image, background)?;
        write_png(file("heat.png"), &heat_map_f64(&self.image, truth)?, [0.0, 0.0, 0.0, 1.0])
    }

    fn row(&self, errors: &ImageErrors) -> Vec<String> {
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
            Times::wall(&self.frames).map_or_else(String::new, |times| format!("{:.1}", times.median())),
        ]
    }

    fn json(&self, errors: &ImageErrors) -> Value {
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
            // Taken from the serialised form, which writes infinity in a way that JSON can hold.
            put(key, full["all"][statistic].clone());
        }
        put("above_1_255", json!(errors.above_1_255));
        for (key, times) in [("wall_ms", Times::wall(&self.frames)), ("gpu_ms", Times::gpu(&self.frames))] {
            if let Some(times) = times {
                put(key, json!(times.median()));
            }
        }
        put("errors", full);
        Value::Object(entry)
    }
}
