//! The key `points`: a data file, or an analytic field at random points.

use std::fmt;
use std::path::Path;

use schemars::JsonSchema;
use serde::de::Visitor;
use serde::{Deserialize, Deserializer};
use serde_json::json;

use crate::error::{Error, Result};
use crate::io::options::ReadOptions;
use crate::io::scene_file::data::{Given, SceneData, check_memory, read, refuse_arrays};
use crate::io::scene_file::kernels::KernelsSpec;
use crate::io::scene_file::schema::{lacks, names, needs, one_of, rules, with, words};
use crate::num;
use crate::scene::{Data, Field, KernelSize, Kernels, Model, Points};

/// Points: a data file, or an analytic field at random places.
// One struct has the keys of both, so that every error names its key.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object with `file` or `field`")]
#[schemars(transform = rules(vec![
    one_of(&["file", "field"]),
    with("file", lacks(&["count"])),
    with("field", needs(&["count"])),
    with("field", lacks(&["array", "covariance", "weight"])),
    with("field", json!({"properties": {"radius": {"not": {"type": "string"}}}})),
    with("covariance", lacks(&["radius"])),
]))]
pub(crate) struct PointsSpec {
    /// Names a file that holds points.
    file: Option<String>,
    /// Selects the array of scalars. Left out: that which the file marks as active, else the first suitable one.
    array: Option<String>,
    /// Sets the support radius of all kernels, in world units, or names an array of radii. The standard deviation of a
    /// Gaussian is a third of it; a B-spline spans it. Left out, without `covariance`: three times the spacing of points.
    radius: Option<Radius>,
    /// Names an array of covariances (xx, xy, xz, yy, yz, zz, or all nine), instead of `radius`.
    covariance: Option<String>,
    /// Names an array of weights. Left out: 1.
    weight: Option<String>,
    /// Selects an analytic field, taken at random places in [-1, 1]³, the same in every run.
    #[schemars(transform = words(Field::NAMES))]
    field: Option<String>,
    /// Sets the number of points of a field.
    #[schemars(range(min = 1, max = u32::MAX))]
    count: Option<u32>,
    /// Selects the shape of a kernel.
    #[schemars(transform = words(KernelsSpec::names_for_all()), extend("default" = Kernels::of_points().kernel.name()))]
    kernel: Option<String>,
    /// Sets the distance at which `gaussian` kernels end, in standard deviations.
    #[schemars(range(min = Kernels::CUT[0], max = Kernels::CUT[1]), extend("default" = Kernels::of_points().cut))]
    cut: Option<f64>,
    /// Selects what kernels add up to: `density` adds their extinctions, `interpolate` takes the weighted mean of their
    /// scalars.
    #[schemars(
        transform = words(names(Model::ALL)),
        extend("default" = Kernels::of_points().model.name())
    )]
    model: Option<String>,
    /// Sets the sum of weights below which the model `interpolate` has vacuum.
    #[schemars(range(min = Kernels::LEASTS[0], max = Kernels::LEASTS[1]), extend("default" = Kernels::LEAST))]
    least: Option<f64>,
}

/// One radius for all points, or the array of radii.
#[derive(JsonSchema)]
#[schemars(untagged)]
enum Radius {
    All(#[schemars(extend("exclusiveMinimum" = 0))] f64),
    Array(String),
}

impl<'de> Deserialize<'de> for Radius {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct Either;
        impl Visitor<'_> for Either {
            type Value = Radius;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a length, or the name of an array")
            }

            fn visit_f64<E: serde::de::Error>(self, radius: f64) -> std::result::Result<Radius, E> {
                if radius > 0.0 && radius.is_finite() {
                    Ok(Radius::All(radius))
                } else {
                    Err(E::custom(format!("{radius}: must be positive and finite")))
                }
            }

            fn visit_u64<E: serde::de::Error>(self, radius: u64) -> std::result::Result<Radius, E> {
                self.visit_f64(num::f64_of_u64(radius))
            }

            fn visit_i64<E: serde::de::Error>(self, radius: i64) -> std::result::Result<Radius, E> {
                Err(E::custom(format!("{radius}: must be positive and finite")))
            }

            fn visit_str<E>(self, name: &str) -> std::result::Result<Radius, E> {
                Ok(Radius::Array(name.to_owned()))
            }
        }
        deserializer.deserialize_any(Either)
    }
}

impl PointsSpec {
    /// Returns the kernels given among the keys of points.
    pub(crate) fn kernels(&self) -> KernelsSpec {
        let Self { kernel, cut, model, least, .. } = self;
        KernelsSpec { kernel: kernel.clone(), sigma: None, cut: *cut, model: model.clone(), least: *least }
    }

    pub(crate) fn load(&self, scene: &Path, options: &ReadOptions) -> Result<SceneData> {
        let refuse = |place: &str, rule: &str| Err(Error::file(scene, place, rule));
        if self.radius.is_some() && self.covariance.is_some() {
            return refuse("points.covariance", "points have either `radius` or `covariance`, not both");
        }
        match Given::of(scene, "points", &self.file, &self.field)? {
            Given::File(_) if self.count.is_some() => {
                refuse("points.count", "belongs to a field, not to a file")
            }
            Given::File(file) => self.read(&file, options),
            Given::Field(field) => Ok(SceneData::analytic(scene, self.analytic(scene, field, options)?)),
        }
    }

    /// Reads the file. Options override keys; a radius or covariance in the options overrides both keys.
    fn read(&self, file: &Path, options: &ReadOptions) -> Result<SceneData> {
        let mut wanted = options.clone();
        wanted.array = wanted.array.or_else(|| self.array.clone());
        wanted.weight = wanted.weight.or_else(|| self.weight.clone());
        let mut all = None;
        if wanted.radius.is_none() && wanted.covariance.is_none() {
            wanted.covariance.clone_from(&self.covariance);
            match &self.radius {
                Some(Radius::All(radius)) => all = Some(*radius),
                Some(Radius::Array(name)) => wanted.radius = Some(name.clone()),
                None => {}
            }
        }
        let mut loaded = read("points", file, &wanted)?;
        if let (Data::Points(points), Some(radius)) = (&loaded.data, all) {
            loaded.data = points.clone().with_size(KernelSize::Radius(radius))?.into();
        }
        Ok(SceneData::new(file, loaded))
    }

    fn analytic(&self, scene: &Path, field: &str, options: &ReadOptions) -> Result<Points> {
        let radius = match &self.radius {
            Some(Radius::Array(name)) => &Some(name.clone()),
            _ => &None,
        };
        let wanted = [
            ("points.array", &self.array),
            ("points.radius", radius),
            ("points.covariance", &self.covariance),
            ("points.weight", &self.weight),
            ("array", &options.array),
            ("radius", &options.radius),
            ("covariance", &options.covariance),
            ("weight", &options.weight),
        ];
        refuse_arrays(scene, "fields", &wanted)?;
        let Some(count) = self.count else {
            return Err(Error::file(scene, "points.count", "missing: a field needs count"));
        };
        let at = |key: &'static str| move |error: Error| error.at_place(scene, key);
        let field = Field::from_name(field).map_err(at("points.field"))?;
        // A point takes 28 bytes: position and scalar.
        check_memory(scene, "points.count", count, 28 * u64::from(count), options)?;
        let points = field.points(count).map_err(at("points.count"))?;
        match self.radius {
            Some(Radius::All(radius)) => points.with_size(KernelSize::Radius(radius)),
            _ => Ok(points),
        }
    }
}
