//! The key `kernels`, and the keys of kernels among those of points.

use std::path::Path;

use serde::Deserialize;

use crate::error::{Error, Result};
use crate::scene::{Kernel, Kernels, Model};

/// The object `kernels`, for any data.
#[derive(Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with `kernel`, `sigma`, `cut`, `model`, `least`")]
pub(crate) struct KernelsSpec {
    pub(crate) kernel: Option<String>,
    pub(crate) sigma: Option<f64>,
    pub(crate) cut: Option<f64>,
    pub(crate) model: Option<String>,
    pub(crate) least: Option<f64>,
}

impl KernelsSpec {
    /// Returns the first key that is given.
    pub(crate) fn key(&self) -> Option<&'static str> {
        let keys = [
            ("kernel", self.kernel.is_some()),
            ("sigma", self.sigma.is_some()),
            ("cut", self.cut.is_some()),
            ("model", self.model.is_some()),
            ("least", self.least.is_some()),
        ];
        keys.into_iter().find(|(_, given)| *given).map(|(key, _)| key)
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
            if kind != Kind::Grid && !matches!(kernels.kernel, Kernel::Gaussian | Kernel::BSpline) {
                let rule = format!("\"{name}\": is for grids; gaussian and bspline are for all");
                return refuse("kernel", rule);
            }
        }
        if let Some(name) = &self.model {
            let models = [Model::Density, Model::Interpolate];
            let Some(model) = models.into_iter().find(|model| model.name() == name) else {
                let names = models.map(Model::name).join(", ");
                return refuse("model", format!("\"{name}\": must be one of {names}"));
            };
            kernels.model = model;
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

/// The kind of data that has kernels.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Grid,
    Mesh,
    Points,
}
