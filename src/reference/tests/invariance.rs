//! Rays through grids under changes that must have no effect.

use super::*;

#[test]
fn a_placed_grid_equals_the_plain_one_seen_from_the_placed_camera() {
    let plain = marschner_lobb(8);
    let mut random = Random(11);
    let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -1.1, 2.0));
    let mirror = DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0));
    for direction in [turn, mirror, turn * mirror] {
        let origin = DVec3::new(30.0, -20.0, 7.0);
        let spacing = DVec3::splat(2.0 / 7.0);
        let mut placed = plain.clone();
        placed.data =
            placed.grid().unwrap().clone().with_placement(spacing, origin, direction).unwrap().into();
        for _ in 0..20 {
            let (o, d, range) = chord(&mut random);
            let want = ray(&plain, o, d, range).unwrap();
            let moved = origin + direction * (o + DVec3::ONE);
            same(ray(&placed, moved, direction * d, range).unwrap(), want, 1e-11);
        }
    }
    // A shear changes lengths; the affine field s = x + 2y - z / 2 in world coordinates stays the same.
    let affine = |p: DVec3| p.x + 2.0 * p.y - 0.5 * p.z;
    let rows = [
        [-4.0, 1.0, 0.0, 0.3, 0.0],
        [0.0, 0.2, 0.8, 0.3, 1.0],
        [1.0, 0.2, 0.1, 0.9, 4.0],
        [1.5, 0.0, 1.0, 0.0, 0.1],
    ];
    let shear =
        DMat3::from_cols(DVec3::new(1.0, 0.0, 0.0), DVec3::new(0.5, 1.0, 0.25), DVec3::new(-0.25, 0.5, -1.0));
    let lattice =
        grid([9, 9, 9], |_, _, _| 0.0).with_placement(DVec3::splat(0.5), DVec3::NEG_ONE, shear).unwrap();
    let fill = |lattice: &Grid| {
        let place = |x: u32, y: u32, z: u32| {
            lattice.world_of_index(DVec3::new(f64::from(x), f64::from(y), f64::from(z)))
        };
        // Every number involved is a small multiple of 1/16: exact in f32.
        grid(lattice.dims(), |x, y, z| num::f32_of(affine(place(x, y, z))))
            .with_placement(
                DVec3::splat(0.5),
                lattice.origin(),
                DMat3::from_cols(
                    lattice.index_to_world().x_axis * 2.0,
                    lattice.index_to_world().y_axis * 2.0,
                    lattice.index_to_world().z_axis * 2.0,
                ),
            )
            .unwrap()
    };
    let sheared = scene(fill(&lattice), &rows);
    let centre = lattice.centre();
    let straight =
        lattice.with_placement(DVec3::splat(0.5), centre - DVec3::splat(2.0), DMat3::IDENTITY).unwrap();
    let straight = scene(fill(&straight), &rows);
    for _ in 0..20 {
        // Stay inside both boxes.
        let (a, b) = (
            random.in_box(DVec3::splat(-0.4), DVec3::splat(0.4)),
            random.in_box(DVec3::splat(-0.4), DVec3::splat(0.4)),
        );
        let range = [0.0, (b - a).length()];
        let want = ray(&straight, centre + a, b - a, range).unwrap();
        assert!(want[3] > 0.0);
        same(ray(&sheared, centre + a, b - a, range).unwrap(), want, 1e-12);
    }
}

#[test]
fn integer_types_and_rescale_equal_their_float_values() {
    let mut random = Random(5);
    let stored = Field::MarschnerLobb.sample([7; 3], "u8").unwrap();
    let Samples::U8(codes) = stored.samples().clone() else { panic!("asked for u8") };
    let rescale = Rescale { slope: -2.0, intercept: 300.0 };
    let place =
        |grid: Grid| grid.with_placement(DVec3::splat(2.0 / 6.0), DVec3::NEG_ONE, DMat3::IDENTITY).unwrap();
    let float = place(
        Grid::new([7; 3], Samples::F32(codes.iter().map(|&c| 300.0 - 2.0 * f32::from(c)).collect())).unwrap(),
    );
    let wide = place(Grid::new([7; 3], Samples::I16(codes.iter().map(|&c| i16::from(c)).collect())).unwrap());
    let rows = [[-210.0, 0.2, 0.2, 1.0, 2.0], [0.0, 1.0, 0.5, 0.0, 0.0], [250.0, 1.0, 0.5, 0.0, 3.0]];
    let want = scene(float, &rows);
    for grid in [stored.with_rescale(rescale).unwrap(), wide.with_rescale(rescale).unwrap()] {
        let rescaled = scene(grid, &rows);
        for _ in 0..10 {
            let (o, d, range) = chord(&mut random);
            assert_eq!(ray(&rescaled, o, d, range).unwrap(), ray(&want, o, d, range).unwrap());
        }
    }
}

#[test]
fn axis_aligned_and_face_grazing_rays_are_limits_of_their_neighbours() {
    let scene = marschner_lobb(9);
    // Index 4 is the centre: 0 and 1/4 lie on faces along every axis, 0.1 does not.
    let step = if crate::exhaustive() { 1 } else { 2 };
    for a in [-0.25, 0.0, 0.1, 0.25] {
        for b in [-0.5, 0.0, 0.3].into_iter().step_by(step) {
            for (o, d) in [
                (DVec3::new(-3.0, a, b), DVec3::X),
                (DVec3::new(a, 3.0, b), DVec3::NEG_Y),
                (DVec3::new(a, b, -3.0), DVec3::Z),
                // In a face, along its diagonal; along the body's diagonal through edges and corners.
                (DVec3::new(-2.0, -2.0, a), DVec3::new(1.0, 1.0, 0.0)),
                (DVec3::splat(-2.0), DVec3::ONE),
            ] {
                let got = everywhere(&scene, o, d);
                let side = d.any_orthonormal_vector() * 1e-11;
                same(everywhere(&scene, o + side, d), got, EXACT);
                same(everywhere(&scene, o - side, d), got, EXACT);
                same(adaptive(&scene, o, d.normalize(), [0.0, 7.0]), got, EXACT);
                // A direction with a negligible component.
                same(everywhere(&scene, o, d + DVec3::new(1e-300, -1e-17, 5e-324)), got, EXACT);
            }
        }
    }
    // The box is closed: a ray in an outer face sees it, one beside it does not.
    let box_ = ramp_cell(&[[0.0, 1.0, 1.0, 1.0, 1.0]]);
    for (y, depth) in [(0.0, 1.0), (1.0, 1.0), (-1e-12, 0.0), (1.0 + 1e-12, 0.0)] {
        same(everywhere(&box_, DVec3::new(-1.0, y, 1.0), DVec3::X), uniform([1.0; 3], depth), 1e-14);
    }
}

#[test]
fn a_nan_sample_empties_its_cells_and_no_other() {
    // No scalar is vacuum, so only the NaN makes cells empty.
    let rows = [[0.0, 0.1, 0.2, 0.6, 1.0], [0.5, 1.0, 0.8, 0.3, 0.3], [1.0, 0.3, 0.4, 1.0, 2.0]];
    let whole = scene(Field::MarschnerLobb.sample([6; 3], "f32").unwrap(), &rows);
    let Samples::F32(mut samples) = whole.grid().unwrap().samples().clone() else { panic!("asked for f32") };
    // Sample (2, 3, 1): the cells [1, 3] x [2, 4] x [0, 2] are vacuum.
    samples[(6 + 3) * 6 + 2] = f32::NAN;
    let place = |samples| {
        let grid = Grid::new([6; 3], Samples::F32(samples)).unwrap();
        let grid = grid.with_placement(DVec3::ONE, DVec3::ZERO, DMat3::IDENTITY).unwrap();
        Scene::new(grid, whole.transfer.clone())
    };
    let holed = place(samples);
    let Samples::F32(samples) = whole.grid().unwrap().samples().clone() else { panic!("asked for f32") };
    let whole = place(samples);
    let mut hit = 0;
    for y in 0..10 {
        for z in 0..10 {
            let o = DVec3::new(-1.0, f64::from(y) * 0.5 + 0.25, f64::from(z) * 0.5 + 0.25);
            let got = everywhere(&holed, o, DVec3::X);
            if o.y > 2.0 && o.y < 4.0 && o.z < 2.0 {
                let front = ray(&whole, o, DVec3::X, [0.0, 2.0]).unwrap();
                let back = ray(&whole, o, DVec3::X, [4.0, 9.0]).unwrap();
                let want = std::array::from_fn(|i| front[i] + (1.0 - front[3]) * back[i]);
                same(got, want, 1e-14);
                hit += 1;
            } else {
                assert_eq!(got, everywhere(&whole, o, DVec3::X), "beside the hole, at {o}");
            }
        }
    }
    assert_eq!(hit, 16);
}

#[test]
fn infinite_samples_take_the_end_knots_before_interpolation() {
    let rows = [[-2.0, 1.0, 0.0, 0.0, 0.5], [3.0, 0.0, 0.5, 1.0, 6.0]];
    let value =
        |at_ends: [f32; 2]| move |x: u32, y: u32, _: u32| if y == 0 { at_ends[num::index(x)] } else { 1.0 };
    let infinite = scene(grid([2, 2, 2], value([f32::NEG_INFINITY, f32::INFINITY])), &rows);
    let finite = scene(grid([2, 2, 2], value([-2.0, 3.0])), &rows);
    for d in [DVec3::X, DVec3::new(1.0, 0.4, 0.3), DVec3::new(-1.0, 0.2, 0.1)] {
        let o = DVec3::new(0.5, 0.3, 0.5) - d * 3.0;
        assert_eq!(everywhere(&infinite, o, d), everywhere(&finite, o, d));
    }
    // A negative slope exchanges the infinities.
    let turned = scene(grid([2, 2, 2], value([f32::INFINITY, f32::NEG_INFINITY])), &rows);
    let rescaled =
        turned.grid().unwrap().clone().with_rescale(Rescale { slope: -1.0, intercept: 2.0 }).unwrap();
    let turned = Scene::new(rescaled, turned.transfer);
    assert_eq!(
        everywhere(&turned, DVec3::new(-1.0, 0.3, 0.5), DVec3::X),
        everywhere(&finite, DVec3::new(-1.0, 0.3, 0.5), DVec3::X)
    );
}

#[test]
fn splitting_reversing_and_scaling() {
    let scene = marschner_lobb(10);
    let mut random = Random(21);
    for _ in 0..30 {
        let (o, d, [a, b]) = chord(&mut random);
        let whole = ray(&scene, o, d, [a, b]).unwrap();
        let cut = a + (b - a) * random.next();
        let (front, back) = (ray(&scene, o, d, [a, cut]).unwrap(), ray(&scene, o, d, [cut, b]).unwrap());
        same(std::array::from_fn(|i| front[i] + (1.0 - front[3]) * back[i]), whole, 1e-11);
        let reversed = ray(&scene, o + d * b, -d, [0.0, b - a]).unwrap();
        assert!((reversed[3] - whole[3]).abs() < 1e-12);
        // Extinction times k, lengths divided by k.
        let k = 1000.0;
        let grid = scene.grid().unwrap();
        let m = grid.spacing();
        let small = Scene::new(
            grid.clone().with_placement(m / k, grid.origin() / k, DMat3::IDENTITY).unwrap(),
            TransferFunction::from_rows(&SHELLS.map(|[s, r, g, b, tau]| [s, r, g, b, tau * k])).unwrap(),
        );
        same(ray(&small, o / k, d, [a / k, b / k]).unwrap(), whole, 1e-11);
        // Twice the colour is twice the image.
        let bright =
            TransferFunction::from_rows(&SHELLS.map(|[s, r, g, b, tau]| [s, 2.0 * r, 2.0 * g, 2.0 * b, tau]))
                .unwrap();
        let bright = ray(&Scene::new(grid.clone(), bright), o, d, [a, b]).unwrap();
        same(bright, [2.0 * whole[0], 2.0 * whole[1], 2.0 * whole[2], whole[3]], 1e-14);
    }
}

/// The depth of a peak far narrower than a cell is exact: peak width / |ds/dx|.
#[test]
fn narrow_peaks_and_many_knots() {
    for width in [1e-4, 1e-9] {
        let peak = 0.5 / width;
        let rows = [
            [0.0, 1.0, 1.0, 1.0, 0.0],
            [0.5 - width, 1.0, 1.0, 1.0, 0.0],
            [0.5, 1.0, 1.0, 1.0, peak],
            [0.5 + width, 1.0, 1.0, 1.0, 0.0],
        ];
        // The knots themselves are rounded: 1e-16 of 1e-9.
        same(
            everywhere(&ramp_cell(&rows), DVec3::new(-1.0, 0.2, 0.2), DVec3::X),
            uniform([1.0; 3], 0.5),
            1e-6 * 1e-9 / width + 1e-11,
        );
    }
    let rows: Vec<[f64; 5]> = (0..=65536)
        .map(|i| {
            let s = f64::from(i) / 65536.0;
            [s, s, 1.0 - s, 0.5, 3.0 * s]
        })
        .collect();
    let few = ramp_cell(&[[0.0, 0.0, 1.0, 0.5, 0.0], [1.0, 1.0, 0.0, 0.5, 3.0]]);
    let d = DVec3::new(1.0, 0.2, 0.3);
    same(
        everywhere(&ramp_cell(&rows), DVec3::new(-0.1, 0.2, 0.2), d),
        everywhere(&few, DVec3::new(-0.1, 0.2, 0.2), d),
        1e-12,
    );
}

#[test]
fn extreme_values_stay_finite() {
    let huge = grid([2, 2, 2], |x, y, z| [3e38, -3e38, 1e-40][num::index((x + y + z) % 3)]);
    let huge = huge.with_rescale(Rescale { slope: 1e280, intercept: 0.0 }).unwrap();
    let box_ = scene(
        huge,
        &[
            [-1.0, 0.2, 0.1, 0.4, 0.5],
            [-1.0, 1.0, 0.1, 0.4, 1e300],
            [0.0, 0.4, 0.1, 0.4, 0.0],
            [5e-324, 1.0, 1.0, 0.0, 1e8],
            [1e-300, 1.0, 0.0, 0.0, 2.0],
        ],
    );
    let mut random = Random(2);
    for _ in 0..50 {
        let (o, d, range) = chord(&mut random);
        let got = ray(&box_, o + DVec3::splat(0.5), d, range).unwrap();
        assert!(got.iter().all(|c| (0.0..=1.0 + 1e-12).contains(c)), "{got:?}");
    }
    // The difference of two samples overflows after the rescale; a jump half-way between them stays half-way.
    let steep = grid([2, 2, 2], |x, _, _| if x == 0 { -3e38 } else { 3e38 });
    let steep = steep.with_rescale(Rescale { slope: 4e269, intercept: 0.0 }).unwrap();
    let box_ = scene(steep, &[[0.0, 1.0, 0.0, 0.0, 2.0], [0.0, 0.0, 1.0, 0.0, 0.0]]);
    same(everywhere(&box_, DVec3::new(-1.0, 0.5, 0.5), DVec3::X), uniform([1.0, 0.0, 0.0], 1.0), 1e-14);
}

/// A far eye costs only the rounding of its distance.
#[test]
fn a_far_eye_sees_the_same_ray() {
    let scene = marschner_lobb(8);
    let d = DVec3::new(0.36, 0.48, 0.8);
    let near = everywhere(&scene, DVec3::new(0.1, -0.2, 0.05), d);
    for distance in [1e3, 1e6] {
        let o = DVec3::new(0.1, -0.2, 0.05) - d * distance;
        // Two roundings of the distance, times the largest slope of the image across rays (about 1e3).
        same(ray(&scene, o, d, [0.0, f64::INFINITY]).unwrap(), near, 1e-12 + distance * 2e-16 * 1e3);
    }
    // Along an axis the distance is exact, and so is the ray.
    let o = DVec3::new(0.25, -0.125, 0.0625);
    let near = everywhere(&scene, o, DVec3::X);
    same(ray(&scene, o - DVec3::X * 1_048_576.0, DVec3::X, [0.0, f64::INFINITY]).unwrap(), near, 1e-13);
}
