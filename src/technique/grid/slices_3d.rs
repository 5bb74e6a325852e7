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
use crate::technique::grid::options::{
    DITHER, EMPTY_SPACE, FILTER, GridOptions, ORDER, PREFILTER, ROUTE, SEED, STEP, STOP, TARGET,
};
use crate::technique::grid::rays::GridRays;
use crate::technique::grid::technique::{GridInputs, GridTechnique, MarchInputs, Polygons, Slabs};
use crate::technique::options::{self, Choice, OptionInfo};

const NAME: &str = "slices-3d";

/// The ends of a slice's slab along a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ends {
    /// Clipped at the domain's faces and at the eye.
    Clip,
    /// Not clipped: the classic polygons, each weighted with the whole step.
    Plane,
}

impl Choice for Ends {
    const WORDS: &'static [(&'static str, Self)] = &[("clip", Self::Clip), ("plane", Self::Plane)];
}

/// Descriptions of the options.
pub(crate) const OPTIONS: &[OptionInfo] = &[
    STEP,
    FILTER,
    PREFILTER,
    OptionInfo {
        key: "ends",
        values: "clip|plane",
        default: "clip",
        effect: "plane: the classic polygons, unclipped; first order at the domain's faces",
    },
    ROUTE,
    TARGET,
    ORDER,
    DITHER,
    SEED,
    EMPTY_SPACE,
    STOP,
];

/// Options of this technique.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Options that techniques for grids share.
    pub grid: GridOptions,
    /// The ends of slabs.
    pub ends: Ends,
}

impl Default for Options {
    fn default() -> Self {
        Self { grid: GridOptions::default(), ends: Ends::Clip }
    }
}

impl Options {
    /// Reads `key`, `value` pairs.
    pub(crate) fn parse(pairs: &[(String, String)]) -> Result<Self> {
        let mut options = Self::default();
        for (key, text) in pairs {
            match key.as_str() {
                "ends" => options.ends = options::choice(NAME, key, text)?,
                _ if options.grid.read(NAME, key, text)? => {}
                _ => return Err(options::unknown(NAME, key, OPTIONS)),
            }
        }
        options.check()?;
        Ok(options)
    }

    /// The options as text that reads back to them; unset ones are left out.
    pub(crate) fn pairs(&self) -> Vec<(&'static str, String)> {
        let mut pairs = self.grid.pairs();
        pairs.push(("ends", self.ends.word().to_string()));
        pairs
    }
}

impl GridTechnique for Options {
    fn name(&self) -> &'static str {
        NAME
    }

    fn check(&self) -> Result<()> {
        self.grid.check(NAME)
    }

    fn options(&self) -> &GridOptions {
        &self.grid
    }

    fn march(&self, grid: GridInputs<'_>, march: MarchInputs) -> Result<Bound> {
        let GridInputs { volume, lattice, optics, bounded, .. } = grid;
        let MarchInputs { accumulation, resume, empty_space, layers } = march;
        let clip_ends = self.ends == Ends::Clip;
        Ok(SLICES_3D_COMPUTE.with(&Slices3dCompute {
            accumulation,
            resume,
            clip_ends,
            volume,
            bounded,
            empty_space,
            lattice,
            layers,
            optics,
        }))
    }

    fn polygons(&self, grid: GridInputs<'_>, blend: Option<Blend>) -> Result<Option<Polygons>> {
        let GridInputs { volume, lattice, optics, bounded, .. } = grid;
        let clip_ends = self.ends == Ends::Clip;
        let vertex = SLICES_3D_VERTEX.with(&Slices3dVertex { clip_ends });
        let fragment = match blend {
            Some(blend) => SLICES_3D_SHADER_BLEND.with(&Slices3dShaderBlend {
                clip_ends,
                volume,
                blend,
                bounded,
                lattice,
                optics,
            }),
            None => {
                SLICES_3D_FRAGMENT.with(&Slices3dFragment { clip_ends, volume, bounded, lattice, optics })
            }
        };
        let topology = vk::PrimitiveTopology::TRIANGLE_STRIP;
        Ok(Some(Polygons { bound: vertex.and(fragment), topology, vertices: 6 }))
    }

    fn slabs(&self, grid: &Grid, rays: &GridRays, _axis: Option<usize>) -> Slabs {
        Slabs::of_equal_depth(grid, rays, self.grid.step)
    }
}
