//! The routes of a frame of a grid: pipelines and the image that they write.
//!
//! - Compute: one dispatch marches every ray, or several that resume where the march is too long for one.
//! - Raster: one instanced draw of all slabs, blended by fixed function.
//! - Raster with dithering: one draw per slab, blended by the shader in packed texels.

use std::sync::Arc;

use ash::vk;

use crate::error::{Error, Result};
use crate::frame::target::{Canvas, draws_directly, own_image};
use crate::gpu::shader::{
    self, EmptySpace as Skipping, PIXELS_FIRST, Shown, TILE_INTERVALS_COMPUTE, TileStep,
};
use crate::gpu::sync::Use;
use crate::gpu::{
    Blend, Bound, Buffer, BufferUse, Descriptors, Gpu, GraphicsState, Groups, Image, Pipeline, Recorder,
};
use crate::interface::GridPush;
use crate::primitives::dispatch::{Dispatch, buffer, pass, tiles_of};
use crate::resident::GpuScene;
use crate::resident::bricks::Bricks;
use crate::resident::tables::Knots;
use crate::resident::volume::Volume;
use crate::scene::{Mode, View};
use crate::technique::declare::{BlendOrder, EmptySpace, refused};
use crate::technique::grid::blue_noise;
use crate::technique::grid::dispatch_limits::{Loops, check_loops, slabs_per_dispatch};
use crate::technique::grid::options::{Dither, Filter, Prefilter};
use crate::technique::grid::paging::Paging;
use crate::technique::grid::steps::TileSteps;
use crate::technique::grid::technique::{GridInputs, GridTechnique, MarchInputs, Polygons};

/// How a frame's slabs are composited.
#[derive(Debug)]
pub(super) enum Path {
    /// Polygons blended by fixed function.
    Raster { pipeline: Arc<Pipeline>, vertices: u32 },
    /// Polygons that the shader blends into packed texels, which are then copied to the image.
    ShaderBlend { pipeline: Arc<Pipeline>, vertices: u32, texels: Arc<Buffer> },
    /// A march along each pixel's ray.
    Compute {
        /// Finds where tiles show anything; only where empty space is skipped.
        tiles: Option<TileIntervals>,
        /// Chooses the steps of tiles; only for a tolerance.
        steps: Option<Box<TileSteps>>,
        first: Arc<Pipeline>,
        /// Continues where the dispatch before stopped; only where the march is split.
        resume: Option<Arc<Pipeline>>,
        /// Slabs that one dispatch may walk.
        slabs_per_dispatch: u32,
        /// Workgroups: one invocation for each pixel of the image, of a list of tiles or of a list of pixels.
        groups: Groups,
        /// Whether pixels are drawn once more.
        redraws: bool,
    },
}

/// The depths between which each tile of the image shows anything (`glsl/grid/tile-intervals.glsl`).
#[derive(Debug)]
pub(super) struct TileIntervals {
    intervals: Arc<Buffer>,
    /// The tiles that do, of which alone the march has workgroups.
    list: Option<Arc<Buffer>>,
    find: Dispatch,
    groups: [u32; 3],
}

impl TileIntervals {
    fn new(
        gpu: &Gpu,
        name: &str,
        around: &Arc<Buffer>,
        view: &View,
        image: &Arc<Image>,
        lists: bool,
    ) -> Result<Self> {
        let [across, rows, _] = tiles_of(view.extent());
        let tiles = u64::from(across) * u64::from(rows);
        let intervals = buffer(gpu, &format!("{name}.tiles"), 2 * tiles)?;
        let list = || buffer(gpu, &format!("{name}.tiles.list"), u64::from(PIXELS_FIRST) + tiles);
        let list = lists.then(list).transpose()?;
        let inputs = shader::TileIntervals {
            around: around.read(),
            tile_intervals: intervals.write(),
            // A binding must hold something.
            pixels: list.as_ref().unwrap_or(&intervals).write(),
            accumulation: image.stored(),
            by_tile_list: lists,
        };
        let find = pass(gpu, &format!("{name}.tiles"), &TILE_INTERVALS_COMPUTE.with(&inputs))?;
        Ok(Self { intervals, list, find, groups: tiles_of([across, rows]) })
    }

    /// Records the pass. With a list it clears the tiles that show nothing: fixed function clears storage images slowly.
    pub(super) fn record(&self, recorder: &mut Recorder<'_>, name: &str, push: &GridPush) {
        if let Some(list) = &self.list {
            recorder.clear_start(&format!("{name}.tiles.clear"), list, 4 * u64::from(PIXELS_FIRST));
        }
        self.find.record(recorder, push, self.groups);
    }

    /// Keeps what an earlier recording has found.
    pub(super) fn keep(&self, recorder: &mut Recorder<'_>) {
        for buffer in self.list.iter().chain([&self.intervals]) {
            recorder.assume_buffer_after(buffer, Use::ComputeReadWrite);
        }
    }
}

/// Samples of the grid with the descriptors that name them.
#[derive(Debug)]
pub(super) struct Samples {
    /// The axis of a stack.
    pub(super) axis: Option<usize>,
    pub(super) volume: Arc<Volume>,
    pub(super) descriptors: Arc<Descriptors>,
}

/// A route, ready to be recorded.
pub(super) struct Routed {
    pub(super) path: Path,
    pub(super) samples: Vec<Samples>,
    /// The image that is written; `None` where that is the caller's.
    pub(super) image: Option<Arc<Image>>,
}

/// The description that a route is built from.
pub(super) struct RouteDesc<'a> {
    pub(super) scene: &'a GpuScene,
    pub(super) name: &'static str,
    pub(super) technique: &'a dyn GridTechnique,
    pub(super) volumes: &'a [(Option<usize>, Arc<Volume>)],
    pub(super) paging: Option<&'a Paging>,
    pub(super) knots: &'a Knots,
    pub(super) view: &'a View,
    pub(super) target: &'a Canvas,
}

impl RouteDesc<'_> {
    fn gpu(&self) -> &Gpu {
        self.scene.gpu()
    }

    /// Returns the inputs that all shaders share, for one of the volumes.
    fn inputs(&self, volume: &Volume) -> Result<GridInputs<'_>> {
        let options = self.technique.options();
        let has_nan = self.scene.grid()?.nan_count() > 0;
        // A sampler may drop NaN.
        let filter_exact = options.filter == Filter::Exact || !volume.filterable || has_nan;
        let filter = if filter_exact { vk::Filter::NEAREST } else { vk::Filter::LINEAR };
        Ok(GridInputs {
            scene: self.scene,
            volume: volume.image.sampled(filter),
            pages: Paging::pages(self.paging, &self.knots.buffer),
            lattice: shader::Lattice {
                filter_exact,
                has_nan,
                prefilter: options.prefilter == Prefilter::Mip,
            },
            optics: self.knots.optics(),
            bounded: self.target.bounded(&self.knots.buffer),
            lighting: self.scene.lighting(&self.knots.buffer)?,
            hardware: options.filter == Filter::Hardware,
        })
    }

    /// Returns the loop iterations of a slab.
    fn loops(&self) -> Loops {
        let lit = matches!(self.scene.scene().mode, Mode::Lit(_));
        Loops::new(self.knots, self.technique.segments().as_ref(), lit)
    }

    /// Sets the constants of shaders that take the values of options.
    fn with_options(&self, bound: Bound) -> Result<Bound> {
        bound.with_options(|key| self.technique.bits(self.name, key))
    }

    /// Makes the descriptors of each volume for a pipeline; `bind` binds its shaders.
    fn samples(
        &self,
        pipeline: &Pipeline,
        bind: impl Fn(GridInputs<'_>) -> Result<Bound>,
    ) -> Result<Vec<Samples>> {
        let made = |(axis, volume): &(Option<usize>, Arc<Volume>)| {
            let bound = bind(self.inputs(volume)?)?;
            let descriptors = Arc::new(Descriptors::new(self.gpu(), pipeline, &bound)?);
            Ok(Samples { axis: *axis, volume: Arc::clone(volume), descriptors })
        };
        self.volumes.iter().map(made).collect()
    }

    /// Returns the first of the volumes, all of which have one form.
    fn first(&self) -> Result<&Volume> {
        let none = || Error::invalid(self.name, "no volume");
        self.volumes.first().map(|(_, volume)| volume.as_ref()).ok_or_else(none)
    }

    /// Builds the route `compute` for a first view of so many slabs.
    pub(super) fn march(&self, slabs: u32) -> Result<Routed> {
        let Self { scene, knots, technique, .. } = *self;
        let (gpu, name, options) = (self.gpu(), self.name, technique.options());
        let segments = technique.segments();
        let format = vk::Format::R32G32B32A32_SFLOAT;
        let image = own_image(gpu, name, format, vk::ImageUsageFlags::STORAGE, self.view, self.target)?;
        let skips = options.empty_space == EmptySpace::Skip && options.prefilter != Prefilter::Mip;
        let greatest = scene.scene().mode == Mode::Maximum;
        // A variant that reads no bricks binds the knots in their place.
        let (mut bricks, mut tiles) = (Arc::clone(&knots.buffer), None);
        if skips {
            let Bricks { codes, around } = match self.paging {
                Some(paging) => paging.bricks().clone(),
                None if greatest => scene.greatest_scalars()?,
                None => scene.bricks(scene.margin(segments.as_ref()))?,
            };
            // Surfaces are drawn in all tiles.
            let lists = self.target.layers.is_none() && self.target.redrawn.is_none();
            let intervals = |around| TileIntervals::new(gpu, name, &around, self.view, &image, lists);
            (bricks, tiles) = (codes, around.map(intervals).transpose()?);
        }
        let list = tiles.as_ref().and_then(|tiles| tiles.list.as_ref());
        let intervals = tiles.as_ref().map_or(&knots.buffer, |tiles| &tiles.intervals);
        let inputs = |steps: Option<&TileSteps>, resume: bool| MarchInputs {
            accumulation: image.stored(),
            resume,
            empty_space: Skipping { bricks: bricks.read(), empty_space: skips, greatest },
            layers: self.target.layered(&knots.buffer),
            by_list: self.target.by_list(list, &knots.buffer),
            shown: Shown { tile_intervals: intervals.read(), by_tiles: tiles.is_some() },
            tile_step: TileStep {
                tile_steps: steps.map_or(&knots.buffer, |steps| &steps.steps).read(),
                by_steps: steps.is_some(),
            },
            counts: self.target.counts(&knots.buffer),
            hit_depths: self.target.hit_depths(),
            // A word of the plan's own stands in, as for hit depths.
            paging: Paging::march(self.paging, &self.target.hit_depths),
            owned: self.target.owned(&knots.buffer),
        };
        let steps = match technique.tolerance() {
            Some(_) if greatest => {
                return Err(refused(name, "tolerance", "the greatest scalar has no integral: set step"));
            }
            Some(tolerance) => {
                let layers = Canvas { layers: None, ..self.target.clone() }.layered(&knots.buffer);
                let hit_depths = shader::HitDepths { hit_at: 0, ..self.target.hit_depths() };
                let bind = |pilots| {
                    let march = MarchInputs { layers, hit_depths, ..inputs(None, false) };
                    self.with_options(technique.pilot(self.inputs(self.first()?)?, march, pilots)?)
                };
                let most = |rays| slabs_per_dispatch(gpu, name, slabs, &self.loops(), scene.grid()?, rays);
                Some(TileSteps::new(gpu, name, tolerance, self.view, slabs, most, bind)?)
            }
            None => None,
        };
        let bind = |grid: GridInputs<'_>, resume: bool| {
            self.with_options(technique.march(grid, inputs(steps.as_ref(), resume))?)
        };
        let rays = self.view.extent().map(u64::from).iter().product();
        let most = slabs_per_dispatch(gpu, name, slabs, &self.loops(), scene.grid()?, rays)?;
        // Translucent surfaces take loop iterations of their own.
        let slabs_per_dispatch = match self.target.layers {
            Some(_) => (most / 2).max(1),
            None => most,
        };
        let volume = self.first()?;
        let first = gpu.compute_pipeline(&format!("{name}.march"), &bind(self.inputs(volume)?, false)?)?;
        let resume = if slabs > slabs_per_dispatch && self.paging.is_none() {
            let bound = bind(self.inputs(volume)?, true)?;
            Some(gpu.compute_pipeline(&format!("{name}.march.resume"), &bound)?)
        } else {
            None
        };
        let samples = self.samples(&first, |grid| bind(grid, false))?;
        let redrawn = self.target.redrawn.as_ref().map(|redrawn| &redrawn.pixels);
        let groups = match redrawn.or(list) {
            Some(list) => Groups::Counted(Arc::clone(list)),
            None => tiles_of(self.view.extent()).into(),
        };
        let redraws = redrawn.is_some();
        let path = Path::Compute {
            tiles,
            steps: steps.map(Box::new),
            first,
            resume,
            slabs_per_dispatch,
            groups,
            redraws,
        };
        Ok(Routed { path, samples, image: Some(image) })
    }

    /// Builds the route `raster`, by fixed function or, with dithering, by the shader.
    pub(super) fn raster(&self) -> Result<Routed> {
        let options = self.technique.options();
        check_loops(self.gpu(), self.name, &self.loops())?;
        if options.dither == Dither::None { self.fixed_function() } else { self.shader_blend() }
    }

    /// Binds the shaders that draw polygons.
    fn polygons(&self, grid: GridInputs<'_>, blend: Option<shader::Blend>) -> Result<Polygons> {
        let none = || Error::unsupported(format!("{} route=raster", self.name), "polygons: it has none");
        let polygons = self.technique.polygons(grid, blend)?.ok_or_else(none)?;
        Ok(Polygons { bound: self.with_options(polygons.bound)?, ..polygons })
    }

    /// Blends the slabs by fixed function.
    fn fixed_function(&self) -> Result<Routed> {
        let Self { technique, view, target, .. } = *self;
        let (gpu, name, options) = (self.gpu(), self.name, technique.options());
        let back_to_front = options.order() == BlendOrder::BackToFront;
        let format = options.accumulation().format();
        let Polygons { bound, topology, vertices } = self.polygons(self.inputs(self.first()?)?, None)?;
        let blend = if back_to_front { Blend::Over } else { Blend::Under };
        let state = GraphicsState { topology, blend, format: Some(format) };
        let pipeline = gpu.graphics_pipeline(&format!("{name}.draw"), &bound, state)?;
        let image = if draws_directly(target, format, back_to_front) {
            None
        } else {
            Some(own_image(gpu, name, format, vk::ImageUsageFlags::COLOR_ATTACHMENT, view, target)?)
        };
        let samples = self.samples(&pipeline, |grid| Ok(self.polygons(grid, None)?.bound))?;
        Ok(Routed { path: Path::Raster { pipeline, vertices }, samples, image })
    }

    /// Blends the slabs in the shader, with dithering.
    fn shader_blend(&self) -> Result<Routed> {
        let Self { technique, view, target, .. } = *self;
        let (gpu, name, options) = (self.gpu(), self.name, technique.options());
        // An image view needs a usage beyond transfers.
        let usage = vk::ImageUsageFlags::TRANSFER_DST | vk::ImageUsageFlags::SAMPLED;
        gpu.check_drawing(name, view.extent())?;
        let image = own_image(gpu, name, options.accumulation().format(), usage, view, target)?;
        let bytes = image.desc().texel_bytes();
        let texels = Arc::new(Buffer::new(gpu, &format!("{name}.texels"), bytes, BufferUse::ShaderWrite)?);
        let thresholds = if options.dither == Dither::Blue {
            Buffer::with_data(gpu, "blue-noise", bytemuck::cast_slice(blue_noise::tile()))?
        } else {
            Arc::clone(&self.knots.buffer)
        };
        let blend = shader::Blend {
            texels: texels.write(),
            thresholds: thresholds.read(),
            under: options.order() == BlendOrder::FrontToBack,
        };
        let grid = self.inputs(self.first()?)?;
        let Polygons { bound, topology, vertices } = self.polygons(grid, Some(blend.clone()))?;
        let state = GraphicsState { topology, blend: Blend::Copy, format: None };
        let pipeline = gpu.graphics_pipeline(&format!("{name}.dither"), &bound, state)?;
        let samples = self.samples(&pipeline, |grid| Ok(self.polygons(grid, Some(blend.clone()))?.bound))?;
        Ok(Routed { path: Path::ShaderBlend { pipeline, vertices, texels }, samples, image: Some(image) })
    }
}
