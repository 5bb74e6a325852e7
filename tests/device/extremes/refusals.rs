//! What is refused before a device is asked.

use glam::{DMat3, DVec3};
use volraster::Technique;
use volraster::scene::{Camera, Grid, Projection, Samples, Scene, TetScalars, Tets, TransferFunction, View};

use crate::extremes::catalogue::{Case, Family, Run};
use crate::extremes::support::*;

pub static FAMILY: Family = Family::new("refusals", CASES);

fn knot(row: [f64; 5]) -> volraster::Result<TransferFunction> {
    TransferFunction::from_rows(&[row])
}

fn placed(spacing: DVec3, direction: DMat3) -> volraster::Result<Grid> {
    Grid::new([2; 3], Samples::U8(vec![0; 8])).unwrap().with_placement(spacing, DVec3::ZERO, direction)
}

fn camera(change: impl FnOnce(&mut Camera)) -> volraster::Result<View> {
    let mut camera = *look(DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, 42.0, 4).camera();
    change(&mut camera);
    View::new(camera, 4, 4)
}

/// So far away that float32 does not hold the rays.
fn beyond(run: &mut Run<'_>) {
    let view = camera(|camera| camera.eye = DVec3::Z * 1e39).unwrap();
    for scene in scenes(2, &fog(1.0), |_| 0.5) {
        run.each(&scene, &view, &[], |_, frame| {
            // Drawn, it is a cube that no pixel's centre need meet: but then it is nothing.
            finite(&frame.image)
        });
    }
}

/// Steps that make more slabs than are drawn.
fn steps(run: &mut Run<'_>) {
    let scene = Scene::new(grid([8; 3], DVec3::NEG_ONE, DVec3::ONE, affine), fog(1.0));
    run.every(&scene, &through(2, 2), &[("step", "1e-9")], |_, _| Err("drawn".to_string()));
    for step in ["0", "-1", "NaN", "inf"] {
        run.refuses("option", Technique::parse(&format!("slices-3d:step={step}")), &["step"]);
    }
}

/// A mean with NaN is none.
fn mips(run: &mut Run<'_>) {
    let field = |p: DVec3| if p.length() < 0.1 { f64::NAN } else { 0.5 };
    let scene = Scene::new(grid([9; 3], DVec3::NEG_ONE, DVec3::ONE, field), fog(1.0));
    let claims = |spec: &crate::extremes::catalogue::Spec| spec.has("prefilter");
    run.only(claims, &scene, &through(2, 2), &[("prefilter", "mip")], |_, _| Err("drawn".to_string()));
}

const CASES: &[Case] = &[
    Case {
        number: "8",
        name: "extinction negative, NaN, infinite",
        expect: "refused",
        tolerance: "",
        run: |run| {
            for tau in [-1e-9, f64::NAN, f64::INFINITY] {
                run.refuses("transfer function", knot([0.0, 1.0, 1.0, 1.0, tau]), &["extinction"]);
            }
        },
    },
    Case {
        number: "64",
        name: "colour negative, NaN, infinite",
        expect: "refused",
        tolerance: "",
        run: |run| {
            for red in [-1e-9, f64::NAN, f64::INFINITY] {
                run.refuses("transfer function", knot([0.0, red, 1.0, 1.0, 1.0]), &["colour"]);
            }
        },
    },
    Case {
        number: "16d",
        name: "knots at NaN, at infinity, none",
        expect: "refused",
        tolerance: "",
        run: |run| {
            for s in [f64::NAN, f64::INFINITY] {
                run.refuses("transfer function", knot([s, 1.0, 1.0, 1.0, 1.0]), &["scalar"]);
            }
            run.refuses("transfer function", TransferFunction::from_rows(&[]), &["0 knots"]);
        },
    },
    Case {
        number: "20d",
        name: "grids of 1 x 1 x 1, 1 x 1 x 9, 9 x 1 x 1",
        expect: "refused: a domain without a volume",
        tolerance: "",
        run: |run| {
            for dims in [[1, 1, 1], [1, 1, 9], [9, 1, 1]] {
                let samples = Samples::U8(vec![0; dims.iter().product::<u32>() as usize]);
                run.refuses("grid", Grid::new(dims, samples), &["at least 2"]);
            }
        },
    },
    Case {
        number: "23b",
        name: "axes in a plane, without length, NaN",
        expect: "refused",
        tolerance: "",
        run: |run| {
            let flat = DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::X + DVec3::Y);
            run.refuses("grid", placed(DVec3::ONE, flat), &["span space"]);
            run.refuses("grid", placed(DVec3::ONE, DMat3::ZERO), &["span space"]);
            run.refuses("grid", placed(DVec3::ONE, DMat3::NAN), &["finite"]);
            run.refuses("grid", placed(DVec3::new(1.0, 0.0, 1.0), DMat3::IDENTITY), &["positive"]);
        },
    },
    Case {
        number: "24b",
        name: "nothing but NaN",
        expect: "refused",
        tolerance: "",
        run: |run| {
            run.refuses("grid", Grid::new([2; 3], Samples::F32(vec![f32::NAN; 8])), &["finite"]);
            let mesh = cube(1, Cut::Five, |_| 0.5);
            run.refuses("mesh", mesh.with_scalars(TetScalars::Point(vec![f32::NAN; 8])), &["finite"]);
        },
    },
    Case {
        number: "37c",
        name: "angles of view of 0 and 180 degrees, NaN; no height",
        expect: "refused",
        tolerance: "",
        run: |run| {
            for fov_y_deg in [0.0, 180.0, f64::NAN] {
                let view = camera(|camera| camera.projection = Projection::Perspective { fov_y_deg });
                run.refuses("camera", view, &["fov_y_deg"]);
            }
            let view = camera(|camera| camera.projection = Projection::Orthographic { half_height: 0.0 });
            run.refuses("camera", view, &["half_height"]);
        },
    },
    Case {
        number: "39h",
        name: "eye at the target, up along the view, eye NaN, no image",
        expect: "refused",
        tolerance: "",
        run: |run| {
            run.refuses("camera", camera(|camera| camera.eye = camera.target), &["coincide"]);
            run.refuses("camera", camera(|camera| camera.up = DVec3::Z), &["parallel"]);
            run.refuses("camera", camera(|camera| camera.eye = DVec3::NAN), &["eye"]);
            run.refuses("camera", View::new(*through(1, 1).camera(), 0, 4), &["width"]);
            run.refuses("camera", View::new(*through(1, 1).camera(), 4, 40_000), &["height"]);
        },
    },
    Case {
        number: "35d",
        name: "eye 1e39 away, beyond float32",
        expect: "refused, or finite",
        tolerance: "",
        run: beyond,
    },
    Case {
        number: "43",
        name: "steps of 1e-9, 0, -1, NaN and infinity",
        expect: "refused",
        tolerance: "",
        run: steps,
    },
    Case { number: "61b", name: "mip levels of data with NaN", expect: "refused", tolerance: "", run: mips },
    Case {
        number: "55c",
        name: "a mesh of flat cells alone",
        expect: "refused",
        tolerance: "",
        run: |run| {
            let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::ONE - DVec3::Z];
            let mesh = Tets::new(points, vec![[0, 1, 2, 3]], TetScalars::Cell(vec![1.0]));
            run.refuses("mesh", mesh, &["volume"]);
        },
    },
];
