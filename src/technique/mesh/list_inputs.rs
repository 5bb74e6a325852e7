//! The inputs of passes that draw tiles, and of passes that draw lists of fragments.

use std::sync::Arc;

use ash::vk;

use crate::error::Result;
use crate::frame::target::Canvas;
use crate::gpu::shader::{
    Bounded, Coverage, HavsSweep, HitDepths, Layers, Optics, Segments, SweepImages, TileWalk,
};
use crate::gpu::{Bound, Buffer, Gpu, Image, ImageDesc};
use crate::resident::GpuScene;
use crate::resident::tables::SegmentOptions;

/// The format of a mesh's image.
pub(crate) const FORMAT: vk::Format = vk::Format::R32G32B32A32_SFLOAT;

/// Binds a shader that resolves lists.
pub(crate) type ListShader = fn(&ListInputs<'_>) -> Bound;

/// Entries of the k-buffer that a repair sorts with.
pub(crate) const REPAIR_K: u32 = 15;

/// The inputs of passes that shade the segments of a mesh.
#[derive(Clone, Debug)]
pub(crate) struct Shading {
    pub(crate) optics: Optics,
    pub(crate) segments: Segments,
    pub(crate) bounded: Bounded,
    pub(crate) layers: Layers,
    pub(crate) hit_depths: HitDepths,
}

impl Shading {
    /// Collects the inputs for a scene and a target.
    pub(crate) fn new(scene: &GpuScene, segments: &SegmentOptions, target: &Canvas) -> Result<Self> {
        let knots = scene.knots()?;
        Ok(Self {
            optics: knots.optics(),
            segments: scene.segments(segments, false, None)?,
            bounded: target.bounded(&knots.buffer),
            layers: target.layered(&knots.buffer),
            hit_depths: target.hit_depths(),
        })
    }
}

/// The resources and constants of all passes that draw; each shader binds those that it declares.
#[derive(Clone, Debug)]
pub(crate) struct ListInputs<'a> {
    pub(crate) shading: &'a Shading,
    /// Ends of the lists of pixels.
    pub(crate) cursors: &'a Arc<Buffer>,
    pub(crate) lists: &'a Arc<Buffer>,
    pub(crate) status: &'a Arc<Buffer>,
    pub(crate) flags: &'a Arc<Buffer>,
    pub(crate) image: &'a Arc<Image>,
    /// Images that keep the k-buffer between chunks: up to four; one of a texel where a list is resolved at once, none for cells.
    pub(crate) kbuffer: &'a [Arc<Image>],
    pub(crate) cell_scalars: bool,
    pub(crate) by_planes: bool,
    pub(crate) back_to_front: bool,
    /// Whether the mesh may reach behind the eye.
    pub(crate) eye_inside: bool,
    pub(crate) k: u32,
    /// Flags of the pixels that have lists.
    pub(crate) listed: u32,
}

/// The inputs of the passes that draw the primitives of each tile.
#[derive(Clone, Debug)]
pub(crate) struct TileInputs<'a> {
    pub(crate) list: &'a ListInputs<'a>,
    pub(crate) coverage: Coverage,
    pub(crate) tile_walk: TileWalk,
    /// Whether the pass goes on where the one before ended, and whether none comes after it.
    pub(crate) resume: bool,
    pub(crate) last_chunk: bool,
}

/// Binds a shader that draws the primitives of each tile.
pub(crate) type TileShader = fn(&TileInputs<'_>) -> Bound;

impl ListInputs<'_> {
    /// Returns the images of a sweep; the first of the k-buffer stands in for those that a small one does not need.
    pub(crate) fn images(&self) -> SweepImages {
        let [kbuffer_0, kbuffer_1, kbuffer_2, kbuffer_3] =
            [0, 1, 2, 3].map(|i| self.kbuffer.get(i).or(self.kbuffer.first()).unwrap_or(self.image).stored());
        SweepImages { accumulation: self.image.stored(), kbuffer_0, kbuffer_1, kbuffer_2, kbuffer_3 }
    }

    /// Returns the inputs of a sweep through faces.
    pub(crate) fn sweep(&self) -> HavsSweep {
        HavsSweep { back_to_front: self.back_to_front, eye_inside: self.eye_inside }
    }
}

/// Allocates the images of a k-buffer of K pairs and the one that left last, two pairs a texel and eight in four images. Above 7 a pixel takes
/// two texels side by side.
pub(crate) fn kbuffer_images(gpu: &Gpu, k: u32, [width, height]: [u32; 2]) -> Result<Vec<Arc<Image>>> {
    let wide = if k > 7 { 2 * width } else { width };
    let desc = ImageDesc::flat(vk::Format::R32G32B32A32_UINT, [wide, height], vk::ImageUsageFlags::STORAGE);
    (0..(k / 2 + 1).min(4)).map(|i| Image::new(gpu, &format!("kbuffer.{i}"), &desc).map(Arc::new)).collect()
}
