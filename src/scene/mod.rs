//! Scenes: data, transfer function, kernels, surfaces and camera, all without Vulkan.
//!
//! The data are grids, tetrahedral meshes, points or trained Gaussian splats. Every value is checked when it is made, so whoever holds
//! a [`Scene`] holds a valid one.
//!
//! This room uses only `error`, `image` and `num`. Readers make scenes; the reference, the device's copies and the
//! techniques use them.

mod affine;
pub mod auto;
mod axes;
pub(crate) mod boxes;
mod camera;
#[cfg(feature = "io")]
mod cells;
mod clip;
mod colour_map;
#[cfg(feature = "io")]
mod cut;
mod data;
pub(crate) mod field;
mod gaussians;
pub(crate) mod grid;
pub mod harmonics;
mod kernel;
mod mode;
mod opacity;
mod points;
pub(crate) mod predicates;
pub mod presets;
mod rule;
mod samples;
mod surface;
mod tets;
pub(crate) mod topology;
pub(crate) mod transfer;

pub use axes::{Axes, StoredAxes};
pub use camera::{Camera, ClipY, Projection, View};
#[cfg(feature = "io")]
pub use cells::CellKind;
pub use clip::{Clip, ClipPlane};
pub use colour_map::ColourMap;
pub use data::Data;
pub use field::Field;
pub use gaussians::{Dropped, GaussianParts, Gaussians, TrainedMode};
pub use grid::{Anatomy, Grid, Rescale};
pub use kernel::{Kernel, Kernels, Model};
pub use mode::{Lighting, Mode};
pub use opacity::Opacity;
pub use points::{KernelSize, Points};
pub use rule::SplatRule;
#[cfg(feature = "zarr")]
pub(crate) use samples::OVERVIEW;
pub(crate) use samples::SampleKind;
pub use samples::{OnDemand, Overview, SampleSource, Samples};
pub use surface::{Shading, Surface};
#[cfg(any(test, feature = "io"))]
pub(crate) use tets::Orientation;
pub use tets::{Mended, TetScalars, Tets};
pub use transfer::{Knot, TransferFunction};

use crate::error::{Error, Result};
use crate::image::Colours;

/// A volume with the optical properties of its scalars. Every technique and the reference draw one.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The data.
    pub data: Data,
    /// The transfer function, which maps a scalar to emission and extinction. Gaussian splats have colours of their own
    /// and ignore it.
    pub transfer: TransferFunction,
    /// Kernels that reconstruct a field from the samples. `None` selects the default of the data: trilinear
    /// interpolation in a grid, linear interpolation in the cells of a mesh, [`Kernels::of_points`] for
    /// points.
    pub kernels: Option<Kernels>,
    /// Opaque and translucent triangle meshes inside the volume.
    pub surfaces: Vec<Surface>,
    /// What the ray of a pixel shows.
    pub mode: Mode,
    /// The rule by which trained splats are drawn. `None` selects the one that they were trained under.
    pub rule: Option<SplatRule>,
}

impl Scene {
    /// Makes a scene of data, without kernels and surfaces, that shows emission and absorption.
    #[must_use]
    pub fn new(data: impl Into<Data>, transfer: TransferFunction) -> Self {
        Self {
            data: data.into(),
            transfer,
            kernels: None,
            surfaces: Vec::new(),
            mode: Mode::Emission,
            rule: None,
        }
    }

    /// Returns the scene with its field reconstructed by kernels: at the samples of a grid, the points of a
    /// mesh, or points.
    ///
    /// The reference and the splatting techniques draw such a scene; all other techniques refuse it.
    ///
    /// # Errors
    ///
    /// As [`Kernels::check`]; [`Error::Invalid`] for a kernel that this kind of data does not support.
    pub fn with_kernels(mut self, kernels: Kernels) -> Result<Self> {
        kernels.check()?;
        if matches!(self.data, Data::Gaussians(_)) {
            return Err(Error::invalid(
                "kernels",
                "the scene holds gaussians, which are kernels of their own",
            ));
        }
        let of_grids = matches!(kernels.kernel, Kernel::Tent | Kernel::Sinc);
        if of_grids && !matches!(self.data, Data::Grid(_)) {
            let why =
                format!("{}: requires a grid, the scene holds a {}", kernels.kernel.name(), self.data.kind());
            return Err(Error::invalid("kernel", why));
        }
        self.kernels = Some(kernels);
        Ok(self)
    }

    /// Returns the scene with these triangle meshes in it, in place of its own.
    #[must_use]
    pub fn with_surfaces(self, surfaces: Vec<Surface>) -> Self {
        Self { surfaces, ..self }
    }

    /// Returns the scene with another mode.
    ///
    /// # Errors
    ///
    /// As [`Mode::check`]; [`Error::Invalid`] for a mode other than [`Mode::Emission`] unless the scene holds a grid without
    /// kernels.
    pub fn with_mode(self, mode: Mode) -> Result<Self> {
        let scene = Self { mode, ..self };
        scene.check_mode().map(|()| scene)
    }

    /// Returns the scene with another rule for trained splats; other data have none.
    #[must_use]
    pub fn with_rule(self, rule: SplatRule) -> Self {
        Self { rule: Some(rule), ..self }
    }

    /// Returns what the numbers of colours are in its images: trained splats are blended as they are displayed.
    #[must_use]
    pub fn colours(&self) -> Colours {
        if self.gaussians().is_some() { Colours::Displayed } else { Colours::Linear }
    }

    /// Returns the rule by which trained splats are drawn, if the data are such.
    #[must_use]
    pub fn splat_rule(&self) -> Option<SplatRule> {
        let Data::Gaussians(splats) = &self.data else { return None };
        Some(self.rule.unwrap_or_else(|| SplatRule::of(splats.mode())))
    }

    /// Checks the mode, as [`Self::with_mode`] does.
    pub(crate) fn check_mode(&self) -> Result<()> {
        self.mode.check()?;
        if self.mode != Mode::Emission && (self.grid().is_none() || self.kernels.is_some()) {
            let kernels = if self.kernels.is_some() { " of kernels" } else { "" };
            let (mode, kind) = (self.mode.name(), self.data.kind());
            return Err(Error::invalid(
                "mode",
                format!("{mode}: requires a grid, the scene holds a {kind}{kernels}"),
            ));
        }
        Ok(())
    }

    /// Returns the grid if the data is one.
    #[must_use]
    pub fn grid(&self) -> Option<&Grid> {
        if let Data::Grid(grid) = &self.data { Some(grid) } else { None }
    }

    /// Returns the mesh if the data is one.
    #[must_use]
    pub fn mesh(&self) -> Option<&Tets> {
        if let Data::Mesh(mesh) = &self.data { Some(mesh) } else { None }
    }

    /// Returns the Gaussian splats if the data is such.
    #[must_use]
    pub fn gaussians(&self) -> Option<&Gaussians> {
        if let Data::Gaussians(gaussians) = &self.data { Some(gaussians) } else { None }
    }

    /// Returns the points if the data is points.
    #[must_use]
    pub fn points(&self) -> Option<&Points> {
        if let Data::Points(points) = &self.data { Some(points) } else { None }
    }
}
