//! Options of techniques: their description, and how they are read. Options that several kinds of technique share.

use serde::Serialize;

use crate::error::{Error, Result};
use crate::resident::tables::{Integrator, SegmentOptions};
use crate::technique::options;

/// The description of one option of a technique, as `volraster techniques` prints it.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct OptionInfo {
    /// Key.
    pub key: &'static str,
    /// Allowed values.
    pub values: &'static str,
    /// Value without the option.
    pub default: &'static str,
    /// Effect on error and time.
    pub effect: &'static str,
}

/// An option whose allowed values are names.
pub(crate) trait Choice: Copy + PartialEq + 'static {
    /// The names with their values.
    const WORDS: &'static [(&'static str, Self)];

    /// The name of a value.
    fn word(self) -> &'static str {
        Self::WORDS.iter().find(|(_, value)| *value == self).map_or("?", |(word, _)| word)
    }
}

/// Reads the name of a value.
pub(crate) fn choice<C: Choice>(technique: &str, key: &str, text: &str) -> Result<C> {
    C::WORDS.iter().find(|(word, _)| *word == text).map(|(_, value)| *value).ok_or_else(|| {
        let words: Vec<&str> = C::WORDS.iter().map(|(word, _)| *word).collect();
        Error::invalid(
            format!("{technique} option {key}"),
            format!("\"{text}\": must be one of {}", words.join(", ")),
        )
    })
}

/// Reads a positive, finite number.
pub(crate) fn positive(technique: &str, key: &str, text: &str) -> Result<f64> {
    let number = text.parse::<f64>().ok().filter(|n| n.is_finite() && *n > 0.0);
    number.ok_or_else(|| {
        Error::invalid(
            format!("{technique} option {key}"),
            format!("\"{text}\": must be a number that is positive and finite"),
        )
    })
}

/// Makes the error of an unknown key.
pub(crate) fn unknown(technique: &str, key: &str, options: &[OptionInfo]) -> Error {
    let keys: Vec<&str> = options.iter().map(|option| option.key).collect();
    Error::invalid(format!("{technique} option \"{key}\""), format!("must be one of {}", keys.join(", ")))
}

/// Reads a whole number.
pub(crate) fn whole(
    technique: &str,
    key: &str,
    text: &str,
    allowed: std::ops::RangeInclusive<u32>,
) -> Result<u32> {
    text.parse().ok().filter(|number| allowed.contains(number)).ok_or_else(|| {
        Error::invalid(
            format!("{technique} option {key}"),
            format!("\"{text}\": must be a whole number from {} to {}", allowed.start(), allowed.end()),
        )
    })
}

/// Reads a number from 0 to below 1.
pub(crate) fn below_one(technique: &str, key: &str, text: &str) -> Result<f64> {
    let number = text.parse::<f64>().ok().filter(|n| (0.0..1.0).contains(n));
    number.ok_or_else(|| {
        Error::invalid(
            format!("{technique} option {key}"),
            format!("\"{text}\": must be a number from 0 to below 1"),
        )
    })
}

/// The order in which slabs or primitives are blended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlendOrder {
    /// The operator "over".
    BackToFront,
    /// The operator "under".
    FrontToBack,
}

/// How a technique uses the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Route {
    /// Compute, unless an option needs raster.
    Auto,
    /// Polygons and fixed-function blending.
    Raster,
    /// One invocation per pixel composites in registers.
    Compute,
}

/// The treatment of bricks in which nothing is visible.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EmptySpace {
    /// Skipped, where pixels are composited in registers.
    Skip,
    /// Sampled like all others.
    March,
}

impl Choice for BlendOrder {
    const WORDS: &'static [(&'static str, Self)] =
        &[("back-to-front", Self::BackToFront), ("front-to-back", Self::FrontToBack)];
}

impl Choice for Route {
    const WORDS: &'static [(&'static str, Self)] =
        &[("auto", Self::Auto), ("raster", Self::Raster), ("compute", Self::Compute)];
}

impl Choice for EmptySpace {
    const WORDS: &'static [(&'static str, Self)] = &[("skip", Self::Skip), ("march", Self::March)];
}

/// Option `table` of techniques that integrate segments.
pub(crate) const TABLE: OptionInfo = OptionInfo {
    key: "table",
    values: "a whole number from 2 to 65536 (full: to 1024)",
    default: "4096 (full: 256)",
    effect: "bins of the integral's table (64 bytes each), nodes on each axis of the full one (192 bytes for each pair); features of the transfer function that are narrower than a bin are blurred",
};

impl Choice for Integrator {
    const WORDS: &'static [(&'static str, Self)] = &[
        ("midpoint", Self::Midpoint),
        ("integral", Self::Integral),
        ("full", Self::Full),
        ("exact", Self::Exact),
        ("smoke", Self::Smoke),
    ];
}

impl SegmentOptions {
    /// Reads one option. Returns `false` when the key is none of these.
    pub(crate) fn read(&mut self, technique: &str, key: &str, text: &str) -> Result<bool> {
        match key {
            "integrator" => self.integrator = options::choice(technique, key, text)?,
            "table" => self.table = Some(options::whole(technique, key, text, 2..=65_536)?),
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// The options in force, as text that reads back to them.
    pub(crate) fn pairs(&self) -> Vec<(&'static str, String)> {
        let mut pairs = vec![("integrator", self.integrator.word().to_string())];
        pairs.extend(self.table.map(|size| ("table", size.to_string())));
        pairs
    }

    /// Checks integrator and table together. `midpoint` says whether the technique may classify samples.
    pub(crate) fn check(&self, technique: &str, midpoint: bool) -> Result<()> {
        let refuse = |key: &str, why: String| Err(Error::invalid(format!("{technique} option {key}"), why));
        if self.integrator == Integrator::Midpoint && !midpoint {
            return refuse("integrator", "midpoint: must be one of integral, full, exact".to_string());
        }
        if self.integrator == Integrator::Smoke {
            return refuse(
                "integrator",
                "smoke: must be one of integral, full, exact; smoke is for meshes".to_string(),
            );
        }
        let most = match self.integrator {
            Integrator::Integral => 65_536,
            Integrator::Full => 1024,
            Integrator::Midpoint | Integrator::Exact | Integrator::Smoke if self.table.is_some() => {
                return refuse("table", format!("integrator={} has no table", self.integrator.word()));
            }
            Integrator::Midpoint | Integrator::Exact | Integrator::Smoke => return Ok(()),
        };
        match self.table {
            Some(size) if !(2..=most).contains(&size) => {
                refuse("table", format!("{size}: must be from 2 to {most}"))
            }
            _ => Ok(()),
        }
    }
}
