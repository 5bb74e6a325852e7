//! Tetrahedra: closed forms, boxes cut in several ways against grids, rays in faces, edges and corners,
//! images against brute force.

use super::super::draw::{Rays, box_filter};
use super::*;
use crate::scene::{TetScalars, Tets};

mod real;

const ONE_COLOUR: [f64; 3] = [0.8, 0.4, 0.1];

fn tets(points: &[DVec3], cells: &[[u32; 4]], scalars: Vec<f32>) -> Tets {
    Tets::new(points.to_vec(), cells.to_vec(), TetScalars::Point(scalars)).unwrap().0
}

fn mesh_scene(mesh: Tets, rows: &[[f64; 5]]) -> Scene {
    Scene::new(mesh, TransferFunction::from_rows(rows).unwrap())
}

/// The same extinction and colour everywhere.
fn homogeneous(mesh: &Tets, tau: f64) -> Scene {
    let [r, g, b] = ONE_COLOUR;
    mesh_scene(mesh.clone(), &[[0.0, r, g, b, tau]])
}

/// The same mesh with scalars that are a function of the position.
fn with_field(mesh: &Tets, value: impl Fn(DVec3) -> f64) -> Tets {
    let values = mesh.points().iter().map(|&p| num::f32_of(value(p))).collect();
    mesh.clone().with_scalars(TetScalars::Point(values)).unwrap()
}

fn moved(mesh: &Tets, place: impl Fn(DVec3) -> DVec3) -> Tets {
    let points = mesh.points().iter().map(|&p| place(p)).collect();
    Tets::new(points, mesh.cells().to_vec(), mesh.scalars().clone()).unwrap().0
}

/// Affine, and exact in float32 at multiples of 1/16.
fn affine(p: DVec3) -> f64 {
    0.5 + 0.25 * p.x + 0.125 * p.y - 0.0625 * p.z
}

/// Length of a ray in a convex solid by the planes of its faces, each given by a point and an outward normal.
fn chord_of(planes: &[(DVec3, DVec3)], o: DVec3, d: DVec3, [mut t0, mut t1]: [f64; 2]) -> [f64; 2] {
    for (point, normal) in planes {
        let (distance, speed) = ((*point - o).dot(*normal), d.dot(*normal));
        if speed > 0.0 {
            t1 = t1.min(distance / speed);
        } else if speed < 0.0 {
            t0 = t0.max(distance / speed);
        } else if distance < 0.0 {
            return [0.0, 0.0];
        }
    }
    if t0 < t1 { [t0, t1] } else { [0.0, 0.0] }
}

fn planes_of(corners: [DVec3; 4]) -> Vec<(DVec3, DVec3)> {
    (0..4)
        .map(|i| {
            let [a, b, c] = [1, 2, 3].map(|k| corners[(i + k) % 4]);
            let normal = (b - a).cross(c - a).normalize();
            (a, if normal.dot(corners[i] - a) > 0.0 { -normal } else { normal })
        })
        .collect()
}

const EVERYWHERE: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

/// The cube [-1, 1]³ in `n`³ cubes of 5, 6 or 24 tetrahedra.
fn cut_cube(n: u32, parts: u32) -> Tets {
    if parts == 5 {
        return Field::Homogeneous(1.0).tets(n).unwrap();
    }
    let (mut points, mut cells) = (Vec::new(), Vec::new());
    let h = 2.0 / f64::from(n);
    for i in 0..n * n * n {
        let low = DVec3::new(f64::from(i % n), f64::from(i / n % n), f64::from(i / n / n)) * h - 1.0;
        // Cubes do not share points: nothing may depend on connectivity.
        let first = num::count(points.len());
        let corner = |bits: u32| {
            low + h * DVec3::new(f64::from(bits & 1), f64::from(bits >> 1 & 1), f64::from(bits >> 2))
        };
        points.extend((0..8).map(corner));
        if parts == 6 {
            // Kuhn: one tetrahedron for each order of the axes, all along one diagonal.
            for [a, b] in [[1, 3], [1, 5], [2, 3], [2, 6], [4, 5], [4, 6]] {
                cells.push([0, a, b, 7].map(|i| first + i));
            }
            continue;
        }
        points.push(low + 0.5 * h);
        for (face, side) in [
            ([0, 2, 6, 4], DVec3::NEG_X),
            ([1, 3, 7, 5], DVec3::X),
            ([0, 1, 5, 4], DVec3::NEG_Y),
            ([2, 3, 7, 6], DVec3::Y),
            ([0, 1, 3, 2], DVec3::NEG_Z),
            ([4, 5, 7, 6], DVec3::Z),
        ] {
            points.push(low + 0.5 * h * (1.0 + side));
            let middle = num::count(points.len()) - 1;
            cells.extend((0..4).map(|i| [first + face[i], first + face[(i + 1) % 4], middle, first + 8]));
        }
    }
    let scalars = vec![1.0; points.len()];
    tets(&points, &cells, scalars)
}

fn view(eye: DVec3, target: DVec3, projection: Projection, [width, height]: [u32; 2]) -> View {
    View::new(Camera { eye, target, up: DVec3::new(0.1, 1.0, 0.05), projection }, width, height).unwrap()
}

/// Asserts that the image equals that of rays against every tetrahedron, bit for bit.
#[track_caller]
fn equals_brute_force(image: &ReferenceImage, scene: &Scene, view: &View, samples: u32) {
    let Rays::Mesh(rays) = Rays::new(scene).unwrap() else { panic!("no mesh") };
    let [width, height] = view.extent();
    for y in 0..height {
        for x in 0..width {
            let want = box_filter(samples, |offset| {
                let (o, d) = view.ray(DVec2::new(f64::from(x), f64::from(y)) + offset);
                rays.trace(o, d, view_range(view))
            });
            assert_eq!(image.pixel(x, y), want, "pixel ({x}, {y})");
        }
    }
}

// ---- closed forms ------------------------------------------------------------------------------------

#[test]
fn one_tetrahedron_is_its_closed_form() {
    let mut random = Random(5);
    let mut hits = 0;
    for _ in 0..300 {
        let corners: [DVec3; 4] = std::array::from_fn(|_| random.in_box(DVec3::NEG_ONE, DVec3::ONE));
        let volume = (corners[1] - corners[0]).cross(corners[2] - corners[0]).dot(corners[3] - corners[0]);
        if volume.abs() < 0.05 {
            continue;
        }
        let (tau, gradient) = (2.0 * random.next(), random.in_box(DVec3::splat(-0.3), DVec3::splat(0.3)));
        let mesh = tets(&corners, &[[0, 1, 2, 3]], vec![0.0; 4]);
        let mesh = with_field(&mesh, |p| 1.0 + gradient.dot(p));
        let TetScalars::Point(s) = mesh.scalars() else { unreachable!() };
        let planes = planes_of(corners);
        for _ in 0..6 {
            let o = random.in_box(DVec3::splat(-3.0), DVec3::splat(3.0));
            let d = (random.in_box(DVec3::splat(-0.5), DVec3::splat(0.5)) - o).normalize();
            let [t0, t1] = chord_of(&planes, o, d, EVERYWHERE);
            hits += u32::from(t1 > t0);
            let [r, g, b] = ONE_COLOUR;
            same(everywhere(&homogeneous(&mesh, tau), o, d), uniform(ONE_COLOUR, tau * (t1 - t0)), 1e-13);
            // Extinction is tau times the scalar, whose mean is that at the chord's middle, found by Cramer's
            // rule.
            let ramp = mesh_scene(mesh.clone(), &[[0.0, r, g, b, 0.0], [4.0, r, g, b, 4.0 * tau]]);
            let middle = o + d * (0.5 * (t0 + t1));
            let [e1, e2, e3] = [1, 2, 3].map(|i| corners[i] - corners[0]);
            let q = middle - corners[0];
            let w = [q.cross(e2).dot(e3), e1.cross(q).dot(e3), e1.cross(e2).dot(q)].map(|w| w / volume);
            let mean =
                f64::from(s[0]) + (0..3).map(|i| w[i] * (f64::from(s[i + 1]) - f64::from(s[0]))).sum::<f64>();
            same(everywhere(&ramp, o, d), uniform(ONE_COLOUR, tau * mean * (t1 - t0)), 1e-13);
        }
    }
    assert!(hits > 300, "{hits} rays met their tetrahedron");
}

#[test]
fn a_cube_in_5_6_or_24_tetrahedra_is_the_box() {
    let box_ = |o: DVec3, d: DVec3| {
        let (a, b) = ((DVec3::NEG_ONE - o) / d, (DVec3::ONE - o) / d);
        (a.max(b).min_element() - a.min(b).max_element()).max(0.0)
    };
    let mut random = Random(6);
    for (n, parts) in [(1, 5), (3, 5), (1, 6), (3, 6), (1, 24), (2, 24)] {
        let scene = homogeneous(&cut_cube(n, parts), 0.7);
        for _ in 0..200 {
            let (o, d, _) = chord(&mut random);
            same(everywhere(&scene, o, d), uniform(ONE_COLOUR, 0.7 * box_(o, d)), 1e-13);
        }
    }
}

/// Rays in shared faces, along shared edges and through shared corners count each place once.
#[test]
fn rays_in_shared_faces_edges_and_corners_count_nothing_twice() {
    let planes: Vec<(DVec3, DVec3)> =
        [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|n| [(n, n), (-n, -n)]).collect();
    let tilt = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -1.1, 2.0));
    let directions: Vec<DVec3> = (0..27)
        .map(|i| DVec3::new(f64::from(i % 3 - 1), f64::from(i / 3 % 3 - 1), f64::from(i / 9 - 1)))
        .filter(|d| *d != DVec3::ZERO)
        .chain([DVec3::new(1.0, 2.0, 0.0), DVec3::new(-1.0, 3.0, 2.0), DVec3::new(0.5, 0.0, -1.0)])
        .collect();
    let mut degenerate = 0;
    for (n, parts) in [(1, 5), (4, 5), (2, 6), (4, 6), (2, 24)] {
        let mesh = cut_cube(n, parts);
        let ramp = with_field(&mesh, affine);
        for d in &directions {
            // Through lattice points, midpoints of edges and faces, and centres of cubes, inside the box.
            for i in 0..343_u32 {
                let p = (DVec3::new(f64::from(i % 7), f64::from(i / 7 % 7), f64::from(i / 49)) - 3.0) * 0.25;
                let o = p - 4.0 * *d;
                let length = chord_of(&planes, o, d.normalize(), EVERYWHERE);
                let length = length[1] - length[0];
                let found = pieces(&homogeneous(&mesh, 1.0), o, *d, EVERYWHERE).unwrap();
                let sum: f64 = found.iter().map(|piece| piece.t[1] - piece.t[0]).sum();
                assert!((sum - length).abs() < 1e-13, "{n}, {parts}: {sum} instead of {length} along {d}");
                for pair in found.windows(2) {
                    assert!((pair[1].t[0] - pair[0].t[1]).abs() < 1e-14, "{pair:?}");
                    assert!((pair[1].s[0] - pair[0].s[1]).abs() < 1e-14, "{pair:?}");
                }
                degenerate += u32::from(i % 2 == 0);
                if i % 49 == 24 {
                    // After a rotation the places are degenerate only up to rounding.
                    let turned = homogeneous(&moved(&mesh, |p| tilt * p), 1.0);
                    let want = uniform(ONE_COLOUR, length);
                    same(everywhere(&turned, tilt * o, tilt * *d), want, 1e-12);
                    let placed = pieces(&mesh_scene(ramp.clone(), &SHELLS), o, *d, EVERYWHERE).unwrap();
                    for piece in placed {
                        for (t, s) in piece.t.into_iter().zip(piece.s) {
                            let want = affine(o + d.normalize() * t);
                            assert!((s - want).abs() < 1e-14, "{s} instead of {want}");
                        }
                    }
                }
            }
        }
    }
    assert!(degenerate > 10_000);
}

// ---- against grids -----------------------------------------------------------------------------------

#[test]
fn an_affine_field_on_tetrahedra_is_the_grid_s() {
    let on_grid = scene(
        grid([5; 3], |x, y, z| {
            num::f32_of(affine(DVec3::new(f64::from(x), f64::from(y), f64::from(z)) * 0.5 - 1.0))
        })
        .with_placement(DVec3::splat(0.5), DVec3::NEG_ONE, DMat3::IDENTITY)
        .unwrap(),
        &SHELLS,
    );
    for parts in [5, 6, 24] {
        let on_mesh = mesh_scene(with_field(&cut_cube(4, parts), affine), &SHELLS);
        let options = ReferenceOptions { samples: 2 };
        for (eye, projection) in [
            (DVec3::new(2.0, 1.5, 3.8), Projection::Perspective { fov_y_deg: 42.0 }),
            (DVec3::new(2.0, 1.5, 3.8), Projection::Orthographic { half_height: 1.6 }),
            (DVec3::new(0.2, -0.3, 0.41), Projection::Perspective { fov_y_deg: 100.0 }),
            (DVec3::new(0.2, -0.3, 0.41), Projection::Orthographic { half_height: 0.4 }),
        ] {
            let view = view(eye, DVec3::new(0.1, 0.05, -0.2), projection, [19, 14]);
            let want = render(&on_grid, &view, &options, None).unwrap();
            let got = render(&on_mesh, &view, &options, None).unwrap();
            let mut visible = 0;
            for (got, want) in got.pixels().iter().zip(want.pixels()) {
                visible += u32::from(want[3] > 0.05);
                same(*got, *want, 1e-12);
            }
            assert!(visible > 60, "{visible} pixels show something");
        }
    }
}

// ---- changes that must not matter --------------------------------------------------------------------

#[test]
fn a_cell_that_is_split_inside_looks_the_same() {
    let mut random = Random(8);
    let corners = [DVec3::NEG_ONE, DVec3::X, DVec3::Y, DVec3::Z];
    for _ in 0..20 {
        let mut w = [0.05 + random.next(), random.next(), random.next(), random.next()];
        let sum: f64 = w.iter().sum();
        w = w.map(|w| w / sum);
        let inside: DVec3 = corners.iter().zip(w).map(|(p, w)| *p * w).sum();
        let points = [corners[0], corners[1], corners[2], corners[3], inside];
        let s = [0.25_f32, 1.0, 0.0, 0.5];
        // The scalar inside is rounded, and so are the slopes on either side of the split.
        let value: f64 = s.iter().zip(w).map(|(s, w)| f64::from(*s) * w).sum();
        let whole = mesh_scene(tets(&points[..4], &[[0, 1, 2, 3]], s.to_vec()), &SHELLS);
        let parts = [[4, 1, 2, 3], [0, 4, 2, 3], [0, 1, 4, 3], [0, 1, 2, 4]];
        let scalars = vec![s[0], s[1], s[2], s[3], num::f32_of(value)];
        let split = mesh_scene(tets(&points, &parts, scalars), &SHELLS);
        for _ in 0..20 {
            let o = random.in_box(DVec3::splat(-3.0), DVec3::splat(3.0));
            let d = random.in_box(DVec3::splat(-0.3), DVec3::splat(0.3)) - o;
            same(everywhere(&split, o, d), everywhere(&whole, o, d), 1e-6);
            let uniform = |scene: &Scene| everywhere(&homogeneous(scene.mesh().unwrap(), 1.3), o, d);
            same(uniform(&split), uniform(&whole), 1e-13);
        }
        // One scalar for each cell is exactly the same in all parts.
        let cells = |mesh: &Tets| {
            let count = mesh.cells().len();
            mesh_scene(mesh.clone().with_scalars(TetScalars::Cell(vec![0.53; count])).unwrap(), &SHELLS)
        };
        let (split, whole) = (cells(split.mesh().unwrap()), cells(whole.mesh().unwrap()));
        let o = random.in_box(DVec3::splat(2.0), DVec3::splat(3.0));
        same(everywhere(&split, o, inside - o), everywhere(&whole, o, inside - o), 1e-13);
    }
}

#[test]
fn a_placed_mesh_equals_the_plain_one_seen_from_the_placed_camera() {
    let plain = Field::Blobs.tets(5).unwrap();
    let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -1.1, 2.0));
    let mirror = DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0));
    let fog = |scale: f64| FOG.map(|[s, r, g, b, tau]| [s, r, g, b, tau / scale]);
    let mut random = Random(11);
    // Scale, offset, and the bound of the error from the rounding of coordinates.
    for (scale, offset, bound) in
        [(1.0, 0.0, 1e-13), (1e-6, 3e-5, 1e-11), (1e9, 1e10, 1e-11), (1e60, 0.0, 1e-12)]
    {
        for matrix in [turn, mirror, turn * mirror] {
            let place = |p: DVec3| matrix * p * scale + offset * DVec3::new(1.0, -2.0, 0.5);
            let original = mesh_scene(plain.clone(), &FOG);
            let placed = mesh_scene(moved(&plain, place), &fog(scale));
            for _ in 0..20 {
                let (o, d, range) = chord(&mut random);
                let want = ray(&original, o, d, range).unwrap();
                let got = ray(&placed, place(o), matrix * d, range.map(|t| t * scale)).unwrap();
                same(got, want, bound);
            }
        }
    }
}

const FOG: [[f64; 5]; 5] = [
    [0.0, 0.1, 0.2, 0.7, 0.0],
    [0.06, 0.1, 0.2, 0.7, 0.0],
    [0.3, 0.2, 0.6, 0.9, 1.0],
    [0.6, 0.9, 0.85, 0.3, 3.0],
    [1.0, 1.0, 0.25, 0.1, 8.0],
];

#[test]
fn a_far_camera_sees_what_a_parallel_one_sees() {
    let scene = mesh_scene(Field::Blobs.tets(6).unwrap(), &FOG);
    let towards = DVec3::new(2.0, 1.5, 3.8).normalize();
    let target = DVec3::new(0.01, 0.02, 0.03);
    let parallel = view(target + towards, target, Projection::Orthographic { half_height: 1.6 }, [16, 16]);
    let want = render(&scene, &parallel, &ReferenceOptions::default(), None).unwrap();
    for distance in [1e6, 1e9].into_iter().take(if crate::exhaustive() { 2 } else { 1 }) {
        let fov_y_deg = 2.0 * (1.6_f64 / distance).atan().to_degrees();
        let far = view(target + towards * distance, target, Projection::Perspective { fov_y_deg }, [16, 16]);
        let got = render(&scene, &far, &ReferenceOptions::default(), None).unwrap();
        equals_brute_force(&got, &scene, &far, 1);
        for (got, want) in got.pixels().iter().zip(want.pixels()) {
            // Rays diverge by the mesh's size over the distance; coordinates have the distance's rounding.
            same(*got, *want, 30.0 / distance + 1e-14 * distance);
        }
    }
}

#[test]
fn the_eye_inside_and_the_range_cut_the_ray() {
    let (mesh, tau) = (Field::Blobs.tets(6).unwrap(), 1.1);
    let scene = mesh_scene(mesh.clone(), &FOG);
    let mut random = Random(13);
    for _ in 0..60 {
        let (o, d, _) = chord(&mut random);
        let (a, b) = (0.8 + random.next(), 1.9 + random.next());
        // Front, middle and back compose to the whole, wherever it is cut.
        let parts = [[f64::NEG_INFINITY, a], [a, b], [b, f64::INFINITY]];
        let parts = parts.map(|range| ray(&scene, o, d, range).unwrap());
        let over = |a: [f64; 4], b: [f64; 4]| std::array::from_fn(|i| a[i] + (1.0 - a[3]) * b[i]);
        same(over(over(parts[0], parts[1]), parts[2]), everywhere(&scene, o, d), 1e-13);
        // An eye inside sees only the part in front of it.
        let eye = o + d * a;
        same(ray(&scene, eye, d, [0.0, f64::INFINITY]).unwrap(), over(parts[1], parts[2]), 1e-12);
        let uniform_ = |range| ray(&homogeneous(&mesh, tau), o, d, range).unwrap();
        let planes = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|n| [(n, n), (-n, -n)]);
        let [t0, t1] = chord_of(&planes.collect::<Vec<_>>(), o, d, [a, b]);
        same(uniform_([a, b]), uniform(ONE_COLOUR, tau * (t1 - t0)), 1e-13);
        assert_eq!(uniform_([b, a]), [0.0; 4], "an empty range");
    }
}

// ---- values ------------------------------------------------------------------------------------------

#[test]
fn nan_is_vacuum_and_infinities_are_the_ends() {
    let rows = [[0.0, 0.9, 0.5, 0.1, 0.5], [1.0, 0.1, 0.3, 0.9, 4.0]];
    let points = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X];
    let cells = [[0, 1, 2, 3], [0, 2, 4, 3]];
    let made = |s: [f32; 5]| mesh_scene(tets(&points, &cells, s.to_vec()), &rows);
    let (o, d) = (DVec3::new(5.0, 0.21, 0.32), DVec3::new(-1.0, 0.003, -0.002));
    let right = mesh_scene(tets(&points[..4], &cells[..1], vec![0.1, 0.2, 0.3, 0.4]), &rows);
    same(everywhere(&made([0.1, 0.2, 0.3, 0.4, f32::NAN]), o, d), everywhere(&right, o, d), 1e-15);
    let (low, high) = (f32::NEG_INFINITY, f32::INFINITY);
    let got = everywhere(&made([low, 0.2, high, 0.4, high]), o, d);
    same(got, everywhere(&made([0.0, 0.2, 1.0, 0.4, 1.0]), o, d), 1e-15);
    // The largest numbers neither overflow nor count as infinite.
    let (least, most) = (f32::MIN, f32::MAX);
    let huge = everywhere(&made([least, most, least, most, most]), o, d);
    assert!(huge.iter().all(|c| c.is_finite()) && huge[3] > 0.0, "{huge:?}");
    let found = pieces(&made([0.1, 0.2, 0.3, 0.4, f32::NAN]), o, d, EVERYWHERE).unwrap();
    assert_eq!(found.iter().map(|piece| piece.cell).collect::<Vec<_>>(), [0]);
}

#[test]
fn scalars_of_cells_are_constant_inside() {
    let rows = [[0.0, 0.9, 0.5, 0.1, 0.5], [1.0, 0.1, 0.3, 0.9, 4.0]];
    let points = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y];
    let cells = vec![[0, 1, 2, 3], [0, 2, 4, 3], [0, 4, 5, 3]];
    let scalars = TetScalars::Cell(vec![0.25, 0.75, f32::NAN]);
    let mesh = Tets::new(points.to_vec(), cells, scalars).unwrap().0;
    let scene = mesh_scene(mesh, &rows);
    let (o, d) = (DVec3::new(5.0, 0.2, 0.3), DVec3::NEG_X);
    let layer = |s: f64, length: f64| {
        let (colour, tau) = scene.transfer.at(s);
        uniform(colour.to_array(), tau * length)
    };
    let over = |a: [f64; 4], b: [f64; 4]| std::array::from_fn(|i| a[i] + (1.0 - a[3]) * b[i]);
    same(everywhere(&scene, o, d), over(layer(0.25, 0.5), layer(0.75, 0.5)), 1e-15);
    same(
        everywhere(&scene, -o.with_y(-0.2).with_z(-0.3), -d),
        over(layer(0.75, 0.5), layer(0.25, 0.5)),
        1e-15,
    );
    assert_eq!(everywhere(&scene, DVec3::new(5.0, -0.2, 0.3), d), [0.0; 4], "NaN");
    // Along the shared face: one of the two cells, not both.
    let along = everywhere(&scene, DVec3::new(0.0, 0.2, 5.0), DVec3::NEG_Z);
    let either = [0.25, 0.75].map(|s| difference(along, layer(s, 0.8)));
    assert!(either[0].min(either[1]) < 1e-15, "{along:?}");
}

/// Overlapping cells both count.
#[test]
fn cells_that_overlap_both_count() {
    let corners = [DVec3::NEG_ONE, DVec3::X, DVec3::Y, DVec3::Z];
    let once = homogeneous(&tets(&corners, &[[0, 1, 2, 3]], vec![0.5; 4]), 2.0);
    let twice = homogeneous(&tets(&corners, &[[0, 1, 2, 3], [0, 1, 2, 3]], vec![0.5; 4]), 1.0);
    let (o, d) = (DVec3::new(0.1, 0.05, 4.0), DVec3::NEG_Z);
    same(everywhere(&twice, o, d), everywhere(&once, o, d), 1e-15);
    assert!(everywhere(&once, o, d)[3] > 0.1);
}

// ---- images ------------------------------------------------------------------------------------------

fn views(mesh: &Tets, extent: [u32; 2]) -> [View; 4] {
    let [low, high] = mesh.bounds();
    let (centre, size) = (0.5 * (low + high), (high - low).length());
    let towards = DVec3::new(2.0, 1.5, 3.8).normalize();
    // The eye is close to one of the mesh's points.
    let inside = mesh.points()[num::index(mesh.cells()[mesh.cells().len() / 3][0])];
    [
        view(centre + size * towards, centre, Projection::Perspective { fov_y_deg: 42.0 }, extent),
        view(centre + size * towards, centre, Projection::Orthographic { half_height: 0.4 * size }, extent),
        view(inside, centre + 0.01 * size * towards, Projection::Perspective { fov_y_deg: 120.0 }, extent),
        view(
            inside + 1e-3 * size * towards,
            centre,
            Projection::Orthographic { half_height: 0.1 * size },
            extent,
        ),
    ]
}

#[test]
fn covers_miss_no_tetrahedron() {
    let scene = mesh_scene(Field::Blobs.tets(5).unwrap(), &FOG);
    for (i, view) in views(scene.mesh().unwrap(), [70, 19]).into_iter().enumerate() {
        for samples in
            [1, 3].into_iter().filter(|samples| crate::exhaustive() || (*samples == 1) == (i % 2 == 0))
        {
            let options = ReferenceOptions { samples };
            let image = render(&scene, &view, &options, None).unwrap();
            equals_brute_force(&image, &scene, &view, samples);
            assert!(image.pixels().iter().filter(|pixel| pixel[3] > 0.01).count() > 100);
        }
    }
}
