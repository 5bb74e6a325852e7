//! What techniques for grids share on the host: the resources of a frame, its route, and how it is recorded.
//!
//! A technique says how it cuts the domain into slabs and which shaders draw them ([`GridTechnique`]); from
//! that follow a frame by compute (one dispatch, or several that resume where the march is too long for one),
//! by raster (one instanced draw, blended by fixed function), or by raster with dithering (one draw a slab,
//! blended by the shader).

use std::sync::Arc;

use ash::vk;

use crate::error::{Error, Result};
use crate::frame::depth_measure::DepthMeasure;
use crate::frame::prepared::Prepared;
use crate::frame::target::{Canvas, draws_directly, own_image};
use crate::gpu::shader::{
    BINDING_ACCUMULATION, BINDING_BRICKS, BINDING_KNOTS, BINDING_KNOTS_UNIFORM, BINDING_TABLE,
    BINDING_TABLE_HEAD, BINDING_TEXELS, BINDING_THRESHOLDS, BINDING_VOLUME, BRICK, SPEC_BLUE_NOISE,
    SPEC_EMPTY_SPACE, SPEC_FILTER_EXACT, SPEC_HAS_NAN, SPEC_INTEGRATOR, SPEC_KNOT_WALK, SPEC_PREFILTER,
    SPEC_RESUME, SPEC_TABLE_FILTER, SPEC_TARGET, SPEC_UNDER, Shader,
};
use crate::gpu::sync::Use;
use crate::gpu::{
    Attachment, Blend, Buffer, BufferUse, ComputeDesc, Descriptors, Gpu, GraphicsDesc, Image, Pipeline,
    Recorder, Resource, SpecConstant, TargetImage,
};
use crate::interface::GridPush;
use crate::num::{self, f32_of};
use crate::primitives::dispatch::tiles_of;
use crate::resident::GpuScene;
use crate::resident::tables::{Integrator, Knots, SegmentOptions, TABLE_FORMAT, Table};
use crate::resident::volume::{Layout, Volume};
use crate::scene::grid::turned;
use crate::scene::{Grid, View};
use crate::technique::grid::blue_noise;
use crate::technique::grid::options::{Dither, Filter, GridOptions, Prefilter};
use crate::technique::grid::rays::GridRays;
use crate::technique::options::{Choice, EmptySpace, Order, Route};

/// More slabs than this lose their order in float32, and no image needs them.
pub(crate) const MAX_SLABS: f64 = 4_194_304.0;

/// More draws than this hold up the device, and the host that records them, for too long.
const MAX_DRAWS: f64 = 65_536.0;

/// Shaders of a technique.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shaders {
    pub(crate) compute: &'static Shader,
    pub(crate) raster: Option<RasterShaders>,
}

/// Shaders that draw slabs as polygons.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RasterShaders {
    pub(crate) vertex: &'static Shader,
    pub(crate) fragment: &'static Shader,
    pub(crate) shader_blend: &'static Shader,
    pub(crate) topology: vk::PrimitiveTopology,
    /// Vertices of one slab.
    pub(crate) vertices: u32,
}

/// How a technique cuts the domain of a view.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slabs {
    /// Where slab 0 begins and how thick slabs are, in the technique's own measure.
    pub(crate) begin: f64,
    pub(crate) thickness: f64,
    /// Number of slabs, not yet rounded down to what is drawn.
    pub(crate) count: f64,
    /// The slab at which front-to-back order begins: from it on upwards, then from the one below downwards. No
    /// ray meets slabs on both sides of it.
    pub(crate) first: u32,
}

impl Slabs {
    /// Slabs of equal depth from the domain's nearest point in front of the eye to its farthest.
    pub(crate) fn of_equal_depth(grid: &Grid, rays: &GridRays, step: f64) -> Self {
        let unit = grid.spacing().min_element();
        let [begin, end] = rays.depths.map(|depth| depth / unit);
        let count = if end > begin { ((end - begin) / step).ceil() } else { 0.0 };
        Self { begin, thickness: step, count, first: 0 }
    }
}

/// A technique for grids.
pub(crate) trait GridTechnique: std::fmt::Debug + Send + Sync {
    /// Its name.
    fn name(&self) -> &'static str;
    /// Whether its options hold, alone and together.
    fn check(&self) -> Result<()>;
    /// The shared options.
    fn options(&self) -> &GridOptions;
    /// How it integrates segments, where it has any.
    fn segments(&self) -> Option<SegmentOptions> {
        None
    }
    /// Specialisation constants of its own.
    fn constants(&self) -> Vec<SpecConstant> {
        Vec::new()
    }
    /// Its shaders.
    fn shaders(&self) -> Shaders;
    /// The axis along which slices are stacked, for a view; `current` is the one in use. `None`: one volume.
    fn stack_axis(&self, _grid: &Grid, _view: &View, _current: Option<usize>) -> Option<usize> {
        None
    }
    /// Whether all three stacks lie on the device.
    fn keeps_all_stacks(&self) -> bool {
        false
    }
    /// The slabs of a view. `rays` are in the axes of the stack.
    fn slabs(&self, grid: &Grid, rays: &GridRays, axis: Option<usize>) -> Slabs;
}

/// What is drawn of a view: the push constants, and the number of slabs.
#[derive(Clone, Copy, Debug)]
struct Cut {
    push: GridPush,
    count: u32,
    first: u32,
}

/// Samples of the grid with the descriptors that name them.
#[derive(Debug)]
struct Samples {
    axis: Option<usize>,
    volume: Arc<Volume>,
    descriptors: Arc<Descriptors>,
}

/// Everything that is fixed between frames of one size.
#[derive(Debug)]
pub(crate) struct GridFrame {
    scene: Arc<GpuScene>,
    measure: DepthMeasure,
    technique: Box<dyn GridTechnique>,
    knots: Arc<Knots>,
    table: Option<Arc<Table>>,
    image: Option<Arc<Image>>,
    samples: Vec<Samples>,
    /// Which of them is drawn.
    current: usize,
    cut: Cut,
    path: Path,
}

#[derive(Debug)]
enum Path {
    Raster {
        pipeline: Arc<Pipeline>,
        vertices: u32,
    },
    /// Raster whose shader blends into packed texels, which are then copied to the image.
    ShaderBlend {
        pipeline: Arc<Pipeline>,
        vertices: u32,
        texels: Arc<Buffer>,
    },
    Compute {
        first: Arc<Pipeline>,
        /// Continues where a dispatch before stopped; only where the work is split.
        resume: Option<Arc<Pipeline>>,
        /// Slabs that one dispatch may walk.
        slabs_per_dispatch: u32,
    },
}

impl Path {
    /// Passes for a number of slabs.
    fn passes(&self, slabs: u32) -> u32 {
        match self {
            Self::Raster { .. } => 1,
            Self::ShaderBlend { .. } => 3,
            Self::Compute { slabs_per_dispatch, .. } => slabs.div_ceil(*slabs_per_dispatch).max(1),
        }
    }
}

impl GridFrame {
    pub(crate) fn new(
        scene: &Arc<GpuScene>,
        view: &View,
        target: &Canvas,
        technique: Box<dyn GridTechnique>,
    ) -> Result<Self> {
        technique.check()?;
        let name = technique.name();
        let options = *technique.options();
        let gpu = scene.gpu();
        let grid = scene.grid()?;
        let route = options.route_on(gpu, name)?;
        if route == Route::Raster {
            target.refuse_layers(&format!("{name} route=raster"), "route=compute")?;
        }
        let mip = options.prefilter == Prefilter::Mip;
        // A sampler need not hand NaN on.
        let has_nan = grid.nan_count() > 0;
        if has_nan && mip {
            return Err(Error::unsupported(
                format!("{name} prefilter=mip"),
                "a grid without NaN: a mean with NaN is none",
            ));
        }
        let axis = technique.stack_axis(grid, view, None);
        let axes: Vec<Option<usize>> = match axis {
            Some(axis) if technique.keeps_all_stacks() => {
                [axis, axis + 1, axis + 2].map(|a| Some(a % 3)).to_vec()
            }
            axis => vec![axis],
        };
        let mut volumes = Vec::new();
        for &axis in &axes {
            let layout = axis.map_or(Layout::Volume, Layout::Stack);
            volumes.push(scene.volume(layout, options.filter == Filter::Hardware, mip)?);
        }
        let Some(volume) = volumes.first() else { return Err(Error::invalid(name, "no volume")) };
        let exact = options.filter == Filter::Exact || !volume.filterable || has_nan;
        let knots = scene.knots()?;
        let cut = cut(scene, technique.as_ref(), volume, &knots, view, axis)?;

        let segments = technique.segments();
        let table = match &segments {
            Some(segments) => scene.table(segments)?,
            None => None,
        };
        let shaders = technique.shaders();
        let mut constants: Vec<SpecConstant> = vec![
            (SPEC_FILTER_EXACT, u32::from(exact)),
            (SPEC_HAS_NAN, u32::from(has_nan)),
            (SPEC_PREFILTER, u32::from(mip)),
            (SPEC_KNOT_WALK, knots.walk),
        ];
        let filters_table = segments.is_some_and(|segments| segments.integrator == Integrator::Full)
            && options.filter == Filter::Hardware
            && gpu.image_features(TABLE_FORMAT).contains(vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR);
        if let Some(segments) = &segments {
            constants.push((SPEC_INTEGRATOR, segments.integrator.code()));
            constants.push((SPEC_TABLE_FILTER, u32::from(filters_table)));
        }
        constants.extend([target.bounded(), target.layered()]);
        constants.extend(technique.constants());
        let filter = if exact { vk::Filter::NEAREST } else { vk::Filter::LINEAR };
        let knots_buffer = || Resource::Buffer(Arc::clone(&knots.buffer));
        // A variant that does not read a table or bricks is given what is there anyway.
        let table_buffer =
            table.as_ref().map_or_else(knots_buffer, |table| Resource::Buffer(Arc::clone(&table.buffer)));
        let mut resources = vec![
            (BINDING_KNOTS_UNIFORM, knots_buffer()),
            (BINDING_KNOTS, knots_buffer()),
            (BINDING_TABLE_HEAD, table_buffer),
        ];
        resources.extend(target.bounds(&knots.buffer));
        resources.extend(target.layers(&knots.buffer));

        let (path, pipeline, image) = if route == Route::Compute {
            let format = vk::Format::R32G32B32A32_SFLOAT;
            let image = own_image(gpu, name, format, vk::ImageUsageFlags::STORAGE, view, target)?;
            resources.push((BINDING_ACCUMULATION, Resource::Storage(Arc::clone(&image))));
            let skips = options.empty_space == EmptySpace::Skip && !mip;
            let bricks = if skips {
                Resource::ReadOnly(scene.bricks(scene.margin(segments.as_ref()))?)
            } else {
                knots_buffer()
            };
            resources.push((BINDING_BRICKS, bricks));
            let rays = view.extent().map(u64::from).iter().product();
            let slabs_per_dispatch =
                slabs_per_dispatch(gpu, name, cut.count, &knots, segments.as_ref(), grid, rays)?;
            // Translucent surfaces take turns of their own.
            let slabs_per_dispatch = match target.layers {
                Some(_) => (slabs_per_dispatch / 2).max(1),
                None => slabs_per_dispatch,
            };
            let pipeline = |resume: bool| {
                let mut constants = constants.clone();
                constants.push((SPEC_RESUME, u32::from(resume)));
                constants.push((SPEC_EMPTY_SPACE, u32::from(skips)));
                let name = if resume { format!("{name}.march.resume") } else { format!("{name}.march") };
                gpu.compute_pipeline(&name, &ComputeDesc { shader: shaders.compute, constants: &constants })
            };
            let first = pipeline(false)?;
            let resume = if cut.count > slabs_per_dispatch { Some(pipeline(true)?) } else { None };
            (Path::Compute { first: Arc::clone(&first), resume, slabs_per_dispatch }, first, Some(image))
        } else {
            let Some(raster) = shaders.raster else {
                return Err(Error::unsupported(format!("{name} route=raster"), "polygons: it has none"));
            };
            check_loops(gpu, name, &knots, segments.as_ref())?;
            raster_path(gpu, name, &options, &raster, constants, &mut resources, view, target)?
        };

        let mut samples = Vec::new();
        for (axis, volume) in axes.into_iter().zip(volumes) {
            let mut resources = resources.clone();
            resources.push((BINDING_VOLUME, Resource::Sampled(Arc::clone(&volume.image), filter)));
            let table_texels = table.as_ref().map_or(&volume.image, |table| &table.image);
            let filter = if filters_table { vk::Filter::LINEAR } else { vk::Filter::NEAREST };
            resources.push((BINDING_TABLE, Resource::Sampled(Arc::clone(table_texels), filter)));
            let descriptors = Arc::new(Descriptors::new(gpu, &pipeline, &resources)?);
            samples.push(Samples { axis, volume, descriptors });
        }
        let measure = DepthMeasure::of_grid(grid);
        let scene = Arc::clone(scene);
        Ok(Self { scene, measure, technique, knots, table, image, samples, current: 0, cut, path })
    }
}

impl Prepared for GridFrame {
    fn set_view(&mut self, view: &View, most_passes: u32) -> Result<bool> {
        let grid = self.scene.grid()?;
        let in_use = self.samples.get(self.current).and_then(|samples| samples.axis);
        let axis = self.technique.stack_axis(grid, view, in_use);
        let Some(place) = self.samples.iter().position(|samples| samples.axis == axis) else {
            return Ok(false);
        };
        let volume = &self.samples[place].volume;
        let cut = cut(&self.scene, self.technique.as_ref(), volume, &self.knots, view, axis)?;
        let passes = self.path.passes(cut.count);
        let fits = passes <= most_passes
            && (passes == 1 || !matches!(self.path, Path::Compute { resume: None, .. }));
        if fits {
            (self.cut, self.current) = (cut, place);
        }
        Ok(fits)
    }

    fn measure(&self) -> DepthMeasure {
        self.measure
    }

    fn image(&self) -> Option<&Arc<Image>> {
        self.image.as_ref()
    }

    fn last_use(&self) -> Use {
        match self.path {
            Path::Raster { .. } => Use::ColorAttachment,
            Path::ShaderBlend { .. } => Use::TransferWrite,
            Path::Compute { .. } => Use::ComputeReadWrite,
        }
    }

    fn route(&self) -> &'static str {
        match self.path {
            Path::Raster { .. } | Path::ShaderBlend { .. } => Route::Raster.word(),
            Path::Compute { .. } => Route::Compute.word(),
        }
    }

    fn passes(&self) -> u32 {
        self.path.passes(self.cut.count)
    }

    fn counters(&self) -> Vec<(&'static str, u64)> {
        // Where the shader blends, each slab is a draw.
        let draws =
            if matches!(self.path, Path::ShaderBlend { .. }) { self.cut.count } else { self.passes() };
        let mut counters =
            vec![("slices", u64::from(self.cut.count)), ("dispatches_or_draws", u64::from(draws))];
        let axis = self.samples.get(self.current).and_then(|samples| samples.axis);
        counters.extend(axis.map(|axis| ("stack_axis", u64::from(num::count(axis)))));
        counters
    }

    fn record(&self, recorder: &mut Recorder<'_>, target: Option<&TargetImage>, clear: bool) {
        let Some(samples) = self.samples.get(self.current) else { return };
        recorder.assume_ready(&samples.volume.image);
        if let Some(table) = &self.table {
            recorder.assume_ready(&table.image);
        }
        let name = self.technique.name();
        let options = self.technique.options();
        let descriptors = &samples.descriptors;
        let count = self.cut.count;
        let mut push = self.cut.push;
        match &self.path {
            Path::Raster { pipeline, vertices } => {
                let attachment = match (&self.image, target) {
                    (Some(image), _) => Attachment::Own(Arc::clone(image)),
                    (None, Some(target)) => Attachment::Caller(*target),
                    (None, None) => return,
                };
                push.order = self.cut.first << 1 | u32::from(options.order() == Order::BackToFront);
                recorder.draw(
                    &format!("{name}.draw"),
                    pipeline,
                    descriptors,
                    bytemuck::bytes_of(&push),
                    &attachment,
                    clear || self.image.is_some(),
                    *vertices,
                    count,
                );
            }
            Path::ShaderBlend { pipeline, vertices, texels } => {
                let Some(image) = &self.image else { return };
                let [width, height, _] = image.desc().extent;
                recorder.clear_buffer(&format!("{name}.clear"), texels);
                let pushes = (0..count).map(|i| {
                    let i = if options.order() == Order::FrontToBack { i } else { count - 1 - i };
                    let upwards = count - self.cut.first;
                    let slab = if i < upwards { self.cut.first + i } else { count - 1 - i };
                    bytemuck::bytes_of(&GridPush { first: slab, count: 1, order: 0, ..push }).to_vec()
                });
                recorder.draw_each(
                    &format!("{name}.draw"),
                    pipeline,
                    descriptors,
                    pushes,
                    [width, height],
                    *vertices,
                );
                recorder.copy_buffer_to_image(&format!("{name}.resolve"), texels, image, 0, [0, 1]);
            }
            Path::Compute { first, resume, slabs_per_dispatch } => {
                let Some(image) = &self.image else { return };
                let [width, height, _] = image.desc().extent;
                let groups = tiles_of([width, height]);
                let mut begin = 0;
                loop {
                    push.first = begin;
                    push.count = (count - begin).min(*slabs_per_dispatch);
                    let more = begin + push.count < count;
                    push.order = samples.axis.map_or(2, num::count) | u32::from(more) << 2;
                    let pipeline = resume.as_ref().filter(|_| begin > 0).unwrap_or(first);
                    let pass = format!("{name}.march");
                    recorder.dispatch(&pass, pipeline, descriptors, bytemuck::bytes_of(&push), groups);
                    begin += push.count;
                    if begin >= count {
                        break;
                    }
                }
            }
        }
    }
}

/// The raster route: by fixed function, or by the shader where it dithers.
#[expect(clippy::too_many_arguments, reason = "one caller, which has all of these at hand")]
fn raster_path(
    gpu: &Gpu,
    name: &str,
    options: &GridOptions,
    raster: &RasterShaders,
    mut constants: Vec<SpecConstant>,
    resources: &mut Vec<(u32, Resource)>,
    view: &View,
    target: &Canvas,
) -> Result<(Path, Arc<Pipeline>, Option<Arc<Image>>)> {
    let order = options.order();
    let format = options.accumulation().format();
    let code = options.accumulation().code().filter(|_| options.dither != Dither::None);
    if let Some(code) = code {
        constants.extend([
            (SPEC_TARGET, code),
            (SPEC_BLUE_NOISE, u32::from(options.dither == Dither::Blue)),
            (SPEC_UNDER, u32::from(order == Order::FrontToBack)),
        ]);
    }
    let desc = GraphicsDesc {
        vertex: raster.vertex,
        fragment: if code.is_some() { raster.shader_blend } else { raster.fragment },
        topology: raster.topology,
        blend: match (code, order) {
            (Some(_), _) => Blend::Copy,
            (None, Order::BackToFront) => Blend::Over,
            (None, Order::FrontToBack) => Blend::Under,
        },
        format: code.is_none().then_some(format),
        constants: &constants,
    };
    let vertices = raster.vertices;
    if code.is_none() {
        let pipeline = gpu.graphics_pipeline(&format!("{name}.draw"), &desc)?;
        let image = if draws_directly(target, format, order == Order::BackToFront) {
            None
        } else {
            Some(own_image(gpu, name, format, vk::ImageUsageFlags::COLOR_ATTACHMENT, view, target)?)
        };
        return Ok((Path::Raster { pipeline: Arc::clone(&pipeline), vertices }, pipeline, image));
    }
    let pipeline = gpu.graphics_pipeline(&format!("{name}.dither"), &desc)?;
    // Sampled, because a view needs some use of its own.
    let usage = vk::ImageUsageFlags::TRANSFER_DST | vk::ImageUsageFlags::SAMPLED;
    gpu.check_drawing(name, view.extent())?;
    let image = own_image(gpu, name, format, usage, view, target)?;
    let bytes = image.desc().texel_bytes();
    let texels = Arc::new(Buffer::new(gpu, &format!("{name}.texels"), bytes, BufferUse::ShaderWrite)?);
    resources.push((BINDING_TEXELS, Resource::Buffer(Arc::clone(&texels))));
    let thresholds = if options.dither == Dither::Blue {
        Buffer::with_data(gpu, "blue-noise", bytemuck::cast_slice(blue_noise::tile()))?
    } else {
        match resources.iter().find(|(binding, _)| *binding == BINDING_KNOTS) {
            Some((_, Resource::Buffer(knots))) => Arc::clone(knots),
            _ => Arc::clone(&texels),
        }
    };
    resources.push((BINDING_THRESHOLDS, Resource::Buffer(thresholds)));
    Ok((Path::ShaderBlend { pipeline: Arc::clone(&pipeline), vertices, texels }, pipeline, Some(image)))
}

/// The slabs of a view with what shaders need to know of it.
fn cut(
    scene: &GpuScene,
    technique: &dyn GridTechnique,
    volume: &Volume,
    knots: &Knots,
    view: &View,
    axis: Option<usize>,
) -> Result<Cut> {
    let grid = scene.grid()?;
    let options = technique.options();
    let rays = GridRays::new(grid, view).turned(axis.unwrap_or(2));
    let slabs = technique.slabs(grid, &rays, axis);
    // Each slab that the shader blends is a draw of its own.
    let most = if options.dither == Dither::None { MAX_SLABS } else { MAX_DRAWS };
    if slabs.count > most {
        return Err(Error::invalid(
            format!("{} option step", technique.name()),
            format!("{}: makes {} slices of this grid, at most {most} are drawn", options.step, slabs.count),
        ));
    }
    // Depth goes to the device in units of the smallest voxel spacing: the world's own unit may be a parsec or
    // an angstrom.
    let unit = grid.spacing().min_element();
    let pack = |v: glam::DVec3, w: f64| num::vec3_of(v).extend(f32_of(w)).to_array();
    let [width, height] = view.extent();
    let half = turned((grid.last_index() * 0.5).to_array(), axis.unwrap_or(2));
    let push = GridPush {
        // Pixels of parallel rays are as large at every depth.
        q0_kq: pack(rays.q0, if rays.kd == 0.0 { 1.0 } else { rays.kq / unit }),
        px_kd: pack(rays.px * if rays.kd == 0.0 { 1.0 } else { unit }, rays.kd),
        py_z0: pack(rays.py * if rays.kd == 0.0 { 1.0 } else { unit }, slabs.begin),
        d0_h: pack(rays.d0 * unit, slabs.thickness),
        half_scale: pack(half.into(), rays.scale),
        half_extent: [f32_of(f64::from(width) * 0.5), f32_of(f64::from(height) * 0.5)],
        near: f32_of((rays.near / unit).max(-1e30)),
        value_scale: volume.scale,
        value_offset: volume.offset,
        knots: knots.count,
        first: 0,
        count: num::u32_of(slabs.count),
        order: 0,
        unit: f32_of(unit),
        opaque: f32_of(options.stop / scene.max_colour()),
        seed: options.seed,
    };
    let numbers = [push.q0_kq, push.px_kd, push.py_z0, push.d0_h, push.half_scale];
    let finite = numbers.iter().flatten().chain([&push.near]).all(|number| number.is_finite());
    if !(finite && push.unit.is_normal()) {
        return Err(Error::invalid(
            "view",
            "the camera is so far from the grid, or its voxels so large or small, that float32 cannot hold the rays",
        ));
    }
    Ok(Cut { push, count: num::u32_of(slabs.count), first: slabs.first.min(num::u32_of(slabs.count)) })
}

/// Every device manages this many loop iterations; the probe runs only where the answer counts.
const ALWAYS: u32 = 32_768;

/// Invocations that some devices run in step, and whose loops they count together.
const LANES: u32 = 8;

/// Loop iterations of a slab, and of the quadrature where matter is opaque.
fn loops(knots: &Knots, segments: Option<&SegmentOptions>) -> (u32, u32) {
    // One for the slab, those of the classification, and of the way through bricks as many as there are slabs.
    let each = 3 + knots.iterations;
    if !segments.is_some_and(|segments| segments.integrator == Integrator::Exact) {
        return (each, 0);
    }
    // Every piece has a panel of four nodes; opaque matter leaves few panels. A segment may span every knot.
    let pieces = if knots.walk > 0 { knots.walk } else { knots.count };
    (each.saturating_add(pieces.saturating_mul(5)), LANES * 5 * 64)
}

fn too_many_loops(name: &str, each: u32, limit: u32) -> Error {
    Error::unsupported(
        format!("{name} integrator=exact"),
        format!("{each} loop iterations for this transfer function, the limit is {limit}; integral works"),
    )
}

/// A fragment takes one slab, and cannot be split.
pub(crate) fn check_loops(
    gpu: &Gpu,
    name: &str,
    knots: &Knots,
    segments: Option<&SegmentOptions>,
) -> Result<()> {
    let (each, once) = loops(knots, segments);
    let all = each.saturating_add(once);
    if all <= ALWAYS {
        return Ok(());
    }
    let limit = gpu.loop_limit()?;
    if all > limit { Err(too_many_loops(name, each, limit)) } else { Ok(()) }
}

/// Slabs that one dispatch may walk. No invocation may make more loop iterations than the device allows, and no
/// dispatch may hold up the device for so long that a watchdog ends it.
pub(crate) fn slabs_per_dispatch(
    gpu: &Gpu,
    name: &str,
    slabs: u32,
    knots: &Knots,
    segments: Option<&SegmentOptions>,
    grid: &Grid,
    rays: u64,
) -> Result<u32> {
    /// Samples of one dispatch: a fifth of a second where 5e9 are taken in one.
    const SAMPLES: u64 = 1 << 30;
    let (each, panels) = loops(knots, segments);
    // Bricks along a ray.
    let bricks: u32 = grid.dims().iter().map(|side| side.div_ceil(BRICK)).sum();
    let once = (LANES * (bricks + 2)).saturating_add(panels);
    let few = slabs.saturating_mul(each).saturating_add(once) <= ALWAYS && gpu.loop_limit_is_unknown();
    let limit = if few { ALWAYS } else { gpu.loop_limit()? };
    // Splits cost the way through the bricks anew, so the limit is not eaten up by it.
    let iterations = limit.saturating_sub(once).max(limit / 2);
    if each > iterations && segments.is_some_and(|segments| segments.integrator == Integrator::Exact) {
        return Err(too_many_loops(name, each, limit));
    }
    let by_time = u32::try_from(SAMPLES / rays.max(1)).unwrap_or(u32::MAX);
    Ok((iterations / each).min(by_time).max(1))
}
