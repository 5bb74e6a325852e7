//! The table of settings: techniques with one varying option, from coarse to fine.

use crate::error::Result;
use crate::scene::{Data, Kernel, Kernels, Model, Scene};
use crate::technique::Technique;

/// Settings of one technique that differ in one option, along which errors fall and times rise.
#[derive(Clone, Copy, Debug)]
struct Family {
    /// Specification for [`Technique::parse`]; the option's value is appended.
    spec: &'static str,
    values: &'static [&'static str],
    /// Whether the technique supports early ray termination.
    stops: bool,
    of: Of,
}

/// Kinds of scenes that a family draws as the reference does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Of {
    /// Grids without kernels.
    Grids,
    /// Meshes without kernels.
    Meshes,
    /// Gaussians with the density model.
    Densities,
    /// Gaussians with either model.
    Gaussians,
    /// Other kernels, except for meshes.
    Others,
}

impl Of {
    fn is(self, scene: &Scene) -> bool {
        let kernels = match (&scene.data, scene.kernels) {
            (Data::Grid(_), None) => return self == Self::Grids,
            (Data::Mesh(_), None) => return self == Self::Meshes,
            (Data::Points(_), None) => Kernels::of_points(),
            (_, Some(kernels)) => kernels,
        };
        let gaussian = kernels.kernel == Kernel::Gaussian;
        match self {
            Self::Grids | Self::Meshes => false,
            Self::Densities => gaussian && kernels.model == Model::Density,
            Self::Gaussians => gaussian,
            Self::Others => !gaussian && scene.mesh().is_none(),
        }
    }
}

/// A setting that may be chosen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Candidate {
    /// Specification for [`Technique::parse`].
    pub(crate) spec: String,
    /// Index of its family, and its place there.
    pub(crate) family: usize,
    pub(crate) place: usize,
    stops: bool,
}

const STEPS: &[&str] = &["8", "4", "2", "1", "0.5", "0.25", "0.125", "0.0625"];
const FINE: &[&str] = &["1", "0.5", "0.25", "0.125", "0.0625"];
const ONE: &[&str] = &[""];

/// Sampled slices: every n-th.
const EVERY: &[&str] = &["8", "4", "2", "1"];

/// Texels of the intermediate image per pixel, along a side.
const TEXELS: &[&str] = &["0.25", "0.33", "0.5", "pixel"];
const FINE_TEXELS: &[&str] = &["0.5", "0.7", "pixel", "2"];

/// Thicknesses of the slabs of splats.
const SLABS: &[&str] = &["8", "4", "2", "1", "0.5", "0.25", "0.125"];

#[rustfmt::skip]
const FAMILIES: &[Family] = &[
    Family { spec: "slices-3d:step=", values: STEPS, stops: true, of: Of::Grids },
    Family { spec: "raycast:step=", values: STEPS, stops: true, of: Of::Grids },
    Family { spec: "slabs:step=", values: STEPS, stops: true, of: Of::Grids },
    Family { spec: "slabs:integrator=exact,step=", values: STEPS, stops: true, of: Of::Grids },
    Family { spec: "slabs:integrator=exact,filter=exact,step=", values: FINE, stops: true, of: Of::Grids },
    Family { spec: "slices-2d", values: ONE, stops: true, of: Of::Grids },
    Family { spec: "shear-warp:every=", values: EVERY, stops: true, of: Of::Grids },
    Family { spec: "shear-warp:every=2,intermediate=", values: TEXELS, stops: true, of: Of::Grids },
    Family { spec: "shear-warp:warp=bicubic,intermediate=", values: FINE_TEXELS, stops: true, of: Of::Grids },
    Family { spec: "shear-warp:warp=bicubic,step=", values: &["1", "0.5", "0.25"], stops: true, of: Of::Grids },
    Family { spec: "shear-warp:integrator=exact,warp=bicubic,step=", values: &["2", "1", "0.5", "0.25"], stops: true, of: Of::Grids },
    Family { spec: "havs", values: ONE, stops: true, of: Of::Meshes },
    Family { spec: "havs:integrator=integral", values: ONE, stops: true, of: Of::Meshes },
    Family { spec: "projected-tets:route=raster,shade=vertex", values: ONE, stops: false, of: Of::Meshes },
    Family { spec: "projected-tets:route=raster", values: ONE, stops: false, of: Of::Meshes },
    Family { spec: "projected-tets:rank=centroid", values: ONE, stops: true, of: Of::Meshes },
    Family { spec: "abuffer", values: ONE, stops: true, of: Of::Meshes },
    Family { spec: "splat-ewa:order=center,footprint=ewa", values: ONE, stops: true, of: Of::Densities },
    Family { spec: "splat-ewa:order=center,footprint=exact", values: ONE, stops: true, of: Of::Densities },
    Family { spec: "splat-ewa:order=window,footprint=exact", values: ONE, stops: true, of: Of::Densities },
    Family { spec: "splat-ewa:order=slabs,step=", values: SLABS, stops: true, of: Of::Gaussians },
    Family { spec: "splat-sheets:sheets=image,step=", values: SLABS, stops: true, of: Of::Others },
    Family { spec: "splat-sheets:sheets=axis,step=", values: &["1"], stops: true, of: Of::Others },
];

impl Candidate {
    /// Returns the technique with `stop` as the threshold of early ray termination where it is supported.
    pub(crate) fn technique(&self, stop: f64) -> Result<Technique> {
        if !self.stops || stop == 0.0 {
            return Technique::parse(&self.spec);
        }
        let joint = if self.spec.contains(':') { ',' } else { ':' };
        Technique::parse(&format!("{}{joint}stop={stop}", self.spec))
    }
}

/// Returns the candidates for a scene.
pub(crate) fn candidates(scene: &Scene) -> Vec<Candidate> {
    all().filter(|candidate| FAMILIES[candidate.family].of.is(scene)).collect()
}

/// Returns the candidates for all kinds of scenes.
pub(crate) fn every() -> Vec<Candidate> {
    all().collect()
}

fn all() -> impl Iterator<Item = Candidate> {
    FAMILIES.iter().enumerate().flat_map(|(family, &Family { spec, values, stops, .. })| {
        let one = move |(place, value): (usize, &&str)| Candidate {
            spec: format!("{spec}{value}"),
            family,
            place,
            stops,
        };
        values.iter().enumerate().map(one)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Field, TransferFunction};

    /// Every candidate draws its scene as the reference does, and every kind of scene has candidates.
    #[test]
    fn candidates_draw_the_scene() {
        let transfer = || TransferFunction::from_rows(&[[0.0, 1.0, 1.0, 1.0, 1.0]]).unwrap();
        let grid = || Scene::new(Field::Ramp.sample([2; 3], "f32").unwrap(), transfer());
        let mesh = || Scene::new(Field::Ramp.tets(1).unwrap(), transfer());
        let points = || Scene::new(Field::Ramp.points(3).unwrap(), transfer());
        let with = |scene: Scene, kernel, model| {
            scene.with_kernels(Kernels { kernel, model, ..Kernels::of_points() }).unwrap()
        };
        for (scene, least) in [
            (grid(), 30),
            (mesh(), 6),
            (points(), 9),
            (with(points(), Kernel::Gaussian, Model::Interpolate), 6),
            (with(points(), Kernel::BSpline, Model::Density), 7),
            (with(grid(), Kernel::Gaussian, Model::Density), 9),
            (with(grid(), Kernel::Sinc, Model::Interpolate), 7),
            (with(mesh(), Kernel::Gaussian, Model::Interpolate), 6),
        ] {
            let candidates = candidates(&scene);
            assert!(candidates.len() >= least, "{:?}: {}", scene.kernels, candidates.len());
            for candidate in candidates {
                let method = Technique::parse(&candidate.spec).unwrap().method();
                assert!(method.fits(&scene), "{candidate:?} for {:?}", scene.kernels);
            }
        }
        // No technique draws these kernels.
        assert_eq!(candidates(&with(mesh(), Kernel::BSpline, Model::Interpolate)), []);
    }

    #[test]
    fn every_candidate_is_a_technique_of_its_own() {
        let mut specs: Vec<String> = every().into_iter().map(|candidate| candidate.spec).collect();
        assert!(specs.len() > 40);
        for spec in &specs {
            Technique::parse(spec).unwrap();
        }
        for candidate in every() {
            candidate.technique(1e-3).unwrap();
        }
        let count = specs.len();
        specs.sort_unstable();
        specs.dedup();
        assert_eq!(specs.len(), count);
    }
}
