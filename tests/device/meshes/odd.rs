//! Meshes that are no plain block: single cells, gaps, holes, seams, extremes of size and shape, special values.

use glam::DVec3;
use volraster::GpuScene;
use volraster::scene::{Camera, Field, Projection, Scene, TetScalars, Tets, View};

use crate::common::*;
use crate::meshes::support::*;

/// A tetrahedron about a point.
fn tet(at: [f64; 3], size: f64, scalars: [f32; 4]) -> Tets {
    let corner = |dx: f64, dy: f64, dz: f64| [at[0] + size * dx, at[1] + size * dy, at[2] + size * dz];
    mesh(
        &[corner(-1.0, -0.8, -0.6), corner(1.0, -0.7, -0.5), corner(0.1, 1.0, -0.4), corner(0.2, -0.1, 1.1)],
        &[[0, 1, 2, 3]],
        &scalars,
    )
}

fn views() -> [View; 3] {
    [view(perspective(), 1.0, 40, 32), view(orthographic(), 1.0, 40, 32), view(perspective(), 0.25, 40, 32)]
}

/// Every direction, and the two faces of each technique's sorting.
fn assert_all(gpu: &volraster::Gpu, what: &str, scene: &Scene) {
    for view in views() {
        let truth = truth(scene, &view);
        let on_gpu = GpuScene::new(gpu, scene.clone());
        for spec in
            ["havs", "havs:k=1,order=back-to-front", "abuffer", "abuffer:order=back-to-front", "havs:chunk=2"]
        {
            let image = draw_on(&on_gpu, &view, spec);
            let what = format!("{what}, eye {}, {spec}", view.camera().eye);
            assert_true(&what, &image, &truth, scene, &view, ROUNDING, 2);
        }
    }
}

#[test]
fn single_cells_and_gaps() {
    let gpu = gpu();
    let one = tet([0.0; 3], 1.0, [0.1, 0.9, 0.5, 0.3]);
    assert_all(&gpu, "one", &Scene::new(one.clone(), transfer(&HAZE)));
    // Towards the eye of the first view: one hides the other, a gap between.
    let two = both(
        &tet([-0.3, -0.2, -0.6], 0.5, [0.2, 0.8, 0.1, 0.6]),
        &tet([0.3, 0.2, 0.6], 0.5, [0.9, 0.1, 0.4, 0.7]),
    );
    assert_all(&gpu, "two", &Scene::new(two.clone(), transfer(&HAZE)));
    let far = both(&two, &tet([-0.7, 0.8, 0.7], 0.05, [1.0, 0.0, 0.5, 0.5]));
    assert_all(&gpu, "three sizes", &Scene::new(far, transfer(&HAZE)));
}

/// Cubes with a hole through the middle: lines leave and come in again, as they do where cells are vacuum.
#[test]
fn holes_and_cells_that_are_not_there() {
    let gpu = gpu();
    let base = Field::Ramp.tets(5).unwrap();
    let middle = |cell: &[u32; 4]| cell.iter().map(|&i| base.points()[i as usize]).sum::<DVec3>() / 4.0;
    let ring: Vec<[u32; 4]> = base
        .cells()
        .iter()
        .copied()
        .filter(|cell| {
            let p = middle(cell);
            p.x.abs().max(p.y.abs()) > 0.4 && p.z.abs() < 0.6
        })
        .collect();
    let ring = Tets::new(base.points().to_vec(), ring, base.scalars().clone()).unwrap().0;
    assert_all(&gpu, "ring", &Scene::new(ring, transfer(&HAZE)));

    let TetScalars::Point(values) = base.scalars().clone() else { panic!("scalars of cells") };
    for special in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut values = values.clone();
        for i in taken(3, [0, 43, 44, 86, 107, 130, 215]) {
            values[i] = special;
        }
        let mesh = base.clone().with_scalars(TetScalars::Point(values)).unwrap();
        assert_eq!(mesh.blank_count() > 0, special.is_nan());
        assert_all(&gpu, &format!("{special}"), &Scene::new(mesh, transfer(&HAZE)));
        let cells =
            (0..base.cells().len()).map(|i| if i % 5 == 1 { special } else { (i % 11) as f32 / 11.0 });
        let mesh = base.clone().with_scalars(TetScalars::Cell(cells.collect())).unwrap();
        assert_all(&gpu, &format!("{special} of cells"), &Scene::new(mesh, transfer(&HAZE)));
    }
}

/// Infinities are the ends of the transfer function that is in force.
#[test]
fn infinities_follow_the_transfer_function() {
    let gpu = gpu();
    let base = Field::Ramp.tets(3).unwrap();
    let TetScalars::Point(mut values) = base.scalars().clone() else { panic!("scalars of cells") };
    values[21] = f32::INFINITY;
    values[42] = f32::NEG_INFINITY;
    let scene = Scene::new(base.with_scalars(TetScalars::Point(values)).unwrap(), transfer(&HAZE));
    let wide = transfer(&[[-3.0, 1.0, 0.2, 0.1, 2.0], [2.0, 0.1, 0.5, 1.0, 0.5]]);
    let view = view(perspective(), 1.0, 30, 24);
    for spec in EXACT {
        let first = GpuScene::new(&gpu, scene.clone());
        let before = draw_on(&first, &view, spec);
        let changed = Scene::new(scene.data.clone(), wide.clone());
        let image = draw_on(&first.with_transfer(wide.clone()), &view, spec);
        assert_true(spec, &image, &truth(&changed, &view), &changed, &view, ROUNDING, 1);
        assert_eq!(draw_on(&first, &view, spec), before, "{spec}");
    }
}

/// Two blocks whose faces coincide but share no points: a line leaves one and enters the other at the same distance, in
/// either order. Scalars may jump there.
#[test]
fn seams_leave_no_trace() {
    let gpu = gpu();
    let tau = 1.3;
    let rows = [[0.0, 0.25, 0.5, 1.0, tau], [1.0, 0.25, 0.5, 1.0, tau]];
    let base = Field::Homogeneous(0.5).tets(2).unwrap();
    let left = moved(&base, |p| DVec3::new(0.5 * p.x - 0.5, p.y, p.z));
    let right = moved(&base, |p| DVec3::new(0.5 * p.x + 0.5, p.y, p.z));
    for halves in [both(&left, &right), both(&right, &left)] {
        let scene = GpuScene::new(&gpu, Scene::new(halves, transfer(&rows)));
        for view in views() {
            for spec in ["havs", "havs:k=1", "havs:order=back-to-front", "abuffer"] {
                let image = draw_on(&scene, &view, spec);
                for (i, pixel) in pixels(&view).filter(|(_, pixel)| !on_outline(&view, *pixel)) {
                    let alpha = -(-tau * chord(&view, pixel)).exp_m1();
                    let error = (f64::from(image.pixels()[i][3]) - alpha).abs();
                    assert!(error <= 4e-6, "{spec} at {pixel}: {error:e}");
                }
            }
        }
    }
    // Cut otherwise on either side, so that faces coincide in parts, and scalars jump.
    let finer = moved(&Field::Ramp.tets(3).unwrap(), |p| DVec3::new(0.5 * p.x + 0.5, p.y, p.z));
    let coarse = moved(&Field::Ramp.tets(2).unwrap(), |p| DVec3::new(0.5 * p.x - 0.5, p.y, p.z));
    assert_all(&gpu, "uneven seam", &Scene::new(both(&coarse, &finer), transfer(&HAZE)));
}

/// Meshes of any size anywhere, and cells a million times as long as thick.
#[test]
fn extremes_of_size_and_shape() {
    let gpu = gpu();
    let base = Field::Ramp.tets(3).unwrap();
    for (what, scale, at) in [
        ("tiny", DVec3::splat(1e-12), DVec3::ZERO),
        ("huge", DVec3::splat(1e12), DVec3::ZERO),
        ("far off", DVec3::splat(1.0), DVec3::new(1e6, -2e6, 3e6)),
        ("flat", DVec3::new(1.0, 1.0, 1e-4), DVec3::ZERO),
        ("long", DVec3::new(1.0, 1e-3, 1e-3), DVec3::ZERO),
    ] {
        let size = scale.max_element();
        // Optical depths do not depend on the size.
        let rows = HAZE.map(|[s, r, g, b, tau]| [s, r, g, b, tau / scale.min_element()]);
        let scene = Scene::new(moved(&base, |p| p * scale + at), transfer(&rows));
        for (projection, eye) in [
            (perspective(), DVec3::new(2.0, 1.5, 3.8)),
            (Projection::Orthographic { half_height: 1.6 * size }, DVec3::new(2.0, 1.5, 3.8)),
            (perspective(), DVec3::new(0.2, 0.3, 0.4)),
        ] {
            let camera = Camera { eye: eye * size + at, target: at, up: DVec3::Y, projection };
            let view = View::new(camera, 32, 26).unwrap();
            // Where the mesh is thin, lengths inside round as if it were not.
            let bound = ROUNDING.max(4e-7 * size / scale.min_element());
            let truth = truth(&scene, &view);
            let on_gpu = GpuScene::new(&gpu, scene.clone());
            for spec in EXACT {
                let image = draw_on(&on_gpu, &view, spec);
                let worst = assert_true(
                    &format!("{what} {spec} from {eye}"),
                    &image,
                    &truth,
                    &scene,
                    &view,
                    bound,
                    2,
                );
                println!("{what} {spec}: {worst:.1e}");
            }
        }
    }
    // Cells are shared by cells a thousand times their size.
    assert_drawn(&gpu, "needles", &Scene::new(needles(3), transfer(&HAZE)), &needles_view(40, 30), 3e-5);
    // Faces a thousand times as long as high, most of them seen nearly edge-on.
    let flat = moved(&Field::Blobs.tets(3).unwrap(), |p| p * DVec3::new(1.0, 1e-3, 1.0));
    let dense = HAZE.map(|[s, r, g, b, tau]| [s, r, g, b, tau * 300.0]);
    let scene = Scene::new(flat, transfer(&dense));
    for (name, eye) in [("above", DVec3::new(2.1, 1.4, 1.9)), ("beside", DVec3::new(2.1, 0.2, 1.9))] {
        let projection = Projection::Perspective { fov_y_deg: 30.0 };
        let view = View::new(Camera { eye, target: DVec3::ZERO, up: DVec3::Y, projection }, 60, 44).unwrap();
        // Depths are rounded by 1e-7 or so; along lines that are five times as steep, an extinction of 450 makes that 2e-4 and more.
        assert_drawn(&gpu, &format!("slivers from {name}"), &scene, &view, 1e-3);
    }
}

/// Points that no cell uses may lie anywhere.
#[test]
fn points_without_cells_do_not_count() {
    let gpu = gpu();
    let base = tet([0.0; 3], 1.0, [0.1, 0.9, 0.5, 0.3]);
    let more = [f64::NAN, f64::INFINITY, 1e300, -1e30].map(|x| DVec3::new(x, 0.0, -x));
    let points = [base.points(), &more].concat();
    let scalars = TetScalars::Point(vec![0.1, 0.9, 0.5, 0.3, f32::NAN, 0.0, f32::INFINITY, 1.0]);
    let stray = Tets::new(points, base.cells().to_vec(), scalars).unwrap().0;
    let (plain, stray) = (Scene::new(base, transfer(&HAZE)), Scene::new(stray, transfer(&HAZE)));
    let view = view(perspective(), 1.0, 40, 32);
    for spec in EXACT {
        assert_eq!(draw(&gpu, &plain, &view, spec), draw(&gpu, &stray, &view, spec), "{spec}");
    }
}
