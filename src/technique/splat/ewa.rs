//! Gaussian splats in perspective: elliptical weighted averages (Zwicker 2001), or integrals along each pixel's ray.
//!
//! 0. The host classifies the samples of grids and points, except those whose scalars are interpolated (`resident/splats/`).
//! 1. `splat-project.glsl` finds the pixels that each kernel may cover, its sort key and its ellipse.
//! 2. A stable sort orders kernels by key; tiles take their splats in that order (`bins.glsl`).
//! 3. `splat-ewa.glsl` blends the splats of each tile in registers, front to back. With `order=slabs`
//!    `splat-sheets.glsl` adds them up in slabs instead, where overlapping kernels need no order.
//!
//! Faint splats are not skipped and opacity is not capped: ten thousand layers of opacity 1/3000 are opaque.
//!
//! Error: `footprint=ewa` has at most about `1.2 rho tan(theta) + 1.1 rho²` of a kernel's peak, where rho is its standard
//! deviation over its distance and theta the angle off the axis; `footprint=exact` has that of float32. The opacity of
//! `order=center` has no other error; its colour errs by at most the product of the opacities of two overlapping kernels
//! times the difference of their colours. `order=slabs` is of second order in the thickness of slabs. Cost: for each splat
//! and pixel an exponential and the series of opacity; `exact` an error function more, slabs five for four slabs. Needs: core Vulkan 1.3.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::frame::prepared::Prepared;
use crate::frame::target::Canvas;
use crate::resident::GpuScene;
use crate::scene::{Kernel, Kernels, Model, Scene, View};
use crate::technique::declare::draw::{Draw, Facts, Of, TechniqueOptions};
use crate::technique::declare::{Group, option_set, refused, words};
use crate::technique::splat::desc::{Accumulation, SplatDesc};
use crate::technique::splat::frame::SplatFrame;
use crate::technique::splat::options::SplatOptions;

pub use crate::technique::splat::desc::Filter;

words! {
    /// The order in which splats are blended.
    pub enum EwaOrder {
        /// By the distance of centres.
        Center = "center",
        /// By the place where each pixel's ray is nearest to the centres.
        Pixel = "pixel",
        /// No order among splats: their parts in each slab are added up, and slabs are blended.
        Slabs = "slabs",
    }
}

words! {
    /// How the contribution of a kernel to a pixel is computed.
    pub enum Footprint {
        /// From an ellipse in the image, by affine projection.
        Ewa = "ewa",
        /// From the integral along the pixel's ray.
        Exact = "exact",
    }
}

/// The kernel is always a Gaussian.
const SPLAT: Group = Group { hidden: &[], absent: &["kernel"] };

option_set! {
    /// Options of `splat-ewa`.
    pub struct Options {
        /// Selects the order of blending. center takes whole splats by the distance of their centres: fastest, may jump when the camera
        /// turns. pixel takes them in each pixel by the place where its ray is nearest to their centres: no jumps but those of crossing
        /// splats. slabs adds up parts of splats in slabs: no jumps, converges with step.
        pub order: Option<EwaOrder> = None
            => Rule::words().unset("center for model=density, slabs for interpolate"),
        /// Selects how the contribution of a kernel to a pixel is computed. ewa takes an ellipse, filtered as the option filter says;
        /// exact takes the integral along the pixel's ray, unfiltered, as the reference samples.
        pub footprint: Footprint = Footprint::Exact,
        /// Selects the treatment of footprints that are smaller than a pixel, with footprint=ewa. auto widens ellipses that are narrower
        /// than the pixel's filter to it; full convolves all ellipses with it. A pixel averages opacity, not optical depth.
        pub filter: Filter = Filter::Auto => Rule::words().quiet(),
        /// Sets the variance of the pixel's filter, in pixels, with footprint=ewa. Below 0.25 brightness depends on where in a pixel a
        /// splat lies.
        pub variance: f64 = 0.3 => Rule::positive().quiet(),
        /// Options that techniques for splats share; the kernel is always a Gaussian.
        pub splat: SplatOptions = SplatOptions::default() => SPLAT,
    }
}

impl TechniqueOptions for Options {
    const FACTS: Facts = Facts {
        name: "splat-ewa",
        summary: "Gaussian splats, elliptical weighted averages or integrals along rays",
        source: "Zwicker, Pfister, van Baar and Gross 2001",
        data: &["points", "grid", "mesh"],
        kernels: &[Kernel::Gaussian],
        routes: &["compute"],
        splits_rays: false,
        modes: &[],
        samples: &[
            ("points", "order=slabs,step=0.25", [4e-5, 4e-4]),
            ("points", "order=pixel", [6e-3, 3e-2]),
            ("points", "order=center,pairs=500", [6e-3, 3e-2]),
            ("gaussians", "footprint=ewa,filter=none", [0.2, 0.5]),
            ("gaussians", "order=slabs,step=0.25", [2e-4, 7e-4]),
        ],
        families: &[
            (Of::Densities, "order=center,footprint=ewa", &[""]),
            (Of::Densities, "order=center,footprint=exact", &[""]),
            (Of::Densities, "order=pixel,footprint=exact", &[""]),
            (Of::Gaussians, "order=slabs,step=", &["8", "4", "2", "1", "0.5", "0.25", "0.125"]),
        ],
    };
}

impl Options {
    /// Returns the kernels that a scene is drawn with.
    fn kernels_of(&self, scene: &Scene) -> Result<Kernels> {
        let kernels = self.splat.kernels.of(scene, Kernels::of_samples())?;
        if kernels.kernel != Kernel::Gaussian {
            let why = format!("{}: splat-ewa draws gaussian; splat-sheets draws all", kernels.kernel.name());
            return Err(Error::invalid("kernel", why));
        }
        Ok(kernels)
    }
}

impl Draw for Options {
    fn prepare(&self, scene: &Arc<GpuScene>, view: &View, target: &Canvas) -> Result<Box<dyn Prepared>> {
        let refuse = |key: &str, why: &str| Err(refused(Self::NAME, key, why));
        let kernels = self.kernels_of(scene.scene())?;
        let interpolates = kernels.model == Model::Interpolate;
        let order = self.order.unwrap_or(if interpolates { EwaOrder::Slabs } else { EwaOrder::Center });
        if interpolates && order != EwaOrder::Slabs {
            return refuse("order", "whole splats have one colour each: works with model=density only");
        }
        let ewa = self.footprint == Footprint::Ewa;
        if ewa && order == EwaOrder::Slabs {
            return refuse(
                "footprint",
                "ellipses have no depth: order=slabs works with footprint=exact only",
            );
        }
        let desc = SplatDesc {
            name: Self::NAME,
            kernels,
            accumulation: match order {
                EwaOrder::Center => Accumulation::Centres,
                EwaOrder::Pixel => Accumulation::ByPixel,
                EwaOrder::Slabs => Accumulation::Slabs,
            },
            ewa,
            template: None,
            filter: self.filter,
            variance: self.variance,
            turns: scene.gpu().turns()?,
            options: self.splat,
        };
        Ok(Box::new(SplatFrame::new(scene, view, target, desc)?))
    }
}
