//! Trained Gaussian splats, by the rules that scenes are trained and shown under (Kerbl, Kopanas, Leimkühler and Drettakis 2023).
//!
//! 0. The host packs splats, 40 bytes each and two for each further coefficient of their colours (`resident/splats/trained.rs`).
//! 1. `gaussians-project.glsl` finds the place of each splat, its squared distance as a quotient of quadratic forms, its colour from this
//!    eye, its box of pixels and its sort key.
//! 2. A stable sort orders splats by key; tiles take theirs in that order (`bins.glsl`).
//! 3. `gaussians.glsl` blends the splats of each tile in registers, front to back. By rules that overlap, `gaussians-overlap.glsl` cuts each
//!    pixel's line into slabs, and adds up what splats show through what lies before their shares of each.
//!
//! Error: that of float32 and of the packing, an RMSE of a few 1e-5; where a rule has thresholds, splats on them may count or not. By rules that
//! overlap, colours have an error of second order in the option `step`, below 1e-3 by its default. Colours are display-referred, as scenes are
//! trained. Cost: for each splat and pixel of its tiles a quadratic form and an exponential; by rules that overlap four times as much and an
//! error function for each end of a slab within a splat. Needs: core Vulkan 1.3.

use std::sync::{Arc, PoisonError};

use ash::vk;

use crate::error::{Error, Result};
use crate::frame::depth_measure::DepthMeasure;
use crate::frame::prepared::{Outcome, Prepared};
use crate::frame::target::{Canvas, own_image};
use crate::gpu::inputs::Entry;
use crate::gpu::shader::{
    self, GAUSSIANS_DRAW, GAUSSIANS_DRAW_WIDE, GAUSSIANS_OVERLAP_ADJUST, GAUSSIANS_OVERLAP_BLEND,
    GAUSSIANS_OVERLAP_BLEND_WIDE, GAUSSIANS_OVERLAP_PLACE, GAUSSIANS_OVERLAP_PLACE_WIDE,
    GAUSSIANS_OVERLAP_SHARE, GAUSSIANS_OVERLAP_SHARE_WIDE, GAUSSIANS_OVERLAP_SORT, GAUSSIANS_OVERLAP_WEIGH,
    GAUSSIANS_PROJECT_COMPUTE, GAUSSIANS_REPAIR, GaussiansDraw, GaussiansOverlapPlace, GaussiansOverlapSort,
    GaussiansOverlapWeigh, GaussiansProject, GaussiansRepair, ORDER_DEPTHS, ORDER_DISTANCES, ORDER_PIXELS,
    PIXELS_FIRST, RULE_ANTIALIASED, RULE_INRIA, RULE_INTEGRAL, RULE_KHR, RULE_OVERLAP, RULE_RAY,
    STATUS_WORDS, TILE, TILE_PIXELS, TRAINED_RAY_RECORD, TRAINED_RECORD,
};
use crate::gpu::{Buffer, Gpu, Image, Recorder, TargetImage};
use crate::interface::{SplatPush, TrainedPush};
use crate::num::{self, f32_of};
use crate::primitives::bins::{Bins, Fill, Ranked};
use crate::primitives::dispatch::{self, Dispatch, buffer, groups_of};
use crate::primitives::radix_sort::RadixSort;
use crate::resident::GpuScene;
use crate::resident::splats::trained::TrainedSet;
use crate::scene::{SplatRule, View};
use crate::technique::declare::draw::{Draw, Facts, Of, TechniqueOptions};
use crate::technique::declare::{Value, option_set, refused, words};
use crate::technique::splat::bands::{BandedDraw, Repair, Rounds, Step, bands_of};
use crate::technique::splat::options::TileOptions;
use crate::technique::splat::outcome::SplatOutcome;

/// The steps of slabs that are allowed.
const STEPS: [f64; 2] = [0.006, 0.5];

/// The step of slabs where nothing sets it.
const STEP: f64 = 0.04;

/// Bytes that slabs may take; images of more are drawn in several bands.
const SLAB_BYTES: u64 = 128 << 20;

impl Value for SplatRule {
    const WORDS: &'static [(&'static str, Self)] = &Self::ALL;
}

words! {
    /// The order in which splats are blended.
    pub enum SplatOrder {
        /// By the depth of centres, along the viewing direction.
        Depth = "depth",
        /// By the distance of centres from the eye.
        Distance = "distance",
        /// By the place where each pixel's ray is nearest to them.
        Pixel = "pixel",
    }
}

option_set! {
    /// Options of `gaussians`.
    pub struct Options {
        /// Selects the rule of drawing. khr, inria and antialiased project ellipses, ray takes the greatest opacity along each pixel's ray,
        /// overlap and integral take splats as extinction that is spread along it.
        pub rule: Option<SplatRule> = None => Rule::words().unset("the scene's, or the one that its splats were trained under"),
        /// Selects the order of blending. depth and distance take splats by their centres, as rules of the image do, and may jump when the
        /// camera turns; pixel takes them in each pixel by the place where its ray is nearest to them, with rule=ray. Rules that overlap need
        /// none.
        pub order: Option<SplatOrder> = None
            => Rule::words().unset("the rule's: distance for khr, depth for inria and antialiased, pixel for ray"),
        /// Sets the largest step of the square root of a pixel's transmittance between slabs, in which rule=overlap and rule=integral take
        /// splats without order. The error of colours falls with its square.
        pub step: Option<f64> = None => Rule::between(STEPS).unset("0.04 by rules that overlap"),
        /// Options of tiles.
        pub tiles: TileOptions = TileOptions::default() => GROUP,
    }
}

impl TechniqueOptions for Options {
    const FACTS: Facts = Facts {
        name: "gaussians",
        summary: "trained Gaussian splats, by the rule that they were trained under or another",
        source: "Kerbl, Kopanas, Leimkühler and Drettakis 2023",
        data: &["gaussians"],
        kernels: &[],
        routes: &["compute"],
        splits_rays: false,
        modes: &[],
        samples: &[
            ("khr", "", [1e-4, 1e-3]),
            ("inria", "", [2e-4, 1e-2]),
            ("antialiased", "pairs=700", [2e-4, 1e-2]),
            ("ray", "", [1e-4, 1e-3]),
            ("ray", "order=depth", [2e-2, 0.1]),
            ("overlap", "", [1e-3, 1e-2]),
            ("integral", "step=0.02", [5e-4, 5e-3]),
        ],
        families: &[
            (Of::Ordered, "", &[""]),
            (Of::Ordered, "order=depth", &[""]),
            (Of::Ordered, "resolution=", &["quarter", "half"]),
            (Of::Overlapping, "step=", &["0.32", "0.16", "0.08", "0.04", "0.02", "0.01"]),
        ],
    };
}

impl Draw for Options {
    fn prepare(&self, scene: &Arc<GpuScene>, view: &View, target: &Canvas) -> Result<Box<dyn Prepared>> {
        let rule = self.rule.or(scene.scene().splat_rule()).unwrap_or(SplatRule::Khr);
        if target.bounds.is_some() {
            rule.check_depth("surfaces, clip regions and depth images")?;
        }
        if target.target.hit_depths.is_some() {
            rule.check_depth("hit depths")?;
        }
        let usual = match rule {
            SplatRule::Khr => SplatOrder::Distance,
            SplatRule::Inria | SplatRule::Antialiased => SplatOrder::Depth,
            SplatRule::Ray | SplatRule::Overlap | SplatRule::Integral => SplatOrder::Pixel,
        };
        let order = self.order.unwrap_or(usual);
        if order == SplatOrder::Pixel && !rule.has_depth() {
            let why = format!("pixel: splats have no depth on a ray by rule={}", rule.name());
            return Err(refused(Self::NAME, "order", why));
        }
        let overlaps = rule.overlaps();
        for (key, is_set, fits) in
            [("order", self.order.is_some(), !overlaps), ("step", self.step.is_some(), overlaps)]
        {
            if is_set && !fits {
                let why = format!(
                    "rule={} {}",
                    rule.name(),
                    if overlaps { "needs no order" } else { "has no slabs" }
                );
                return Err(refused(Self::NAME, key, why));
            }
        }
        let slabs = overlaps.then(|| num::u32_of((1.0 / self.step.unwrap_or(STEP)).ceil()));
        let desc = TrainedDesc { rule: code_of(rule), order, slabs, tiles: self.tiles };
        Ok(Box::new(TrainedFrame::new(scene, view, target, &desc)?))
    }
}

/// How splats are drawn.
struct TrainedDesc {
    /// The shader's code of the rule.
    rule: u32,
    order: SplatOrder,
    /// Slabs of each pixel, by rules that overlap.
    slabs: Option<u32>,
    tiles: TileOptions,
}

impl TrainedDesc {
    fn by_pixel(&self) -> bool {
        self.order == SplatOrder::Pixel && self.slabs.is_none()
    }

    /// Returns the shader's code of the sort key.
    fn key_code(&self) -> u32 {
        match self.order {
            SplatOrder::Depth => ORDER_DEPTHS,
            SplatOrder::Distance => ORDER_DISTANCES,
            SplatOrder::Pixel => ORDER_PIXELS,
        }
    }

    /// Returns whether pixels end by thresholds of the rule.
    fn ends_itself(&self) -> bool {
        [RULE_INRIA, RULE_ANTIALIASED].contains(&self.rule)
    }
}

/// Returns the shader's code of a rule.
fn code_of(rule: SplatRule) -> u32 {
    match rule {
        SplatRule::Khr => RULE_KHR,
        SplatRule::Inria => RULE_INRIA,
        SplatRule::Antialiased => RULE_ANTIALIASED,
        SplatRule::Ray => RULE_RAY,
        SplatRule::Overlap => RULE_OVERLAP,
        SplatRule::Integral => RULE_INTEGRAL,
    }
}

/// Returns the words of each pixel that `gaussians-overlap.glsl` needs.
fn slab_words(slabs: u32) -> u32 {
    2 * slabs + 3
}

/// Everything that is fixed between frames of one size.
#[derive(Debug)]
struct TrainedFrame {
    set: Arc<TrainedSet>,
    project: Dispatch,
    sort: RadixSort,
    banded: BandedDraw,
    pushes: (TrainedPush, SplatPush),
    image: Arc<Image>,
    status: Arc<Buffer>,
    outcome: Arc<SplatOutcome>,
}

impl TrainedFrame {
    /// Prepares frames of one view size.
    fn new(scene: &Arc<GpuScene>, view: &View, target: &Canvas, desc: &TrainedDesc) -> Result<Self> {
        let (gpu, name) = (scene.gpu(), Options::NAME);
        let set = scene.trained()?;
        let turns = gpu.turns()?;
        let opaque = if desc.ends_itself() { 0.0 } else { desc.tiles.stop / set.max_colour };
        let push = SplatPush { opaque: f32_of(opaque), turns, ..SplatPush::default() };
        let pushes = pushes(&set, view, push)?;
        let [width, height] = view.extent();
        let across = width.div_ceil(TILE);
        let tiles = across * height.div_ceil(TILE);

        // 1. Splats as the view sees them.
        let count = u64::from(set.count);
        let keys = buffer(gpu, "order.keys", count)?;
        let order = buffer(gpu, "order", count)?;
        let boxes = buffer(gpu, "boxes", 2 * count)?;
        let status = buffer(gpu, "status", STATUS_WORDS.into())?;
        let vectors = if desc.rule >= RULE_RAY { TRAINED_RAY_RECORD } else { TRAINED_RECORD };
        let records = buffer(gpu, "records", 4 * u64::from(vectors) * count)?;
        let project = GAUSSIANS_PROJECT_COMPUTE.with(&GaussiansProject {
            boxes: boxes.write(),
            order: order.write(),
            rank_keys: keys.write(),
            splat_harmonics: set.harmonics.read(),
            splat_points: set.splats.read(),
            splat_records: records.write(),
            splat_order: desc.key_code(),
            splat_rule: desc.rule,
        });
        let project = dispatch::pass(gpu, &format!("{name}.project"), &project)?;

        // 2. Their order, and bands whose bins fit a buffer.
        let sort = RadixSort::new(gpu, &format!("{name}.sort"), [&keys, &order], set.count)?;
        let (status_of, scratch) = (Arc::clone(&status), Arc::clone(&sort.scratch));
        let ranked = Ranked { order, boxes, status: status_of, keys, scratch, count: set.count };
        let fill = Fill::measure(gpu, name, &ranked, [tiles, across], |recorder| {
            project.record(recorder, &pushes.0, groups_of(set.count, 64));
            sort.record(recorder);
        })?;
        let known = *scene.splat_needs.lock().unwrap_or_else(PoisonError::into_inner);
        let tile_bytes = desc.slabs.map(|slabs| 4 * u64::from(slab_words(slabs) * TILE_PIXELS));
        let most = SLAB_BYTES.min(gpu.limits().max_storage_buffer_range.into());
        let fit = tile_bytes.map_or(u32::MAX, |bytes| u32::try_from(most / bytes).unwrap_or(u32::MAX).max(1));
        let (bands, capacity) = bands_of(gpu, name, &desc.tiles, &fill, known.entries, fit)?;
        let widest = bands.iter().map(|band| band.tiles).max().unwrap_or(1);
        let bins = Bins::new(gpu, name, &ranked, widest, capacity, false)?;

        // 3. The passes that blend bins.
        let format = vk::Format::R32G32B32A32_SFLOAT;
        let image = own_image(gpu, name, format, vk::ImageUsageFlags::STORAGE, view, target)?;
        let in_band = u64::from(widest) * u64::from(TILE_PIXELS);
        let listed = if desc.by_pixel() { 2 * in_band } else { 0 };
        let inputs = Inputs {
            desc,
            target,
            image: &image,
            bins: &bins,
            status: &status,
            records,
            state: buffer(gpu, "state", 2 * in_band)?,
            pixels: buffer(gpu, "pixels", u64::from(PIXELS_FIRST) + listed)?,
            columns: desc.tiles.columns(name, gpu)?,
        };
        // Loop iterations that a splat takes, whatever it meets.
        let each = desc.slabs.map_or(1, |slabs| if inputs.columns { 10 * TILE } else { slabs + 11 });
        let rounds = fill.longest().saturating_mul(each).div_ceil(turns).max(1).max(known.rounds);
        let steps = match desc.slabs {
            Some(slabs) => inputs.overlap(gpu, rounds, slabs, in_band)?,
            None => vec![Step::Bins(inputs.blend(gpu, rounds)?.into())],
        };
        let repair = desc.by_pixel().then(|| inputs.repair(gpu)).transpose()?;
        let banded = BandedDraw { bins, bands, across, steps, repair, rounds };
        let outcome = banded.outcome(scene, name, set.count, banded.bands.len())?;
        Ok(Self { set, project, sort, banded, pushes, image, status, outcome })
    }
}

/// What passes that blend bins read and write.
struct Inputs<'a> {
    desc: &'a TrainedDesc,
    target: &'a Canvas,
    image: &'a Arc<Image>,
    bins: &'a Bins,
    status: &'a Arc<Buffer>,
    records: Arc<Buffer>,
    state: Arc<Buffer>,
    pixels: Arc<Buffer>,
    /// Whether an invocation draws a column of a tile.
    columns: bool,
}

impl Inputs<'_> {
    fn band(&self, resume: bool) -> shader::Band {
        shader::Band {
            accumulation: self.image.stored(),
            bins: self.bins.entries.write(),
            bin_ends: self.bins.ends.read(),
            splat_state: self.state.write(),
            status: self.status.write(),
            resume,
        }
    }

    fn meet(&self) -> shader::Meet {
        shader::Meet { splat_records: self.records.read(), splat_rule: self.desc.rule }
    }

    /// Makes the pass of rules that blend whole splats.
    fn blend(&self, gpu: &Gpu, rounds: u32) -> Result<Rounds> {
        let shader = if self.columns { GAUSSIANS_DRAW } else { GAUSSIANS_DRAW_WIDE };
        Rounds::new(gpu, &format!("{}.draw", Options::NAME), rounds, |resume| {
            shader.with(&GaussiansDraw {
                pixels: self.pixels.write(),
                splat_by_pixel: self.desc.by_pixel(),
                meet: self.meet(),
                band: self.band(resume),
                bounded: self.target.bounded(&self.records),
                hit_depths: self.target.hit_depths(),
            })
        })
    }

    /// Makes the pass that draws pixels once more, in whose lines the order of the bin is too far from their own.
    fn repair(&self, gpu: &Gpu) -> Result<Repair> {
        let draw = Rounds::new(gpu, &format!("{}.repair", Options::NAME), 1, |_| {
            GAUSSIANS_REPAIR.with(&GaussiansRepair {
                pixels: self.pixels.write(),
                meet: self.meet(),
                band: self.band(false),
                bounded: self.target.bounded(&self.records),
                hit_depths: self.target.hit_depths(),
            })
        })?;
        Ok(Repair { pixels: Arc::clone(&self.pixels), draw })
    }

    /// Makes the passes of rules that overlap.
    fn overlap(&self, gpu: &Gpu, rounds: u32, slabs: u32, in_band: u64) -> Result<Vec<Step>> {
        let (name, turns) = (Options::NAME, gpu.turns()?);
        // A column's lines place depths at different splats; a line sorts its own.
        if turns < 2 * slabs.max(64) * slabs {
            let step = 1.0 / f64::from(slabs);
            let why = format!("{turns} loop iterations of an invocation: step={step} needs more");
            return Err(Error::unsupported(format!("{name} of overlapping splats"), why));
        }
        let words = buffer(gpu, "slabs", u64::from(slab_words(slabs)) * in_band)?;
        let pass =
            |columns: &Entry<GaussiansOverlapPlace>, pixels: &Entry<GaussiansOverlapPlace>, step: &str| {
                let entry = if self.columns { columns } else { pixels };
                Rounds::new(gpu, &format!("{name}.{step}"), rounds, |resume| {
                    entry.with(&GaussiansOverlapPlace {
                        meet: self.meet(),
                        slab_count: slabs,
                        splat_slabs: words.write(),
                        band: self.band(resume),
                        bounded: self.target.bounded(&self.records),
                    })
                })
            };
        let by_line = |entry: &Entry<GaussiansOverlapSort>, step: &str| {
            let inputs = GaussiansOverlapSort { splat_slabs: words.write(), slab_count: slabs };
            dispatch::pass(gpu, &format!("{name}.{step}"), &entry.with(&inputs))
        };
        let weigh = GAUSSIANS_OVERLAP_WEIGH.with(&GaussiansOverlapWeigh {
            splat_slabs: words.write(),
            slab_count: slabs,
            band: self.band(false),
            hit_depths: self.target.hit_depths(),
        });
        let share = Arc::new(pass(&GAUSSIANS_OVERLAP_SHARE, &GAUSSIANS_OVERLAP_SHARE_WIDE, "share")?);
        Ok(vec![
            Step::Bins(pass(&GAUSSIANS_OVERLAP_PLACE, &GAUSSIANS_OVERLAP_PLACE_WIDE, "place")?.into()),
            Step::Pixels(by_line(&GAUSSIANS_OVERLAP_SORT, "slabs")?),
            Step::Bins(Arc::clone(&share)),
            Step::Pixels(by_line(&GAUSSIANS_OVERLAP_ADJUST, "adjust")?),
            Step::Bins(share),
            Step::Pixels(dispatch::pass(gpu, &format!("{name}.weigh"), &weigh)?),
            Step::Bins(pass(&GAUSSIANS_OVERLAP_BLEND, &GAUSSIANS_OVERLAP_BLEND_WIDE, "blend")?.into()),
        ])
    }
}

/// Derives the push constants of a view in float64, for the pass that projects and for the one that draws.
fn pushes(set: &TrainedSet, view: &View, draw: SplatPush) -> Result<(TrainedPush, SplatPush)> {
    let eye = view.camera().eye;
    // What float32 takes from the eye is added to all places.
    let rounded = eye.to_array().map(f32_of);
    let rest = glam::DVec3::from_array(rounded.map(f64::from)) - eye;
    let row = |axis: glam::DVec3| [axis.x, axis.y, axis.z, rest.dot(axis)].map(f32_of);
    let focal = 1.0 / view.pixel_size();
    let perspective = view.is_perspective();
    let ([right, up, forward], (aspect, skew)) = (view.rows(), view.shape());
    let middle = set.centre.to_array().map(f32_of);
    let (whole, from) = view.whole();
    let depth = (set.centre - eye).dot(view.forward());
    let project = TrainedPush {
        right: row(right),
        down: row(-up),
        forward: row(forward),
        eye: [rounded[0], rounded[1], rounded[2], f32_of(focal)],
        middle: [middle[0], middle[1], middle[2], f32_of(aspect)],
        skew: [skew.x, -skew.y].map(f32_of),
        from_whole: from.to_array().map(f32_of),
        sides: view.sides(),
        whole: View::in_one_word(whole),
        scale_low: f32_of(set.scales[0]),
        scale_step: f32_of(set.scales[1]),
        reach: f32_of(set.reach),
        count: set.count,
        degree: set.degree,
        perspective: u32::from(perspective),
    };
    let [slope_x, slope_y, middle_x, middle_y] = view.slopes().map(f32_of);
    let draw = SplatPush {
        q0_kq: [0.0, 0.0, 0.0, f32_of(depth)],
        px_slope: [0.0, 0.0, 0.0, slope_x],
        py_slope: [0.0, 0.0, 0.0, slope_y],
        d0_slope: [0.0, 0.0, 0.0, middle_x],
        slope_y: middle_y,
        sides: view.sides(),
        // Of the eye's plane before that through the middle, from which depths are told.
        h: f32_of(depth),
        // Depths in float32 have less rounding than this.
        forward_reach: [0.0, 0.0, 0.0, f32_of(set.reach + 1e-5 * (set.radius + depth.abs()))],
        unit: if perspective { 1.0 } else { 0.0 },
        // Thinner splats have no places within, in float32.
        least: f32_of(1e-6 * (set.radius + depth.abs())),
        ..draw
    };
    let rows = [project.right, project.down, project.forward];
    if !(rows.iter().flatten().chain(&rounded).all(|x| x.is_finite())
        && project.eye[3].is_normal()
        && draw.h.is_finite())
    {
        let why = "the camera is so far from the data, or its pixels so large or small, that float32 cannot hold the view";
        return Err(Error::invalid("view", why));
    }
    Ok((project, draw))
}

impl Prepared for TrainedFrame {
    fn set_view(&mut self, view: &View, _most_passes: u32) -> Result<bool> {
        self.pushes = pushes(&self.set, view, self.pushes.1)?;
        Ok(true)
    }

    fn measure(&self) -> DepthMeasure {
        DepthMeasure { centre: self.set.centre, unit: 1.0 }
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
        let mut counters = self.banded.counters();
        counters.push(("splat_bytes", self.set.bytes_each()));
        counters
    }

    fn outcome(&self) -> Option<Arc<dyn Outcome>> {
        Some(Arc::clone(&self.outcome) as _)
    }

    fn record(&self, recorder: &mut Recorder<'_>, _target: Option<&TargetImage>, _clear: bool) {
        self.banded.record(recorder, self.pushes.1, &self.status, &self.outcome, |recorder| {
            self.project.record(recorder, &self.pushes.0, groups_of(self.set.count, 64));
            self.sort.record(recorder);
        });
    }
}
