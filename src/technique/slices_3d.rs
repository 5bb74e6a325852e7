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

use std::sync::Arc;

use ash::vk;

use super::gpu_scene::{GpuScene, Volume};
use super::grid_rays::GridRays;
use super::options::{self, Choice, OptionInfo};
use super::{TargetDesc, TargetMode};
use crate::error::{Error, Result};
use crate::gpu::shader::{
    BINDING_ACCUMULATION, BINDING_KNOTS, BINDING_KNOTS_UNIFORM, BINDING_VOLUME, SLICES_3D_COMPUTE,
    SLICES_3D_FRAGMENT, SLICES_3D_VERTEX, SPEC_CLIP_ENDS, SPEC_FILTER_EXACT, SPEC_HAS_NAN, SPEC_KNOT_WALK,
    SPEC_RESUME,
};
use crate::gpu::sync::Use;
use crate::gpu::{
    Attachment, Blend, ComputeDesc, Descriptors, Gpu, GraphicsDesc, Image, ImageDesc, OptionalFeature,
    Pipeline, Recorder, Resource, SpecConstant, TargetImage,
};
use crate::interface::Slices3dPush;
use crate::num::{self, f32_of};
use crate::scene::View;

const NAME: &str = "slices-3d";

/// More slabs than this lose their order in float32, and no image needs them.
const MAX_SLABS: f64 = 4_194_304.0;

/// Transmittance behind which the compute route stops: what lies there changes no channel by more, for
/// colours up to 1; brighter ones lower it in proportion.
const OPAQUE: f64 = 2.4e-7;

/// Reconstruction between samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filter {
    /// The sampler's: fast, with the weights' precision of the device.
    Hardware,
    /// Eight fetches and float32 weights.
    Exact,
}

/// Format that raster accumulates in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Accumulation {
    /// 8 bits a channel.
    Rgba8,
    /// 16-bit float.
    Rgba16f,
    /// 32-bit float.
    Rgba32f,
}

/// Order in which raster blends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// The operator "over".
    BackToFront,
    /// The operator "under".
    FrontToBack,
}

/// Where a slice's slab ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ends {
    /// At the domain's faces and at the eye, along each ray.
    Clip,
    /// Nowhere: the classic polygons, each weighted with the whole step.
    Plane,
}

/// Who composites.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Route {
    /// Compute, unless `target` or `order` ask for what only raster does.
    Auto,
    /// Polygons and fixed-function blending.
    Raster,
    /// One invocation owns a pixel and composites in registers.
    Compute,
}

impl Choice for Filter {
    const WORDS: &'static [(&'static str, Self)] = &[("hardware", Self::Hardware), ("exact", Self::Exact)];
}
impl Choice for Accumulation {
    const WORDS: &'static [(&'static str, Self)] =
        &[("rgba8", Self::Rgba8), ("rgba16f", Self::Rgba16f), ("rgba32f", Self::Rgba32f)];
}
impl Choice for Order {
    const WORDS: &'static [(&'static str, Self)] =
        &[("back-to-front", Self::BackToFront), ("front-to-back", Self::FrontToBack)];
}
impl Choice for Ends {
    const WORDS: &'static [(&'static str, Self)] = &[("clip", Self::Clip), ("plane", Self::Plane)];
}
impl Choice for Route {
    const WORDS: &'static [(&'static str, Self)] =
        &[("auto", Self::Auto), ("raster", Self::Raster), ("compute", Self::Compute)];
}

/// What can be chosen, with its effect on error and time.
pub(crate) const OPTIONS: &[OptionInfo] = &[
    OptionInfo {
        key: "step",
        values: "a positive number",
        default: "1",
        effect: "distance of slices in units of the smallest voxel spacing; time falls as 1/step, error grows as step^2 where everything is smooth",
    },
    OptionInfo {
        key: "filter",
        values: "hardware|exact",
        default: "hardware",
        effect: "exact: eight fetches and float32 weights, for devices whose sampler has coarse weights; several times slower",
    },
    OptionInfo {
        key: "target",
        values: "rgba8|rgba16f|rgba32f",
        default: "rgba32f",
        effect: "format that raster blends in; rgba8 loses every slice below half of 1/255, rgba16f is good for some 64 slices",
    },
    OptionInfo {
        key: "order",
        values: "back-to-front|front-to-back",
        default: "back-to-front",
        effect: "raster's blending: over or under; under keeps more digits of many thin slices",
    },
    OptionInfo {
        key: "ends",
        values: "clip|plane",
        default: "clip",
        effect: "plane: the classic polygons, unclipped; first order at the domain's faces",
    },
    OptionInfo {
        key: "route",
        values: "auto|raster|compute",
        default: "auto",
        effect: "compute composites in registers in float32; auto takes it unless target or order is given",
    },
];

/// Options of this technique.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Distance of slices, in units of the smallest voxel spacing.
    pub step: f64,
    /// Reconstruction.
    pub filter: Filter,
    /// Raster's accumulation; `None` is [`Accumulation::Rgba32f`].
    pub target: Option<Accumulation>,
    /// Raster's order; `None` is [`Order::BackToFront`].
    pub order: Option<Order>,
    /// Ends of slabs.
    pub ends: Ends,
    /// Route.
    pub route: Route,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            step: 1.0,
            filter: Filter::Hardware,
            target: None,
            order: None,
            ends: Ends::Clip,
            route: Route::Auto,
        }
    }
}

impl Options {
    /// Reads `key`, `value` pairs.
    pub(crate) fn parse(pairs: &[(String, String)]) -> Result<Self> {
        let mut options = Self::default();
        for (key, text) in pairs {
            match key.as_str() {
                "step" => options.step = options::positive(NAME, key, text)?,
                "filter" => options.filter = options::choice(NAME, key, text)?,
                "target" => options.target = Some(options::choice(NAME, key, text)?),
                "order" => options.order = Some(options::choice(NAME, key, text)?),
                "ends" => options.ends = options::choice(NAME, key, text)?,
                "route" => options.route = options::choice(NAME, key, text)?,
                _ => return Err(options::unknown(NAME, key, OPTIONS)),
            }
        }
        options.check()?;
        Ok(options)
    }

    /// The options as text that reads back to them; what is unset is left out.
    pub(crate) fn pairs(&self) -> Vec<(&'static str, String)> {
        let mut pairs = vec![("step", self.step.to_string()), ("filter", self.filter.word().to_string())];
        pairs.extend(self.target.map(|target| ("target", target.word().to_string())));
        pairs.extend(self.order.map(|order| ("order", order.word().to_string())));
        pairs.push(("ends", self.ends.word().to_string()));
        pairs.push(("route", self.route.word().to_string()));
        pairs
    }

    pub(crate) fn check(&self) -> Result<()> {
        if !(self.step.is_finite() && self.step > 0.0) {
            return Err(Error::invalid(
                "slices-3d option step",
                format!("{}: must be positive and finite", self.step),
            ));
        }
        if self.route == Route::Compute
            && (self.target.is_some_and(|t| t != Accumulation::Rgba32f) || self.order.is_some())
        {
            return Err(Error::invalid(
                "slices-3d option route",
                "compute composites front to back in float32: leave out target and order, or take route=raster",
            ));
        }
        Ok(())
    }

    fn accumulation(&self) -> Accumulation {
        self.target.unwrap_or(Accumulation::Rgba32f)
    }

    /// The route on a device.
    fn route_on(&self, gpu: &Gpu) -> Result<Route> {
        let blends = self.accumulation() != Accumulation::Rgba32f || gpu.has(OptionalFeature::BlendRgba32f);
        match self.route {
            Route::Raster | Route::Auto
                if self.route == Route::Raster || self.target.is_some() || self.order.is_some() =>
            {
                if blends {
                    return Ok(Route::Raster);
                }
                Err(Error::unsupported(
                    "slices-3d route=raster",
                    "blending into R32G32B32A32_SFLOAT; target=rgba16f or route=compute work",
                ))
            }
            _ => Ok(Route::Compute),
        }
    }
}

impl Accumulation {
    fn format(self) -> vk::Format {
        match self {
            Self::Rgba8 => vk::Format::R8G8B8A8_UNORM,
            Self::Rgba16f => vk::Format::R16G16B16A16_SFLOAT,
            Self::Rgba32f => vk::Format::R32G32B32A32_SFLOAT,
        }
    }
}

/// What the grid and the options make of a view: the push constants, and the number of slabs.
#[derive(Clone, Copy, Debug)]
struct Slabs {
    push: Slices3dPush,
    count: u32,
}

/// Slabs of equal depth from the domain's nearest point in front of the eye to its farthest.
fn slabs(scene: &GpuScene, volume: &Volume, knots: u32, view: &View, options: &Options) -> Result<Slabs> {
    let grid = &scene.scene().grid;
    let rays = GridRays::new(grid, view);
    // Depth goes to the device in units of the smallest voxel spacing: the world's own unit may be a parsec or
    // an angstrom.
    let unit = grid.spacing().min_element();
    let thickness = options.step * unit;
    let [begin, end] = rays.depths;
    let count = if end > begin { ((end - begin) / thickness).ceil() } else { 0.0 };
    if count > MAX_SLABS {
        return Err(Error::invalid(
            "slices-3d option step",
            format!("{}: makes {count} slices of this grid, at most {MAX_SLABS} are drawn", options.step),
        ));
    }
    let pack = |v: glam::DVec3, w: f64| num::vec3_of(v).extend(f32_of(w)).to_array();
    let [width, height] = view.extent();
    let push = Slices3dPush {
        q0_kq: pack(rays.q0, rays.kq / unit),
        px_kd: pack(rays.px * unit, rays.kd),
        py_z0: pack(rays.py * unit, begin / unit),
        d0_h: pack(rays.d0 * unit, options.step),
        half_scale: pack(grid.last_index() * 0.5, rays.scale),
        half_extent: [f32_of(f64::from(width) * 0.5), f32_of(f64::from(height) * 0.5)],
        near: f32_of((rays.near / unit).max(-1e30)),
        value_scale: volume.scale,
        value_offset: volume.offset,
        knots,
        slab_first: 0,
        slab_count: num::u32_of(count),
        backwards: 0,
        unit: f32_of(unit),
        opaque: f32_of(OPAQUE / scene.scene().transfer.max_colour().max(1.0)),
    };
    let numbers = [push.q0_kq, push.px_kd, push.py_z0, push.d0_h, push.half_scale];
    if !numbers.iter().flatten().chain([&push.near, &push.unit]).all(|number| number.is_finite()) {
        return Err(Error::invalid(
            "view",
            "the camera is so far from the grid, or its voxels so large or small, that float32 cannot hold the rays",
        ));
    }
    Ok(Slabs { push, count: num::u32_of(count) })
}

/// Everything that is fixed between frames of one size.
#[derive(Debug)]
pub(crate) struct Prepared {
    scene: Arc<GpuScene>,
    options: Options,
    volume: Arc<Volume>,
    knots: u32,
    image: Option<Arc<Image>>,
    slabs: Slabs,
    path: Path,
}

#[derive(Debug)]
enum Path {
    Raster {
        pipeline: Arc<Pipeline>,
        descriptors: Arc<Descriptors>,
    },
    Compute {
        first: Arc<Pipeline>,
        /// Continues where a dispatch before stopped; only where the work is split.
        resume: Option<Arc<Pipeline>>,
        descriptors: Arc<Descriptors>,
        /// Slabs that one dispatch may walk.
        slabs_per_dispatch: u32,
    },
}

impl Path {
    /// Draws or dispatches for a number of slabs.
    fn passes(&self, slabs: u32) -> u32 {
        match self {
            Self::Raster { .. } => 1,
            Self::Compute { slabs_per_dispatch, .. } => slabs.div_ceil(*slabs_per_dispatch).max(1),
        }
    }
}

impl Prepared {
    pub(crate) fn new(
        scene: &Arc<GpuScene>,
        view: &View,
        target: &TargetDesc,
        options: &Options,
    ) -> Result<Self> {
        options.check()?;
        let gpu = scene.gpu();
        let route = options.route_on(gpu)?;
        let volume = scene.volume(options.filter == Filter::Hardware)?;
        // A sampler need not hand NaN on.
        let has_nan = scene.scene().grid.nan_count() > 0;
        let exact = options.filter == Filter::Exact || !volume.filterable || has_nan;
        let knots = scene.knots()?;
        let slabs = slabs(scene, &volume, knots.count, view, options)?;
        let constants: Vec<SpecConstant> = vec![
            (SPEC_FILTER_EXACT, u32::from(exact)),
            (SPEC_HAS_NAN, u32::from(has_nan)),
            (SPEC_CLIP_ENDS, u32::from(options.ends == Ends::Clip)),
            (SPEC_KNOT_WALK, knots.walk),
        ];
        let filter = if exact { vk::Filter::NEAREST } else { vk::Filter::LINEAR };
        let mut resources = vec![
            (BINDING_VOLUME, Resource::Sampled(Arc::clone(&volume.image), filter)),
            (BINDING_KNOTS_UNIFORM, Resource::Buffer(Arc::clone(&knots.buffer))),
            (BINDING_KNOTS, Resource::Buffer(Arc::clone(&knots.buffer))),
        ];
        let (path, image) = if route == Route::Compute {
            let image =
                own_image(gpu, vk::Format::R32G32B32A32_SFLOAT, vk::ImageUsageFlags::STORAGE, view, target)?;
            resources.push((BINDING_ACCUMULATION, Resource::Storage(Arc::clone(&image))));
            let slabs_per_dispatch = slabs_per_dispatch(gpu, slabs.count, knots.iterations, view)?;
            let pipeline = |resume: bool| {
                let mut constants = constants.clone();
                constants.push((SPEC_RESUME, u32::from(resume)));
                let name = if resume { "slices-3d.march.resume" } else { "slices-3d.march" };
                gpu.compute_pipeline(name, &ComputeDesc { shader: &SLICES_3D_COMPUTE, constants: &constants })
            };
            let first = pipeline(false)?;
            let resume = if slabs.count > slabs_per_dispatch { Some(pipeline(true)?) } else { None };
            let descriptors = Arc::new(Descriptors::new(gpu, &first, &resources)?);
            (Path::Compute { first, resume, descriptors, slabs_per_dispatch }, Some(image))
        } else {
            let order = options.order.unwrap_or(Order::BackToFront);
            let format = options.accumulation().format();
            let direct = draws_directly(target, format, order);
            let pipeline = gpu.graphics_pipeline(
                "slices-3d.draw",
                &GraphicsDesc {
                    vertex: &SLICES_3D_VERTEX,
                    fragment: &SLICES_3D_FRAGMENT,
                    topology: vk::PrimitiveTopology::TRIANGLE_STRIP,
                    blend: if order == Order::BackToFront { Blend::Over } else { Blend::Under },
                    format,
                    constants: &constants,
                },
            )?;
            let image = if direct {
                None
            } else {
                Some(own_image(gpu, format, vk::ImageUsageFlags::COLOR_ATTACHMENT, view, target)?)
            };
            let descriptors = Arc::new(Descriptors::new(gpu, &pipeline, &resources)?);
            (Path::Raster { pipeline, descriptors }, image)
        };
        Ok(Self {
            scene: Arc::clone(scene),
            options: *options,
            volume,
            knots: knots.count,
            image,
            slabs,
            path,
        })
    }

    /// Turns to another view of the same image size. `false`, and nothing is changed, when the plan has no
    /// room for it.
    pub(crate) fn set_view(&mut self, view: &View, most_passes: u32) -> Result<bool> {
        let slabs = slabs(&self.scene, &self.volume, self.knots, view, &self.options)?;
        let passes = self.path.passes(slabs.count);
        let fits = passes <= most_passes
            && (passes == 1 || !matches!(self.path, Path::Compute { resume: None, .. }));
        if fits {
            self.slabs = slabs;
        }
        Ok(fits)
    }

    /// The image that the technique draws into, when that is not the caller's.
    pub(crate) fn image(&self) -> Option<&Arc<Image>> {
        self.image.as_ref()
    }

    /// How a frame leaves that image.
    pub(crate) fn last_use(&self) -> Use {
        match self.path {
            Path::Raster { .. } => Use::ColorAttachment,
            Path::Compute { .. } => Use::ComputeReadWrite,
        }
    }

    pub(crate) fn route(&self) -> &'static str {
        match self.path {
            Path::Raster { .. } => Route::Raster.word(),
            Path::Compute { .. } => Route::Compute.word(),
        }
    }

    /// Passes of one frame.
    pub(crate) fn passes(&self) -> u32 {
        self.path.passes(self.slabs.count)
    }

    pub(crate) fn counters(&self) -> Vec<(&'static str, u64)> {
        vec![("slices", u64::from(self.slabs.count)), ("dispatches_or_draws", u64::from(self.passes()))]
    }

    /// Records a frame into the own image, or into `target` where there is none. `clear` begins with
    /// transparent black.
    pub(crate) fn record(&self, recorder: &mut Recorder<'_>, target: Option<&TargetImage>, clear: bool) {
        recorder.assume_ready(&self.volume.image);
        let mut push = self.slabs.push;
        match &self.path {
            Path::Raster { pipeline, descriptors } => {
                let attachment = match (&self.image, target) {
                    (Some(image), _) => Attachment::Own(Arc::clone(image)),
                    (None, Some(target)) => Attachment::Caller(*target),
                    (None, None) => return,
                };
                push.backwards =
                    u32::from(self.options.order.unwrap_or(Order::BackToFront) == Order::BackToFront);
                recorder.draw(
                    "slices-3d.draw",
                    pipeline,
                    descriptors,
                    bytemuck::bytes_of(&push),
                    &attachment,
                    clear || self.image.is_some(),
                    6,
                    self.slabs.count,
                );
            }
            Path::Compute { first, resume, descriptors, slabs_per_dispatch } => {
                let Some(image) = &self.image else { return };
                let [width, height, _] = image.desc().extent;
                let groups = [width.div_ceil(8), height.div_ceil(8), 1];
                let mut begin = 0;
                loop {
                    let count = (self.slabs.count - begin).min(*slabs_per_dispatch);
                    (push.slab_first, push.slab_count) = (begin, count);
                    let pipeline = resume.as_ref().filter(|_| begin > 0).unwrap_or(first);
                    recorder.dispatch(
                        "slices-3d.march",
                        pipeline,
                        descriptors,
                        bytemuck::bytes_of(&push),
                        groups,
                    );
                    begin += count;
                    if begin >= self.slabs.count {
                        break;
                    }
                }
            }
        }
    }
}

/// Slabs that one dispatch may walk. No invocation may make more loop iterations than the device allows (one
/// for the slab, and those of the classification), and no dispatch may hold up the device for so long that
/// a watchdog ends it.
fn slabs_per_dispatch(gpu: &Gpu, slabs: u32, knot_iterations: u32, view: &View) -> Result<u32> {
    /// Every device manages this many iterations; the probe runs only where the answer counts.
    const ALWAYS: u32 = 32_768;
    /// Samples of one dispatch: a fifth of a second where 5e9 are taken in one.
    const SAMPLES: u64 = 1 << 30;
    let each = 1 + knot_iterations;
    let few = slabs.saturating_mul(each) <= ALWAYS && gpu.loop_limit_is_unknown();
    let iterations = if few { ALWAYS } else { gpu.loop_limit()? };
    let [width, height] = view.extent().map(u64::from);
    let by_time = u32::try_from(SAMPLES / (width * height)).unwrap_or(u32::MAX);
    Ok((iterations / each).min(by_time).max(1))
}

/// Whether raster may draw into the caller's image itself: same format, and what is there is either
/// cleared or covered back to front.
fn draws_directly(target: &TargetDesc, format: vk::Format, order: Order) -> bool {
    target.format() == Some(format) && (target.mode() == TargetMode::Clear || order == Order::BackToFront)
}

fn own_image(
    gpu: &Gpu,
    format: vk::Format,
    usage: vk::ImageUsageFlags,
    view: &View,
    target: &TargetDesc,
) -> Result<Arc<Image>> {
    // Read back, or composited.
    let after = if target.format().is_none() {
        vk::ImageUsageFlags::TRANSFER_SRC
    } else {
        vk::ImageUsageFlags::SAMPLED
    };
    let desc = ImageDesc::flat(format, view.extent(), usage | after);
    Ok(Arc::new(Image::new(gpu, "slices-3d.accumulation", &desc)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Options> {
        let pairs: Vec<(String, String)> = text
            .split(',')
            .filter(|pair| !pair.is_empty())
            .map(|pair| {
                let (key, value) = pair.split_once('=').unwrap();
                (key.to_string(), value.to_string())
            })
            .collect();
        Options::parse(&pairs)
    }

    #[test]
    fn options_are_read_and_written_back() {
        let options =
            parse("step=0.25,filter=exact,target=rgba16f,order=front-to-back,ends=plane,route=raster")
                .unwrap();
        let pairs: Vec<(String, String)> =
            options.pairs().iter().map(|(k, v)| ((*k).to_string(), v.clone())).collect();
        assert_eq!(Options::parse(&pairs).unwrap(), options);
        for text in ["", "route=compute", "order=front-to-back"] {
            let options = parse(text).unwrap();
            let pairs: Vec<(String, String)> =
                options.pairs().iter().map(|(k, v)| ((*k).to_string(), v.clone())).collect();
            assert_eq!(Options::parse(&pairs).unwrap(), options, "{text}");
        }
        assert_eq!(parse("").unwrap(), Options::default());
    }

    #[test]
    fn wrong_options_name_option_value_and_range() {
        for (text, parts) in [
            ("step=0", ["step", "\"0\"", "positive"]),
            ("step=NaN", ["step", "NaN", "finite"]),
            ("step=x", ["step", "\"x\"", "number"]),
            ("filter=cubic", ["filter", "cubic", "hardware, exact"]),
            ("stepp=1", ["stepp", "must be one of", "step, filter"]),
            ("route=compute,target=rgba8", ["route", "compute", "raster"]),
        ] {
            let message = parse(text).unwrap_err().to_string();
            assert!(parts.iter().all(|part| message.contains(part)), "{text}: {message}");
        }
    }

    #[test]
    fn a_documented_default_is_the_default() {
        let pairs = Options::default().pairs();
        for info in OPTIONS {
            // What is unset is not in force: the documented default is what the route then takes.
            let Some((_, value)) = pairs.iter().find(|(key, _)| *key == info.key) else {
                assert!(info.key == "target" || info.key == "order", "{}", info.key);
                continue;
            };
            assert_eq!(value, info.default, "{}", info.key);
        }
    }
}
