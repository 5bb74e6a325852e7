//! The keys of a scene file: the document, its camera, its image and its clip region.

use std::path::Path;

use glam::DVec3;
use schemars::generate::SchemaSettings;
use schemars::transform::RecursiveTransform;
use schemars::{JsonSchema, Schema};
use serde::Deserialize;
use serde_json::{Map, Value, json};

use crate::error::{Error, Result};
use crate::io::options::ReadOptions;
use crate::io::report::Loaded;
use crate::io::scene_file::data::SceneData;
use crate::io::scene_file::gaussians::GaussiansSpec;
use crate::io::scene_file::kernels::{KernelsSpec, Kind};
use crate::io::scene_file::mesh::MeshSpec;
use crate::io::scene_file::mode::LightingSpec;
use crate::io::scene_file::points::PointsSpec;
use crate::io::scene_file::schema::{lacks, one_of, only, positive, rules, with, words};
use crate::io::scene_file::surfaces::SurfaceSpec;
use crate::io::scene_file::technique::TechniqueChoice;
use crate::io::scene_file::transfer::TransferSpec;
use crate::io::scene_file::volume::VolumeSpec;
use crate::scene::{Camera, Clip, Data, Kernels, Lighting, Mode, Projection, View};

/// A scene of volraster: the data, and how it is drawn. It has exactly one of `volume`, `mesh`, `points` and `gaussians`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a scene: an object with `volume`, `mesh`, `points` or `gaussians`")]
#[schemars(title = "Scene file of volraster", transform = rules(vec![
    one_of(&["volume", "mesh", "points", "gaussians"]),
    with("lighting", only("mode", [Mode::Lit(Lighting::default()).name()])),
    with("kernels", json!({"properties": {"points": lacks(&KernelsSpec::OF_POINTS)}})),
    with("mesh", json!({"properties": {"kernels": KernelsSpec::not_on_a_grid()}})),
    with("points", json!({"properties": {"kernels": KernelsSpec::not_on_a_grid()}})),
    with("gaussians", lacks(&["kernels", "transfer", "lighting"])),
]))]
pub(crate) struct Document {
    /// Names the schema of the file, for editors; the reader ignores it.
    #[serde(rename = "$schema")]
    _schema: Option<String>,
    /// Selects a grid: a data file, raw samples, or an analytic field.
    pub(crate) volume: Option<VolumeSpec>,
    /// Selects a mesh: a data file, or an analytic field on tetrahedra.
    pub(crate) mesh: Option<MeshSpec>,
    /// Selects points: a data file, or an analytic field at random places.
    pub(crate) points: Option<PointsSpec>,
    /// Selects trained Gaussian splats, which have colours of their own: without `transfer`, `kernels` and `lighting`.
    pub(crate) gaussians: Option<GaussiansSpec>,
    /// Replaces the linear field between samples by a sum of kernels.
    pub(crate) kernels: Option<KernelsSpec>,
    /// Sets colour and extinction of each scalar. Left out: chosen by the distribution of the scalars.
    pub(crate) transfer: Option<TransferSpec>,
    /// Selects what the ray of a pixel shows: `emission` is emission and absorption, `lit` the same with light on it,
    /// `maximum` the maximum intensity projection. `lit` and `maximum` are for grids without `kernels`. Left out: `lit`
    /// where `lighting` is given, else that of the preset or isosurface in `transfer`, else `emission`.
    #[schemars(transform = words(Mode::NAMES))]
    pub(crate) mode: Option<String>,
    /// Sets the light of the mode `lit`.
    pub(crate) lighting: Option<LightingSpec>,
    /// Sets the viewpoint. Left out: one that frames what is visible.
    pub(crate) camera: Option<CameraSpec>,
    /// Sets the size of the image.
    pub(crate) image: Option<ImageSpec>,
    /// Sets the colour behind the volume in PNG files: linear red, green and blue, and alpha from 0 to 1. EXR files do
    /// not have it.
    #[schemars(extend("prefixItems" = rgba(), "items" = false, "default" = Document::BACKGROUND))]
    pub(crate) background: Option<[f64; 4]>,
    /// Lists surfaces in the volume, opaque and translucent ones. Triangles are visible from both sides.
    pub(crate) opaque: Option<Vec<SurfaceSpec>>,
    /// Cuts away parts of the volume, not of surfaces.
    pub(crate) clip: Option<ClipSpec>,
    /// Selects the technique and its options. Left out: the default for the data, or that of the command line.
    #[schemars(with = "Option<Map<String, Value>>")]
    pub(crate) technique: Option<TechniqueChoice>,
}

impl Document {
    /// The default background: opaque black.
    pub(crate) const BACKGROUND: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

    /// Returns the JSON Schema of scene files, in which a technique is any object.
    pub(crate) fn schema() -> Value {
        let settings = SchemaSettings::draft2020_12()
            .with(|settings| settings.inline_subschemas = true)
            .with_transform(RecursiveTransform(plain));
        settings.into_generator().into_root_schema_for::<Self>().into()
    }

    /// Takes the description of the data, which must be of one kind.
    pub(crate) fn data(&mut self, path: &Path) -> Result<DataSpec> {
        const RULE: &str = "a scene has one of `volume`, `mesh`, `points` and `gaussians`";
        let mut given = self.take_data();
        let Some((_, first)) = given.next() else {
            let rule = "missing: a scene needs data, in `volume`, `mesh`, `points` or `gaussians`";
            return Err(Error::file(path, "volume", rule));
        };
        match given.next_back() {
            Some((key, _)) => Err(Error::file(path, key, RULE)),
            None => Ok(first),
        }
    }

    /// Takes data that is given beside the document, which must describe none.
    pub(crate) fn given(&mut self, path: &Path, loaded: Loaded) -> Result<DataSpec> {
        match self.take_data().next() {
            Some((key, _)) => Err(Error::file(path, key, "the data is given: a scene has no other")),
            None => Ok(DataSpec::Given(Box::new(loaded))),
        }
    }

    /// Takes all descriptions of data, with their keys.
    fn take_data(&mut self) -> impl DoubleEndedIterator<Item = (&'static str, DataSpec)> + use<> {
        let all = [
            ("volume", self.volume.take().map(|volume| DataSpec::Volume(Box::new(volume)))),
            ("mesh", self.mesh.take().map(DataSpec::Mesh)),
            ("points", self.points.take().map(DataSpec::Points)),
            ("gaussians", self.gaussians.take().map(DataSpec::Gaussians)),
        ];
        all.into_iter().filter_map(|(key, spec)| Some((key, spec?)))
    }
}

/// Returns the schemas of the parts of a colour.
fn rgba() -> [Value; 4] {
    let alpha = json!({"type": "number", "minimum": 0, "maximum": 1, "description": "alpha"});
    [positive("linear red"), positive("linear green"), positive("linear blue"), alpha]
}

/// Removes line breaks of descriptions, and formats such as `uint32`, which strict validators do not know.
fn plain(schema: &mut Schema) {
    schema.remove("format");
    if let Some(Value::String(text)) = schema.get_mut("description") {
        *text = text.replace('\n', " ");
    }
}

/// The description of the data, before it is read.
pub(crate) enum DataSpec {
    /// Data that has been read.
    Given(Box<Loaded>),
    Volume(Box<VolumeSpec>),
    Mesh(MeshSpec),
    Points(PointsSpec),
    Gaussians(GaussiansSpec),
}

impl DataSpec {
    /// Returns the kernels of the scene, from `kernels` or from the keys of points.
    pub(crate) fn kernels(&self, path: &Path, spec: Option<KernelsSpec>) -> Result<Option<Kernels>> {
        let kind = match self {
            Self::Given(loaded) if matches!(loaded.data, Data::Points(_)) => Kind::Points,
            Self::Given(loaded) if matches!(loaded.data, Data::Mesh(_)) => Kind::Mesh,
            Self::Given(loaded) if matches!(loaded.data, Data::Grid(_)) => Kind::Grid,
            Self::Volume(_) => Kind::Grid,
            Self::Mesh(_) => Kind::Mesh,
            Self::Points(points) => match (points.kernels().key(), &spec) {
                (Some(_), None) => return points.kernels().check(path, "points", Kind::Points).map(Some),
                (Some(key), Some(_)) => {
                    let rule = "must be in `kernels` or in `points`, not in both";
                    return Err(Error::file(path, format!("points.{key}"), rule));
                }
                (None, _) => Kind::Points,
            },
            Self::Given(_) | Self::Gaussians(_) if spec.is_some() => {
                return Err(Error::file(path, "kernels", "gaussians are kernels of their own"));
            }
            Self::Given(_) | Self::Gaussians(_) => return Ok(None),
        };
        spec.map(|spec| spec.check(path, "kernels", kind)).transpose()
    }

    /// Returns whether the data has colours of its own.
    pub(crate) fn is_gaussians(&self) -> bool {
        match self {
            Self::Given(loaded) => matches!(loaded.data, Data::Gaussians(_)),
            other => matches!(other, Self::Gaussians(_)),
        }
    }

    /// Reads the data.
    pub(crate) fn load(self, path: &Path, options: &ReadOptions) -> Result<SceneData> {
        let data = match self {
            Self::Given(loaded) => SceneData::new(path, *loaded),
            Self::Volume(volume) => volume.load(path, options)?,
            Self::Mesh(mesh) => mesh.load(path, options)?,
            Self::Points(points) => points.load(path, options)?,
            Self::Gaussians(gaussians) => gaussians.load(path, options)?,
        };
        options.check_axes(path, &data.data)?;
        match options.step {
            Some(step) if data.report.steps.is_empty() => {
                Err(Error::file(path, format!("step {step}"), "its data is no series of time steps"))
            }
            _ => Ok(data),
        }
    }
}

/// The size of the image.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object with width and height")]
pub(crate) struct ImageSpec {
    /// Sets the width, in pixels.
    #[schemars(range(min = 1, max = View::MAX_SIDE), extend("default" = ImageSpec::SIDE))]
    pub(crate) width: Option<u32>,
    /// Sets the height, in pixels.
    #[schemars(range(min = 1, max = View::MAX_SIDE), extend("default" = ImageSpec::SIDE))]
    pub(crate) height: Option<u32>,
}

impl ImageSpec {
    /// The default width and height, in pixels.
    pub(crate) const SIDE: u32 = 512;
}

/// The viewpoint. Pixels are square.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object with eye, target, up and fov_y_deg or half_height")]
#[schemars(transform = rules(vec![one_of(&["fov_y_deg", "half_height"])]))]
pub(crate) struct CameraSpec {
    /// Sets the position of the eye, in world coordinates.
    eye: [f64; 3],
    /// Sets the position in the centre of the image, in world coordinates, other than `eye`.
    target: [f64; 3],
    /// Sets the direction that is up in the image, of any length, not parallel to the view.
    up: [f64; 3],
    /// Sets the angle between the lower and the upper edge of a perspective image, in degrees.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = View::MAX_FOV))]
    fov_y_deg: Option<f64>,
    /// Sets half the height of an orthographic image, in world units.
    #[schemars(extend("exclusiveMinimum" = 0))]
    half_height: Option<f64>,
}

impl CameraSpec {
    pub(crate) fn check(self, path: &Path) -> Result<Camera> {
        let projection = match (self.fov_y_deg, self.half_height) {
            (Some(fov_y_deg), None) => Projection::Perspective { fov_y_deg },
            (None, Some(half_height)) => Projection::Orthographic { half_height },
            _ => return Err(Error::file(path, "camera", "must have either fov_y_deg or half_height")),
        };
        let [eye, target, up] = [self.eye, self.target, self.up].map(DVec3::from_array);
        Ok(Camera { eye, target, up, projection })
    }
}

/// Clip planes and a crop box.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object with `planes` and `crop`")]
pub(crate) struct ClipSpec {
    /// Lists planes, each of which keeps one side.
    #[schemars(length(max = Clip::MAX_PLANES))]
    planes: Option<Vec<PlaneSpec>>,
    /// Sets an axis-aligned box, whose inside is kept.
    crop: Option<CropSpec>,
}

/// A plane.
#[derive(Deserialize, JsonSchema)]
#[serde(
    deny_unknown_fields,
    expecting = "an object with `point` and `normal`, which points to the side that is kept"
)]
struct PlaneSpec {
    /// Sets a point of the plane, in world coordinates.
    point: [f64; 3],
    /// Sets the direction to the side that is kept, of any length but 0.
    normal: [f64; 3],
}

/// An axis-aligned box.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object with `low` and `high`")]
struct CropSpec {
    /// Sets the lower ends of the box, in world coordinates, each below that of `high`; `null` cuts nothing.
    low: Option<[Option<f64>; 3]>,
    /// Sets the upper ends of the box, in world coordinates; `null` cuts nothing.
    high: Option<[Option<f64>; 3]>,
}

impl ClipSpec {
    pub(crate) fn check(&self, scene: &Path) -> Result<Clip> {
        let mut clip = Clip::none();
        for (i, plane) in self.planes.iter().flatten().enumerate() {
            clip = clip.with_plane(plane.point.into(), plane.normal.into()).map_err(|error| match error {
                Error::Invalid { what, why } => {
                    let key = what.strip_prefix("clip plane ").map_or(String::new(), |key| format!(".{key}"));
                    Error::file(scene, format!("clip.planes[{i}]{key}"), why)
                }
                other => other,
            })?;
        }
        let Some(crop) = &self.crop else { return Ok(clip) };
        let bound = |given: Option<[Option<f64>; 3]>, none: f64| {
            DVec3::from(given.unwrap_or_default().map(|bound| bound.unwrap_or(none)))
        };
        let [low, high] = [bound(crop.low, f64::NEG_INFINITY), bound(crop.high, f64::INFINITY)];
        clip.with_crop(low, high).map_err(|error| error.at_place(scene, "clip.crop"))
    }
}
