//! An A-buffer of cells: exact lists of the cells of each pixel (Carpenter 1984).
//!
//! The other techniques for meshes are compared with it on the device. Every cell that a pixel's ray meets makes a piece:
//! the depths where the ray enters and leaves, and the scalars there. Pieces are sorted by their middles and integrated one
//! after the other. A piece needs no neighbours, so gaps and overlaps of cells need no special case.
//!
//! 1. Cells are ranked by the distance of their centroids and binned to tiles (`mesh/frame.rs`, `mesh-tiles.glsl`).
//! 2. `abuffer.glsl` passes the pieces of each pixel through a window in registers. Where they leave it out of order, they
//!    are listed and sorted (`mesh/repairs.rs`, `mesh-lists.glsl`).
//!
//! Error: that of the integrator. Cost: a mask for each tile that a cell's box touches; an intersection of four faces and an
//! integration for each fragment. Needs: core Vulkan 1.3.

use std::sync::Arc;

use crate::error::Result;
use crate::frame::prepared::Prepared;
use crate::frame::target::Canvas;
use crate::resident::GpuScene;
use crate::resident::mesh::Primitives;
use crate::scene::View;
use crate::technique::declare::draw::{Draw, Facts, Of, TechniqueOptions};
use crate::technique::declare::option_set;
use crate::technique::mesh::cell_lists;
use crate::technique::mesh::desc::MeshDesc;
use crate::technique::mesh::frame::MeshFrame;
use crate::technique::mesh::options::MeshOptions;

option_set! {
    /// Options of `abuffer`.
    pub struct Options {
        /// The options that the techniques for meshes share.
        pub mesh: MeshOptions = MeshOptions::default() => GROUP,
    }
}

impl TechniqueOptions for Options {
    const FACTS: Facts = Facts {
        name: "abuffer",
        summary: "cells of a mesh sorted exactly in each pixel",
        source: "Carpenter 1984",
        data: &["mesh"],
        kernels: &[],
        routes: &["compute"],
        splits_rays: true,
        modes: &[],
        samples: &[
            ("mesh", "", [1e-6, 4e-6]),
            ("mesh", "integrator=integral,empty-space=march", [2e-2, 0.2]),
        ],
        families: &[(Of::Meshes, "", &[""])],
    };

    fn check(&self) -> Result<()> {
        self.mesh.check(Self::NAME)
    }
}

impl Draw for Options {
    fn prepare(&self, scene: &Arc<GpuScene>, view: &View, target: &Canvas) -> Result<Box<dyn Prepared>> {
        let desc = MeshDesc {
            name: Self::NAME,
            primitives: Primitives::Cells,
            options: self.mesh,
            draw: cell_lists::draw,
            k: 0,
            deepens: false,
            chunk: None,
            repair: Some(cell_lists::repair),
            unsorted: "kbuffer_overflow_pixels",
        };
        Ok(Box::new(MeshFrame::new(scene, view, target, desc, None)?))
    }
}
