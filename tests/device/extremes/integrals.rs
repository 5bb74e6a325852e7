//! Optical depths from nothing to the largest float, in one piece and in a hundred thousand.

use glam::DVec3;
use volraster::scene::{Camera, Projection, Scene, View};

use crate::extremes::catalogue::{Case, Family, Run, Spec};
use crate::extremes::support::*;

pub static FAMILY: Family = Family::new("integrals", CASES);

/// Layers of a mesh, where a grid has more.
const MOST_LAYERS: u32 = 2000;

/// A homogeneous cube of an optical depth, in so many steps, or layers of cells.
fn homogeneous(run: &mut Run<'_>, od: f64, steps: u32, bound: f64) {
    let transfer = fog(od / 2.0);
    let view = through(2, 2);
    // One voxel is 2 units wide.
    let step = format!("{}", 1.0 / f64::from(steps));
    let grid = grid([2; 3], DVec3::NEG_ONE, DVec3::ONE, |_| 0.5);
    let mesh = layered(steps.min(MOST_LAYERS), |_| 0.5);
    for scene in [Scene::new(grid, transfer.clone()), Scene::new(mesh, transfer)] {
        // What a grid's Gaussians interpolate is homogeneous too, in the grid's domain.
        let claims = |spec: &Spec| !spec.blurs(&scene.data) || (scene.grid().is_some() && steps <= 1000);
        run.only(claims, &scene, &view, &[("step", &step), ("stop", "0")], |_, frame| {
            let want = opacity(od.min(1e9));
            for pixel in frame.image.pixels() {
                let [r, g, b, a] = pixel.map(f64::from);
                near("opacity", a, want, bound)?;
                // Of an opaque cube colour is a sum of pieces, each rounded, where a technique takes pieces.
                let bound = if od < 88.0 { bound } else { (-23.0_f64).exp2() };
                for (got, colour) in [r, g, b].into_iter().zip(COLOUR) {
                    near("colour", got, colour * want, bound)?;
                }
            }
            Ok(())
        });
    }
}

/// Extinction rises from 0 to 1 along the view: its mean is 1/2 over 2 units. A sample in the middle of a step is the
/// mean of a linear function, so every rule is exact.
fn linear(run: &mut Run<'_>, steps: u32, flip: bool) {
    let field = |p: DVec3| 0.5 + 0.5 * if flip { -p.z } else { p.z };
    let step = format!("{}", 1.0 / f64::from(steps));
    let grid = grid([2; 3], DVec3::NEG_ONE, DVec3::ONE, field);
    let mesh = layered(steps.min(MOST_LAYERS), field);
    for scene in [Scene::new(grid, ramp(0.0, 1.0)), Scene::new(mesh, ramp(0.0, 1.0))] {
        run.each(&scene, &through(2, 2), &[("step", &step)], |_, frame| {
            let bound = t32(f64::from(steps));
            frame.image.pixels().iter().try_for_each(|p| near("opacity", p[3].into(), opacity(1.0), bound))
        });
    }
}

/// Colour from 0 in front to 1 behind under a constant extinction, of optical depth 1 in all:
/// `int_0^1 t exp(-t) dt = 1 - 2/e`.
///
/// In a step of optical depth h the mean colour instead of the attenuated one is off by `h^3 / 12` times the
/// transmittance in front, so N steps by `(1 - 1/e) / (12 N^2)`; the rest is of higher order for h <= 1, where it is
/// below a tenth of this. In the 2-D table colour is linear in both scalars, but its weight `1/x - 1/(exp(x) - 1)` of
/// the back goes linearly between lengths x = L and L/2; its second derivative is below x/120, so that it is off by
/// `(L/2)^2 / 8 * L/120`, with L at most twice a step's depth. Below the shortest length, a 2048th of the diagonal,
/// the last layer stands in: off by a twelfth of that.
fn attenuated(run: &mut Run<'_>, steps: u32) {
    let rows = [[0.0, 1.0, 1.0, 1.0, 0.5], [1.0, 0.0, 0.0, 0.0, 0.5]];
    let field = |p: DVec3| 0.5 + 0.5 * p.z;
    let step = format!("{}", 1.0 / f64::from(steps));
    let view = through(2, 2);
    let want = 1.0 - 2.0 / 1.0_f64.exp();
    let grid = grid([2; 3], DVec3::NEG_ONE, DVec3::ONE, field);
    let mesh = layered(steps.min(MOST_LAYERS), field);
    for scene in [Scene::new(grid, transfer(&rows)), Scene::new(mesh, transfer(&rows))] {
        let is_grid = scene.grid().is_some();
        run.each(&scene, &view, &[("step", &step)], |spec, frame| {
            let n = f64::from(steps);
            // Pieces of a cell are shorter than a layer.
            let mean = 1.1 * opacity(1.0) / (12.0 * n * n);
            let longest = 2.0 / n;
            let table = (longest / 2.0).powi(2) / 8.0 * longest / 120.0 + 3.5 / 2048.0 / 12.0 / n;
            let rule = match spec.integrator {
                "exact" => 0.0,
                "full" => table,
                _ => mean,
            };
            let rule = if spec.integrator.is_empty() && !is_grid { 0.0 } else { rule };
            let bound = rule + t32(n).max(1e-5);
            frame.image.pixels().iter().try_for_each(|p| near("colour", p[0].into(), want, bound))
        });
    }
}

/// Extinction from 0 to K at the back of 2 units and colour from 0 to 1: `int_0^1 exp(-K t^2) dt`, which is
/// `sqrt(pi / K) / 2` where K is opaque; and the other way round, where `K (2 t - t^2)` is the optical depth:
/// `1 / (2 K) (1 + 1 / (2 K) + O(K^-2))` of the back's colour is seen. Both directions of compositing. Claimed by what
/// integrates between knots; tables and samples take a mean. Panels of Gauss-Legendre are within 1e-6.
fn opaque_ramp(run: &mut Run<'_>, depth: f64) {
    let rows = [[0.0, 0.0, 1.0, 1.0, 0.0], [1.0, 1.0, 1.0, 1.0, depth]];
    for (rising, want) in [
        (true, (std::f64::consts::PI / depth).sqrt() / 2.0),
        (false, 1.0 - (1.0 + 0.5 / depth) / (2.0 * depth)),
    ] {
        let field = |p: DVec3| 0.5 - 0.5 * if rising { p.z } else { -p.z };
        for data in kinds(1, field) {
            let scene = Scene::new(data, transfer(&rows));
            for order in ["front-to-back", "back-to-front"] {
                let options: &[(&str, &str)] = &[("step", "1"), ("order", order)];
                run.only(
                    |spec| spec.integrator == "exact",
                    &scene,
                    &through(2, 2),
                    options,
                    |_, frame| {
                        frame.image.pixels().iter().try_for_each(|p| {
                            near("opacity", p[3].into(), 1.0, 2e-6)?;
                            near("colour", p[0].into(), want, 1e-5)
                        })
                    },
                );
            }
        }
    }
}

/// Rays that pass ever closer to an edge of the cube, seen at 45 degrees: at the distance x from the middle the chord
/// is `2 (sqrt(2) - x)`.
fn grazing(run: &mut Run<'_>) {
    for aside in [1e-1, 1e-2, 1e-3, 1e-4, 1e-5] {
        let tau = 3.0;
        let eye = DVec3::new(5.0, 0.0, 5.0);
        let right = DVec3::Y.cross(eye).normalize();
        // One pixel, off the diagonals of cells along y.
        let centre = right * (2.0_f64.sqrt() - aside) + DVec3::Y * 0.0371;
        let projection = Projection::Orthographic { half_height: 0.1 };
        let view =
            View::new(Camera { eye: eye + centre, target: centre, up: DVec3::Y, projection }, 1, 1).unwrap();
        let want = opacity(tau * 2.0 * aside);
        for scene in scenes(2, &fog(tau), |_| 0.5) {
            run.each(&scene, &view, &[("step", "0.1")], |_, frame| {
                finite(&frame.image)?;
                near(&format!("opacity at {aside}"), frame.image.pixel(0, 0)[3].into(), want, 1e-5)
            });
        }
    }
}

/// Steps that leave a last piece a millionth of a step thin: nothing is lost or counted twice.
fn thin_last_piece(run: &mut Run<'_>) {
    for excess in [1e-7, 1e-6, -1e-7] {
        let step = format!("{}", (1.0 + excess) / 8.0);
        let scene = Scene::new(grid([2; 3], DVec3::NEG_ONE, DVec3::ONE, |_| 0.5), fog(0.5));
        run.each(&scene, &through(2, 2), &[("step", &step)], |_, frame| {
            let alpha = f64::from(frame.image.pixel(0, 0)[3]);
            near("opacity", alpha, opacity(1.0), t32(10.0))
        });
    }
}

/// Exactly transparent black: nothing emits, or the camera looks away, or past.
fn nothing(run: &mut Run<'_>) {
    let away = look(DVec3::Z * 5.0, DVec3::Z * 9.0, DVec3::Y, 42.0, 3);
    let past = look(DVec3::Z * 5.0, DVec3::new(5.0, 0.0, 0.0), DVec3::Y, 20.0, 3);
    for (tau, view) in [(0.0, &through(3, 3)), (1.0, &away), (1.0, &past)] {
        for scene in scenes(2, &ramp(tau, tau), affine) {
            run.every(&scene, view, &[], |_, frame| {
                let drawn = frame.image.pixels().iter().find(|p| **p != [0.0; 4]);
                drawn.map_or(Ok(()), |p| Err(format!("{p:?} is not nothing")))
            });
        }
    }
}

const CASES: &[Case] = &[
    Case {
        number: "1",
        name: "homogeneous, od 1e-8 in 1 step",
        expect: "1e-8",
        tolerance: "1e-6 relative",
        run: |run| homogeneous(run, 1e-8, 1, 1e-14),
    },
    Case {
        number: "2",
        name: "homogeneous, od 1e-8 in 1e5 steps (meshes: 2000 layers)",
        expect: "1e-8",
        tolerance: "1e-3 relative",
        run: |run| homogeneous(run, 1e-8, 100_000, 1e-11),
    },
    Case {
        number: "3",
        name: "homogeneous, od 1e-4 in 1e5 steps (meshes: 2000 layers)",
        expect: "9.9995e-5",
        tolerance: "2e-3 relative",
        run: |run| homogeneous(run, 1e-4, 100_000, 2e-7),
    },
    Case {
        number: "4a",
        name: "homogeneous, od 1 in 1 step",
        expect: "0.6321206",
        tolerance: "t32(1)",
        run: |run| homogeneous(run, 1.0, 1, t32(1.0)),
    },
    Case {
        number: "4b",
        name: "homogeneous, od 1 in 10 steps",
        expect: "0.6321206",
        tolerance: "t32(10)",
        run: |run| homogeneous(run, 1.0, 10, t32(10.0)),
    },
    Case {
        number: "4c",
        name: "homogeneous, od 1 in 1000 steps",
        expect: "0.6321206",
        tolerance: "t32(1000)",
        run: |run| homogeneous(run, 1.0, 1000, t32(1000.0)),
    },
    Case {
        number: "4d",
        name: "homogeneous, od 1 in 1e5 steps (meshes: 2000 layers)",
        expect: "0.6321206",
        tolerance: "t32(1e5)",
        run: |run| homogeneous(run, 1.0, 100_000, t32(1e5)),
    },
    Case {
        number: "5",
        name: "homogeneous, od 20",
        expect: "1 - 2.06e-9",
        tolerance: "2e-7",
        run: |run| homogeneous(run, 20.0, 4, 2e-7),
    },
    Case {
        number: "6a",
        name: "homogeneous, od 88",
        expect: "1, the colour itself",
        tolerance: "exact; colour 1 ulp",
        run: |run| homogeneous(run, 88.0, 1, 0.0),
    },
    Case {
        number: "6b",
        name: "homogeneous, od 104",
        expect: "1, the colour itself",
        tolerance: "exact; colour 1 ulp",
        run: |run| homogeneous(run, 104.0, 1, 0.0),
    },
    Case {
        number: "6c",
        name: "homogeneous, od 1e8",
        expect: "1, the colour itself",
        tolerance: "exact; colour 1 ulp",
        run: |run| homogeneous(run, 1e8, 4, 0.0),
    },
    Case {
        number: "6d",
        name: "homogeneous, od of the largest float32",
        expect: "1, the colour itself",
        tolerance: "exact; colour 1 ulp",
        run: |run| homogeneous(run, f64::from(f32::MAX), 4, 0.0),
    },
    Case {
        number: "6e",
        name: "homogeneous, od beyond float32, 1e300",
        expect: "1, the colour itself",
        tolerance: "exact; colour 1 ulp",
        run: |run| homogeneous(run, 1e300, 1, 0.0),
    },
    Case {
        number: "7",
        name: "no extinction; a camera that looks away, and past the data",
        expect: "0",
        tolerance: "exact",
        run: nothing,
    },
    Case {
        number: "9a",
        name: "extinction linear along the ray, 1 step",
        expect: "1 - exp(-1)",
        tolerance: "t32(1)",
        run: |run| linear(run, 1, false),
    },
    Case {
        number: "9b",
        name: "extinction linear along the ray, 7 steps",
        expect: "1 - exp(-1)",
        tolerance: "t32(7)",
        run: |run| linear(run, 7, false),
    },
    Case {
        number: "9c",
        name: "extinction linear along the ray, 1000 steps",
        expect: "1 - exp(-1)",
        tolerance: "t32(1000)",
        run: |run| linear(run, 1000, false),
    },
    Case {
        number: "9d",
        name: "extinction linear against the ray, 7 steps",
        expect: "1 - exp(-1)",
        tolerance: "t32(7)",
        run: |run| linear(run, 7, true),
    },
    Case {
        number: "10a",
        name: "colour linear, extinction constant, 1 step",
        expect: "1 - 2/e",
        tolerance: "1e-5; mean colours 5.8e-2, 2-D table 2.1e-3",
        run: |run| attenuated(run, 1),
    },
    Case {
        number: "10b",
        name: "colour linear, extinction constant, 30 steps",
        expect: "1 - 2/e",
        tolerance: "1e-5; mean colours 6.4e-5, 2-D table 5e-6 more",
        run: |run| attenuated(run, 30),
    },
    Case {
        number: "10c",
        name: "extinction and colour linear in one step, od 40",
        expect: "sqrt(pi / K) / 2; 1 - 1 / (2 K)",
        tolerance: "1e-5",
        run: |run| opaque_ramp(run, 40.0),
    },
    Case {
        number: "10d",
        name: "extinction and colour linear in one step, od 700",
        expect: "sqrt(pi / K) / 2; 1 - 1 / (2 K)",
        tolerance: "1e-5",
        run: |run| opaque_ramp(run, 700.0),
    },
    Case {
        number: "10e",
        name: "extinction and colour linear in one step, od 1e6",
        expect: "sqrt(pi / K) / 2; 1 - 1 / (2 K)",
        tolerance: "1e-5",
        run: |run| opaque_ramp(run, 1e6),
    },
    Case {
        number: "12",
        name: "rays 1e-1 to 1e-5 from an edge of the outline",
        expect: "1 - exp(-tau chord)",
        tolerance: "1e-5",
        run: grazing,
    },
    Case {
        number: "42",
        name: "a last piece thinner than a millionth of a step",
        expect: "1 - exp(-1)",
        tolerance: "t32(10)",
        run: thin_last_piece,
    },
];
