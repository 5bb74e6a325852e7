//! The key `points`: a data file, or an analytic field at random points.

use std::fmt;
use std::path::Path;

use serde::de::Visitor;
use serde::{Deserialize, Deserializer};

use crate::error::{Error, Result};
use crate::io::options::ReadOptions;
use crate::io::read_data;
use crate::io::report::Report;
use crate::io::scene_file::data::{SceneData, beside};
use crate::io::scene_file::kernels::{KernelsSpec, Kind};
use crate::num;
use crate::scene::{Data, Field, KernelSize, Kernels, Points};

/// The keys of both kinds of points, in one struct so that every error names its key.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with `file` or `field`")]
pub(crate) struct PointsSpec {
    file: Option<String>,
    array: Option<String>,
    radius: Option<Radius>,
    covariance: Option<String>,
    weight: Option<String>,
    field: Option<String>,
    count: Option<u32>,
    kernel: Option<String>,
    cut: Option<f64>,
    model: Option<String>,
    least: Option<f64>,
}

/// One radius for all points, or the array of radii.
enum Radius {
    All(f64),
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
    /// Returns the kernels given among the keys of points, if any.
    pub(crate) fn kernels(&self, scene: &Path) -> Result<Option<Kernels>> {
        let spec = self.kernels_spec();
        spec.key().map(|_| spec.check(scene, "points", Kind::Points)).transpose()
    }

    /// Returns the first kernel key that is given.
    pub(crate) fn kernels_key(&self) -> Option<&'static str> {
        self.kernels_spec().key()
    }

    fn kernels_spec(&self) -> KernelsSpec {
        let Self { kernel, cut, model, least, .. } = self;
        KernelsSpec { kernel: kernel.clone(), sigma: None, cut: *cut, model: model.clone(), least: *least }
    }

    pub(crate) fn load(&self, scene: &Path, options: &ReadOptions) -> Result<SceneData> {
        let refuse = |place: &str, rule: &str| Err(Error::file(scene, place, rule));
        if self.radius.is_some() && self.covariance.is_some() {
            return refuse("points.covariance", "points have either `radius` or `covariance`, not both");
        }
        match (&self.file, &self.field) {
            (Some(_), Some(_)) => refuse("points", "must have either `file` or `field`, not both"),
            (None, None) => refuse("points", "must have `file` or `field`"),
            (Some(_), None) if self.count.is_some() => {
                refuse("points.count", "belongs to a field, not to a file")
            }
            (Some(file), None) => self.read(&beside(scene, file), options),
            (None, Some(field)) => {
                self.refuse_arrays(scene, options)?;
                let report = Report { format: "analytic field", ..Report::default() };
                Ok(SceneData::of_points(scene, self.analytic(scene, field, options)?, report))
            }
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
        let loaded = read_data::read(file, &wanted)?;
        let holds = |what: &str| Err(Error::file(file, "content", format!("holds a {what}")));
        let points = match loaded.data {
            Data::Points(points) => points,
            Data::Grid(_) => return holds("grid: a scene names it in `volume`"),
            Data::Mesh(_) => return holds("mesh: a scene names it in `mesh`"),
        };
        Ok(SceneData::of_points(file, sized(points, all)?, loaded.report))
    }

    /// Refuses selected arrays, which fields do not have.
    fn refuse_arrays(&self, scene: &Path, options: &ReadOptions) -> Result<()> {
        let radius = match &self.radius {
            Some(Radius::Array(name)) => Some(name),
            _ => None,
        };
        let wanted = [
            ("points.array", self.array.as_ref()),
            ("points.radius", radius),
            ("points.covariance", self.covariance.as_ref()),
            ("points.weight", self.weight.as_ref()),
            ("array", options.array.as_ref()),
            ("radius", options.radius.as_ref()),
            ("covariance", options.covariance.as_ref()),
            ("weight", options.weight.as_ref()),
        ];
        match wanted.into_iter().find_map(|(key, array)| Some((key, array?))) {
            Some((key, array)) => {
                let rule = format!("\"{array}\": fields have no arrays with names");
                Err(Error::file(scene, key, rule))
            }
            None => Ok(()),
        }
    }

    fn analytic(&self, scene: &Path, field: &str, options: &ReadOptions) -> Result<Points> {
        let Some(count) = self.count else {
            return Err(Error::file(scene, "points.count", "missing: a field needs count"));
        };
        let at = |key: &'static str| move |error: Error| error.at_place(scene, key);
        let field = Field::from_name(field).map_err(at("points.field"))?;
        // A point takes 28 bytes: position and scalar.
        let bytes = 28 * u64::from(count);
        if bytes > options.max_bytes {
            let rule = format!("{count}: takes {bytes} bytes, the limit is {} bytes", options.max_bytes);
            return Err(Error::file(scene, "points.count", rule));
        }
        let all = match self.radius {
            Some(Radius::All(radius)) => Some(radius),
            _ => None,
        };
        sized(field.points(count).map_err(at("points.count"))?, all)
    }
}

/// Gives all points one radius, if there is one.
fn sized(points: Points, radius: Option<f64>) -> Result<Points> {
    match radius {
        Some(radius) => points.with_size(KernelSize::Radius(radius)),
        None => Ok(points),
    }
}
