//! Cells thin, long, flat, inverted, doubled, cut in several ways, and in a cycle.

use glam::DVec3;
use volraster::scene::{Scene, TetScalars, Tets};

use crate::common::*;
use crate::extremes::catalogue::{Case, Family, Run};
use crate::extremes::support::*;

pub static FAMILY: Family = Family::new("meshes", CASES);

const TAU: f64 = 0.9;

/// Half a cube, homogeneous, seen from in front, obliquely, and along the layers' planes: `1 - exp(-tau chord)`.
fn homogeneous(run: &mut Run<'_>, mesh: Tets, pieces: f64) {
    let scene = Scene::new(mesh, fog(TAU));
    for view in [through(9, 9), view(perspective(), 1.0, 12, 10), view(perspective(), 0.1, 12, 10)] {
        run.each(&scene, &view, &[], |_, frame| {
            // A ray is off by 2^-23 of the cube's radius at each end, and by up to 20 times as much where it is flat.
            let bound = t32(pieces) + TAU * 2.0 * 20.0 * 2e-7;
            assert_depths(&frame.image, &view, |_| bound, |pixel| TAU * chord(&view, pixel))
        });
    }
}

/// A layer of cells so thin between two of ordinary size: it adds what it holds, and its neighbours meet.
fn layer(run: &mut Run<'_>, thickness: f64) {
    let sides = planes(2);
    let z = [-1.0, 0.3, 0.3 + thickness, 1.0];
    homogeneous(run, blocks([&sides, &sides, &z], Cut::Six, |_| 0.5), 40.0);
    let x = [-1.0, 0.017, 0.017 + thickness, 1.0];
    homogeneous(run, blocks([&x, &sides, &sides], Cut::Five, |_| 0.5), 40.0);
}

/// One cell of a height of 1e-7 seen from the side of its base: no more than extinction times its thickness.
fn sliver(run: &mut Run<'_>) {
    for height in [1e-3, 1e-7, 1e-12] {
        let points = vec![
            DVec3::new(-0.9, -0.8, 0.0),
            DVec3::new(0.9, -0.7, 0.0),
            DVec3::new(0.1, 0.9, 0.0),
            DVec3::new(0.05, -0.1, height),
        ];
        let mesh = Tets::new(points, vec![[0, 1, 2, 3]], TetScalars::Point(vec![0.5; 4])).unwrap().0;
        let tau = 2.0;
        let scene = Scene::new(mesh, fog(tau));
        for view in [through(9, 9), view(perspective(), 1.0, 12, 10)] {
            run.each(&scene, &view, &[], |_, frame| {
                finite(&frame.image)?;
                for (i, pixel) in pixels(&view) {
                    let (_, direction) = view.ray(pixel);
                    let most = opacity(tau * height / direction.z.abs());
                    let alpha = f64::from(frame.image.pixels()[i][3]);
                    if !(-1e-12..=most + 1e-5).contains(&alpha) {
                        return Err(format!("height {height:e} at {pixel}: {alpha} is not 0 to {most}"));
                    }
                }
                Ok(())
            });
        }
    }
}

const NEEDLE: f64 = 1e-4;

/// A box 10,000 times as long as wide, seen along it and from the side, near its middle.
fn needle(run: &mut Run<'_>) {
    let thin = NEEDLE;
    let sides = [-thin, 0.1 * thin, thin];
    let mesh = blocks([&sides, &sides, &planes(2)], Cut::Five, |_| 0.5);
    // From the side optical depth is that of 2e-4, from the end that of 2.
    for (eye, up, tau, length) in [(DVec3::X, DVec3::Z, 4e3, 2.0 * thin), (DVec3::Z, DVec3::Y, 0.6, 2.0)] {
        let projection = volraster::scene::Projection::Orthographic { half_height: 0.3 * thin };
        let aside = DVec3::new(0.37, 0.41, 0.43) * (0.5 * thin);
        let camera = volraster::scene::Camera { eye: eye * 3.0 + aside, target: aside, up, projection };
        let view = volraster::scene::View::new(camera, 4, 4).unwrap();
        let scene = Scene::new(mesh.clone(), fog(tau));
        run.each(&scene, &view, &[], |_, frame| {
            // Places are rounded to 2^-23 of the radius, 1: of a thickness of 2e-4 that is 0.06 % at either end.
            let relative = if length < 1.0 { 2.0 * (-23.0_f64).exp2() / length } else { 0.0 };
            let od = tau * length;
            let bound = t32(20.0) + relative * od * (-od * (1.0 - relative)).exp();
            frame.image.pixels().iter().try_for_each(|p| near("opacity", p[3].into(), opacity(od), bound))
        });
    }
}

/// The affine cube with its cells turned over, flat ones among them, and points twice.
fn mended(run: &mut Run<'_>) {
    let plain = cube(2, Cut::Five, affine);
    let mut cells: Vec<[u32; 4]> = plain.cells().iter().map(|&[a, b, c, d]| [b, a, c, d]).collect();
    // Four corners of a square, a corner twice.
    cells.extend([[0, 1, 3, 4], [0, 0, 5, 13], [2, 8, 5, 2]]);
    let turned = Tets::new(plain.points().to_vec(), cells, plain.scalars().clone()).unwrap();
    run.check(turned.1.flat == 3 && turned.1.reoriented > 0, || format!("{:?}", turned.1));
    let scenes = [plain, turned.0].map(|mesh| Scene::new(mesh, ramp(ENDS[0], ENDS[1])));
    for view in [through(9, 9), view(perspective(), 0.1, 10, 10)] {
        run.pairs([&scenes[0], &scenes[1]], [&view; 2], [&[]; 2], |_, a, b| {
            near("apart", apart(a, b), 0.0, t32(20.0))?;
            assert_depths(a, &view, |_| t32(20.0) + 4e-6, |pixel| affine_depth(&view, pixel))
        });
    }
}

/// Every cell has points of its own: faces coincide, and are not shared.
fn soup(run: &mut Run<'_>) {
    let mesh = cube(2, Cut::Five, |_| 0.5);
    let points: Vec<DVec3> = mesh.cells().iter().flatten().map(|&i| mesh.points()[i as usize]).collect();
    let cells = (0..mesh.cells().len() as u32).map(|i| [4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 3]).collect();
    let scalars = TetScalars::Point(vec![0.5; points.len()]);
    homogeneous(run, Tets::new(points, cells, scalars).unwrap().0, 20.0);
}

/// A cube cut in 5, 6 and 24: the affine field is the same in all.
fn cuts(run: &mut Run<'_>, cut: Cut) {
    let scene = Scene::new(cube(1, cut, affine), ramp(ENDS[0], ENDS[1]));
    for view in [through(9, 9), view(perspective(), 1.0, 12, 10), view(perspective(), 0.1, 12, 10)] {
        run.each(&scene, &view, &[], |_, frame| {
            // As for `homogeneous`, of an extinction up to 2.2.
            let bound = t32(12.0) + 2.2 * 2.0 * 20.0 * 2e-7;
            assert_depths(&frame.image, &view, |_| bound, |pixel| affine_depth(&view, pixel))
        });
    }
}

/// Three bars of cells of which each hides the next: no order of cells is right, and yet every pixel has one.
fn cycle(run: &mut Run<'_>) {
    let mut points = Vec::new();
    let mut cells = Vec::new();
    let mut scalars = Vec::new();
    for i in 0..3 {
        let angle = f64::from(i) * std::f64::consts::TAU / 3.0;
        let turn = |p: DVec3| {
            let (sin, cos) = angle.sin_cos();
            DVec3::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y, p.z)
        };
        // Along x at y = -0.35, from far at one end to near at the other.
        let bar = [(-0.95, -0.45), (0.95, 0.45)].map(|(x, z)| DVec3::new(x, -0.35, z));
        let first = points.len() as u32;
        for p in [
            bar[0] - DVec3::Y * 0.15,
            bar[0] + DVec3::Y * 0.15,
            bar[1] - DVec3::Y * 0.15,
            bar[1] + DVec3::new(0.0, 0.15, 0.08),
        ] {
            points.push(turn(p));
            scalars.push(0.1 + 0.4 * i as f32);
        }
        cells.push([first, first + 1, first + 2, first + 3]);
    }
    let mesh = Tets::new(points, cells, TetScalars::Point(scalars)).unwrap().0;
    let rows = [
        [0.0, 1.0, 0.0, 0.0, 30.0],
        [0.3, 0.0, 1.0, 0.0, 30.0],
        [0.6, 0.0, 1.0, 0.0, 30.0],
        [1.0, 0.0, 0.0, 1.0, 30.0],
    ];
    let scene = Scene::new(mesh, transfer(&rows));
    let view = along(DVec3::Z, DVec3::Y, 24, 24);
    let truth = truth(&scene, &view);
    // Raster blends whole cells one after the other, and has no lists to repair a pixel from.
    let ordered =
        |spec: &crate::extremes::catalogue::Spec| spec.route != "raster" && spec.integrator == "exact";
    run.only(ordered, &scene, &view, &[], |_, frame| {
        let mut off = 0;
        for (i, _) in pixels(&view) {
            let difference = (0..4)
                .map(|c| (f64::from(frame.image.pixels()[i][c]) - truth.pixels()[i][c]).abs())
                .fold(0.0, f64::max);
            off += usize::from(difference > 2e-4);
        }
        // Pixels within rounding of a silhouette.
        if off <= 1 { Ok(()) } else { Err(format!("{off} pixels are wrong")) }
    });
}

/// So many layers that a line meets more cells than some devices' loops have turns.
fn very_deep(run: &mut Run<'_>) {
    let layers = 15_000;
    let scene = Scene::new(layered(layers, |_| 0.5), fog(0.5));
    let right = |_: &crate::extremes::catalogue::Spec, frame: &crate::extremes::catalogue::Frame| {
        near("opacity", frame.image.pixel(0, 0)[3].into(), opacity(1.0), t32(3.0 * f64::from(layers)))
    };
    run.only(|spec| spec.integrator == "exact", &scene, &through(1, 1), &[], right);
    // Cut into dispatches it fits any device.
    let cut = |spec: &crate::extremes::catalogue::Spec| {
        spec.integrator == "exact" && spec.has("chunk") && spec.route == "compute"
    };
    run.only(cut, &scene, &through(1, 1), &[("chunk", "5000")], right);
}

const CASES: &[Case] = &[
    Case {
        number: "4e",
        name: "homogeneous, od 1 in 15,000 layers of cells",
        expect: "0.6321206",
        tolerance: "t32(45000)",
        run: very_deep,
    },
    Case {
        number: "54a",
        name: "layer of cells 1e-3 thin between others",
        expect: "1 - exp(-tau chord)",
        tolerance: "t32(40) + 7e-6",
        run: |run| layer(run, 1e-3),
    },
    Case {
        number: "54b",
        name: "layer of cells 1e-5 thin between others",
        expect: "1 - exp(-tau chord)",
        tolerance: "t32(40) + 7e-6",
        run: |run| layer(run, 1e-5),
    },
    Case {
        number: "54c",
        name: "layer of cells 1e-7 thin, below float32, between others",
        expect: "1 - exp(-tau chord)",
        tolerance: "t32(40) + 7e-6",
        run: |run| layer(run, 1e-7),
    },
    Case {
        number: "54d",
        name: "layer of cells 1e-12 thin between others",
        expect: "1 - exp(-tau chord)",
        tolerance: "t32(40) + 7e-6",
        run: |run| layer(run, 1e-12),
    },
    Case {
        number: "54e",
        name: "slivers of a height of 1e-3, 1e-7, 1e-12",
        expect: "od <= tau height / cos",
        tolerance: "1e-5",
        run: sliver,
    },
    Case {
        number: "54f",
        name: "needles of 1e4 : 1, from the side and from the end",
        expect: "1 - exp(-tau chord)",
        tolerance: "t32(20); from the side 2^-23 of the length",
        run: needle,
    },
    Case {
        number: "55a",
        name: "inverted and flat cells, points used twice",
        expect: "as without",
        tolerance: "t32(20)",
        run: mended,
    },
    Case {
        number: "55b",
        name: "every cell with points of its own",
        expect: "1 - exp(-tau chord)",
        tolerance: "t32(20) + 7e-6",
        run: soup,
    },
    Case {
        number: "56a",
        name: "cube cut in 5",
        expect: "closed form of the box",
        tolerance: "t32(12) + 1.8e-5 along flat rays",
        run: |run| cuts(run, Cut::Five),
    },
    Case {
        number: "56b",
        name: "cube cut in 6",
        expect: "closed form of the box",
        tolerance: "t32(12) + 1.8e-5 along flat rays",
        run: |run| cuts(run, Cut::Six),
    },
    Case {
        number: "56c",
        name: "cube cut in 24",
        expect: "closed form of the box",
        tolerance: "t32(12) + 1.8e-5 along flat rays",
        run: |run| cuts(run, Cut::TwentyFour),
    },
    Case {
        number: "58",
        name: "three cells that hide each other in a cycle",
        expect: "the reference, by routes that order pixels",
        tolerance: "2e-4; one pixel at silhouettes",
        run: cycle,
    },
];
