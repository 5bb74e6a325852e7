//! The keys of a scene file: the document, its camera, its image and its clip region.

use std::path::Path;

use glam::DVec3;
use serde::Deserialize;

use crate::error::{Error, Result};
use crate::io::options::ReadOptions;
use crate::io::scene_file::data::SceneData;
use crate::io::scene_file::kernels::{KernelsSpec, Kind};
use crate::io::scene_file::mesh::MeshSpec;
use crate::io::scene_file::mode::LightingSpec;
use crate::io::scene_file::points::PointsSpec;
use crate::io::scene_file::surfaces::SurfaceSpec;
use crate::io::scene_file::technique::TechniqueChoice;
use crate::io::scene_file::transfer::TransferSpec;
use crate::io::scene_file::volume::VolumeSpec;
use crate::scene::{Camera, Clip, Kernels, Projection};

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a scene: an object with `volume`, `mesh` or `points`")]
pub(crate) struct Document {
    pub(crate) volume: Option<VolumeSpec>,
    pub(crate) mesh: Option<MeshSpec>,
    pub(crate) points: Option<PointsSpec>,
    pub(crate) kernels: Option<KernelsSpec>,
    pub(crate) transfer: Option<TransferSpec>,
    pub(crate) mode: Option<String>,
    pub(crate) lighting: Option<LightingSpec>,
    pub(crate) camera: Option<CameraSpec>,
    pub(crate) image: Option<ImageSpec>,
    pub(crate) background: Option<[f64; 4]>,
    pub(crate) opaque: Option<Vec<SurfaceSpec>>,
    pub(crate) clip: Option<ClipSpec>,
    pub(crate) technique: Option<TechniqueChoice>,
}

impl Document {
    /// Takes the description of the data, which must be of one kind.
    pub(crate) fn data(&mut self, path: &Path) -> Result<DataSpec> {
        match (self.volume.take(), self.mesh.take(), self.points.take()) {
            (Some(volume), None, None) => Ok(DataSpec::Volume(Box::new(volume))),
            (None, Some(mesh), None) => Ok(DataSpec::Mesh(mesh)),
            (None, None, Some(points)) => Ok(DataSpec::Points(points)),
            (None, None, None) => {
                let rule = "missing: a scene needs data, in `volume`, `mesh` or `points`";
                Err(Error::file(path, "volume", rule))
            }
            (_, _, points) => {
                let second = if points.is_some() { "points" } else { "mesh" };
                Err(Error::file(path, second, "a scene has one of `volume`, `mesh` and `points`"))
            }
        }
    }
}

/// The description of the data, before it is read.
pub(crate) enum DataSpec {
    Volume(Box<VolumeSpec>),
    Mesh(MeshSpec),
    Points(PointsSpec),
}

impl DataSpec {
    /// Returns the kernels of the scene, from `kernels` or from the keys of points.
    pub(crate) fn kernels(&self, path: &Path, spec: Option<KernelsSpec>) -> Result<Option<Kernels>> {
        let kind = match self {
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
        };
        spec.map(|spec| spec.check(path, "kernels", kind)).transpose()
    }

    /// Reads the data.
    pub(crate) fn load(self, path: &Path, options: &ReadOptions) -> Result<SceneData> {
        let data = match self {
            Self::Volume(volume) => volume.load(path, options)?,
            Self::Mesh(mesh) => mesh.load(path, options)?,
            Self::Points(points) => points.load(path, options)?,
        };
        match options.step {
            Some(step) if data.report.steps.is_empty() => {
                Err(Error::file(path, format!("step {step}"), "its data is no series of time steps"))
            }
            _ => Ok(data),
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with width and height")]
pub(crate) struct ImageSpec {
    pub(crate) width: Option<u32>,
    pub(crate) height: Option<u32>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with eye, target, up and fov_y_deg or half_height")]
pub(crate) struct CameraSpec {
    eye: [f64; 3],
    target: [f64; 3],
    up: [f64; 3],
    fov_y_deg: Option<f64>,
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
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with `planes` and `crop`")]
pub(crate) struct ClipSpec {
    planes: Option<Vec<PlaneSpec>>,
    crop: Option<CropSpec>,
}

#[derive(Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "an object with `point` and `normal`, which points to the side that is kept"
)]
struct PlaneSpec {
    point: [f64; 3],
    normal: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with `low` and `high`")]
struct CropSpec {
    low: Option<[Option<f64>; 3]>,
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
