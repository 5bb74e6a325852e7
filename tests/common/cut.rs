//! What is cut in tests: scenes of each kind of data, views, and the error that is allowed.

use glam::DVec3;
use volraster::Gpu;
use volraster::scene::{
    Field, GaussianParts, Gaussians, KernelSize, Points, Scene, SplatRule, TetScalars, TransferFunction, View,
};

use super::{FOG, by_pixel, orthographic, perspective, scene, specs, view, with_option};

/// A scene by name, and the specs that draw it, each with a bound of its error.
pub type Case = (&'static str, Scene, Vec<(String, f64)>);

/// The error of the same view, uncut, as a bound.
pub const OWN: f64 = 0.0;

/// From outside, by parallel rays, and from inside.
pub fn views() -> [View; 3] {
    [view(perspective(), 1.0, 40, 30), view(orthographic(), 1.0, 40, 30), view(perspective(), 0.1, 40, 30)]
}

pub fn fog() -> TransferFunction {
    TransferFunction::from_rows(&FOG).unwrap()
}

/// A grid, by all that draws it, and by `more`.
pub fn grid(gpu: &Gpu, more: impl IntoIterator<Item = String>) -> Case {
    let fine = |spec: String| match spec.as_str() {
        resampled if !by_pixel(resampled) => (format!("{resampled},filter=exact"), OWN),
        sheets if sheets.starts_with("splat") => (format!("{sheets},step=0.25"), 2e-4),
        other => (format!("{},filter=exact", with_option(other, "step", "0.25")), 2e-4),
    };
    ("grid", scene(Field::Blobs, 24, "f32", &FOG), specs(gpu).into_iter().chain(more).map(fine).collect())
}

/// Cells with a scalar at each corner.
pub fn mesh() -> Scene {
    Scene::new(Field::Blobs.tets(7).unwrap(), fog())
}

/// Cells with a scalar each.
pub fn cells() -> Scene {
    let tets = Field::Blobs.tets(7).unwrap();
    let scalars = (0..tets.cells().len()).map(|i| (i % 10) as f32 * 0.1).collect();
    Scene::new(tets.with_scalars(TetScalars::Cell(scalars)).unwrap(), fog())
}

/// Kernels that overlap.
pub fn points() -> Scene {
    let centres = (0..120).map(|i| {
        let at = |k: f64| ((f64::from(i) * k).fract() - 0.5) * 1.8;
        DVec3::new(at(0.754_877), at(0.569_840), at(0.362_437))
    });
    let scalars = (0..120_u8).map(|i| f32::from(i % 11) / 10.0).collect();
    let points = Points::new(centres.collect()).unwrap().with_scalars(scalars).unwrap();
    Scene::new(points.with_size(KernelSize::Radius(0.45)).unwrap(), fog())
}

/// Trained splats, by the rules that have depth on a ray.
pub fn trained() -> impl Iterator<Item = Case> {
    [SplatRule::Ray, SplatRule::Overlap, SplatRule::Integral].into_iter().map(|rule| {
        let bound = if rule == SplatRule::Ray { 1e-4 } else { 1e-3 };
        let scene = Scene::new(matt(&Field::Blobs.splats(900).unwrap()), fog()).with_rule(rule);
        (rule.name(), scene, vec![("gaussians".to_string(), bound)])
    })
}

/// Splats of one colour from all sides, so that a part of a parallel ray tells what the whole does.
fn matt(splats: &Gaussians) -> Gaussians {
    let parts = GaussianParts {
        centres: splats.centres().to_vec(),
        rotations: splats.rotations().to_vec(),
        log_scales: splats.log_scales().to_vec(),
        opacities: splats.opacities().to_vec(),
        harmonics: splats.harmonics().chunks(12).flat_map(|of| &of[..3]).copied().collect(),
        ..GaussianParts::default()
    };
    Gaussians::new(parts).unwrap().0
}
