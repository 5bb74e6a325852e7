//! Options of `projected-tets`.

use crate::error::{Error, Result};
use crate::gpu::{Gpu, OptionalFeature};
use crate::technique::declare::Route;
use crate::technique::declare::draw::{Facts, Of, TechniqueOptions};
use crate::technique::declare::{option_set, refused, words};
use crate::technique::mesh::options::{MeshOptions, Repair};
use crate::technique::mesh::projected_tets::ranks::Rank;

words! {
    /// Where polygons are made.
    pub enum Plane {
        /// In the image, for each view.
        Image = "image",
        /// In space: fans of the cell's corners around the thick vertex, the middle of the thick segment.
        Space = "space",
    }
}

words! {
    /// Where cells are integrated.
    pub enum Shade {
        /// In every pixel.
        Fragment = "fragment",
        /// Once, along the thick segment: the longest segment of a ray inside the cell.
        Vertex = "vertex",
    }
}

option_set! {
    /// Options of `projected-tets`.
    pub struct Options {
        /// Selects the visibility order of cells. mpvo sorts topologically on the host, right wherever an order exists. power sorts by
        /// the power distance of circumspheres, right for Delaunay meshes. centroid sorts by distance on the device, fast, but wrong
        /// where neighbours differ in size or shape, until repair=exact mends it.
        pub rank: Option<Rank> = None => Rule::words().unset("centroid with repair=exact, else mpvo"),
        /// Selects how cells are composited. raster draws polygons that fixed function blends; compute has each pixel walk through the cells of its tile;
        /// auto is compute unless an option needs polygons. The image is the same but for rounding.
        pub route: Route = Route::Auto,
        /// Selects where polygons are made, with route=raster. image makes outlines for each view, exact at every pixel's centre. space
        /// makes fans of triangles that serve every view from the same eye, where a pixel within 1/256 pixel of an edge may belong to
        /// either side.
        pub plane: Plane = Plane::Image,
        /// Selects where cells are integrated, with route=raster. fragment integrates every cell in every pixel. vertex integrates each
        /// cell once, at its thickest place, from where opacity falls linearly to 0: fewer integrations, but wrong where a cell is not
        /// thin.
        pub shade: Shade = Shade::Fragment,
        /// Selects the treatment of pixels whose cells came out of order. exact draws them again from sorted lists, so that rank decides
        /// on time alone; none leaves them wrong, but counts them. route=raster can do neither.
        pub repair: Option<Repair> = None => Rule::words().unset("exact with route=compute"),
        /// The options that the techniques for meshes share.
        pub mesh: MeshOptions = MeshOptions::default() => GROUP,
    }
}

impl TechniqueOptions for Options {
    const FACTS: Facts = Facts {
        name: "projected-tets",
        summary: "cells of a mesh sorted, projected and integrated one by one",
        source: "Shirley and Tuchman 1990",
        data: &["mesh"],
        kernels: &[],
        routes: &["raster", "compute"],
        splits_rays: false,
        modes: &[],
        samples: &[
            ("mesh", "route=compute", [1e-6, 4e-6]),
            ("mesh", "route=compute,integrator=full,table=128", [4e-4, 9e-3]),
            ("mesh", "route=raster", [1e-6, 4e-6]),
            ("mesh", "route=raster,plane=space,order=back-to-front", [1e-6, 6e-6]),
            ("mesh", "route=raster,rank=power,shade=vertex", [0.2, 0.8]),
        ],
        families: &[
            (Of::Meshes, "route=raster,shade=vertex", &[""]),
            (Of::Meshes, "route=raster", &[""]),
            (Of::Meshes, "", &[""]),
        ],
    };

    fn check(&self) -> Result<()> {
        let refuse = |key: &str, why: &str| Err(refused(Self::NAME, key, why));
        let draws_polygons = self.route == Route::Raster || self.has_fans();
        if self.mesh.stop > 0.0 && draws_polygons {
            return refuse("stop", "works with route=compute only");
        }
        if self.repair == Some(Repair::Exact) && draws_polygons {
            return refuse("repair", "exact works with route=compute only");
        }
        if self.has_fans() && self.route == Route::Compute {
            let key = if self.plane == Plane::Space { "plane" } else { "shade" };
            return refuse(key, "route=compute draws no polygons");
        }
        self.mesh.check(Self::NAME)
    }
}

impl Options {
    /// Whether cells are drawn as fans around their thick vertices.
    pub(crate) fn has_fans(&self) -> bool {
        self.plane == Plane::Space || self.shade == Shade::Vertex
    }

    /// Whether pixels whose cells came out of order are drawn again by a route.
    pub(crate) fn repairs_on(&self, route: Route) -> bool {
        route == Route::Compute && self.repair != Some(Repair::None)
    }

    /// Returns the visibility order of a route.
    pub(crate) fn rank_on(&self, route: Route) -> Rank {
        self.rank.unwrap_or(if self.repairs_on(route) { Rank::Centroid } else { Rank::Mpvo })
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
        Err(Error::unsupported(format!("{} route=raster", Self::NAME), needed))
    }
}
