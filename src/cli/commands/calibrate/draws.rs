//! Random scenes, cameras, transfer functions and error goals, on which automatic choices are checked.

use volraster::choice::{Goal, Profile, TrialOutcome};
use volraster::glam::DVec3;
use volraster::scene::{
    Camera, Data, Field, Kernel, KernelSize, Kernels, Model, Projection, Scene, TransferFunction, View,
};
use volraster::{Error, Gpu, GpuScene, Result, choice};

use crate::cli::input::Size;
use crate::cli::numbers::counted;
use crate::cli::random::Random;

/// A random scene and view with an error goal.
#[derive(Debug)]
struct Sample {
    what: String,
    scene: Scene,
    view: View,
    max_error: f64,
}

impl Sample {
    /// Draws a random sample. Two in eight scenes are meshes, one is points, one a grid with kernels, the others
    /// plain grids.
    fn new(random: &mut Random, size: Size) -> Result<Self> {
        let fields = [Field::MarschnerLobb, Field::Blobs, Field::Ramp, Field::Sphere];
        let field = random.of(&fields);
        let kind = random.whole(0, 7);
        let mut kernels = None;
        let (data, unit, what) = if kind < 2 {
            let cubes = random.whole(4, 20);
            (Data::from(field.tets(cubes)?), 1.0, format!("{field:?} on {cubes} cubes"))
        } else if kind == 2 {
            let count = random.whole(10, 3000);
            let radius = random.scale(0.05, 0.3);
            let points = field.points(count)?.with_size(KernelSize::Radius(radius))?;
            (Data::from(points), 1.0, format!("{field:?} at {count} points of {radius:.3}"))
        } else if kind == 3 {
            let side = random.whole(4, 24);
            let kernel = random.of(&[Kernel::Gaussian, Kernel::Gaussian, Kernel::BSpline, Kernel::Tent]);
            let model = random.of(&[Model::Density, Model::Interpolate]);
            kernels = Some(Kernels { kernel, model, ..Kernels::of_samples() });
            let what = format!("{field:?} {side} {} {}", kernel.name(), model.name());
            (Data::from(field.sample([side; 3], "f32")?), 1.0, what)
        } else {
            let side = random.whole(16, 80);
            let (kind, unit) = random.of(&[("f32", 1.0), ("u8", 255.0), ("u16", 65535.0)]);
            (Data::from(field.sample([side; 3], kind)?), unit, format!("{field:?} {side} {kind}"))
        };
        let fov_y_deg = random.scale(15.0, 90.0);
        let projection = if random.whole(0, 3) == 0 {
            Projection::Orthographic { half_height: random.scale(0.4, 2.0) }
        } else {
            Projection::Perspective { fov_y_deg }
        };
        // Distances range from inside the data to where it covers few pixels.
        let mut direction = || DVec3::from_array(std::array::from_fn(|_| random.between(-1.0, 1.0)));
        let (towards, target, up) = (direction(), direction() * 0.3, direction());
        let distance = random.scale(0.5, 6.0);
        let eye = target + towards.try_normalize().unwrap_or(DVec3::Z) * distance;
        let camera = Camera { eye, target, up, projection };
        let mut scene = Scene::new(data, transfer(random, unit)?);
        if let Some(kernels) = kernels {
            scene = scene.with_kernels(kernels)?;
        }
        Ok(Self {
            what: format!("{what} from {distance:.2}"),
            scene,
            view: View::new(camera, size.width, size.height)?,
            max_error: random.scale(3e-4, 3e-2),
        })
    }
}

/// Draws a transfer function of 2 to 7 knots; one in three has a narrow peak.
fn transfer(random: &mut Random, unit: f64) -> Result<TransferFunction> {
    let strength = random.scale(0.3, 40.0);
    let count = random.whole(2, 7);
    let mut at: Vec<f64> = (0..count).map(|_| random.between(0.0, 1.0)).collect();
    let mut rows = Vec::new();
    let colour = |random: &mut Random| std::array::from_fn(|_| random.between(0.0, 1.0));
    at.sort_by(f64::total_cmp);
    for s in at {
        let [r, g, b] = colour(random);
        let tau = if random.whole(0, 2) == 0 { 0.0 } else { strength * random.between(0.0, 1.0) };
        rows.push([s * unit, r, g, b, tau]);
    }
    if random.whole(0, 2) == 0 {
        let (middle, half) = (random.between(0.1, 0.9), random.scale(0.004, 0.1));
        let [r, g, b] = colour(random);
        for (s, tau) in [(middle - half, 0.0), (middle, strength * 4.0), (middle + half, 0.0)] {
            rows.push([s * unit, r, g, b, tau]);
        }
    }
    rows.sort_by(|a, b| a[0].total_cmp(&b[0]));
    TransferFunction::from_rows(&rows)
}

/// Counts of a check.
#[derive(Default)]
pub(super) struct Check {
    /// Samples with a choice, or with a setting that meets the goal.
    pub(super) possible: u32,
    /// Of these, samples whose chosen setting meets the goal.
    pub(super) held: u32,
    /// Samples whose goal no setting meets, and for which none was chosen.
    pub(super) refused: u32,
    /// Time of each choice relative to the fastest setting that meets the goal.
    pub(super) ratios: Vec<f64>,
    /// Trials of each choice.
    pub(super) trials: Vec<f64>,
}

/// Chooses settings for random samples, and compares each choice with all settings. `progress` gets the number of
/// samples done and a line about the last one.
pub(super) fn check(
    gpu: &Gpu,
    profile: &Profile,
    [count, seed]: [u32; 2],
    size: Size,
    progress: &mut dyn FnMut(u32, &str),
) -> Result<Check> {
    let mut found = Check::default();
    for i in 0..count {
        // Each sample has a seed of its own and does not depend on earlier samples.
        let mut random = Random(u64::from(seed) << 32 | u64::from(i));
        let Sample { what, scene, view, max_error } = Sample::new(&mut random, size)?;
        let scene = GpuScene::new(gpu, scene);
        let goal = Goal::MaxError(max_error);
        let choice = match choice::choose(&scene, &view, goal, profile) {
            Ok(choice) => Some(choice),
            Err(Error::Unsupported { .. }) => None,
            Err(error) => return Err(error),
        };
        let mut costs = Vec::new();
        for (spec, outcome) in choice::try_all(&scene, &view, goal)? {
            if let TrialOutcome::Drawn { error, ms } = outcome {
                costs.push((spec, error.rmse, ms));
            }
        }
        let meets = costs.iter().filter(|(_, rmse, _)| *rmse <= max_error);
        let fastest = meets.map(|(.., ms)| *ms).min_by(f64::total_cmp);
        found.possible += u32::from(fastest.is_some() || choice.is_some());
        let mut line = format!("{what}, {}, error {max_error:.1e}: ", view.extent()[0]);
        match (fastest, choice) {
            (None, None) => {
                found.refused += 1;
                line += "no setting meets it, none chosen";
            }
            (None, Some(choice)) => {
                line += &format!("no setting meets it, {} chosen", choice.trials[choice.chosen].spec);
            }
            (Some(_), None) => line += "none chosen",
            (Some(fastest), Some(choice)) => {
                let (spec, trials) = (&choice.trials[choice.chosen].spec, choice.trials.len());
                found.trials.push(trials as f64);
                let known = costs.iter().find(|(other, ..)| other == spec).map(|&(_, rmse, ms)| (rmse, ms));
                // A step between those of the table was drawn for the choice alone.
                let own = match &choice.trials[choice.chosen].outcome {
                    TrialOutcome::Drawn { error, ms } => Some((error.rmse, *ms)),
                    _ => None,
                };
                if let Some((rmse, ms)) = known.or(own) {
                    found.held += u32::from(rmse <= max_error);
                    found.ratios.push(ms / fastest);
                    line += &format!(
                        "{spec} has {rmse:.1e} in {ms:.2} ms after {}; the fastest {fastest:.2} ms",
                        counted(trials, "trial")
                    );
                }
            }
        }
        progress(i + 1, &line);
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_vary_and_are_reproducible() {
        let size = Size { width: 8, height: 8 };
        let one = |i: u64| Sample::new(&mut Random(i), size).unwrap();
        let (mut meshes, mut parallel, mut splats) = (0, 0, 0);
        for i in 0..60 {
            let draw = one(i);
            meshes += u32::from(matches!(draw.scene.data, Data::Mesh(_)));
            splats += u32::from(matches!(draw.scene.data, Data::Points(_)) || draw.scene.kernels.is_some());
            parallel += u32::from(!draw.view.is_perspective());
            let again = one(i);
            assert_eq!((&draw.what, draw.max_error, draw.view), (&again.what, again.max_error, again.view));
            assert_eq!(draw.scene.transfer, again.scene.transfer);
        }
        assert!((5..30).contains(&meshes) && (5..30).contains(&parallel), "{meshes} {parallel}");
        assert!((5..30).contains(&splats), "{splats}");
    }
}
