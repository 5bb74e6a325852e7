//! A frame of a grid: the resources that all techniques for grids share, and how it is recorded.
//!
//! A technique says how it cuts the domain into slabs and which shaders draw them ([`GridTechnique`]); the route
//! (`grid/route.rs`) follows from the options and the device.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::frame::depth_measure::DepthMeasure;
use crate::frame::dry_run::{draws, dry_run, passes};
use crate::frame::prepared::{Outcome, Prepared};
use crate::frame::target::Canvas;
use crate::gpu::shader::{MARCH_CONTINUES, MARCH_WIDE, RASTER_BACK_TO_FRONT, RASTER_FIRST_SHIFT};
use crate::gpu::{Attachment, Image, Recorder, TargetImage};
use crate::interface::GridPush;
use crate::num;
use crate::resident::GpuScene;
use crate::resident::tables::{Integrator, Knots, SegmentOptions};
use crate::resident::volume::{Form, Layout, Volume};
use crate::scene::{Mode, View};
use crate::technique::declare::Value as _;
use crate::technique::declare::draw::{Draw, TechniqueOptions};
use crate::technique::declare::{BlendOrder, Route, refused};
use crate::technique::grid::cut::{Cut, cut};
use crate::technique::grid::options::{Filter, Prefilter};
use crate::technique::grid::paging::Paging;
use crate::technique::grid::route::{Path, RouteDesc, Routed, Samples};
use crate::technique::grid::technique::GridTechnique;

/// `GridPush::order` of the raster route: where front-to-back order begins, and the direction of blending.
fn raster_order(first: u32, order: BlendOrder) -> u32 {
    first << RASTER_FIRST_SHIFT | if order == BlendOrder::BackToFront { RASTER_BACK_TO_FRONT } else { 0 }
}

/// `GridPush::order` of the compute route: the stack's axis in its two lowest bits, and whether another dispatch follows.
fn march_order(axis: Option<usize>, more: bool) -> u32 {
    axis.map_or(2, num::count) | if more { MARCH_CONTINUES } else { 0 }
}

/// Everything that is fixed between frames of one size.
#[derive(Debug)]
pub(crate) struct GridFrame {
    name: &'static str,
    scene: Arc<GpuScene>,
    measure: DepthMeasure,
    technique: Box<dyn GridTechnique>,
    knots: Arc<Knots>,
    image: Option<Arc<Image>>,
    samples: Vec<Samples>,
    /// Index of the samples that are drawn.
    current: usize,
    cut: Cut,
    path: Path,
    /// Of a grid that is kept in pages.
    paging: Option<Paging>,
}

/// Refuses what does not draw a grid in pages.
fn check_paged(name: &str, technique: &dyn GridTechnique, route: Route, target: &Canvas) -> Result<()> {
    let (what, instead) = if route == Route::Raster {
        ("route=raster", "route=compute")
    } else if technique.tolerance().is_some() {
        ("tolerance", "step")
    } else if technique.options().prefilter == Prefilter::Mip {
        ("prefilter=mip", "prefilter=none")
    } else if target.redrawn.is_some() {
        ("refine", "resolution=full")
    } else {
        return Ok(());
    };
    Err(Paging::refused(name, what, instead))
}

/// The samples that a frame reads: the whole volume, or the stack of the view, and all stacks where the technique keeps them; or the pool of
/// pages of a form.
fn volumes(
    scene: &GpuScene,
    technique: &dyn GridTechnique,
    axis: Option<usize>,
    pages: Option<Form>,
) -> Result<Vec<(Option<usize>, Arc<Volume>)>> {
    let all = |axis: usize| [axis, axis + 1, axis + 2].map(|a| Some(a % 3)).to_vec();
    // A pool serves every axis.
    let axes: Vec<Option<usize>> = match axis {
        Some(axis) if technique.keeps_all_stacks() || pages.is_some() => all(axis),
        axis => vec![axis],
    };
    let [hardware, mip] = reads(technique);
    let volume = |axis: Option<usize>| match pages {
        Some(form) => Ok((axis, Arc::clone(&scene.page_pool(form)?.volume))),
        None => Ok((axis, scene.volume(axis.map_or(Layout::Volume, Layout::Stack), hardware, mip)?)),
    };
    axes.into_iter().map(volume).collect()
}

/// Returns whether a technique reads samples through the sampler's filter, and mip levels.
fn reads(technique: &dyn GridTechnique) -> [bool; 2] {
    let options = technique.options();
    [options.filter == Filter::Hardware, options.prefilter == Prefilter::Mip]
}

impl<T: GridTechnique + TechniqueOptions + 'static> Draw for T {
    fn prepare(&self, scene: &Arc<GpuScene>, view: &View, target: &Canvas) -> Result<Box<dyn Prepared>> {
        Ok(Box::new(GridFrame::new(scene, view, target, T::NAME, Box::new(*self))?))
    }
}

impl GridFrame {
    /// Fixes everything that frames of one size need.
    pub(crate) fn new(
        scene: &Arc<GpuScene>,
        view: &View,
        target: &Canvas,
        name: &'static str,
        technique: Box<dyn GridTechnique>,
    ) -> Result<Self> {
        let options = *technique.options();
        let grid = scene.grid()?;
        let route = options.route_on(scene.gpu(), name)?;
        if route == Route::Raster {
            target.refuse_layers(&format!("{name} route=raster"), "route=compute")?;
        }
        let full = |segments: SegmentOptions| segments.integrator == Integrator::Full;
        if matches!(scene.scene().mode, Mode::Lit(_)) && technique.segments().is_some_and(full) {
            let why = "full: its table does not tell where a lit segment emits; integral and exact do";
            return Err(refused(name, "integrator", why));
        }
        if route == Route::Raster && target.owned.is_some() {
            let why = "none where a box owns pieces of rays: set compute";
            return Err(refused(name, "route", why));
        }
        let has_nan = grid.nan_count() > 0;
        if has_nan && options.prefilter == Prefilter::Mip {
            return Err(Error::unsupported(
                format!("{name} prefilter=mip"),
                "a grid without NaN: a mean with NaN is none",
            ));
        }
        let axis = technique.stack_axis(grid, view, None);
        let [hardware, mip] = reads(technique.as_ref());
        let layout = axis.map_or(Layout::Volume, Layout::Stack);
        let pages = scene.pages_of(layout, hardware, mip)?;
        if pages.is_some() {
            check_paged(name, technique.as_ref(), route, target)?;
        }
        let volumes = volumes(scene, technique.as_ref(), axis, pages)?;
        let Some((_, volume)) = volumes.first() else { return Err(Error::invalid(name, "no volume")) };
        let pixels = view.extent().map(u64::from).iter().product();
        let margin =
            (scene.scene().mode != Mode::Maximum).then(|| scene.margin(technique.segments().as_ref()));
        let paging = pages
            .map(|form| Paging::new(scene, name, form, margin, view, pixels, !target.sampled))
            .transpose()?;
        let knots = scene.knots()?;
        let cut = cut(name, scene, technique.as_ref(), volume, &knots, view, axis)?;
        let desc = RouteDesc {
            name,
            scene,
            technique: technique.as_ref(),
            volumes: &volumes,
            paging: paging.as_ref(),
            knots: &knots,
            view,
            target,
        };
        let Routed { path, samples, image } = match route {
            Route::Compute => desc.march(cut.count)?,
            _ => desc.raster()?,
        };
        let measure = DepthMeasure::of_grid(grid);
        let scene = Arc::clone(scene);
        Ok(Self { name, scene, measure, technique, knots, image, samples, current: 0, cut, path, paging })
    }

    /// Records the slabs of a view.
    fn record_cut(
        &self,
        recorder: &mut Recorder<'_>,
        samples: &Samples,
        cut: &Cut,
        target: Option<&TargetImage>,
        clear: bool,
    ) {
        let name = self.name;
        let options = self.technique.options();
        let descriptors = &samples.descriptors;
        let count = cut.count;
        let mut push = cut.push;
        match &self.path {
            Path::Raster { pipeline, vertices } => {
                let attachment = match (&self.image, target) {
                    (Some(image), _) => Attachment::Own(Arc::clone(image)),
                    (None, Some(target)) => Attachment::Caller(*target),
                    (None, None) => return,
                };
                push.order = raster_order(cut.first, options.order());
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
                    let i = if options.order() == BlendOrder::FrontToBack { i } else { count - 1 - i };
                    let upwards = count - cut.first;
                    let slab = if i < upwards { cut.first + i } else { count - 1 - i };
                    bytemuck::bytes_of(&GridPush { first: slab, count: 1, order: 0, ..push }).to_vec()
                });
                let pushes = pushes.collect();
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
            Path::Compute { tiles, steps, first, resume, slabs_per_dispatch, groups, redraws } => {
                let resumes = self.paging.as_ref().is_some_and(|paging| paging.record_begin(recorder, name));
                match tiles {
                    // Pixels go on within the tiles that the image began with.
                    Some(tiles) if resumes => tiles.keep(recorder),
                    Some(tiles) => {
                        push.order = march_order(samples.axis, false) | if cut.wide { MARCH_WIDE } else { 0 };
                        tiles.record(recorder, name, &push);
                    }
                    None => {}
                }
                if let Some(steps) = steps {
                    push.order = march_order(samples.axis, false);
                    steps.record(recorder, push);
                }
                if let Some(paging) = &self.paging {
                    push.seed = *slabs_per_dispatch;
                    for part in 0..count.div_ceil(*slabs_per_dispatch).max(1) {
                        push.order = march_order(samples.axis, false) | Paging::march_order(resumes, part);
                        paging.record_dispatch(recorder, name);
                        let push = bytemuck::bytes_of(&push);
                        recorder.dispatch(&format!("{name}.march"), first, descriptors, push, groups.clone());
                    }
                    paging.record_end(recorder, name);
                    return;
                }
                let mut begin = 0;
                loop {
                    push.first = begin;
                    push.count = (count - begin).min(*slabs_per_dispatch);
                    push.order = march_order(samples.axis, begin + push.count < count);
                    let pipeline = resume.as_ref().filter(|_| begin > 0).unwrap_or(first);
                    let pass = format!("{name}.{}", if *redraws { "redraw" } else { "march" });
                    recorder.dispatch(
                        &pass,
                        pipeline,
                        descriptors,
                        bytemuck::bytes_of(&push),
                        groups.clone(),
                    );
                    begin += push.count;
                    if begin >= count {
                        break;
                    }
                }
            }
        }
    }
}

impl GridFrame {
    /// Returns the cut of a view and the place of its samples, if the frame can draw it with so many passes.
    fn cut_of(&self, view: &View, most_passes: u32) -> Result<Option<(Cut, usize)>> {
        let grid = self.scene.grid()?;
        let in_use = self.samples.get(self.current).and_then(|samples| samples.axis);
        let axis = self.technique.stack_axis(grid, view, in_use);
        let Some(place) = self.samples.iter().position(|samples| samples.axis == axis) else {
            return Ok(None);
        };
        let volume = &self.samples[place].volume;
        let cut = cut(self.name, &self.scene, self.technique.as_ref(), volume, &self.knots, view, axis)?;
        let steps = dry_run(self.scene.gpu(), |recorder, target| {
            self.record_cut(recorder, &self.samples[place], &cut, Some(target), true);
        });
        let passes = passes(&steps);
        // A march that did not need to resume cannot.
        let marches = match &self.path {
            Path::Compute { resume: None, slabs_per_dispatch, .. } if self.paging.is_none() => {
                cut.count <= *slabs_per_dispatch
            }
            _ => true,
        };
        let fits = passes <= most_passes && marches;
        Ok(fits.then_some((cut, place)))
    }
}

impl Prepared for GridFrame {
    fn set_view(&mut self, view: &View, most_passes: u32) -> Result<bool> {
        let Some((cut, place)) = self.cut_of(view, most_passes)? else { return Ok(false) };
        (self.cut, self.current) = (cut, place);
        if let Some(paging) = &mut self.paging {
            paging.set_view(&self.scene, view)?;
        }
        Ok(true)
    }

    fn load(&mut self) -> Result<bool> {
        // A stack has a copy of the pages for each axis.
        let copy = self.samples.get(self.current).and_then(|samples| samples.axis).map_or(0, num::count);
        self.paging.as_ref().map_or(Ok(false), |paging| paging.load(&[copy]))
    }

    fn resumes(&self) -> bool {
        self.paging.as_ref().is_some_and(Paging::resumes)
    }

    fn outcome(&self) -> Option<Arc<dyn Outcome>> {
        self.paging.as_ref().map(Paging::outcome)
    }

    fn suits(&self, view: &View, most_passes: u32) -> Result<bool> {
        Ok(self.cut_of(view, most_passes)?.is_some())
    }

    fn measure(&self) -> DepthMeasure {
        self.measure
    }

    fn image(&self) -> Option<&Arc<Image>> {
        self.image.as_ref()
    }

    fn route(&self) -> &'static str {
        match self.path {
            Path::Raster { .. } | Path::ShaderBlend { .. } => Route::Raster.word(),
            Path::Compute { .. } => Route::Compute.word(),
        }
    }

    fn counts(&self) -> bool {
        matches!(self.path, Path::Compute { .. })
    }

    fn hit_depths(&self) -> std::result::Result<(), &'static str> {
        match self.path {
            _ if self.scene.scene().mode == Mode::Maximum => Err("maximum intensity projection has none"),
            Path::Compute { .. } => Ok(()),
            Path::Raster { .. } | Path::ShaderBlend { .. } => Err("route=compute tells them"),
        }
    }

    fn counters(&self) -> Vec<(&'static str, u64)> {
        let steps = dry_run(self.scene.gpu(), |recorder, target| self.record(recorder, Some(target), true));
        let draws = draws(&steps);
        let mut counters =
            vec![("slices", u64::from(self.cut.count)), ("dispatches_or_draws", u64::from(draws))];
        let samples = self.samples.get(self.current);
        counters.extend(samples.map(|samples| ("voxel_bytes", samples.volume.voxel_bytes())));
        let axis = samples.and_then(|samples| samples.axis);
        counters.extend(axis.map(|axis| ("stack_axis", u64::from(num::count(axis)))));
        counters
    }

    fn record(&self, recorder: &mut Recorder<'_>, target: Option<&TargetImage>, clear: bool) {
        if let Some(samples) = self.samples.get(self.current) {
            self.record_cut(recorder, samples, &self.cut, target, clear);
        }
    }
}
