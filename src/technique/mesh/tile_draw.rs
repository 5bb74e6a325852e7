//! The passes that draw the primitives of tiles into an image, at once or in chunks and parts.

use std::sync::Arc;

use ash::vk;

use crate::error::Result;
use crate::frame::lists::{Band, Hits, Ranking};
use crate::frame::target::{Canvas, own_image};
use crate::gpu::shader::{FLAG_UNSORTED, TILE, TILE_PIXELS};
use crate::gpu::{Buffer, Image, Recorder};
use crate::interface::MeshPush;
use crate::primitives::dispatch::{Dispatch, buffer, groups_of, pass};
use crate::resident::GpuScene;
use crate::resident::mesh::Primitives;
use crate::scene::View;
use crate::technique::mesh::desc::MeshDesc;
use crate::technique::mesh::list_inputs::{FORMAT, ListInputs, Shading, TileInputs, kbuffer_images};

/// The image of a mesh, and the passes that draw into it.
#[derive(Debug)]
pub(crate) struct TileDraw {
    pub(crate) image: Arc<Image>,
    /// Words of pixels: what a frame leaves of their order, and their state between two dispatches.
    pub(crate) flags: Arc<Buffer>,
    /// Images that keep the k-buffer between two dispatches.
    kbuffer: Vec<Arc<Image>>,
    shading: Shading,
    back_to_front: bool,
    k: u32,
    /// One pass that takes all primitives of a tile, or those that take the first, some in the middle and the last.
    passes: Vec<Dispatch>,
    /// Dispatches for a tile's primitives, and how many primitives one takes.
    pub(crate) chunks: u32,
    chunk: u32,
}

/// Whether the mesh may reach behind the eye.
pub(crate) fn eye_inside(push: &MeshPush) -> bool {
    // `forward[3]` is the eye's depth relative to the centre of the mesh, which lies within one unit of it.
    push.forward[3] > -1.001
}

impl TileDraw {
    /// Makes the image of a view and its passes. A tile has up to `longest` primitives at a time; with `parts` there may be more to come.
    pub(crate) fn new(
        scene: &GpuScene,
        (view, target): (&View, &Canvas),
        desc: &MeshDesc,
        (ranking, hits): (&Ranking, &Hits),
        push: &MeshPush,
        longest: u32,
        parts: bool,
    ) -> Result<Self> {
        let gpu = scene.gpu();
        let image = own_image(gpu, desc.name, FORMAT, vk::ImageUsageFlags::STORAGE, view, target)?;
        let [width, height] = view.extent();
        let tiles = u64::from(width.div_ceil(TILE)) * u64::from(height.div_ceil(TILE));
        let flags = buffer(gpu, "flags", tiles * u64::from(TILE_PIXELS))?;
        let chunk = desc.chunk.unwrap_or(u32::MAX);
        let chunks = longest.div_ceil(chunk).max(1);
        let at_once = chunks == 1 && !parts;
        let kbuffer = match desc.primitives {
            Primitives::Cells => Vec::new(),
            // A pixel is drawn at once, but the shader declares images.
            Primitives::Faces if at_once => kbuffer_images(gpu, 1, [1, 1])?,
            Primitives::Faces => kbuffer_images(gpu, desc.k, view.extent())?,
        };
        let mut draw = Self {
            image,
            flags,
            kbuffer,
            shading: Shading::new(scene, &desc.options.segments, target)?,
            back_to_front: desc.options.back_to_front(),
            k: desc.k,
            passes: Vec::new(),
            chunks,
            chunk,
        };
        let list = draw.inputs(ranking, push);
        let pass = |&[resume, last_chunk]: &[bool; 2]| {
            let (coverage, tile_walk) = (ranking.coverage(), hits.walk());
            let inputs = TileInputs { list: &list, coverage, tile_walk, resume, last_chunk };
            pass(gpu, &format!("{}.draw", desc.name), &(desc.draw)(&inputs))
        };
        let made: &[[bool; 2]] =
            if at_once { &[[false, true]] } else { &[[false, false], [true, false], [true, true]] };
        draw.passes = made.iter().map(pass).collect::<Result<_>>()?;
        Ok(draw)
    }

    /// Returns the inputs of all passes that draw into the image.
    pub(crate) fn inputs<'a>(&'a self, ranking: &'a Ranking, push: &MeshPush) -> ListInputs<'a> {
        ListInputs {
            shading: &self.shading,
            // Only repairs have lists, of their own.
            cursors: &self.flags,
            lists: &self.flags,
            status: &ranking.status,
            flags: &self.flags,
            image: &self.image,
            kbuffer: &self.kbuffer,
            cell_scalars: ranking.cell_scalars,
            by_planes: ranking.by_planes,
            back_to_front: self.back_to_front,
            eye_inside: eye_inside(push),
            k: self.k,
            listed: FLAG_UNSORTED,
        }
    }

    /// Whether hit depths are told; the reason if not.
    pub(crate) fn hit_depths(&self) -> std::result::Result<(), &'static str> {
        if self.back_to_front { Err("order=front-to-back tells them") } else { Ok(()) }
    }

    /// Returns the images that hold the state between two dispatches.
    pub(crate) fn kept(&self) -> Vec<Arc<Image>> {
        self.kbuffer.iter().chain([&self.image]).cloned().collect()
    }

    /// Records the passes that draw the primitives of each tile of a band: all that there are, or a part, which may be the first, the last, or
    /// both.
    pub(crate) fn record(
        &self,
        recorder: &mut Recorder<'_>,
        push: &MeshPush,
        band: Band,
        [first, last]: [bool; 2],
    ) {
        let push = MeshPush { count: band.tiles, band: band.first, ..*push };
        let whole = self.passes.len() == 1;
        // A part that is both the first and the last takes two dispatches.
        let dispatches = if first && last && !whole { self.chunks.max(2) } else { self.chunks };
        for chunk in 0..dispatches {
            let [begins, ends] = [first && chunk == 0, last && chunk + 1 == dispatches];
            let pass = self.passes.get(usize::from(!begins) + usize::from(ends && !whole));
            // The last takes what a later view may have more.
            let number = if chunk + 1 == dispatches { u32::MAX } else { self.chunk };
            let push = MeshPush { first: chunk.saturating_mul(self.chunk), number, ..push };
            if let Some(pass) = pass {
                pass.record(recorder, &push, groups_of(band.tiles, 1));
            }
        }
    }
}
