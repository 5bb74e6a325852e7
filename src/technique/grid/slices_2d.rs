//! Stacks of 2D-textured slices parallel to the base plane (Peikert, Object Space Volume Rendering,
//! SciVis 2007, page 4-3).
//!
//! Up to three stacks of 2D images hold the grid, one along each axis; the stack whose planes face the viewer most is drawn. Each
//! slice stands for the slab half-way to its neighbours. A pixel's ray clips the slab to the domain and to the eye, samples the slice,
//! bilinearly, beside the middle of that segment, and takes extinction times the segment's length as its optical depth.
//!
//! 1. The host chooses the axis: the one with the largest cosine between the planes' normal and the direction
//!    to the domain's centre from the eye (perspective with the eye outside), or the view's direction
//!    (parallel rays, or the eye inside). It keeps the axis in use until another leads by `hysteresis`.
//! 2. `glsl/grid/slices-2d.glsl` draws the far faces of each slab's box (route `raster`), or walks a pixel's slabs
//!    in registers (route `compute`).
//!
//! Error: the spacing along a ray is that of the planes divided by the cosine, up to sqrt(3) in a cube. A `step` makes it finer by
//! blending two slices, which is trilinear, and the error is second order. A slab that the domain or the eye clips has its middle
//! beside the stored slice: first order there. A homogeneous grid is exact up to rounding. Cost: one bilinear fetch (two with
//! `step`) and one classification per slice and covered pixel; each stack is one more copy of the grid. Needs: core Vulkan 1.3;
//! a stack with more slices than an image may have layers is drawn in pages.

use ash::vk;
use glam::DVec3;

use crate::error::Result;
use crate::gpu::Bound;
use crate::gpu::shader::{
    Blend, SLICES_2D_COMPUTE, SLICES_2D_FRAGMENT, SLICES_2D_SHADER_BLEND, SLICES_2D_VERTEX, Slices2dCompute,
    Slices2dFragment, Slices2dShaderBlend, Slices2dVertex, Stack,
};
use crate::num;
use crate::scene::grid::turned;
use crate::scene::{Grid, View};
use crate::technique::declare::draw::{Facts, Of, TechniqueOptions};
use crate::technique::declare::{option_set, words};
use crate::technique::grid::options::{GridOptions, OrSlices};
use crate::technique::grid::rays::GridRays;
use crate::technique::grid::technique::{GridInputs, GridTechnique, MarchInputs, Polygons, Slabs};

words! {
    /// The stacks that the device holds.
    pub enum Stacks {
        /// The stack of the view; another view may need another plan.
        Used = "used",
        /// All three.
        All = "all",
    }
}

option_set! {
    /// Options of this technique.
    pub struct Options {
        /// Options that techniques for grids share; `step` counts only with `between`.
        pub grid: GridOptions = GridOptions::default() => GROUP,
        /// Whether slices are `step` apart, each a blend of two slices of the grid.
        pub between: bool = false => OrSlices(
            "slices draws the slices of the grid, bilinear. A number is the distance of planes in units of the smallest voxel spacing, \
             each a blend of two slices, with twice the fetches and an error of second order."
        ),
        /// Keeps the stack in use until the cosine of another leads by this value. The image jumps later and less often. The first view
        /// of a plan takes the best stack.
        pub hysteresis: f64 = 0.0 => Rule::below_one(),
        /// Selects the stacks of a whole grid that the device holds. all keeps three copies of it, so that no change of the view needs an upload.
        pub stacks: Stacks = Stacks::Used,
    }
}

impl TechniqueOptions for Options {
    const FACTS: Facts = Facts {
        name: "slices-2d",
        summary: "stacks of 2D-textured slices parallel to the base plane, post-classified",
        source: "Peikert 2007",
        data: &["grid"],
        kernels: &[],
        routes: &["raster", "compute"],
        splits_rays: true,
        modes: &[],
        samples: &[
            ("f32", "route=compute,step=0.25", [1e-3, 2e-2]),
            ("f32", "route=raster,step=0.25", [1e-3, 2e-2]),
            ("f32", "route=raster,step=0.25,order=front-to-back", [1e-3, 2e-2]),
            ("f32", "stacks=all,filter=exact", [3e-2, 0.5]),
            ("i16", "route=compute,step=0.25", [1e-3, 2e-2]),
        ],
        families: &[(Of::Grids, "", &[""])],
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
        let GridInputs { volume, pages, lattice, optics, bounded, .. } = grid;
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
        let stack = Stack { volume, between: self.between };
        Ok(SLICES_2D_COMPUTE.with(&Slices2dCompute {
            accumulation,
            resume,
            bounded,
            pages,
            empty_space,
            lattice,
            layers,
            by_list,
            shown,
            counts,
            hit_depths,
            paging,
            owned,
            optics,
            stack,
        }))
    }

    fn polygons(&self, grid: GridInputs<'_>, blend: Option<Blend>) -> Result<Option<Polygons>> {
        let GridInputs { volume, pages, lattice, optics, bounded, .. } = grid;
        let stack = Stack { volume, between: self.between };
        let vertex = SLICES_2D_VERTEX.with(&Slices2dVertex {});
        let fragment = match blend {
            Some(blend) => SLICES_2D_SHADER_BLEND.with(&Slices2dShaderBlend {
                blend,
                pages,
                bounded,
                lattice,
                optics,
                stack,
            }),
            None => SLICES_2D_FRAGMENT.with(&Slices2dFragment { pages, bounded, lattice, optics, stack }),
        };
        let topology = vk::PrimitiveTopology::TRIANGLE_LIST;
        Ok(Some(Polygons { bound: vertex.and(fragment), topology, vertices: 36 }))
    }

    fn stack_axis(&self, grid: &Grid, view: &View, current: Option<usize>) -> Option<usize> {
        Some(steepest_axis(grid, view, current, self.hysteresis))
    }

    fn keeps_all_stacks(&self) -> bool {
        self.stacks == Stacks::All
    }

    fn slabs(&self, grid: &Grid, rays: &GridRays, axis: Option<usize>) -> Slabs {
        let axis = axis.unwrap_or(2);
        let last = grid.last_index()[axis];
        let (begin, thickness, count) = if self.between {
            let thickness = self.grid.step * grid.spacing().min_element() / planes(grid)[axis].1;
            (-0.5 * last, thickness, (last / thickness).ceil())
        } else {
            (-0.5 * last - 0.5, 1.0, last + 1.0)
        };
        // Rays go up the stack from the slab of the eye on, and down from the one below it.
        let first = if rays.kd == 0.0 {
            if rays.d0.z > 0.0 { 0 } else { u32::MAX }
        } else {
            num::u32_of(((rays.q0.z - rays.kq * rays.d0.z - begin) / thickness).floor())
        };
        Slabs { begin, thickness, count, first }
    }
}

/// Returns for each axis the unit normal of the planes of its slices, along which indices grow, and the distance of two planes in world
/// units.
pub(crate) fn planes(grid: &Grid) -> [(DVec3, f64); 3] {
    let axes = grid.index_to_world();
    [0, 1, 2].map(|axis| {
        let [u, v, along] = turned([axes.x_axis, axes.y_axis, axes.z_axis], axis);
        let normal = u.cross(v).normalize_or_zero();
        let distance = normal.dot(along);
        (if distance < 0.0 { -normal } else { normal }, distance.abs())
    })
}

/// Returns the axis whose planes face a view most; keeps `current` until the cosine of another leads by `hysteresis`.
pub(crate) fn steepest_axis(grid: &Grid, view: &View, current: Option<usize>, hysteresis: f64) -> usize {
    let to_index = grid.index_to_world().inverse();
    let from_centre = view.camera().eye - grid.centre();
    let place = (to_index * from_centre).abs() - grid.last_index() * 0.5;
    let outside = place.max_element() > 0.0;
    let direction =
        if view.is_perspective() && outside { from_centre.normalize_or_zero() } else { view.forward() };
    let cosines = planes(grid).map(|(normal, _)| normal.dot(direction).abs());
    let mut best = 2;
    for axis in [1, 0] {
        // A tie goes to the last axis, whose slices are contiguous in the file.
        if cosines[axis] > cosines[best] {
            best = axis;
        }
    }
    match current {
        Some(current) if cosines[best] - cosines[current] <= hysteresis => current,
        _ => best,
    }
}
