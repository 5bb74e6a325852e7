//! A frame of `shear-warp`: composites base planes into the intermediate image, and warps it to the image.

use std::sync::Arc;

use crate::error::Result;
use crate::frame::depth_measure::DepthMeasure;
use crate::frame::dry_run::{draws, dry_run, passes};
use crate::frame::prepared::{Outcome, Prepared};
use crate::frame::target::Canvas;
use crate::gpu::{Attachment, Buffer, Descriptors, Image, Pipeline, Recorder, TargetImage};
use crate::interface::{BasePlanePush, ShearBoundsPush, WarpPush};
use crate::num::{self, f32_of};
use crate::primitives::dispatch::tiles_of;
use crate::resident::GpuScene;
use crate::resident::tables::Knots;
use crate::resident::volume::Volume;
use crate::scene::View;
use crate::technique::declare::Value as _;
use crate::technique::declare::draw::Draw;
use crate::technique::declare::{BlendOrder, Route};
use crate::technique::grid::paging::Paging;
use crate::technique::shear_warp::bounds::ShearBounds;
use crate::technique::shear_warp::march::{EdgeMarch, March};
use crate::technique::shear_warp::options::{NAME, Options};
use crate::technique::shear_warp::planes::{DrawnPlane, DrawnPlanes, TEXEL, choose_planes};

/// A bit of `BasePlanePush::order`: raster draws the farthest slab first.
const BACK_TO_FRONT: u32 = crate::gpu::shader::PLANE_BACK_TO_FRONT;

/// A stack of slices on the device with the descriptors that name it.
#[derive(Debug)]
pub(super) struct Stack {
    pub(super) axis: usize,
    pub(super) volume: Arc<Volume>,
    pub(super) descriptors: Arc<Descriptors>,
}

/// Everything that is fixed between frames of one size.
#[derive(Debug)]
pub(crate) struct ShearFrame {
    pub(super) scene: Arc<GpuScene>,
    pub(super) measure: DepthMeasure,
    pub(super) options: Options,
    pub(super) knots: Arc<Knots>,
    pub(super) stacks: Vec<Stack>,
    pub(super) path: Path,
    /// Where rays are bounded: the bounds of texels, and the march of single pixels.
    pub(super) bounded: Option<(ShearBounds, EdgeMarch)>,
    /// Texels of the intermediate image, the levels of each base plane one after the other.
    pub(super) intermediate: Arc<Buffer>,
    pub(super) image: Option<Arc<Image>>,
    /// Averages each level of the intermediate image to the next smaller one.
    pub(super) halve: Option<(Arc<Pipeline>, Arc<Descriptors>)>,
    pub(super) warp: (Arc<Pipeline>, Arc<Descriptors>),
    pub(super) drawn: DrawnPlanes,
    /// The base planes with the most passes that another view may have.
    pub(super) most: DrawnPlanes,
    /// Of a grid that is kept in pages.
    pub(super) paging: Option<Paging>,
}

/// How base planes are composited.
#[derive(Debug)]
pub(super) enum Path {
    /// Each texel marches through the slabs.
    Compute(March),
    /// Each slab is drawn as a quad and blended.
    Raster {
        pipeline: Arc<Pipeline>,
        /// All base planes, one below the other.
        atlas: Arc<Image>,
    },
}

impl Draw for Options {
    fn prepare(&self, scene: &Arc<GpuScene>, view: &View, target: &Canvas) -> Result<Box<dyn Prepared>> {
        Ok(Box::new(ShearFrame::new(scene, view, target, *self)?))
    }
}

impl Prepared for ShearFrame {
    fn set_view(&mut self, view: &View, most_passes: u32) -> Result<bool> {
        let gpu = self.scene.gpu().clone();
        let grid = self.scene.grid()?;
        let raster = matches!(self.path, Path::Raster { .. });
        let chosen = choose_planes(&gpu, grid, &self.options, view, self.drawn.axis, raster)?;
        let axes: Vec<usize> = self.stacks.iter().map(|stack| stack.axis).collect();
        if !chosen.axes.iter().all(|axis| axes.contains(axis)) {
            return Ok(false);
        }
        let Some(Stack { volume, .. }) = self.stacks.first() else { return Ok(false) };
        let drawn =
            DrawnPlanes::of(&self.scene, &self.options, &chosen, &axes, volume, &self.knots, view, raster)?;
        let splits = match &self.path {
            Path::Compute(march) => {
                self.paging.is_some()
                    || march.resume.is_some()
                    || drawn.planes.iter().all(|plane| march.parts(plane.slabs) == 1)
            }
            Path::Raster { .. } => true,
        };
        let holds = match &self.path {
            Path::Compute(_) => u64::from(drawn.texels) * TEXEL <= self.intermediate.size(),
            Path::Raster { atlas, .. } => {
                let [columns, rows, _] = atlas.desc().extent;
                let texels = u64::from(columns) * u64::from(rows) + u64::from(drawn.texels);
                drawn.atlas[0] <= columns
                    && drawn.atlas[1] <= rows
                    && texels * TEXEL <= self.intermediate.size()
            }
        };
        let steps = || dry_run(&gpu, |to, target| self.record_planes(to, &drawn, Some(target), true));
        let fits = splits && holds && passes(&steps()) <= most_passes;
        if fits {
            self.drawn = drawn;
            if let Some(paging) = &mut self.paging {
                paging.set_view(&self.scene, view)?;
            }
        }
        Ok(fits)
    }

    fn load(&mut self) -> Result<bool> {
        let mut copies: Vec<u32> =
            self.drawn.planes.iter().map(|plane| num::count(self.stacks[plane.stack].axis)).collect();
        copies.sort_unstable();
        copies.dedup();
        self.paging.as_ref().map_or(Ok(false), |paging| paging.load(&copies))
    }

    fn resumes(&self) -> bool {
        self.paging.as_ref().is_some_and(Paging::resumes)
    }

    fn outcome(&self) -> Option<Arc<dyn Outcome>> {
        self.paging.as_ref().map(Paging::outcome)
    }

    fn measure(&self) -> DepthMeasure {
        self.measure
    }

    fn image(&self) -> Option<&Arc<Image>> {
        self.image.as_ref()
    }

    fn route(&self) -> &'static str {
        match self.path {
            Path::Raster { .. } => Route::Raster.word(),
            Path::Compute(_) => Route::Compute.word(),
        }
    }

    fn hit_depths(&self) -> std::result::Result<(), &'static str> {
        Err("rays of base planes are not those of pixels: slices-2d tells them")
    }

    fn counts(&self) -> bool {
        matches!(self.path, Path::Compute(_))
    }

    fn counters(&self) -> Vec<(&'static str, u64)> {
        let drawn = &self.drawn;
        let steps = dry_run(self.scene.gpu(), |recorder, target| self.record(recorder, Some(target), true));
        let draws = draws(&steps);
        let texels = |plane: &DrawnPlane| u64::from(plane.push.size[0]) * u64::from(plane.push.size[1]);
        let mut counters = vec![
            ("slices", drawn.planes.iter().map(|plane| u64::from(plane.slabs)).sum()),
            ("base_planes", num::wide(drawn.planes.len())),
            ("intermediate_texels", drawn.planes.iter().map(texels).sum()),
            ("dispatches_or_draws", draws.into()),
        ];
        counters.extend(self.stacks.first().map(|stack| ("voxel_bytes", stack.volume.voxel_bytes())));
        counters.extend(drawn.axis.map(|axis| ("stack_axis", u64::from(num::count(axis)))));
        counters
    }

    fn record(&self, recorder: &mut Recorder<'_>, target: Option<&TargetImage>, clear: bool) {
        self.record_planes(recorder, &self.drawn, target, clear);
    }

    fn record_most(&self, recorder: &mut Recorder<'_>, target: &TargetImage) {
        self.record_planes(recorder, &self.most, Some(target), true);
    }
}

impl ShearFrame {
    /// Records the compositing of base planes, and their warp.
    fn record_planes(
        &self,
        recorder: &mut Recorder<'_>,
        drawn: &DrawnPlanes,
        target: Option<&TargetImage>,
        clear: bool,
    ) {
        if let Some((bounds, _)) = &self.bounded {
            for plane in &drawn.planes {
                bounds.record_texels(recorder, &self.placed_bounds(plane));
            }
        }
        match &self.path {
            Path::Compute(march) => {
                let name = format!("{NAME}.march");
                let resumes = self.paging.as_ref().map(|paging| paging.record_begin(recorder, NAME));
                for plane in &drawn.planes {
                    let descriptors = &self.stacks[plane.stack].descriptors;
                    let groups = tiles_of(plane.push.size);
                    match resumes {
                        Some(resumes) => march.record_paged(recorder, &name, plane, descriptors, resumes),
                        None => march.record(recorder, &name, plane, descriptors, groups),
                    }
                }
                if let Some(paging) = &self.paging {
                    paging.record_end(recorder, NAME);
                }
            }
            Path::Raster { pipeline, atlas } => {
                let [columns, rows, _] = atlas.desc().extent;
                let back_to_front = self.options.grid.order() == BlendOrder::BackToFront;
                for (i, plane) in drawn.planes.iter().enumerate() {
                    let order = plane.push.order | if back_to_front { BACK_TO_FRONT } else { 0 };
                    let push = BasePlanePush { order, atlas: [columns, rows], ..plane.push };
                    recorder.draw(
                        &format!("{NAME}.draw"),
                        pipeline,
                        &self.stacks[plane.stack].descriptors,
                        bytemuck::bytes_of(&push),
                        &Attachment::Own(Arc::clone(atlas)),
                        i == 0,
                        4,
                        plane.slabs,
                    );
                }
                if !drawn.planes.is_empty() {
                    recorder.copy_image_to_buffer(&format!("{NAME}.copy"), atlas, &self.intermediate);
                }
            }
        }
        self.record_warp(recorder, drawn, target, clear);
    }

    /// Places a level in the intermediate buffer. With raster the first levels lie there as in the atlas, and smaller levels follow it.
    fn placed(&self, push: &WarpPush, first: bool) -> WarpPush {
        let Path::Raster { atlas, .. } = &self.path else { return *push };
        let [columns, rows, _] = atlas.desc().extent;
        let mut placed = *push;
        placed.to_w[3] = f32::from_bits(push.to_w[3].to_bits() + columns * rows);
        if first {
            (placed.offset, placed.stride) = (push.offset * columns, columns);
        } else {
            placed.offset += columns * rows;
        }
        placed
    }

    /// Places the bounds of texels as the texels themselves.
    fn placed_bounds(&self, plane: &DrawnPlane) -> ShearBoundsPush {
        let Path::Raster { atlas, .. } = &self.path else { return plane.bounds };
        let [columns, ..] = atlas.desc().extent;
        ShearBoundsPush { offset: plane.bounds.offset * columns, stride: columns, ..plane.bounds }
    }

    /// Records the march of single pixels, after the warp of a base plane.
    fn record_edges(&self, recorder: &mut Recorder<'_>, plane: &DrawnPlane, extent: [u32; 2]) {
        let Some((bounds, edge)) = &self.bounded else { return };
        bounds.record_edges(recorder, &self.placed_bounds(plane), extent);
        // Without slabs there is nothing to march, and the result of the warp stays.
        if let Some(descriptors) = edge.descriptors.get(plane.stack).filter(|_| plane.slabs > 0) {
            edge.march.record(recorder, &format!("{NAME}.edge"), plane, descriptors, tiles_of(extent));
        }
    }

    /// Records the smaller levels of the intermediate image, and the warp of each base plane to the image.
    fn record_warp(
        &self,
        recorder: &mut Recorder<'_>,
        drawn: &DrawnPlanes,
        target: Option<&TargetImage>,
        clear: bool,
    ) {
        if let Some((pipeline, descriptors)) = &self.halve {
            for plane in &drawn.planes {
                for (level, half) in plane.halves.iter().enumerate() {
                    let [w, h] = half.size;
                    let push = self.placed(half, level == 0);
                    recorder.dispatch(
                        &format!("{NAME}.halve"),
                        pipeline,
                        descriptors,
                        bytemuck::bytes_of(&push),
                        tiles_of([w.div_ceil(2), h.div_ceil(2)]),
                    );
                }
            }
        }
        // A view without base planes sees nothing: a warp of nothing clears the image.
        let [width, height] = match (&self.image, target) {
            (Some(image), _) => [image.desc().extent[0], image.desc().extent[1]],
            (None, Some(target)) => target.extent,
            (None, None) => return,
        };
        let mut pushes: Vec<WarpPush> =
            drawn.planes.iter().map(|plane| self.placed(&plane.warp, true)).collect();
        if pushes.is_empty() {
            let half_extent = [width, height].map(|side| f32_of(f64::from(side) * 0.5));
            pushes.push(WarpPush { half_extent, levels: 1, ..WarpPush::default() });
        }
        for (i, push) in pushes.iter().enumerate() {
            let name = format!("{NAME}.warp");
            let bytes = bytemuck::bytes_of(push);
            let (pipeline, descriptors) = &self.warp;
            if self.bounded.is_some() || matches!(self.path, Path::Compute(_)) {
                let groups = tiles_of([width, height]);
                recorder.dispatch(&name, pipeline, descriptors, bytes, groups);
                if let Some(plane) = drawn.planes.get(i) {
                    self.record_edges(recorder, plane, [width, height]);
                }
                continue;
            }
            let attachment = match (&self.image, target) {
                (Some(image), _) => Attachment::Own(Arc::clone(image)),
                (None, Some(target)) => Attachment::Caller(*target),
                (None, None) => return,
            };
            let clear = i == 0 && (clear || self.image.is_some());
            recorder.draw(&name, pipeline, descriptors, bytes, &attachment, clear, 4, 1);
        }
    }
}

#[cfg(test)]
mod tests;
