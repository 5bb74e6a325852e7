//! The table of settings: techniques with one varying option, from coarse to fine.

use crate::error::Result;
use crate::scene::Scene;
use crate::technique::declare::draw::Of;
use crate::technique::{Method, Technique};

/// Steps whose logarithms differ by less draw in the same time, within what a measurement tells.
const LEAST_CHANGE: f64 = 0.03;

/// A setting that may be chosen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Candidate {
    /// Specification for [`Technique::parse`].
    pub(crate) spec: String,
    /// Index of its family, and its place there.
    pub(crate) family: usize,
    pub(crate) place: usize,
}

impl Candidate {
    /// Returns the specification up to a step, and the step; `None` if the setting does not end with one.
    fn step(&self) -> Option<(&str, f64)> {
        let (stem, step) = self.spec.rsplit_once('=')?;
        let step = step.parse().ok().filter(|_| stem.ends_with("step"))?;
        Some((stem, step))
    }

    pub(crate) fn has_step(&self) -> bool {
        self.step().is_some()
    }

    /// Returns the setting with a step between those of this setting and another of its family, at a share of the
    /// way on a logarithmic scale; `None` if it would be as good as one of them.
    pub(crate) fn between(&self, other: &Self, share: f64) -> Option<Self> {
        let ((stem, own), (_, end)) = (self.step()?, other.step()?);
        let step = own * (end / own).powf(share);
        let spec = format!("{stem}={step:.3}");
        let is_new = |old: f64| (step / old).ln().abs() > LEAST_CHANGE;
        (is_new(own) && is_new(end)).then(|| Self { spec, ..self.clone() })
    }

    /// Returns the technique with `stop` as the threshold of early ray termination where it is supported.
    pub(crate) fn technique(&self, stop: f64) -> Result<Technique> {
        let joint = if self.spec.contains(':') { ',' } else { ':' };
        let stopped =
            (stop != 0.0).then(|| Technique::parse(&format!("{}{joint}stop={stop}", self.spec)).ok());
        stopped.flatten().map_or_else(|| Technique::parse(&self.spec), Ok)
    }
}

/// Returns the candidates for a scene.
pub(crate) fn candidates(scene: &Scene) -> Vec<Candidate> {
    all(|of, method| of.is(scene) && method.draws_scene(scene))
}

/// Returns the candidates for all kinds of scenes.
pub(crate) fn every() -> Vec<Candidate> {
    all(|_, _| true)
}

fn all(is: impl Fn(Of, Method) -> bool) -> Vec<Candidate> {
    let families =
        Method::ALL.into_iter().flat_map(|method| method.families().iter().map(move |f| (method, f)));
    let mut candidates = Vec::new();
    for (family, (method, (of, options, values))) in families.enumerate() {
        for (place, value) in values.iter().enumerate().filter(|_| is(*of, method)) {
            let spec = format!("{}:{options}{value}", method.name());
            candidates.push(Candidate { spec: spec.trim_end_matches(':').to_string(), family, place });
        }
    }
    candidates
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Field, Kernel, Kernels, Lighting, Mode, Model, SplatRule, TransferFunction};

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
        let trained = |rule| Scene::new(Field::Ramp.splats(3).unwrap(), transfer()).with_rule(rule);
        for (scene, least) in [
            (grid(), 30),
            (grid().with_mode(Mode::Lit(Lighting::default())).unwrap(), 29),
            (grid().with_mode(Mode::Maximum).unwrap(), 8),
            (mesh(), 6),
            (points(), 9),
            (with(points(), Kernel::Gaussian, Model::Interpolate), 6),
            (with(points(), Kernel::BSpline, Model::Density), 7),
            (with(grid(), Kernel::Gaussian, Model::Density), 9),
            (with(grid(), Kernel::Sinc, Model::Interpolate), 7),
            (with(mesh(), Kernel::Gaussian, Model::Interpolate), 6),
            (trained(SplatRule::Khr), 4),
            (trained(SplatRule::Integral), 6),
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
    fn steps_between_settings_are_settings() {
        let of = |spec: &str| Candidate { spec: spec.to_string(), family: 3, place: 2 };
        let [fine, coarse] = ["slabs:integrator=exact,step=0.5", "slabs:integrator=exact,step=1"].map(of);
        let between = fine.between(&coarse, 0.5).unwrap();
        assert_eq!(between, of("slabs:integrator=exact,step=0.707"));
        between.technique(1e-3).unwrap();
        assert_eq!(coarse.between(&fine, 0.25).unwrap().spec, "slabs:integrator=exact,step=0.841");
        // As good as one of both, or no step at all.
        assert_eq!(fine.between(&coarse, 0.01), None);
        assert_eq!(fine.between(&coarse, 0.99), None);
        assert_eq!(of("havs").between(&of("havs:resolution=half"), 0.5), None);
        assert_eq!(of("shear-warp:every=2").between(&of("shear-warp:every=1"), 0.5), None);
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
