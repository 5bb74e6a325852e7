//! Compares orders with the cells along rays, which are found by cutting every cell with every ray.

use glam::{DVec2, DVec3};

use crate::num;
use crate::scene::topology::Topology;
use crate::scene::topology::tests::{REAL, cubes, cubes_where, five, mesh, shared_mesh};
use crate::scene::{Camera, Projection, Tets, View};
use crate::technique::mesh::order::keys::{PowerCheck, ascending, centroid, check_power, power};
use crate::technique::mesh::order::mpvo::VisibilityOrder;
use crate::technique::mesh::order::{Boundary, mpvo};

/// Numbers in [0, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / 2.0_f64.powi(53)
    }

    /// In the cube of this half side.
    fn point(&mut self, half: f64) -> DVec3 {
        (DVec3::new(self.next(), self.next(), self.next()) * 2.0 - 1.0) * half
    }
}

fn view(eye: DVec3, target: DVec3, projection: Projection, extent: [u32; 2]) -> View {
    let up = if (target - eye).normalize().y.abs() > 0.99 { DVec3::X } else { DVec3::Y };
    View::new(Camera { eye, target, up, projection }, extent[0], extent[1]).unwrap()
}

fn perspective(eye: DVec3, target: DVec3, side: u32) -> View {
    view(eye, target, Projection::Perspective { fov_y_deg: 60.0 }, [side, side])
}

fn parallel(eye: DVec3, target: DVec3, side: u32, half_height: f64) -> View {
    view(eye, target, Projection::Orthographic { half_height }, [side, side])
}

/// The segment of a ray inside a cell, and the error of its ends.
#[derive(Clone, Copy, Debug)]
struct Piece {
    cell: u32,
    begin: f64,
    end: f64,
    error: f64,
}

/// Cuts the ray (o, d) with the four planes of a cell. The error is the largest of all planes that may cut it
/// within their errors, infinite for a ray that lies in one of them within rounding.
fn piece(mesh: &Tets, cell: u32, (o, d): (DVec3, DVec3), from_eye: bool) -> Option<Piece> {
    let at = mesh.cells()[num::index(cell)].map(|i| mesh.points()[num::index(i)]);
    let planes = [[1, 3, 2], [0, 2, 3], [0, 3, 1], [0, 1, 2]].map(|face| {
        let [a, b, c] = face.map(|i: usize| at[i]);
        let normal = (b - a).cross(c - a);
        let rounding = 32.0 * f64::EPSILON * (b - a).length() * (c - a).length();
        let (slope, height) = (normal.dot(d), normal.dot(a - o));
        let depth = height / slope;
        let reach = (a - o).length() + depth.abs() * d.length();
        let error = if slope == 0.0 { 0.0 } else { rounding * reach / slope.abs() };
        let lies_in = slope.abs() <= rounding * d.length() && height.abs() <= rounding * (a - o).length();
        (slope, height, depth, if lies_in { f64::INFINITY } else { error })
    });
    let mut piece =
        Piece { cell, begin: if from_eye { 0.0 } else { f64::NEG_INFINITY }, end: f64::INFINITY, error: 0.0 };
    for (slope, height, depth, _) in planes {
        if slope > 0.0 {
            piece.begin = piece.begin.max(depth);
        } else if slope < 0.0 {
            piece.end = piece.end.min(depth);
        } else if height > 0.0 {
            return None;
        }
    }
    for (slope, _, depth, error) in planes {
        let cuts = if slope > 0.0 { depth + error >= piece.begin } else { depth - error <= piece.end };
        if error == f64::INFINITY || (slope != 0.0 && cuts) {
            piece.error = piece.error.max(error);
        }
    }
    (piece.begin < piece.end).then_some(piece)
}

/// Counts of all pairs of cells on rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Tally {
    /// Segments of rays in cells.
    pieces: usize,
    /// Pairs in the wrong order, by more than rounding.
    wrong: usize,
    /// Pairs in the wrong order where one segment is shorter than the errors of its ends.
    excused: usize,
    /// Pairs that overlap by more than rounding, so that no order is right.
    overlapping: usize,
}

impl Tally {
    fn add(&mut self, mut pieces: Vec<Piece>, rank: &[usize]) {
        self.pieces += pieces.len();
        pieces.sort_by(|a, b| (a.begin + a.end).total_cmp(&(b.begin + b.end)));
        for (j, far) in pieces.iter().enumerate() {
            for near in &pieces[..j] {
                if rank[num::index(near.cell)] < rank[num::index(far.cell)] {
                    continue;
                }
                let error = 2.0 * (near.error + far.error);
                if (near.end - near.begin).min(far.end - far.begin) <= error {
                    self.excused += 1;
                } else if near.end > far.begin + error {
                    self.overlapping += 1;
                } else {
                    self.wrong += 1;
                }
            }
        }
    }
}

fn ranks(order: &[u32]) -> Vec<usize> {
    let mut rank = vec![usize::MAX; order.len()];
    for (i, &cell) in order.iter().enumerate() {
        assert_eq!(rank[num::index(cell)], usize::MAX, "cell {cell} stands there twice");
        rank[num::index(cell)] = i;
    }
    rank
}

/// Counts pairs on random rays of the projection, through the whole mesh.
fn tally_random(mesh: &Tets, view: &View, order: &[u32], rays: usize, random: &mut Random) -> Tally {
    let rank = ranks(order);
    let mut tally = Tally::default();
    let [low, high] = mesh.bounds();
    for _ in 0..rays {
        let through = low + (high - low) * DVec3::new(random.next(), random.next(), random.next());
        let eye = view.camera().eye;
        let ray = if view.is_perspective() { (eye, through - eye) } else { (through, view.forward()) };
        let pieces = (0..num::count(mesh.cells().len()))
            .filter_map(|cell| piece(mesh, cell, ray, view.is_perspective()));
        tally.add(pieces.collect(), &rank);
    }
    tally
}

/// Counts pairs on the rays of the pixels in every `step`-th column and row.
fn tally_pixels(mesh: &Tets, view: &View, order: &[u32], step: u32) -> Tally {
    let rank = ranks(order);
    let [width, height] = view.extent();
    let (columns, rows) = (width.div_ceil(step), height.div_ceil(step));
    let mut pieces = vec![Vec::new(); num::index(columns * rows)];
    for (number, cell) in (0..).zip(mesh.cells()) {
        let places = cell.map(|i| view.project(mesh.points()[num::index(i)]).map(|place| place.0));
        if places.iter().all(Option::is_none) {
            continue;
        }
        let mut bounds = [DVec2::ZERO, view.extent().map(f64::from).into()];
        if let [Some(a), Some(b), Some(c), Some(d)] = places {
            bounds = [a.min(b).min(c).min(d) - 1.0, a.max(b).max(c).max(d) + 1.0];
        }
        let of = |v: f64| num::u32_of((v / f64::from(step)).floor().max(0.0));
        for y in of(bounds[0].y)..(of(bounds[1].y) + 1).min(rows) {
            for x in of(bounds[0].x)..(of(bounds[1].x) + 1).min(columns) {
                let ray = view.ray(DVec2::new(f64::from(x * step) + 0.5, f64::from(y * step) + 0.5));
                pieces[num::index(y * columns + x)].extend(piece(mesh, number, ray, view.is_perspective()));
            }
        }
    }
    let mut tally = Tally::default();
    for pieces in pieces {
        tally.add(pieces, &rank);
    }
    tally
}

fn sorted(mesh: &Tets, view: &View, boundary: Boundary) -> VisibilityOrder {
    mpvo(mesh, &Topology::new(mesh).unwrap(), view, boundary).unwrap()
}

/// Returns views with eyes far, near and inside, random and on planes of the lattice, and with parallel rays.
fn views(random: &mut Random, side: u32) -> Vec<View> {
    let mut views = Vec::new();
    for i in 0..4 {
        let target = random.point(0.5);
        views.push(perspective(random.point(0.9), target, side));
        views.push(perspective(random.point(1.0).normalize() * 3.5, target, side));
        views.push(parallel(random.point(3.0), target, side, 2.0));
        let axis = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE][i];
        views.push(perspective(axis * 4.0, DVec3::ZERO, side));
        views.push(parallel(axis * -4.0, DVec3::ZERO, side, 1.25));
        views.push(perspective(axis * 0.5, DVec3::ZERO, side));
        views.push(perspective(axis, -axis, side));
    }
    views
}

#[test]
fn cubes_are_in_order_on_every_ray() {
    let mut random = Random(1);
    for n in 3..=6 {
        let mesh = cubes(n);
        let topology = Topology::new(&mesh).unwrap();
        assert!(topology.is_convex());
        for view in views(&mut random, 33) {
            for boundary in [Boundary::Pixels, Boundary::Centroid] {
                let order = mpvo(&mesh, &topology, &view, boundary).unwrap();
                assert_eq!((order.cycles, order.dropped_relations, order.approximate), (0, 0, false));
                let tally = tally_random(&mesh, &view, &order.front_to_back, 60, &mut random);
                assert!(
                    tally.pieces > 100 && tally.wrong == 0 && tally.overlapping == 0,
                    "{tally:?} {view:?}"
                );
                let tally = tally_pixels(&mesh, &view, &order.front_to_back, 3);
                assert!(tally.wrong == 0 && tally.overlapping == 0, "{tally:?} {view:?}");
            }
        }
    }
}

/// Returns the Delaunay triangulation of a few points: the cells whose circumsphere holds no other point.
fn delaunay(points: &[DVec3]) -> Tets {
    let n = num::count(points.len());
    let at = |i: u32| points[num::index(i)];
    let mut cells = Vec::new();
    for (a, b, c, d) in (0..n).flat_map(|a| {
        (a + 1..n).flat_map(move |b| (b + 1..n).flat_map(move |c| (c + 1..n).map(move |d| (a, b, c, d))))
    }) {
        let rows = glam::DMat3::from_cols(at(b) - at(a), at(c) - at(a), at(d) - at(a)).transpose();
        let squares = [b, c, d].map(|i| (at(i) - at(a)).length_squared() * 0.5);
        let centre = at(a) + rows.inverse() * DVec3::from_array(squares);
        let radius = (at(a) - centre).length();
        if (0..n).filter(|i| ![a, b, c, d].contains(i)).all(|i| (at(i) - centre).length() > radius) {
            cells.push([a, b, c, d]);
        }
    }
    mesh(points.to_vec(), cells)
}

#[test]
fn power_orders_delaunay_meshes() {
    let mut random = Random(5);
    let mut by_centroid = 0;
    for _ in 0..12 {
        let points: Vec<DVec3> = (0..14).map(|_| random.point(1.0)).collect();
        let mesh = delaunay(&points);
        let topology = Topology::new(&mesh).unwrap();
        assert!(topology.is_convex(), "the hull of the points is missing something");
        for view in views(&mut random, 8) {
            let order = ascending(&power(&mesh, &view));
            let tally = tally_random(&mesh, &view, &order, 50, &mut random);
            assert!(tally.wrong == 0 && tally.overlapping == 0, "{tally:?} {view:?}");
            let check = check_power(&mesh, &topology, &view);
            assert!(check.pairs > 10 && check.equal == 0 && check.contrary == 0, "{check:?}");
            let order = ascending(&centroid(&mesh, &view));
            by_centroid += tally_random(&mesh, &view, &order, 50, &mut random).wrong;
        }
    }
    // The test can distinguish orders.
    assert!(by_centroid > 0);
}

#[test]
fn power_says_where_it_does_not_tell() {
    let mut random = Random(2);
    let cubes = cubes(3);
    let topology = Topology::new(&cubes).unwrap();
    for view in views(&mut random, 8) {
        let check = check_power(&cubes, &topology, &view);
        // The four faces inside each cube, less those that the eye's plane holds.
        assert_eq!(check.contrary, 0);
        assert!((27..=4 * 27).contains(&check.equal) && check.pairs > check.equal, "{check:?}");
    }
    // Two cells across the wrong diagonal: the apex of one lies in the sphere of the other.
    let apex = DVec3::new(0.2, 0.2, 0.1);
    let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, apex, apex * DVec3::new(1.0, 1.0, -1.0)];
    let flat = mesh(points, vec![[0, 1, 2, 3], [0, 1, 2, 4]]);
    let topology = Topology::new(&flat).unwrap();
    for view in [perspective(DVec3::Z * 3.0, DVec3::ZERO, 8), parallel(DVec3::Z * 3.0, DVec3::ZERO, 8, 1.0)] {
        assert_eq!(check_power(&flat, &topology, &view), PowerCheck { pairs: 1, equal: 0, contrary: 1 });
        assert_eq!(sorted(&flat, &view, Boundary::Pixels).front_to_back, [0, 1]);
    }
}

#[test]
fn keys_are_true_distances() {
    let tet = vec![DVec3::ZERO, DVec3::X * 4.0, DVec3::Y * 4.0, DVec3::Z * 4.0];
    let mesh = mesh(tet, vec![[0, 1, 2, 3]]);
    let (eye, target) = (DVec3::new(1.0, 1.0, 6.0), DVec3::new(1.0, 1.0, 0.0));
    // Centroid (1, 1, 1); sphere about (2, 2, 2) of radius sqrt 12.
    let near = |keys: Vec<f64>, wanted: f64| assert!((keys[0] - wanted).abs() < 1e-12, "{keys:?} {wanted}");
    near(centroid(&mesh, &perspective(eye, target, 4)), 25.0);
    near(centroid(&mesh, &parallel(eye, target, 4, 1.0)), 5.0);
    near(power(&mesh, &perspective(eye, target, 4)), 1.0 + 1.0 + 16.0 - 12.0);
    near(power(&mesh, &parallel(eye, target, 4, 1.0)), 4.0);
}

/// Adds a thin cell around the segment from a to b.
fn bar(a: DVec3, b: DVec3, points: &mut Vec<DVec3>) -> [u32; 4] {
    let first = num::count(points.len());
    let side = (b - a).cross(DVec3::Z).normalize() * 0.05;
    points.extend([a - side, a + side, b - DVec3::Z * 0.05, b + DVec3::Z * 0.05]);
    [0, 1, 2, 3].map(|i| first + i)
}

#[test]
fn three_cells_that_cover_one_another_in_turn_are_one_cycle() {
    let corner = |i: u32, z: f64| {
        let angle = std::f64::consts::TAU * f64::from(i) / 3.0;
        DVec3::new(angle.cos(), angle.sin(), z)
    };
    let (mut points, mut cells) = (Vec::new(), Vec::new());
    for i in 0..3 {
        // Low where it begins, under the bar before, and high where it ends, over the next.
        let (a, b) = (corner(i, -0.4), corner(i + 1, 0.4));
        cells.push(bar(a + (a - b) * 0.3, b + (b - a) * 0.3, &mut points));
    }
    // Behind all of them a cell that the cycle must not touch, though its centroid be near.
    cells.push(bar(DVec3::new(-1.0, 0.0, -1.0), DVec3::new(1.0, 0.0, -1.0), &mut points));
    let mesh = mesh(points, cells);
    for (eye, cycles) in [(6.0, 1), (-6.0, 1)] {
        for view in
            [perspective(DVec3::Z * eye, DVec3::ZERO, 256), parallel(DVec3::Z * eye, DVec3::ZERO, 256, 2.0)]
        {
            let order = sorted(&mesh, &view, Boundary::Pixels);
            assert_eq!((order.cycles, order.cells_in_cycles, order.dropped_relations), (cycles, 3, 1));
            assert_eq!(
                order.front_to_back.iter().position(|&cell| cell == 3),
                Some(if eye > 0.0 { 3 } else { 0 })
            );
            assert!(tally_pixels(&mesh, &view, &order.front_to_back, 1).wrong > 0);
            let order = sorted(&mesh, &view, Boundary::Centroid);
            assert_eq!((order.cycles, order.approximate), (0, true));
        }
    }
    // From the side they do not.
    let view = parallel(DVec3::new(6.0, 0.1, 0.2), DVec3::ZERO, 256, 2.0);
    let order = sorted(&mesh, &view, Boundary::Pixels);
    assert_eq!((order.cycles, order.dropped_relations), (0, 0));
    assert_eq!(tally_pixels(&mesh, &view, &order.front_to_back, 1).wrong, 0);
}

#[test]
fn centroids_fail_across_a_gap_and_pixels_do_not() {
    // A long cell that comes near, and a small one behind its near end.
    let mut points = Vec::new();
    let long = bar(DVec3::new(0.0, 0.0, 1.0), DVec3::new(0.0, 1.0, -9.0), &mut points);
    let small = bar(DVec3::new(-0.3, 0.0, 0.0), DVec3::new(0.3, 0.05, 0.0), &mut points);
    let mesh = mesh(points, vec![small, long]);
    for view in
        [perspective(DVec3::Z * 4.0, DVec3::ZERO, 256), parallel(DVec3::Z * 4.0, DVec3::ZERO, 256, 1.0)]
    {
        let order = sorted(&mesh, &view, Boundary::Pixels);
        assert_eq!((order.front_to_back.as_slice(), order.approximate), ([1, 0].as_slice(), false));
        let tally = tally_pixels(&mesh, &view, &order.front_to_back, 1);
        assert_eq!((tally.wrong, tally.overlapping), (0, 0));
        let order = sorted(&mesh, &view, Boundary::Centroid);
        assert!(order.approximate && order.front_to_back == [0, 1]);
        assert!(tally_pixels(&mesh, &view, &order.front_to_back, 1).wrong > 0);
    }
}

/// Stretches a mesh to long cells, for which centroids are a poor key. Lattices of eighths stay exact.
fn long(tets: &Tets) -> Tets {
    let at = |p: &DVec3| DVec3::new(2.0 * p.x + p.z, 0.25 * p.y, 0.5 * p.z + 0.25 * p.y);
    mesh(tets.points().iter().map(at).collect(), tets.cells().to_vec())
}

#[test]
fn hollow_meshes_are_right_at_every_pixel() {
    let ring = |[x, y, z]: [u32; 3]| z == 2 && (x.min(y) == 0 || x.max(y) == 4);
    let cavity = |[x, y, z]: [u32; 3]| !(x == 2 && y == 2 && (1..=3).contains(&z));
    let scattered = |[x, y, z]: [u32; 3]| (x * 7 + y * 3 + z * 5) % 4 != 0;
    // Cubes that touch at edges and corners only.
    let chess = |[x, y, z]: [u32; 3]| (x + y + z) % 2 == 0;
    let two = |[x, ..]: [u32; 3]| x == 0 || x == 4;
    let mut random = Random(9);
    let (mut by_centroid, mut pieces) = (0, 0);
    let meshes = [
        cubes_where(5, ring),
        cubes_where(5, cavity),
        cubes_where(5, scattered),
        cubes_where(5, chess),
        cubes_where(5, two),
    ];
    let step = if crate::exhaustive() { 1 } else { 3 };
    for mesh in meshes.iter().cloned().chain(meshes.iter().map(long)).step_by(step) {
        let topology = Topology::new(&mesh).unwrap();
        assert!(!topology.is_convex());
        // Odd sides: pixel centres on planes and edges of the lattice. Parallel rays of half height 1.25 over
        // 25 pixels go through its points.
        for view in views(&mut random, 25).into_iter().chain(views(&mut random, 40)) {
            let order = mpvo(&mesh, &topology, &view, Boundary::Pixels).unwrap();
            assert_eq!((order.cycles, order.dropped_relations, order.approximate), (0, 0, false), "{view:?}");
            let tally = tally_pixels(&mesh, &view, &order.front_to_back, 1);
            assert_eq!((tally.wrong, tally.overlapping), (0, 0), "{view:?}");
            pieces += tally.pieces;
            let order = mpvo(&mesh, &topology, &view, Boundary::Centroid).unwrap();
            assert!(order.approximate);
            by_centroid += tally_pixels(&mesh, &view, &order.front_to_back, 1).wrong;
        }
    }
    println!("{pieces} pieces, by centroids {by_centroid} wrong");
    assert!(by_centroid > 0);
}

#[test]
fn seams_give_relations_without_pixels() {
    // The lower half with points of its own.
    let whole = cubes(4);
    let points = whole.points().to_vec();
    let offset = num::count(points.len());
    let low = |cell: &[u32; 4]| cell.iter().map(|&i| points[num::index(i)].z).sum::<f64>() < 0.0;
    let cells: Vec<[u32; 4]> =
        whole.cells().iter().map(|cell| if low(cell) { cell.map(|i| i + offset) } else { *cell }).collect();
    let torn = long(&mesh([points.clone(), points].concat(), cells));
    let topology = Topology::new(&torn).unwrap();
    assert_eq!((topology.seams().len(), topology.outline().len()), (32, 12 * 16));
    assert!(topology.is_convex());
    let mut random = Random(3);
    for view in views(&mut random, 16) {
        let order = mpvo(&torn, &topology, &view, Boundary::Centroid).unwrap();
        assert_eq!((order.cycles, order.approximate), (0, false));
        let tally = tally_random(&torn, &view, &order.front_to_back, 100, &mut random);
        assert_eq!((tally.wrong, tally.overlapping), (0, 0));
    }
}

#[test]
fn sheets_that_touch_need_no_common_triangles() {
    // Two long boxes, cut so that the diagonals of the common square differ.
    let corner = |x: u32, c: u32| DVec3::new(f64::from(x * 4), f64::from(c >> 1 & 1), f64::from(c >> 2));
    let points = (0..12).map(|i| corner(i / 4, i % 4 * 2)).collect();
    let box_at = |x: u32| [0, 1, 2, 3, 4, 5, 6, 7].map(|c| (x + (c & 1)) * 4 + (c >> 1));
    let tets = mesh(points, [five(box_at(0), false), five(box_at(1), false)].concat());
    let topology = Topology::new(&tets).unwrap();
    assert_eq!((topology.outline().len(), topology.is_convex()), (24, false));
    let mut random = Random(4);
    for _ in 0..20 {
        let (eye, target) = (random.point(12.0), DVec3::new(4.0, 0.5, 0.5));
        for view in [perspective(eye, target, 64), parallel(eye, target, 64, 3.0)] {
            let order = mpvo(&tets, &topology, &view, Boundary::Pixels).unwrap();
            assert_eq!((order.cycles, order.dropped_relations), (0, 0));
            let tally = tally_pixels(&tets, &view, &order.front_to_back, 1);
            assert!(tally.pieces > 0 && tally.wrong + tally.overlapping == 0, "{tally:?} {view:?}");
        }
    }
}

#[test]
fn a_part_inside_of_a_cell_keeps_its_own_order() {
    // Two cells on either side of z = 0, inside of a large one: the ray leaves the farther one first of all.
    let mut points = vec![DVec3::X, DVec3::Y, DVec3::new(-1.0, -1.0, 0.0), DVec3::Z * 0.5, DVec3::Z * -0.5];
    points.extend([DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|p| p * 40.0 - 8.0));
    let mesh = mesh(points, vec![[0, 1, 2, 4], [0, 1, 2, 3], [5, 6, 7, 8]]);
    for view in
        [perspective(DVec3::Z * 60.0, DVec3::ZERO, 256), parallel(DVec3::Z * 60.0, DVec3::ZERO, 256, 2.0)]
    {
        let order = sorted(&mesh, &view, Boundary::Pixels);
        assert_eq!((order.cycles, order.dropped_relations), (0, 0));
        let rank = ranks(&order.front_to_back);
        assert!(rank[1] < rank[0]);
    }
}

#[test]
fn another_mesh_is_refused() {
    let topology = Topology::new(&cubes(2)).unwrap();
    let view = perspective(DVec3::Z * 4.0, DVec3::ZERO, 4);
    assert!(mpvo(&cubes(3), &topology, &view, Boundary::Pixels).unwrap_err().to_string().contains("40"));
}

#[test]
#[ignore = "make test-all: data that is not part of the project"]
fn real_meshes_are_in_order_at_pixels() {
    for name in REAL {
        let Some(mesh) = shared_mesh(name) else { continue };
        let topology = Topology::new(&mesh).unwrap();
        let [low, high] = mesh.bounds();
        let (centre, size) = ((low + high) * 0.5, (high - low).length());
        for direction in [DVec3::new(0.6, 0.4, 0.7), DVec3::new(-0.2, 0.9, 0.3), DVec3::Z] {
            // Some 1,800 rays each; fewer from inside, where many cells cross the plane of the eye.
            for (view, step) in [
                (perspective(centre + direction.normalize() * size, centre, 256), 6),
                (perspective(centre + direction.normalize() * size * 0.1, centre, 256), 17),
                (parallel(centre + direction * size, centre, 256, size * 0.5), 6),
            ] {
                let start = std::time::Instant::now();
                let order = mpvo(&mesh, &topology, &view, Boundary::Pixels).unwrap();
                let took = start.elapsed();
                let tally = tally_pixels(&mesh, &view, &order.front_to_back, step);
                println!(
                    "{name}: {:.0} ms, {} cycles of {} cells, {} dropped; {tally:?}",
                    took.as_secs_f64() * 1e3,
                    order.cycles,
                    order.cells_in_cycles,
                    order.dropped_relations,
                );
                assert!(order.cycles > 0 || tally.wrong == 0, "{name}");
            }
        }
    }
}
