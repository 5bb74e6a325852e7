//! `volraster compare`: several techniques against the truth.

use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};
use volraster::io::{ReadOptions, read_exr, write_exr, write_png};
use volraster::measure::{ImageErrors, heat_map_f64};
use volraster::reference::ReferenceImage;
use volraster::scene::{Data, Scene, View};
use volraster::technique::{FrameTime, Method};
use volraster::{Error, Gpu, GpuScene, Image, Renderer, Result, Technique};

use super::cache::{Cache, Origin};
use super::case::device_bytes;
use super::input::{self, ArraysArgs, DeviceArgs, Input, Settings, Size, Wanted};
use super::report::{self, Page, Row};
use super::timing::{Spread, pass_medians};
use super::{Outcome, output, table};

/// Frames that are timed, after one that warms up.
const FRAMES: u32 = 5;

/// Arguments of `compare`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A scene file (.json) or a data file.
    #[arg(value_name = "SCENE|DATA")]
    scene: PathBuf,
    #[command(flatten)]
    arrays: ArraysArgs,
    /// Folder for pictures, error pictures, errors.json and report.html, which shows all of it in one file.
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
    /// Draw the reference anew, and keep none.
    #[arg(long)]
    no_cache: bool,
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
    /// What the frame did, where it is known.
    counters: Vec<(&'static str, u64)>,
    device_bytes: u64,
}

/// What came of a list of techniques.
struct Drawn {
    entries: Vec<Entry>,
    /// Of `all`: technique, route and why it does not draw this here.
    refused: Vec<[String; 3]>,
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
        let Input { scene, settings } = Input::load(&self.scene, self.size, &self.arrays, quiet)?;
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
                Wanted::All => input::drawn(&scene)?,
                Wanted::One(request) => drop(settings.choose(Some(request), &scene)?),
            }
        }
        let (gpu, log) = self.device.open(self.validate)?;
        let device = gpu.report().clone();
        // Pictures first: what the device cannot do is found before the long work, and before anything
        // is written.
        let Drawn { entries, refused } = draw(&gpu, &scene, &settings, &lists.concat())?;
        // The messages of the device's destruction count.
        drop(gpu);
        let (truth, origin) = match given {
            Some(truth) => (truth, None),
            None => {
                let (truth, origin) = self.reference(&scene, &settings.view)?;
                (truth, Some(origin))
            }
        };

        output::make_folder(&self.output)?;
        let picture = truth.to_image()?;
        let truth_stem = if origin.is_some() { "reference" } else { "against" };
        if origin.is_some() {
            write_exr(self.output.join("reference.exr"), &picture)?;
        }
        let truth_png = self.output.join(format!("{truth_stem}.png"));
        write_png(&truth_png, &picture, settings.background)?;
        let mut errors = Vec::new();
        let mut lines = vec![
            ["technique", "route", "options", "rmse", "max", "bias", "p99", "p99.9", ">1/255", "ms"]
                .map(str::to_string)
                .to_vec(),
        ];
        let mut rows = Vec::new();
        for entry in &entries {
            let measured = ImageErrors::between_f64(&entry.image, &truth)?;
            let pictures = entry.write(&self.output, &truth, settings.background)?;
            lines.push(entry.line(&measured));
            errors.push(entry.json(&measured));
            rows.push(entry.row(measured, pictures));
        }
        output::write_json(&self.output.join("errors.json"), &Value::Array(errors))?;
        let what = match origin {
            Some(Origin::Drawn) => "float64 reference".to_string(),
            Some(Origin::Cached) => "float64 reference, drawn before".to_string(),
            None => self.against.display().to_string(),
        };
        let [width, height] = settings.view.extent();
        let view = if settings.view.is_perspective() { "perspective" } else { "orthographic" };
        let name = self.scene.file_name().unwrap_or_default().to_string_lossy();
        let facts = vec![
            ("Scene", self.scene.display().to_string()),
            ("Data", format!("{}, {}", settings.data.display(), described(&scene.data))),
            ("View", format!("{width} × {height}, {view}")),
            ("Truth", what.clone()),
            ("Device", format!("{}, {}, Vulkan {}", device.name, device.driver, device.api)),
            ("Frames", format!("{FRAMES} timed, after one that warms up")),
            ("volraster", env!("CARGO_PKG_VERSION").to_string()),
        ];
        let truth = (read(&truth_png)?, what);
        let page = Page { title: format!("Comparison: {name}"), facts, truth, rows, refused };
        volraster::io::write_text(self.output.join("report.html"), &report::html(&page))?;
        if !quiet {
            output::print(&table::aligned(&lines, &[0, 1, 2]))?;
        }
        input::silent(&log)
    }

    /// The reference, with a bar that counts rows.
    fn reference(&self, scene: &Scene, view: &View) -> Result<(ReferenceImage, Origin)> {
        let bar = output::progress(u64::from(view.extent()[1]), "reference");
        let rows = |_: u32, _: u32| bar.inc(1);
        let image = Cache::of_user(!self.no_cache).image(scene, view, Some(&rows));
        bar.finish_and_clear();
        image
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

/// Kind and size of data.
fn described(data: &Data) -> String {
    match data {
        Data::Grid(grid) => {
            let [x, y, z] = grid.dims();
            format!("grid of {x} × {y} × {z} {}", grid.samples().type_name())
        }
        Data::Mesh(mesh) => {
            format!("mesh of {} tetrahedra, {} points", mesh.cells().len(), mesh.points().len())
        }
        Data::Points(points) => format!("{} points", points.centres().len()),
        other => other.kind().to_string(),
    }
}

fn read(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).map_err(|source| Error::Io {
        path: path.to_path_buf(),
        action: "cannot read",
        source,
    })
}

/// Draws what is wanted.
fn draw(gpu: &Gpu, scene: &Scene, settings: &Settings, list: &[Wanted]) -> Result<Drawn> {
    let mut entries: Vec<Entry> = Vec::new();
    let mut refused = Vec::new();
    let mut skipped = None;
    for wanted in list {
        let Wanted::One(request) = *wanted else {
            for (method, route) in by_route().filter(|(method, _)| method.fits(scene)) {
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
                    // Nobody has asked for just this one.
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
    /// Draws with a scene of its own, so that the memory that is counted is all that is needed.
    fn draw(gpu: &Gpu, scene: &Scene, view: &View, technique: Technique, stem: String) -> Result<Self> {
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

    /// Writes the picture and its error, and returns both as PNG.
    fn write(&self, folder: &Path, truth: &ReferenceImage, background: [f64; 4]) -> Result<[Vec<u8>; 2]> {
        let file = |ending: &str| folder.join(format!("{}.{ending}", self.stem));
        write_exr(file("exr"), &self.image)?;
        write_png(file("png"), &self.image, background)?;
        write_png(file("heat.png"), &heat_map_f64(&self.image, truth)?, [0.0, 0.0, 0.0, 1.0])?;
        Ok([read(&file("png"))?, read(&file("heat.png"))?])
    }

    /// The row of the report.
    fn row(&self, errors: ImageErrors, pictures: [Vec<u8>; 2]) -> Row {
        Row {
            stem: self.stem.clone(),
            technique: self.technique.method().name().to_string(),
            route: self.route.to_string(),
            options: input::options_text(&self.technique),
            errors,
            wall: Spread::wall(&self.frames),
            gpu: Spread::gpu(&self.frames),
            passes: pass_medians(&self.frames),
            counters: self.counters.iter().map(|(name, n)| ((*name).to_string(), *n)).collect(),
            device_bytes: self.device_bytes,
            pictures,
        }
    }

    /// The line of the table on stdout.
    fn line(&self, errors: &ImageErrors) -> Vec<String> {
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
            Spread::wall(&self.frames).map_or_else(String::new, |times| format!("{:.1}", times.median)),
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
        for (key, times) in [("wall_ms", Spread::wall(&self.frames)), ("gpu_ms", Spread::gpu(&self.frames))] {
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
