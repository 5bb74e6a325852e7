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

use crate::error::Result;
use crate::gpu::Bound;
use crate::gpu::inputs::Write;
use crate::gpu::shader::{
    MAXIMUM_COMPUTE, Maximum, RAYCAST_COMPUTE, RAYCAST_PILOT, RaycastCompute, RaycastPilot,
};
use crate::resident::tables::{Integrator, SegmentOptions};
use crate::scene::grid::diagonal;
use crate::scene::{Grid, Mode};
use crate::technique::declare::draw::{Facts, Of, STEPS, TechniqueOptions};
use crate::technique::declare::{Group, option_set, refused};
use crate::technique::declare::{Route, Segments};
use crate::technique::grid::options::GridOptions;
use crate::technique::grid::rays::GridRays;
use crate::technique::grid::steps::FINEST;
use crate::technique::grid::technique::{GridInputs, GridTechnique, MarchInputs, Slabs};

/// Every technique accepts the name of a route that it has.
const GRID: Group = Group { hidden: &["route"], absent: &["target", "order", "dither", "seed"] };

option_set! {
    /// Options of this technique.
    pub struct Options {
        /// Options that techniques for grids share; the route is always compute.
        pub grid: GridOptions = GridOptions { route: Route::Compute, ..GridOptions::default() } => GRID,
        /// Selects how segments are integrated. midpoint classifies the middle of a segment; the others integrate between its ends as
        /// slabs does.
        pub segments: SegmentOptions = SegmentOptions::of(Integrator::Midpoint) => Segments(Integrator::OF_GRIDS),
        /// Sets the RMSE of the image, in place of step: each tile of 8 x 8 pixels takes the step, from 8 to 1/8 voxels, that its error at
        /// several steps calls for. The RMSE is 0.55 to 0.95 times this value on most data, and up to 1.3 times among thin shells. A frame
        /// takes 1.2 times the time of the one step with that RMSE, which one would have to search for. Errors other than that of steps
        /// are not counted.
        pub tolerance: Option<f64> = None => Rule::positive().or("off", None).unset("off"),
    }
}

impl TechniqueOptions for Options {
    const FACTS: Facts = Facts {
        name: "raycast",
        summary: "image-order ray casting, the baseline of the comparison",
        source: "Levoy 1988",
        data: &["grid"],
        kernels: &[],
        routes: &["compute"],
        splits_rays: true,
        modes: &["lit", "maximum"],
        samples: &[
            ("f32", "step=0.25", [3e-4, 5e-3]),
            ("f32", "step=0.5,integrator=integral", [3e-3, 4e-2]),
            ("f32", "step=0.5,integrator=full,table=128", [4e-3, 4e-2]),
            ("f32", "step=0.25,integrator=exact", [9e-4, 2e-2]),
            ("u8", "step=0.25,integrator=exact", [9e-4, 2e-2]),
            ("f32", "tolerance=1e-3", [2e-3, 4e-2]),
        ],
        families: &[(Of::Grids, "step=", STEPS)],
    };

    fn check(&self) -> Result<()> {
        if self.grid.route == Route::Raster {
            return Err(refused(Self::NAME, "route", "raster: must be compute"));
        }
        if self.tolerance.is_some() && self.grid.step != GridOptions::default().step {
            return Err(refused(Self::NAME, "tolerance", "it chooses the steps: leave out step"));
        }
        self.segments.check(Self::NAME)
    }
}

impl GridTechnique for Options {
    fn options(&self) -> &GridOptions {
        &self.grid
    }

    fn segments(&self) -> Option<SegmentOptions> {
        Some(self.segments)
    }

    fn march(&self, grid: GridInputs<'_>, march: MarchInputs) -> Result<Bound> {
        let MarchInputs {
            accumulation,
            resume,
            empty_space,
            layers,
            by_list,
            shown,
            tile_step,
            counts,
            hit_depths,
            paging,
            owned,
        } = march;
        if grid.scene.scene().mode == Mode::Maximum {
            let GridInputs { volume, pages, lattice, optics, bounded, .. } = grid;
            return Ok(MAXIMUM_COMPUTE.with(&Maximum {
                accumulation,
                resume,
                volume,
                pages,
                bounded,
                empty_space,
                lattice,
                by_list,
                shown,
                counts,
                paging,
                optics,
            }));
        }
        let segments = grid.segments(&self.segments)?;
        let GridInputs { volume, pages, lattice, optics, bounded, lighting, .. } = grid;
        Ok(RAYCAST_COMPUTE.with(&RaycastCompute {
            accumulation,
            resume,
            volume,
            pages,
            bounded,
            empty_space,
            lattice,
            lighting,
            layers,
            by_list,
            shown,
            tile_step,
            counts,
            hit_depths,
            paging,
            owned,
            optics,
            segments,
        }))
    }

    fn tolerance(&self) -> Option<f64> {
        self.tolerance
    }

    fn pilot(&self, grid: GridInputs<'_>, march: MarchInputs, pilots: Write) -> Result<Bound> {
        let segments = grid.segments(&self.segments)?;
        let MarchInputs { empty_space, layers, shown, counts, hit_depths, .. } = march;
        let GridInputs { volume, pages, lattice, optics, bounded, lighting, .. } = grid;
        Ok(RAYCAST_PILOT.with(&RaycastPilot {
            volume,
            pages,
            bounded,
            empty_space,
            lattice,
            lighting,
            layers,
            pilots,
            shown,
            counts,
            hit_depths,
            optics,
            segments,
        }))
    }

    fn slabs(&self, grid: &Grid, _rays: &GridRays, _axis: Option<usize>) -> Slabs {
        // No ray is longer than the domain's diagonal; one more segment holds its last part.
        let step = if self.tolerance.is_some() { FINEST } else { self.grid.step };
        let count = (diagonal(grid) / (step * grid.spacing().min_element())).ceil() + 1.0;
        Slabs { begin: 0.0, thickness: step, count, first: 0 }
    }
}
