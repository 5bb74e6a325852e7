//! The data that a second drawing of flagged pixels shares with the first.

use std::sync::Arc;

use crate::gpu::{Buffer, Resource, SpecConstant};
use crate::interface::MeshPush;
use crate::resident::GpuScene;
use crate::resident::mesh::MeshData;
use crate::technique::mesh::desc::MeshDesc;

/// A frame whose flagged pixels are drawn again.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FlaggedFrame<'a> {
    pub(crate) scene: &'a GpuScene,
    pub(crate) data: &'a Arc<MeshData>,
    pub(crate) desc: &'a MeshDesc,
    pub(crate) push: &'a MeshPush,
    /// Tiles of the image.
    pub(crate) tiles: u32,
    /// Tiles in a row.
    pub(crate) across: u32,
    /// Flags of each pixel.
    pub(crate) flags: &'a Arc<Buffer>,
    /// Bindings of the passes that drew the pixels.
    pub(crate) resources: &'a [(u32, Resource)],
    /// Specialisation constants of passes that shade segments.
    pub(crate) shading: &'a [SpecConstant],
}
