//! The raster route of `projected-tets`: cells are polygons that fixed function blends.
//!
//! Outlines are made for each view (`projected-tets.glsl`). Fans around thick vertices (`tet-fans.glsl`) serve every view
//! from one eye if they are made in space; then frames reuse the fans and the ranks of the frame before.

use std::sync::{Arc, Mutex, PoisonError};

use ash::vk;
use glam::DVec3;

use crate::error::{Error, Result};
use crate::frame::depth_measure::DepthMeasure;
use crate::frame::lists::Ranking;
use crate::frame::prepared::{Outcome, Prepared};
use crate::frame::target::{Canvas, draws_directly, own_image};
use crate::gpu::shader::{
    FAN_VERTICES, OUTLINE_VERTICES, PROJECTED_TETS_FRAGMENT, PROJECTED_TETS_OUTLINES, PROJECTED_TETS_VERTEX,
    ProjectedTetsFragment, ProjectedTetsOutlines, ProjectedTetsVertex, STATUS_NAN_KEYS, STATUS_WORDS,
    TET_FANS_BUILD, TET_FANS_FRAGMENT, TET_FANS_SHADED_FRAGMENT, TET_FANS_SHADED_VERTEX, TET_FANS_VERTEX,
    TetFansBuild, TetFansFragment, TetFansShadedFragment, TetFansShadedVertex, TetFansVertex,
};
use crate::gpu::sync::Use;
use crate::gpu::{
    Attachment, Blend, Bound, Buffer, Descriptors, GraphicsState, Image, Pipeline, Recorder, TargetImage,
};
use crate::interface::{Fan, MeshPush};
use crate::num;
use crate::primitives::dispatch::{Dispatch, buffer, download, groups_of, pass, words};
use crate::resident::GpuScene;
use crate::resident::local_space::LocalSpace;
use crate::resident::tables::Integrator;
use crate::scene::View;
use crate::technique::declare::Route;
use crate::technique::mesh::desc::MeshDesc;
use crate::technique::mesh::list_inputs::Shading;
use crate::technique::mesh::projected_tets::options::{Options, Plane, Shade};
use crate::technique::mesh::projected_tets::ranks::{Rank, Ranker};
use crate::technique::mesh::shading::shading_push;

/// The format of the accumulation image.
const FORMAT: vk::Format = vk::Format::R32G32B32A32_SFLOAT;

/// The eye, or the direction of parallel rays: views that share it can share fans in space and ranks.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Eye {
    perspective: bool,
    at: DVec3,
    /// Fans of a mirrored view turn the other way round.
    mirrored: bool,
}

impl Eye {
    fn of(view: &View) -> Self {
        let perspective = view.is_perspective();
        Self {
            perspective,
            at: if perspective { view.camera().eye } else { view.forward() },
            mirrored: view.shape().0 < 0.0,
        }
    }
}

/// Everything that is fixed between frames of one size.
#[derive(Debug)]
pub(crate) struct TetsRaster {
    name: &'static str,
    options: Options,
    space: LocalSpace,
    push: MeshPush,
    ranking: Ranking,
    /// Makes polygons: outlines, or fans.
    polygons: Dispatch,
    /// What that pass writes: outlines or fans.
    fans: Arc<Buffer>,
    pipeline: Arc<Pipeline>,
    descriptors: Arc<Descriptors>,
    /// The image that is drawn into; `None` where it is the target.
    image: Option<Arc<Image>>,
    ranker: Ranker,
    /// The view whose ranks the host found last.
    ranked: View,
    /// Whether these ranks were found by `prepare`, and no frame has used them yet.
    fresh: bool,
    view: View,
    outcome: Arc<RasterOutcome>,
}

/// The status of a frame, and what it reused.
#[derive(Debug)]
struct RasterOutcome {
    status: Arc<Buffer>,
    cells: u32,
    built: Mutex<Built>,
}

/// Fans and ranks that frames leave for those after them.
#[derive(Debug, Default)]
struct Built {
    /// The eye of the fans and the view of the ranks that are on the device, once the frame has ended that made them or used them last.
    known: Option<(Eye, View)>,
    /// Those of the frame that is recorded, which may never run.
    recorded: Option<(Eye, View)>,
    /// Whether that reuses the fans, and the ranks.
    reused: [bool; 2],
}

impl Outcome for RasterOutcome {
    fn read(&self) -> Result<(bool, Vec<(&'static str, u64)>)> {
        let status = words(&self.status.host_copy()?);
        let nan = status.get(num::index(STATUS_NAN_KEYS)).copied().unwrap_or(0);
        let mut built = self.built.lock().unwrap_or_else(PoisonError::into_inner);
        built.known = built.recorded.take();
        let [fans, ranks] = built.reused;
        let counters = vec![
            ("primitives", u64::from(self.cells)),
            ("nan_keys", u64::from(nan)),
            ("fans_reused", u64::from(fans)),
            ("ranks_reused", u64::from(ranks)),
        ];
        Ok((true, counters))
    }
}

/// Refuses `shade=vertex` where something bounds rays.
fn check_shade(name: &str, options: &Options, target: &Canvas) -> Result<()> {
    if options.shade != Shade::Vertex || target.bounds.is_none() {
        return Ok(());
    }
    Err(Error::unsupported(
        format!("{name} shade=vertex with clipping, a depth image or opaque surfaces"),
        "colours of a cell's corners, which cannot be cut: shade=fragment works",
    ))
}

/// The shaders of the route, with what they share.
struct Shaders<'a> {
    ranking: &'a Ranking,
    polygons: &'a Arc<Buffer>,
    shading: &'a Shading,
    /// Whether fans lie in space.
    space: bool,
    back_to_front: bool,
}

impl Shaders<'_> {
    /// Binds the shader that makes fans, with colours at the vertices if `shaded`.
    fn fans(&self, shaded: bool) -> Bound {
        let Self { ranking, shading, .. } = *self;
        TET_FANS_BUILD.with(&TetFansBuild {
            fans: self.polygons.write(),
            mesh_scalars: ranking.scalars.read(),
            order: ranking.order.write(),
            primitives: ranking.primitives.read(),
            rank_keys: ranking.keys.write(),
            view_points: ranking.view_points.read(),
            back_to_front: self.back_to_front,
            cell_scalars: ranking.cell_scalars,
            shaded,
            space: self.space,
            optics: shading.optics.clone(),
            segments: shading.segments.clone(),
        })
    }

    /// Binds the shader that makes outlines.
    fn outlines(&self) -> Bound {
        PROJECTED_TETS_OUTLINES.with(&ProjectedTetsOutlines {
            boxes: self.ranking.boxed.read(),
            polygons: self.polygons.write(),
            coverage: self.ranking.coverage(),
        })
    }

    /// Binds the shaders that draw outlines.
    fn draw_outlines(&self) -> Bound {
        let Self { ranking, shading, .. } = *self;
        let vertex = PROJECTED_TETS_VERTEX.with(&ProjectedTetsVertex {
            order: ranking.order.read(),
            polygons: self.polygons.read(),
            cell_scalars: ranking.cell_scalars,
            coverage: ranking.coverage(),
        });
        vertex.and(PROJECTED_TETS_FRAGMENT.with(&ProjectedTetsFragment {
            cell_scalars: ranking.cell_scalars,
            bounded: shading.bounded.clone(),
            optics: shading.optics.clone(),
            segments: shading.segments.clone(),
        }))
    }

    /// Binds the shaders that draw fans, with colours in each fragment.
    fn draw_fans(&self) -> Bound {
        let Self { ranking, shading, .. } = *self;
        let vertex = TET_FANS_VERTEX.with(&TetFansVertex {
            fans: self.polygons.read(),
            mesh_scalars: ranking.scalars.read(),
            order: ranking.order.read(),
            primitives: ranking.primitives.read(),
            view_points: ranking.view_points.read(),
            cell_scalars: ranking.cell_scalars,
            space: self.space,
        });
        vertex.and(TET_FANS_FRAGMENT.with(&TetFansFragment {
            cell_scalars: ranking.cell_scalars,
            bounded: shading.bounded.clone(),
            optics: shading.optics.clone(),
            segments: shading.segments.clone(),
        }))
    }

    /// Binds the shaders that draw fans, with colours at the vertices.
    fn draw_shaded_fans(&self) -> Bound {
        let Self { ranking, shading, .. } = *self;
        let vertex = TET_FANS_SHADED_VERTEX.with(&TetFansShadedVertex {
            fans: self.polygons.read(),
            mesh_scalars: ranking.scalars.read(),
            order: ranking.order.read(),
            primitives: ranking.primitives.read(),
            view_points: ranking.view_points.read(),
            cell_scalars: ranking.cell_scalars,
            space: self.space,
            optics: shading.optics.clone(),
        });
        vertex.and(TET_FANS_SHADED_FRAGMENT.with(&TetFansShadedFragment {}))
    }
}

impl TetsRaster {
    /// Prepares frames of one view size; `order` are the ranks of `view`, where the host finds them.
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
        check_shade(name, options, target)?;
        let space = LocalSpace::of(scene.mesh()?);
        let knots = scene.knots()?;
        let push = space.push(view, &shading_push(scene, &desc, &knots)?)?;
        let ranking = desc.rank_primitives(scene, &scene.mesh_data(), order)?;

        let mut shading = Shading::new(scene, &desc.options.segments, target)?;
        // A fragment that walks through knots loads them all; between two scalars a table needs no walk.
        if !ranking.cell_scalars && desc.options.segments.integrator == Integrator::Integral {
            shading.optics.knot_walk = 0;
        }
        let fans = options.has_fans();
        let size = if fans { size_of::<Fan>() } else { size_of::<[[f32; 2]; 4]>() };
        let polygons = buffer(gpu, "polygons", num::wide(size / 4) * u64::from(ranking.count))?;
        let shaders = Shaders {
            ranking: &ranking,
            polygons: &polygons,
            shading: &shading,
            space: options.plane == Plane::Space,
            back_to_front: desc.options.back_to_front(),
        };
        let (part, making, drawing) = match (fans, options.shade) {
            (false, _) => ("outlines", shaders.outlines(), shaders.draw_outlines()),
            (true, Shade::Fragment) => ("fans", shaders.fans(false), shaders.draw_fans()),
            (true, Shade::Vertex) => ("fans", shaders.fans(true), shaders.draw_shaded_fans()),
        };
        let make_polygons = pass(gpu, &format!("{name}.{part}"), &making)?;
        let state = GraphicsState {
            topology: vk::PrimitiveTopology::TRIANGLE_LIST,
            blend: if desc.options.back_to_front() { Blend::Over } else { Blend::Under },
            format: Some(FORMAT),
        };
        let pipeline = gpu.graphics_pipeline(&format!("{name}.draw"), &drawing, state)?;
        let descriptors = Arc::new(Descriptors::new(gpu, &pipeline, &drawing)?);
        let image = if draws_directly(target, FORMAT, desc.options.back_to_front()) {
            None
        } else {
            Some(own_image(gpu, name, FORMAT, vk::ImageUsageFlags::COLOR_ATTACHMENT, view, target)?)
        };
        Ok(Self {
            name,
            options: *options,
            space,
            push,
            polygons: make_polygons,
            fans: polygons,
            pipeline,
            descriptors,
            image,
            ranker,
            ranked: *view,
            fresh: true,
            view: *view,
            outcome: Arc::new(RasterOutcome {
                status: download(gpu, "status", 4 * u64::from(STATUS_WORDS))?,
                cells: ranking.count,
                built: Mutex::default(),
            }),
            ranking,
        })
    }

    /// Returns whether the fans, and the ranks, of the frame before serve another view.
    fn serves(&self, built: Option<(Eye, View)>, view: &View) -> [bool; 2] {
        let same = self.options.plane == Plane::Space && built.is_some_and(|(eye, _)| eye == Eye::of(view));
        // The host finds ranks for a view, the device for an eye.
        let ranks = self.options.rank_on(Route::Raster) == Rank::Centroid
            || built.is_some_and(|(_, view)| view == self.ranked);
        [same, same && ranks]
    }

    /// Finds ranks on the host, unless the last ones serve. Returns `false` while a recording reads them.
    fn rank(&mut self, view: &View) -> Result<bool> {
        let prepared = std::mem::take(&mut self.fresh) && self.ranked == *view;
        let held = self.options.plane == Plane::Space
            && Eye::of(&self.ranked) == Eye::of(view)
            && (self.ranked == *view || self.ranker.serves_other_pixels()?);
        if prepared || held {
            return Ok(true);
        }
        let Some(order) = self.ranker.order(view)? else { return Ok(true) };
        let given = self.ranking.give_order(&order);
        if given {
            self.ranked = *view;
        }
        Ok(given)
    }

    /// Returns the image that is drawn into: the plan's own, or the caller's.
    fn attachment(&self, target: Option<&TargetImage>) -> Option<Attachment> {
        match &self.image {
            Some(image) => Some(Attachment::Own(Arc::clone(image))),
            None => target.map(|target| Attachment::Caller(*target)),
        }
    }

    /// Records a frame. `fans` and `ranks` say whether it reuses those of the previous frame.
    fn record_frame(
        &self,
        recorder: &mut Recorder<'_>,
        attachment: &Attachment,
        clear: bool,
        [fans, ranks]: [bool; 2],
    ) {
        let push = MeshPush { count: self.ranking.count, ..self.push };
        let groups = groups_of(self.ranking.count, 64);
        self.ranking.clear_status(recorder);
        self.ranking.record_points(recorder, &push);
        // Fans in space also rank cells outside of the image, when they are built.
        if self.options.plane == Plane::Image {
            self.ranking.record_boxes(recorder, &push);
            self.ranking.record_order(recorder);
        }
        if fans {
            recorder.assume_buffer_after(&self.fans, Use::ComputeReadWrite);
        } else {
            self.polygons.record(recorder, &push, groups);
        }
        if ranks {
            self.ranking.assume_order(recorder);
        } else if self.options.plane == Plane::Space {
            self.ranking.record_order(recorder);
        }
        let vertices = if self.options.has_fans() { FAN_VERTICES } else { OUTLINE_VERTICES };
        recorder.draw(
            &format!("{}.draw", self.name),
            &self.pipeline,
            &self.descriptors,
            bytemuck::bytes_of(&push),
            attachment,
            clear || self.image.is_some(),
            vertices * self.ranking.count,
            1,
        );
        recorder.copy_buffer(
            "status",
            &self.ranking.status,
            &self.outcome.status,
            self.outcome.status.size(),
        );
        recorder.release_to_host(&self.outcome.status);
    }
}

impl Prepared for TetsRaster {
    fn set_view(&mut self, view: &View, _most_passes: u32) -> Result<bool> {
        let push = self.space.push(view, &self.push)?;
        let fits = self.rank(view)?;
        if fits {
            self.push = push;
            self.view = *view;
        }
        Ok(fits)
    }

    fn measure(&self) -> DepthMeasure {
        DepthMeasure::of_frame(&self.space)
    }

    fn image(&self) -> Option<&Arc<Image>> {
        self.image.as_ref()
    }

    fn route(&self) -> &'static str {
        "raster"
    }

    fn hit_depths(&self) -> std::result::Result<(), &'static str> {
        Err("route=compute tells them")
    }

    fn counters(&self) -> Vec<(&'static str, u64)> {
        let mut counters = vec![("cells_seen", u64::from(self.ranking.count))];
        counters.extend_from_slice(self.ranker.counters());
        counters
    }

    fn outcome(&self) -> Option<Arc<dyn Outcome>> {
        Some(Arc::clone(&self.outcome) as _)
    }

    fn record(&self, recorder: &mut Recorder<'_>, target: Option<&TargetImage>, clear: bool) {
        let Some(attachment) = self.attachment(target) else { return };
        let mut built = self.outcome.built.lock().unwrap_or_else(PoisonError::into_inner);
        let reused = self.serves(built.known, &self.view);
        if recorder.records() {
            *built = Built { known: None, recorded: Some((Eye::of(&self.view), self.ranked)), reused };
        }
        self.record_frame(recorder, &attachment, clear, reused);
    }

    fn record_most(&self, recorder: &mut Recorder<'_>, target: &TargetImage) {
        if let Some(attachment) = self.attachment(Some(target)) {
            self.record_frame(recorder, &attachment, true, [false; 2]);
        }
    }
}
