//! The rules by which trained splats are drawn.

use super::TrainedMode;
use super::kernel::named;
use crate::error::{Error, Result};

/// A rule by which trained splats are projected, ordered and blended. Scenes are trained under one, and look different under others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SplatRule {
    /// That of `KHR_gaussian_splatting`: ellipses of the affine projection, cut at three standard deviations, ordered by the distance of
    /// centres.
    Khr,
    /// That of the first paper (Kerbl, Kopanas, Leimkühler and Drettakis 2023): ellipses widened by 0.3 pixels², ordered by depth, with
    /// the thresholds of its program.
    Inria,
    /// The same with opacities that make up for the widening (Yu, Chen, Huang, Sattler and Geiger 2024).
    Antialiased,
    /// The greatest opacity along each ray, in the order of the places where it is met.
    Ray,
    /// Splats as extinction along each ray, which overlap: one alone looks as by `Ray`.
    Overlap,
    /// The same with an extinction that is Gaussian, where the others' opacity is (Celarek and others 2025).
    Integral,
}

impl SplatRule {
    /// All rules by name.
    pub const ALL: [(&'static str, Self); 6] = [
        ("khr", Self::Khr),
        ("inria", Self::Inria),
        ("antialiased", Self::Antialiased),
        ("ray", Self::Ray),
        ("overlap", Self::Overlap),
        ("integral", Self::Integral),
    ];

    /// Returns its name in scene files and options.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, rule)| *rule == self).map_or("?", |(name, _)| name)
    }

    /// Finds the rule of a name.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] for an unknown name; it lists the known ones.
    pub fn named(name: &str) -> Result<Self> {
        named("rule", name, &Self::ALL)
    }

    /// Returns whether splats are extinction along each ray, which overlaps, so that they have no order.
    #[must_use]
    pub fn overlaps(self) -> bool {
        matches!(self, Self::Overlap | Self::Integral)
    }

    /// Returns the rule that splats were trained under; that of the first paper where nothing is known.
    #[must_use]
    pub fn of(mode: TrainedMode) -> Self {
        match mode {
            TrainedMode::Unknown | TrainedMode::Default => Self::Inria,
            TrainedMode::Antialiased => Self::Antialiased,
            TrainedMode::Khronos => Self::Khr,
            // A flat splat is met where the ray goes through its plane.
            TrainedMode::Flat => Self::Ray,
        }
    }

    /// Whether a splat has a depth of its own on each ray, so that surfaces, clip planes and depth images can cut it.
    #[must_use]
    pub fn has_depth(self) -> bool {
        matches!(self, Self::Ray | Self::Overlap | Self::Integral)
    }

    /// Checks that splats have depths of their own where `what` needs them.
    pub(crate) fn check_depth(self, what: &str) -> Result<()> {
        if self.has_depth() {
            return Ok(());
        }
        let others: Vec<&str> =
            Self::ALL.iter().filter(|(_, rule)| rule.has_depth()).map(|(name, _)| *name).collect();
        let others = others.join(", ");
        let why =
            format!("{}: its splats have no depth on a ray, which {what} need; {others} have", self.name());
        Err(Error::invalid("rule", why))
    }
}
