//! What several commands take: a scene, an image size, techniques, a device.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use serde_json::{Map, Value};
use volraster::gpu::{GpuOptions, Validation, ValidationLog};
use volraster::io::scene_file::{LoadedScene, TechniqueChoice};
use volraster::io::{ReadOptions, Report};
use volraster::scene::{Data, Scene, Surface, View};
use volraster::technique::Method;
use volraster::{Error, Gpu, Result, Technique};

use super::{Failure, output};

/// Which device draws, and under which checks.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct DeviceArgs {
    /// Part of the device's name, case ignored; wins over the environment's `VOLRASTER_DEVICE`.
    #[arg(long, value_name = "NAME")]
    pub(crate) device: Option<String>,
}

impl DeviceArgs {
    /// Opens the device. The log outlives it.
    ///
    /// # Errors
    ///
    /// As [`Gpu::new`].
    pub(crate) fn open(&self, validate: bool) -> Result<(Gpu, Arc<ValidationLog>)> {
        let validation = if validate { Validation::On } else { Validation::Off };
        let gpu = Gpu::new(&GpuOptions { device: self.device.clone(), validation, ..GpuOptions::default() })?;
        let log = gpu.validation_log();
        Ok((gpu, log))
    }
}

/// A finding, when the validation layers said anything. To be asked when the device is gone: the
/// messages of its destruction count.
///
/// # Errors
///
/// [`Failure::Finding`] with the number of messages.
pub(crate) fn silent(log: &ValidationLog) -> std::result::Result<(), Failure> {
    match log.messages().len() {
        0 => Ok(()),
        1 => Err(Failure::Finding("the validation layers gave 1 message".to_string())),
        n => Err(Failure::Finding(format!("the validation layers gave {n} messages"))),
    }
}

/// An image size on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Size {
    /// Pixels in a row.
    pub(crate) width: u32,
    /// Rows.
    pub(crate) height: u32,
}

impl Size {
    /// Reads `WxH`.
    ///
    /// # Errors
    ///
    /// The rule, for clap to name option and value.
    pub(crate) fn parse(text: &str) -> std::result::Result<Self, String> {
        let side = |text: &str| text.parse().ok().filter(|side| (1..=View::MAX_SIDE).contains(side));
        text.split_once('x')
            .and_then(|(width, height)| Some(Self { width: side(width)?, height: side(height)? }))
            .ok_or_else(|| format!("must be WIDTHxHEIGHT, each 1 to {}", View::MAX_SIDE))
    }
}

/// Reads a finite number.
///
/// # Errors
///
/// The rule, for clap to name option and value.
pub(crate) fn finite(text: &str) -> std::result::Result<f64, String> {
    text.parse().ok().filter(|n: &f64| n.is_finite()).ok_or_else(|| "must be a finite number".to_string())
}

/// Which arrays of a file are read. They win over a scene file's.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct ArraysArgs {
    /// The array to show, where a file has several; `info` lists them. PART is a component (0, 1, ..., or a
    /// letter of xyzw or rgba) or `magnitude`. Wins over a scene file's.
    #[arg(long, value_name = "[point:|cell:]NAME[:PART]")]
    array: Option<String>,
    /// Of points: the array of support radii. Without any size one is estimated from the spacing.
    #[arg(long, value_name = "NAME", conflicts_with = "covariance")]
    radius: Option<String>,
    /// Of points: the array of covariances, of 6 components (xx, xy, xz, yy, yz, zz) or 9.
    #[arg(long, value_name = "NAME")]
    covariance: Option<String>,
    /// Of points: the array of weights.
    #[arg(long, value_name = "NAME")]
    weight: Option<String>,
}

impl ArraysArgs {
    /// What a reader is asked for.
    pub(crate) fn options(&self) -> ReadOptions {
        ReadOptions {
            radius: self.radius.clone(),
            covariance: self.covariance.clone(),
            weight: self.weight.clone(),
            array: self.array.clone(),
            ..ReadOptions::default()
        }
    }

    /// The first array that is asked for, with the option's name.
    pub(crate) fn first(&self) -> Option<(&'static str, &str)> {
        let all = [
            ("array", &self.array),
            ("radius", &self.radius),
            ("covariance", &self.covariance),
            ("weight", &self.weight),
        ];
        all.into_iter().find_map(|(name, array)| Some((name, array.as_deref()?)))
    }
}

/// A scene, and how to draw it. Two parts, since the scene goes to the device and is large.
#[derive(Debug)]
pub(crate) struct Input {
    /// Data and transfer function.
    pub(crate) scene: Scene,
    /// Everything else.
    pub(crate) settings: Settings,
}

/// How a scene is to be drawn.
#[derive(Debug)]
pub(crate) struct Settings {
    /// The file.
    path: PathBuf,
    /// The file that the data comes from.
    pub(crate) data: PathBuf,
    /// How it was read.
    pub(crate) report: Report,
    /// The camera with the image size in force.
    pub(crate) view: View,
    /// Whether the camera was chosen for the data.
    pub(crate) camera_is_automatic: bool,
    /// What PNG output is composited over.
    pub(crate) background: [f64; 4],
    /// The technique that the file asks for.
    pub(crate) choice: Option<TechniqueChoice>,
    /// Time that reading took, in milliseconds.
    pub(crate) load_ms: f64,
}

impl Input {
    /// Reads a scene file or a data file, with a bar, and says what may not be as it seems. For another image
    /// size an automatic camera is chosen again.
    ///
    /// # Errors
    ///
    /// As [`LoadedScene::load_any`] and [`View::new`].
    pub(crate) fn load(path: &Path, size: Option<Size>, arrays: &ArraysArgs, quiet: bool) -> Result<Self> {
        let reading = output::Reading::new(path);
        let input = Self::load_within(path, size, &reading.tell(arrays.options()))?;
        drop(reading);
        if !quiet {
            output::warn(&input.settings.data, &input.settings.report.warnings);
        }
        Ok(input)
    }

    /// The same without a word.
    ///
    /// # Errors
    ///
    /// As [`Input::load`].
    pub(crate) fn load_within(path: &Path, size: Option<Size>, options: &ReadOptions) -> Result<Self> {
        let start = Instant::now();
        let loaded = LoadedScene::load_any(path, options)?;
        Self::new(path, loaded, size, start)
    }

    /// What was read, with the image size in force.
    ///
    /// # Errors
    ///
    /// As [`View::new`].
    pub(crate) fn new(path: &Path, loaded: LoadedScene, size: Option<Size>, start: Instant) -> Result<Self> {
        let Size { width, height } = size.unwrap_or(Size { width: loaded.width, height: loaded.height });
        let view = loaded.view(width, height).map_err(|error| error.in_file(path))?;
        let LoadedScene { scene, camera_is_automatic, background, technique, file, report, .. } = loaded;
        let settings = Settings {
            path: path.to_path_buf(),
            data: file,
            report,
            view,
            camera_is_automatic,
            background,
            choice: technique,
            load_ms: milliseconds(start),
        };
        Ok(Self { scene, settings })
    }
}

impl Settings {
    /// The technique that the file asks for, if it does.
    ///
    /// # Errors
    ///
    /// [`Error::File`] naming the scene file and what is wrong.
    pub(crate) fn technique(&self) -> Result<Option<Technique>> {
        let Some(choice) = &self.choice else { return Ok(None) };
        let technique = Method::from_name(&choice.name).and_then(|m| Technique::new(m, &choice.options));
        technique.map(Some).map_err(|error| error.in_file(&self.path))
    }

    /// The technique to draw with: the one asked for, else the file's, else the default for the scene. Asked for
    /// by its bare name, the file's technique keeps the file's options.
    ///
    /// # Errors
    ///
    /// As [`Settings::technique`] and [`drawn`]; [`Error::Invalid`] if it does not draw the scene's data or kernels.
    pub(crate) fn choose(&self, request: Option<Request>, scene: &Scene) -> Result<Technique> {
        let own = || self.technique().transpose();
        let technique = match request {
            None => own().unwrap_or_else(|| default_technique(scene))?,
            Some(Request { technique, bare }) => {
                let name = technique.method().name();
                let same = bare && self.choice.as_ref().is_some_and(|choice| choice.name == name);
                own().filter(|_| same).unwrap_or(Ok(technique))?
            }
        };
        let method = technique.method();
        if method.draws_scene(scene) {
            return Ok(technique);
        }
        drawn(scene)?;
        let others: Vec<&str> =
            Method::ALL.into_iter().filter(|m| m.draws_scene(scene)).map(Method::name).collect();
        let why =
            format!("\"{}\": draws no {}; {} would", method.name(), described(scene), others.join(", "));
        Err(Error::Invalid { what: "technique".to_string(), why })
    }
}

/// The kind of data, of its kernels where it has some of its own, and surfaces that not all techniques draw.
fn described(scene: &Scene) -> String {
    let kind = scene.data.kind();
    let surfaces = match scene.surfaces.iter().any(Surface::is_translucent) {
        true => " with translucent surfaces",
        false => "",
    };
    scene.kernels.map_or_else(
        || format!("{kind}{surfaces}"),
        |kernels| format!("{kind} of {} kernels{surfaces}", kernels.kernel.name()),
    )
}

/// The technique that draws a scene where none is asked for.
///
/// # Errors
///
/// As [`drawn`].
fn default_technique(scene: &Scene) -> Result<Technique> {
    drawn(scene)?;
    Method::default_for(scene).map_or_else(|| Ok(Technique::default()), |method| Technique::new(method, &[]))
}

/// Nothing, if a technique draws a scene.
///
/// # Errors
///
/// [`Error::Invalid`] if none does.
pub(crate) fn drawn(scene: &Scene) -> Result<()> {
    if Method::default_for(scene).is_some() {
        return Ok(());
    }
    let why = format!("no technique draws data of this kind: {}; `reference` does", described(scene));
    Err(Error::Invalid { what: "technique".to_string(), why })
}

/// Most samples that are splatted unasked where other techniques draw the same field in a hundredth of the time.
const MOST_SPLATS: u64 = 1 << 18;

/// Why a technique is not tried unasked on data without kernels of its own: it would take too long.
pub(crate) fn too_many_splats(method: Method, data: &Data) -> Option<String> {
    let count = match data {
        Data::Grid(grid) if method == Method::SplatSheets => {
            grid.dims().into_iter().map(u64::from).product::<u64>()
        }
        _ => 0,
    };
    let why = || format!("{count} samples without kernels: it is tried unasked up to {MOST_SPLATS}");
    (count > MOST_SPLATS).then(why)
}

/// One word of a list of techniques.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Wanted {
    /// `all`: every technique by every route.
    All,
    /// One technique.
    One(Request),
}

/// A technique as the command line names it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Request {
    /// The technique, with defaults where no option is given.
    pub(crate) technique: Technique,
    /// Whether no option is given.
    pub(crate) bare: bool,
}

impl Request {
    /// Reads `NAME[:key=value,...]`.
    ///
    /// # Errors
    ///
    /// As [`Technique::parse`].
    pub(crate) fn parse(text: &str) -> Result<Self> {
        Ok(Self { technique: Technique::parse(text)?, bare: !text.contains(':') })
    }
}

impl Wanted {
    /// Reads several, separated by `;` or `,`. What has `=` and no `:` is an option of the technique
    /// before it.
    ///
    /// # Errors
    ///
    /// As [`Technique::parse`].
    pub(crate) fn parse_list(text: &str) -> Result<Vec<Self>> {
        let mut words: Vec<String> = Vec::new();
        for part in text.split(';') {
            let first = words.len();
            for word in part.split(',').map(str::trim).filter(|word| !word.is_empty()) {
                match words.get_mut(first..).and_then(<[String]>::last_mut) {
                    Some(last) if word.contains('=') && !word.contains(':') => {
                        last.push(if last.contains(':') { ',' } else { ':' });
                        last.push_str(word);
                    }
                    _ => words.push(word.to_string()),
                }
            }
        }
        if words.is_empty() {
            return Err(Error::Invalid {
                what: "techniques".to_string(),
                why: format!("\"{text}\": must name at least one technique"),
            });
        }
        let read =
            |word: &String| if word == "all" { Ok(Self::All) } else { Request::parse(word).map(Self::One) };
        words.iter().map(read).collect()
    }
}

/// A technique with given options, of which some are set anew.
///
/// # Errors
///
/// As [`Technique::new`].
pub(crate) fn with_options(
    method: Method,
    given: &[(String, String)],
    more: &[(&str, &str)],
) -> Result<Technique> {
    let mut options: Vec<(String, String)> =
        given.iter().filter(|(key, _)| !more.iter().any(|(k, _)| k == key)).cloned().collect();
    options.extend(more.iter().map(|(key, value)| ((*key).to_string(), (*value).to_string())));
    Technique::new(method, &options)
}

/// A technique by one route, as [`with_options`]. A technique of a single route may not have that as an option.
///
/// # Errors
///
/// As [`Technique::new`].
pub(crate) fn by_route(
    method: Method,
    route: &str,
    given: &[(String, String)],
    more: &[(&str, &str)],
) -> Result<Technique> {
    let named = method.options().iter().any(|info| info.key == "route");
    let route = named.then_some(("route", route));
    with_options(method, given, &more.iter().copied().chain(route).collect::<Vec<_>>())
}

/// Options as JSON, numbers and truth values as such.
pub(crate) fn options_json(technique: &Technique) -> Value {
    let typed = |text: String| match serde_json::from_str(&text) {
        Ok(value @ (Value::Number(_) | Value::Bool(_))) => value,
        _ => Value::String(text),
    };
    let pairs = technique.option_pairs().into_iter();
    Value::Object(pairs.map(|(key, text)| (key.to_string(), typed(text))).collect::<Map<_, _>>())
}

/// The options that differ from their defaults, as the command line takes them; `route` is left out,
/// since it is told on its own.
pub(crate) fn options_text(technique: &Technique) -> String {
    let infos = technique.method().options();
    let is_default =
        |key: &str, value: &str| infos.iter().any(|info| info.key == key && info.default == value);
    let pairs = technique.option_pairs().into_iter();
    let told: Vec<String> = pairs
        .filter(|(key, value)| *key != "route" && !is_default(key, value))
        .map(|(key, value)| format!("{key}={value}"))
        .collect();
    told.join(",")
}

/// Milliseconds since a moment.
pub(crate) fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_two_sides_in_range() {
        assert_eq!(Size::parse("64x48"), Ok(Size { width: 64, height: 48 }));
        for wrong in ["64", "0x48", "64x", "64x48x2", "-1x5", "64X48", "32769x1"] {
            assert!(Size::parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn lists_of_techniques_split_at_semicolons_and_names() {
        let text = |wanted: &Wanted| match wanted {
            Wanted::All => "all".to_string(),
            Wanted::One(request) => format!("{}{}", request.bare, options_text(&request.technique)),
        };
        let texts =
            |list: &str| -> Vec<String> { Wanted::parse_list(list).unwrap().iter().map(text).collect() };
        assert_eq!(texts("all, slices-3d:step=2"), ["all", "falsestep=2"]);
        assert_eq!(texts("slices-3d"), ["true"]);
        assert_eq!(
            texts("slices-3d,slices-3d:step=0.5,filter=exact,slices-3d"),
            ["true", "falsestep=0.5,filter=exact", "true"]
        );
        assert_eq!(texts("slices-3d:step=2;slices-3d"), ["falsestep=2", "true"]);
        let why = |list: &str| Wanted::parse_list(list).unwrap_err().to_string();
        assert!(why(";,").contains("at least one"));
        assert!(why("step=1").contains("step=1"));
        assert!(why("slices-3d;step=1").contains("step=1"));
    }

    #[test]
    fn a_technique_draws_the_data_or_is_refused() {
        let read = |name: &str, json: &str| {
            let path =
                std::env::temp_dir().join(format!("volraster-input-{}-{name}.json", std::process::id()));
            std::fs::write(&path, json).unwrap();
            let input = Input::load_within(&path, None, &ReadOptions::default());
            std::fs::remove_file(&path).unwrap();
            input.unwrap()
        };
        let grid = read(
            "grid",
            r#"{"volume": {"field": "ramp", "dims": [2,2,2]}, "technique": {"name": "slabs", "step": 2}}"#,
        );
        let mesh = read("mesh", r#"{"mesh": {"field": "ramp", "cubes": 1}}"#);
        let choose = |input: &Input, text: Option<&str>| {
            input.settings.choose(text.map(|text| Request::parse(text).unwrap()), &input.scene)
        };
        let text = |technique: Technique| (technique.method().name(), options_text(&technique));
        assert_eq!(text(choose(&grid, None).unwrap()), ("slabs", "step=2".into()));
        assert_eq!(text(choose(&grid, Some("slabs")).unwrap()), ("slabs", "step=2".into()));
        assert_eq!(
            text(choose(&grid, Some("slabs:filter=exact")).unwrap()),
            ("slabs", "filter=exact".into())
        );
        assert_eq!(text(choose(&grid, Some("raycast")).unwrap()), ("raycast", String::new()));
        assert_eq!(default_technique(&grid.scene).unwrap(), Technique::default());
        let why = choose(&mesh, Some("slabs")).unwrap_err().to_string();
        assert!(why.contains("mesh"), "{why}");
        assert!(choose(&mesh, None).unwrap().method().draws(&mesh.scene.data));
        let points = read("points", r#"{"points": {"field": "ramp", "count": 10}}"#);
        assert_eq!(choose(&points, None).unwrap().method().name(), "splat-ewa");
        // What knows no kernels is not chosen for them, and refused.
        let kernels = |data: &str, kernel: &str| {
            read(kernel, &format!(r#"{{{data}, "kernels": {{"kernel": "{kernel}"}}}}"#))
        };
        let (of_mesh, of_grid) =
            (r#""mesh": {"field": "ramp", "cubes": 1}"#, r#""volume": {"field": "ramp", "dims": [2,2,2]}"#);
        let gaussian = kernels(of_mesh, "gaussian");
        assert_eq!(choose(&gaussian, None).unwrap().method().name(), "splat-ewa");
        let bspline = kernels(of_grid, "bspline");
        assert_eq!(choose(&bspline, None).unwrap().method().name(), "splat-sheets");
        for name in ["slices-3d", "raycast", "splat-ewa"] {
            let why = choose(&bspline, Some(name)).unwrap_err().to_string();
            assert!(why.contains("no grid of bspline kernels; splat-sheets would"), "{why}");
        }
        let why = choose(&kernels(of_mesh, "bspline"), None).unwrap_err().to_string();
        assert!(why.contains("no technique draws data of this kind: mesh of bspline kernels"), "{why}");
    }

    #[test]
    fn options_keep_their_types() {
        let technique = Technique::parse("slices-3d:step=0.5").unwrap();
        let json = options_json(&technique);
        assert_eq!(json["step"], 0.5);
        assert_eq!(json["filter"], "hardware");
        let changed =
            with_options(technique.method(), &[("step".into(), "4".into())], &[("step", "2")]).unwrap();
        assert_eq!(options_json(&changed)["step"], 2.0);
    }
}
