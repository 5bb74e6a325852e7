//! Meshes and points of small data sets.

use std::collections::HashMap;

use super::*;
use crate::io::build::arrays::{ArrayInfo, Association};
use crate::io::file::sample_type::{Pick, SampleType};
use crate::io::file::source::Source;
use crate::io::options::{ReadOptions, Request};
use crate::io::report::Content;
use crate::num;
use crate::scene::{Data, KernelSize, Samples, TetScalars, Tets};

fn array(name: &str, association: Association, components: usize) -> ArrayInfo {
    ArrayInfo { name: name.into(), association, kind: SampleType::F32, components, active: false }
}

/// Builds a dataset with one array of each association: a linear field, and the cell's number.
fn build_with(dataset: Dataset, options: &ReadOptions, ghosts: Option<Vec<u8>>) -> Result<Found> {
    build_of(dataset, options, ghosts, linear)
}

/// The same with another field.
fn build_of(
    dataset: Dataset,
    options: &ReadOptions,
    ghosts: Option<Vec<u8>>,
    field: impl Fn(DVec3) -> f64,
) -> Result<Found> {
    let source = Source::in_memory(&[("a.vtu", b"")])?;
    let field: Vec<f32> = dataset.points.iter().map(|p| num::f32_of(field(*p))).collect();
    let cells: Vec<f32> = (0..dataset.types.len()).map(|i| num::f32_of(num::f64_of(i))).collect();
    let mut arrays = vec![array("field", Association::Point, 1), array("cell", Association::Cell, 1)];
    if ghosts.is_some() {
        arrays.push(ArrayInfo { kind: SampleType::U8, ..array("vtkGhostType", Association::Cell, 1) });
    }
    let mut read = |index: usize, _: Pick| {
        let samples = match index {
            0 => Samples::F32(field.clone()),
            1 => Samples::F32(cells.clone()),
            _ => Samples::U8(ghosts.clone().unwrap_or_default()),
        };
        Ok(samples.into())
    };
    let mut budget = Budget::new(&source, options);
    let (budget, read) = (&mut budget, &mut read);
    dataset.build(Origin {
        source: &source,
        format: "test",
        arrays,
        spare: 0..0,
        request: &Request::scene(options),
        budget,
        read,
    })
}

fn mesh_of(dataset: Dataset, array: &str) -> (Tets, Vec<String>) {
    let options = ReadOptions { array: Some(array.into()), ..ReadOptions::within(1 << 24) };
    let loaded = build_with(dataset, &options, None).unwrap();
    let Content::Scene(Data::Mesh(mesh)) = loaded.data else { panic!() };
    (mesh, loaded.report.notes)
}

fn linear(p: DVec3) -> f64 {
    1.0 + 2.0 * p.x - 3.0 * p.y + 0.5 * p.z
}

fn refusal(dataset: Dataset) -> String {
    build_with(dataset, &ReadOptions::within(1 << 24), None).unwrap_err().to_string()
}

impl Dataset {
    fn add(&mut self, number: u8, corners: &[DVec3], shared: bool) {
        for &corner in corners {
            let found = self.points.iter().position(|&point| shared && point == corner);
            let index = found.unwrap_or_else(|| {
                self.points.push(corner);
                self.points.len() - 1
            });
            self.nodes.push(num::count(index));
        }
        self.types.push(number);
        self.ends.push(num::count(self.nodes.len()));
    }
}

/// Checks that every face inside a convex body is shared by two tetrahedra on opposite sides, with faces
/// identified by position, and that volume and hull area are right.
fn assert_conforming(mesh: &Tets, volume: f64, hull: f64) {
    let mut faces: HashMap<[[u64; 3]; 3], usize> = HashMap::new();
    let (mut sum, mut area) = (0.0, 0.0);
    let key = |p: DVec3| (p + 0.0).to_array().map(f64::to_bits);
    let mut places: HashMap<[u64; 3], DVec3> = HashMap::new();
    for cell in mesh.cells() {
        let [a, b, c, d] = cell.map(|i| mesh.points()[num::index(i)]);
        sum += (b - a).cross(c - a).dot(d - a) / 6.0;
        for face in [[a, b, c], [a, b, d], [a, c, d], [b, c, d]] {
            let mut keys = face.map(|p| {
                places.insert(key(p), p);
                key(p)
            });
            keys.sort_unstable();
            *faces.entry(keys).or_default() += 1;
        }
    }
    for (face, count) in faces {
        assert!(count <= 2);
        if count == 1 {
            let [a, b, c] = face.map(|key| places[&key]);
            area += (b - a).cross(c - a).length() / 2.0;
        }
    }
    assert!((sum - volume).abs() < 1e-10, "volume {sum}, not {volume}");
    assert!((area - hull).abs() < 1e-10, "hull {area}, not {hull}: faces do not match");
}

const HEXAHEDRON: [[f64; 3]; 8] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [1.0, 1.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 1.0],
    [1.0, 1.0, 1.0],
    [0.0, 1.0, 1.0],
];

/// 3 x 3 x 3 cells: columns of hexahedra, voxels, pairs of wedges and six pyramids round a centre, so
/// that wedges meet in triangles, and all others in quadrilaterals.
fn block(shared: bool, turn: usize) -> Dataset {
    let mut dataset = Dataset::default();
    for i in 0..27 {
        let base = DVec3::new(f64::from(i % 3), f64::from(i / 3 % 3), f64::from(i / 9));
        let corner = HEXAHEDRON.map(|c| base + DVec3::from_array(c));
        let pick = |list: &[usize]| list.iter().map(|&i| corner[i]).collect::<Vec<_>>();
        match (usize::try_from(i % 9).unwrap() + turn) % 4 {
            0 => dataset.add(12, &corner, shared),
            1 => dataset.add(11, &pick(&[0, 1, 3, 2, 4, 5, 7, 6]), shared),
            2 => {
                dataset.add(13, &pick(&[0, 1, 2, 4, 5, 6]), shared);
                dataset.add(13, &pick(&[0, 2, 3, 4, 6, 7]), shared);
            }
            _ => {
                let centre = base + DVec3::splat(0.5);
                for face in
                    [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
                {
                    let mut corners = pick(&face);
                    corners.push(centre);
                    dataset.add(14, &corners, shared);
                }
            }
        }
    }
    dataset
}

#[test]
fn faces_match_also_across_seams_of_coincident_points() {
    for turn in 0..4 {
        let (mesh, _) = mesh_of(block(true, turn), "field");
        assert_conforming(&mesh, 27.0, 54.0);
        // Each cell with points of its own: the rule goes by place.
        let (mesh, notes) = mesh_of(block(false, turn), "cell");
        assert_conforming(&mesh, 27.0, 54.0);
        assert!(notes.iter().any(|note| note.contains("wedges became")), "{notes:?}");
    }
}

#[test]
fn cell_data_follows_its_cell_and_point_data_its_point() {
    let (mesh, _) = mesh_of(block(true, 1), "cell");
    let TetScalars::Cell(values) = mesh.scalars() else { panic!() };
    let source = block(true, 1);
    for (cell, value) in mesh.cells().iter().zip(values) {
        let middle: DVec3 = cell.iter().map(|&i| mesh.points()[num::index(i)]).sum::<DVec3>() / 4.0;
        let index = num::usize_of(f64::from(*value));
        let begin = if index == 0 { 0 } else { num::index(source.ends[index - 1]) };
        let corners: Vec<DVec3> = source.nodes[begin..num::index(source.ends[index])]
            .iter()
            .map(|&n| source.points[num::index(n)])
            .collect();
        let lo = corners.iter().copied().reduce(DVec3::min).unwrap();
        let hi = corners.iter().copied().reduce(DVec3::max).unwrap();
        assert!(middle.cmpge(lo).all() && middle.cmple(hi).all());
    }
    let (mesh, _) = mesh_of(block(true, 1), "field");
    let TetScalars::Point(values) = mesh.scalars() else { panic!() };
    assert!(mesh.points().iter().zip(values).all(|(p, v)| (linear(*p) - f64::from(*v)).abs() < 1e-6));
}

/// The corners of a unit cube from x on, and the middles of its edges.
fn quadratic_hexahedron(x: f64) -> Vec<DVec3> {
    let corner = HEXAHEDRON.map(|c| DVec3::from_array(c) + DVec3::X * x);
    let edges =
        [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];
    corner.into_iter().chain(edges.map(|[a, b]| (corner[a] + corner[b]) / 2.0)).collect()
}

/// Two quadratic hexahedra side by side: their common face is cut alike, and new centres carry the field.
#[test]
fn quadratic_cells_match_and_their_centres_have_values() {
    let mut dataset = Dataset::default();
    for x in [0.0, 1.0] {
        dataset.add(25, &quadratic_hexahedron(x), true);
    }
    let (mesh, notes) = mesh_of(dataset, "field");
    assert_conforming(&mesh, 2.0, 10.0);
    assert_eq!(notes, ["2 quadratic hexahedra became 72 tetrahedra"]);
    let TetScalars::Point(values) = mesh.scalars() else { panic!() };
    assert_eq!(values.len(), 12 + 20 + 2);
    assert!(mesh.points().iter().zip(values).all(|(p, v)| (linear(*p) - f64::from(*v)).abs() < 1e-6));
}

/// The function of the cell is 12/4 of 9 less 8/4 of 13.5 at its centre: zero.
#[test]
fn centres_keep_within_the_values_of_their_nodes() {
    let mut dataset = Dataset::default();
    dataset.add(25, &quadratic_hexahedron(0.0), true);
    let options = ReadOptions { array: Some("field".into()), ..ReadOptions::within(1 << 24) };
    let field =
        |p: DVec3| if p.cmpeq(DVec3::splat(0.5)).any() { 9.0 } else { 10.0 + p.x + 2.0 * p.y + 4.0 * p.z };
    let loaded = build_of(dataset, &options, None, field).unwrap();
    let Content::Scene(Data::Mesh(mesh)) = loaded.data else { panic!() };
    assert_eq!((mesh.range(), loaded.report.file_range), ([9.0, 17.0], Some([9.0, 17.0])));
    assert_eq!(
        loaded.report.notes[1],
        "1 quadratic hexahedra overshoot the values of their nodes at their centres, which keep within these"
    );
}

fn tet() -> [DVec3; 4] {
    [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]
}

#[test]
fn ghosts_and_flat_cells_are_left_out_and_counted() {
    let mut dataset = Dataset::default();
    dataset.add(10, &tet(), true);
    dataset.add(5, &tet()[..3], true);
    dataset.add(10, &tet().map(|p| p + DVec3::ONE), true);
    dataset.add(10, &tet().map(|p| p - DVec3::ONE), true);
    let loaded = build_with(dataset, &ReadOptions::within(1 << 20), Some(vec![0, 0, 1, 32])).unwrap();
    let Content::Scene(Data::Mesh(mesh)) = loaded.data else { panic!() };
    assert_eq!(mesh.cells().len(), 1);
    assert_eq!(
        loaded.report.notes,
        ["1 cells without volume (surfaces, lines, vertices) left out", "2 ghost cells left out"]
    );
    assert_eq!(loaded.report.shown.as_deref(), Some("point:field"));
}

#[test]
fn what_is_no_dataset_is_refused() {
    let of = |types: &[u8], ends: &[u32], nodes: &[u32]| Dataset {
        points: tet().to_vec(),
        types: types.to_vec(),
        ends: ends.to_vec(),
        nodes: nodes.to_vec(),
    };
    assert!(refusal(of(&[10], &[4], &[0, 1, 2, 4])).contains("node 4: there are 4 points"));
    assert!(refusal(of(&[10], &[3], &[0, 1, 2])).contains("3 nodes, tetrahedra have 4"));
    assert!(refusal(of(&[10], &[4], &[0, 1, 2, 3, 3])).contains("5 nodes, the last cell ends at 4"));
    assert!(refusal(of(&[10, 10], &[4, 2], &[0, 1, 2, 3])).contains("offsets must not decrease"));
    assert!(refusal(of(&[10], &[4, 8], &[0, 1, 2, 3])).contains("1 types, 2 offsets"));
    assert!(refusal(of(&[5], &[3], &[0, 1, 2])).contains("1 triangles: a volume needs solid cells"));
    assert!(refusal(of(&[10, 42], &[4, 8], &[0, 1, 2, 3, 0, 1, 2, 3])).contains("1 of type 42"));
    let options = ReadOptions::within(100);
    let error = build_with(of(&[10], &[4], &[0, 1, 2, 3]), &ReadOptions::within(20), None).unwrap_err();
    assert!(error.to_string().contains("the limit of 20"), "{error}");
    assert!(build_with(of(&[10], &[4], &[0, 1, 2, 3]), &options, None).is_ok());
}

#[test]
fn vertices_are_points_with_what_is_asked_for() {
    let dataset = || Dataset {
        points: vec![DVec3::ZERO, DVec3::NAN, DVec3::ONE],
        types: vec![1; 3],
        ends: vec![1, 2, 3],
        nodes: vec![0, 1, 2],
    };
    let options = ReadOptions {
        radius: Some("field".into()),
        weight: Some("field".into()),
        ..ReadOptions::within(1 << 20)
    };
    let mut some = dataset();
    some.points[1] = DVec3::X;
    some.points[2] = DVec3::Z;
    let loaded = build_with(some, &options, None).unwrap();
    let Content::Scene(Data::Points(points)) = loaded.data else { panic!() };
    assert_eq!(points.size(), &KernelSize::Radii(vec![1.0, 3.0, 1.5]));
    assert_eq!(points.weights().unwrap(), [1.0, 3.0, 1.5]);
    assert!(points.scalars().is_none(), "a size is not what is shown");
    // The place that is no place goes with everything that belongs to it.
    let source = Source::in_memory(&[("a.vtu", b"")]).unwrap();
    let options = ReadOptions::within(1 << 20);
    let mut read = |_: usize, _: Pick| Ok(Samples::F32(vec![5.0, 6.0, 7.0]).into());
    let mut budget = Budget::new(&source, &options);
    let arrays = vec![array("Radius", Association::Point, 1)];
    let (options, budget, read) = (&options, &mut budget, &mut read);
    let origin = Origin {
        source: &source,
        format: "test",
        arrays,
        spare: 0..0,
        request: &Request::scene(options),
        budget,
        read,
    };
    let loaded = dataset().build(origin).unwrap();
    assert!(
        loaded.report.notes[0].contains("point:Radius (f32) may hold the radii"),
        "{:?}",
        loaded.report.notes
    );
    let Content::Scene(Data::Points(points)) = loaded.data else { panic!() };
    assert_eq!((points.centres().len(), points.scalars().unwrap()), (2, [5.0, 7.0].as_slice()));
    assert_eq!(loaded.report.notes[1..], ["1 points with positions that are not finite left out"]);
}
