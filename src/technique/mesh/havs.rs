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
//! A mesh that the device has no room for goes through these steps part by part (`mesh/parts.rs`).
//!
//! Error: that of the integrator; sorting adds none with `repair=exact`. Cost: a mask of 64 pixels for each tile that a
//! face's box touches; a meeting with a plane, `k` comparisons and an integration for each fragment. Needs: core Vulkan 1.3; the route `interlock` needs
//! `VK_EXT_fragment_shader_interlock`, `implementation-ordered` a driver that is known to keep the order of stores.

mod options;
mod raster;

use std::sync::{Arc, Mutex, PoisonError};

use crate::error::Result;
use crate::frame::in_parts::{MOST_PARTS, in_parts};
use crate::frame::prepared::Prepared;
use crate::frame::target::Canvas;
use crate::gpu::Bound;
use crate::gpu::shader::{HAVS_REPAIR, HAVS_TILES, HavsRepair, HavsTiles};
use crate::num;
use crate::resident::GpuScene;
use crate::resident::mesh::{Needs, Primitives};
use crate::scene::View;
use crate::technique::declare::draw::{Draw, TechniqueOptions as _};
use crate::technique::mesh::desc::MeshDesc;
use crate::technique::mesh::frame::MeshFrame;
use crate::technique::mesh::havs::raster::RasterFrame;
use crate::technique::mesh::list_inputs::{ListInputs, ListShader, REPAIR_K, TileInputs};
use crate::technique::mesh::options::Repair;
use crate::technique::mesh::parts::PartsFrame;

pub use options::{KBufferRoute, Options};

/// Pairs of the k-buffer, until many pixels of a mesh had to be drawn again.
const FIRST_K: u32 = 7;

/// Bytes of the device's memory for each face of a mesh as a whole, and in parts for each face of one: data, ranks, boxes, planes, and pairs of a
/// tile and a face; parts are staged twice. (About: faces that cover many tiles take more, and there are fewer of these.)
const FACE_BYTES: [u64; 2] = [128, 160];

/// Bytes of the largest k-buffer for each pixel.
const KBUFFER_BYTES: u64 = 128;

/// Bytes of what else a pixel takes.
const PIXEL_BYTES: u64 = 24;

/// Most faces that are sorted at a time.
const MOST_SORTED: u64 = 1 << 26;

impl Draw for Options {
    fn prepare(&self, scene: &Arc<GpuScene>, view: &View, target: &Canvas) -> Result<Box<dyn Prepared>> {
        let whole = self.desc(scene.mesh_data().needs(Primitives::Faces), false);
        if self.route.rasterises() {
            return Ok(Box::new(RasterFrame::new(scene, view, target, whole, self.route)?));
        }
        // An unsorted pixel takes two more turns through all parts, and a larger k-buffer spares nearly all of them.
        let [width, height] = view.extent().map(u64::from);
        let large = KBUFFER_BYTES * width * height <= scene.gpu().memory_left() / 8;
        let margin = whole.margin(scene);
        let prepare = |parts| -> Result<Box<dyn Prepared>> {
            if parts == 1 {
                return Ok(Box::new(MeshFrame::new(scene, view, target, whole, None)?));
            }
            let mesh = scene.mesh_parts(Primitives::Faces, margin, parts)?;
            let desc = self.desc(&mesh.needs, large);
            Ok(Box::new(PartsFrame::new(scene, view, target, &desc, &mesh)?))
        };
        let forget = |parts| scene.forget_primitives(Primitives::Faces, margin, parts);
        in_parts(self.parts, || fewest_parts(scene, view, &whole), prepare, forget)
    }
}

impl Options {
    /// Returns how a mesh is drawn whose frames have needed so much, or that is to have a large k-buffer.
    fn desc(&self, known: &Mutex<Needs>, large: bool) -> MeshDesc {
        // A larger k-buffer takes two texels of its images, which only chunks and parts have.
        let may_deepen = self.k.is_none() && !self.route.rasterises() && self.chunk.is_none();
        let deep = large || known.lock().unwrap_or_else(PoisonError::into_inner).deep;
        MeshDesc {
            name: Self::NAME,
            primitives: Primitives::Faces,
            options: self.mesh,
            draw,
            k: self.k.unwrap_or(if deep && may_deepen { REPAIR_K } else { FIRST_K }),
            deepens: may_deepen && !deep,
            chunk: self.chunk,
            repair: (self.repair == Repair::Exact).then_some(repair as ListShader),
            unsorted: "kbuffer_overflow_pixels",
        }
    }
}

/// Returns the number of parts in which the device has room for a mesh, estimated from its cells.
fn fewest_parts(scene: &GpuScene, view: &View, desc: &MeshDesc) -> Result<u32> {
    let (gpu, margin) = (scene.gpu(), desc.margin(scene));
    if scene.has_primitives(Primitives::Faces, margin) {
        return Ok(1);
    }
    let cells = scene.drawn_cell_count(margin)?;
    // Two faces a cell, and some of the outline.
    let faces = 2 * cells + cells / 16 + 64;
    let largest = 4 * num::wide(Primitives::Faces.words(true));
    let most = (gpu.most_buffer_bytes() / largest).min(MOST_SORTED);
    let pixels = view.extent().into_iter().map(u64::from).product::<u64>();
    // Some is left for what comes after, and for a plan that takes over from another.
    let room = (gpu.memory_left() / 4 * 3).min(gpu.memory_budget() / 8 * 5);
    let [whole, of_part] = FACE_BYTES.map(|bytes| bytes * faces);
    if whole + PIXEL_BYTES * pixels <= room && faces <= most {
        return Ok(1);
    }
    // Where pixels take all the room, parts help little.
    let room = room.saturating_sub((PIXEL_BYTES + KBUFFER_BYTES) * pixels).max(room / 8).max(1);
    let parts = of_part.div_ceil(room).max(faces.div_ceil(most)).clamp(2, MOST_PARTS.into());
    Ok(u32::try_from(parts.min(cells.max(1))).unwrap_or(MOST_PARTS))
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
