//! The interface of a technique for grids: its options, its shaders, and the slabs that it cuts the domain into.

use ash::vk;

use crate::gpu::SpecConstant;
use crate::gpu::shader::Shader;
use crate::resident::tables::SegmentOptions;
use crate::scene::{Grid, View};
use crate::technique::grid::options::GridOptions;
use crate::technique::grid::rays::GridRays;

/// The shaders of a technique.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shaders {
    pub(crate) compute: &'static Shader,
    pub(crate) raster: Option<RasterShaders>,
}

/// The shaders that draw slabs as polygons.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RasterShaders {
    pub(crate) vertex: &'static Shader,
    pub(crate) fragment: &'static Shader,
    /// Blends and dithers in the shader.
    pub(crate) shader_blend: &'static Shader,
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
pub(crate) trait GridTechnique: std::fmt::Debug + Send + Sync {
    /// The shared options.
    fn options(&self) -> &GridOptions;
    /// How it integrates segments; `None` where it classifies samples.
    fn segments(&self) -> Option<SegmentOptions> {
        None
    }
    /// Specialisation constants of its own.
    fn constants(&self) -> Vec<SpecConstant> {
        Vec::new()
    }
    /// Its shaders.
    fn shaders(&self) -> Shaders;
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
