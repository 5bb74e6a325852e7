//! Builds a frame of `shear-warp`: stacks, intermediate image, compositing, warp.

use std::sync::Arc;

use ash::vk;

use crate::error::{Error, Result};
use crate::frame::depth_measure::DepthMeasure;
use crate::frame::target::{Canvas, draws_directly, own_image};
use crate::gpu::shader::{
    BINDING_ACCUMULATION, BINDING_BRICKS, BINDING_EDGES, BINDING_INTERMEDIATE, BINDING_KNOTS,
    BINDING_KNOTS_UNIFORM, BINDING_TABLE, BINDING_TABLE_HEAD, BINDING_TEXEL_BOUNDS, BINDING_VOLUME,
    SHEAR_WARP_COMPUTE, SHEAR_WARP_FRAGMENT, SHEAR_WARP_VERTEX, SPEC_BETWEEN, SPEC_EMPTY_SPACE, SPEC_EVERY,
    SPEC_FILTER_EXACT, SPEC_HAS_NAN, SPEC_INTEGRATOR, SPEC_KNOT_WALK, SPEC_RESUME, SPEC_TABLE_FILTER,
    SPEC_WARP, WARP_BICUBIC, WARP_BILINEAR, WARP_BOUNDED, WARP_COMPUTE, WARP_FRAGMENT, WARP_HALVE, WARP_MIP,
    WARP_VERTEX,
};
use crate::gpu::{
    Blend, Buffer, ComputeDesc, Descriptors, Gpu, GraphicsDesc, Image, ImageDesc, Pipeline, Resource,
    SpecConstant,
};
use crate::interface::WarpPush;
use crate::num;
use crate::primitives::dispatch::buffer;
use crate::resident::GpuScene;
use crate::resident::tables::{Integrator, Knots, SegmentOptions, TABLE_FORMAT};
use crate::resident::volume::{Layout, Volume};
use crate::scene::View;
use crate::technique::grid::dispatch_limits::{check_loops, slabs_per_dispatch};
use crate::technique::grid::options::Filter;
use crate::technique::grid::slices_2d::Stacks;
use crate::technique::options::{BlendOrder, EmptySpace, Route};
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

/// Bindings with their resources.
type Resources = Vec<(u32, Resource)>;

/// How every step samples the grid and the transfer function.
struct Sampling {
    knots: Arc<Knots>,
    /// `None` where slices are classified.
    segments: Option<SegmentOptions>,
    /// The table's texels, or a placeholder.
    table: Arc<Image>,
    /// The sampler's filter for slices.
    filter: vk::Filter,
    constants: Vec<SpecConstant>,
    resources: Resources,
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
        let volumes: Vec<_> = axes
            .iter()
            .map(|&axis| scene.volume(Layout::Stack(axis), hardware, false))
            .collect::<Result<_>>()?;
        let Some(volume) = volumes.first() else { return Err(Error::invalid(NAME, "no volume")) };
        let sampling = Sampling::new(scene, target, &options, volume, has_nan)?;
        let knots = &sampling.knots;
        let drawn = DrawnPlanes::of(scene, &options, &chosen, &axes, volume, knots, view, raster)?;
        let intermediate = Intermediate::new(gpu, &drawn, raster)?;
        let build = Build {
            scene,
            gpu,
            view,
            target,
            options: &options,
            raster,
            sampling: &sampling,
            intermediate: &intermediate,
            most_slabs: drawn.planes.iter().map(|plane| plane.slabs).max().unwrap_or(1),
        };

        let bounds = match &target.bounds {
            Some(bounds) => {
                Some(ShearBounds::new(gpu, bounds, view, intermediate.texels, build.warp_constant())?)
            }
            None => None,
        };
        let mut resources = build.resources(bounds.as_ref());
        let (path, pipeline) = if raster { build.draws()? } else { build.marches(&mut resources)? };
        let (stacks, stack_resources) = build.stacks(&pipeline, &resources, &axes, volumes)?;
        let (warp, image) = build.warp(bounds.as_ref())?;
        let bounded = match (bounds, &image) {
            (Some(bounds), Some(image)) => {
                let march = build.edge_march(&bounds, image, stack_resources)?;
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
            table: sampling.table,
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
        })
    }
}

impl Sampling {
    fn new(
        scene: &GpuScene,
        target: &Canvas,
        options: &Options,
        volume: &Volume,
        has_nan: bool,
    ) -> Result<Self> {
        // A sampler may drop NaN.
        let exact = options.grid.filter == Filter::Exact || !volume.filterable || has_nan;
        let knots = scene.knots()?;
        let segments = Some(options.segments).filter(|s| s.integrator != Integrator::Midpoint);
        let table = match &segments {
            Some(segments) => scene.table(segments)?,
            None => None,
        };
        let texels = match &table {
            Some(table) => Arc::clone(&table.image),
            None => scene.no_table()?,
        };
        let linear = vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR;
        let filters_table = options.segments.integrator == Integrator::Full
            && options.grid.filter == Filter::Hardware
            && scene.gpu().image_features(TABLE_FORMAT).contains(linear);
        let constants = vec![
            (SPEC_FILTER_EXACT, u32::from(exact)),
            (SPEC_HAS_NAN, u32::from(has_nan)),
            (SPEC_KNOT_WALK, knots.walk),
            (SPEC_INTEGRATOR, options.segments.integrator.code()),
            (SPEC_TABLE_FILTER, u32::from(filters_table)),
            (SPEC_BETWEEN, u32::from(options.between)),
            (SPEC_EVERY, u32::from(options.every > 1)),
            target.bounded(),
        ];
        let filter = |linear: bool| if linear { vk::Filter::LINEAR } else { vk::Filter::NEAREST };
        let knots_buffer = || Resource::Buffer(Arc::clone(&knots.buffer));
        let table_head =
            table.as_ref().map_or_else(knots_buffer, |table| Resource::Buffer(Arc::clone(&table.buffer)));
        let resources = vec![
            (BINDING_KNOTS_UNIFORM, knots_buffer()),
            (BINDING_KNOTS, knots_buffer()),
            (BINDING_TABLE_HEAD, table_head),
            (BINDING_TABLE, Resource::Sampled(Arc::clone(&texels), filter(filters_table))),
        ];
        Ok(Self { knots, segments, table: texels, filter: filter(!exact), constants, resources })
    }
}

impl Intermediate {
    fn new(gpu: &Gpu, drawn: &DrawnPlanes, raster: bool) -> Result<Self> {
        let most = gpu.most_buffer_bytes() / TEXEL;
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

impl Build<'_> {
    /// The filter of the warp.
    fn warp_constant(&self) -> SpecConstant {
        let code = match self.options.warp {
            Warp::Bilinear => WARP_BILINEAR,
            Warp::Mip => WARP_MIP,
            Warp::Bicubic => WARP_BICUBIC,
        };
        (SPEC_WARP, code)
    }

    /// The bindings of compositing that do not depend on route and stack.
    fn resources(&self, bounds: Option<&ShearBounds>) -> Resources {
        let mut resources = self.sampling.resources.clone();
        resources.push((BINDING_INTERMEDIATE, Resource::Buffer(Arc::clone(&self.intermediate.buffer))));
        let texel_bounds = bounds.map_or(&self.sampling.knots.buffer, |bounds| &bounds.texel_bounds);
        resources.push((BINDING_TEXEL_BOUNDS, Resource::ReadOnly(Arc::clone(texel_bounds))));
        resources
    }

    /// Route `raster`: draws each slab as a quad.
    fn draws(&self) -> Result<(Path, Arc<Pipeline>)> {
        let gpu = self.gpu;
        check_loops(gpu, NAME, &self.sampling.knots, self.sampling.segments.as_ref())?;
        let back_to_front = self.options.grid.order() == BlendOrder::BackToFront;
        let pipeline = gpu.graphics_pipeline(
            &format!("{NAME}.draw"),
            &GraphicsDesc {
                vertex: &SHEAR_WARP_VERTEX,
                fragment: &SHEAR_WARP_FRAGMENT,
                topology: vk::PrimitiveTopology::TRIANGLE_STRIP,
                blend: if back_to_front { Blend::Over } else { Blend::Under },
                format: Some(FORMAT),
                constants: &self.sampling.constants,
            },
        )?;
        let name = format!("{NAME}.base-planes");
        gpu.check_drawing(&name, self.intermediate.atlas)?;
        let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_SRC;
        let desc = ImageDesc::flat(FORMAT, self.intermediate.atlas, usage);
        let atlas = Arc::new(Image::new(gpu, &name, &desc)?);
        Ok((Path::Raster { pipeline: Arc::clone(&pipeline), atlas }, pipeline))
    }

    /// Slabs that one dispatch of so many rays may walk.
    fn slabs_per_dispatch(&self, rays: u64) -> Result<u32> {
        let Sampling { knots, segments, .. } = self.sampling;
        let grid = self.scene.grid()?;
        slabs_per_dispatch(self.gpu, NAME, self.most_slabs, knots, segments.as_ref(), grid, rays)
    }

    /// Route `compute`: marches the ray of each texel.
    fn marches(&self, resources: &mut Resources) -> Result<(Path, Arc<Pipeline>)> {
        let Sampling { knots, segments, constants, .. } = self.sampling;
        let skips = self.options.grid.empty_space == EmptySpace::Skip;
        let bricks = if skips {
            Resource::ReadOnly(self.scene.bricks(self.scene.margin(segments.as_ref()))?)
        } else {
            Resource::Buffer(Arc::clone(&knots.buffer))
        };
        resources.push((BINDING_BRICKS, bricks));
        // Rays of the largest base plane that the intermediate image holds.
        let slabs_per_dispatch = self.slabs_per_dispatch(self.intermediate.texels)?;
        let pipeline = |resume: bool| {
            let mut constants = constants.clone();
            constants.push((SPEC_RESUME, u32::from(resume)));
            constants.push((SPEC_EMPTY_SPACE, u32::from(skips)));
            let name = if resume { format!("{NAME}.march.resume") } else { format!("{NAME}.march") };
            let desc = ComputeDesc { shader: &SHEAR_WARP_COMPUTE, constants: &constants };
            self.gpu.compute_pipeline(&name, &desc)
        };
        let first = pipeline(false)?;
        let resume = if self.most_slabs > slabs_per_dispatch { Some(pipeline(true)?) } else { None };
        Ok((Path::Compute(March { first: Arc::clone(&first), resume, slabs_per_dispatch }), first))
    }

    /// Makes the descriptors of each stack. Also returns their bindings, for the march of single pixels.
    fn stacks(
        &self,
        pipeline: &Arc<Pipeline>,
        resources: &Resources,
        axes: &[usize],
        volumes: Vec<Arc<Volume>>,
    ) -> Result<(Vec<Stack>, Vec<Resources>)> {
        let mut stacks = Vec::new();
        let mut all = Vec::new();
        for (&axis, volume) in axes.iter().zip(volumes) {
            let mut resources = resources.clone();
            let samples = Resource::Sampled(Arc::clone(&volume.image), self.sampling.filter);
            resources.push((BINDING_VOLUME, samples));
            let descriptors = Arc::new(Descriptors::new(self.gpu, pipeline, &resources)?);
            all.push(resources);
            stacks.push(Stack { axis, volume, descriptors });
        }
        Ok((stacks, all))
    }

    /// The warp with its descriptors, and the image that it makes unless it draws into the caller's.
    #[expect(clippy::type_complexity, reason = "one caller, which takes it apart")]
    fn warp(
        &self,
        bounds: Option<&ShearBounds>,
    ) -> Result<((Arc<Pipeline>, Arc<Descriptors>), Option<Arc<Image>>)> {
        let gpu = self.gpu;
        let constants = [self.warp_constant()];
        let intermediate = Resource::ReadOnly(Arc::clone(&self.intermediate.buffer));
        let mut resources = vec![(BINDING_INTERMEDIATE, intermediate)];
        if let Some(bounds) = bounds {
            resources.push((BINDING_EDGES, Resource::Buffer(Arc::clone(&bounds.edge_pixels))));
        }
        // Pixels that are marched by themselves are stored by a shader.
        let (pipeline, image) = if self.raster && bounds.is_none() {
            self.warp_by_raster(&constants)?
        } else {
            let usage = vk::ImageUsageFlags::STORAGE;
            let image = own_image(gpu, NAME, FORMAT, usage, self.view, self.target)?;
            resources.push((BINDING_ACCUMULATION, Resource::Storage(Arc::clone(&image))));
            let shader = if bounds.is_some() { &WARP_BOUNDED } else { &WARP_COMPUTE };
            let desc = ComputeDesc { shader, constants: &constants };
            (gpu.compute_pipeline(&format!("{NAME}.warp"), &desc)?, Some(image))
        };
        let descriptors = Arc::new(Descriptors::new(gpu, &pipeline, &resources)?);
        Ok(((pipeline, descriptors), image))
    }

    /// The warp as a draw.
    fn warp_by_raster(&self, constants: &[SpecConstant]) -> Result<(Arc<Pipeline>, Option<Arc<Image>>)> {
        let (gpu, target) = (self.gpu, self.target);
        let directly = target.format().filter(|&format| draws_directly(target, format, true));
        let pipeline = gpu.graphics_pipeline(
            &format!("{NAME}.warp"),
            &GraphicsDesc {
                vertex: &WARP_VERTEX,
                fragment: &WARP_FRAGMENT,
                topology: vk::PrimitiveTopology::TRIANGLE_STRIP,
                blend: Blend::Over,
                format: Some(directly.unwrap_or(FORMAT)),
                constants,
            },
        )?;
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
        stacks: Vec<Resources>,
    ) -> Result<EdgeMarch> {
        let Sampling { knots, constants, .. } = self.sampling;
        let pixels = self.view.extent().map(u64::from).iter().product();
        let slabs_per_dispatch = self.slabs_per_dispatch(pixels)?;
        EdgeMarch::new(self.gpu, bounds, image, knots, constants, stacks, slabs_per_dispatch)
    }

    /// `warp=mip`: averages texels of one level to those of the next.
    fn halve(&self) -> Result<Option<(Arc<Pipeline>, Arc<Descriptors>)>> {
        if self.options.warp != Warp::Mip {
            return Ok(None);
        }
        let desc = ComputeDesc { shader: &WARP_HALVE, constants: &[] };
        let pipeline = self.gpu.compute_pipeline(&format!("{NAME}.halve"), &desc)?;
        let resources = [(BINDING_INTERMEDIATE, Resource::Buffer(Arc::clone(&self.intermediate.buffer)))];
        let descriptors = Arc::new(Descriptors::new(self.gpu, &pipeline, &resources)?);
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
