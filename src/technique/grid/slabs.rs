//! Pre-integrated slabs between view-aligned slices (Engel, Kraus and Ertl 2001).
//!
//! Planes of equal depth, `step` apart, cut the grid into slabs. A pixel's ray samples the scalar where it enters and leaves a slab, and
//! integrates the transfer function between the two, so that no feature of the transfer function is missed, however far apart
//! the planes are.
//!
//! 1. `glsl/grid/slabs.glsl` makes the polygon of each slab in the vertex shader (route `raster`), or walks a
//!    pixel's slabs in registers (route `compute`).
//!    `grid/frame.rs` records either, as for all techniques for grids.
//! 2. `glsl/shared/segments.glsl` integrates, by option `integrator`; tables are built on the host in float64
//!    (`optics`) on first use.
//!
//! Error: second order in `step` where the field is smooth, for every transfer function; tables add their
//! own, see `table`. Where the transfer function is smooth too, samples in the middle (`slices-3d`) have the
//! smaller constant. A homogeneous grid is exact up to rounding. Cost: one fetch (raster: two) and one integration
//! per slab and covered pixel. Needs: core Vulkan 1.3.

use ash::vk;

use crate::error::Result;
use crate::gpu::Bound;
use crate::gpu::shader::{
    Blend, SLABS_COMPUTE, SLABS_FRAGMENT, SLABS_SHADER_BLEND, SLABS_VERTEX, SlabsCompute, SlabsFragment,
    SlabsShaderBlend, SlabsVertex,
};
use crate::resident::tables::{Integrator, SegmentOptions};
use crate::scene::Grid;
use crate::technique::declare::Segments;
use crate::technique::declare::draw::{Facts, Of, STEPS, TechniqueOptions};
use crate::technique::declare::option_set;
use crate::technique::grid::options::GridOptions;
use crate::technique::grid::rays::GridRays;
use crate::technique::grid::technique::{GridInputs, GridTechnique, MarchInputs, Polygons, Slabs};

option_set! {
    /// Options of this technique.
    pub struct Options {
        /// Options that techniques for grids share.
        pub grid: GridOptions = GridOptions::default() => GROUP,
        /// Selects how slabs are integrated. integral reads 1-D tables, made in 0.1 ms: opacity is exact, colour of second order in the
        /// slab's optical depth. full reads a 2-D table for 12 thicknesses, as fast to draw but slow to make. exact integrates between
        /// knots without a table, for slabs of large optical depth, in 1.1 to 1.6 times the time.
        pub segments: SegmentOptions = SegmentOptions::of(Integrator::Integral)
            => Segments(&[Integrator::Integral, Integrator::Full, Integrator::Exact]),
    }
}

impl TechniqueOptions for Options {
    const FACTS: Facts = Facts {
        name: "slabs",
        summary: "view-aligned slabs, the transfer function integrated across each",
        source: "Engel, Kraus and Ertl 2001",
        data: &["grid"],
        kernels: &[],
        routes: &["raster", "compute"],
        splits_rays: true,
        modes: &["lit"],
        samples: &[
            ("f32", "route=compute,step=0.5", [4e-3, 3e-2]),
            ("f32", "route=raster,step=0.5", [4e-3, 3e-2]),
            ("f32", "route=compute,step=0.5,integrator=full,table=128", [4e-3, 4e-2]),
            ("f32", "route=raster,step=0.5,integrator=exact", [4e-3, 4e-2]),
            ("f32", "route=compute,step=0.25,integrator=exact", [9e-4, 1e-2]),
        ],
        families: &[
            (Of::Grids, "step=", STEPS),
            (Of::Grids, "integrator=exact,step=", STEPS),
            (Of::Grids, "integrator=exact,filter=exact,step=", &["1", "0.5", "0.25", "0.125", "0.0625"]),
        ],
    };

    fn check(&self) -> Result<()> {
        self.segments.check(Self::NAME)?;
        self.grid.check(Self::NAME)
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
        let segments = grid.segments(&self.segments)?;
        let GridInputs { volume, pages, lattice, optics, bounded, lighting, .. } = grid;
        let MarchInputs {
            accumulation,
            resume,
            empty_space,
            layers,
            by_list,
            shown,
            counts,
            hit_depths,
            paging,
            owned,
            ..
        } = march;
        let clip_ends = true;
        Ok(SLABS_COMPUTE.with(&SlabsCompute {
            accumulation,
            resume,
            clip_ends,
            volume,
            pages,
            bounded,
            empty_space,
            lattice,
            lighting,
            layers,
            by_list,
            shown,
            counts,
            hit_depths,
            paging,
            owned,
            optics,
            segments,
        }))
    }

    fn polygons(&self, grid: GridInputs<'_>, blend: Option<Blend>) -> Result<Option<Polygons>> {
        let segments = grid.segments(&self.segments)?;
        let GridInputs { volume, pages, lattice, optics, bounded, lighting, .. } = grid;
        let clip_ends = true;
        let vertex = SLABS_VERTEX.with(&SlabsVertex { clip_ends });
        let fragment = match blend {
            Some(blend) => SLABS_SHADER_BLEND.with(&SlabsShaderBlend {
                clip_ends,
                volume,
                pages,
                blend,
                bounded,
                lattice,
                lighting,
                optics,
                segments,
            }),
            None => SLABS_FRAGMENT.with(&SlabsFragment {
                clip_ends,
                volume,
                pages,
                bounded,
                lattice,
                lighting,
                optics,
                segments,
            }),
        };
        let topology = vk::PrimitiveTopology::TRIANGLE_STRIP;
        Ok(Some(Polygons { bound: vertex.and(fragment), topology, vertices: 6 }))
    }

    fn slabs(&self, grid: &Grid, rays: &GridRays, _axis: Option<usize>) -> Slabs {
        Slabs::of_equal_depth(grid, rays, self.grid.step)
    }
}
