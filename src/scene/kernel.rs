//! Kernels that reconstruct a field from samples: their shapes, and the two models that turn a sum of kernels
//! into optical properties.

use crate::error::{Error, Result};

/// Selects the shape of a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Kernel {
    /// `exp(-r² / 2)` with r in standard deviations, 0 beyond the cut. On grids it is scaled to unit mass.
    Gaussian,
    /// The cubic B-spline. On grids it is a product of one B-spline along each axis; on points it is a
    /// function of the distance, ends at the radius and has peak 1.
    BSpline,
    /// Grids only: the product of `1 - |x|` along each axis; the sum is trilinear interpolation.
    Tent,
    /// Grids only: the product of `sinc(x) sinc(x / 3)` for `|x| < 3` along each axis (Lanczos). It has
    /// negative lobes.
    Sinc,
}

impl Kernel {
    /// Every kernel with its name, in the order of the enum.
    pub const ALL: [(&'static str, Self); 4] = [
        ("gaussian", Self::Gaussian),
        ("bspline", Self::BSpline),
        ("tent", Self::Tent),
        ("sinc", Self::Sinc),
    ];

    /// Returns the kernel of a name.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] with the allowed names.
    pub fn from_name(name: &str) -> Result<Self> {
        named("kernel", name, &Self::ALL)
    }

    /// Returns the name in scene files and options.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::ALL[self as usize].0
    }
}

/// Returns the entry of a name.
pub(super) fn named<T: Copy>(what: &str, name: &str, all: &[(&str, T)]) -> Result<T> {
    all.iter().find(|(known, _)| *known == name).map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<&str> = all.iter().map(|(name, _)| *name).collect();
        Error::invalid(what, format!("\"{name}\": must be one of {}", names.join(", ")))
    })
}

/// Selects how kernels `K_i` with scalars `s_i` and weights `w_i` become optical properties.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Model {
    /// Pre-classified: extinction is `Σ w_i tau(s_i) K_i`, and the colour is the mean of the kernels'
    /// colours, weighted by extinction. Kernels extend beyond a grid's domain.
    Density,
    /// Post-classified: the scalar is `Σ w_i s_i K_i / Σ w_i K_i` where the sum of weights is at least
    /// [`Kernels::least`]. Elsewhere, and outside a grid's domain, there is vacuum.
    Interpolate,
}

impl Model {
    /// Every model with its name, in the order of the enum.
    pub const ALL: [(&'static str, Self); 2] =
        [("density", Self::Density), ("interpolate", Self::Interpolate)];

    /// Returns the model of a name.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] with the allowed names.
    pub fn from_name(name: &str) -> Result<Self> {
        named("model", name, &Self::ALL)
    }

    /// Returns the name in scene files and options.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::ALL[self as usize].0
    }
}

/// Describes how samples become a field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kernels {
    /// Shape of each kernel.
    pub kernel: Kernel,
    /// Grids and [`Kernel::Gaussian`]: standard deviation, in voxels along each axis. Points have their own:
    /// a third of the radius, or a covariance.
    pub sigma: f64,
    /// [`Kernel::Gaussian`]: distance at which the kernel is cut, in standard deviations.
    pub cut: f64,
    /// Model that turns the sum into optical properties.
    pub model: Model,
    /// [`Model::Interpolate`]: smallest sum of weights that is not vacuum.
    pub least: f64,
}

impl Kernels {
    /// Default of [`Self::least`].
    pub const LEAST: f64 = 0.05;
    /// Least and largest allowed [`Self::sigma`].
    pub const SIGMA: [f64; 2] = [0.1, 100.0];
    /// Least and largest allowed [`Self::cut`].
    pub const CUT: [f64; 2] = [0.5, 6.0];
    /// Least and largest allowed [`Self::least`].
    pub const LEASTS: [f64; 2] = [1e-6, 1e6];

    /// Returns the default for points: the density model with Gaussians.
    #[must_use]
    pub fn of_points() -> Self {
        Self { kernel: Kernel::Gaussian, sigma: 0.7, cut: 3.0, model: Model::Density, least: Self::LEAST }
    }

    /// Returns the default for grids and the points of meshes: the interpolation model with Gaussians.
    #[must_use]
    pub fn of_samples() -> Self {
        Self { model: Model::Interpolate, ..Self::of_points() }
    }

    /// Returns the half-width of a kernel on a grid along each axis, in voxels.
    #[must_use]
    pub fn reach(&self) -> f64 {
        match self.kernel {
            Kernel::Gaussian => self.sigma * self.cut,
            Kernel::BSpline => 2.0,
            Kernel::Tent => 1.0,
            Kernel::Sinc => 3.0,
        }
    }

    /// Returns the peak of a kernel on a grid, which gives the kernel unit mass in voxels, or 0.997³ for
    /// Lanczos.
    #[must_use]
    pub fn peak_on_grid(&self) -> f64 {
        match self.kernel {
            Kernel::Gaussian => (self.sigma * (2.0 * std::f64::consts::PI).sqrt()).powi(-3) / self.mass(),
            Kernel::BSpline => 8.0 / 27.0,
            Kernel::Tent | Kernel::Sinc => 1.0,
        }
    }

    /// Returns the mass of a cut Gaussian in space, as a share of the whole.
    ///
    /// `erf(x) - 2 x exp(-x²) / sqrt(pi)` with `x = cut / sqrt(2)`, by the series of the incomplete gamma
    /// function, whose terms are all positive.
    fn mass(&self) -> f64 {
        let x = 0.5 * self.cut * self.cut;
        // x^(3/2) exp(-x) / Gamma(5/2)
        let mut term = x * x.sqrt() * (-x).exp() * 4.0 / (3.0 * std::f64::consts::PI.sqrt());
        let mut sum = 0.0;
        for k in 0..200 {
            sum += term;
            term *= x / (f64::from(k) + 2.5);
        }
        sum
    }

    /// Checks the numbers and the combination: a kernel with negative lobes requires the interpolation model.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] naming the number and the rule.
    pub fn check(&self) -> Result<()> {
        let within = |name: &str, value: f64, [low, high]: [f64; 2]| {
            let fits = value >= low && value <= high;
            let why = || format!("{value}: must be a number from {low} to {high}");
            fits.then_some(()).ok_or_else(|| Error::invalid(format!("kernel {name}"), why()))
        };
        within("sigma", self.sigma, Self::SIGMA)?;
        within("cut", self.cut, Self::CUT)?;
        within("least", self.least, Self::LEASTS)?;
        if self.kernel == Kernel::Sinc && self.model == Model::Density {
            let why = "sinc has negative lobes: it requires the model interpolate";
            return Err(Error::invalid("kernel", why));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaussians_on_a_grid_have_unit_mass_after_the_cut() {
        for (cut, mass) in [(1.0, 0.198_748_043_098_8), (3.0, 0.970_709_113_465_1), (6.0, 0.999_999_925_1)] {
            let kernels = Kernels { cut, ..Kernels::of_samples() };
            assert!((kernels.mass() - mass).abs() < 1e-10, "{cut}: {}", kernels.mass());
        }
        // Sum over spherical shells.
        let kernels = Kernels { sigma: 0.8, cut: 2.5, ..Kernels::of_samples() };
        let step = 1e-4 * kernels.reach();
        let shell = |i: i32| {
            let r = (f64::from(i) + 0.5) * step;
            4.0 * std::f64::consts::PI * r * r * (-0.5 * (r / 0.8).powi(2)).exp() * step
        };
        let sum: f64 = (0..10_000).map(shell).sum();
        assert!((sum * kernels.peak_on_grid() - 1.0).abs() < 1e-7);
    }

    #[test]
    fn names_read_back_and_numbers_are_checked() {
        for (name, kernel) in Kernel::ALL {
            assert_eq!((Kernel::from_name(name).unwrap(), kernel.name()), (kernel, name));
        }
        assert!(Kernel::from_name("box").unwrap_err().to_string().contains("tent"));
        let kernels = Kernels::of_samples();
        assert!(kernels.check().is_ok());
        assert!(Kernels { sigma: f64::NAN, ..kernels }.check().unwrap_err().to_string().contains("sigma"));
        assert!(Kernels { cut: 0.1, ..kernels }.check().unwrap_err().to_string().contains("cut"));
        assert!(Kernels { least: 0.0, ..kernels }.check().unwrap_err().to_string().contains("least"));
        let sinc = Kernels { kernel: Kernel::Sinc, ..kernels };
        assert!(sinc.check().is_ok() && Kernels { model: Model::Density, ..sinc }.check().is_err());
    }
}
