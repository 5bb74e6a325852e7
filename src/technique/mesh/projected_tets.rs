//! Projected tetrahedra (Shirley and Tuchman 1990).
//!
//! Cells are drawn one by one in the order in which rays meet them. A cell covers a triangle or a quadrilateral of the
//! image; where a pixel's ray passes through it, the piece inside has two ends, and what lies between them is
//! integrated.
//!
//! 1. `order` ranks cells on the host, or the device sorts them by the distance of their centroids.
//! 2. `route=raster`: `glsl/projected-tets.glsl` makes each cell's outline, whose fragments are blended by fixed
//!    function (`tets_raster`). `route=compute`: `mesh_frame` lists the cells of each pixel by rank, and one
//!    invocation composites them.
//!
//! 3. By compute a pixel whose pieces do not come in order is counted, and with `repair=exact` drawn again from its
//!    sorted list (`glsl/abuffer.glsl`).
//!
//! Error: that of the integrator where the order is right or repaired. Cost: a test and an integration for each cell of each
//! pixel. Needs: core Vulkan 1.3; `route=raster` blending into 32-bit float.

use std::sync::Arc;

use crate::error::Result;
use crate::frame::depth_measure::DepthMeasure;
use crate::frame::prepared::{Outcome, Prepared};
use crate::frame::target::Canvas;
use crate::gpu::shader::{ABUFFER_COMPUTE, MOST_TURNS, PROJECTED_TETS_COMPUTE};
use crate::gpu::sync::Use;
use crate::gpu::{Buffer, Image, Recorder, TargetImage};
use crate::resident::GpuScene;
use crate::resident::mesh::Primitives;
use crate::scene::View;
use crate::technique::mesh::frame::MeshFrame;
use crate::technique::mesh::options::Repair;
use crate::technique::mesh::projected_tets_options::NAME;
use crate::technique::mesh::projected_tets_raster::TetsRaster;
use crate::technique::mesh::ranks::Ranker;
use crate::technique::mesh::shading::MeshDesc;
use crate::technique::options::{BlendOrder, Route};

pub(crate) use crate::technique::mesh::projected_tets_options::OPTIONS;
pub use crate::technique::mesh::projected_tets_options::{Options, Plane, Shade};
pub use crate::technique::mesh::ranks::Rank;

impl Options {
    pub(crate) fn prepare(
        &self,
        scene: &Arc<GpuScene>,
        view: &View,
        target: &Canvas,
    ) -> Result<Box<dyn Prepared>> {
        self.check()?;
        let back_to_front = self.mesh.order == BlendOrder::BackToFront;
        let desc = MeshDesc {
            name: NAME,
            primitives: Primitives::Cells,
            segments: self.mesh.segments,
            smoke: self.mesh.smoke,
            back_to_front,
            resolve: &PROJECTED_TETS_COMPUTE,
            k: 0,
            chunk: Some(MOST_TURNS),
            repair: (self.repair != Some(Repair::None)).then_some(&ABUFFER_COMPUTE),
            unsorted: "unsorted_pixels",
            stop: self.mesh.stop,
            skip: self.mesh.skips(),
        };
        let margin = self.mesh.skips().then(|| scene.margin(Some(&self.mesh.segments)));
        let mut ranker = Ranker::new(scene, self.rank, back_to_front, margin);
        let order = ranker.order(view)?;
        if self.route_on(scene.gpu())? == Route::Raster {
            let raster = TetsRaster::new(scene, view, target, desc, self, ranker, order.as_deref())?;
            return Ok(Box::new(raster));
        }
        let frame = MeshFrame::with_order(scene, view, target, desc, order.as_deref())?;
        Ok(Box::new(Listed { frame, ranker, fresh: Some(*view) }))
    }
}

/// Cells in the lists of pixels, by ranks of the host.
#[derive(Debug)]
struct Listed {
    frame: MeshFrame,
    ranker: Ranker,
    /// The view that the ranks have been found for while it was prepared.
    fresh: Option<View>,
}

impl Prepared for Listed {
    fn set_view(&mut self, view: &View, most_passes: u32) -> Result<bool> {
        if self.fresh.take().is_none_or(|fresh| fresh != *view)
            && let Some(order) = self.ranker.order(view)?
            && !self.frame.give_order(&order)
        {
            return Ok(false);
        }
        self.frame.set_view(view, most_passes)
    }

    fn measure(&self) -> DepthMeasure {
        self.frame.measure()
    }

    fn image(&self) -> Option<&Arc<Image>> {
        self.frame.image()
    }

    fn overflow(&self) -> Option<&Arc<Buffer>> {
        self.frame.overflow()
    }

    fn last_use(&self) -> Use {
        self.frame.last_use()
    }

    fn route(&self) -> &'static str {
        self.frame.route()
    }

    fn counters(&self) -> Vec<(&'static str, u64)> {
        let mut counters = self.frame.counters();
        counters.push(("cells_seen", self.frame.primitive_count().into()));
        counters.extend_from_slice(self.ranker.counters());
        counters
    }

    fn record(&self, recorder: &mut Recorder<'_>, target: Option<&TargetImage>, clear: bool) {
        self.frame.record(recorder, target, clear);
    }

    fn outcome(&self) -> Option<Arc<dyn Outcome>> {
        self.frame.outcome()
    }
}
