//! Segments between scalars that are equal, nearly equal or outside of all knots; jumps, peaks, very many knots.

use glam::DVec3;
use volraster::scene::{Grid, Samples, Scene, TransferFunction};

use crate::extremes::catalogue::{Case, Family, Run};
use crate::extremes::support::*;

pub static FAMILY: Family = Family::new("transfer functions", CASES);

/// The cube with one scalar in front (z = 1) and one behind, as each kind of data.
fn between(front: f64, back: f64, transfer: &TransferFunction) -> Vec<Scene> {
    // Exact at both ends.
    scenes(1, transfer, |p| if p.z > 0.0 { front } else { back })
}

fn expect(run: &mut Run<'_>, scenes: &[Scene], steps: u32, od: f64, bound: f64) {
    let step = format!("{}", 1.0 / f64::from(steps));
    for scene in scenes {
        run.each(scene, &through(2, 2), &[("step", &step)], |_, frame| {
            frame.image.pixels().iter().try_for_each(|p| near("opacity", p[3].into(), opacity(od), bound))
        });
    }
}

/// Where the front is so near to the back that a difference quotient has no digits: the optical depth is that of the
/// mean. A linear transfer function, so its value in the middle is the mean; 1 ulp of scalar is 7e-8 of it.
fn nearly_equal(run: &mut Run<'_>, difference: f64) {
    for tau in [1e-3, 1.0, 4.0] {
        let back = 0.9 + difference;
        let od = 2.0 * tau * (0.9 + 0.5 * difference);
        let ramp = ramp(0.0, tau);
        for (a, b) in [(0.9, back), (back, 0.9)] {
            // 1e-4 of the depth, in opacity.
            expect(run, &between(a, b, &ramp), 1, od, 1e-4 * od * (-od).exp());
        }
    }
}

/// Both ends, or one, beyond the knots: constant there, so `[low, high]` of the ramp counts in proportion. The kinks at
/// the ends cost a sample in the middle at most an eighth of a step of scalar, once each.
fn beyond(run: &mut Run<'_>, front: f64, back: f64) {
    let (a, b) = (front.min(back), front.max(back));
    // Mean over [a, b] of the clamped scalar.
    let (p, q) = (a.clamp(0.0, 1.0), b.clamp(0.0, 1.0));
    let mean = (0.5 * (q * q - p * p) + (b - 1.0).max(0.0) - (a - 1.0).max(0.0)) / (b - a);
    let od = 2.0 * (0.1 + 0.8 * mean);
    let n = 100.0;
    let kinks = 2.0 * 0.8 * 2.0 / n * (b - a) / n / 8.0;
    // The 2-D table's nodes lie on both kinks.
    expect(run, &between(front, back, &ramp(0.1, 0.9)), 100, od, t32(n) + kinks);
}

/// A peak of 2^-13 of the range, of optical depth 1 in all. Its ends are floats. A sample every 1e-5 of the range meets
/// it 12 times, one more or less; a sample every seventh would miss it, so samples claim the fine steps alone. Steps of
/// a seventh round the scalars at their ends by 2^-25 each, 2^-11 of the peak. Nodes of the 2-D table lie on the ends
/// of one step only.
fn peak(run: &mut Run<'_>, steps: u32) {
    let width = (-13.0_f64).exp2();
    let tau = 0.5 / width;
    let [r, g, b] = COLOUR;
    let rows = [[0.0, 0.0], [0.5, 0.0], [0.5, tau], [0.5 + width, tau], [0.5 + width, 0.0], [1.0, 0.0]]
        .map(|[s, tau]| [s, r, g, b, tau]);
    let step = format!("{}", 1.0 / f64::from(steps));
    for (front, back) in [(0.0, 1.0), (1.0, 0.0)] {
        for scene in between(front, back, &transfer(&rows)) {
            let is_grid = scene.grid().is_some();
            let claims = |spec: &crate::extremes::catalogue::Spec| match spec.integrator {
                _ if spec.blurs(&scene.data) => false,
                "" | "midpoint" => !is_grid || steps >= 100_000,
                "full" => steps == 1 && is_grid,
                _ => steps < 100_000,
            };
            run.only(claims, &scene, &through(2, 2), &[("step", &step)], |spec, frame| {
                let alpha = f64::from(frame.image.pixel(0, 0)[3]);
                let error = if is_grid && spec.samples() { 1.0 / 12.2 } else { 1e-3 };
                near("opacity", alpha, opacity(1.0), error * (-1.0_f64).exp() + t32(f64::from(steps)))
            });
        }
    }
}

/// Every value of a type on a jump: the later knot holds, seen from both sides.
fn jumps(run: &mut Run<'_>) {
    let values = [0, 1, 2, 7, 100, 127, 128, 254, 255];
    for value in values {
        let samples = Samples::U8(vec![value; 8]);
        let grid = Grid::new([2; 3], samples).unwrap();
        let grid = grid.with_placement(DVec3::splat(2.0), DVec3::NEG_ONE, glam::DMat3::IDENTITY).unwrap();
        let value = f64::from(value);
        let rows = [[value - 1.0, 9.0], [value, 9.0], [value, 0.25]].map(|[s, tau]| [s, 0.25, 0.5, 1.0, tau]);
        let mesh = cube(1, Cut::Five, |_| value);
        for scene in [Scene::new(grid, transfer(&rows)), Scene::new(mesh, transfer(&rows))] {
            // Samplers may round even between equal samples.
            let options: &[(&str, &str)] = &[("step", "0.25"), ("filter", "exact")];
            for side in [DVec3::Z, DVec3::NEG_Z] {
                run.each(&scene, &along(side, DVec3::Y, 1, 1), options, |_, frame| {
                    near("opacity", frame.image.pixel(0, 0)[3].into(), opacity(0.5), t32(10.0))
                });
            }
        }
    }
}

/// A linear function, told by so many knots, in one step and in seven.
fn knots(run: &mut Run<'_>, count: u32) {
    let [r, g, b] = COLOUR;
    let rows: Vec<[f64; 5]> = (0..count)
        .map(|i| {
            let s = if count == 1 { 0.5 } else { f64::from(i) / f64::from(count - 1) };
            [s, r, g, b, s]
        })
        .collect();
    // Float32 knots: scalars and extinctions of each are rounded by 2^-25, and the pieces between two by no more. What cuts
    // at knots composites a piece for each.
    let tf = transfer(&rows);
    for steps in [1, 7] {
        let step = format!("{}", 1.0 / f64::from(steps));
        for scene in [between(0.0, 1.0, &tf), between(1.0, 0.0, &tf)].concat() {
            run.each(&scene, &through(2, 2), &[("step", &step)], |spec, frame| {
                let pieces =
                    f64::from(steps + 8) + if spec.integrator == "exact" { f64::from(count) } else { 0.0 };
                let bound = t32(pieces) + 1e-6;
                frame
                    .image
                    .pixels()
                    .iter()
                    .try_for_each(|p| near("opacity", p[3].into(), opacity(1.0), bound))
            });
        }
    }
}

const CASES: &[Case] = &[
    Case {
        number: "14",
        name: "front and back scalar equal",
        expect: "od = tau(s) d",
        tolerance: "1e-6 relative",
        run: |run| {
            for od in [1e-6, 1e-3, 1.0] {
                let scenes =
                    between(0.7, 0.7, &transfer(&[[0.0, 1.0, 1.0, 1.0, 0.0], [1.4, 1.0, 1.0, 1.0, od]]));
                expect(run, &scenes, 1, od, 1e-6 * od);
            }
        },
    },
    Case {
        number: "15a",
        name: "scalars 1 ulp apart",
        expect: "od = tau(middle) d",
        tolerance: "1e-4 relative",
        run: |run| nearly_equal(run, f64::from(0.9_f32.next_up()) - f64::from(0.9_f32)),
    },
    Case {
        number: "15b",
        name: "scalars 1e-7 apart",
        expect: "od = tau(middle) d",
        tolerance: "1e-4 relative",
        run: |run| nearly_equal(run, 1e-7),
    },
    Case {
        number: "15c",
        name: "scalars 1e-5 apart",
        expect: "od = tau(middle) d",
        tolerance: "1e-4 relative",
        run: |run| nearly_equal(run, 1e-5),
    },
    Case {
        number: "15d",
        name: "scalars 1e-3 apart",
        expect: "od = tau(middle) d",
        tolerance: "1e-4 relative",
        run: |run| nearly_equal(run, 1e-3),
    },
    Case {
        number: "16a",
        name: "both scalars below the knots",
        expect: "the first knot",
        tolerance: "t32(100)",
        run: |run| beyond(run, -5.0, -2.0),
    },
    Case {
        number: "16b",
        name: "both scalars above the knots",
        expect: "the last knot",
        tolerance: "t32(100)",
        run: |run| beyond(run, 3.0, 7.0),
    },
    Case {
        number: "16c",
        name: "scalars on both sides of all knots",
        expect: "constant, linear, constant",
        tolerance: "t32(100) + 1.5e-4 of kinks",
        run: |run| {
            beyond(run, -1.0, 3.0);
            beyond(run, 2.0, -1.5);
        },
    },
    Case {
        number: "17a",
        name: "peak of 2^-13 of the range, 1 step",
        expect: "1 - exp(-1)",
        tolerance: "1e-3 relative; not required of sampled techniques",
        run: |run| peak(run, 1),
    },
    Case {
        number: "17b",
        name: "peak of 2^-13 of the range, 7 steps",
        expect: "1 - exp(-1)",
        tolerance: "1e-3 relative; not required of sampled techniques and the 2-D table",
        run: |run| peak(run, 7),
    },
    Case {
        number: "17c",
        name: "peak of 2^-13 of the range, 1e5 samples",
        expect: "1 - exp(-1)",
        tolerance: "one sample of twelve",
        run: |run| peak(run, 100_000),
    },
    Case {
        number: "18",
        name: "jump exactly at a voxel's value",
        expect: "the later knot, from both sides",
        tolerance: "t32(10)",
        run: jumps,
    },
    Case {
        number: "19a",
        name: "1 knot",
        expect: "constant: 1 - exp(-1)",
        tolerance: "t32(pieces) + 1e-6",
        run: |run| knots(run, 1),
    },
    Case {
        number: "19b",
        name: "2 knots",
        expect: "linear: 1 - exp(-1)",
        tolerance: "t32(pieces) + 1e-6",
        run: |run| knots(run, 2),
    },
    Case {
        number: "19c",
        name: "65536 knots",
        expect: "linear: 1 - exp(-1)",
        tolerance: "t32(pieces) + 1e-6",
        run: |run| knots(run, 65_536),
    },
];
