//! Exact lists of cells (the A-buffer of Carpenter 1984): what the other techniques for meshes are compared with on the
//! device.
//!
//! In each pixel every cell that its line passes has an entry: where the line enters and leaves, and the scalars there. The
//! entries are sorted by the middles of the pieces and integrated one after the other. Each piece stands for
//! itself, so that neither gaps nor overlaps of cells need a rule.
//!
//! 1. `mesh_frame` ranks cells by the distance of their centroids, counts the entries of each pixel, sums them up and
//!    writes them (`glsl/mesh-lists.glsl`).
//! 2. `glsl/abuffer.glsl` passes each list through a window in registers. Where that did not sort it - which shows - the
//!    list is sorted in place.
//!
//! Error: that of the integrator. Cost: 16 bytes for each fragment, known before they are asked for; an image whose
//! lists do not fit a buffer is drawn in bands. Needs: core Vulkan 1.3.

use std::sync::Arc;

use crate::error::Result;
use crate::frame::prepared::Prepared;
use crate::frame::target::Canvas;
use crate::gpu::shader::ABUFFER_COMPUTE;
use crate::resident::GpuScene;
use crate::resident::mesh::Primitives;
use crate::scene::View;
use crate::technique::mesh::frame::MeshFrame;
use crate::technique::mesh::options::{EMPTY_SPACE, INTEGRATOR, MeshOptions, ORDER, SMOKE, STOP};
use crate::technique::mesh::shading::MeshDesc;
use crate::technique::options::{self, BlendOrder, OptionInfo, TABLE};

const NAME: &str = "abuffer";

/// Entries that a list passes through before it is sorted in place.
const WINDOW: u32 = 7;

/// What can be chosen, with its effect on error and time.
pub(crate) const OPTIONS: &[OptionInfo] = &[INTEGRATOR, TABLE, SMOKE, ORDER, STOP, EMPTY_SPACE];

/// Options of this technique.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Options {
    /// Those that techniques for meshes share.
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

    /// The options as text that reads back to them; what is unset is left out.
    pub(crate) fn pairs(&self) -> Vec<(&'static str, String)> {
        self.mesh.pairs()
    }

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
            resolve: &ABUFFER_COMPUTE,
            k: WINDOW,
            chunk: None,
            repair: Some(&ABUFFER_COMPUTE),
            unsorted: "kbuffer_overflow_pixels",
            stop: self.mesh.stop,
            skip: self.mesh.skips(),
        };
        Ok(Box::new(MeshFrame::new(scene, view, target, desc)?))
    }
}
