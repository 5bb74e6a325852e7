//! Enlarges the image of a frame that was drawn with fewer pixels, and draws those pixels once more for which that is too coarse
//! (`glsl/frame/upsampling.glsl`).

use std::sync::Arc;

use ash::vk;

use crate::error::Result;
use crate::frame::dry_run::{dry_run, passes};
use crate::frame::prepared::{Outcome, Prepared};
use crate::frame::ray_bounds::{BOUNDS, RayBounds, bounds_buffer};
use crate::frame::target::{Canvas, Redrawn, usage_after};
use crate::gpu::shader::{PIXELS_COUNT, PIXELS_FIRST, UPSAMPLING_COMPUTE, Upsampling as Inputs};
use crate::gpu::{Buffer, Gpu, Image, ImageDesc, Recorder, TargetImage};
use crate::interface::UpsamplingPush;
use crate::num::{self, f32_of};
use crate::primitives::dispatch::{Dispatch, buffer, download, pass, tiles_of, words};
use crate::scene::View;

/// The pixels of a view that are drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drawn {
    /// Side of the squares of pixels of which one is drawn.
    pub(crate) side: u32,
    /// The second difference of colour between these beyond which all pixels around them are drawn.
    pub(crate) refine: Option<f32>,
    /// Whether pieces of rays are drawn that a view owns; else it is clipped to what it owns.
    pub(crate) pieces: bool,
}

/// The pass that makes an image of the view's size from one with fewer pixels.
#[derive(Debug)]
pub(crate) struct Upsampling {
    pass: Dispatch,
    push: UpsamplingPush,
    squares: [u32; 2],
    /// The image of the view's size.
    pub(crate) image: Arc<Image>,
    refinement: Option<Refinement>,
}

/// The pixels that are drawn once more, and what draws them.
#[derive(Debug)]
struct Refinement {
    redrawn: Redrawn,
    bounds: Option<RayBounds>,
    prepared: Box<dyn Prepared>,
    /// Most passes of the technique. (More rays than of fewer pixels may need more dispatches.)
    most_passes: u32,
    outcome: Arc<Refined>,
}

/// The number of pixels that were drawn once more.
#[derive(Debug)]
struct Refined {
    head: Arc<Buffer>,
}

impl Outcome for Refined {
    fn read(&self) -> Result<(bool, Vec<(&'static str, u64)>)> {
        let head = words(&self.head.host_copy()?);
        let count = head.get(num::index(PIXELS_COUNT)).copied().unwrap_or(0);
        Ok((true, vec![("redrawn_pixels", u64::from(count))]))
    }
}

impl Refinement {
    /// Prepares the technique for a list of pixels of the image.
    fn new(
        gpu: &Gpu,
        redrawn: Redrawn,
        view: &View,
        smaller: &Canvas,
        prepare: impl FnOnce(&View, &Canvas) -> Result<Box<dyn Prepared>>,
    ) -> Result<Self> {
        let bounds = smaller.bounds.is_some().then(|| bounds_buffer(gpu, BOUNDS, view)).transpose()?;
        let list = Some(redrawn.clone());
        let canvas = Canvas { bounds, sampled: false, redrawn: list, ..smaller.clone() };
        let prepared = prepare(view, &canvas)?;
        let bounds = canvas.bounds.as_ref();
        let bounds =
            bounds.map(|bounds| RayBounds::new(gpu, BOUNDS, bounds, false, prepared.measure(), view));
        let outcome = Arc::new(Refined { head: download(gpu, "redrawn.head", 4 * u64::from(PIXELS_FIRST))? });
        let most_passes = passes(&dry_run(gpu, |recorder, target| prepared.record_most(recorder, target)));
        Ok(Self { redrawn, bounds: bounds.transpose()?, prepared, most_passes, outcome })
    }
}

impl Upsampling {
    /// Builds the pass that reads `source`, which shows `view` with fewer pixels; with `refine` also what draws pixels once more, which
    /// `prepare` makes. `smaller` is what the technique drew `source` for.
    pub(crate) fn new(
        gpu: &Gpu,
        source: &Arc<Image>,
        view: &View,
        smaller: &Canvas,
        refine: Option<f32>,
        prepare: impl FnOnce(&View, &Canvas) -> Result<Box<dyn Prepared>>,
    ) -> Result<Self> {
        let usage = vk::ImageUsageFlags::STORAGE | usage_after(gpu, &smaller.target, false);
        let desc = ImageDesc::flat(vk::Format::R32G32B32A32_SFLOAT, view.extent(), usage);
        let image = Arc::new(Image::new(gpu, "upsampling", &desc)?);
        let places = refine.map_or(0, |_| view.extent().map(u64::from).iter().product());
        let pixels = buffer(gpu, "redrawn", u64::from(PIXELS_FIRST) + places)?;
        let bound = UPSAMPLING_COMPUTE.with(&Inputs {
            source: source.sampled(vk::Filter::NEAREST),
            accumulation: image.stored(),
            pixels: pixels.write(),
            refines: refine.is_some(),
        });
        let [width, height, _] = source.desc().extent;
        let push = UpsamplingPush {
            half_extent: view.half_extent(),
            half_source: [width, height].map(|side| f32_of(0.5 * f64::from(side))),
            // Both images show the same height.
            scale: f32_of(f64::from(height) / f64::from(view.extent()[1])),
            inverse: f32_of(f64::from(view.extent()[1]) / f64::from(height)),
            refine: refine.unwrap_or(0.0),
            pad0: 0,
        };
        let refinement = match refine {
            Some(_) => {
                let redrawn = Redrawn { pixels, image: Arc::clone(&image) };
                Some(Refinement::new(gpu, redrawn, view, smaller, prepare)?)
            }
            None => None,
        };
        let squares = [width + 1, height + 1];
        Ok(Self { pass: pass(gpu, "upsampling", &bound)?, push, squares, image, refinement })
    }

    /// Returns whether another view of the same size fits what draws pixels once more.
    pub(crate) fn suits(&self, view: &View) -> Result<bool> {
        let Some(Refinement { prepared, most_passes, .. }) = &self.refinement else { return Ok(true) };
        prepared.suits(view, *most_passes)
    }

    /// Changes to another view, which [`Upsampling::suits`] has accepted.
    pub(crate) fn set_view(&mut self, view: &View) -> Result<()> {
        let Some(Refinement { bounds, prepared, most_passes, .. }) = &mut self.refinement else {
            return Ok(());
        };
        let fits = prepared.set_view(view, *most_passes)?;
        debug_assert!(fits, "the view was accepted");
        if let Some(bounds) = bounds {
            bounds.set_view(view);
        }
        Ok(())
    }

    /// The status of the pixels that are drawn once more.
    pub(crate) fn outcome(&self) -> Option<Arc<dyn Outcome>> {
        self.refinement.as_ref().map(|refinement| Arc::clone(&refinement.outcome) as Arc<dyn Outcome>)
    }

    /// Records the passes. `most` is the placeholder for the target in a dry run of the view with most passes.
    pub(crate) fn record(&self, recorder: &mut Recorder<'_>, most: Option<&TargetImage>) {
        let groups = tiles_of(self.squares);
        let Some(Refinement { redrawn, bounds, prepared, outcome, .. }) = &self.refinement else {
            return self.pass.record(recorder, &self.push, groups);
        };
        recorder.clear_start("redrawn.clear", &redrawn.pixels, 4 * u64::from(PIXELS_FIRST));
        self.pass.record(recorder, &self.push, groups);
        recorder.copy_buffer("redrawn.count", &redrawn.pixels, &outcome.head, outcome.head.size());
        recorder.release_to_host(&outcome.head);
        match (bounds, most) {
            (Some(bounds), Some(_)) => bounds.record_most(recorder, None),
            (Some(bounds), None) => bounds.record_planes(recorder),
            (None, _) => {}
        }
        match most {
            Some(target) => prepared.record_most(recorder, target),
            None => prepared.record(recorder, None, true),
        }
    }
}
