//! The key `opaque`: surfaces from files, boxes and spheres.

use std::path::Path;

use schemars::JsonSchema;
use serde::Deserialize;

use crate::error::{Error, Result};
use crate::io::formats::fan::Triangles;
use crate::io::formats::triangles;
use crate::io::options::ReadOptions;
use crate::io::scene_file::data::beside;
use crate::io::scene_file::schema::{names, one_of, rules, words};
use crate::num;
use crate::scene::{Shading, Surface};

/// The limit on triangles of all surfaces together.
const MAX_TRIANGLES: usize = (1 << 31) - 1;

/// A surface: a file, a box or a sphere.
// One struct has the keys of all three, so that every error names its key.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a surface: an object with `file`, `box` or `sphere`")]
#[schemars(transform = rules(vec![one_of(&["file", "box", "sphere"])]))]
pub(crate) struct SurfaceSpec {
    /// Names a PLY or OBJ file of triangles or polygons.
    file: Option<String>,
    /// Sets an axis-aligned box.
    #[serde(rename = "box")]
    cuboid: Option<BoxSpec>,
    /// Sets a sphere of triangles.
    sphere: Option<SphereSpec>,
    /// Sets the colour: linear red, green and blue.
    #[schemars(inner(range(min = 0)), extend("default" = COLOUR))]
    colour: Option<[f64; 3]>,
    /// Sets the opacity: 1 is opaque and hides what is behind, less tints it.
    #[schemars(range(min = 0, max = 1), extend("default" = OPACITY))]
    opacity: Option<f64>,
    /// Selects the shading: `headlight` multiplies the colour by the cosine between normal and ray, `flat` leaves it.
    #[schemars(transform = words(names(SHADES)), extend("default" = SHADE.0))]
    shade: Option<String>,
    /// Multiplies the coordinates, before `translate` moves them.
    #[schemars(extend("exclusiveMinimum" = 0, "default" = SCALE))]
    scale: Option<f64>,
    /// Moves the surface, in world units.
    #[schemars(extend("default" = TRANSLATE))]
    translate: Option<[f64; 3]>,
}

/// An axis-aligned box.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object with `low` and `high`")]
struct BoxSpec {
    /// Sets the least corner, in world coordinates, below `high` on every axis.
    low: [f64; 3],
    /// Sets the greatest corner, in world coordinates.
    high: [f64; 3],
}

/// A sphere of triangles.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object with `centre`, `radius` and `subdivisions`")]
struct SphereSpec {
    /// Sets the centre, in world coordinates.
    centre: [f64; 3],
    /// Sets the radius, in world units.
    #[schemars(extend("exclusiveMinimum" = 0))]
    radius: f64,
    /// Sets how often each triangle of an icosahedron is divided into four.
    #[schemars(range(max = Surface::MAX_SUBDIVISIONS), extend("default" = SUBDIVISIONS))]
    subdivisions: Option<u32>,
}

/// The default colour: linear RGB.
const COLOUR: [f64; 3] = [0.8; 3];

/// The default opacity.
const OPACITY: f64 = 1.0;

/// The default factor of coordinates.
const SCALE: f64 = 1.0;

/// The default offset of coordinates.
const TRANSLATE: [f64; 3] = [0.0; 3];

/// The default number of subdivisions of a sphere.
const SUBDIVISIONS: u32 = 4;

/// A surface whose keys have been checked; its file has not been read.
struct Plan<'a> {
    place: String,
    scene: &'a Path,
    spec: &'a SurfaceSpec,
    colour: [f64; 4],
    shading: Shading,
    scale: f64,
}

/// The shadings by name.
const SHADES: [(&str, Shading); 2] = [("flat", Shading::Flat), SHADE];

/// The default shading.
const SHADE: (&str, Shading) = ("headlight", Shading::Headlight);

/// Loads all surfaces, which together may take `options.max_bytes`. All keys are checked before files are read.
pub(crate) fn load(specs: &[SurfaceSpec], scene: &Path, options: &ReadOptions) -> Result<Vec<Surface>> {
    let plans = specs.iter().enumerate().map(|(i, spec)| Plan::new(spec, i, scene));
    let plans = plans.collect::<Result<Vec<_>>>()?;
    let (mut left, mut triangles) = (options.max_bytes, 0);
    let mut surfaces = Vec::with_capacity(plans.len());
    for plan in plans {
        let surface = plan.load(&ReadOptions { max_bytes: left, ..options.clone() })?;
        triangles += surface.triangles().len();
        if triangles > MAX_TRIANGLES {
            return Err(plan.refuse("", format!("all surfaces have more than {MAX_TRIANGLES} triangles")));
        }
        let bytes = 24 * surface.points().len() + 12 * surface.triangles().len();
        left = left.saturating_sub(num::wide(bytes));
        surfaces.push(surface);
    }
    Ok(surfaces)
}

impl<'a> Plan<'a> {
    fn new(spec: &'a SurfaceSpec, i: usize, scene: &'a Path) -> Result<Self> {
        let [r, g, b] = spec.colour.unwrap_or(COLOUR);
        let opacity = spec.opacity.unwrap_or(OPACITY);
        let mut plan = Self {
            place: format!("opaque[{i}]"),
            scene,
            spec,
            colour: [r, g, b, opacity],
            shading: SHADE.1,
            scale: spec.scale.unwrap_or(SCALE),
        };
        let shapes = [spec.file.is_some(), spec.cuboid.is_some(), spec.sphere.is_some()];
        if shapes.into_iter().filter(|given| *given).count() != 1 {
            return Err(plan.refuse("", "must have exactly one of `file`, `box` and `sphere`"));
        }
        if [r, g, b].iter().any(|c| !(c.is_finite() && *c >= 0.0)) {
            return Err(plan.refuse(".colour", format!("{:?}: must be three numbers from 0 on", [r, g, b])));
        }
        if !(0.0..=1.0).contains(&opacity) {
            return Err(plan.refuse(".opacity", format!("{opacity}: must lie in [0, 1]")));
        }
        if !(plan.scale > 0.0 && plan.scale.is_finite()) {
            return Err(plan.refuse(".scale", format!("{}: must be positive and finite", plan.scale)));
        }
        if let Some(name) = &spec.shade {
            let Some((_, shading)) = SHADES.into_iter().find(|(known, _)| known == name) else {
                let names = SHADES.map(|(name, _)| name).join(", ");
                return Err(plan.refuse(".shade", format!("\"{name}\": must be one of {names}")));
            };
            plan.shading = shading;
        }
        Ok(plan)
    }

    fn load(&self, options: &ReadOptions) -> Result<Surface> {
        let at = |key: &'static str| {
            move |error: Error| error.at_place(self.scene, &format!("{}{key}", self.place))
        };
        let surface = if let Some(file) = &self.spec.file {
            let path = beside(self.scene, file);
            let Triangles { points, triangles } = triangles::read_triangles(&path, options)?;
            Surface::new(points, triangles, self.colour).map_err(|error| error.in_file(&path))?
        } else if let Some(BoxSpec { low, high }) = &self.spec.cuboid {
            Surface::cuboid((*low).into(), (*high).into(), self.colour).map_err(at(".box"))?
        } else if let Some(SphereSpec { centre, radius, subdivisions }) = &self.spec.sphere {
            let subdivisions = subdivisions.unwrap_or(SUBDIVISIONS);
            // A corner takes 24 bytes and a triangle 12; there are twice as many triangles as corners.
            let bytes = 480 << (2 * subdivisions.min(Surface::MAX_SUBDIVISIONS));
            if bytes > options.max_bytes {
                let left = options.max_bytes;
                let rule = format!("{subdivisions}: takes {bytes} bytes, {left} are left of the limit");
                return Err(self.refuse(".sphere.subdivisions", rule));
            }
            let key = |error: Error| match &error {
                Error::Invalid { what, .. } if what.ends_with("radius") => at(".sphere.radius")(error),
                Error::Invalid { what, .. } if what.ends_with("subdivisions") => {
                    at(".sphere.subdivisions")(error)
                }
                _ => at(".sphere")(error),
            };
            Surface::sphere((*centre).into(), *radius, self.colour, subdivisions).map_err(key)?
        } else {
            return Err(self.refuse("", "has no shape"));
        };
        let translate = self.spec.translate.unwrap_or(TRANSLATE);
        let placed = surface.placed(self.scale, translate.into()).map_err(at(".scale"))?;
        Ok(placed.with_shading(self.shading))
    }

    /// Returns an error about one of its keys, given with a leading dot, or about the whole surface.
    fn refuse(&self, key: &str, rule: impl Into<String>) -> Error {
        Error::file(self.scene, format!("{}{key}", self.place), rule)
    }
}
