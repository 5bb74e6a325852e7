//! Hardware-assisted visibility sorting with a k-buffer (Callahan, Ikits, Comba and Silva 2005).
//!
//! Every face of the mesh is ranked by the distance of its centroid, which sorts most of them. In each pixel the
//! faces that its line meets pass through a window of `k` pairs of scalar and distance, which puts in order what
//! ranks have up to `k` places too early. Between two faces that leave the window one after the other lies a piece of
//! a cell, whose optical depth and colour are integrated.
//!
//! 1. `mesh_frame` ranks faces and lists them for each pixel (`glsl/mesh-lists.glsl`).
//! 2. `glsl/havs.glsl` takes a pixel's list through the window in registers; between chunks the window is in four
//!    storage images.
//!    The raster routes (`havs_raster`) draw each face once instead, and read and write the images for each fragment.
//! 3. A pixel is unsorted if and only if a pair leaves that is nearer than the one before; such pixels are counted,
//!    and with `repair=exact` drawn again from their sorted lists.
//!
//! Error: that of the integrator; none from sorting with `repair=exact`. Cost: a test for each pixel of a face's box,
//! `k` comparisons and an integration for each fragment. Needs: core Vulkan 1.3; the route `interlock` needs
//! `VK_EXT_fragment_shader_interlock`, `implementation-ordered` a driver that is known to keep the order of stores.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::frame::prepared::Prepared;
use crate::frame::target::Canvas;
use crate::gpu::shader::HAVS_COMPUTE;
use crate::resident::GpuScene;
use crate::resident::mesh::Primitives;
use crate::scene::View;
use crate::technique::mesh::frame::MeshFrame;
use crate::technique::mesh::havs_raster::{MOST_K, RasterFrame};
use crate::technique::mesh::options::{EMPTY_SPACE, INTEGRATOR, MeshOptions, ORDER, Repair, SMOKE, STOP};
use crate::technique::mesh::shading::MeshDesc;
use crate::technique::options::{self, BlendOrder, Choice, OptionInfo, TABLE};

pub use crate::technique::mesh::havs_raster::KBufferRoute;

const NAME: &str = "havs";

/// What can be chosen, with its effect on error and time.
pub(crate) const OPTIONS: &[OptionInfo] = &[
    OptionInfo {
        key: "k",
        values: "1 to 15",
        default: "7",
        effect: "pairs of the k-buffer: a face may come k places too early; the work for each fragment grows with it; at most 7 with a raster route",
    },
    OptionInfo {
        key: "route",
        values: "auto|compute|interlock|implementation-ordered",
        default: "auto",
        effect: "auto: compute. interlock rasterises the faces, fragments in order by a Vulkan extension; implementation-ordered does without it on drivers that are known to keep their order, which Vulkan does not promise",
    },
    OptionInfo {
        key: "repair",
        values: "exact|none",
        default: "exact",
        effect: "exact draws pixels whose faces did not leave the k-buffer in order again from sorted lists; none leaves them wrong, but counted",
    },
    OptionInfo {
        key: "chunk",
        values: "1 to 1000000",
        default: "all",
        effect: "with route=compute: faces of a pixel in one dispatch; the k-buffer waits in storage images between two. The image is the same",
    },
    INTEGRATOR,
    TABLE,
    SMOKE,
    ORDER,
    STOP,
    EMPTY_SPACE,
];

impl KBufferRoute {
    fn rasterises(self) -> bool {
        matches!(self, Self::Interlock | Self::ImplementationOrdered)
    }
}

/// Options of this technique.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Those that techniques for meshes share.
    pub mesh: MeshOptions,
    /// Pairs of the k-buffer, 1 to 15.
    pub k: u32,
    /// How faces come to pixels.
    pub route: KBufferRoute,
    /// What becomes of pixels whose faces were not sorted.
    pub repair: Repair,
    /// Faces of a pixel in one dispatch; `None`: all.
    pub chunk: Option<u32>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            mesh: MeshOptions::default(),
            k: 7,
            route: KBufferRoute::Auto,
            repair: Repair::Exact,
            chunk: None,
        }
    }
}

impl Options {
    /// Reads `key`, `value` pairs.
    pub(crate) fn parse(pairs: &[(String, String)]) -> Result<Self> {
        let mut options = Self::default();
        for (key, text) in pairs {
            match key.as_str() {
                "k" => options.k = options::whole(NAME, key, text, 1..=15)?,
                "route" => options.route = options::choice(NAME, key, text)?,
                "repair" => options.repair = options::choice(NAME, key, text)?,
                "chunk" if text == "all" => options.chunk = None,
                "chunk" => options.chunk = Some(options::whole(NAME, key, text, 1..=1_000_000)?),
                _ if options.mesh.read(NAME, key, text)? => {}
                _ => return Err(options::unknown(NAME, key, OPTIONS)),
            }
        }
        options.check()?;
        Ok(options)
    }

    fn check(&self) -> Result<()> {
        options::whole(NAME, "k", &self.k.to_string(), 1..=15)?;
        if self.route.rasterises() {
            let refuse = |key: &str, why: String| Err(Error::invalid(format!("{NAME} option {key}"), why));
            let route = self.route.word();
            if self.k > MOST_K {
                return refuse("k", format!("{}: must be 1 to {MOST_K} with route={route}", self.k));
            }
            if self.chunk.is_some() {
                return refuse("chunk", format!("route={route} has no dispatches to cut: leave it out"));
            }
        }
        self.mesh.check(NAME)
    }

    /// The options as text that reads back to them; what is unset is left out.
    pub(crate) fn pairs(&self) -> Vec<(&'static str, String)> {
        let mut pairs = vec![
            ("k", self.k.to_string()),
            ("route", self.route.word().to_string()),
            ("repair", self.repair.word().to_string()),
        ];
        pairs.extend(self.chunk.map(|chunk| ("chunk", chunk.to_string())));
        pairs.extend(self.mesh.pairs());
        pairs
    }

    pub(crate) fn prepare(
        &self,
        scene: &Arc<GpuScene>,
        view: &View,
        target: &Canvas,
    ) -> Result<Box<dyn Prepared>> {
        self.check()?;
        let desc = MeshDesc {
            name: NAME,
            primitives: Primitives::Faces,
            segments: self.mesh.segments,
            smoke: self.mesh.smoke,
            back_to_front: self.mesh.order == BlendOrder::BackToFront,
            resolve: &HAVS_COMPUTE,
            k: self.k,
            chunk: self.chunk,
            repair: (self.repair == Repair::Exact).then_some(&HAVS_COMPUTE),
            unsorted: "kbuffer_overflow_pixels",
            stop: self.mesh.stop,
            skip: self.mesh.skips(),
        };
        if self.route.rasterises() {
            return Ok(Box::new(RasterFrame::new(scene, view, target, desc, self.route)?));
        }
        Ok(Box::new(MeshFrame::new(scene, view, target, desc)?))
    }
}
