//! Options that the techniques for meshes share.

use crate::error::{Error, Result};
use crate::resident::tables::{Integrator, SegmentOptions};
use crate::technique::options::{self, BlendOrder, Choice, EmptySpace, OptionInfo};

pub(crate) const INTEGRATOR: OptionInfo = OptionInfo {
    key: "integrator",
    values: "exact|integral|full|smoke",
    default: "exact",
    effect: "how a cell is integrated: exact cuts it at the knots, without a table; integral reads 1-D tables, opacity is exact and colour of second order in the cell's optical depth; full reads a 2-D table for 12 thicknesses; smoke: extinction is the mean scalar times the option smoke",
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
    effect: "direction of ranks and compositing; the image is the same but for rounding",
};
pub(crate) const EMPTY_SPACE: OptionInfo = OptionInfo {
    key: "empty-space",
    values: "skip|march",
    default: "skip",
    effect: "skip leaves out cells whose range of scalars has no extinction; march draws all cells; the image is the same",
};
pub(crate) const STOP: OptionInfo = OptionInfo {
    key: "stop",
    values: "a number from 0 to below 1",
    default: "0",
    effect: "largest colour that a ray may miss when it ends early: an absolute error; fragments behind its end are not checked for order",
};

/// Treatment of pixels whose faces or cells came out of order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Repair {
    /// Draws them again from sorted lists.
    Exact,
    /// Counts them only.
    None,
}

impl Choice for Repair {
    const WORDS: &'static [(&'static str, Self)] = &[("exact", Self::Exact), ("none", Self::None)];
}

/// Options that the techniques for meshes share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshOptions {
    /// How cells are integrated.
    pub segments: SegmentOptions,
    /// With [`Integrator::Smoke`]: extinction per unit of the scalar.
    pub smoke: f64,
    /// Direction of ranks and compositing.
    pub order: BlendOrder,
    /// Largest colour that a ray may miss when it ends early.
    pub stop: f64,
    /// Treatment of cells in which nothing is visible.
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
    /// Reads one option; returns `false` for a key that is none of these.
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

    /// Returns the options as text that [`MeshOptions::read`] reads back.
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

    /// Whether cells in which nothing is visible are skipped; smoke is visible everywhere.
    pub(crate) fn skips(&self) -> bool {
        self.empty_space == EmptySpace::Skip && self.segments.integrator != Integrator::Smoke
    }

    /// Refuses values and combinations that are not allowed.
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
