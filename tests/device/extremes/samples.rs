//! Samples that are no numbers, infinite, huge, tiny, and of every integer type up to its ends.

use glam::{DMat3, DVec3};
use volraster::reference;
use volraster::scene::{Grid, Rescale, Samples, Scene, TetScalars, Tets, TransferFunction};

use crate::common::*;
use crate::extremes::catalogue::{Case, Family, Run};
use crate::extremes::support::*;

pub static FAMILY: Family = Family::new("samples", CASES);

const EXACT: &[(&str, &str)] = &[("step", "0.25"), ("filter", "exact")];

/// The cube of 8 voxels a side with one sample replaced, as each kind of data: 4, 4, 4 and a corner.
fn with_sample(value: f32, transfer: &TransferFunction) -> Vec<[Scene; 2]> {
    let centre = grid([9; 3], DVec3::NEG_ONE, DVec3::ONE, affine);
    let Samples::F32(plain) = centre.samples().clone() else { return Vec::new() };
    let place = |values: Vec<f32>| {
        let grid = Grid::new([9; 3], Samples::F32(values)).unwrap();
        Scene::new(
            grid.with_placement(DVec3::splat(0.25), DVec3::NEG_ONE, DMat3::IDENTITY).unwrap(),
            transfer.clone(),
        )
    };
    let mesh = cube(8, Cut::Five, affine);
    let scalars = mesh.scalars().values().to_vec();
    let meshed = |values: Vec<f32>| {
        Scene::new(mesh.clone().with_scalars(TetScalars::Point(values)).unwrap(), transfer.clone())
    };
    let replaced = |mut values: Vec<f32>| {
        values[(4 * 9 + 4) * 9 + 4] = value;
        values[0] = value;
        values
    };
    vec![[place(plain.clone()), place(replaced(plain))], [meshed(scalars.clone()), meshed(replaced(scalars))]]
}

/// A NaN is vacuum in the cells that touch it, and nothing else changes: rays that pass none of them are the same to the
/// bit, others are the reference's. Steps end at the cells' faces along the axis; a piece that ends in one is half in
/// it by rounding, two of 1/16 of extinction up to 2.2, in slabs of sampled ends four.
fn not_a_number(run: &mut Run<'_>) {
    let view = through(9, 9);
    for [plain, damaged] in with_sample(f32::NAN, &ramp(ENDS[0], ENDS[1])) {
        let truth = truth(&damaged, &view);
        let is_grid = plain.grid().is_some();
        let options: &[(&str, &str)] = &[("step", "0.125"), ("filter", "exact")];
        run.pairs([&plain, &damaged], [&view; 2], [options; 2], |_, plain, damaged| {
            finite(damaged)?;
            let mut changed = 0;
            for (i, pixel) in pixels(&view) {
                let (origin, _) = view.ray(pixel);
                // Cells around 4, 4, 4 reach a quarter to each side.
                let touches = origin.x.abs().max(origin.y.abs()) < 0.2501;
                if touches {
                    let bound = if is_grid { 4.0 * ENDS[1] * 0.25 * 0.125 } else { t32(60.0) };
                    near(&format!("at {pixel}"), damaged.pixels()[i][3].into(), truth.pixels()[i][3], bound)?;
                    changed += usize::from(plain.pixels()[i] != damaged.pixels()[i]);
                } else if plain.pixels()[i] != damaged.pixels()[i] {
                    return Err(format!(
                        "{pixel} is not the same: {:?}, {:?}",
                        plain.pixels()[i],
                        damaged.pixels()[i]
                    ));
                }
            }
            if changed > 4 { Ok(()) } else { Err(format!("{changed} pixels see the NaN")) }
        });
    }
}

/// An infinity is the transfer function's end: the same image, to the bit, as that of a sample there.
fn infinite(run: &mut Run<'_>, value: f32, end: f32) {
    let transfer = ramp(ENDS[0], ENDS[1]);
    for (infinite, at_end) in with_sample(value, &transfer).into_iter().zip(with_sample(end, &transfer)) {
        run.every_pair([&infinite[1], &at_end[1]], [&through(7, 7); 2], [EXACT; 2], |_, a, b| {
            finite(a)?;
            equal("infinite", a, b)
        });
    }
}

/// Scalars times a factor, and the knots' with them: the same image but for rounding of the scalars.
fn scaled(run: &mut Run<'_>, factor: f64, bound: f64) {
    let rows = |k: f64| {
        let [r, g, b] = COLOUR;
        transfer(&[[0.0, r, g, b, ENDS[0]], [k, r, g, b, ENDS[1]]])
    };
    let view = through(5, 5);
    for scene in scenes(4, &rows(factor), |p| factor * affine(p)) {
        run.each(&scene, &view, EXACT, |_, frame| {
            finite(&frame.image)?;
            assert_depths(&frame.image, &view, |_| bound, |pixel| affine_depth(&view, pixel))
        });
    }
}

/// Denormal scalars may be zero on the device: the opacity is that of one or the other, or between.
fn denormal(run: &mut Run<'_>) {
    let [r, g, b] = COLOUR;
    let tf = transfer(&[[0.0, r, g, b, 0.5], [2e-39, r, g, b, 1.0]]);
    for scene in scenes(2, &tf, |_| 1e-39) {
        run.each(&scene, &through(2, 2), EXACT, |_, frame| {
            let alpha = f64::from(frame.image.pixel(0, 0)[3]);
            near(
                "opacity",
                alpha,
                0.5 * (opacity(1.0) + opacity(2.0)),
                0.5 * (opacity(2.0) - opacity(1.0)) + t32(20.0),
            )
        });
    }
    // Among ordinary knots they are nothing.
    for scene in scenes(2, &ramp(0.5, 1.0), |_| 1e-39) {
        run.each(&scene, &through(2, 2), EXACT, |_, frame| {
            near("opacity", frame.image.pixel(0, 0)[3].into(), opacity(1.0), t32(20.0))
        });
    }
}

/// One value of an integer type between two jumps that part it from its neighbours: 0.25 there, 9 elsewhere.
fn integer(run: &mut Run<'_>, samples: Samples, value: f64) {
    let [r, g, b] = COLOUR;
    let rows = [[value - 0.5, 9.0], [value - 0.5, 0.25], [value + 0.5, 0.25], [value + 0.5, 9.0]];
    let grid = Grid::new([2; 3], samples).unwrap();
    let grid = grid.with_placement(DVec3::splat(2.0), DVec3::NEG_ONE, DMat3::IDENTITY).unwrap();
    let scene = Scene::new(grid, transfer(&rows.map(|[s, tau]| [s, r, g, b, tau])));
    for filter in ["hardware", "exact"] {
        run.each(&scene, &through(1, 1), &[("step", "0.5"), ("filter", filter)], |_, frame| {
            near(&format!("{value}"), frame.image.pixel(0, 0)[3].into(), opacity(0.5), t32(8.0))
        });
    }
}

/// Codes of 8 and 16 bits, with a knot between two of them, against the same numbers in float32. Normalised codes are
/// scaled in float32: 2^-23 of the range, of an extinction that rises by 8 over it.
fn codes(run: &mut Run<'_>) {
    let [r, g, b] = COLOUR;
    let value = |i: usize| ((i * 37) % 256) as u8;
    let place = |samples, slope| {
        let grid = Grid::new([5, 4, 6], samples).unwrap();
        let grid =
            grid.with_placement(DVec3::new(0.5, 2.0 / 3.0, 0.4), DVec3::NEG_ONE, DMat3::IDENTITY).unwrap();
        grid.with_rescale(Rescale { slope, intercept: 0.0 }).unwrap()
    };
    let tf = transfer(&[[0.0, r, g, b, 0.2], [0.4981, r, g, b, 4.0], [1.0, r, g, b, 8.0]]);
    let bytes: Vec<u8> = (0..120).map(value).collect();
    let words = bytes.iter().map(|&v| u16::from(v) * 257).collect();
    let signed = bytes.iter().map(|&v| (i32::from(v) * 257 - 32768) as i16).collect();
    let floats = bytes.iter().map(|&v| f32::from(v) / 255.0).collect();
    let [plain, bytes, words] = [
        place(Samples::F32(floats), 1.0),
        place(Samples::U8(bytes), 1.0 / 255.0),
        place(Samples::U16(words), 1.0 / 65535.0),
    ]
    .map(|grid| Scene::new(grid, tf.clone()));
    let signed = place(Samples::I16(signed), 1.0)
        .with_rescale(Rescale { slope: 1.0 / 65535.0, intercept: 32768.0 / 65535.0 })
        .unwrap();
    let signed = Scene::new(signed, tf.clone());
    let view = view(perspective(), 1.0, 9, 9);
    for coded in [&bytes, &words, &signed] {
        run.pairs([&plain, coded], [&view; 2], [EXACT; 2], |_, a, b| {
            near("apart", apart(a, b), 0.0, t32(40.0) + 8.0 * 3.5 * (-23.0_f64).exp2())
        });
    }
}

/// Axes that mirror and shear: the field of the place is the same, so the image is.
fn oblique(run: &mut Run<'_>) {
    let mirror = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
    let cyclic = DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X);
    let shear =
        DMat3::from_cols(DVec3::new(1.0, 0.3, 0.0), DVec3::new(-0.2, 0.0, 1.0), DVec3::new(0.1, 0.9, 0.4));
    let view = view(perspective(), 1.0, 12, 12);
    for direction in [mirror, cyclic, shear] {
        let dims = [5, 6, 7];
        let spacing = DVec3::new(0.4, 0.3, 0.25);
        let origin = -(direction * (spacing * DVec3::new(4.0, 5.0, 6.0) * 0.5));
        let mut values = Vec::new();
        for z in 0..7 {
            for y in 0..6 {
                for x in 0..5 {
                    let index = DVec3::new(x.into(), y.into(), z.into());
                    values.push((0.4 * affine(origin + direction * (spacing * index)) + 0.3) as f32);
                }
            }
        }
        let grid = Grid::new(dims, Samples::F32(values)).unwrap();
        let scene =
            Scene::new(grid.with_placement(spacing, origin, direction).unwrap(), ramp(ENDS[0], ENDS[1]));
        let truth = truth(&scene, &view);
        let value = |pixel| {
            let (origin, direction) = view.ray(pixel);
            reference::ray(&scene, origin, direction, [0.0, f64::INFINITY]).unwrap()[3]
        };
        let warps: Vec<f64> = pixels(&view).map(|(_, pixel)| warped(pixel, 0.25, value)).collect();
        run.each(&scene, &view, FINE, |spec, frame| {
            // Rays that the outline passes within 1/64 pixel see it or not.
            let edge = |pixel: glam::DVec2| {
                let at = |pixel| {
                    let (origin, direction) = view.ray(pixel);
                    reference::ray(&scene, origin, direction, [0.0, f64::INFINITY]).unwrap()[3] > 0.0
                };
                (0..8).any(|i| {
                    let angle = f64::from(i) / 8.0 * std::f64::consts::TAU;
                    at(pixel + glam::DVec2::new(angle.cos(), angle.sin()) / 64.0) != at(pixel)
                })
            };
            for (i, pixel) in pixels(&view).filter(|(_, pixel)| !edge(*pixel)) {
                // As in the tests of cameras: 8 units of 2^-24, along the ray up to 20 times as much, extinction up to 2.2.
                let warp = if spec.warps() { warps[i] } else { 0.0 };
                let bound = t32(60.0) + 2.2 * 2.0 * 20.0 * 8.0 * (-24.0_f64).exp2() + warp;
                near(&format!("at {pixel}"), frame.image.pixels()[i][3].into(), truth.pixels()[i][3], bound)?;
            }
            Ok(())
        });
    }
}

/// Scalars of points that no cell uses, of any kind, change nothing.
fn unused(run: &mut Run<'_>) {
    let mesh = cube(2, Cut::Six, affine);
    let more = [f64::NAN, f64::INFINITY, 1e300].map(|x| DVec3::new(x, -x, 0.0));
    let points = [mesh.points(), &more].concat();
    let scalars = [mesh.scalars().values(), &[f32::NAN, f32::NEG_INFINITY, f32::MAX]].concat();
    let stray = Tets::new(points, mesh.cells().to_vec(), TetScalars::Point(scalars)).unwrap().0;
    let [a, b] = [mesh, stray].map(|mesh| Scene::new(mesh, ramp(ENDS[0], ENDS[1])));
    run.pairs([&a, &b], [&through(6, 6); 2], [EXACT; 2], |_, a, b| equal("stray points", a, b));
}

const CASES: &[Case] = &[
    Case {
        number: "23",
        name: "axes that mirror, turn and shear",
        expect: "the reference",
        tolerance: "t32(60) + 4.2e-5 along flat rays",
        run: oblique,
    },
    Case {
        number: "24",
        name: "one NaN inside, one at a corner",
        expect: "vacuum in the cells that touch it",
        tolerance: "elsewhere exact; inside a quarter of a voxel, meshes t32(60)",
        run: not_a_number,
    },
    Case {
        number: "25a",
        name: "one sample infinite",
        expect: "as the last knot's scalar",
        tolerance: "exact",
        run: |run| infinite(run, f32::INFINITY, 1.0),
    },
    Case {
        number: "25b",
        name: "one sample negative infinite",
        expect: "as the first knot's scalar",
        tolerance: "exact",
        run: |run| infinite(run, f32::NEG_INFINITY, 0.0),
    },
    Case {
        number: "26a",
        name: "scalars up to 65504 x 2, beyond half floats",
        expect: "closed form",
        tolerance: "t32(60)",
        run: |run| scaled(run, 131_008.0, t32(60.0)),
    },
    Case {
        number: "26b",
        name: "scalars up to 1e30",
        expect: "closed form",
        tolerance: "t32(60)",
        run: |run| scaled(run, 1e30, t32(60.0)),
    },
    Case {
        number: "27a",
        name: "scalars as small as subnormal half floats, 1e-5",
        expect: "closed form",
        tolerance: "t32(60)",
        run: |run| scaled(run, 1e-5, t32(60.0)),
    },
    Case {
        number: "27b",
        name: "scalars up to 1e-20",
        expect: "closed form",
        tolerance: "t32(60)",
        run: |run| scaled(run, 1e-20, t32(60.0)),
    },
    Case {
        number: "27c",
        name: "subnormal float32 scalars",
        expect: "that of the scalar, of zero, or between",
        tolerance: "t32(20)",
        run: denormal,
    },
    Case {
        number: "28a",
        name: "u8 at both ends",
        expect: "distinct from its neighbours",
        tolerance: "t32(8)",
        run: |run| {
            for value in [0, 1, 254, 255] {
                integer(run, Samples::U8(vec![value; 8]), value.into());
            }
        },
    },
    Case {
        number: "28b",
        name: "u16 at both ends",
        expect: "distinct from its neighbours",
        tolerance: "t32(8)",
        run: |run| {
            for value in [0, 1, 65534, 65535] {
                integer(run, Samples::U16(vec![value; 8]), value.into());
            }
        },
    },
    Case {
        number: "28c",
        name: "i16 at both ends, -32768 and -32767",
        expect: "distinct from its neighbours",
        tolerance: "t32(8)",
        run: |run| {
            for value in [-32768, -32767, -1, 0, 32767] {
                integer(run, Samples::I16(vec![value; 8]), value.into());
            }
        },
    },
    Case {
        number: "29",
        name: "codes of 8 and 16 bits, a knot between two",
        expect: "as float32",
        tolerance: "t32(40) + 3.4e-6",
        run: codes,
    },
    Case {
        number: "25c",
        name: "points that no cell uses: NaN, infinite, far",
        expect: "as without them",
        tolerance: "exact",
        run: unused,
    },
];
