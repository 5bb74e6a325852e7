//! Kernels that make a field of samples: their shapes, and the two models by which a sum of kernels is optics.

use crate::error::{Error, Result};

/// The shape of a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Kernel {
    /// `exp(-r² / 2)` with r in standard deviations, 0 beyond the cut. On grids of unit weight in all.
    Gaussian,
    /// The cubic B-spline: on grids the product of one along each axis, on points that of the distance, which spans
    /// the radius, with peak 1.
    BSpline,
    /// Grids only: the product of `1 - |x|` along each axis, whose sum is trilinear interpolation.
    Tent,
    /// Grids only: the product of `sinc(x) sinc(x / 3)` for `|x| < 3` along each axis (Lanczos). Its lobes are negative.
    Sinc,
}

impl Kernel {
    /// Every kernel, by name.
    pub const ALL: [(&'static str, Self); 4] = [
        ("gaussian", Self::Gaussian),
        ("bspline", Self::BSpline),
        ("tent", Self::Tent),
        ("sinc", Self::Sinc),
    ];

    /// The kernel of a name.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] with the names that there are.
    pub fn from_name(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|(known, _)| *known == name).map(|(_, kernel)| kernel).ok_or_else(|| {
            let names: Vec<&str> = Self::ALL.iter().map(|(name, _)| *name).collect();
            Error::invalid("kernel", format!("\"{name}\": must be one of {}", names.join(", ")))
        })
    }

    /// The name in scene files and options.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Gaussian => "gaussian",
            Self::BSpline => "bspline",
            Self::Tent => "tent",
            Self::Sinc => "sinc",
        }
    }
}

/// How kernels `K_i` with scalars `s_i` and weights `w_i` become optics.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Model {
    /// Pre-classified: extinction is `Σ w_i tau(s_i) K_i`, colour the mean of the kernels' colours by extinction. Not
    /// cut at a grid's domain.
    Density,
    /// Post-classified: the scalar is `Σ w_i s_i K_i / Σ w_i K_i`, where that weight is at least [`Kernels::least`];
    /// vacuum elsewhere, and outside of a grid's domain.
    Interpolate,
}

impl Model {
    /// The model of a name.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] with the names that there are.
    pub fn from_name(name: &str) -> Result<Self> {
        match name {
            "density" => Ok(Self::Density),
            "interpolate" => Ok(Self::Interpolate),
            _ => Err(Error::invalid("model", format!("\"{name}\": must be one of density, interpolate"))),
        }
    }

    /// The name in scene files and options.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Density => "density",
            Self::Interpolate => "interpolate",
        }
    }
}

/// How samples become a field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kernels {
    /// Shape of each kernel.
    pub kernel: Kernel,
    /// Grids and [`Kernel::Gaussian`]: standard deviation, in voxels along each axis. Points have theirs: a third of
    /// the radius, or a covariance.
    pub sigma: f64,
    /// [`Kernel::Gaussian`]: distance at which it is cut, in standard deviations.
    pub cut: f64,
    /// What is made of the sum.
    pub model: Model,
    /// [`Model::Interpolate`]: the least sum of weights that shows anything.
    pub least: f64,
}

impl Kernels {
    /// Sum of weights below which nothing is shown, unless told otherwise.
    pub const LEAST: f64 = 0.05;

    /// For points: Gaussians that add up.
    #[must_use]
    pub fn of_points() -> Self {
        Self { kernel: Kernel::Gaussian, sigma: 0.7, cut: 3.0, model: Model::Density, least: Self::LEAST }
    }

    /// For grids and for the points of meshes: a scalar that Gaussians interpolate.
    #[must_use]
    pub fn of_samples() -> Self {
        Self { model: Model::Interpolate, ..Self::of_points() }
    }

    /// Reach of a kernel on a grid along each axis, in voxels.
    #[must_use]
    pub fn reach(&self) -> f64 {
        match self.kernel {
            Kernel::Gaussian => self.sigma * self.cut,
            Kernel::BSpline => 2.0,
            Kernel::Tent => 1.0,
            Kernel::Sinc => 3.0,
        }
    }

    /// Peak of a kernel on a grid: with it, a kernel's integral over space, in voxels, is 1; Lanczos' 0.997³.
    #[must_use]
    pub fn peak_on_grid(&self) -> f64 {
        match self.kernel {
            Kernel::Gaussian => (self.sigma * (2.0 * std::f64::consts::PI).sqrt()).powi(-3) / self.mass(),
            Kernel::BSpline => 8.0 / 27.0,
            Kernel::Tent | Kernel::Sinc => 1.0,
        }
    }

    /// What the cut leaves of a Gaussian in space: `erf(x) - 2 x exp(-x²) / sqrt(pi)` with `x = cut / sqrt(2)`, by the series of
    /// the incomplete gamma function, whose terms are all positive.
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

    /// Checks the numbers, and that shape and model go together: negative lobes are for scalars only.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] naming number and rule.
    pub fn check(&self) -> Result<()> {
        let within = |name: &str, value: f64, low: f64, high: f64| {
            let fits = value >= low && value <= high;
            let why = || format!("{value}: must be a number from {low} to {high}");
            fits.then_some(()).ok_or_else(|| Error::invalid(format!("kernel {name}"), why()))
        };
        within("sigma", self.sigma, 0.1, 100.0)?;
        within("cut", self.cut, 0.5, 6.0)?;
        within("least", self.least, 1e-6, 1e6)?;
        if self.kernel == Kernel::Sinc && self.model == Model::Density {
            let why = "sinc has negative lobes: it is for model interpolate";
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
        // Summed up over shells.
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
