//! Options that techniques for meshes share.

use crate::error::{Error, Result};
use crate::resident::tables::{Integrator, SegmentOptions};
use crate::technique::options::{self, BlendOrder, Choice, EmptySpace, OptionInfo};

pub(crate) const INTEGRATOR: OptionInfo = OptionInfo {
    key: "integrator",
    values: "exact|integral|full|smoke",
    default: "exact",
    effect: "how a cell is integrated: exact without a table, cut at the knots; integral from 1-D tables, opacity exact and colour second order in the cell's optical depth; full from a 2-D table for 12 thicknesses; smoke: extinction is the mean scalar times the option smoke",
};
pub(crate) const SMOKE: OptionInfo = OptionInfo {
    key: "smoke",
    values: "a positive number",
    default: "1",
    effect: "with integrator=smoke: extinction per unit of the scalar",
};
pub(crate) const ORDER: OptionInfo = OptionInfo {
    key: "order",
    values: "front-to-back|back-to-front",
    default: "front-to-back",
    effect: "direction in which ranks and compositing go; the image is the same but for rounding",
};
pub(crate) const EMPTY_SPACE: OptionInfo = OptionInfo {
    key: "empty-space",
    values: "skip|march",
    default: "skip",
    effect: "skip leaves out cells in whose range of scalars nothing is visible; march draws them all, for the same image",
};
pub(crate) const STOP: OptionInfo = OptionInfo {
    key: "stop",
    values: "a number from 0 to below 1",
    default: "0",
    effect: "colour that what lies behind may still add where a line ends: an absolute error; what is behind is not checked for order either",
};

/// What becomes of pixels whose faces or cells did not come in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Repair {
    /// They are drawn again from sorted lists.
    Exact,
    /// They are counted.
    None,
}

impl Choice for Repair {
    const WORDS: &'static [(&'static str, Self)] = &[("exact", Self::Exact), ("none", Self::None)];
}

/// Options that techniques for meshes share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshOptions {
    /// How cells are integrated.
    pub segments: SegmentOptions,
    /// With [`Integrator::Smoke`]: extinction per unit of the scalar.
    pub smoke: f64,
    /// Direction of ranks and compositing.
    pub order: BlendOrder,
    /// Colour that may be left out where a line ends.
    pub stop: f64,
    /// What becomes of cells in which nothing is visible.
    pub empty_space: EmptySpace,
}

impl Default for MeshOptions {
    fn default() -> Self {
        let segments = SegmentOptions { integrator: Integrator::Exact, table: None };
        Self {
            segments,
            smoke: 1.0,
            order: BlendOrder::FrontToBack,
            stop: 0.0,
            empty_space: EmptySpace::Skip,
        }
    }
}

impl MeshOptions {
    /// Reads one option; `false` when the key is none of these.
    pub(crate) fn read(&mut self, technique: &str, key: &str, text: &str) -> Result<bool> {
        match key {
            "smoke" => self.smoke = options::positive(technique, key, text)?,
            "order" => self.order = options::choice(technique, key, text)?,
            "empty-space" => self.empty_space = options::choice(technique, key, text)?,
            "stop" => self.stop = options::below_one(technique, key, text)?,
            _ => return self.segments.read(technique, key, text),
        }
        Ok(true)
    }

    pub(crate) fn pairs(&self) -> Vec<(&'static str, String)> {
        let mut pairs = self.segments.pairs();
        if self.segments.integrator == Integrator::Smoke {
            pairs.push(("smoke", self.smoke.to_string()));
        }
        pairs.push(("order", self.order.word().to_string()));
        pairs.push(("stop", self.stop.to_string()));
        pairs.push(("empty-space", self.empty_space.word().to_string()));
        pairs
    }

    /// Whether cells in which nothing is visible are left out; smoke is visible everywhere.
    pub(crate) fn skips(&self) -> bool {
        self.empty_space == EmptySpace::Skip && self.segments.integrator != Integrator::Smoke
    }

    pub(crate) fn check(&self, technique: &str) -> Result<()> {
        let refuse = |key: &str, why: &str| Err(Error::invalid(format!("{technique} option {key}"), why));
        if self.stop > 0.0 && self.order == BlendOrder::BackToFront {
            return refuse("stop", "works with order=front-to-back only");
        }
        if self.segments.integrator == Integrator::Smoke {
            if self.segments.table.is_some() {
                return refuse("table", "integrator=smoke has no table");
            }
            return Ok(());
        }
        self.segments.check(technique, false)
    }
}
