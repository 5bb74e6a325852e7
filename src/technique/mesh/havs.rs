//! Hardware-assisted visibility sorting with a k-buffer (Callahan, Ikits, Comba and Silva 2005).
//!
//! Every face of the mesh is ranked by the distance of its centroid, which sorts most of them. In each pixel the
//! faces that its ray meets pass through a window of `k` pairs of scalar and distance, the k-buffer. The window sorts
//! faces that come up to `k` places too early. Two faces that leave it one after the other bound a segment of the ray
//! inside one cell, whose optical depth and colour are integrated.
//!
//! 1. Faces are ranked, and with `route=compute` binned to tiles (`mesh/frame.rs`, `mesh-tiles.glsl`).
//! 2. `route=compute`: `havs.glsl` takes the faces of a pixel's line through the window in registers; between chunks up to
//!    four storage images hold the window. The raster routes (`havs/raster.rs`) draw each face once instead, and every fragment
//!    loads the window from the images and stores it again.
//! 3. A pixel is unsorted if and only if a pair leaves the window that is nearer than the one before. Such pixels are
//!    counted, and with `repair=exact` drawn again from their sorted list (`mesh/repairs.rs`, `mesh-lists.glsl`).
//! 4. With `repair=exact`, pixels in which cells overlap are drawn again from lists of cells (`mesh/overlaps.rs`).
//!
//! Error: that of the integrator; sorting adds none with `repair=exact`. Cost: a mask of 64 pixels for each tile that a
//! face's box touches; a meeting with a plane, `k` comparisons and an integration for each fragment. Needs: core Vulkan 1.3; the route `interlock` needs
//! `VK_EXT_fragment_shader_interlock`, `implementation-ordered` a driver that is known to keep the order of stores.

mod options;
mod raster;

use std::sync::{Arc, PoisonError};

use crate::error::Result;
use crate::frame::prepared::Prepared;
use crate::frame::target::Canvas;
use crate::gpu::Bound;
use crate::gpu::shader::{HAVS_REPAIR, HAVS_TILES, HavsRepair, HavsTiles};
use crate::resident::GpuScene;
use crate::resident::mesh::Primitives;
use crate::scene::View;
use crate::technique::declare::draw::{Draw, TechniqueOptions as _};
use crate::technique::mesh::desc::MeshDesc;
use crate::technique::mesh::frame::MeshFrame;
use crate::technique::mesh::havs::raster::RasterFrame;
use crate::technique::mesh::list_inputs::{ListInputs, ListShader, REPAIR_K, TileInputs};
use crate::technique::mesh::options::Repair;

pub use options::{KBufferRoute, Options};

/// Pairs of the k-buffer, until many pixels of a mesh had to be drawn again.
const FIRST_K: u32 = 7;

impl Draw for Options {
    fn prepare(&self, scene: &Arc<GpuScene>, view: &View, target: &Canvas) -> Result<Box<dyn Prepared>> {
        let rasterises = self.route.rasterises();
        // A larger k-buffer would take two texels of its images, which only chunks have.
        let may_deepen = self.k.is_none() && !rasterises && self.chunk.is_none();
        let deep =
            scene.mesh_data().needs(Primitives::Faces).lock().unwrap_or_else(PoisonError::into_inner).deep;
        let desc = MeshDesc {
            name: Self::NAME,
            primitives: Primitives::Faces,
            options: self.mesh,
            draw,
            k: self.k.unwrap_or(if deep && may_deepen { REPAIR_K } else { FIRST_K }),
            deepens: may_deepen && !deep,
            chunk: self.chunk,
            repair: (self.repair == Repair::Exact).then_some(repair as ListShader),
            unsorted: "kbuffer_overflow_pixels",
        };
        if rasterises {
            return Ok(Box::new(RasterFrame::new(scene, view, target, desc, self.route)?));
        }
        Ok(Box::new(MeshFrame::new(scene, view, target, desc, None)?))
    }
}

/// Binds the shader that draws the faces of each tile.
fn draw(TileInputs { list, coverage, tile_walk, resume, last_chunk }: &TileInputs<'_>) -> Bound {
    HAVS_TILES.with(&HavsTiles {
        flags: list.flags.write(),
        status: list.status.write(),
        last_chunk: *last_chunk,
        resume: *resume,
        k: list.k,
        by_planes: list.by_planes,
        cell_scalars: list.cell_scalars,
        bounded: list.shading.bounded.clone(),
        coverage: coverage.clone(),
        havs_sweep: list.sweep(),
        hit_depths: list.shading.hit_depths.clone(),
        layers: list.shading.layers.clone(),
        optics: list.shading.optics.clone(),
        segments: list.shading.segments.clone(),
        sweep_images: list.images(),
        tile_walk: tile_walk.clone(),
    })
}

/// Binds the shader that sorts and resolves lists of faces.
fn repair(list: &ListInputs<'_>) -> Bound {
    HAVS_REPAIR.with(&HavsRepair {
        cursors: list.cursors.read(),
        flags: list.flags.write(),
        lists: list.lists.write(),
        status: list.status.write(),
        k: list.k,
        cell_scalars: list.cell_scalars,
        bounded: list.shading.bounded.clone(),
        havs_sweep: list.sweep(),
        hit_depths: list.shading.hit_depths.clone(),
        layers: list.shading.layers.clone(),
        optics: list.shading.optics.clone(),
        segments: list.shading.segments.clone(),
        sweep_images: list.images(),
    })
}
