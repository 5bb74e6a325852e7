//! The interface of a technique for grids: its options, its shaders, and the slabs that it cuts the domain into.

use ash::vk;

use crate::error::{Error, Result};
use crate::gpu::inputs::{Stored, Write};
use crate::gpu::shader::{
    Blend, Bounded, ByList, Counts, EmptySpace, HitDepths, Lattice, Layers, Lighting, Optics, Owned, Pages,
    Paging, Segments, Shown, TileStep,
};
use crate::gpu::{Bound, Sampled};
use crate::resident::GpuScene;
use crate::resident::tables::SegmentOptions;
use crate::scene::{Grid, View};
use crate::technique::declare::OptionBits;
use crate::technique::grid::options::GridOptions;
use crate::technique::grid::rays::GridRays;

/// The inputs of shaders that sample a grid; a technique takes those of its own shaders.
#[derive(Clone, Debug)]
pub(crate) struct GridInputs<'a> {
    pub(crate) scene: &'a GpuScene,
    /// The samples: a volume, a stack or a pool of pages.
    pub(crate) volume: Sampled,
    pub(crate) pages: Pages,
    pub(crate) lattice: Lattice,
    pub(crate) optics: Optics,
    pub(crate) bounded: Bounded,
    pub(crate) lighting: Lighting,
    /// Whether samplers may interpolate.
    pub(crate) hardware: bool,
}

impl GridInputs<'_> {
    /// Returns the inputs of shaders that integrate segments.
    pub(crate) fn segments(&self, options: &SegmentOptions) -> Result<Segments> {
        self.scene.segments(options, self.hardware, Some(self.volume.clone()))
    }
}

/// The further inputs of a march.
#[derive(Clone, Debug)]
pub(crate) struct MarchInputs {
    pub(crate) accumulation: Stored,
    /// Whether the march continues from the accumulated colour.
    pub(crate) resume: bool,
    pub(crate) empty_space: EmptySpace,
    pub(crate) layers: Layers,
    pub(crate) by_list: ByList,
    pub(crate) shown: Shown,
    pub(crate) tile_step: TileStep,
    pub(crate) counts: Counts,
    pub(crate) hit_depths: HitDepths,
    pub(crate) paging: Paging,
    pub(crate) owned: Owned,
}

/// Shaders that draw slabs as polygons.
#[derive(Debug)]
pub(crate) struct Polygons {
    pub(crate) bound: Bound,
    pub(crate) topology: vk::PrimitiveTopology,
    /// Vertices of one slab.
    pub(crate) vertices: u32,
}

/// The slabs that a technique cuts the domain of a view into.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slabs {
    /// Begin of slab 0 and thickness of each slab, in the technique's own measure.
    pub(crate) begin: f64,
    pub(crate) thickness: f64,
    /// Number of slabs, not yet converted to an integer.
    pub(crate) count: f64,
    /// The slab at which front-to-back order begins: from it on upwards, then from the one below downwards. No
    /// ray meets slabs on both sides of it.
    pub(crate) first: u32,
}

impl Slabs {
    /// Makes slabs of equal thickness in depth, from the domain's nearest point in front of the eye to its farthest.
    pub(crate) fn of_equal_depth(grid: &Grid, rays: &GridRays, step: f64) -> Self {
        let unit = grid.spacing().min_element();
        let [begin, end] = rays.depths.map(|depth| depth / unit);
        let count = if end > begin { ((end - begin) / step).ceil() } else { 0.0 };
        Self { begin, thickness: step, count, first: 0 }
    }
}

/// A technique for grids.
pub(crate) trait GridTechnique: OptionBits + std::fmt::Debug + Send + Sync {
    /// The shared options.
    fn options(&self) -> &GridOptions;
    /// How it integrates segments; `None` where it classifies samples.
    fn segments(&self) -> Option<SegmentOptions> {
        None
    }
    /// Binds the shader that marches along rays.
    fn march(&self, grid: GridInputs<'_>, march: MarchInputs) -> Result<Bound>;
    /// The RMSE for which the tiles of the image take steps of their own; `None` where all take the same.
    fn tolerance(&self) -> Option<f64> {
        None
    }
    /// Binds the shader that marches along the rays of tiles' centres for `tolerance`, and writes to `pilots`.
    fn pilot(&self, _grid: GridInputs<'_>, _march: MarchInputs, _pilots: Write) -> Result<Bound> {
        Err(Error::unsupported("tolerance", "the technique raycast"))
    }
    /// Binds the shaders that draw slabs as polygons, blended by the shader with `blend`, else by fixed function. `None` where the
    /// technique has no polygons.
    fn polygons(&self, _grid: GridInputs<'_>, _blend: Option<Blend>) -> Result<Option<Polygons>> {
        Ok(None)
    }
    /// The axis along which slices are stacked for a view; `current` is the one in use. `None` where it samples one volume.
    fn stack_axis(&self, _grid: &Grid, _view: &View, _current: Option<usize>) -> Option<usize> {
        None
    }
    /// Whether all three stacks stay on the device.
    fn keeps_all_stacks(&self) -> bool {
        false
    }
    /// The slabs of a view. `rays` are in the axes of the stack.
    fn slabs(&self, grid: &Grid, rays: &GridRays, axis: Option<usize>) -> Slabs;
}
