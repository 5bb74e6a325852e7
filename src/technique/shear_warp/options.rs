//! The algorithm of `shear-warp` and its options.
//!
//! A view is the product of a permutation of the axes, a shear of the slices (with a scaling in perspective) and a warp
//! that does not depend on depth. Each texel of the base plane is one ray, along which slices are composited as in `slices-2d` or, with an
//! integrator of segments, as in `slabs`. The number of rays does not depend on the number of pixels, which saves time.
//!
//! 1. `factorisation` factors the view. `base_planes` chooses base planes, up to six where the eye is near or in the domain,
//!    and lays a lattice of texels on each.
//! 2. `glsl/shear-warp/shear-warp.glsl` composites slabs: by a march along the ray of each texel (route `compute`), or by one quad per slab,
//!    blended by fixed function (route `raster`).
//! 3. `glsl/shear-warp/warp.glsl` resamples the intermediate image. Each pixel reads the base plane whose slices its ray crosses most
//!    steeply. `warp=mip` averages texels that are smaller than pixels.
//!
//! Error: along a ray that of `slices-2d` or `slabs`. Resampling adds an error of second order in the texels' distance (third
//! with `warp=bicubic`) where the image is smooth, and blurs edges by a texel. A homogeneous domain is
//! exact for rays through both faces. Cost: per slab and covered texel one bilinear fetch (two with `step`) and one
//! classification or integration; four to sixteen texels per pixel. Each axis in use needs one more copy of the grid. Needs: core
//! Vulkan 1.3.

use crate::error::Result;
use crate::resident::tables::{Integrator, SegmentOptions};
use crate::technique::declare::Segments;
use crate::technique::declare::draw::{Facts, Of, TechniqueOptions};
use crate::technique::declare::{Group, Value, option_set, refused, words};
use crate::technique::grid::options::{GridOptions, OrSlices};
use crate::technique::grid::slices_2d::Stacks;

pub(crate) const NAME: &str = "shear-warp";

words! {
    /// The filter of the warp.
    pub enum Warp {
        /// Bilinear, between four texels.
        Bilinear = "bilinear",
        /// Bilinear, in smaller levels of the intermediate image where its texels are smaller than pixels.
        Mip = "mip",
        /// Bicubic, between sixteen texels (Keys 1981).
        Bicubic = "bicubic",
    }
}

/// The resolution of the intermediate image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Intermediate {
    /// One texel per voxel of the nearest slice, but from one to three pixels wide.
    Auto,
    /// One texel per voxel of the nearest slice.
    Voxel,
    /// This many texels per pixel, along each side, in the middle of the region that is drawn.
    Pixel(f64),
}

impl Value for Intermediate {
    const WORDS: &'static [(&'static str, Self)] =
        &[("auto", Self::Auto), ("voxel", Self::Voxel), ("pixel", Self::Pixel(1.0))];

    fn read(text: &str) -> Option<Self> {
        text.parse().ok().map(Self::Pixel)
    }

    fn number(self) -> Option<f64> {
        if let Self::Pixel(texels) = self { Some(texels) } else { None }
    }
}

/// The intermediate image is rgba32f, and `warp=mip` takes the place of a prefilter.
const GRID: Group =
    Group { hidden: &[], absent: &["prefilter", "target", "dither", "seed", "resolution", "refine"] };

option_set! {
    /// Options of this technique.
    pub struct Options {
        /// Options that techniques for grids share; `step` counts only with `between`. This technique has no `prefilter`, `target`, `dither`
        /// and `resolution`: see `intermediate`.
        pub grid: GridOptions = GridOptions::default() => GRID,
        /// Whether slices are `step` apart along a ray, each a blend of two slices of the grid.
        pub between: bool = false => OrSlices(
            "slices composites the slices of the grid, whose distance along a ray grows to sqrt(3) voxels. A number is the distance of \
             slices along a ray, in units of the smallest voxel spacing, in every view, each a blend of two slices, with twice the fetches."
        ),
        /// Samples every n-th slice with step=slices, in about 1/n of the time. The distance of these slices sets the error. It refuses
        /// data with NaN.
        pub every: u32 = 1 => Rule::whole(1, 64).quiet(),
        /// Selects how slices are integrated. midpoint classifies each slice; the other values integrate the transfer function between
        /// slices, as slabs does.
        pub segments: SegmentOptions = SegmentOptions::of(Integrator::Midpoint) => Segments(Integrator::OF_GRIDS),
        /// Sets the resolution of the intermediate image: one texel per voxel of the nearest slice (voxel), one per pixel (pixel), this
        /// many along each side of a pixel, or one per voxel but from one to three pixels wide (auto). Time grows with the number of
        /// texels, and details smaller than a texel are blurred.
        pub intermediate: Intermediate = Intermediate::Auto => Rule::positive(),
        /// Selects the filter that resamples the intermediate image; the option filter takes these words, too. bicubic is sharper than
        /// bilinear, from four times the texels. mip averages texels that are smaller than pixels, where other techniques would need
        /// many rays per pixel.
        pub warp: Warp = Warp::Bilinear,
        /// Keeps the base plane in use until the cosine of another leads by this value. The image jumps later and less often.
        pub hysteresis: f64 = 0.01 => Rule::below_one(),
        /// Selects the stacks of a whole grid that the device holds. all keeps three copies of it, so that no change of the view needs an upload.
        pub stacks: Stacks = Stacks::Used,
    }
}

impl TechniqueOptions for Options {
    const FACTS: Facts = Facts {
        name: NAME,
        summary: "slices composited in a base plane, which is warped to the image",
        source: "Lacroute and Levoy 1994",
        data: &["grid"],
        kernels: &[],
        routes: &["raster", "compute"],
        splits_rays: false,
        modes: &[],
        samples: &[
            ("f32", "route=compute,step=0.5,intermediate=pixel", [2e-2, 0.3]),
            ("f32", "route=raster,step=0.5,intermediate=pixel", [2e-2, 0.3]),
            ("f32", "route=compute,integrator=exact,warp=bicubic,intermediate=2", [2e-2, 0.2]),
            ("f32", "route=raster,integrator=integral,warp=mip,intermediate=3,stacks=all", [2e-2, 0.2]),
        ],
        families: &[
            (Of::Grids, "every=", &["8", "4", "2", "1"]),
            (Of::Grids, "every=2,intermediate=", &["0.25", "0.33", "0.5", "pixel"]),
            (Of::Grids, "warp=bicubic,intermediate=", &["0.5", "0.7", "pixel", "2"]),
            (Of::Grids, "warp=bicubic,step=", &["1", "0.5", "0.25"]),
            (Of::Grids, "integrator=exact,warp=bicubic,step=", &["2", "1", "0.5", "0.25"]),
        ],
    };

    fn key<'a>(key: &'a str, text: &str) -> &'a str {
        let is_warp = Warp::WORDS.iter().any(|(word, _)| *word == text);
        if key == "filter" && is_warp { "warp" } else { key }
    }

    fn check(&self) -> Result<()> {
        if self.every > 1 && self.between {
            return Err(refused(NAME, "every", "applies to slices of the grid: step must be slices"));
        }
        self.segments.check(NAME)?;
        self.grid.check(NAME)
    }
}
