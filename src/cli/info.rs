//! `volraster info`: what a file holds, and what would be drawn of it.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde_json::{Map, Value, json};
use volraster::GridBytes;
use volraster::glam::DVec3;
use volraster::io::scene_file::{LoadedScene, SceneFile};
use volraster::io::{self, ArrayInfo, Data, Report};
use volraster::scene::{
    Anatomy, Camera, Clip, Grid, Kernel, KernelSize, Kernels, Model, Points, Projection, Shading, Surface,
    TetScalars, Tets, TransferFunction,
};
use volraster::{Error, Result};

use super::histogram::Histogram;
use super::input::{ArraysArgs, Input};
use super::table::{self, number, triple};
use super::{Outcome, output};

/// Knots that are listed; the JSON has all of them.
const LISTED_KNOTS: usize = 16;

/// Arrays that are listed; the JSON has all of them.
const LISTED_ARRAYS: usize = 32;

/// Surfaces that are listed; the JSON has all of them.
const LISTED_SURFACES: usize = 16;

/// Arguments of `info`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A data file, a folder of slices, or a scene file (.json).
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    arrays: ArraysArgs,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Args {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// What is wrong with the file.
    pub(crate) fn run(&self) -> Outcome {
        let facts = self.facts()?;
        if self.json {
            output::print_json(&Value::Object(facts.json))?;
        } else {
            output::print(&facts.text(&self.file))?;
        }
        Ok(())
    }

    fn facts(&self) -> Result<Facts> {
        let start = Instant::now();
        let reading = output::Reading::new(&self.file);
        let options = reading.tell(self.arrays.options());
        let scene = |loaded: LoadedScene| self.of_scene(&Input::new(&self.file, loaded, None, start)?);
        if SceneFile::is_at(&self.file, &options) {
            let loaded = LoadedScene::load_any(&self.file, &options)?;
            drop(reading);
            return scene(loaded);
        }
        let loaded = io::read(&self.file, &options)?;
        drop(reading);
        scene(LoadedScene::from_loaded(&self.file, loaded)?)
    }

    fn of_scene(&self, input: &Input) -> Result<Facts> {
        let Input { scene, settings } = input;
        let mut facts = Facts::new(&self.file, scene.data.kind(), &settings.data, &settings.report);
        match &scene.data {
            Data::Grid(grid) => facts.of_grid(grid, &settings.report),
            Data::Mesh(mesh) => facts.of_mesh(mesh, &settings.report),
            Data::Points(points) => facts.of_points(points, &settings.report),
            other => {
                return Err(Error::Invalid {
                    what: "data".into(),
                    why: format!("{}: unknown", other.kind()),
                });
            }
        }
        if let Some(kernels) = &scene.kernels {
            facts.kernels(kernels, matches!(scene.data, Data::Grid(_)));
        }
        facts.remarks(&settings.report);

        let extent @ [width, height] = settings.view.extent();
        let camera = settings.view.camera();
        facts.put("camera", camera_json(camera, settings.camera_is_automatic));
        facts.line("camera", camera_text(camera, settings.camera_is_automatic));
        facts.put("transfer", json!(rows(&scene.transfer)));
        facts.put("image", json!(extent));
        facts.line("image", format!("{width} x {height}"));
        facts.put("background", json!(settings.background));
        facts.surfaces(&scene.surfaces);
        facts.clip(settings.view.clip());
        if let Some(choice) = &settings.choice {
            let mut technique = Map::from_iter([("name".to_string(), json!(choice.name))]);
            technique.extend(choice.options.iter().map(|(key, value)| (key.clone(), json!(value))));
            facts.put("technique", Value::Object(technique));
            let options: Vec<String> =
                choice.options.iter().map(|(key, value)| format!("{key}={value}")).collect();
            facts.line("technique", format!("{} {}", choice.name, options.join(",")).trim_end().to_string());
        }
        facts.tail = knots_text(&scene.transfer);
        Ok(facts)
    }
}

/// What is told of a file: as JSON, and as lines of a word and a text.
struct Facts {
    json: Map<String, Value>,
    lines: Vec<(&'static str, String)>,
    /// What follows the lines.
    tail: String,
}

impl Facts {
    /// Begins with what is told of every file; `data` is the file that the data comes from.
    fn new(file: &Path, kind: &str, data: &Path, report: &Report) -> Self {
        let mut facts = Self { json: Map::new(), lines: Vec::new(), tail: String::new() };
        // A folder has no size worth telling, and a file may be gone by now.
        let size = std::fs::metadata(data).ok().filter(std::fs::Metadata::is_file);
        let size = size.map(|metadata| metadata.len());
        facts.put("file", json!(file.display().to_string()));
        facts.put("kind", json!(kind));
        facts.put("format", json!(report.format));
        facts.put("file_bytes", json!(size));
        let size = size.map_or_else(String::new, |size| format!(", {size} bytes"));
        facts.line("format", format!("{} ({kind}){size}", report.format));
        facts
    }

    fn put(&mut self, key: &str, value: Value) {
        self.json.insert(key.to_string(), value);
    }

    fn line(&mut self, word: &'static str, text: String) {
        self.lines.push((word, text));
    }

    fn of_grid(&mut self, grid: &Grid, report: &Report) {
        self.lattice(grid);
        self.values(grid.range(), grid.nan_count(), grid.infinite_count(), &Histogram::of(grid));
        self.arrays(report);
        let device = GridBytes::of(grid);
        self.put(
            "device_bytes",
            json!({
                "volume": device.volume, "stack": device.stack, "stacks": device.stacks, "bricks": device.bricks,
            }),
        );
        self.line(
            "on device",
            format!(
                "{} bytes (slices-3d, slabs, raycast), {} (slices-2d and shear-warp, {} with stacks=all); bricks {} more",
                device.volume, device.stack, device.stacks, device.bricks
            ),
        );
    }

    fn of_mesh(&mut self, mesh: &Tets, report: &Report) {
        let (points, cells) = (mesh.points().len(), mesh.cells().len());
        let values = mesh.scalars().values();
        let (of, each) = match mesh.scalars() {
            TetScalars::Point(_) => ("point", "a scalar at each point"),
            TetScalars::Cell(_) => ("cell", "a scalar in each cell"),
        };
        let bytes = 24 * points + 16 * cells + 4 * values.len();
        self.put("points", json!(points));
        self.put("tetrahedra", json!(cells));
        self.put("scalars", json!(of));
        self.put("type", json!("f32"));
        self.put("bytes", json!(bytes));
        self.put("vacuum", json!(mesh.blank_count()));
        self.line("points", format!("{points}, {cells} tetrahedra, {bytes} bytes"));
        self.line("scalars", format!("f32, {each}"));
        self.line("vacuum", format!("{} tetrahedra", mesh.blank_count()));
        self.bounds(mesh.bounds());
        self.scalars(mesh.range(), values);
        self.arrays(report);
        self.geometry(12 * points + 16 * cells + 4 * values.len());
    }

    fn of_points(&mut self, points: &Points, report: &Report) {
        let count = points.centres().len();
        let lists = points.scalars().map_or(0, |_| 4) + points.weights().map_or(0, |_| 4);
        let (kernel, extra) = match points.size() {
            KernelSize::Unknown => (json!({"kind": "unknown"}), 0),
            KernelSize::Radius(radius) => (json!({"kind": "radius", "radius": radius}), 0),
            KernelSize::Radii(radii) => (json!({"kind": "radii", "range": range_of(radii)}), 4),
            KernelSize::Covariances(_) => (json!({"kind": "covariances"}), 24),
        };
        let bytes = count * (24 + lists + extra);
        self.put("points", json!(count));
        self.put("type", json!("f32"));
        self.put("bytes", json!(bytes));
        self.line("points", format!("{count}, {bytes} bytes"));
        self.line(
            "kernels",
            match points.size() {
                KernelSize::Unknown => "of unknown size".to_string(),
                KernelSize::Radius(radius) => format!("radius {}", number(*radius)),
                KernelSize::Radii(radii) => format!("radii {}", range_text(radii)),
                KernelSize::Covariances(_) => "covariances".to_string(),
            },
        );
        self.put("kernel", kernel);
        self.put("weights", points.weights().map_or(Value::Null, |weights| json!(range_of(weights))));
        self.line("weights", points.weights().map_or_else(|| "1 each".to_string(), range_text));
        self.bounds(points.bounds());
        match points.scalars() {
            Some(scalars) => self.scalars(points.range(), scalars),
            None => {
                self.values(
                    points.range(),
                    0,
                    0,
                    &Histogram { first: 1.0, width: 1.0, counts: vec![count as u64] },
                );
            }
        }
        self.arrays(report);
        self.geometry(count * (12 + lists + extra));
    }

    /// Kernels that a scene asks for.
    fn kernels(&mut self, kernels: &Kernels, on_grid: bool) {
        let Kernels { kernel, sigma, cut, model, least } = *kernels;
        let mut json = Map::from_iter([
            ("kernel".to_string(), json!(kernel.name())),
            ("model".to_string(), json!(model.name())),
        ]);
        let numbers = [
            ("sigma", sigma, kernel == Kernel::Gaussian && on_grid),
            ("cut", cut, kernel == Kernel::Gaussian),
            ("least", least, model == Model::Interpolate),
        ];
        let mut text = format!("{}, {}", kernel.name(), model.name());
        for (name, value, _) in numbers.into_iter().filter(|(.., counts)| *counts) {
            json.insert(name.to_string(), json!(value));
            // Writing into a string cannot fail.
            let _ = write!(text, ", {name} {}", number(value));
        }
        self.put("kernels", Value::Object(json));
        self.line("field", text);
    }

    /// Triangle meshes in the volume.
    fn surfaces(&mut self, surfaces: &[Surface]) {
        let shade = |surface: &Surface| match surface.shading() {
            Shading::Flat => "flat",
            Shading::Headlight => "headlight",
        };
        let json_of = |surface: &Surface| {
            let [r, g, b, opacity] = surface.colour();
            json!({
                "points": surface.points().len(), "triangles": surface.triangles().len(),
                "bounds": surface.bounds().map(|bounds| bounds.map(|corner| corner.to_array())),
                "colour": [r, g, b], "opacity": opacity, "shade": shade(surface),
            })
        };
        self.put("surfaces", Value::Array(surfaces.iter().map(json_of).collect()));
        for (i, surface) in surfaces.iter().take(LISTED_SURFACES).enumerate() {
            let [r, g, b, opacity] = surface.colour();
            let bounds = surface
                .bounds()
                .map_or_else(String::new, |[low, high]| format!(", {} to {}", triple(low), triple(high)));
            let text = format!(
                "{} triangles{bounds}, colour {}, opacity {}, {}",
                surface.triangles().len(),
                triple(DVec3::new(r, g, b)),
                number(opacity),
                shade(surface)
            );
            self.line(if i == 0 { "surfaces" } else { "" }, text);
        }
        if surfaces.len() > LISTED_SURFACES {
            self.line("", format!("and {} more", surfaces.len() - LISTED_SURFACES));
        }
    }

    /// What is cut away, if anything is.
    fn clip(&mut self, clip: &Clip) {
        // JSON has no infinite numbers: a side that cuts nothing is null.
        let planes: Vec<Value> = clip
            .planes()
            .map(|plane| json!({"point": plane.point.to_array(), "normal": plane.normal.to_array()}))
            .collect();
        let crop = clip.crop().map(|[low, high]| json!({"low": low.to_array(), "high": high.to_array()}));
        let is_none = planes.is_empty() && crop.is_none();
        self.put("clip", if is_none { Value::Null } else { json!({"planes": planes, "crop": crop}) });
        let planes = clip
            .planes()
            .map(|plane| format!("plane through {} along {}", triple(plane.point), triple(plane.normal)));
        let crop = clip.crop().map(|[low, high]| format!("box {} to {}", bounds(low), bounds(high)));
        for (i, text) in planes.chain(crop).enumerate() {
            self.line(if i == 0 { "kept" } else { "" }, text);
        }
    }

    /// Size, type and place of a grid.
    fn lattice(&mut self, grid: &Grid) {
        let samples = grid.samples();
        let [nx, ny, nz] = grid.dims();
        let bytes = samples.len() * samples.sample_bytes();
        let m = grid.index_to_world();
        let axes = [m.x_axis, m.y_axis, m.z_axis].map(DVec3::normalize_or_zero);
        let anatomy = anatomy(grid.anatomy());
        let rescale = grid.rescale();
        self.put("dims", json!(grid.dims()));
        self.put("type", json!(samples.type_name()));
        self.put("bytes", json!(bytes));
        self.put("spacing", json!(grid.spacing().to_array()));
        self.put("origin", json!(grid.origin().to_array()));
        self.put("axes", json!(axes.map(|axis| axis.to_array())));
        self.put("anatomy", json!(anatomy));
        self.put("rescale", json!({"slope": rescale.slope, "intercept": rescale.intercept}));
        self.line("samples", format!("{nx} x {ny} x {nz}, {}, {bytes} bytes", samples.type_name()));
        self.line("spacing", triple(grid.spacing()));
        self.line("size", triple(grid.spacing() * grid.last_index()));
        self.line("origin", triple(grid.origin()));
        let [x, y, z] = axes.map(triple);
        self.line("axes", format!("x {x}; y {y}; z {z}"));
        self.line("anatomy", anatomy.to_string());
        let corners = grid.corners();
        let all = |f: fn(DVec3, DVec3) -> DVec3| corners.into_iter().reduce(f).unwrap_or_default();
        self.bounds([all(DVec3::min), all(DVec3::max)]);
        if (rescale.slope, rescale.intercept) != (1.0, 0.0) {
            self.line("rescale", format!("value = {} * stored + {}", rescale.slope, rescale.intercept));
        }
    }

    fn bounds(&mut self, [low, high]: [DVec3; 2]) {
        self.put("bounds", json!([low.to_array(), high.to_array()]));
        self.line("bounds", format!("{} to {}", triple(low), triple(high)));
    }

    /// Scalars of a mesh or of points.
    fn scalars(&mut self, range: [f64; 2], values: &[f32]) {
        let nan = values.iter().filter(|value| value.is_nan()).count();
        let infinite = values.iter().filter(|value| value.is_infinite()).count();
        self.values(range, nan, infinite, &Histogram::of_values(range, values));
    }

    fn values(&mut self, [lo, hi]: [f64; 2], nan: usize, infinite: usize, histogram: &Histogram) {
        let Histogram { first, width, counts } = histogram;
        self.put("range", json!([lo, hi]));
        self.put("nan", json!(nan));
        self.put("infinite", json!(infinite));
        self.put("histogram", json!({"first": first, "width": width, "counts": counts}));
        self.line("range", format!("{} to {}", number(lo), number(hi)));
        self.line("NaN", nan.to_string());
        self.line("infinite", infinite.to_string());
        self.line("histogram", format!("|{}| logarithmic", histogram.sketch()));
    }

    /// The arrays of the file, and which is shown.
    fn arrays(&mut self, report: &Report) {
        let shown = shown(report);
        let json_of = |(i, array): (usize, &ArrayInfo)| {
            json!({
                "name": array.name, "association": array.association.name(), "type": array.kind.name(),
                "components": array.components, "shown": shown == Some(i),
            })
        };
        let all: Vec<Value> = report.arrays.iter().enumerate().map(json_of).collect();
        self.put("arrays", Value::Array(all));
        self.put("shown", json!(report.shown));
        for (i, array) in report.arrays.iter().take(LISTED_ARRAYS).enumerate() {
            let mark = match &report.shown {
                Some(name) if shown == Some(i) => format!(", shown as {name}"),
                _ => String::new(),
            };
            self.line(if i == 0 { "arrays" } else { "" }, format!("{array}{mark}"));
        }
        if report.arrays.len() > LISTED_ARRAYS {
            self.line("", format!("and {} more", report.arrays.len() - LISTED_ARRAYS));
        }
    }

    /// What the corners and scalars of a mesh, or the points, take on the device at least.
    fn geometry(&mut self, bytes: usize) {
        self.put("device_bytes", json!({"geometry": bytes}));
        self.line("on device", format!("{bytes} bytes at least (geometry and scalars in 32 bits)"));
    }

    fn remarks(&mut self, report: &Report) {
        self.put("notes", json!(report.notes));
        self.put("warnings", json!(report.warnings));
        for note in &report.notes {
            self.line("note", note.clone());
        }
        for warning in &report.warnings {
            self.line("warning", warning.clone());
        }
    }

    fn text(&self, file: &Path) -> String {
        let width = self.lines.iter().map(|(word, _)| word.len()).max().unwrap_or(0);
        let mut text = output::plain(&file.display().to_string());
        for (word, line) in &self.lines {
            // Writing into a string cannot fail.
            let _ = write!(text, "\n  {word:<width$}  {}", output::plain(line));
        }
        text.push_str(&self.tail);
        text
    }
}

/// The place of the array that is shown: the one with the longest name that fits.
fn shown(report: &Report) -> Option<usize> {
    let shown = report.shown.as_deref()?;
    let fits = |array: &ArrayInfo| {
        let rest = shown.strip_prefix(array.association.name())?.strip_prefix(':')?;
        let rest = rest.strip_prefix(array.name.as_str())?;
        (rest.is_empty() || rest.starts_with(':')).then_some(array.name.len())
    };
    let lengths = report.arrays.iter().enumerate().filter_map(|(i, array)| Some((fits(array)?, i)));
    // Of equal names the first is the one that readers find.
    lengths.max_by_key(|&(length, i)| (length, std::cmp::Reverse(i))).map(|(_, i)| i)
}

/// Smallest and largest finite value, if there is one.
fn range_of(values: &[f32]) -> Option<[f32; 2]> {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    Some([finite().reduce(f32::min)?, finite().reduce(f32::max)?])
}

fn range_text(values: &[f32]) -> String {
    match range_of(values) {
        Some([lo, hi]) => format!("{} to {}", number(f64::from(lo)), number(f64::from(hi))),
        None => "none finite".to_string(),
    }
}

fn anatomy(anatomy: Anatomy) -> &'static str {
    match anatomy {
        Anatomy::Unknown => "unknown",
        Anatomy::Ras => "right-anterior-superior",
        Anatomy::Lps => "left-posterior-superior",
        Anatomy::Las => "left-anterior-superior",
    }
}

fn rows(transfer: &TransferFunction) -> Vec<[f64; 5]> {
    transfer.knots().iter().map(|k| [k.s, k.colour.x, k.colour.y, k.colour.z, k.tau]).collect()
}

fn knots_text(transfer: &TransferFunction) -> String {
    let knots = rows(transfer);
    let mut text =
        format!("\n  transfer function of {} knots: value, red, green, blue, extinction", knots.len());
    let listed: Vec<Vec<String>> =
        knots.iter().take(LISTED_KNOTS).map(|row| row.iter().map(|&n| number(n)).collect()).collect();
    for line in table::aligned(&listed, &[]).lines() {
        let _ = write!(text, "\n    {line}");
    }
    if knots.len() > LISTED_KNOTS {
        let _ = write!(text, "\n    and {} more", knots.len() - LISTED_KNOTS);
    }
    text
}

/// A corner of a crop box; `-` where it cuts nothing.
fn bounds(corner: DVec3) -> String {
    let [x, y, z] =
        corner.to_array().map(|bound| if bound.is_finite() { number(bound) } else { "-".to_string() });
    format!("[{x}, {y}, {z}]")
}

fn camera_json(camera: &Camera, automatic: bool) -> Value {
    let mut json = json!({
        "eye": camera.eye.to_array(),
        "target": camera.target.to_array(),
        "up": camera.up.to_array(),
        "automatic": automatic,
    });
    match camera.projection {
        Projection::Perspective { fov_y_deg } => json["fov_y_deg"] = json!(fov_y_deg),
        Projection::Orthographic { half_height } => json["half_height"] = json!(half_height),
    }
    json
}

fn camera_text(camera: &Camera, automatic: bool) -> String {
    let projection = match camera.projection {
        Projection::Perspective { fov_y_deg } => format!("fov_y_deg {}", number(fov_y_deg)),
        Projection::Orthographic { half_height } => format!("half_height {}", number(half_height)),
    };
    let origin = if automatic { " (automatic)" } else { "" };
    let [eye, target, up] = [camera.eye, camera.target, camera.up].map(triple);
    format!("eye {eye}, target {target}, up {up}, {projection}{origin}")
}
