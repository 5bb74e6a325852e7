//! An A-buffer of cells: exact lists of the cells of each pixel (Carpenter 1984).
//!
//! The other techniques for meshes are compared with it on the device. Every cell that a pixel's ray meets has an entry:
//! the depths where the ray enters and leaves, and the scalars there. The entries are sorted by the middles of their
//! segments and integrated one after the other. An entry needs no neighbours, so gaps and overlaps of cells need no
//! special case.
//!
//! 1. Cells are ranked by the distance of their centroids. The entries of each pixel are counted, summed up and written
//!    (`mesh/frame.rs`, `mesh-lists.glsl`).
//! 2. `abuffer.glsl` passes each list through a window in registers. A list that leaves the window out of order is
//!    sorted in place.
//!
//! Error: that of the integrator. Cost: 16 bytes for each fragment, counted before they are allocated; an image whose
//! lists do not fit one buffer is drawn in bands. Needs: core Vulkan 1.3.

use std::sync::Arc;

use crate::error::Result;
use crate::frame::prepared::Prepared;
use crate::frame::target::Canvas;
use crate::resident::GpuScene;
use crate::resident::mesh::Primitives;
use crate::scene::View;
use crate::technique::mesh::cell_lists;
use crate::technique::mesh::desc::MeshDesc;
use crate::technique::mesh::frame::MeshFrame;
use crate::technique::mesh::options::{EMPTY_SPACE, INTEGRATOR, MeshOptions, ORDER, SMOKE, STOP};
use crate::technique::options::{self, BlendOrder, OptionInfo, TABLE};

const NAME: &str = "abuffer";

/// The options, each with its effect on error and time.
pub(crate) const OPTIONS: &[OptionInfo] = &[INTEGRATOR, TABLE, SMOKE, ORDER, STOP, EMPTY_SPACE];

/// Options of `abuffer`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Options {
    /// The options that the techniques for meshes share.
    pub mesh: MeshOptions,
}

impl Options {
    /// Reads `key`, `value` pairs.
    pub(crate) fn parse(pairs: &[(String, String)]) -> Result<Self> {
        let mut options = Self::default();
        for (key, text) in pairs {
            if !options.mesh.read(NAME, key, text)? {
                return Err(options::unknown(NAME, key, OPTIONS));
            }
        }
        options.mesh.check(NAME)?;
        Ok(options)
    }

    /// Returns the options as text that [`Options::parse`] reads back; options that are unset are left out.
    pub(crate) fn pairs(&self) -> Vec<(&'static str, String)> {
        self.mesh.pairs()
    }

    /// Prepares frames of one view size.
    pub(crate) fn prepare(
        &self,
        scene: &Arc<GpuScene>,
        view: &View,
        target: &Canvas,
    ) -> Result<Box<dyn Prepared>> {
        self.mesh.check(NAME)?;
        let desc = MeshDesc {
            name: NAME,
            primitives: Primitives::Cells,
            segments: self.mesh.segments,
            smoke: self.mesh.smoke,
            back_to_front: self.mesh.order == BlendOrder::BackToFront,
            resolve: cell_lists::resolve,
            k: cell_lists::WINDOW,
            chunk: None,
            repair: Some(cell_lists::resolve),
            unsorted: "kbuffer_overflow_pixels",
            stop: self.mesh.stop,
            skip: self.mesh.skips(),
        };
        Ok(Box::new(MeshFrame::new(scene, view, target, desc)?))
    }
}
