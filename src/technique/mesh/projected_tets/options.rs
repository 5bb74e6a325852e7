//! Options of `projected-tets`.

use crate::error::{Error, Result};
use crate::gpu::{Gpu, OptionalFeature};
use crate::technique::mesh::options::{EMPTY_SPACE, INTEGRATOR, MeshOptions, ORDER, Repair, SMOKE, STOP};
use crate::technique::mesh::projected_tets::ranks::{RANK, Rank};
use crate::technique::options::{self, Choice, OptionInfo, Route, TABLE};

pub(crate) const NAME: &str = "projected-tets";

/// The options, each with its effect on error and time.
pub(crate) const OPTIONS: &[OptionInfo] = &[
    RANK,
    OptionInfo {
        key: "route",
        values: "auto|raster|compute",
        default: "auto",
        effect: "raster draws polygons that fixed function blends; compute lists the cells of each pixel; auto is compute unless an option needs polygons. The image is the same but for rounding",
    },
    OptionInfo {
        key: "plane",
        values: "image|space",
        default: "image",
        effect: "with route=raster: where polygons are made. image makes outlines for each view, exact at every pixel's centre; space makes fans of triangles that serve every view from the same eye, where a pixel within 1/256 pixel of an edge may belong to either side",
    },
    OptionInfo {
        key: "shade",
        values: "fragment|vertex",
        default: "fragment",
        effect: "with route=raster: where cells are integrated. fragment: every cell in every pixel; vertex: each cell once, at its thickest place, from where opacity falls linearly to 0: fewer integrations, but wrong where a cell is not thin",
    },
    OptionInfo {
        key: "repair",
        values: "exact|none",
        default: "exact with route=compute",
        effect: "pixels whose cells came out of order: exact draws them again from sorted lists, so that rank decides on time alone; none leaves them wrong, but counts them. route=raster can do neither",
    },
    INTEGRATOR,
    TABLE,
    SMOKE,
    ORDER,
    STOP,
    EMPTY_SPACE,
];

/// Where polygons are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plane {
    /// In the image, for each view.
    Image,
    /// In space: fans of the cell's corners around the thick vertex, the middle of the thick segment.
    Space,
}

impl Choice for Plane {
    const WORDS: &'static [(&'static str, Self)] = &[("image", Self::Image), ("space", Self::Space)];
}

/// Where cells are integrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shade {
    /// In every pixel.
    Fragment,
    /// Once, along the thick segment: the longest segment of a ray inside the cell.
    Vertex,
}

impl Choice for Shade {
    const WORDS: &'static [(&'static str, Self)] = &[("fragment", Self::Fragment), ("vertex", Self::Vertex)];
}

/// Options of `projected-tets`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// The options that the techniques for meshes share.
    pub mesh: MeshOptions,
    /// How cells are ranked.
    pub rank: Rank,
    /// How cells are composited.
    pub route: Route,
    /// Where polygons are made.
    pub plane: Plane,
    /// Where cells are integrated.
    pub shade: Shade,
    /// Treatment of pixels whose cells came out of order; `None`: they are repaired where the route can.
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

    /// Refuses values and combinations that are not allowed.
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

    /// Returns the options as text that [`Options::parse`] reads back; options that are unset are left out.
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

    /// Returns the route on a device.
    ///
    /// # Errors
    ///
    /// [`Error::Unsupported`] where `raster` is needed and the device cannot blend into 32-bit float.
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
