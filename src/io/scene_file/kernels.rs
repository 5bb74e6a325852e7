//! The key `kernels`, and the keys of kernels among those of points.

use std::path::Path;

use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::{Value, json};

use crate::error::{Error, Result};
use crate::io::scene_file::schema::{lacks, names, only, words};
use crate::scene::{Kernel, Kernels, Model};

/// The kernels of any data.
#[derive(Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object with `kernel`, `sigma`, `cut`, `model`, `least`")]
pub(crate) struct KernelsSpec {
    /// Selects the shape of a kernel. `tent` and `sinc` are for grids.
    #[schemars(transform = words(names(Kernel::ALL)), extend("default" = Kernels::of_samples().kernel.name()))]
    pub(crate) kernel: Option<String>,
    /// Sets the standard deviation of `gaussian` kernels on grids, in voxels.
    #[schemars(range(min = Kernels::SIGMA[0], max = Kernels::SIGMA[1]), extend("default" = Kernels::of_samples().sigma))]
    pub(crate) sigma: Option<f64>,
    /// Sets the distance at which `gaussian` kernels end, in standard deviations.
    #[schemars(range(min = Kernels::CUT[0], max = Kernels::CUT[1]), extend("default" = Kernels::of_samples().cut))]
    pub(crate) cut: Option<f64>,
    /// Selects what kernels add up to: `density` adds their extinctions, `interpolate` takes the weighted mean of their
    /// scalars. Left out: `density` for points, else `interpolate`.
    #[schemars(transform = words(names(Model::ALL)))]
    pub(crate) model: Option<String>,
    /// Sets the sum of weights below which the model `interpolate` has vacuum.
    #[schemars(range(min = Kernels::LEASTS[0], max = Kernels::LEASTS[1]), extend("default" = Kernels::LEAST))]
    pub(crate) least: Option<f64>,
}

impl KernelsSpec {
    /// Returns the names of the kernels for all kinds of data; the others are for grids.
    pub(crate) fn names_for_all() -> impl Iterator<Item = &'static str> {
        Kernel::ALL.into_iter().filter(|(_, kernel)| is_for_all(*kernel)).map(|(name, _)| name)
    }

    /// Returns the schema of what `kernels` may hold beside other data than grids.
    pub(crate) fn not_on_a_grid() -> Value {
        json!({"allOf": [lacks(&["sigma"]), only("kernel", Self::names_for_all())]})
    }

    /// The keys that may also be among those of points.
    pub(crate) const OF_POINTS: [&'static str; 4] = ["kernel", "cut", "model", "least"];

    /// Returns the first of [`Self::OF_POINTS`] that is given.
    pub(crate) fn key(&self) -> Option<&'static str> {
        let given = [self.kernel.is_some(), self.cut.is_some(), self.model.is_some(), self.least.is_some()];
        Self::OF_POINTS.into_iter().zip(given).find(|(_, given)| *given).map(|(key, _)| key)
    }

    /// Checks the keys and returns the kernels, with defaults for the kind of data. `of` is the name of the object.
    pub(crate) fn check(&self, scene: &Path, of: &str, kind: Kind) -> Result<Kernels> {
        let refuse = |key: &str, rule: String| Err(Error::file(scene, format!("{of}.{key}"), rule));
        let mut kernels = match kind {
            Kind::Points => Kernels::of_points(),
            Kind::Grid | Kind::Mesh => Kernels::of_samples(),
        };
        if let Some(name) = &self.kernel {
            let place = format!("{of}.kernel");
            kernels.kernel = Kernel::from_name(name).map_err(|error| error.at_place(scene, &place))?;
            if kind != Kind::Grid && !is_for_all(kernels.kernel) {
                let names = Self::names_for_all().collect::<Vec<_>>().join(" and ");
                let rule = format!("\"{name}\": is for grids; {names} are for all");
                return refuse("kernel", rule);
            }
        }
        if let Some(name) = &self.model {
            let place = format!("{of}.model");
            kernels.model = Model::from_name(name).map_err(|error| error.at_place(scene, &place))?;
        }
        let gaussian = kernels.kernel == Kernel::Gaussian;
        if self.sigma.is_some() && !(gaussian && kind == Kind::Grid) {
            return refuse("sigma", "belongs to gaussian kernels on grids, in voxels".into());
        }
        if self.cut.is_some() && !gaussian {
            return refuse("cut", format!("belongs to gaussian kernels, not to {}", kernels.kernel.name()));
        }
        if self.least.is_some() && kernels.model != Model::Interpolate {
            return refuse("least", "belongs to model interpolate".into());
        }
        kernels.sigma = self.sigma.unwrap_or(kernels.sigma);
        kernels.cut = self.cut.unwrap_or(kernels.cut);
        kernels.least = self.least.unwrap_or(kernels.least);
        kernels.check().map(|()| kernels).map_err(|error| match error {
            // Errors name a parameter as `kernel NAME`, and the kernel itself as `kernel`.
            Error::Invalid { what, why } => {
                Error::file(scene, format!("{of}.{}", what.strip_prefix("kernel ").unwrap_or(&what)), why)
            }
            other => other,
        })
    }
}

/// Returns whether a kernel is for all kinds of data, and not only for grids.
fn is_for_all(kernel: Kernel) -> bool {
    matches!(kernel, Kernel::Gaussian | Kernel::BSpline)
}

/// The kind of data that has kernels.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Grid,
    Mesh,
    Points,
}
