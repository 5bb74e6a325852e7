//! A frame of splats: the kernels as the view sees them, in order; bins of tiles; what becomes of each bin.
//!
//! The image is drawn in bands of tiles whose bins fit a buffer. Nothing is dropped: what has no room, and tiles that need more
//! turns of a loop than a dispatch makes, are counted, and the frame repeated with more.

use std::sync::{Arc, PoisonError};

use ash::vk;
use glam::DVec3;

use crate::error::{Error, Result};
use crate::frame::depth_measure::DepthMeasure;
use crate::frame::prepared::{Outcome, Prepared};
use crate::frame::target::{Canvas, own_image};
use crate::gpu::shader::{
    BINDING_ACCUMULATION, BINDING_BIN_TABLE, BINDING_BINS, BINDING_BOXES, BINDING_KNOTS,
    BINDING_KNOTS_UNIFORM, BINDING_ORDER, BINDING_RANK_KEYS, BINDING_SPLAT_DOMAIN, BINDING_SPLAT_POINTS,
    BINDING_SPLAT_RECORDS, BINDING_SPLAT_SHAPES, BINDING_SPLAT_STATE, BINDING_SPLAT_TEMPLATE, BINDING_STATUS,
    FOOTPRINT_PARTS, KERNEL_BSPLINE, KERNEL_GAUSSIAN, KERNEL_SINC, KERNEL_TENT, LOWPASS_AUTO, LOWPASS_FULL,
    LOWPASS_NONE, MOST_TURNS, ORDER_CENTRES, ORDER_NEAREST, ORDER_SHEETS, SHEETS, SPEC_EYE_INSIDE,
    SPEC_KNOT_WALK, SPEC_RESUME, SPEC_RUNS, SPEC_SPLAT_AXIS, SPEC_SPLAT_DENSITY, SPEC_SPLAT_EWA,
    SPEC_SPLAT_KERNEL, SPEC_SPLAT_LOWPASS, SPEC_SPLAT_ORDER, SPEC_SPLAT_SHAPE, SPEC_SPLAT_TEMPLATE,
    SPLAT_EWA_CENTRE, SPLAT_EWA_CENTRE_WIDE, SPLAT_EWA_WINDOW, SPLAT_PROJECT_COMPUTE, SPLAT_SHEETS_AXIS,
    SPLAT_SHEETS_AXIS_WIDE, SPLAT_SHEETS_IMAGE, SPLAT_SHEETS_IMAGE_WIDE, SPLAT_WINDOW, STATUS_CUT,
    STATUS_LOST, STATUS_UNFINISHED, STATUS_WORDS, Shader, TILE, TILE_PIXELS,
};
use crate::gpu::sync::Use;
use crate::gpu::{Buffer, Gpu, Image, Recorder, Resource, SpecConstant, TargetImage};
use crate::interface::{SplatPush, SplatViewPush};
use crate::num::{self, f32_of};
use crate::primitives::bins::{Bins, Fill};
use crate::primitives::dispatch::{Dispatch, buffer, download, groups_of, pass, total, words};
use crate::primitives::radix_sort::RadixSort;
use crate::resident::GpuScene;
use crate::resident::local_space::LocalSpace;
use crate::resident::splats::{Shape, SplatSet};
use crate::resident::tables::Knots;
use crate::scene::{Kernel, Kernels, Model, Projection, View};
use crate::technique::grid::rays::GridRays;
use crate::technique::splat::options::Spread;

/// What splats are drawn in the order of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SplatOrder {
    /// Their centres, each as a whole.
    Centres,
    /// The same, put in order again pixel by pixel.
    Window,
    /// Slabs parallel to the image.
    Slabs,
    /// Layers along an axis of the data.
    Sheets,
}

/// What is done against footprints below a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lowpass {
    None,
    Auto,
    Full,
}

/// How splats are drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SplatDesc {
    pub(crate) name: &'static str,
    pub(crate) kernels: Kernels,
    pub(crate) order: SplatOrder,
    /// Footprints are ellipses; else integrals along each pixel's line.
    pub(crate) ewa: bool,
    /// Footprints of parallel lines come from a table of this many entries a side.
    pub(crate) template: Option<u32>,
    pub(crate) lowpass: Lowpass,
    /// Variance of the pixel's filter, in pixels.
    pub(crate) variance: f64,
    /// Thickness of slabs, in what the data means by a step.
    pub(crate) step: f64,
    /// Colour that may be left out where a line ends.
    pub(crate) stop: f64,
    /// Most entries of bins at a time.
    pub(crate) pairs: Option<u32>,
    /// How a tile's pixels are spread over invocations.
    pub(crate) spread: Spread,
}

/// Tiles that are drawn together.
#[derive(Clone, Copy, Debug)]
struct Band {
    first: u32,
    tiles: u32,
}

/// Most sheets of a frame.
const MAX_SHEETS: f64 = 4_194_304.0;

// What docs say of it.
const _: () = assert!(FOOTPRINT_PARTS == 8);

/// What of a view goes to shaders.
#[derive(Clone, Copy, Debug)]
struct SplatView {
    project: SplatViewPush,
    draw: SplatPush,
    eye_inside: bool,
    axis: usize,
}

/// Everything that is fixed between frames of one size.
#[derive(Debug)]
pub(crate) struct SplatFrame {
    desc: SplatDesc,
    set: Arc<SplatSet>,
    view: SplatView,
    across: u32,
    project: Dispatch,
    sort: RadixSort,
    bins: Bins,
    bands: Vec<Band>,
    first: Dispatch,
    resume: Option<Dispatch>,
    rounds: u32,
    image: Arc<Image>,
    status: Arc<Buffer>,
    outcome: Arc<SplatOutcome>,
    _knots: Arc<Knots>,
}

/// What a frame tells of itself when it has ended.
#[derive(Debug)]
struct SplatOutcome {
    scene: Arc<GpuScene>,
    name: &'static str,
    status: Arc<Buffer>,
    bins: Vec<Arc<Buffer>>,
    capacity: u32,
    rounds: u32,
    splats: u32,
}

impl Outcome for SplatOutcome {
    fn read(&self) -> Result<(bool, Vec<(&'static str, u64)>)> {
        let status = words(&self.status.host_copy()?);
        let at = |word: u32| status.get(num::index(word)).copied().unwrap_or(0);
        if at(STATUS_CUT) > 0 {
            return Err(Error::unsupported(
                format!("{} of this view", self.name),
                format!(
                    "{} invocations need more turns of a loop than devices make: thinner slabs or a larger image have fewer in one",
                    at(STATUS_CUT)
                ),
            ));
        }
        let (mut pairs, mut fullest) = (0, 0);
        for bins in &self.bins {
            let band = total(bins)?;
            pairs += band;
            fullest = band.max(fullest);
        }
        let fits = fullest <= u64::from(self.capacity) && at(STATUS_LOST) == 0;
        let through = at(STATUS_UNFINISHED) == 0;
        let mut needs = self.scene.splat_needs.lock().unwrap_or_else(PoisonError::into_inner);
        needs.entries = needs.entries.max(u32::try_from(fullest).unwrap_or(u32::MAX));
        if fits && !through {
            needs.rounds = self.rounds * 2;
        }
        Ok((fits && through, vec![("splats", self.splats.into()), ("pairs", pairs)]))
    }
}

fn kernel_code(kernel: Kernel) -> u32 {
    match kernel {
        Kernel::Gaussian => KERNEL_GAUSSIAN,
        Kernel::BSpline => KERNEL_BSPLINE,
        Kernel::Tent => KERNEL_TENT,
        Kernel::Sinc => KERNEL_SINC,
    }
}

impl SplatView {
    fn new(set: &SplatSet, desc: &SplatDesc, knots: u32, opaque: f64, view: &View) -> Result<Self> {
        let space = &set.space;
        let frame = LocalSpace { centre: space.centre, radius: space.unit };
        let lines = frame.lines(view);
        let rays = GridRays::of(space.to_world.inverse(), space.centre, &space.corners, view);
        let axis = sheet_axis(set, view);
        // Rows of what leads from splat space to the view's, in units.
        let row = |(vector, offset): (DVec3, f64)| {
            let v = space.to_world.transpose() * vector / space.unit;
            [v.x, v.y, v.z, offset].map(f32_of)
        };
        let [right, up, forward] = lines.rows;
        let half_extent = view.extent().map(|side| f32_of(f64::from(side) * 0.5));
        let h = if desc.order == SplatOrder::Sheets {
            space.layer * if set.shape == Shape::Alike { 1.0 } else { desc.step }
        } else {
            desc.step * space.step / space.unit
        };
        // All data lies within two units of depth, or of extent along an axis. Float32 counts sheets.
        let sheets = match desc.order {
            SplatOrder::Slabs => 2.0 / h,
            SplatOrder::Sheets if set.shape != Shape::Alike => 2.0 / h,
            _ => 0.0,
        };
        if sheets > MAX_SHEETS {
            return Err(Error::invalid(
                format!("{} option step", desc.name),
                format!(
                    "{}: makes {sheets:.0} sheets of this scene, at most {MAX_SHEETS} are drawn",
                    desc.step
                ),
            ));
        }
        let ahead = space.to_world.inverse() * view.forward();
        let eye = match view.camera().projection {
            Projection::Perspective { .. } => (space.to_world.inverse() * (view.camera().eye - space.centre))
                .to_array()[axis]
                .clamp(-1e29, 1e29),
            Projection::Orthographic { .. } if ahead.to_array()[axis] > 0.0 => -1e38,
            Projection::Orthographic { .. } => 1e38,
        };
        let pack = |v: DVec3, w: f64| [v.x, v.y, v.z, w].map(f32_of);
        let project = SplatViewPush {
            right: row(right),
            up: row(up),
            forward: row((forward.0, lines.begin)),
            half_extent,
            pixel: f32_of(lines.pixel),
            w0: f32_of(lines.w0),
            w1: f32_of(lines.w1),
            unit: f32_of(space.unit),
            cut: f32_of(set.cut),
            amplitude: f32_of(set.amplitude),
            lowpass: f32_of(desc.variance),
            thickness: f32_of(h),
            eye: f32_of(eye),
            middle: f32_of(space.middles[axis]),
            count: set.count,
        };
        let gradient = space.to_world.transpose() * forward.0 / space.unit;
        // Half the depth that a kernel of sigma 1 spans; of a product the box that holds it.
        let product = set.shape == Shape::Alike && set.kernels.kernel != Kernel::Gaussian;
        let reach = set.cut * if product { gradient.abs().element_sum() } else { gradient.length() };
        let reach = if set.shape == Shape::Alike { reach } else { set.cut };
        let near = rays.near / space.unit;
        let draw = SplatPush {
            q0_kq: pack(rays.q0, rays.kq),
            // Depth is in units, the rays' in the world's.
            px_kd: pack(rays.px, rays.kd * space.unit),
            py_scale: pack(rays.py, rays.scale / space.unit),
            d0_near: pack(rays.d0 * space.unit, near.max(-3e38)),
            forward_reach: pack(gradient, reach),
            half_extent,
            unit: f32_of(space.unit),
            h: f32_of(h),
            cut: f32_of(set.cut),
            least: f32_of(set.kernels.least),
            amplitude: f32_of(set.amplitude),
            opaque: f32_of(opaque),
            knots,
            ..SplatPush::default()
        };
        let numbers =
            [project.right, project.up, project.forward, draw.q0_kq, draw.px_kd, draw.py_scale, draw.d0_near];
        let finite = numbers.iter().flatten().all(|number| number.is_finite());
        if !(finite && project.pixel.is_normal() && project.unit.is_normal()) {
            return Err(Error::invalid(
                "view",
                "the camera is so far from the data, or the data so large or small, that float32 cannot hold the view",
            ));
        }
        let eye_inside = view.is_perspective() && near > -1.001;
        Ok(Self { project, draw, eye_inside, axis })
    }
}

/// The axis of the data that sheets are stacked along: that whose layers the view sees most from the front.
fn sheet_axis(set: &SplatSet, view: &View) -> usize {
    let space = &set.space;
    let from_centre = view.camera().eye - space.centre;
    let outside = from_centre.length() > space.unit;
    let direction =
        if view.is_perspective() && outside { from_centre.normalize_or_zero() } else { view.forward() };
    let inverse = space.to_world.inverse();
    let cosines = [0, 1, 2].map(|axis| inverse.row(axis).normalize_or_zero().dot(direction).abs());
    let mut best = 2;
    for axis in [1, 0] {
        if cosines[axis] > cosines[best] {
            best = axis;
        }
    }
    best
}

impl SplatFrame {
    pub(crate) fn new(scene: &Arc<GpuScene>, view: &View, target: &Canvas, desc: SplatDesc) -> Result<Self> {
        // A table holds whole footprints.
        let template = desc.template.filter(|_| target.bounds.is_none());
        let desc = SplatDesc { template, ..desc };
        let gpu = scene.gpu();
        let name = desc.name;
        let set = scene.splats(&desc.kernels, desc.step)?;
        let knots = scene.knots()?;
        let opaque = desc.stop / scene.max_colour();
        let seen = SplatView::new(&set, &desc, knots.count, opaque, view)?;
        let [width, height] = view.extent();
        let across = width.div_ceil(TILE);
        let tiles = across * height.div_ceil(TILE);

        // Kernels as the view sees them, in order.
        let count = set.count;
        let keys = buffer(gpu, "order.keys", count.into())?;
        let order = buffer(gpu, "order", count.into())?;
        let boxes = buffer(gpu, "boxes", 2 * u64::from(count))?;
        let status = buffer(gpu, "status", STATUS_WORDS.into())?;
        let records = if desc.ewa || set.shape == Shape::Covariances { 8 * u64::from(count) } else { 0 };
        let records = buffer(gpu, "records", records)?;
        let half = set.space.domain.to_array().map(|x| if x.is_finite() { f32_of(x) } else { 0.0 });
        let template = scene.splat_template(&set, desc.template, view)?;
        let scale = template.scale;
        let domain = [[half[0], half[1], half[2], f32_of(set.space.middles[seen.axis])], scale];
        let domain = Buffer::with_data(gpu, "splats.domain", bytemuck::cast_slice(&domain))?;
        let mut constants: Vec<SpecConstant> = vec![
            (SPEC_SPLAT_SHAPE, set.shape.code()),
            (SPEC_SPLAT_KERNEL, kernel_code(set.kernels.kernel)),
            (SPEC_SPLAT_EWA, u32::from(desc.ewa)),
            (SPEC_SPLAT_AXIS, num::count(seen.axis)),
            (
                SPEC_SPLAT_ORDER,
                match desc.order {
                    SplatOrder::Centres | SplatOrder::Window => ORDER_CENTRES,
                    SplatOrder::Slabs => ORDER_NEAREST,
                    SplatOrder::Sheets => ORDER_SHEETS,
                },
            ),
            (
                SPEC_SPLAT_LOWPASS,
                match desc.lowpass {
                    Lowpass::None => LOWPASS_NONE,
                    Lowpass::Auto => LOWPASS_AUTO,
                    Lowpass::Full => LOWPASS_FULL,
                },
            ),
            (SPEC_SPLAT_DENSITY, u32::from(set.kernels.model == Model::Density)),
            (SPEC_SPLAT_TEMPLATE, u32::from(desc.template.is_some())),
            (SPEC_KNOT_WALK, knots.walk),
            (SPEC_EYE_INSIDE, u32::from(seen.eye_inside)),
            target.bounded(),
        ];
        let resources = vec![
            (BINDING_SPLAT_POINTS, Resource::Buffer(Arc::clone(&set.points))),
            (BINDING_SPLAT_SHAPES, Resource::Buffer(Arc::clone(&set.shapes))),
            (BINDING_SPLAT_RECORDS, Resource::Buffer(Arc::clone(&records))),
            (BINDING_RANK_KEYS, Resource::Buffer(Arc::clone(&keys))),
            (BINDING_ORDER, Resource::Buffer(Arc::clone(&order))),
            (BINDING_BOXES, Resource::Buffer(Arc::clone(&boxes))),
        ];
        let project = pass(gpu, &format!("{name}.project"), &SPLAT_PROJECT_COMPUTE, &constants, &resources)?;
        let sort = RadixSort::new(gpu, &format!("{name}.sort"), &keys, &order, count, 32)?;

        // Bands whose bins fit a buffer.
        let fill = Fill::measure(gpu, name, [&order, &boxes], count, [tiles, across], |recorder| {
            let groups = groups_of(count, 64);
            project.record(recorder, &seen.project, groups);
            sort.record(recorder);
        })?;
        let most = u64::from(gpu.inner.properties.limits.max_storage_buffer_range) / 4;
        let most = desc.pairs.map_or(most - most / 5, |pairs| most.min(pairs.into()));
        let known = *scene.splat_needs.lock().unwrap_or_else(PoisonError::into_inner);
        let (bands, fullest) = bands_of(&fill.tiles, most, name)?;
        let with_margin = |need: u32| need.saturating_add(need / 4).saturating_add(64);
        let capacity =
            if bands.len() == 1 { with_margin(fullest.max(known.entries)) } else { with_margin(fullest) };
        let widest = bands.iter().map(|band| band.tiles).max().unwrap_or(1);
        let bins = Bins::new(gpu, name, [&order, &boxes, &status], widest, fill.runs, capacity)?;

        let format = vk::Format::R32G32B32A32_SFLOAT;
        let image = own_image(gpu, name, format, vk::ImageUsageFlags::STORAGE, view, target)?;
        let state = buffer(gpu, "state", 2 * u64::from(widest) * u64::from(TILE_PIXELS))?;
        constants.push((SPEC_RUNS, fill.runs));
        let knots_buffer = || Resource::Buffer(Arc::clone(&knots.buffer));
        let mut resources = resources;
        resources.extend([
            (BINDING_KNOTS, knots_buffer()),
            (BINDING_KNOTS_UNIFORM, knots_buffer()),
            (BINDING_SPLAT_DOMAIN, Resource::Buffer(domain)),
            (BINDING_BIN_TABLE, Resource::ReadOnly(Arc::clone(&bins.table))),
            (BINDING_BINS, Resource::Buffer(Arc::clone(&bins.entries))),
            (BINDING_SPLAT_STATE, Resource::Buffer(state)),
            (BINDING_STATUS, Resource::Buffer(Arc::clone(&status))),
            (BINDING_ACCUMULATION, Resource::Storage(Arc::clone(&image))),
        ]);
        resources.extend(target.bounds(&knots.buffer));
        for (binding, resource) in &mut resources {
            if *binding == BINDING_SPLAT_RECORDS {
                *resource = Resource::ReadOnly(Arc::clone(&records));
            }
        }
        resources.push((BINDING_SPLAT_TEMPLATE, Resource::Sampled(template.image, vk::Filter::LINEAR)));
        let shader = shader_of(gpu, &desc)?;
        let rounds = rounds_of(&desc, fill.longest()).max(known.rounds);
        let draw = |resume: bool| {
            let part = if resume { "draw.resume" } else { "draw" };
            let mut constants = constants.clone();
            constants.push((SPEC_RESUME, u32::from(resume)));
            pass(gpu, &format!("{name}.{part}"), shader, &constants, &resources)
        };
        let first = draw(false)?;
        let resume = if rounds > 1 { Some(draw(true)?) } else { None };
        let outcome = SplatOutcome {
            scene: Arc::clone(scene),
            name,
            status: download(gpu, "status", 4 * u64::from(STATUS_WORDS))?,
            bins: bands.iter().map(|_| download(gpu, "bins.total", 8)).collect::<Result<_>>()?,
            capacity,
            rounds,
            splats: count,
        };
        Ok(Self {
            desc,
            set,
            view: seen,
            across,
            project,
            sort,
            bins,
            bands,
            first,
            resume,
            rounds,
            image,
            status,
            outcome: Arc::new(outcome),
            _knots: knots,
        })
    }
}

/// Turns of a dispatch's loops.
fn turns_of(desc: &SplatDesc) -> u32 {
    match desc.order {
        // The window's own loop counts too.
        SplatOrder::Window => MOST_TURNS / (2 * SPLAT_WINDOW + 2),
        _ => MOST_TURNS,
    }
}

/// Dispatches for the fullest bin, as far as that can be told.
fn rounds_of(desc: &SplatDesc, longest: u32) -> u32 {
    match desc.order {
        SplatOrder::Centres | SplatOrder::Window => longest.div_ceil(turns_of(desc)).max(1),
        // Half of the turns are for the sheet that is the last.
        SplatOrder::Sheets => longest.div_ceil(turns_of(desc) / 2).max(1),
        SplatOrder::Slabs => longest.saturating_mul(2 + SHEETS).div_ceil(turns_of(desc) / 2).max(1),
    }
}

fn shader_of(gpu: &Gpu, desc: &SplatDesc) -> Result<&'static Shader> {
    // Software runs the lanes of a workgroup in step, and what they share is read once; elsewhere a column would leave most
    // lanes of a subgroup idle.
    let columns = match desc.spread {
        Spread::Auto => gpu.is_software() && gpu.eight_share_words(),
        Spread::Pixels => false,
        Spread::Columns if gpu.eight_share_words() => true,
        Spread::Columns => {
            let what = format!("{} spread=columns", desc.name);
            return Err(Error::unsupported(
                what,
                "subgroups of eight invocations that tell each other words",
            ));
        }
    };
    Ok(match (desc.order, columns) {
        (SplatOrder::Centres, true) => &SPLAT_EWA_CENTRE,
        (SplatOrder::Centres, false) => &SPLAT_EWA_CENTRE_WIDE,
        (SplatOrder::Window, _) => &SPLAT_EWA_WINDOW,
        (SplatOrder::Slabs, true) => &SPLAT_SHEETS_IMAGE,
        (SplatOrder::Slabs, false) => &SPLAT_SHEETS_IMAGE_WIDE,
        (SplatOrder::Sheets, true) => &SPLAT_SHEETS_AXIS,
        (SplatOrder::Sheets, false) => &SPLAT_SHEETS_AXIS_WIDE,
    })
}

/// Bands of tiles of at most so many entries each, and those of the fullest.
fn bands_of(fill: &[u32], most: u64, name: &str) -> Result<(Vec<Band>, u32)> {
    let mut bands = vec![Band { first: 0, tiles: 0 }];
    let (mut sum, mut fullest) = (0_u64, 0_u64);
    for (tile, &entries) in (0_u32..).zip(fill) {
        if u64::from(entries) > most {
            return Err(Error::unsupported(
                format!("{name} of this view"),
                format!("{entries} splats in one tile of {TILE} pixels; {most} fit"),
            ));
        }
        let last = bands.len() - 1;
        if sum + u64::from(entries) > most {
            bands.push(Band { first: tile, tiles: 1 });
            sum = entries.into();
        } else {
            bands[last].tiles += 1;
            sum += u64::from(entries);
        }
        fullest = fullest.max(sum);
    }
    Ok((bands, u32::try_from(fullest).unwrap_or(u32::MAX)))
}

impl Prepared for SplatFrame {
    fn set_view(&mut self, view: &View, _most_passes: u32) -> Result<bool> {
        let opaque = f64::from(self.view.draw.opaque);
        let seen = SplatView::new(&self.set, &self.desc, self.view.draw.knots, opaque, view)?;
        let same = seen.axis == self.view.axis || self.desc.order != SplatOrder::Sheets;
        let template_stays = self.desc.template.is_none();
        if !same || !template_stays || (seen.eye_inside && !self.view.eye_inside) {
            return Ok(false);
        }
        self.view = seen;
        Ok(true)
    }

    fn measure(&self) -> DepthMeasure {
        DepthMeasure { centre: self.set.space.centre, unit: self.set.space.unit }
    }

    fn image(&self) -> Option<&Arc<Image>> {
        Some(&self.image)
    }

    fn last_use(&self) -> Use {
        Use::ComputeReadWrite
    }

    fn route(&self) -> &'static str {
        "compute"
    }

    fn counters(&self) -> Vec<(&'static str, u64)> {
        vec![
            ("tiles", self.bands.iter().map(|band| u64::from(band.tiles)).sum()),
            ("bands", num::wide(self.bands.len())),
            ("rounds", self.rounds.into()),
        ]
    }

    fn outcome(&self) -> Option<Arc<dyn Outcome>> {
        Some(Arc::clone(&self.outcome) as _)
    }

    fn record(&self, recorder: &mut Recorder<'_>, _target: Option<&TargetImage>, _clear: bool) {
        recorder.clear_buffer("status.clear", &self.status);
        self.project.record(recorder, &self.view.project, groups_of(self.set.count, 64));
        self.sort.record(recorder);
        for (band, host) in self.bands.iter().zip(&self.outcome.bins) {
            self.bins.record(recorder, self.across, [band.first, band.tiles], self.set.count);
            recorder.copy_buffer("bins.total", self.bins.total(), host, 8);
            recorder.release_to_host(host);
            let turns = turns_of(&self.desc);
            let push = SplatPush { band: band.first, tiles: band.tiles, ..self.view.draw };
            for round in 0..self.rounds {
                let pass = self.resume.as_ref().filter(|_| round > 0).unwrap_or(&self.first);
                // What an earlier dispatch leaves open is not short.
                let last = u32::from(round + 1 == self.rounds) << 31;
                let push = SplatPush { turns: turns | last, ..push };
                pass.record(recorder, &push, groups_of(band.tiles, 1));
            }
        }
        recorder.copy_buffer("status", &self.status, &self.outcome.status, self.outcome.status.size());
        recorder.release_to_host(&self.outcome.status);
    }
}
