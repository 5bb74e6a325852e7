//! Builds a frame of `shear-warp`: stacks, intermediate image, compositing, warp.

use std::sync::Arc;

use ash::vk;

use crate::error::{Error, Result};
use crate::frame::depth_measure::DepthMeasure;
use crate::frame::target::{Canvas, draws_directly, own_image};
use crate::gpu::shader::{
    EmptySpace as Skipping, Lattice, Optics, Pages, SHEAR_WARP_COMPUTE, SHEAR_WARP_EDGE, SHEAR_WARP_FRAGMENT,
    SHEAR_WARP_VERTEX, Segments, ShearWarpCompute, ShearWarpEdge, ShearWarpFragment, ShearWarpVertex,
    Stack as StackInputs, WARP_BICUBIC, WARP_BILINEAR, WARP_BOUNDED, WARP_COMPUTE, WARP_FRAGMENT, WARP_HALVE,
    WARP_MIP, WARP_VERTEX, WarpBounded, WarpCompute, WarpFragment, WarpHalve, WarpVertex,
};
use crate::gpu::{Blend, Bound, Buffer, Descriptors, Gpu, GraphicsState, Image, ImageDesc, Pipeline};
use crate::interface::WarpPush;
use crate::num;
use crate::primitives::dispatch::buffer;
use crate::resident::GpuScene;
use crate::resident::tables::{Integrator, Knots, SegmentOptions};
use crate::resident::volume::{Layout, Volume};
use crate::scene::View;
use crate::technique::declare::{BlendOrder, EmptySpace, Route};
use crate::technique::grid::dispatch_limits::{Loops, check_loops, slabs_per_dispatch};
use crate::technique::grid::options::Filter;
use crate::technique::grid::paging::Paging;
use crate::technique::grid::slices_2d::Stacks;
use crate::technique::shear_warp::bounds::ShearBounds;
use crate::technique::shear_warp::frame::{Path, ShearFrame, Stack};
use crate::technique::shear_warp::march::{EdgeMarch, March};
use crate::technique::shear_warp::options::{NAME, Options, Warp};
use crate::technique::shear_warp::planes::{DrawnPlane, DrawnPlanes, FILL, TEXEL, choose_planes};

/// Format of the intermediate image.
const FORMAT: vk::Format = vk::Format::R32G32B32A32_SFLOAT;

/// Most base planes of a perspective view.
const MOST_PLANES: usize = 6;

/// Levels that `warp=mip` provides for in other views.
const MOST_LEVELS: usize = 16;

/// How every step samples the grid and the transfer function.
struct Sampling {
    knots: Arc<Knots>,
    /// `None` where slices are classified.
    segments: Option<SegmentOptions>,
    /// The sampler's filter for slices.
    filter: vk::Filter,
    lattice: Lattice,
    optics: Optics,
    pages: Pages,
    integration: Segments,
    between: bool,
    /// Whether a slab holds several slices.
    every: bool,
}

/// The intermediate image on the device, with capacity for views that need more than the first.
struct Intermediate {
    /// Columns and rows of the image that raster draws all base planes into.
    atlas: [u32; 2],
    texels: u64,
    buffer: Arc<Buffer>,
}

/// The inputs that the steps of the construction share.
struct Build<'a> {
    scene: &'a Arc<GpuScene>,
    gpu: &'a Gpu,
    view: &'a View,
    target: &'a Canvas,
    options: &'a Options,
    raster: bool,
    sampling: &'a Sampling,
    intermediate: &'a Intermediate,
    paging: Option<&'a Paging>,
    /// Slabs of the base plane with the most.
    most_slabs: u32,
}

impl ShearFrame {
    /// Fixes everything that frames of one size need.
    pub(crate) fn new(scene: &Arc<GpuScene>, view: &View, target: &Canvas, options: Options) -> Result<Self> {
        let gpu = scene.gpu();
        let grid = scene.grid()?;
        let raster = options.grid.route_on(gpu, NAME)? == Route::Raster;
        let has_nan = grid.nan_count() > 0;
        if has_nan && options.every > 1 {
            return Err(Error::unsupported(
                format!("{NAME} every={}", options.every),
                "a grid without NaN: slices that are not looked up may hold it",
            ));
        }
        let chosen = choose_planes(gpu, grid, &options, view, None, raster)?;
        let axes = match (options.stacks, chosen.axes.as_slice()) {
            (Stacks::All, _) => vec![0, 1, 2],
            // A view without base planes still binds a stack.
            (Stacks::Used, []) => vec![2],
            (Stacks::Used, axes) => axes.to_vec(),
        };
        let hardware = options.grid.filter == Filter::Hardware;
        let layout = Layout::Stack(axes.first().copied().unwrap_or(2));
        let pages = scene.pages_of(layout, hardware, false)?;
        let paged = pages.is_some();
        // A pool serves every axis.
        let axes = if paged { vec![0, 1, 2] } else { axes };
        let volume = |&axis: &usize| match pages {
            Some(form) => Ok(Arc::clone(&scene.page_pool(form)?.volume)),
            None => scene.volume(Layout::Stack(axis), hardware, false),
        };
        let volumes = axes.iter().map(volume).collect::<Result<Vec<_>>>()?;
        let Some(volume) = volumes.first() else { return Err(Error::invalid(NAME, "no volume")) };
        if paged && (raster || target.bounds.is_some()) {
            let (what, instead) =
                if raster { ("route=raster", "route=compute") } else { ("of a cut view", "slices-2d") };
            return Err(Paging::refused(NAME, what, instead));
        }
        let mut sampling = Sampling::new(scene, &options, volume, has_nan)?;
        let knots = &sampling.knots;
        let drawn = DrawnPlanes::of(scene, &options, &chosen, &axes, volume, knots, view, raster)?;
        let intermediate = Intermediate::new(gpu, &drawn, raster)?;
        let margin = scene.margin(sampling.segments.as_ref());
        let paging =
            pages.map(|form| Paging::new(scene, NAME, form, Some(margin), view, intermediate.texels, false));
        let paging = paging.transpose()?;
        sampling.pages = Paging::pages(paging.as_ref(), &sampling.knots.buffer);
        let knots = &sampling.knots;
        let build = Build {
            scene,
            gpu,
            view,
            target,
            options: &options,
            raster,
            sampling: &sampling,
            intermediate: &intermediate,
            paging: paging.as_ref(),
            most_slabs: drawn.planes.iter().map(|plane| plane.slabs).max().unwrap_or(1),
        };

        let bounds = match &target.bounds {
            Some(bounds) => {
                Some(ShearBounds::new(gpu, bounds, view, intermediate.texels, build.warp_code())?)
            }
            None => None,
        };
        let texel_bounds = bounds.as_ref().map_or(&knots.buffer, |bounds| &bounds.texel_bounds);
        let (path, stacks) = if raster {
            build.draws(&axes, &volumes, texel_bounds)?
        } else {
            build.marches(&axes, &volumes, texel_bounds)?
        };
        let (warp, image) = build.warp(bounds.as_ref())?;
        let bounded = match (bounds, &image) {
            (Some(bounds), Some(image)) => {
                let march = build.edge_march(&bounds, image, &volumes)?;
                Some((bounds, march))
            }
            _ => None,
        };
        let halve = build.halve()?;
        let most = build.most(&drawn);
        Ok(Self {
            scene: Arc::clone(scene),
            measure: DepthMeasure::of_grid(grid),
            options,
            knots: sampling.knots,
            stacks,
            path,
            bounded,
            intermediate: intermediate.buffer,
            image,
            halve,
            warp,
            drawn,
            most,
            paging,
        })
    }
}

impl Sampling {
    fn new(scene: &GpuScene, options: &Options, volume: &Volume, has_nan: bool) -> Result<Self> {
        // A sampler may drop NaN.
        let exact = options.grid.filter == Filter::Exact || !volume.filterable || has_nan;
        let knots = scene.knots()?;
        let segments = Some(options.segments).filter(|s| s.integrator != Integrator::Midpoint);
        Ok(Self {
            segments,
            filter: if exact { vk::Filter::NEAREST } else { vk::Filter::LINEAR },
            // Stacks have no mip levels here: the warp averages texels instead.
            lattice: Lattice { filter_exact: exact, has_nan, prefilter: false },
            optics: knots.optics(),
            pages: Paging::pages(None, &knots.buffer),
            integration: scene.segments(&options.segments, options.grid.filter == Filter::Hardware, None)?,
            between: options.between,
            every: options.every > 1,
            knots,
        })
    }

    /// The inputs of shaders that sample a stack.
    fn stack(&self, volume: &Volume) -> StackInputs {
        StackInputs { volume: volume.image.sampled(self.filter), between: self.between }
    }
}

impl Intermediate {
    fn new(gpu: &Gpu, drawn: &DrawnPlanes, raster: bool) -> Result<Self> {
        let most = gpu.most_bound_bytes() / TEXEL;
        let atlas = drawn.atlas.map(|side| {
            let with_margin = num::u32_of(f64::from(side.max(1)) * 1.3);
            with_margin.min(gpu.max_image_2d()).max(side)
        });
        let [columns, rows] = atlas.map(u64::from);
        let atlas_texels = if raster { columns * rows } else { 0 };
        let needed = atlas_texels + u64::from(drawn.texels);
        let with_margin = num::u64_of(f64::from(drawn.texels.max(64)) / FILL);
        let texels = (atlas_texels + with_margin).min(most).max(needed);
        let buffer = buffer(gpu, &format!("{NAME}.intermediate"), texels.saturating_mul(TEXEL / 4))?;
        Ok(Self { atlas, texels, buffer })
    }
}

/// The first of the stacks, all of which have one form.
fn first_of(volumes: &[Arc<Volume>]) -> Result<&Volume> {
    volumes.first().map(Arc::as_ref).ok_or_else(|| Error::invalid(NAME, "no volume"))
}

impl Build<'_> {
    /// The shader's code of the warp's filter.
    fn warp_code(&self) -> u32 {
        match self.options.warp {
            Warp::Bilinear => WARP_BILINEAR,
            Warp::Mip => WARP_MIP,
            Warp::Bicubic => WARP_BICUBIC,
        }
    }

    /// Makes the descriptors of each stack; `bind` binds the shaders of `pipeline` for its samples.
    fn stacks(
        &self,
        pipeline: &Pipeline,
        axes: &[usize],
        volumes: &[Arc<Volume>],
        bind: impl Fn(&Volume) -> Bound,
    ) -> Result<Vec<Stack>> {
        let made = |(&axis, volume): (&usize, &Arc<Volume>)| {
            let descriptors = Arc::new(Descriptors::new(self.gpu, pipeline, &bind(volume))?);
            Ok(Stack { axis, volume: Arc::clone(volume), descriptors })
        };
        axes.iter().zip(volumes).map(made).collect()
    }

    /// Route `raster`: draws each slab as a quad.
    fn draws(
        &self,
        axes: &[usize],
        volumes: &[Arc<Volume>],
        texel_bounds: &Arc<Buffer>,
    ) -> Result<(Path, Vec<Stack>)> {
        let (gpu, sampling) = (self.gpu, self.sampling);
        check_loops(gpu, NAME, &Loops::new(&sampling.knots, sampling.segments.as_ref(), false))?;
        let bind = |volume: &Volume| {
            SHEAR_WARP_VERTEX.with(&ShearWarpVertex {}).and(SHEAR_WARP_FRAGMENT.with(&ShearWarpFragment {
                pages: self.sampling.pages.clone(),
                texel_bounds: texel_bounds.read(),
                bounded: self.target.bounds.is_some(),
                every: sampling.every,
                lattice: sampling.lattice.clone(),
                optics: sampling.optics.clone(),
                segments: sampling.integration.clone(),
                stack: sampling.stack(volume),
            }))
        };
        let back_to_front = self.options.grid.order() == BlendOrder::BackToFront;
        let state = GraphicsState {
            topology: vk::PrimitiveTopology::TRIANGLE_STRIP,
            blend: if back_to_front { Blend::Over } else { Blend::Under },
            format: Some(FORMAT),
        };
        let pipeline = gpu.graphics_pipeline(&format!("{NAME}.draw"), &bind(first_of(volumes)?), state)?;
        let name = format!("{NAME}.base-planes");
        gpu.check_drawing(&name, self.intermediate.atlas)?;
        let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_SRC;
        let desc = ImageDesc::flat(FORMAT, self.intermediate.atlas, usage);
        let atlas = Arc::new(Image::new(gpu, &name, &desc)?);
        let stacks = self.stacks(&pipeline, axes, volumes, bind)?;
        Ok((Path::Raster { pipeline, atlas }, stacks))
    }

    /// Slabs that one dispatch of so many rays may walk.
    fn slabs_per_dispatch(&self, rays: u64) -> Result<u32> {
        let Sampling { knots, segments, .. } = self.sampling;
        let (grid, loops) = (self.scene.grid()?, Loops::new(knots, segments.as_ref(), false));
        slabs_per_dispatch(self.gpu, NAME, self.most_slabs, &loops, grid, rays)
    }

    /// Route `compute`: marches the ray of each texel.
    fn marches(
        &self,
        axes: &[usize],
        volumes: &[Arc<Volume>],
        texel_bounds: &Arc<Buffer>,
    ) -> Result<(Path, Vec<Stack>)> {
        let Sampling { knots, segments, .. } = self.sampling;
        let skips = self.options.grid.empty_space == EmptySpace::Skip;
        // A variant that reads no bricks binds the knots in their place.
        let bricks = match self.paging {
            _ if !skips => Arc::clone(&knots.buffer),
            Some(paging) => Arc::clone(&paging.bricks().codes),
            None => self.scene.bricks(self.scene.margin(segments.as_ref()))?.codes,
        };
        let bind = |volume: &Volume, resume: bool| {
            SHEAR_WARP_COMPUTE.with(&ShearWarpCompute {
                pages: self.sampling.pages.clone(),
                paging: Paging::march(self.paging, &self.target.hit_depths),
                intermediate: self.intermediate.buffer.write(),
                texel_bounds: texel_bounds.read(),
                bounded: self.target.bounds.is_some(),
                every: self.sampling.every,
                resume,
                counts: self.target.counts(&knots.buffer),
                empty_space: Skipping { bricks: bricks.read(), empty_space: skips, greatest: false },
                lattice: self.sampling.lattice.clone(),
                optics: self.sampling.optics.clone(),
                segments: self.sampling.integration.clone(),
                stack: self.sampling.stack(volume),
            })
        };
        // Rays of the largest base plane that the intermediate image holds.
        let slabs_per_dispatch = self.slabs_per_dispatch(self.intermediate.texels)?;
        let volume = first_of(volumes)?;
        let first = self.gpu.compute_pipeline(&format!("{NAME}.march"), &bind(volume, false))?;
        let resume = if self.most_slabs > slabs_per_dispatch && self.paging.is_none() {
            Some(self.gpu.compute_pipeline(&format!("{NAME}.march.resume"), &bind(volume, true))?)
        } else {
            None
        };
        let stacks = self.stacks(&first, axes, volumes, |volume| bind(volume, false))?;
        Ok((Path::Compute(March { first, resume, slabs_per_dispatch }), stacks))
    }

    /// The warp with its descriptors, and the image that it makes unless it draws into the caller's.
    #[expect(clippy::type_complexity, reason = "one caller, which takes it apart")]
    fn warp(
        &self,
        bounds: Option<&ShearBounds>,
    ) -> Result<((Arc<Pipeline>, Arc<Descriptors>), Option<Arc<Image>>)> {
        let gpu = self.gpu;
        let (intermediate, warp) = (self.intermediate.buffer.read(), self.warp_code());
        // Pixels that are marched by themselves are stored by a shader.
        let (bound, pipeline, image) = if self.raster && bounds.is_none() {
            let inputs = WarpFragment { intermediate, warp };
            let bound = WARP_VERTEX.with(&WarpVertex {}).and(WARP_FRAGMENT.with(&inputs));
            let (pipeline, image) = self.warp_by_raster(&bound)?;
            (bound, pipeline, image)
        } else {
            let usage = vk::ImageUsageFlags::STORAGE;
            let image = own_image(gpu, NAME, FORMAT, usage, self.view, self.target)?;
            let accumulation = image.stored();
            let bound = match bounds {
                Some(bounds) => {
                    let edges = bounds.edge_pixels.write();
                    WARP_BOUNDED.with(&WarpBounded { accumulation, edges, intermediate, warp })
                }
                None => WARP_COMPUTE.with(&WarpCompute { accumulation, intermediate, warp }),
            };
            let pipeline = gpu.compute_pipeline(&format!("{NAME}.warp"), &bound)?;
            (bound, pipeline, Some(image))
        };
        let descriptors = Arc::new(Descriptors::new(gpu, &pipeline, &bound)?);
        Ok(((pipeline, descriptors), image))
    }

    /// The warp as a draw.
    fn warp_by_raster(&self, bound: &Bound) -> Result<(Arc<Pipeline>, Option<Arc<Image>>)> {
        let (gpu, target) = (self.gpu, self.target);
        let directly = target.format().filter(|&format| draws_directly(target, format, true));
        let state = GraphicsState {
            topology: vk::PrimitiveTopology::TRIANGLE_STRIP,
            blend: Blend::Over,
            format: Some(directly.unwrap_or(FORMAT)),
        };
        let pipeline = gpu.graphics_pipeline(&format!("{NAME}.warp"), bound, state)?;
        if directly.is_some() {
            return Ok((pipeline, None));
        }
        gpu.check_drawing(&format!("{NAME}.accumulation"), self.view.extent())?;
        let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT;
        Ok((pipeline, Some(own_image(gpu, NAME, FORMAT, usage, self.view, target)?)))
    }

    /// The march of pixels that the warp cannot take from texels.
    fn edge_march(
        &self,
        bounds: &ShearBounds,
        image: &Arc<Image>,
        volumes: &[Arc<Volume>],
    ) -> Result<EdgeMarch> {
        let sampling = self.sampling;
        let pixels = self.view.extent().map(u64::from).iter().product();
        let slabs_per_dispatch = self.slabs_per_dispatch(pixels)?;
        let shader = |volume: &Arc<Volume>| {
            let stack = sampling.stack(volume);
            move |resume: bool| {
                SHEAR_WARP_EDGE.with(&ShearWarpEdge {
                    pages: self.sampling.pages.clone(),
                    paging: Paging::march(self.paging, &self.target.hit_depths),
                    accumulation: image.stored(),
                    edges: bounds.edge_pixels.read(),
                    every: sampling.every,
                    resume,
                    counts: self.target.counts(&sampling.knots.buffer),
                    // A single ray skips no bricks.
                    empty_space: Skipping {
                        bricks: sampling.knots.buffer.read(),
                        empty_space: false,
                        greatest: false,
                    },
                    lattice: sampling.lattice.clone(),
                    optics: sampling.optics.clone(),
                    segments: sampling.integration.clone(),
                    stack: stack.clone(),
                })
            }
        };
        let shaders: Vec<_> = volumes.iter().map(shader).collect();
        EdgeMarch::new(self.gpu, &shaders, slabs_per_dispatch)
    }

    /// `warp=mip`: averages texels of one level to those of the next.
    fn halve(&self) -> Result<Option<(Arc<Pipeline>, Arc<Descriptors>)>> {
        if self.options.warp != Warp::Mip {
            return Ok(None);
        }
        let bound = WARP_HALVE.with(&WarpHalve { intermediate: self.intermediate.buffer.write() });
        let pipeline = self.gpu.compute_pipeline(&format!("{NAME}.halve"), &bound)?;
        let descriptors = Arc::new(Descriptors::new(self.gpu, &pipeline, &bound)?);
        Ok(Some((pipeline, descriptors)))
    }

    /// The base planes with the most passes that another view may have: six in perspective, each with half as many slabs again
    /// as the first view's.
    fn most(&self, drawn: &DrawnPlanes) -> DrawnPlanes {
        let levels = drawn.planes.iter().map(|plane| plane.halves.len()).max().unwrap_or(0);
        let levels = if self.options.warp == Warp::Mip { levels.max(MOST_LEVELS) } else { levels };
        let plane = DrawnPlane {
            slabs: self.most_slabs.saturating_add(self.most_slabs / 2),
            halves: vec![WarpPush::default(); levels],
            ..DrawnPlane::default()
        };
        let planes = if self.view.is_perspective() { MOST_PLANES } else { 1 };
        DrawnPlanes { planes: vec![plane; planes.max(drawn.planes.len())], ..DrawnPlanes::default() }
    }
}
