//! A frame of splats.
//!
//! 1. Each kernel is projected: the pixels that it may cover, its sort key, its ellipse (`splat-project.glsl`).
//! 2. Kernels are sorted by key, and binned to tiles (`bins.glsl`).
//! 3. Each tile draws its bin in that order, in one dispatch or several. Pixels whose own order is another one are listed,
//!    and drawn again.
//!
//! Kernels that the device has no room for go through these steps part by part (`parts.rs`).
//!
//! Bins and step 3 run for one band of tiles after the other, because the bins of a band must fit one buffer. Nothing
//! is dropped: a frame whose bins exceed their capacity, or whose tiles need more dispatches, is incomplete, and is
//! prepared again with what it needed.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, PoisonError};

use ash::vk;

use crate::error::{Error, Result};
use crate::frame::depth_measure::DepthMeasure;
use crate::frame::in_parts::{MOST_PARTS, in_parts};
use crate::frame::prepared::{Outcome, Prepared};
use crate::frame::target::{Canvas, own_image};
use crate::gpu::shader::{
    self, Bounded, FOOTPRINT_PARTS, HitDepths, KERNEL_BSPLINE, KERNEL_GAUSSIAN, KERNEL_SINC, KERNEL_TENT,
    Optics, PIXELS_FIRST, SPLAT_EWA_DRAW, SPLAT_EWA_DRAW_WIDE, SPLAT_EWA_REPAIR, SPLAT_PROJECT_COMPUTE,
    SPLAT_SHEETS_AXIS, SPLAT_SHEETS_AXIS_WIDE, SPLAT_SHEETS_IMAGE, SPLAT_SHEETS_IMAGE_WIDE, STATUS_WORDS,
    SplatEwaDraw, SplatEwaRepair, SplatProject, SplatSheetsAxis, SplatSheetsImage, Splats, TILE, TILE_PIXELS,
};
use crate::gpu::{Bound, Buffer, Gpu, Image, Recorder, Sampled, TargetImage};
use crate::interface::{SplatPush, SplatViewPush};
use crate::num::{self, f32_of};
use crate::primitives::bins::{Bins, Fill, Ranked};
use crate::primitives::dispatch::{Dispatch, buffer, groups_of, pass};
use crate::primitives::radix_sort::RadixSort;
use crate::resident::GpuScene;
use crate::resident::splats::{Place, Shape, SplatSet};
use crate::scene::{Data, Kernel, KernelSize, Model, View};
use crate::technique::splat::bands::{BandedDraw, Repair, Rounds, Step, bands_of};
use crate::technique::splat::desc::{Accumulation, SplatDesc};
use crate::technique::splat::outcome::SplatOutcome;
use crate::technique::splat::parts::SplatParts;
use crate::technique::splat::view::SplatView;

/// Bytes of the device's memory for each kernel: data, keys, order, box, record and pairs with tiles; and in parts for each of one, which is staged
/// twice. (About: kernels that cover many tiles take more, and there are fewer of these.)
const KERNEL_BYTES: [u64; 2] = [128, 192];

/// The same for what a covariance takes more.
const COVARIANCE_BYTES: [u64; 2] = [64, 192];

/// The format of the accumulation image.
const FORMAT: vk::Format = vk::Format::R32G32B32A32_SFLOAT;

// The documents say that a footprint is integrated in eight parts.
const _: () = assert!(FOOTPRINT_PARTS == 8);

/// Everything that is fixed between frames of one size.
#[derive(Debug)]
pub(crate) struct SplatFrame {
    desc: SplatDesc,
    set: Arc<SplatSet>,
    of: View,
    view: SplatView,
    project: Dispatch,
    sort: RadixSort,
    banded: BandedDraw,
    image: Arc<Image>,
    status: Arc<Buffer>,
    outcome: Arc<SplatOutcome>,
    /// Where the device has room for a part of the kernels.
    parts: Option<SplatParts>,
    /// The part of the next recording, where that goes on with the image of the last one.
    next: usize,
    resumes: AtomicBool,
}

/// The kernels as a view sees them.
#[derive(Debug)]
struct Projected {
    keys: Arc<Buffer>,
    order: Arc<Buffer>,
    boxes: Arc<Buffer>,
    status: Arc<Buffer>,
    /// Ellipses, or the depths that kernels with covariances span; else empty.
    records: Arc<Buffer>,
}

impl Projected {
    /// Makes the buffers of so many kernels.
    fn new(gpu: &Gpu, desc: &SplatDesc, set: &SplatSet, count: u32) -> Result<Self> {
        let count = u64::from(count);
        let keys = buffer(gpu, "order.keys", count)?;
        let order = buffer(gpu, "order", count)?;
        let boxes = buffer(gpu, "boxes", 2 * count)?;
        let status = buffer(gpu, "status", STATUS_WORDS.into())?;
        let records = if desc.ewa || set.shape == Shape::Covariances { 8 * count } else { 0 };
        let records = buffer(gpu, "records", records)?;
        Ok(Self { keys, order, boxes, status, records })
    }

    /// Binds the shader that projects kernels.
    fn shader(&self, desc: &SplatDesc, set: &SplatSet, lists: &[Arc<Buffer>; 2], axis: usize) -> Bound {
        SPLAT_PROJECT_COMPUTE.with(&SplatProject {
            boxes: self.boxes.write(),
            order: self.order.write(),
            rank_keys: self.keys.write(),
            splat_points: lists[0].read(),
            splat_records: self.records.write(),
            splat_shapes: lists[1].read(),
            splat_axis: num::count(axis),
            splat_density: set.kernels.model == Model::Density,
            splat_ewa: desc.ewa,
            splat_kernel: kernel_code(set.kernels.kernel),
            splat_lowpass: desc.filter.code(),
            splat_order: desc.accumulation.key_code(),
            splat_shape: set.shape.code(),
        })
    }
}

/// The inputs of the passes that draw bins.
struct DrawInputs {
    splats: Splats,
    band: shader::Band,
    records: Arc<Buffer>,
    /// Pixels that are listed to be drawn again.
    pixels: Arc<Buffer>,
    /// The table of footprints.
    template: Sampled,
    tabulated: bool,
    ewa: bool,
    axis: u32,
    bounded: Bounded,
    hit_depths: HitDepths,
    optics: Optics,
}

impl DrawInputs {
    /// Binds the shader that draws listed pixels.
    fn repair(&self) -> Bound {
        SPLAT_EWA_REPAIR.with(&SplatEwaRepair {
            pixels: self.pixels.write(),
            splat_records: self.records.read(),
            splat_ewa: self.ewa,
            bounded: self.bounded.clone(),
            hit_depths: self.hit_depths.clone(),
            band: self.band.clone(),
            splats: self.splats.clone(),
        })
    }

    /// Binds the shader that draws bins, in columns or in pixels; with `resume` from where the dispatch before ended.
    fn shader(&self, accumulation: Accumulation, columns: bool, resume: bool) -> Bound {
        let (splats, band) = (self.splats.clone(), shader::Band { resume, ..self.band.clone() });
        let (optics, bounded, hit_depths) =
            (self.optics.clone(), self.bounded.clone(), self.hit_depths.clone());
        let splat_records = self.records.read();
        match accumulation {
            Accumulation::Centres | Accumulation::ByPixel => {
                let shader = if columns { SPLAT_EWA_DRAW } else { SPLAT_EWA_DRAW_WIDE };
                shader.with(&SplatEwaDraw {
                    pixels: self.pixels.write(),
                    splat_records,
                    splat_by_pixel: accumulation == Accumulation::ByPixel,
                    splat_ewa: self.ewa,
                    bounded,
                    hit_depths,
                    band,
                    splats,
                })
            }
            Accumulation::Slabs => {
                let shader = if columns { SPLAT_SHEETS_IMAGE } else { SPLAT_SHEETS_IMAGE_WIDE };
                shader.with(&SplatSheetsImage { splat_records, bounded, hit_depths, band, optics, splats })
            }
            Accumulation::Sheets => {
                let shader = if columns { SPLAT_SHEETS_AXIS } else { SPLAT_SHEETS_AXIS_WIDE };
                shader.with(&SplatSheetsAxis {
                    splat_template: self.template.clone(),
                    splat_axis: self.axis,
                    splat_tabulated: self.tabulated,
                    bounded,
                    hit_depths,
                    band,
                    optics,
                    splats,
                })
            }
        }
    }

    /// Builds the pass that draws bins, and the one that draws listed pixels again.
    fn passes(&self, gpu: &Gpu, desc: &SplatDesc, rounds: u32) -> Result<(Rounds, Option<Repair>)> {
        let columns = desc.options.tiles.columns(desc.name, gpu)?;
        let name = |part: &str| format!("{}.{part}", desc.name);
        let draw = Rounds::new(gpu, &name("draw"), rounds, |resume| {
            self.shader(desc.accumulation, columns, resume)
        })?;
        if desc.accumulation != Accumulation::ByPixel {
            return Ok((draw, None));
        }
        let repair = Rounds::new(gpu, &name("repair"), 1, |_| self.repair())?;
        Ok((draw, Some(Repair { pixels: Arc::clone(&self.pixels), draw: repair })))
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

/// Uploads the half extents of a lattice's domain, the middle of sheet 0, and the scale of the table of footprints.
fn upload_domain(gpu: &Gpu, set: &SplatSet, axis: usize, scale: [f32; 4]) -> Result<Arc<Buffer>> {
    let half = set.space.domain.to_array().map(|x| if x.is_finite() { f32_of(x) } else { 0.0 });
    let domain = [[half[0], half[1], half[2], f32_of(set.space.middles[axis])], scale];
    Buffer::with_data(gpu, "splats.domain", bytemuck::cast_slice(&domain))
}

impl SplatFrame {
    /// Prepares frames of one view size, in parts where the device has no room for all kernels.
    pub(crate) fn new(scene: &Arc<GpuScene>, view: &View, target: &Canvas, desc: SplatDesc) -> Result<Self> {
        // The table holds whole footprints; bounds would cut them.
        let template = desc.template.filter(|_| target.bounds.is_none());
        let desc = SplatDesc { template, ..desc };
        let place = |parts| if parts == 1 { Place::Device } else { Place::Host };
        let prepare = |parts| {
            let set = scene.splats(&desc.kernels, desc.options.step, place(parts))?;
            let frame = Self::of_set(scene, view, target, desc, (&set, parts));
            let rows = view.extent()[1].div_ceil(TILE);
            frame.map_err(|error| match error {
                // More parts do not help.
                Error::Memory { .. } if parts > 1 && parts >= rows => {
                    let what = format!("{} in parts of this view", desc.name);
                    Error::unsupported(what, format!("room for the kernels of one row of tiles: {error}"))
                }
                error => error,
            })
        };
        let forget = |parts| {
            if parts == 1 {
                scene.forget_splats(&desc.kernels, desc.options.step, place(parts));
            }
        };
        in_parts(desc.options.parts, || Ok(fewest_parts(scene)), prepare, forget)
    }

    /// Prepares frames of a set of kernels, in at most so many parts if it is held by the host.
    fn of_set(
        scene: &Arc<GpuScene>,
        view: &View,
        target: &Canvas,
        desc: SplatDesc,
        (set, count): (&Arc<SplatSet>, u32),
    ) -> Result<Self> {
        let gpu = scene.gpu();
        let name = desc.name;
        let knots = scene.knots()?;
        let opaque = desc.options.tiles.stop / scene.max_colour();
        let seen = SplatView::new(set, &desc, knots.count, opaque, view)?;
        let [width, height] = view.extent();
        let across = width.div_ceil(TILE);
        let tiles = across * height.div_ceil(TILE);

        // 1. Kernels as the view sees them, in order.
        let mut parts = None;
        let (lists, room) = match set.on_device() {
            Some(lists) => (lists.clone(), set.count),
            None => {
                let made = parts.insert(SplatParts::new(gpu, set, &seen.project, view.extent(), count)?);
                (made.buffers(), made.room)
            }
        };
        let projected = Projected::new(gpu, &desc, set, room)?;
        let template = scene.splat_template(set, desc.template, view)?;
        let domain = upload_domain(gpu, set, seen.axis, template.scale)?;
        let bound = projected.shader(&desc, set, &lists, seen.axis);
        let project = pass(gpu, &format!("{name}.project"), &bound)?;
        let Projected { keys, order, boxes, status, records } = projected;
        let sort = RadixSort::new(gpu, &format!("{name}.sort"), [&keys, &order], room)?;

        // 2. Bands whose bins fit a buffer.
        let (status_of, scratch) = (Arc::clone(&status), Arc::clone(&sort.scratch));
        let ranked = Ranked { order, boxes, status: status_of, keys, scratch, count: room };
        let known = *scene.splat_needs.lock().unwrap_or_else(PoisonError::into_inner);
        let measure = |upload: &dyn Fn(&mut Recorder<'_>), push: &SplatViewPush| {
            Fill::measure(gpu, name, &ranked, [tiles, across], |recorder| {
                upload(recorder);
                project.record(recorder, push, groups_of(room, 64));
                sort.record(recorder);
            })
        };
        let tile_options = &desc.options.tiles;
        let (bands, capacity, longest) = match &mut parts {
            None => {
                let fill = measure(&|_| {}, &seen.project)?;
                let (bands, capacity) = bands_of(gpu, name, tile_options, &fill, known.entries, u32::MAX)?;
                (bands, capacity, fill.longest())
            }
            Some(parts) => parts.measure(&seen.project, measure, |fill| {
                bands_of(gpu, name, tile_options, fill, 0, u32::MAX)
            })?,
        };
        let widest = bands.iter().map(|band| band.tiles).max().unwrap_or(1);
        let bins = Bins::new(gpu, name, &ranked, widest, capacity, false)?;

        // 3. Passes that draw bins.
        let image = own_image(gpu, name, FORMAT, vk::ImageUsageFlags::STORAGE, view, target)?;
        let in_band = u64::from(widest) * u64::from(TILE_PIXELS);
        let state = buffer(gpu, "state", 2 * in_band)?;
        let listed = if desc.accumulation == Accumulation::ByPixel { 2 * in_band } else { 0 };
        let pixels = buffer(gpu, "pixels", u64::from(PIXELS_FIRST) + listed)?;
        let inputs = DrawInputs {
            band: shader::Band {
                accumulation: image.stored(),
                bins: bins.entries.write(),
                bin_ends: bins.ends.read(),
                splat_state: state.write(),
                status: status.write(),
                resume: false,
            },
            splats: Splats {
                splat_domain: domain.read(),
                splat_points: lists[0].read(),
                splat_shapes: lists[1].read(),
                eye_inside: seen.eye_inside,
                splat_density: set.kernels.model == Model::Density,
                splat_kernel: kernel_code(set.kernels.kernel),
                splat_shape: set.shape.code(),
            },
            records,
            pixels,
            template: template.image.sampled(vk::Filter::LINEAR),
            tabulated: desc.template.is_some(),
            ewa: desc.ewa,
            axis: num::count(seen.axis),
            bounded: target.bounded(&knots.buffer),
            hit_depths: target.hit_depths(),
            optics: knots.optics(),
        };
        let rounds = desc.rounds(longest).max(known.rounds);
        let (draw, repair) = inputs.passes(gpu, &desc, rounds)?;

        let most_bands = parts.as_ref().map_or(bands.len(), |parts| parts.most_bands()[1]);
        let banded = BandedDraw { bins, bands, across, steps: vec![Step::Bins(draw.into())], repair, rounds };
        let outcome = banded.outcome(scene, name, set.count, most_bands)?;
        let (set, resumes) = (Arc::clone(set), AtomicBool::new(false));
        Ok(Self {
            desc,
            set,
            of: *view,
            view: seen,
            project,
            sort,
            banded,
            image,
            status,
            outcome,
            parts,
            next: 0,
            resumes,
        })
    }

    /// Records a part of a frame.
    fn record_part(&self, recorder: &mut Recorder<'_>, push: SplatPush, parts: &SplatParts, at: usize) {
        let begins = at == 0;
        if begins {
            recorder.clear_buffer("status.clear", &self.status);
            self.outcome.record_begin(recorder);
            // The image shows nothing yet where other parts are drawn.
            let widest = self.banded.bands.iter().map(|band| band.tiles).max().unwrap_or(1);
            self.banded.record_empty(recorder, push, &parts.rest(at, widest));
        }
        parts.record(recorder, begins);
        self.project.record(recorder, &parts.project(at, &self.view.project), groups_of(parts.room, 64));
        self.sort.record(recorder);
        let first = parts.first_band(at);
        self.banded.record_bands(recorder, push, (&parts.parts[at].bands, first), &self.outcome);
        self.outcome.record_status(recorder, &self.status);
    }
}

impl Prepared for SplatFrame {
    fn set_view(&mut self, view: &View, _most_passes: u32) -> Result<bool> {
        let opaque = f64::from(self.view.draw.opaque);
        let seen = SplatView::new(&self.set, &self.desc, self.view.draw.knots, opaque, view)?;
        let same = seen.axis == self.view.axis || self.desc.accumulation != Accumulation::Sheets;
        let template_stays = self.desc.template.is_none();
        if !same || !template_stays || (seen.eye_inside && !self.view.eye_inside) {
            return Ok(false);
        }
        if let Some(parts) = &mut self.parts {
            // A frame of the same view goes on.
            if self.of != *view {
                if !parts.set_view(&seen.project, &self.banded.bands) {
                    return Ok(false);
                }
                self.resumes = AtomicBool::new(false);
                self.outcome.take_next();
            }
        }
        self.of = *view;
        self.view = seen;
        Ok(true)
    }

    fn measure(&self) -> DepthMeasure {
        DepthMeasure { centre: self.set.space.centre, unit: self.set.space.unit }
    }

    fn image(&self) -> Option<&Arc<Image>> {
        Some(&self.image)
    }

    fn route(&self) -> &'static str {
        "compute"
    }

    fn hit_depths(&self) -> std::result::Result<(), &'static str> {
        Ok(())
    }

    fn counters(&self) -> Vec<(&'static str, u64)> {
        let Some(parts) = self.parts.as_ref().map(|parts| &parts.parts) else {
            return self.banded.counters();
        };
        let mut counters = self.banded.counters_of(parts.iter().flat_map(|part| &part.bands));
        counters.push(("parts", num::wide(parts.len())));
        counters
    }

    fn outcome(&self) -> Option<Arc<dyn Outcome>> {
        Some(Arc::clone(&self.outcome) as _)
    }

    fn load(&mut self) -> Result<bool> {
        let Some((parts, next)) = self.parts.as_mut().zip(self.outcome.take_next()) else { return Ok(false) };
        if !parts.stage(next, false) {
            return Err(Error::invalid("plan", "what was recorded together with it has not been completed"));
        }
        self.next = next;
        self.resumes.store(true, Ordering::Relaxed);
        Ok(true)
    }

    fn resumes(&self) -> bool {
        self.resumes.load(Ordering::Relaxed)
    }

    fn record(&self, recorder: &mut Recorder<'_>, _target: Option<&TargetImage>, _clear: bool) {
        let push = SplatPush { turns: self.desc.turns, ..self.view.draw };
        let Some(parts) = &self.parts else {
            self.banded.record(recorder, push, &self.status, &self.outcome, |recorder| {
                self.project.record(recorder, &self.view.project, groups_of(self.set.count, 64));
                self.sort.record(recorder);
            });
            return;
        };
        let mut at = 0;
        if recorder.records() {
            if self.resumes.swap(false, Ordering::Relaxed) {
                at = self.next;
            }
            self.outcome.begin(at, parts.parts.len());
        }
        self.record_part(recorder, push, parts, at);
    }

    fn record_most(&self, recorder: &mut Recorder<'_>, target: &TargetImage) {
        let Some(parts) = &self.parts else { return self.record(recorder, Some(target), true) };
        let push = SplatPush { turns: self.desc.turns, ..self.view.draw };
        // The first part, and as many bands as no part may exceed.
        self.record_part(recorder, push, parts, 0);
        let more = vec![self.banded.bands[0]; parts.most_bands()[0]];
        self.banded.record_bands(recorder, push, (&more, 0), &self.outcome);
        self.banded.record_empty(recorder, push, &more);
    }
}

/// Returns the number of parts in which the device has room for points, estimated from their number: one unless they clearly exceed it.
fn fewest_parts(scene: &GpuScene) -> u32 {
    let (Data::Points(points), gpu) = (&scene.scene().data, scene.gpu()) else { return 1 };
    let count = num::wide(points.centres().len());
    let shapes = matches!(points.size(), KernelSize::Covariances(_));
    let bytes = [0, 1].map(|i| KERNEL_BYTES[i] + if shapes { COVARIANCE_BYTES[i] } else { 0 });
    // Some is left for what comes after.
    let room = (gpu.memory_left() / 4 * 3).max(1);
    if count * bytes[0] / 2 <= room {
        return 1;
    }
    let parts = (count * bytes[1]).div_ceil(room / 4 * 3).clamp(2, MOST_PARTS.into());
    u32::try_from(parts).unwrap_or(MOST_PARTS)
}
