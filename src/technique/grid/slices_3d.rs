//! View-aligned slices of a 3D texture (Cabral, Cam and Foran 1994).
//!
//! Planes of equal depth, `step` apart, cut the grid. Each slice stands for the slab around it: along a
//! pixel's ray the slab is cut to the domain and to the eye, the scalar at the middle of that piece is
//! classified, and extinction times the piece's true length is its optical depth.
//!
//! 1. `glsl/slices-3d.glsl` makes the polygon of each slice in the vertex shader (route `raster`, one
//!    instance a slice, blended by fixed function), or walks a pixel's slices in registers (route
//!    `compute`).
//! 2. The host derives the rays of the view in index space (`grid_rays`) and the number of slabs.
//!
//! Error: second order in `step` where field and transfer function are smooth, first order at a jump of
//! the transfer function; none for a homogeneous grid. Cost: one fetch and one classification per slice
//! and covered pixel; raster also blends. Needs: core Vulkan 1.3.

use ash::vk;

use crate::error::Result;
use crate::gpu::SpecConstant;
use crate::gpu::shader::{
    SLICES_3D_COMPUTE, SLICES_3D_FRAGMENT, SLICES_3D_SHADER_BLEND, SLICES_3D_VERTEX, SPEC_CLIP_ENDS,
};
use crate::scene::Grid;
use crate::technique::grid::options::{
    DITHER, EMPTY_SPACE, FILTER, GridOptions, ORDER, PREFILTER, ROUTE, SEED, STEP, STOP, TARGET,
};
use crate::technique::grid::rays::GridRays;
use crate::technique::grid::technique::{GridTechnique, RasterShaders, Shaders, Slabs};
use crate::technique::options::{self, Choice, OptionInfo};

const NAME: &str = "slices-3d";

/// Where a slice's slab ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ends {
    /// At the domain's faces and at the eye, along each ray.
    Clip,
    /// Nowhere: the classic polygons, each weighted with the whole step.
    Plane,
}

impl Choice for Ends {
    const WORDS: &'static [(&'static str, Self)] = &[("clip", Self::Clip), ("plane", Self::Plane)];
}

/// What can be chosen, with its effect on error and time.
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
    /// Those that techniques for grids share.
    pub grid: GridOptions,
    /// Ends of slabs.
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

    /// The options as text that reads back to them; what is unset is left out.
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

    fn constants(&self) -> Vec<SpecConstant> {
        vec![(SPEC_CLIP_ENDS, u32::from(self.ends == Ends::Clip))]
    }

    fn shaders(&self) -> Shaders {
        Shaders {
            compute: &SLICES_3D_COMPUTE,
            raster: Some(RasterShaders {
                vertex: &SLICES_3D_VERTEX,
                fragment: &SLICES_3D_FRAGMENT,
                shader_blend: &SLICES_3D_SHADER_BLEND,
                topology: vk::PrimitiveTopology::TRIANGLE_STRIP,
                vertices: 6,
            }),
        }
    }

    fn slabs(&self, grid: &Grid, rays: &GridRays, _axis: Option<usize>) -> Slabs {
        Slabs::of_equal_depth(grid, rays, self.grid.step)
    }
}
