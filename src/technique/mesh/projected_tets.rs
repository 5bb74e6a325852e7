//! Projected tetrahedra (Shirley and Tuchman 1990).
//!
//! Cells are drawn one by one in visibility order. A cell covers a triangle or a quadrilateral of the image. Each pixel
//! there integrates the segment of its ray inside the cell.
//!
//! 1. The host ranks cells (`mesh/order`), or the device sorts them by the distance of their centroids.
//! 2. `route=raster`: `projected-tets.glsl` makes the outline of each cell, or `tet-fans.glsl` a fan of triangles, and
//!    fixed function blends their fragments (`projected_tets/raster.rs`). `route=compute`: the cells of each pixel are
//!    taken by rank, and one invocation composites them (`mesh/frame.rs`).
//! 3. With `route=compute` a pixel whose segments come out of order is counted, and with `repair=exact` drawn again from
//!    its sorted list (`abuffer.glsl`).
//!
//! Error: that of the integrator where the order is right or repaired. Cost: a test and an integration for each cell of
//! each pixel. Needs: core Vulkan 1.3; `route=raster` needs blending into 32-bit float.

mod options;
mod ranks;
mod raster;

use std::sync::Arc;

use crate::error::Result;
use crate::frame::depth_measure::DepthMeasure;
use crate::frame::prepared::{Outcome, Prepared};
use crate::frame::target::Canvas;
use crate::gpu::shader::{PROJECTED_TETS_COMPUTE, ProjectedTetsCompute};
use crate::gpu::{Bound, Buffer, Image, Recorder, TargetImage};
use crate::resident::GpuScene;
use crate::resident::mesh::Primitives;
use crate::scene::View;
use crate::technique::declare::Route;
use crate::technique::declare::draw::{Draw, TechniqueOptions as _};
use crate::technique::mesh::cell_lists;
use crate::technique::mesh::desc::MeshDesc;
use crate::technique::mesh::frame::MeshFrame;
use crate::technique::mesh::list_inputs::{ListShader, TileInputs};
use crate::technique::mesh::projected_tets::ranks::Ranker;
use crate::technique::mesh::projected_tets::raster::TetsRaster;

pub use options::{Options, Plane, Shade};
pub use ranks::Rank;

impl Draw for Options {
    fn prepare(&self, scene: &Arc<GpuScene>, view: &View, target: &Canvas) -> Result<Box<dyn Prepared>> {
        let route = self.route_on(scene.gpu())?;
        let desc = MeshDesc {
            name: Self::NAME,
            primitives: Primitives::Cells,
            options: self.mesh,
            draw,
            k: 0,
            deepens: false,
            // A pixel meets few primitives of its tile, and takes some ten turns of loops for each.
            chunk: Some((scene.gpu().turns()? / 8).max(1)),
            repair: self.repairs_on(route).then_some(cell_lists::repair as ListShader),
            unsorted: "unsorted_pixels",
        };
        let margin = self.mesh.skips().then(|| scene.margin(Some(&self.mesh.segments)));
        let (rank, repaired) = (self.rank_on(route), self.repairs_on(route));
        let mut ranker = Ranker::new(scene, rank, self.mesh.back_to_front(), margin, repaired);
        let order = ranker.order(view)?;
        if route == Route::Raster {
            let raster = TetsRaster::new(scene, view, target, desc, self, ranker, order.as_deref())?;
            return Ok(Box::new(raster));
        }
        let frame = MeshFrame::new(scene, view, target, desc, order.as_deref())?;
        Ok(Box::new(Listed { frame, ranker, fresh: Some(*view) }))
    }
}

/// Binds the shader that composites the cells of each tile by rank.
fn draw(TileInputs { list, coverage, tile_walk, resume, last_chunk }: &TileInputs<'_>) -> Bound {
    PROJECTED_TETS_COMPUTE.with(&ProjectedTetsCompute {
        accumulation: list.image.stored(),
        flags: list.flags.write(),
        status: list.status.write(),
        back_to_front: list.back_to_front,
        last_chunk: *last_chunk,
        resume: *resume,
        cell_scalars: list.cell_scalars,
        bounded: list.shading.bounded.clone(),
        hit_depths: list.shading.hit_depths.clone(),
        coverage: coverage.clone(),
        optics: list.shading.optics.clone(),
        segments: list.shading.segments.clone(),
        tile_walk: tile_walk.clone(),
    })
}

/// The route `compute`: cells of tiles, ranked by the host where [`Rank`] says so.
#[derive(Debug)]
struct Listed {
    frame: MeshFrame,
    ranker: Ranker,
    /// The view of the ranks that were found while this was prepared; taken by the first frame.
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

    fn route(&self) -> &'static str {
        self.frame.route()
    }

    fn hit_depths(&self) -> std::result::Result<(), &'static str> {
        self.frame.hit_depths()
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
