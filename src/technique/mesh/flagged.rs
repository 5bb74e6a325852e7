//! The data that a second drawing of flagged pixels shares with the first.

use std::sync::Arc;

use crate::interface::MeshPush;
use crate::resident::GpuScene;
use crate::resident::mesh::MeshData;
use crate::technique::mesh::desc::MeshDesc;
use crate::technique::mesh::list_inputs::ListInputs;

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
    /// Inputs of the passes that drew the pixels.
    pub(crate) drawn: &'a ListInputs<'a>,
}
