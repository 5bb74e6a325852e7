//! Image-order ray casting (Levoy 1988), the baseline that the object-order techniques are compared with.
//!
//! Segments of equal length, `step`, split each pixel's ray from its entry into the domain, or from the eye, on. Reconstruction,
//! integrators and early ray termination are those of the other techniques, so that only the geometry differs.
//!
//! 1. `glsl/grid/raycast.glsl` walks a pixel's ray front to back in registers.
//! 2. The host derives the rays of the view in index space (`grid/rays.rs`).
//!
//! Error: that of `slices-3d` with `integrator=midpoint`, else that of `slabs`, at the same spacing along the
//! ray. Cost: one fetch and one classification or integration per segment. Needs: core Vulkan 1.3.

use crate::error::{Error, Result};
use crate::gpu::Bound;
use crate::gpu::shader::{RAYCAST_COMPUTE, Raycast};
use crate::resident::tables::{Integrator, SegmentOptions};
use crate::scene::Grid;
use crate::scene::grid::diagonal;
use crate::technique::grid::options::{EMPTY_SPACE, FILTER, GridOptions, PREFILTER, STOP};
use crate::technique::grid::rays::GridRays;
use crate::technique::grid::technique::{GridInputs, GridTechnique, MarchInputs, Slabs};
use crate::technique::options::{self, OptionInfo, Route, TABLE};

const NAME: &str = "raycast";

/// Descriptions of the options.
pub(crate) const OPTIONS: &[OptionInfo] = &[
    OptionInfo {
        key: "step",
        values: "a positive number",
        default: "1",
        effect: "length of segments in units of the smallest voxel spacing; time falls as 1/step, error grows as step^2 where everything is smooth",
    },
    OptionInfo {
        key: "integrator",
        values: "midpoint|integral|full|exact",
        default: "midpoint",
        effect: "midpoint classifies the middle of a segment; the others integrate between its ends as slabs does",
    },
    TABLE,
    FILTER,
    PREFILTER,
    EMPTY_SPACE,
    STOP,
];

/// Options of this technique.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Options that techniques for grids share; the route is always compute.
    pub grid: GridOptions,
    /// How segments are integrated.
    pub segments: SegmentOptions,
}

impl Default for Options {
    fn default() -> Self {
        let grid = GridOptions { route: Route::Compute, ..GridOptions::default() };
        Self { grid, segments: SegmentOptions { integrator: Integrator::Midpoint, table: None } }
    }
}

impl Options {
    /// Reads `key`, `value` pairs.
    pub(crate) fn parse(pairs: &[(String, String)]) -> Result<Self> {
        let mut options = Self::default();
        for (key, text) in pairs {
            // Every technique accepts the name of a route that it has.
            let known = key == "route" || OPTIONS.iter().any(|info| info.key == key.as_str());
            if !known || !(options.segments.read(NAME, key, text)? || options.grid.read(NAME, key, text)?) {
                return Err(options::unknown(NAME, key, OPTIONS));
            }
        }
        options.check()?;
        Ok(options)
    }

    /// The options as text that reads back to them; unset ones are left out.
    pub(crate) fn pairs(&self) -> Vec<(&'static str, String)> {
        let mut pairs = self.grid.pairs();
        pairs.retain(|(key, _)| *key != "route");
        pairs.extend(self.segments.pairs());
        pairs
    }
}

impl GridTechnique for Options {
    fn name(&self) -> &'static str {
        NAME
    }

    fn check(&self) -> Result<()> {
        if self.grid.route == Route::Raster {
            return Err(Error::invalid("raycast option route", "raster: must be compute"));
        }
        self.segments.check(NAME, true)?;
        GridOptions { route: Route::Compute, ..self.grid }.check(NAME)
    }

    fn options(&self) -> &GridOptions {
        &self.grid
    }

    fn segments(&self) -> Option<SegmentOptions> {
        Some(self.segments)
    }

    fn march(&self, grid: GridInputs<'_>, march: MarchInputs) -> Result<Bound> {
        let segments = grid.segments(&self.segments)?;
        let GridInputs { volume, lattice, optics, bounded, .. } = grid;
        let MarchInputs { accumulation, resume, empty_space, layers } = march;
        Ok(RAYCAST_COMPUTE.with(&Raycast {
            accumulation,
            resume,
            volume,
            bounded,
            empty_space,
            lattice,
            layers,
            optics,
            segments,
        }))
    }

    fn slabs(&self, grid: &Grid, _rays: &GridRays, _axis: Option<usize>) -> Slabs {
        // No ray is longer than the domain's diagonal; one more segment holds its last part.
        let count = (diagonal(grid) / (self.grid.step * grid.spacing().min_element())).ceil() + 1.0;
        Slabs { begin: 0.0, thickness: self.grid.step, count, first: 0 }
    }
}
