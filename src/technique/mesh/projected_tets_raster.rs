//! The raster route of `projected_tets`: cells as polygons, blended by fixed function.
//!
//! Outlines are made for each view (`glsl/projected-tets.glsl`). Fans around thick vertices (`glsl/tet-fans.glsl`) hold
//! for every view from one eye where they stand in space: then neither they nor ranks are made anew.

use std::sync::{Arc, Mutex, PoisonError};

use ash::vk;
use glam::DVec3;

use crate::error::{Error, Result};
use crate::frame::depth_measure::DepthMeasure;
use crate::frame::lists::Stage;
use crate::frame::prepared::{Outcome, Prepared};
use crate::frame::target::{Canvas, draws_directly, own_image};
use crate::gpu::shader::{
    BINDING_BOXES, BINDING_FANS, BINDING_KNOTS, BINDING_KNOTS_UNIFORM, BINDING_MESH_SCALARS, BINDING_ORDER,
    BINDING_POLYGONS, BINDING_PRIMITIVES, BINDING_RANK_KEYS, BINDING_TABLE, BINDING_TABLE_HEAD,
    BINDING_VIEW_POINTS, FAN_VERTICES, OUTLINE_VERTICES, PROJECTED_TETS_FRAGMENT, PROJECTED_TETS_OUTLINES,
    PROJECTED_TETS_VERTEX, SPEC_INTEGRATOR, SPEC_KNOT_WALK, SPEC_SHADED, SPEC_SPACE, STATUS_NAN_KEYS,
    STATUS_WORDS, TET_FANS_BUILD, TET_FANS_FRAGMENT, TET_FANS_SHADED_FRAGMENT, TET_FANS_SHADED_VERTEX,
    TET_FANS_VERTEX,
};
use crate::gpu::sync::Use;
use crate::gpu::{
    Attachment, Blend, Buffer, Descriptors, GraphicsDesc, Image, Pipeline, Recorder, Resource, TargetImage,
};
use crate::interface::{Fan, MeshPush};
use crate::num;
use crate::primitives::dispatch::{Dispatch, buffer, download, groups_of, pass, words};
use crate::resident::GpuScene;
use crate::resident::local_space::LocalSpace;
use crate::resident::tables::{Integrator, Table};
use crate::scene::{TetScalars, View};
use crate::technique::mesh::projected_tets_options::{Options, Plane, Shade};
use crate::technique::mesh::ranks::{Rank, Ranker};
use crate::technique::mesh::shading::{MeshDesc, constants, shading_push, stage};

/// What views must share for fans in space and ranks to serve them: the eye, or the direction of parallel rays.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Eye {
    perspective: bool,
    at: DVec3,
}

impl Eye {
    fn of(view: &View) -> Self {
        let perspective = view.is_perspective();
        Self { perspective, at: if perspective { view.camera().eye } else { view.forward() } }
    }
}

/// What is fixed between frames of one size.
#[derive(Debug)]
pub(crate) struct TetsRaster {
    name: &'static str,
    options: Options,
    frame: LocalSpace,
    push: MeshPush,
    stage: Stage,
    /// Makes polygons: outlines, or fans.
    polygons: Dispatch,
    pipeline: Arc<Pipeline>,
    descriptors: Arc<Descriptors>,
    /// Where the target is not drawn into directly.
    image: Option<Arc<Image>>,
    table: Option<Arc<Table>>,
    ranker: Ranker,
    /// The view that ranks on the host have been found for.
    ranked: View,
    /// Whether that was while it was prepared, so that the first frame need not find them again.
    fresh: bool,
    /// What fans and ranks on the device are for.
    built: Mutex<Option<(Eye, View)>>,
    view: View,
    outcome: Arc<RasterOutcome>,
}

/// What a frame tells of itself when it has ended.
#[derive(Debug)]
struct RasterOutcome {
    status: Arc<Buffer>,
    cells: u32,
    /// Whether the frame drew fans, and with ranks, of one before.
    reused: Mutex<[bool; 2]>,
}

impl Outcome for RasterOutcome {
    fn read(&self) -> Result<(bool, Vec<(&'static str, u64)>)> {
        let status = words(&self.status.host_copy()?);
        let nan = status.get(num::index(STATUS_NAN_KEYS)).copied().unwrap_or(0);
        let [fans, ranks] = *self.reused.lock().unwrap_or_else(PoisonError::into_inner);
        let counters = vec![
            ("primitives", u64::from(self.cells)),
            ("nan_keys", u64::from(nan)),
            ("fans_reused", u64::from(fans)),
            ("ranks_reused", u64::from(ranks)),
        ];
        Ok((true, counters))
    }
}

impl TetsRaster {
    pub(crate) fn new(
        scene: &Arc<GpuScene>,
        view: &View,
        target: &Canvas,
        desc: MeshDesc,
        options: &Options,
        ranker: Ranker,
        order: Option<&[u32]>,
    ) -> Result<Self> {
        let gpu = scene.gpu();
        let name = desc.name;
        let fans = options.has_fans();
        if options.shade == Shade::Vertex && target.bounds.is_some() {
            let missing = "colours of a cell's corners, which cannot be cut: shade=fragment works";
            return Err(Error::unsupported(
                format!("{name} shade=vertex with clipping, a depth image or opaque surfaces"),
                missing,
            ));
        }
        let frame = LocalSpace::of(scene.mesh()?);
        let knots = scene.knots()?;
        let table = scene.table(&desc.segments)?;
        let push = frame.push(view, &shading_push(scene, &desc, &knots)?)?;
        let stage = stage(scene, &scene.mesh_data(), &desc, order)?;

        // Every fragment that walks through knots loads them all. Between two scalars a table needs none.
        let between = matches!(scene.mesh()?.scalars(), TetScalars::Point(_));
        let searches = between && desc.segments.integrator == Integrator::Integral;
        let mut constants = constants(scene, &desc)?;
        constants.extend([
            (SPEC_KNOT_WALK, if searches { 0 } else { knots.walk }),
            (SPEC_INTEGRATOR, desc.segments.integrator.code()),
            (SPEC_SPACE, u32::from(options.plane == Plane::Space)),
            (SPEC_SHADED, u32::from(options.shade == Shade::Vertex)),
            target.bounded(),
        ]);
        let size = if fans { size_of::<Fan>() } else { size_of::<[[f32; 2]; 4]>() };
        let polygons = buffer(gpu, "polygons", num::wide(size / 4) * u64::from(stage.count))?;
        let binding = if fans { BINDING_FANS } else { BINDING_POLYGONS };
        let knots_buffer = || Resource::Buffer(Arc::clone(&knots.buffer));
        let head = table.as_ref().map_or_else(knots_buffer, |t| Resource::Buffer(Arc::clone(&t.buffer)));
        let texels = match &table {
            Some(table) => Arc::clone(&table.image),
            None => scene.no_table()?,
        };
        let shared = [
            (BINDING_KNOTS, knots_buffer()),
            (BINDING_KNOTS_UNIFORM, knots_buffer()),
            (BINDING_TABLE_HEAD, head),
            (BINDING_TABLE, Resource::Sampled(texels, vk::Filter::NEAREST)),
            (BINDING_PRIMITIVES, Resource::Buffer(Arc::clone(&stage.primitives))),
            (BINDING_MESH_SCALARS, Resource::Buffer(Arc::clone(&stage.scalars))),
            (BINDING_VIEW_POINTS, Resource::ReadOnly(Arc::clone(&stage.view_points))),
        ];
        let written = [
            (binding, Resource::Buffer(Arc::clone(&polygons))),
            (BINDING_BOXES, Resource::ReadOnly(Arc::clone(&stage.boxed))),
            (BINDING_RANK_KEYS, Resource::Buffer(Arc::clone(&stage.keys))),
            (BINDING_ORDER, Resource::Buffer(Arc::clone(&stage.order))),
        ];
        let read = [
            (binding, Resource::ReadOnly(polygons)),
            (BINDING_ORDER, Resource::ReadOnly(Arc::clone(&stage.order))),
        ];
        let (shader, part) =
            if fans { (&TET_FANS_BUILD, "fans") } else { (&PROJECTED_TETS_OUTLINES, "outlines") };
        let given: Vec<_> = shared.iter().cloned().chain(written).collect();
        let polygons = pass(gpu, &format!("{name}.{part}"), shader, &constants, &given)?;

        let format = vk::Format::R32G32B32A32_SFLOAT;
        let (vertex, fragment) = match (fans, options.shade) {
            (false, _) => (&PROJECTED_TETS_VERTEX, &PROJECTED_TETS_FRAGMENT),
            (true, Shade::Fragment) => (&TET_FANS_VERTEX, &TET_FANS_FRAGMENT),
            (true, Shade::Vertex) => (&TET_FANS_SHADED_VERTEX, &TET_FANS_SHADED_FRAGMENT),
        };
        let pipeline = gpu.graphics_pipeline(
            &format!("{name}.draw"),
            &GraphicsDesc {
                vertex,
                fragment,
                topology: vk::PrimitiveTopology::TRIANGLE_LIST,
                blend: if desc.back_to_front { Blend::Over } else { Blend::Under },
                format: Some(format),
                constants: &constants,
            },
        )?;
        let bounds = target.bounds(&knots.buffer);
        let given: Vec<_> = shared.iter().cloned().chain(read).chain(bounds).collect();
        let descriptors = Arc::new(Descriptors::new(gpu, &pipeline, &given)?);
        let image = if draws_directly(target, format, desc.back_to_front) {
            None
        } else {
            Some(own_image(gpu, name, format, vk::ImageUsageFlags::COLOR_ATTACHMENT, view, target)?)
        };
        Ok(Self {
            name,
            options: *options,
            frame,
            push,
            polygons,
            pipeline,
            descriptors,
            image,
            table,
            ranker,
            ranked: *view,
            fresh: true,
            built: Mutex::new(None),
            view: *view,
            outcome: Arc::new(RasterOutcome {
                status: download(gpu, "status", 4 * u64::from(STATUS_WORDS))?,
                cells: stage.count,
                reused: Mutex::new([false; 2]),
            }),
            stage,
        })
    }

    /// Whether fans, and ranks, of the frame before serve another view.
    fn serves(&self, built: Option<(Eye, View)>, view: &View) -> [bool; 2] {
        let same = self.options.plane == Plane::Space && built.is_some_and(|(eye, _)| eye == Eye::of(view));
        // Ranks on the host are those of a view; the device has those of the eye.
        let ranks = self.options.rank == Rank::Centroid || built.is_some_and(|(_, view)| view == self.ranked);
        [same, same && ranks]
    }

    /// Finds ranks on the host, unless those that are there serve.
    fn rank(&mut self, view: &View) -> Result<bool> {
        let prepared = std::mem::take(&mut self.fresh) && self.ranked == *view;
        let held = self.options.plane == Plane::Space
            && Eye::of(&self.ranked) == Eye::of(view)
            && (self.ranked == *view || self.ranker.serves_other_pixels()?);
        if prepared || held {
            return Ok(true);
        }
        let Some(order) = self.ranker.order(view)? else { return Ok(true) };
        let given = self.stage.give_order(&order);
        if given {
            self.ranked = *view;
        }
        Ok(given)
    }

    /// The image that is drawn into: the plan's own, or the caller's.
    fn attachment(&self, target: Option<&TargetImage>) -> Option<Attachment> {
        match &self.image {
            Some(image) => Some(Attachment::Own(Arc::clone(image))),
            None => target.map(|target| Attachment::Caller(*target)),
        }
    }

    /// Records a frame. `fans` and `ranks` say whether those of the frame before are drawn again.
    fn record_frame(
        &self,
        recorder: &mut Recorder<'_>,
        attachment: &Attachment,
        clear: bool,
        [fans, ranks]: [bool; 2],
    ) {
        if let Some(table) = &self.table {
            recorder.assume_ready(&table.image);
        }
        let push = MeshPush { count: self.stage.count, ..self.push };
        let groups = groups_of(self.stage.count, 64);
        self.stage.record_points(recorder, &push);
        // Fans in space rank what is beside the image too.
        if self.options.plane == Plane::Image {
            self.stage.record_boxes(recorder, &push);
            self.stage.record_order(recorder);
        }
        if !fans {
            self.polygons.record(recorder, &push, groups);
        }
        if self.options.plane == Plane::Space && !ranks {
            self.stage.record_order(recorder);
        }
        let vertices = if self.options.has_fans() { FAN_VERTICES } else { OUTLINE_VERTICES };
        recorder.draw(
            &format!("{}.draw", self.name),
            &self.pipeline,
            &self.descriptors,
            bytemuck::bytes_of(&push),
            attachment,
            clear || self.image.is_some(),
            vertices * self.stage.count,
            1,
        );
        recorder.copy_buffer("status", &self.stage.status, &self.outcome.status, self.outcome.status.size());
        recorder.release_to_host(&self.outcome.status);
    }
}

impl Prepared for TetsRaster {
    fn set_view(&mut self, view: &View, _most_passes: u32) -> Result<bool> {
        let push = self.frame.push(view, &self.push)?;
        let fits = self.rank(view)?;
        if fits {
            self.push = push;
            self.view = *view;
        }
        Ok(fits)
    }

    fn measure(&self) -> DepthMeasure {
        DepthMeasure::of_frame(&self.frame)
    }

    fn image(&self) -> Option<&Arc<Image>> {
        self.image.as_ref()
    }

    fn last_use(&self) -> Use {
        Use::ColorAttachment
    }

    fn route(&self) -> &'static str {
        "raster"
    }

    fn counters(&self) -> Vec<(&'static str, u64)> {
        let mut counters = vec![("cells_seen", u64::from(self.stage.count))];
        counters.extend_from_slice(self.ranker.counters());
        counters
    }

    fn record(&self, recorder: &mut Recorder<'_>, target: Option<&TargetImage>, clear: bool) {
        let Some(attachment) = self.attachment(target) else { return };
        // What a recording makes is there for the next: a plan has one in flight.
        let mut built = self.built.lock().unwrap_or_else(PoisonError::into_inner);
        let [fans, ranks] = self.serves(*built, &self.view);
        *built = Some((Eye::of(&self.view), self.ranked));
        *self.outcome.reused.lock().unwrap_or_else(PoisonError::into_inner) = [fans, ranks];
        self.record_frame(recorder, &attachment, clear, [fans, ranks]);
    }

    fn record_most(&self, recorder: &mut Recorder<'_>, target: &TargetImage) {
        if let Some(attachment) = self.attachment(Some(target)) {
            self.record_frame(recorder, &attachment, true, [false; 2]);
        }
    }

    fn outcome(&self) -> Option<Arc<dyn Outcome>> {
        Some(Arc::clone(&self.outcome) as _)
    }
}
