//! View-aligned slices of a 3D texture (Cabral, Cam and Foran 1994).
//!
//! Planes of equal depth, `step` apart, cut the grid. Each slice stands for the slab around it. A pixel's ray clips the slab to the
//! domain and to the eye, classifies the scalar at the middle of that segment, and takes extinction times the segment's length
//! as its optical depth.
//!
//! 1. `glsl/grid/slices-3d.glsl` makes the polygon of each slice in the vertex shader (route `raster`, one
//!    instance a slice, blended by fixed function), or walks a pixel's slices in registers (route
//!    `compute`).
//! 2. The host derives the rays of the view in index space (`grid/rays.rs`) and the number of slabs.
//!
//! Error: second order in `step` where field and transfer function are smooth, first order at a jump of
//! the transfer function; a homogeneous grid is exact up to rounding. Cost: one fetch and one classification per slice
//! and covered pixel; raster also blends. Needs: core Vulkan 1.3.

use ash::vk;

use crate::error::Result;
use crate::gpu::Bound;
use crate::gpu::shader::{
    Blend, SLICES_3D_COMPUTE, SLICES_3D_FRAGMENT, SLICES_3D_SHADER_BLEND, SLICES_3D_VERTEX, Slices3dCompute,
    Slices3dFragment, Slices3dShaderBlend, Slices3dVertex,
};
use crate::scene::Grid;
use crate::technique::declare::draw::{Facts, Of, STEPS, TechniqueOptions};
use crate::technique::declare::{option_set, words};
use crate::technique::grid::options::GridOptions;
use crate::technique::grid::rays::GridRays;
use crate::technique::grid::technique::{GridInputs, GridTechnique, MarchInputs, Polygons, Slabs};

words! {
    /// The ends of a slice's slab along a ray.
    pub enum Ends {
        /// Clipped at the domain's faces and at the eye.
        Clip = "clip",
        /// Not clipped: the classic polygons, each weighted with the whole step.
        Plane = "plane",
    }
}

option_set! {
    /// Options of this technique.
    pub struct Options {
        /// Options that techniques for grids share.
        pub grid: GridOptions = GridOptions::default() => GROUP,
        /// Selects the ends of slabs. plane draws the classic polygons, unclipped, which is of first order at the domain's faces.
        pub ends: Ends = Ends::Clip,
    }
}

impl TechniqueOptions for Options {
    const FACTS: Facts = Facts {
        name: "slices-3d",
        summary: "view-aligned slices of a 3D texture, post-classified",
        source: "Cabral, Cam and Foran 1994",
        data: &["grid"],
        kernels: &[],
        routes: &["raster", "compute"],
        splits_rays: true,
        modes: &["lit"],
        samples: &[
            ("f32", "route=compute,step=0.25", [3e-4, 4e-3]),
            ("f32", "route=compute,step=0.25,empty-space=march,stop=0", [3e-4, 4e-3]),
            ("f32", "route=raster,step=0.25", [3e-4, 4e-3]),
            ("f32", "route=raster,step=0.5,target=rgba16", [2e-3, 2e-2]),
            ("f32", "route=raster,step=0.5,target=rgba16f,order=front-to-back", [4e-3, 2e-2]),
            ("f32", "route=raster,target=rgba8,dither=alpha", [7e-3, 8e-2]),
            ("f32", "route=raster,target=rgba8,dither=blue,order=front-to-back", [9e-3, 9e-2]),
            ("f32", "route=compute,step=0.5,filter=exact", [2e-3, 2e-2]),
            ("f32", "route=compute,step=0.5,prefilter=mip", [2e-3, 2e-2]),
            ("f32", "route=raster,step=0.5,ends=plane", [3e-3, 5e-2]),
            ("u16", "route=raster,step=0.25", [3e-4, 4e-3]),
        ],
        families: &[(Of::Grids, "step=", STEPS)],
    };

    fn check(&self) -> Result<()> {
        self.grid.check(Self::NAME)
    }
}

impl GridTechnique for Options {
    fn options(&self) -> &GridOptions {
        &self.grid
    }

    fn march(&self, grid: GridInputs<'_>, march: MarchInputs) -> Result<Bound> {
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
        let clip_ends = self.ends == Ends::Clip;
        Ok(SLICES_3D_COMPUTE.with(&Slices3dCompute {
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
        }))
    }

    fn polygons(&self, grid: GridInputs<'_>, blend: Option<Blend>) -> Result<Option<Polygons>> {
        let GridInputs { volume, pages, lattice, optics, bounded, lighting, .. } = grid;
        let clip_ends = self.ends == Ends::Clip;
        let vertex = SLICES_3D_VERTEX.with(&Slices3dVertex { clip_ends });
        let fragment = match blend {
            Some(blend) => SLICES_3D_SHADER_BLEND.with(&Slices3dShaderBlend {
                clip_ends,
                volume,
                pages,
                blend,
                bounded,
                lattice,
                lighting,
                optics,
            }),
            None => SLICES_3D_FRAGMENT.with(&Slices3dFragment {
                clip_ends,
                volume,
                pages,
                bounded,
                lattice,
                lighting,
                optics,
            }),
        };
        let topology = vk::PrimitiveTopology::TRIANGLE_STRIP;
        Ok(Some(Polygons { bound: vertex.and(fragment), topology, vertices: 6 }))
    }

    fn slabs(&self, grid: &Grid, rays: &GridRays, _axis: Option<usize>) -> Slabs {
        Slabs::of_equal_depth(grid, rays, self.grid.step)
    }
}
