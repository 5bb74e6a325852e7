//! The interface of a technique: its facts, the rules between its options, and how it prepares frames.

use std::sync::Arc;

use crate::error::Result;
use crate::frame::prepared::Prepared;
use crate::frame::target::Canvas;
use crate::resident::GpuScene;
use crate::scene::{Kernel, View};
use crate::technique::declare::{self, OptionSet};

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
    for (key, text) in pairs {
        declare::set(&mut options, T::NAME, T::key(key, text), text)?;
    }
    check(&options)?;
    Ok(options)
}

/// Checks each value, then the rules between options.
pub(crate) fn check<T: TechniqueOptions>(options: &T) -> Result<()> {
    declare::check(options, T::NAME)?;
    options.check()
}
