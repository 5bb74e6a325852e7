//! Rays through grids against closed forms and against integrators without cells and knots.

use super::*;

// ---- closed forms ------------------------------------------------------------------------------------

#[test]
fn homogeneous_box_is_its_closed_form_in_both_projections_and_from_inside() {
    let (colour, tau) = ([0.8, 0.4, 0.1], 1.7);
    let mut box_ =
        scene(Field::Homogeneous(1.0).sample([9, 6, 4], "u8").unwrap(), &[[0.0, 0.8, 0.4, 0.1, tau]]);
    // Length of a ray in [-1, 1]^3 by the slab method; perspective rays begin at the eye.
    let length = |o: DVec3, d: DVec3, from: f64| {
        let (a, b) = ((DVec3::NEG_ONE - o) / d, (DVec3::ONE - o) / d);
        (a.max(b).min_element() - a.min(b).max_element().max(from)).max(0.0)
    };
    for projection in
        [Projection::Perspective { fov_y_deg: 70.0 }, Projection::Orthographic { half_height: 1.6 }]
    {
        for eye in [DVec3::new(2.0, 1.5, 3.8), DVec3::new(0.3, -0.2, 0.6), DVec3::new(0.0, 0.0, 1.0)] {
            let camera = Camera { eye, target: DVec3::new(0.05, 0.02, -0.03), up: DVec3::Y, projection };
            let view = View::new(camera, 23, 17).unwrap();
            let image = render(&box_, &view, &ReferenceOptions::default(), None).unwrap();
            let mut covered = 0;
            for y in 0..17 {
                for x in 0..23 {
                    let (o, d) = view.ray(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
                    let from = if view.is_perspective() { 0.0 } else { f64::NEG_INFINITY };
                    let depth = tau * length(o, d, from);
                    covered += u32::from(depth > 0.0);
                    same(image.pixel(x, y), uniform(colour, depth), 1e-14);
                }
            }
            assert!(covered > 40, "{projection:?}: {covered} pixels covered");
        }
    }
    // Optical depths from nothing to far beyond opaque.
    for tau in [0.0, 1e-12, 1e-8, 1.0, 44.0, 1e8, 1e300] {
        box_.transfer = TransferFunction::from_rows(&[[0.0, 0.8, 0.4, 0.1, tau]]).unwrap();
        let got = everywhere(&box_, DVec3::new(0.1, 0.2, -5.0), DVec3::Z);
        let want = uniform(colour, 2.0 * tau);
        for (got, want) in got.into_iter().zip(want) {
            assert!((got - want).abs() <= 1e-14 * want, "tau {tau:e}: {got:e} instead of {want:e}");
        }
    }
}

#[test]
fn ramp_of_extinction_with_one_colour() {
    let colour = [0.3, 0.9, 0.5];
    for (t0, t1) in [(0.0, 2.0), (5.0, 1.0), (0.0, 1e8), (1e8, 0.0), (1e-9, 3e-9), (f64::MAX, 0.0)] {
        let box_ = ramp_cell(&[[0.0, 0.3, 0.9, 0.5, t0], [1.0, 0.3, 0.9, 0.5, t1]]);
        // An oblique ray through the faces x = 0 and x = 1: s is linear in its length.
        let direction = DVec3::new(1.0, 0.3, 0.2);
        let want = uniform(colour, 0.5 * (t0 + t1) * direction.length());
        same(everywhere(&box_, DVec3::new(-1.0, 0.0, 0.1), direction), want, 1e-13);
        same(everywhere(&box_, DVec3::new(2.0, 0.9, 0.7), -direction), want, 1e-13);
    }
}

#[test]
fn a_jump_makes_two_layers() {
    let (c1, c2) = ([0.9, 0.1, 0.2], [0.1, 0.4, 1.0]);
    for (tau1, tau2) in [(0.7, 2.5), (0.0, 3.0), (1e8, 1.0), (1e-3, 1e8)] {
        let box_ = ramp_cell(&[
            [0.0, 0.9, 0.1, 0.2, tau1],
            [0.4, 0.9, 0.1, 0.2, tau1],
            [0.4, 0.1, 0.4, 1.0, tau2],
            [1.0, 0.1, 0.4, 1.0, tau2],
        ]);
        let (first, second) = (uniform(c1, 0.4 * tau1), uniform(c2, 0.6 * tau2));
        let over = |a: [f64; 4], b: [f64; 4]| std::array::from_fn(|i| a[i] + (1.0 - a[3]) * b[i]);
        same(everywhere(&box_, DVec3::new(-2.0, 0.3, 0.6), DVec3::X), over(first, second), 1e-13);
        same(everywhere(&box_, DVec3::new(7.0, 0.3, 0.6), DVec3::NEG_X), over(second, first), 1e-13);
    }
}

/// The transfer function is continuous from the right: a scalar on the jump belongs to the later knot.
#[test]
fn a_scalar_that_stays_on_a_jump_takes_the_later_knot() {
    let rows = [
        [0.0, 1.0, 0.0, 0.0, 1.0],
        [0.5, 1.0, 0.0, 0.0, 1.0],
        [0.5, 0.0, 1.0, 0.0, 4.0],
        [1.0, 0.0, 1.0, 0.0, 4.0],
    ];
    // The whole cell on the jump; then a field s = y / 2 and rays inside the face y = 1.
    let constant = scene(grid([2, 2, 2], |_, _, _| 0.5), &rows);
    let direction = DVec3::new(0.6, 0.2, 0.7);
    let length = 1.0 / 0.7 * direction.length();
    same(everywhere(&constant, DVec3::ZERO, direction), uniform([0.0, 1.0, 0.0], 4.0 * length), 1e-14);
    let ramp = scene(grid([3, 3, 3], |_, y, _| [0.0, 0.5, 1.0][num::index(y)]), &rows);
    for direction in [DVec3::X, DVec3::NEG_Z, DVec3::new(0.6, 0.0, 0.8)] {
        let got = everywhere(&ramp, DVec3::ONE, direction);
        let length = 2.0 / direction.abs().max_element();
        same(got, uniform([0.0, 1.0, 0.0], 4.0 * length), 1e-13);
    }
}

/// Colour and extinction are both linear. There is no closed form without the error function, hence composite
/// Simpson.
#[test]
fn linear_extinction_and_linear_colour_equal_simpson() {
    let (ca, cb) = ([0.1, 1.0, 0.5], [0.9, 0.0, 0.5]);
    for (ta, tb) in [(0.0, 1.0), (3.0, 0.5), (0.0, 40.0), (700.0, 0.0), (0.0, 700.0), (1e-7, 2e-7)] {
        let box_ = ramp_cell(&[[0.0, 0.1, 1.0, 0.5, ta], [1.0, 0.9, 0.0, 0.5, tb]]);
        let emission = |t: f64, channel: usize| {
            let tau = ta + (tb - ta) * t;
            tau * (ca[channel] + (cb[channel] - ca[channel]) * t)
                * (-(ta * t + 0.5 * (tb - ta) * t * t)).exp()
        };
        let steps = 200_000_u32;
        let h = 1.0 / f64::from(steps);
        let simpson = |channel: usize| -> f64 {
            let inner: f64 =
                (1..steps).map(|i| f64::from(2 + 2 * (i % 2)) * emission(h * f64::from(i), channel)).sum();
            (emission(0.0, channel) + inner + emission(1.0, channel)) * h / 3.0
        };
        let want = [simpson(0), simpson(1), simpson(2), -(-0.5 * (ta + tb)).exp_m1()];
        same(everywhere(&box_, DVec3::new(-1.0, 0.5, 0.5), DVec3::X), want, 1e-12);
    }
    // Opaque at once: the colour of the first knot.
    for tau in [1e30, f64::MAX] {
        let box_ = ramp_cell(&[[0.0, 0.1, 1.0, 0.5, tau], [1.0, 0.9, 0.0, 0.5, tau]]);
        same(everywhere(&box_, DVec3::new(-1.0, 0.5, 0.5), DVec3::X), [0.1, 1.0, 0.5, 1.0], 1e-13);
    }
}

/// tau = x y z along the cell's diagonal is t^3 / sqrt(27) in length: the cubic case.
#[test]
fn cubic_extinction_along_a_diagonal() {
    let corner = grid([2, 2, 2], |x, y, z| if x * y * z == 1 { 1.0 } else { 0.0 });
    let box_ = scene(corner, &[[0.0, 0.2, 0.5, 1.0, 0.0], [1.0, 0.2, 0.5, 1.0, 8.0]]);
    let want = uniform([0.2, 0.5, 1.0], 8.0 * 3.0_f64.sqrt() / 4.0);
    same(everywhere(&box_, DVec3::NEG_ONE, DVec3::ONE), want, 1e-14);
}

// ---- other integrators -------------------------------------------------------------------------------

#[test]
fn random_rays_equal_an_adaptive_integrator() {
    let mut random = Random(7);
    let fog = [
        [0.0, 0.1, 0.2, 0.7, 0.0],
        [0.06, 0.1, 0.2, 0.7, 0.0],
        [0.3, 0.2, 0.6, 0.9, 1.0],
        [0.6, 0.9, 0.85, 0.3, 3.0],
        [1.0, 1.0, 0.25, 0.1, 8.0],
    ];
    let jumps = [
        [0.1, 1.0, 0.0, 0.0, 2.0],
        [0.5, 0.0, 1.0, 0.0, 0.5],
        [0.5, 0.0, 0.0, 1.0, 9.0],
        [0.7, 1.0, 1.0, 0.0, 0.0],
    ];
    let scenes = [
        marschner_lobb(14),
        scene(
            Field::Sphere.sample([9, 11, 8], "f32").unwrap(),
            &[[0.0, 0.9, 0.5, 0.1, 0.0], [1.0, 0.2, 0.5, 0.9, 6.0]],
        ),
        scene(Field::Blobs.sample([10; 3], "f32").unwrap(), &fog),
        scene(Field::MarschnerLobb.sample([7, 8, 9], "f32").unwrap(), &jumps),
    ];
    let mut worst = 0.0_f64;
    for (i, scene) in scenes.iter().enumerate() {
        let mut visible = 0;
        for _ in 0..12 {
            let (o, d, range) = chord(&mut random);
            let got = ray(scene, o, d, range).unwrap();
            let error = difference(got, adaptive(scene, o, d, range));
            assert!(error < EXACT, "scene {i}, from {o} along {d}: error {error:e}");
            worst = worst.max(error);
            visible += u32::from(got[3] > 0.01);
        }
        assert!(visible >= 6, "scene {i}: {visible} rays saw something");
    }
    println!("worst difference from the adaptive integrator: {worst:e}");
}

/// The midpoint rule converges to the reference at its own second order, as far as a correct reference
/// allows.
#[test]
fn midpoint_rule_converges_to_the_reference_at_second_order() {
    let smooth = [[0.0, 0.9, 0.5, 0.1, 0.2], [1.0, 0.2, 0.5, 0.9, 3.0]];
    let scene = scene(Field::MarschnerLobb.sample([6; 3], "f32").unwrap(), &smooth);
    let mut random = Random(3);
    let mut orders = Vec::new();
    let mut finest = 0.0_f64;
    for _ in 0..40 {
        // Inside the box, so that the only kinks are those at the voxel faces.
        let (a, b) = (
            random.in_box(DVec3::splat(-0.99), DVec3::splat(0.99)),
            random.in_box(DVec3::splat(-0.99), DVec3::splat(0.99)),
        );
        let (direction, range) = ((b - a).normalize(), [0.0, (b - a).length()]);
        let truth = ray(&scene, a, direction, range).unwrap();
        let errors =
            [256, 512, 1024, 2048, 4096].map(|n| difference(midpoint(&scene, a, direction, range, n), truth));
        // Kinks fall anywhere in a step, so single halvings are noisy: take the slope over four of them.
        orders.push((errors[0] / errors[4]).log2() / 4.0);
        finest = finest.max(errors[4]);
    }
    orders.sort_by(f64::total_cmp);
    let median = orders[20];
    assert!((median - 2.0).abs() < 0.15, "median order {median:.3}, expected 2");
    assert!(finest < 1e-6, "error of the finest: {finest:e}");
}
