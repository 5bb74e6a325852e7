//! The interface of a technique: its facts, the rules between its options, and how it prepares frames.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::frame::prepared::Prepared;
use crate::frame::target::Canvas;
use crate::frame::upsampling::Drawn;
use crate::resident::GpuScene;
use crate::scene::{Data, Kernel, Kernels, Model, Scene, SplatRule, View};
use crate::technique::declare::{self, OptionBits as _, OptionSet, Resolution};

/// The fixed description of a technique: its name and source, and the scenes and routes that it supports.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Facts {
    /// Name in scene files, on the command line, and of passes and counters.
    pub(crate) name: &'static str,
    /// Description in one line.
    pub(crate) summary: &'static str,
    /// Authors and year of the paper.
    pub(crate) source: &'static str,
    /// Kinds of data that it draws, as [`crate::scene::Data::kind`] names them, first the one that it is made for.
    pub(crate) data: &'static [&'static str],
    /// Kernels of scenes that it draws; none where it interpolates samples itself.
    pub(crate) kernels: &'static [Kernel],
    /// Routes; a device may lack some.
    pub(crate) routes: &'static [&'static str],
    /// Whether it splits rays at translucent surfaces, instead of blending whole splats or cells, or rays that several pixels share.
    pub(crate) splits_rays: bool,
    /// Modes of scenes that it draws beside emission, as [`crate::scene::Mode::name`] names them.
    pub(crate) modes: &'static [&'static str],
    /// Settings, each with a test scene and the errors that it keeps there.
    pub(crate) samples: &'static [Sample],
    /// Settings among which one is chosen for a goal.
    pub(crate) families: &'static [Family],
}

/// The name of a test scene, options, and upper bounds of RMSE and largest error there: about twice the errors on lavapipe 22.3.6 and
/// 25.0.7. Bounds below 1e-4 leave only rounding. The self-test has the scenes and draws every sample.
pub type Sample = (&'static str, &'static str, [f64; 2]);

/// Settings that differ in one option, along which errors fall and times rise: the scenes that they draw as the reference does, options, and
/// the values that are appended to them.
pub(crate) type Family = (Of, &'static str, &'static [&'static str]);

/// Steps of a family, from too coarse to finer than most goals need.
pub(crate) const STEPS: &[&str] = &["8", "4", "2", "1", "0.5", "0.25", "0.125", "0.0625"];

/// Kinds of scenes that a family draws as the reference does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Of {
    /// Grids without kernels.
    Grids,
    /// Meshes without kernels.
    Meshes,
    /// Gaussians with the density model.
    Densities,
    /// Gaussians with either model.
    Gaussians,
    /// Other kernels, except for meshes.
    Others,
    /// Trained splats by rules that blend them in order.
    Ordered,
    /// Trained splats by rules in which they overlap.
    Overlapping,
}

impl Of {
    /// Returns whether a scene is of the kind.
    pub(crate) fn is(self, scene: &Scene) -> bool {
        let kernels = match (&scene.data, scene.kernels) {
            (Data::Grid(_), None) => return self == Self::Grids,
            (Data::Mesh(_), None) => return self == Self::Meshes,
            (Data::Gaussians(_), _) => {
                let overlaps = scene.splat_rule().is_some_and(SplatRule::overlaps);
                return self == if overlaps { Self::Overlapping } else { Self::Ordered };
            }
            (Data::Points(_), None) => Kernels::of_points(),
            (_, Some(kernels)) => kernels,
        };
        let gaussian = kernels.kernel == Kernel::Gaussian;
        match self {
            Self::Grids | Self::Meshes | Self::Ordered | Self::Overlapping => false,
            Self::Densities => gaussian && kernels.model == Model::Density,
            Self::Gaussians => gaussian,
            Self::Others => !gaussian && scene.mesh().is_none(),
        }
    }
}

/// The options of a technique, with its facts.
pub(crate) trait TechniqueOptions: OptionSet {
    /// The fixed description of the technique.
    const FACTS: Facts;

    /// Its name.
    const NAME: &'static str = Self::FACTS.name;

    /// Returns the key of the option that a pair sets; it differs where an option accepts words of another one.
    fn key<'a>(key: &'a str, _text: &str) -> &'a str {
        key
    }

    /// Checks the rules between options.
    fn check(&self) -> Result<()> {
        Ok(())
    }
}

/// A technique that draws with given options.
pub(crate) trait Draw: TechniqueOptions {
    /// Builds the frame of a view. The options were checked.
    fn prepare(&self, scene: &Arc<GpuScene>, view: &View, target: &Canvas) -> Result<Box<dyn Prepared>>;
}

/// Reads `key`, `value` pairs.
pub(crate) fn parse<T: TechniqueOptions>(pairs: &[(String, String)]) -> Result<T> {
    let mut options = T::default();
    for (i, (key, text)) in pairs.iter().enumerate() {
        let known = T::key(key, text);
        if pairs[..i].iter().any(|(key, text)| T::key(key, text) == known) {
            return Err(Error::invalid(format!("{} option {key}", T::NAME), "is given twice"));
        }
        declare::set(&mut options, T::NAME, known, text)?;
    }
    check(&options)?;
    Ok(options)
}

/// Returns which pixels are drawn, by the options `resolution` and `refine`; techniques may lack them.
pub(crate) fn drawn<T: TechniqueOptions>(options: &T) -> Drawn {
    Drawn {
        side: 1 << options.bits(T::NAME, "resolution").unwrap_or(Resolution::Full as u32),
        refine: options.bits(T::NAME, "refine").ok().map(f32::from_bits),
        pieces: T::FACTS.splits_rays && T::FACTS.data.contains(&"grid"),
    }
}

/// Checks each value, then the rules between options.
pub(crate) fn check<T: TechniqueOptions>(options: &T) -> Result<()> {
    declare::check(options, T::NAME)?;
    options.check()
}
