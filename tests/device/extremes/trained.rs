//! Trained splats of extreme shapes and at extreme places, by every rule: against closed forms where parallel rays give one, else
//! against the reference.

use glam::DVec3;
use volraster::GpuScene;
use volraster::measure::ImageErrors;
use volraster::reference::{self, ReferenceOptions};
use volraster::scene::{
    Camera, GaussianParts, Gaussians, Projection, Scene, SplatRule, TransferFunction, View,
};
use volraster::technique::Method;

use crate::common::*;
use crate::extremes::catalogue::{Case, Family, Run, Spec};
use crate::extremes::support::*;

pub static FAMILY: Family = Family::new("trained splats", CASES);

/// A splat of one colour.
#[derive(Clone, Copy)]
struct Splat {
    centre: [f32; 3],
    logs: [f32; 3],
    opacity: f32,
    colour: [f32; 3],
}

/// The coefficient that makes a colour of the constant function.
fn constant(colour: f32) -> f32 {
    (colour - 0.5) / 0.282_094_79
}

fn parts_of(splats: &[Splat]) -> GaussianParts {
    GaussianParts {
        centres: splats.iter().map(|splat| splat.centre).collect(),
        rotations: splats.iter().map(|_| [0.8, 0.3, -0.2, 0.45]).collect(),
        log_scales: splats.iter().map(|splat| splat.logs).collect(),
        opacities: splats.iter().map(|splat| splat.opacity).collect(),
        harmonics: splats.iter().flat_map(|splat| splat.colour.map(constant)).collect(),
        ..GaussianParts::default()
    }
}

/// Draws splats by each rule, and checks the images.
fn by_rules(
    run: &mut Run<'_>,
    parts: &GaussianParts,
    view: &View,
    check: impl Fn(&Scene, SplatRule, &volraster::Image) -> Result<(), String>,
) {
    let spec = Spec { method: Method::Gaussians, route: "compute", integrator: "" };
    let transfer = TransferFunction::from_rows(&[[0.0; 5]]).unwrap();
    let scene = Scene::new(Gaussians::new(parts.clone()).unwrap().0, transfer);
    for (name, rule) in SplatRule::ALL {
        let scene = scene.clone().with_rule(rule);
        let Some(frame) = run.frame(&GpuScene::new(run.gpu, scene.clone()), view, &spec, &[]) else {
            run.fail(format!("{name}: refused"));
            continue;
        };
        if let Err(wrong) = finite(&frame.image).and_then(|()| check(&scene, rule, &frame.image)) {
            run.fail(format!("{name}, {:?}: {wrong}", view.camera()));
        }
    }
}

/// Splats of one standard deviation at one place, seen by parallel rays: each pixel by the closed form of its rule.
fn at_one_place(run: &mut Run<'_>, sigma: f64, splats: &[(f32, [f32; 3])]) {
    let log = sigma.ln() as f32;
    let sigma = f64::from(log).exp();
    let parts: Vec<Splat> = splats
        .iter()
        .map(|&(opacity, colour)| Splat { centre: [0.0; 3], logs: [log; 3], opacity, colour })
        .collect();
    let view = view(Projection::Orthographic { half_height: 1.2 }, 1.0, 48, 40);
    let pixel = view.pixel_size();
    let (middle, _) = view.project(DVec3::ZERO).unwrap();
    by_rules(run, &parts_of(&parts), &view, |_, rule, image| {
        let overlaps = rule.overlaps();
        let widened = [SplatRule::Inria, SplatRule::Antialiased].contains(&rule);
        let variance = sigma * sigma + if widened { 0.3 * pixel * pixel } else { 0.0 };
        'pixels: for (i, place) in pixels(&view) {
            let square = ((place - middle) * pixel).length_squared() / variance;
            // Where splats end, either side is right.
            if (square - 9.0).abs() < 1e-3 {
                continue;
            }
            let share = if square > 9.0 && !widened { 0.0 } else { (-0.5 * square).exp() };
            let factor = if rule == SplatRule::Antialiased { sigma * sigma / variance } else { 1.0 };
            let (mut left, mut light) = (1.0, DVec3::ZERO);
            for splat in &parts {
                let mut alpha = f64::from(splat.opacity) * factor * share;
                if widened {
                    alpha = alpha.min(0.99);
                    if (alpha - 1.0 / 255.0).abs() < 1e-5 {
                        continue 'pixels;
                    }
                    if alpha < 1.0 / 255.0 {
                        continue;
                    }
                }
                let colour = glam::Vec3::from_array(splat.colour).as_dvec3();
                if overlaps {
                    let depth = if rule == SplatRule::Overlap {
                        -(-alpha).ln_1p()
                    } else {
                        -(-f64::from(splat.opacity)).ln_1p() * share
                    };
                    left *= (-depth).exp();
                    light += depth * colour;
                } else {
                    light += left * alpha * colour;
                    left *= 1.0 - alpha;
                }
            }
            if overlaps && left < 1.0 {
                light *= (1.0 - left) / -f64::ln(left);
            }
            let got = image.pixels()[i].map(f64::from);
            let wanted = [light.x, light.y, light.z, 1.0 - left];
            for (got, wanted) in got.into_iter().zip(wanted) {
                near(&format!("at {place}:"), got, wanted, 2e-5)?;
            }
        }
        Ok(())
    });
}

/// A splat beside an ordinary one, from afar, from within and by parallel rays, as the reference draws them.
fn as_reference(run: &mut Run<'_>, centre: [f32; 3], logs: [f32; 3], opacity: f32) {
    let one = Splat { centre, logs, opacity, colour: [0.9, 0.3, 0.1] };
    let other =
        Splat { centre: [0.3, 0.2, 0.1], logs: [-2.0, -1.5, -1.0], opacity: 0.7, colour: [0.2, 0.5, 0.8] };
    let seen = |projection, eye| {
        let camera = Camera { eye, target: DVec3::ZERO, up: DVec3::NEG_Y, projection };
        View::new(camera, 71, 53).unwrap()
    };
    let views = [
        seen(Projection::Perspective { fov_y_deg: 40.0 }, DVec3::new(1.0, -0.7, -3.0)),
        seen(Projection::Perspective { fov_y_deg: 70.0 }, DVec3::new(0.2, 0.1, -0.4)),
        seen(Projection::Orthographic { half_height: 1.2 }, DVec3::new(1.0, -0.7, -3.0)),
    ];
    for view in views {
        by_rules(run, &parts_of(&[one, other]), &view, |scene, _, image| {
            let truth = reference::render(scene, &view, &ReferenceOptions::default(), None).unwrap();
            let errors = ImageErrors::between_f64(image, &truth).unwrap().all;
            near(&format!("{centre:?} {logs:?}: RMSE"), errors.rmse, 0.0, 3e-4)?;
            near(&format!("{centre:?} {logs:?}: largest"), errors.max_abs, 0.0, 2e-2)
        });
    }
}

/// A splat whose colour has functions about the axis alone, seen along the axis: each band l is its coefficient times
/// √((2 l + 1) / 4π), and from behind (-1)^l times that.
fn at_the_poles(run: &mut Run<'_>) {
    let own = [[0.3_f32, -0.2, 0.4], [0.25, 0.1, -0.3], [-0.15, 0.2, 0.1], [0.1, -0.12, 0.2]];
    let mut harmonics = [[0.0_f32; 3]; 16];
    for (l, colour) in own.iter().enumerate() {
        harmonics[l * l + l] = *colour;
    }
    let parts = GaussianParts {
        degree: 3,
        harmonics: harmonics.concat(),
        ..parts_of(&[Splat { centre: [0.0; 3], logs: [-0.5; 3], opacity: 0.8, colour: [0.5; 3] }])
    };
    for sign in [1.0_f64, -1.0] {
        let camera = Camera {
            eye: DVec3::NEG_Z * 3.0 * sign,
            target: DVec3::ZERO,
            up: DVec3::Y,
            projection: Projection::Perspective { fov_y_deg: 20.0 },
        };
        let view = View::new(camera, 9, 9).unwrap();
        by_rules(run, &parts, &view, |_, _, image| {
            let [r, g, b, a] = image.pixel(4, 4).map(f64::from);
            for (k, got) in [r, g, b].into_iter().enumerate() {
                let bands = (0..4).map(|l| {
                    let root = ((2 * l + 1) as f64 / (4.0 * std::f64::consts::PI)).sqrt();
                    sign.powi(l) * root * f64::from(own[l as usize][k])
                });
                near("colour", got, a * (0.5 + bands.sum::<f64>()).max(0.0), 2e-4)?;
            }
            Ok(())
        });
    }
}

const CASES: &[Case] = &[
    Case {
        number: "g1",
        name: "one splat, by parallel rays",
        expect: "closed form of each rule",
        tolerance: "2e-5",
        run: |run| {
            at_one_place(run, 0.3, &[(0.8, [0.9, 0.4, 0.2])]);
            at_one_place(run, 0.06, &[(0.8, [0.9, 0.4, 0.2])]);
        },
    },
    Case {
        number: "g2",
        name: "two splats at one place, by parallel rays",
        expect: "closed form of each rule",
        tolerance: "2e-5",
        run: |run| at_one_place(run, 0.3, &[(0.8, [0.9, 0.4, 0.2]), (0.6, [0.1, 0.3, 0.9])]),
    },
    Case {
        number: "g3",
        name: "splats 10,000 times as long or as wide as thick, and without thickness",
        expect: "reference",
        tolerance: "3e-4 RMSE",
        run: |run| {
            let flat = f32::NEG_INFINITY;
            for logs in [[0.0, -9.2, -9.2], [-0.5, -0.5, -9.7], [-1.0, -1.5, flat]] {
                as_reference(run, [0.0; 3], logs, 0.9);
            }
            // A line without width meets no ray, but for the rounding of one through its middle.
            as_reference(run, [0.02, 0.01, 0.0], [-1.0, flat, flat], 0.9);
        },
    },
    Case {
        number: "g4",
        name: "a splat of a fiftieth of a pixel",
        expect: "reference",
        tolerance: "3e-4 RMSE",
        run: |run| as_reference(run, [0.0; 3], [-7.0; 3], 1.0),
    },
    Case {
        number: "g5",
        name: "splats on the near plane, and around the eye",
        expect: "reference",
        tolerance: "3e-4 RMSE",
        run: |run| {
            as_reference(run, [0.4, 0.2, -0.2], [-0.5, 0.0, -0.2], 0.8);
            as_reference(run, [0.25, 0.13, -0.35], [-1.0, -0.5, -2.0], 0.8);
            as_reference(run, [0.6, 0.3, -0.41], [-1.0, -0.5, -2.0], 0.8);
        },
    },
    Case {
        number: "g6",
        name: "splats behind the eye, and far behind everything",
        expect: "reference",
        tolerance: "3e-4 RMSE",
        run: |run| {
            as_reference(run, [0.4, 0.2, -0.9], [-0.5, 0.0, -0.2], 0.8);
            as_reference(run, [0.6, 0.3, -0.55], [-1.0, -0.5, -1.3], 0.8);
            as_reference(run, [100.0, -70.0, 900.0], [2.0, 3.0, 1.0], 0.8);
        },
    },
    Case {
        number: "g7",
        name: "an opacity of 1, and splats that fill the view",
        expect: "reference",
        tolerance: "3e-4 RMSE",
        run: |run| {
            as_reference(run, [0.0; 3], [-1.0; 3], 1.0);
            as_reference(run, [0.0; 3], [3.0, 2.0, 4.0], 0.5);
        },
    },
    Case {
        number: "g8",
        name: "harmonics of degree 3 about the axis of view, from both sides",
        expect: "closed form",
        tolerance: "2e-4 of half floats",
        run: at_the_poles,
    },
];
