//! Options of `projected-tets`.

use crate::error::{Error, Result};
use crate::gpu::{Gpu, OptionalFeature};
use crate::technique::mesh::options::{EMPTY_SPACE, INTEGRATOR, MeshOptions, ORDER, Repair, SMOKE, STOP};
use crate::technique::mesh::projected_tets::ranks::{RANK, Rank};
use crate::technique::options::{self, Choice, OptionInfo, Route, TABLE};

pub(crate) const NAME: &str = "projected-tets";

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

    pub(crate) fn check(&self) -> Result<()> {
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

    pub(crate) fn route_on(&self, gpu: &Gpu) -> Result<Route> {
        if self.route == Route::Compute || (self.route == Route::Auto && !self.has_fans()) {
            return Ok(Route::Compute);
        }
        if gpu.has(OptionalFeature::BlendRgba32f) {
            return Ok(Route::Raster);
        }
        let needed = "blending into 32-bit float; route=compute works";
        Err(Error::unsupported(format!("{NAME} route=raster"), needed))
    }
}
