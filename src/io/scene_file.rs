//! The scene file: JSON that names the data and says how to look at it.
//!
//! Unknown keys are errors that name the allowed ones. Paths are relative to the scene file.

mod clip;
mod kernels;
mod mesh;
mod points;
mod surfaces;
mod transfer;
mod volume;

use std::fmt;
use std::path::{Path, PathBuf};

use clip::ClipSpec;
use glam::DVec3;
use kernels::{KernelsSpec, Kind};
use mesh::MeshSpec;
use points::PointsSpec;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use surfaces::SurfaceSpec;
use transfer::{Recipe, TransferSpec};
use volume::VolumeSpec;

use crate::error::{Error, Result};
use crate::io::{self, Data, Loaded, ReadOptions, Report};
use crate::num;
use crate::scene::{
    Camera, Clip, KernelSize, Kernels, Points, Projection, Scene, Surface, TransferFunction, View, auto,
};

pub use transfer::{PRESETS, Preset};

/// A technique's name and options, as a scene file or a command line gives them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TechniqueChoice {
    /// The technique.
    pub name: String,
    /// Names and values of its options, in the order in which they were given.
    pub options: Vec<(String, String)>,
}

/// Everything that a picture needs, read and checked.
#[derive(Clone, Debug)]
pub struct LoadedScene {
    /// Data, transfer function and surfaces.
    pub scene: Scene,
    /// What of the volume is cut away.
    pub clip: Clip,
    /// The camera.
    pub camera: Camera,
    /// Whether the camera was chosen for the data; for another image size it should be chosen again, by
    /// [`auto::camera`].
    pub camera_is_automatic: bool,
    /// Width of the image, in pixels.
    pub width: u32,
    /// Height of the image, in pixels.
    pub height: u32,
    /// What PNG output is composited over: straight linear RGBA.
    pub background: [f64; 4],
    /// The technique that the file asks for.
    pub technique: Option<TechniqueChoice>,
    /// The file that the data comes from; for an analytic field the scene file.
    pub file: PathBuf,
    /// How the data was read.
    pub report: Report,
}

impl LoadedScene {
    /// Image side where nothing is said.
    pub const DEFAULT_SIDE: u32 = 512;
    /// Background where nothing is said: opaque black.
    pub const DEFAULT_BACKGROUND: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

    /// A data file alone, with a camera and a transfer function chosen for it, and a radius for points of unknown size.
    ///
    /// # Errors
    ///
    /// As [`io::read`] and [`Self::from_loaded`].
    pub fn from_data(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Self> {
        let path = path.as_ref();
        Self::from_loaded(path, io::read(path, options)?)
    }

    /// The same for data that has been read. `path` is for messages.
    ///
    /// # Errors
    ///
    /// [`Error::File`] if no camera or no transfer function can be chosen for it.
    pub fn from_loaded(path: impl AsRef<Path>, loaded: Loaded) -> Result<Self> {
        let path = path.as_ref();
        Self::assemble(path, Source::new(path, loaded), Rest::default())
    }

    /// A data file or a scene file: what ends in `.json` is a scene file, unless it describes raw samples.
    ///
    /// # Errors
    ///
    /// As [`SceneFile::load`] and [`LoadedScene::from_data`].
    pub fn load_any(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Self> {
        let path = path.as_ref();
        if SceneFile::is_at(path, options) {
            SceneFile::load(path, options)
        } else {
            Self::from_data(path, options)
        }
    }

    /// The view of an image of a size: an automatic camera is chosen again where it is not the scene's own size, and the
    /// scene's clip region cuts.
    ///
    /// # Errors
    ///
    /// As [`View::new`] and [`auto::camera`].
    pub fn view(&self, width: u32, height: u32) -> Result<View> {
        let camera = if self.camera_is_automatic && [width, height] != [self.width, self.height] {
            auto::camera(&self.scene.data, width, height)?
        } else {
            self.camera
        };
        Ok(View::new(camera, width, height)?.with_clip(self.clip))
    }

    /// Puts the parts together and fills in what was not given.
    fn assemble(path: &Path, source: Source, rest: Rest) -> Result<Self> {
        let Source { data, file, report } = source;
        let [width, height] = rest.extent.unwrap_or([Self::DEFAULT_SIDE; 2]);
        let located = |error: Error| error.in_file(path);
        let transfer = match rest.transfer {
            Some(transfer) => transfer,
            None => auto::transfer_of(&data, rest.kernels.as_ref()).map_err(located)?,
        };
        let camera_is_automatic = rest.camera.is_none();
        let camera = match rest.camera {
            Some(camera) => camera,
            None => auto::camera(&data, width, height).map_err(located)?,
        };
        View::new(camera, width, height).map_err(located)?;
        let mut scene = Scene::new(data, transfer);
        if let Some(kernels) = rest.kernels {
            scene = scene.with_kernels(kernels).map_err(located)?;
        }
        Ok(Self {
            scene: scene.with_surfaces(rest.surfaces),
            clip: rest.clip,
            camera,
            camera_is_automatic,
            width,
            height,
            background: rest.background.unwrap_or(Self::DEFAULT_BACKGROUND),
            technique: rest.technique,
            file,
            report,
        })
    }
}

/// The data of a scene, and where it comes from.
struct Source {
    data: Data,
    file: PathBuf,
    report: Report,
}

impl Source {
    /// What was read.
    fn new(file: &Path, loaded: Loaded) -> Self {
        let Loaded { data, report } = loaded;
        match data {
            Data::Points(points) => Self::of_points(file, points, report),
            data => Self { data, file: file.to_path_buf(), report },
        }
    }

    /// Points, which get a radius where they have none.
    fn of_points(file: &Path, mut points: Points, mut report: Report) -> Self {
        if *points.size() == KernelSize::Unknown {
            points = points.with_estimated_radius();
            if let KernelSize::Radius(radius) = points.size() {
                report.notes.push(format!("radius {}: from the spacing of points", short(*radius)));
            }
        }
        Self { data: points.into(), file: file.to_path_buf(), report }
    }

    /// What was read, if it is a grid.
    fn grid(file: &Path, loaded: Loaded) -> Result<Self> {
        match loaded.data {
            Data::Grid(_) => Ok(Self::new(file, loaded)),
            Data::Mesh(_) => Err(Error::file(file, "content", "holds a mesh: a scene names it in `mesh`")),
            Data::Points(_) => Err(Error::file(file, "content", HOLDS_POINTS)),
        }
    }
}

/// The rule for files of points in the wrong place.
const HOLDS_POINTS: &str = "holds points: a scene names them in `points`";

/// A positive number, to three digits.
fn short(value: f64) -> String {
    if (1e-3..1e5).contains(&value) {
        let digits = num::usize_of((2.0 - value.log10().floor()).max(0.0));
        format!("{value:.digits$}")
    } else {
        format!("{value:.2e}")
    }
}

/// The parts of a scene that may be left out.
#[derive(Default)]
struct Rest {
    kernels: Option<Kernels>,
    transfer: Option<TransferFunction>,
    camera: Option<Camera>,
    extent: Option<[u32; 2]>,
    background: Option<[f64; 4]>,
    technique: Option<TechniqueChoice>,
    surfaces: Vec<Surface>,
    clip: Clip,
}

/// Reader of scene files.
#[derive(Clone, Copy, Debug)]
pub struct SceneFile;

impl SceneFile {
    /// Whether a file is a scene file: it is named `.json`, and does not describe raw samples.
    #[must_use]
    pub fn is_at(path: &Path, options: &ReadOptions) -> bool {
        path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json"))
            && !io::describes_raw(path, options)
    }

    /// Reads a scene file and the data that it names. The arrays of `options` win over those that it names.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if a file cannot be read; [`Error::File`] naming file, place and rule if the scene
    /// file or a file that it names breaks a rule.
    pub fn load(path: impl AsRef<Path>, options: &ReadOptions) -> Result<LoadedScene> {
        let path = path.as_ref();
        let document: Document = parse(path, options)?;
        let refuse = |place: &str, rule: &str| Err(Error::file(path, place, rule));
        let source = match (document.volume, document.mesh, document.points) {
            (Some(volume), None, None) => SourceSpec::Volume(Box::new(volume)),
            (None, Some(mesh), None) => SourceSpec::Mesh(mesh),
            (None, None, Some(points)) => SourceSpec::Points(points),
            (None, None, None) => {
                return refuse("volume", "missing: a scene needs data, in `volume`, `mesh` or `points`");
            }
            (_, _, points) => {
                let second = if points.is_some() { "points" } else { "mesh" };
                return refuse(second, "a scene has one of `volume`, `mesh` and `points`");
            }
        };
        if let Some(background) = document.background {
            let valid = background.iter().all(|v| *v >= 0.0 && v.is_finite()) && background[3] <= 1.0;
            if !valid {
                return refuse("background", "must be four numbers that are not negative, alpha at most 1");
            }
        }
        // Small things are checked before large data is read.
        let camera = document.camera.map(|camera| camera.check(path)).transpose()?;
        let extent = document
            .image
            .map(|image| [image.width, image.height].map(|side| side.unwrap_or(LoadedScene::DEFAULT_SIDE)));
        if let (Some(camera), [width, height]) = (camera, extent.unwrap_or([LoadedScene::DEFAULT_SIDE; 2])) {
            View::new(camera, width, height).map_err(|error| error.in_file(path))?;
        }
        let recipe = document.transfer.map(|spec| Recipe::new(path, spec, options)).transpose()?;
        let kernels = source.kernels(path, document.kernels)?;
        let clip = document.clip.map(|clip| clip.check(path)).transpose()?.unwrap_or_default();
        let surfaces = surfaces::load(&document.opaque.unwrap_or_default(), path, options)?;
        let source = match source {
            SourceSpec::Volume(volume) => volume.load(path, options)?,
            SourceSpec::Mesh(mesh) => mesh.load(path, options)?,
            SourceSpec::Points(points) => points.load(path, options)?,
        };
        let transfer = recipe.map(|recipe| recipe.build(source.data.range())).transpose()?;
        let Document { background, technique, .. } = document;
        let rest = Rest { kernels, transfer, camera, extent, background, technique, surfaces, clip };
        LoadedScene::assemble(path, source, rest)
    }
}

/// A path as the scene file means it.
fn beside(scene: &Path, file: &str) -> PathBuf {
    scene.parent().unwrap_or(Path::new("")).join(file)
}

/// Largest JSON file that is read, in bytes.
const MAX_JSON: u64 = 256 << 20;

/// Reads JSON; an error names the line, the column and the key.
fn parse<T: for<'de> Deserialize<'de>>(path: &Path, options: &ReadOptions) -> Result<T> {
    let metadata = std::fs::metadata(path).map_err(|e| Error::io(path, "cannot open", e))?;
    let most = MAX_JSON.min(options.max_bytes);
    if !metadata.is_file() || metadata.len() > most {
        return Err(Error::file(path, "file", format!("must be a regular file of at most {most} bytes")));
    }
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, "cannot read", e))?;
    let mut deserializer = serde_json::Deserializer::from_slice(&bytes);
    let parsed = serde_path_to_error::deserialize(&mut deserializer).map_err(|error| {
        let key = error.path().to_string();
        json_error(path, error.inner(), if key == "." { "" } else { &key })
    })?;
    deserializer.end().map_err(|error| json_error(path, &error, ""))?;
    Ok(parsed)
}

pub(crate) fn json_error(path: &Path, error: &serde_json::Error, key: &str) -> Error {
    let position = format!("line {}, column {}", error.line(), error.column());
    let place = if key.is_empty() { position.clone() } else { format!("{position}, {key}") };
    // The parser repeats the position at the end of its message.
    let text = error.to_string();
    let suffix = format!(" at line {} column {}", error.line(), error.column());
    Error::file(path, place, text.strip_suffix(&suffix).unwrap_or(&text))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a scene: an object with `volume`, `mesh` or `points`")]
struct Document {
    volume: Option<VolumeSpec>,
    mesh: Option<MeshSpec>,
    points: Option<PointsSpec>,
    kernels: Option<KernelsSpec>,
    transfer: Option<TransferSpec>,
    camera: Option<CameraSpec>,
    image: Option<ImageSpec>,
    background: Option<[f64; 4]>,
    opaque: Option<Vec<SurfaceSpec>>,
    clip: Option<ClipSpec>,
    technique: Option<TechniqueChoice>,
}

/// Where the data comes from, not yet read.
enum SourceSpec {
    Volume(Box<VolumeSpec>),
    Mesh(MeshSpec),
    Points(PointsSpec),
}

impl SourceSpec {
    /// The kernels that a scene asks for, beside its data or, with points, among their keys.
    fn kernels(&self, path: &Path, spec: Option<KernelsSpec>) -> Result<Option<Kernels>> {
        let kind = match self {
            Self::Volume(_) => Kind::Grid,
            Self::Mesh(_) => Kind::Mesh,
            Self::Points(points) => match (points.kernels_key(), &spec) {
                (_, None) => return points.kernels(path),
                (Some(key), Some(_)) => {
                    let rule = "stands in `kernels` or in `points`, not in both";
                    return Err(Error::file(path, format!("points.{key}"), rule));
                }
                (None, Some(_)) => Kind::Points,
            },
        };
        spec.map(|spec| spec.check(path, "kernels", kind)).transpose()
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with width and height")]
struct ImageSpec {
    width: Option<u32>,
    height: Option<u32>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with eye, target, up and fov_y_deg or half_height")]
struct CameraSpec {
    eye: [f64; 3],
    target: [f64; 3],
    up: [f64; 3],
    fov_y_deg: Option<f64>,
    half_height: Option<f64>,
}

impl CameraSpec {
    fn check(self, path: &Path) -> Result<Camera> {
        let projection = match (self.fov_y_deg, self.half_height) {
            (Some(fov_y_deg), None) => Projection::Perspective { fov_y_deg },
            (None, Some(half_height)) => Projection::Orthographic { half_height },
            _ => return Err(Error::file(path, "camera", "must have either fov_y_deg or half_height")),
        };
        let [eye, target, up] = [self.eye, self.target, self.up].map(DVec3::from_array);
        Ok(Camera { eye, target, up, projection })
    }
}

/// Most options of a technique.
const MAX_OPTIONS: usize = 64;

impl<'de> Deserialize<'de> for TechniqueChoice {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct Options;
        impl<'de> Visitor<'de> for Options {
            type Value = TechniqueChoice;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("an object with `name` and options")
            }

            fn visit_map<A: MapAccess<'de>>(
                self,
                mut map: A,
            ) -> std::result::Result<TechniqueChoice, A::Error> {
                use serde::de::Error;
                let (mut name, mut options) = (None, Vec::<(String, String)>::new());
                while let Some(key) = map.next_key::<String>()? {
                    if options.iter().any(|(other, _)| *other == key) || (key == "name" && name.is_some()) {
                        return Err(A::Error::custom(format!("duplicate field `{key}`")));
                    }
                    if key == "name" {
                        name = Some(map.next_value()?);
                    } else {
                        if options.len() == MAX_OPTIONS {
                            return Err(A::Error::custom(format!("more than {MAX_OPTIONS} options")));
                        }
                        options.push((key, map.next_value::<Plain>()?.0));
                    }
                }
                let name = name.ok_or_else(|| A::Error::missing_field("name"))?;
                Ok(TechniqueChoice { name, options })
            }
        }
        deserializer.deserialize_map(Options)
    }
}

/// A number, a string or a truth value, as text.
struct Plain(String);

impl<'de> Deserialize<'de> for Plain {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct Text;
        impl Visitor<'_> for Text {
            type Value = Plain;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a number, a string or a truth value")
            }

            fn visit_bool<E>(self, value: bool) -> std::result::Result<Plain, E> {
                Ok(Plain(value.to_string()))
            }

            fn visit_i64<E>(self, value: i64) -> std::result::Result<Plain, E> {
                Ok(Plain(value.to_string()))
            }

            fn visit_u64<E>(self, value: u64) -> std::result::Result<Plain, E> {
                Ok(Plain(value.to_string()))
            }

            fn visit_f64<E>(self, value: f64) -> std::result::Result<Plain, E> {
                Ok(Plain(value.to_string()))
            }

            fn visit_str<E>(self, value: &str) -> std::result::Result<Plain, E> {
                Ok(Plain(value.to_owned()))
            }
        }
        deserializer.deserialize_any(Text)
    }
}
