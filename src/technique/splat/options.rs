//! Options that the techniques for splats share.

use crate::error::{Error, Result};
use crate::scene::{Data, Kernel, Kernels, Model, Scene};
use crate::technique::options::{self, Choice, OptionInfo};

pub(crate) const KERNEL: OptionInfo = OptionInfo {
    key: "kernel",
    values: "gaussian|bspline|tent|sinc",
    default: "the scene's",
    effect: "shape of each sample's kernel. Grids: gaussian blurs, tent interpolates trilinearly, bspline and sinc interpolate smoothly. Points: gaussian or bspline",
};
pub(crate) const SIGMA: OptionInfo = OptionInfo {
    key: "sigma",
    values: "a number from 0.1 to 100",
    default: "the scene's, or 0.7",
    effect: "standard deviation of a grid's Gaussians, in voxels: their sum ripples by 4.4e-2 at 0.5, 3.8e-4 at 0.7, 2e-8 at 1; a larger one blurs more",
};
pub(crate) const CUT: OptionInfo = OptionInfo {
    key: "cut",
    values: "a number from 0.5 to 6",
    default: "the scene's, or 3",
    effect: "distance at which Gaussians end, in standard deviations: the cost grows with its cube, the loss falls exponentially",
};
pub(crate) const MODEL: OptionInfo = OptionInfo {
    key: "model",
    values: "density|interpolate",
    default: "the scene's, or density for points and interpolate for grids and meshes",
    effect: "density: samples are classified, and their extinctions add up; interpolate: scalars are interpolated, then classified",
};
pub(crate) const LEAST: OptionInfo = OptionInfo {
    key: "least",
    values: "a number from 1e-6 to 1e6",
    default: "the scene's, or 0.05",
    effect: "with model=interpolate: least sum of weights that is visible",
};
pub(crate) const STEP: OptionInfo = OptionInfo {
    key: "step",
    values: "a positive number",
    default: "1",
    effect: "thickness of slabs: for grids in units of the smallest voxel spacing, for points in median standard deviations; the error is of second order, at jumps of the transfer function of first",
};
pub(crate) const STOP: OptionInfo = OptionInfo {
    key: "stop",
    values: "a number from 0 to below 1",
    default: "2.4e-7",
    effect: "largest colour that a ray may miss when it ends early: an absolute error",
};
pub(crate) const PAIRS: OptionInfo = OptionInfo {
    key: "pairs",
    values: "a whole number from 64",
    default: "as many as a buffer holds",
    effect: "most entries of bins at a time; an image with more is drawn in several bands of tiles",
};

pub(crate) const SPREAD: OptionInfo = OptionInfo {
    key: "spread",
    values: "auto|columns|pixels",
    default: "auto",
    effect: "pixels that an invocation draws. columns: a column of eight, which share what is read of a splat; pixels: one, which fills the subgroups of a GPU; auto: columns on software devices, else pixels. The image is the same but for rounding",
};

/// How the pixels of a tile are divided among invocations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TileSplit {
    /// Chooses columns on software devices, else pixels.
    #[default]
    Auto,
    /// Each invocation draws a column of eight pixels.
    Columns,
    /// Each invocation draws one pixel.
    Pixels,
}

impl Choice for TileSplit {
    const WORDS: &'static [(&'static str, Self)] =
        &[("auto", Self::Auto), ("columns", Self::Columns), ("pixels", Self::Pixels)];
}

/// The properties of kernels that options set; the scene decides the rest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct KernelOptions {
    /// Shape of the kernel.
    pub kernel: Option<Kernel>,
    /// Standard deviation of a grid's Gaussians, in voxels.
    pub sigma: Option<f64>,
    /// Where Gaussians end, in standard deviations.
    pub cut: Option<f64>,
    /// Sum of extinctions, or interpolation of scalars.
    pub model: Option<Model>,
    /// Least sum of weights that is visible.
    pub least: Option<f64>,
}

impl KernelOptions {
    /// Reads one option; returns `false` for a key that is none of these.
    pub(crate) fn read(&mut self, technique: &str, key: &str, text: &str) -> Result<bool> {
        let named = |error: Error| match error {
            Error::Invalid { why, .. } => Error::invalid(format!("{technique} option {key}"), why),
            other => other,
        };
        match key {
            "kernel" => self.kernel = Some(Kernel::from_name(text).map_err(named)?),
            "sigma" => self.sigma = Some(options::positive(technique, key, text)?),
            "cut" => self.cut = Some(options::positive(technique, key, text)?),
            "least" => self.least = Some(options::positive(technique, key, text)?),
            "model" => self.model = Some(Model::from_name(text).map_err(named)?),
            _ => return Ok(false),
        }
        // Numbers can be checked without a scene.
        let whole = Kernels { model: Model::Interpolate, ..self.over(Kernels::of_samples()) };
        whole.check().map_err(named)?;
        Ok(true)
    }

    /// Returns the options as text that [`KernelOptions::read`] reads back.
    pub(crate) fn pairs(&self) -> Vec<(&'static str, String)> {
        let number = |value: Option<f64>| value.map(|value| value.to_string());
        let all = [
            ("kernel", self.kernel.map(|kernel| kernel.name().to_string())),
            ("sigma", number(self.sigma)),
            ("cut", number(self.cut)),
            ("model", self.model.map(|model| model.name().to_string())),
            ("least", number(self.least)),
        ];
        all.into_iter().filter_map(|(key, value)| Some((key, value?))).collect()
    }

    /// Returns `kernels` with the properties that options set replaced.
    fn over(&self, kernels: Kernels) -> Kernels {
        Kernels {
            kernel: self.kernel.unwrap_or(kernels.kernel),
            sigma: self.sigma.unwrap_or(kernels.sigma),
            cut: self.cut.unwrap_or(kernels.cut),
            model: self.model.unwrap_or(kernels.model),
            least: self.least.unwrap_or(kernels.least),
        }
    }

    /// Returns the kernels of a scene.
    ///
    /// Options come first, then the scene's own kernels, then `usual` for grids and meshes and [`Kernels::of_points`]
    /// for points.
    pub(crate) fn of(&self, scene: &Scene, usual: Kernels) -> Result<Kernels> {
        let usual = match scene.data {
            Data::Points(_) => Kernels::of_points(),
            Data::Mesh(_) => Kernels { kernel: Kernel::Gaussian, ..usual },
            Data::Grid(_) => usual,
        };
        let kernels = self.over(scene.kernels.unwrap_or(usual));
        kernels.check()?;
        Ok(kernels)
    }
}
