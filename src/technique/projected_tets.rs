//! Projected tetrahedra (Shirley and Tuchman 1990).
//!
//! Cells are drawn one by one in the order in which rays meet them. A cell covers a triangle or a quadrilateral of the
//! image; where a pixel's ray passes through it, the piece inside has two ends, and what lies between them is
//! integrated.
//!
//! 1. `order` ranks cells on the host, or the device sorts them by the distance of their centroids.
//! 2. `route=raster`: `glsl/projected-tets.glsl` makes each cell's outline, whose fragments are blended by fixed
//!    function (`tets_raster`). `route=compute`: `mesh_frame` lists the cells of each pixel by rank, and one
//!    invocation composites them.
//!
//! 3. By compute a pixel whose pieces do not come in order is counted, and with `repair=exact` drawn again from its
//!    sorted list (`glsl/abuffer.glsl`).
//!
//! Error: that of the integrator where the order is right or repaired. Cost: a test and an integration for each cell of each
//! pixel. Needs: core Vulkan 1.3; `route=raster` blending into 32-bit float.

use std::sync::Arc;

use super::gpu_scene::GpuScene;
use super::grid_options::{Order, Route, TABLE};
use super::line_bounds::DepthMeasure;
use super::mesh_frame::{MeshDesc, MeshFrame, Primitives};
use super::mesh_options::{EMPTY_SPACE, INTEGRATOR, MeshOptions, ORDER, Repair, SMOKE, STOP};
use super::options::{self, Choice, OptionInfo};
pub use super::ranks::Rank;
use super::ranks::{RANK, Ranker};
use super::tets_raster::TetsRaster;
use super::{Canvas, Outcome, Prepared};
use crate::error::{Error, Result};
use crate::gpu::shader::{ABUFFER_COMPUTE, MOST_TURNS, PROJECTED_TETS_COMPUTE};
use crate::gpu::sync::Use;
use crate::gpu::{Buffer, Gpu, Image, OptionalFeature, Recorder, TargetImage};
use crate::scene::View;

const NAME: &str = "projected-tets";

/// What can be chosen, with its effect on error and time.
pub(crate) const OPTIONS: &[OptionInfo] = &[
    RANK,
    OptionInfo {
        key: "route",
        values: "auto|raster|compute",
        default: "auto",
        effect: "raster draws polygons that are blended by fixed function, compute lists the cells of each pixel; auto is compute. The image is the same but for rounding",
    },
    OptionInfo {
        key: "plane",
        values: "image|space",
        default: "image",
        effect: "with route=raster: where polygons stand. image makes them for each view, exact at every pixel's centre; space makes fans of triangles that serve every view from the same eye, and gives a pixel within 1/256 pixel of an edge to either side",
    },
    OptionInfo {
        key: "shade",
        values: "fragment|vertex",
        default: "fragment",
        effect: "with route=raster: what is integrated. fragment: every cell in every pixel; vertex: the thickest place of each cell, from where opacity goes linearly to 0: fewer integrations, and wrong where a cell is not thin",
    },
    OptionInfo {
        key: "repair",
        values: "exact|none",
        default: "exact with route=compute",
        effect: "exact draws pixels whose cells did not come in order again from sorted lists, so that rank decides on time alone; none leaves them wrong, but counted. With route=raster they are neither",
    },
    INTEGRATOR,
    TABLE,
    SMOKE,
    ORDER,
    STOP,
    EMPTY_SPACE,
];

/// Where polygons stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plane {
    /// In the image.
    Image,
    /// In space: thin vertices where they are, the thick one in the middle of the thick segment.
    Space,
}

impl Choice for Plane {
    const WORDS: &'static [(&'static str, Self)] = &[("image", Self::Image), ("space", Self::Space)];
}

/// What is integrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shade {
    /// Every cell in every pixel.
    Fragment,
    /// The thick segment of every cell.
    Vertex,
}

impl Choice for Shade {
    const WORDS: &'static [(&'static str, Self)] = &[("fragment", Self::Fragment), ("vertex", Self::Vertex)];
}

/// Options of this technique.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Those that techniques for meshes share.
    pub mesh: MeshOptions,
    /// Which cell comes first.
    pub rank: Rank,
    /// How cells come into the image.
    pub route: Route,
    /// Where polygons stand.
    pub plane: Plane,
    /// What is integrated.
    pub shade: Shade,
    /// What becomes of pixels whose cells did not come in order; `None`: they are repaired where the route can.
    pub repair: Option<Repair>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            mesh: MeshOptions::default(),
            rank: Rank::Mpvo,
            route: Route::Auto,
            plane: Plane::Image,
            shade: Shade::Fragment,
            repair: None,
        }
    }
}

impl Options {
    /// Reads `key`, `value` pairs.
    pub(crate) fn parse(pairs: &[(String, String)]) -> Result<Self> {
        let mut options = Self::default();
        for (key, text) in pairs {
            match key.as_str() {
                "rank" => options.rank = options::choice(NAME, key, text)?,
                "route" => options.route = options::choice(NAME, key, text)?,
                "plane" => options.plane = options::choice(NAME, key, text)?,
                "shade" => options.shade = options::choice(NAME, key, text)?,
                "repair" => options.repair = Some(options::choice(NAME, key, text)?),
                _ if options.mesh.read(NAME, key, text)? => {}
                _ => return Err(options::unknown(NAME, key, OPTIONS)),
            }
        }
        options.check()?;
        Ok(options)
    }

    fn check(&self) -> Result<()> {
        let refuse = |key: &str, why: &str| Err(Error::invalid(format!("{NAME} option {key}"), why));
        if self.mesh.stop > 0.0 && (self.route == Route::Raster || self.has_fans()) {
            return refuse("stop", "works with route=compute only");
        }
        if self.repair == Some(Repair::Exact) && (self.route == Route::Raster || self.has_fans()) {
            return refuse("repair", "exact works with route=compute only");
        }
        if self.has_fans() && self.route == Route::Compute {
            let key = if self.plane == Plane::Space { "plane" } else { "shade" };
            return refuse(key, "route=compute draws no polygons");
        }
        self.mesh.check(NAME)
    }

    /// The options as text that reads back to them; what is unset is left out.
    pub(crate) fn pairs(&self) -> Vec<(&'static str, String)> {
        let mut pairs = vec![
            ("rank", self.rank.word().to_string()),
            ("route", self.route.word().to_string()),
            ("plane", self.plane.word().to_string()),
            ("shade", self.shade.word().to_string()),
        ];
        pairs.extend(self.repair.map(|repair| ("repair", repair.word().to_string())));
        pairs.extend(self.mesh.pairs());
        pairs
    }

    /// Whether cells are drawn as fans around their thick vertices.
    pub(crate) fn has_fans(&self) -> bool {
        self.plane == Plane::Space || self.shade == Shade::Vertex
    }

    fn route_on(&self, gpu: &Gpu) -> Result<Route> {
        if self.route == Route::Compute || (self.route == Route::Auto && !self.has_fans()) {
            return Ok(Route::Compute);
        }
        if gpu.has(OptionalFeature::BlendRgba32f) {
            return Ok(Route::Raster);
        }
        let needed = "blending into 32-bit float; route=compute works";
        Err(Error::unsupported(format!("{NAME} route=raster"), needed))
    }

    pub(crate) fn prepare(
        &self,
        scene: &Arc<GpuScene>,
        view: &View,
        target: &Canvas,
    ) -> Result<Box<dyn Prepared>> {
        self.check()?;
        let back_to_front = self.mesh.order == Order::BackToFront;
        let desc = MeshDesc {
            name: NAME,
            primitives: Primitives::Cells,
            segments: self.mesh.segments,
            smoke: self.mesh.smoke,
            back_to_front,
            resolve: &PROJECTED_TETS_COMPUTE,
            k: 0,
            chunk: Some(MOST_TURNS),
            repair: (self.repair != Some(Repair::None)).then_some(&ABUFFER_COMPUTE),
            unsorted: "unsorted_pixels",
            stop: self.mesh.stop,
            skip: self.mesh.skips(),
        };
        let margin = self.mesh.skips().then(|| scene.margin(Some(&self.mesh.segments)));
        let mut ranker = Ranker::new(scene, self.rank, back_to_front, margin);
        let order = ranker.order(view)?;
        if self.route_on(scene.gpu())? == Route::Raster {
            let raster = TetsRaster::new(scene, view, target, desc, self, ranker, order.as_deref())?;
            return Ok(Box::new(raster));
        }
        let frame = MeshFrame::with_order(scene, view, target, desc, order.as_deref())?;
        Ok(Box::new(Listed { frame, ranker, fresh: Some(*view) }))
    }
}

/// Cells in the lists of pixels, by ranks of the host.
#[derive(Debug)]
struct Listed {
    frame: MeshFrame,
    ranker: Ranker,
    /// The view that the ranks have been found for while it was prepared.
    fresh: Option<View>,
}

impl Prepared for Listed {
    fn set_view(&mut self, view: &View, most_passes: u32) -> Result<bool> {
        if self.fresh.take().is_none_or(|fresh| fresh != *view)
            && let Some(order) = self.ranker.order(view)?
            && !self.frame.give_order(&order)
        {
            return Ok(false);
        }
        self.frame.set_view(view, most_passes)
    }

    fn measure(&self) -> DepthMeasure {
        self.frame.measure()
    }

    fn image(&self) -> Option<&Arc<Image>> {
        self.frame.image()
    }

    fn overflow(&self) -> Option<&Arc<Buffer>> {
        self.frame.overflow()
    }

    fn last_use(&self) -> Use {
        self.frame.last_use()
    }

    fn route(&self) -> &'static str {
        self.frame.route()
    }

    fn passes(&self) -> u32 {
        self.frame.passes()
    }

    fn counters(&self) -> Vec<(&'static str, u64)> {
        let mut counters = self.frame.counters();
        counters.push(("cells_seen", self.frame.primitive_count().into()));
        counters.extend_from_slice(self.ranker.counters());
        counters
    }

    fn record(&self, recorder: &mut Recorder<'_>, target: Option<&TargetImage>, clear: bool) {
        self.frame.record(recorder, target, clear);
    }

    fn outcome(&self) -> Option<Arc<dyn Outcome>> {
        self.frame.outcome()
    }
}
