//! Closed forms, and the reference of the same field on a grid.

use glam::DVec3;
use volraster::GpuScene;
use volraster::measure::ImageErrors;
use volraster::reference;
use volraster::scene::{Camera, Field, Projection, Scene, View};

use crate::common::*;
use crate::meshes::support::*;

const ROWS: [[f64; 5]; 4] = [
    [0.0, 0.1, 0.9, 0.4, 0.0],
    [0.3, 0.3, 0.5, 0.4, 2.0],
    [0.5, 0.9, 0.2, 0.5, 0.1],
    [1.0, 0.9, 0.2, 0.5, 3.0],
];

/// From afar, the angle of view narrowed so that the mesh fills the image as it does from nearby.
fn afar(distance: f64, width: u32, height: u32) -> View {
    let near = camera(perspective(), 1.0);
    let half = 21.0_f64.to_radians().tan() / distance;
    let projection = Projection::Perspective { fov_y_deg: 2.0 * half.atan().to_degrees() };
    View::new(Camera { eye: near.eye * distance, projection, ..near }, width, height).unwrap()
}

/// An affine field is the same on a grid and on cubes of tetrahedra, from near, from inside and from afar.
///
/// Bounds: `exact` has rounding alone. `full` blurs knots over a node of its table, 1/255 of the range, in which the
/// extinction's bend is off by at most its slope times a quarter of that, over the mean path through such a layer.
/// `integral` takes the colour of a cell as if the cell did not hide itself: second order in the optical depth of a
/// cell, here 3 x 0.6 at most.
#[test]
fn affine_fields_look_as_on_a_grid() {
    let gpu = gpu();
    let grid = scene(Field::Ramp, 9, "f32", &ROWS);
    let on_gpu = GpuScene::new(&gpu, cubes(Field::Ramp, 6, &ROWS));
    let views = [
        view(perspective(), 1.0, 48, 40),
        view(perspective(), 0.1, 48, 40),
        view(orthographic(), 1.0, 48, 40),
        view(orthographic(), 1e5, 48, 40),
        afar(1e5, 48, 40),
        afar(1e6, 48, 40),
    ];
    for view in views {
        let truth = truth(&grid, &view);
        let seen = truth.pixels().iter().filter(|p| p[3] > 0.1).count();
        assert!(seen > 300, "{seen} pixels");
        for method in EXACT {
            for (integrator, rmse) in [("exact", 1e-6), ("full", 1e-4), ("integral", 3e-3)] {
                let image = draw_on(&on_gpu, &view, &format!("{method}:integrator={integrator}"));
                let errors = ImageErrors::between_f64(&image, &truth).unwrap();
                let what = format!("{:?} {method} {integrator}: {errors}", view.camera());
                println!("{what}");
                assert!(errors.all.rmse <= rmse, "{what}");
                if integrator == "exact" {
                    assert_true(&what, &image, &truth, &grid, &view, ROUNDING, 1);
                }
            }
        }
    }
}

/// `integral` is second order in the size of cells.
#[test]
fn cells_of_half_the_size_have_a_quarter_of_the_error() {
    let gpu = gpu();
    // Smooth: knots alone would be exact.
    let rows = [[0.0, 0.1, 0.9, 0.4, 0.5], [1.0, 0.9, 0.2, 0.5, 3.0]];
    let grid = scene(Field::Ramp, 5, "f32", &rows);
    let view = view(perspective(), 1.0, 40, 32);
    let truth = truth(&grid, &view);
    for method in EXACT {
        let error = |n| {
            let image =
                draw(&gpu, &cubes(Field::Ramp, n, &rows), &view, &format!("{method}:integrator=integral"));
            ImageErrors::between_f64(&image, &truth).unwrap().all.rmse
        };
        let [a, b, c] = [error(2), error(4), error(8)];
        println!("{method}: {a:.2e} {b:.2e} {c:.2e}");
        assert!((3.0..5.5).contains(&(a / b)) && (3.0..5.5).contains(&(b / c)), "{a} {b} {c}");
    }
}

/// Extinction proportional to the scalar: the optical depth is the mean of an affine field's ends times the length.
#[test]
fn smoke_of_an_affine_field_is_a_closed_form() {
    let gpu = gpu();
    let rows = [[0.0, 0.25, 0.5, 1.0, 7.0], [1.0, 0.25, 0.5, 1.0, 9.0]];
    let scene = cubes(Field::Ramp, 5, &rows);
    let on_gpu = GpuScene::new(&gpu, scene);
    for view in [
        view(perspective(), 1.0, 40, 32),
        view(perspective(), 0.1, 40, 32),
        view(orthographic(), 1.0, 40, 32),
    ] {
        for (spec, scale) in
            [("havs", 1.0), ("abuffer", 1.0), ("havs", 6.5), ("havs:order=back-to-front", 2.0)]
        {
            let join = if spec.contains(':') { "," } else { ":" };
            let image = draw_on(&on_gpu, &view, &format!("{spec}{join}integrator=smoke,smoke={scale}"));
            for (i, pixel) in pixels(&view).filter(|(_, pixel)| !on_outline(&view, *pixel)) {
                let (origin, direction) = view.ray(pixel);
                let length = chord(&view, pixel);
                // The middle of the chord.
                let first = if view.is_perspective() { 0.0 } else { f64::NEG_INFINITY };
                let begin = (0..3).fold(first, |t, axis| {
                    let side = |at: f64| (at - origin[axis]) / direction[axis];
                    t.max(side(-1.0).min(side(1.0)))
                });
                let mean = Field::Ramp.value(origin + direction * (begin + 0.5 * length));
                let alpha = if length > 0.0 { -(-scale * mean * length).exp_m1() } else { 0.0 };
                let want = [0.25 * alpha, 0.5 * alpha, alpha, alpha];
                // At most 30 cells, of 1.2e-7 each; the scalars' own rounding.
                let error = difference(image.pixels()[i], want);
                assert!(error <= 5e-6, "{spec} {scale} at {pixel}: {:?} is not {want:?}", image.pixels()[i]);
            }
        }
    }
}

/// The bound of every technique: `max(2e-6, 1.2e-7 N)` for N pieces, and the rounding of the eye's distance.
#[track_caller]
fn assert_homogeneous(what: &str, image: &volraster::Image, view: &View, tau: f64, cubes: f64) -> usize {
    let mut excused = 0;
    let eye = view.camera().eye.length();
    for (i, pixel) in pixels(view) {
        let length = chord(view, pixel);
        // Planes of faces that a line crosses, and thick pieces that are cut.
        let count = 8.0 * cubes + 2.0 * tau * length;
        let bound = (1.2e-7 * count).max(2e-6) + 4.0 * (-24.0_f64).exp2() * tau * eye;
        let [r, g, b, a] = image.pixels()[i].map(f64::from);
        let colour = (r - 0.25 * a).abs().max((g - 0.5 * a).abs()).max((b - a).abs());
        assert!(colour <= bound, "{what} at {pixel}: colour {r} {g} {b} of alpha {a}");
        let alpha = -(-tau * length).exp_m1();
        if (a - alpha).abs() > bound {
            if !on_outline(view, pixel) {
                println!("BAD {what} at {pixel}: {a} is not {alpha} within {bound:e}");
            }
            excused += 1;
        }
    }
    excused
}

/// A homogeneous cube has opacity `1 - exp(-tau d)`, however it is cut into tetrahedra: a gap between two, or a place
/// that two cover, would be seen. Orders of two techniques, both directions, from outside and inside.
#[test]
fn a_homogeneous_cube_is_exact() {
    let gpu = gpu();
    let (mut excused, mut seen) = (0, 0);
    for tau in [0.05, 1.0, 25.0] {
        let rows = [[0.0, 0.25, 0.5, 1.0, tau]];
        for n in [1, 4] {
            let scene = GpuScene::new(&gpu, cubes(Field::Homogeneous(1.0), n, &rows));
            for (projection, distance) in
                [(perspective(), 1.0), (perspective(), 0.12), (perspective(), 0.3), (orthographic(), 1.0)]
            {
                let view = view(projection, distance, 45, 38);
                for spec in ["havs", "havs:order=back-to-front,k=2", "abuffer", "abuffer:order=back-to-front"]
                {
                    let image = draw_on(&scene, &view, spec);
                    let what = format!("tau {tau}, {n} cubes, {projection:?} x {distance}, {spec}");
                    excused += assert_homogeneous(&what, &image, &view, tau, f64::from(n));
                    seen += image.pixels().len();
                }
            }
        }
    }
    println!("{excused} of {seen} pixels are excused");
    assert!(excused * 1000 <= seen, "{excused} of {seen}");
}

/// Parallel rays along the axes that pass exactly through corners and edges of cells: each is moved aside by the same
/// infinitesimal step for all cells, so that none is missed and none counts twice. On the outline itself a ray is inside or
/// outside, nothing between.
#[test]
fn rays_through_corners_and_edges_are_in_one_cell_each() {
    let gpu = gpu();
    let tau = 0.7;
    let rows = [[0.0, 0.25, 0.5, 1.0, tau]];
    let mut excused = 0;
    let mut seen = 0;
    let mut bad = std::collections::BTreeMap::new();
    for n in [2, 4, 8, 6] {
        let scene = GpuScene::new(&gpu, cubes(Field::Homogeneous(1.0), n, &rows));
        for axis in [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z] {
            for up in [DVec3::X, DVec3::NEG_Z, DVec3::Y].into_iter().filter(|up| up.dot(axis) == 0.0) {
                // Pixels 1/8 apart, the middle one on the axis.
                let projection = Projection::Orthographic { half_height: 19.0 / 16.0 };
                let camera = Camera { eye: axis * 3.0, target: DVec3::ZERO, up, projection };
                let view = View::new(camera, 19, 19).unwrap();
                for spec in ["havs", "abuffer", "havs:k=1,order=back-to-front"] {
                    let image = draw_on(&scene, &view, spec);
                    for (i, pixel) in pixels(&view) {
                        let p = (pixel - 9.5).abs().max_element() / 8.0;
                        let full = -(-2.0 * tau).exp_m1();
                        let a = f64::from(image.pixels()[i][3]);
                        let (out, within) = (a.abs() <= 1e-12, (a - full).abs() <= 3e-6);
                        let what = format!("{n} cubes along {axis}, up {up}, {spec} at {pixel}: {a}, {full}");
                        if p == 1.0 {
                            assert!(out || within, "{what}");
                            excused += usize::from(out);
                        } else {
                            if !(if p < 1.0 { within } else { out }) {
                                *bad.entry((n, spec)).or_insert(0) += 1;
                            }
                        }
                        seen += 1;
                    }
                }
            }
        }
    }
    println!("{excused} of {seen} on the outline are outside {bad:?}");
    // A line that meets an edge exactly may slip through where rounding moves it.
    assert!(bad.values().all(|&bad| bad * 3000 <= seen), "{bad:?} of {seen}");
    assert!(excused > 0 && excused < seen / 4);
}

/// The eye on a corner, on an edge and on a face inside of the mesh, and rays along edges.
#[test]
fn the_eye_may_lie_on_corners_edges_and_faces() {
    let gpu = gpu();
    let tau = 0.7;
    let rows = [[0.0, 0.25, 0.5, 1.0, tau]];
    let scene = GpuScene::new(&gpu, cubes(Field::Homogeneous(1.0), 4, &rows));
    let (mut excused, mut seen) = (0, 0);
    for eye in
        [DVec3::ZERO, DVec3::new(0.25, 0.25, 0.0), DVec3::new(0.5, 0.0, 0.0), DVec3::new(-0.5, 0.1, 0.2)]
    {
        for ahead in [DVec3::NEG_Z, DVec3::X, DVec3::new(1.0, -1.0, 0.5)] {
            let camera = Camera { eye, target: eye + ahead, up: DVec3::Y, projection: perspective() };
            let view = View::new(camera, 31, 31).unwrap();
            for spec in EXACT {
                let image = draw_on(&scene, &view, spec);
                excused += assert_homogeneous(&format!("{camera:?} {spec}"), &image, &view, tau, 4.0);
                seen += image.pixels().len();
            }
        }
    }
    assert!(excused * 1000 <= seen, "{excused} of {seen}");
}

/// Scalars of cells are constant inside: against the float64 reference.
#[test]
fn scalars_of_cells_are_constant_inside() {
    let gpu = gpu();
    let base = Field::Ramp.tets(4).unwrap();
    let values = (0..base.cells().len()).map(|i| (i * 37 % 101) as f32 / 100.0).collect();
    let mesh = base.with_scalars(volraster::scene::TetScalars::Cell(values)).unwrap();
    let scene = Scene::new(mesh, transfer(&HAZE));
    for view in [
        view(perspective(), 1.0, 40, 32),
        view(perspective(), 0.1, 40, 32),
        view(orthographic(), 1.0, 40, 32),
    ] {
        let truth = truth(&scene, &view);
        let on_gpu = GpuScene::new(&gpu, scene.clone());
        for spec in ["havs", "abuffer", "havs:order=back-to-front", "abuffer:order=back-to-front"] {
            let image = draw_on(&on_gpu, &view, spec);
            let worst = assert_true(spec, &image, &truth, &scene, &view, ROUNDING, 3);
            println!("{spec}: {worst:.1e}");
        }
    }
}

/// The reference is asked for one ray where no image is needed.
#[test]
fn the_comparison_sees_a_missing_cell() {
    let gpu = gpu();
    let scene = cubes(Field::Ramp, 2, &HAZE);
    let view = view(perspective(), 1.0, 24, 20);
    let mesh = scene.mesh().unwrap();
    let fewer = mesh.cells()[1..].to_vec();
    let fewer = volraster::scene::Tets::new(mesh.points().to_vec(), fewer, mesh.scalars().clone()).unwrap().0;
    let image = draw(&gpu, &Scene::new(fewer, scene.transfer.clone()), &view, "havs");
    let seen = pixels(&view).any(|(i, pixel)| {
        let (origin, direction) = view.ray(pixel);
        let want = reference::ray(&scene, origin, direction, range_of(&view)).unwrap();
        difference(image.pixels()[i], want) > ROUNDING
    });
    assert!(seen);
}
