//! The key `clip`: planes and a box that cut the volume.

use std::path::Path;

use glam::DVec3;
use serde::Deserialize;

use crate::error::{Error, Result};
use crate::scene::Clip;

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
