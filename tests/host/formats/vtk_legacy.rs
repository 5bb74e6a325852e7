//! VTK's legacy files.

use std::fmt::Write as _;
use std::fs;

use glam::{DMat3, DVec3};
use volraster::io::{Loaded, ReadOptions};
use volraster::scene::{Samples, TetScalars};

use crate::formats::support::{
    self, OPTIONS, Sample, grid, gzip, mesh, points, shared, shared_loaded, stored,
};

/// A file that is being written.
#[derive(Clone)]
struct Vtk {
    bytes: Vec<u8>,
    binary: bool,
}

impl Vtk {
    fn new(version: &str, binary: bool) -> Self {
        let kind = if binary { "BINARY" } else { "ASCII" };
        Self { bytes: format!("# vtk DataFile Version {version}\nA title\n{kind}\n").into(), binary }
    }

    fn line(mut self, line: &str) -> Self {
        self.bytes.extend_from_slice(line.as_bytes());
        self.bytes.push(b'\n');
        self
    }

    fn raw(mut self, bytes: &[u8]) -> Self {
        self.bytes.extend_from_slice(bytes);
        self
    }

    /// Numbers of a type.
    fn numbers(mut self, kind: &str, values: &[f64]) -> Self {
        if !self.binary {
            let mut text = String::new();
            for (i, value) in values.iter().enumerate() {
                write!(text, "{value}{}", if i % 9 == 8 { " \n" } else { " " }).unwrap();
            }
            return self.line(&text);
        }
        if kind == "bit" {
            for eight in values.chunks(8) {
                let bits = eight.iter().enumerate().map(|(i, &bit)| u8::from(bit != 0.0) << (7 - i));
                self.bytes.push(bits.sum());
            }
        }
        for &value in values {
            let whole = value as i64;
            let bytes: Vec<u8> = match kind {
                "bit" => continue,
                "unsigned_char" | "char" | "signed_char" => vec![whole as u8],
                "short" | "unsigned_short" => (whole as u16).to_be_bytes().into(),
                "int" | "unsigned_int" | "vtkIdType" => (whole as u32).to_be_bytes().into(),
                "float" => (value as f32).to_be_bytes().into(),
                "double" => value.to_be_bytes().into(),
                _ => whole.to_be_bytes().into(),
            };
            self.bytes.extend_from_slice(&bytes);
        }
        self.bytes.push(b'\n');
        self
    }

    fn scalars(self, name: &str, kind: &str, values: &[f64]) -> Self {
        self.line(&format!("SCALARS {name} {kind}")).line("LOOKUP_TABLE default").numbers(kind, values)
    }

    /// An array of a field.
    fn array(self, name: &str, components: usize, kind: &str, values: &[f64]) -> Self {
        let tuples = values.len() / components;
        self.line(&format!("{name} {components} {tuples} {kind}")).numbers(kind, values)
    }

    fn sample(self, what: &'static str) -> Sample {
        Sample::one(what, "a.vtk", self.bytes)
    }
}

/// `f(0)` to `f(n - 1)`.
fn list(n: usize, f: impl Fn(f64) -> f64) -> Vec<f64> {
    (0..n).map(|i| f(i as f64)).collect()
}

/// Types of whole numbers and floats, with a lowest number that says whether signs survive.
const TYPES: [(&str, f64); 13] = [
    ("unsigned_char", 250.0),
    ("char", -3.0),
    ("signed_char", -4.0),
    ("unsigned_short", 60_000.0),
    ("short", -300.0),
    ("unsigned_int", 4_000_000.0),
    ("int", -70_000.0),
    ("long", -5.0),
    ("unsigned_long", 9.0),
    ("vtktypeint64", -6.0),
    ("vtktypeuint64", 7.0),
    ("float", -0.25),
    ("double", -0.125),
];

/// Every kind of array, for 12 points.
fn attributes(mut vtk: Vtk) -> Vtk {
    let n = 12;
    vtk = vtk.scalars("my%20scalars", "double", &list(n, |i| i * 0.5 - 3.0));
    vtk = vtk.line("LOOKUP_TABLE table 2");
    vtk = if vtk.binary { vtk.raw(b"\0\n\x20\xffPOIN\n") } else { vtk.line("0 0.5 1 1\n1 0 0 0.25") };
    vtk = vtk.line("COLOR_SCALARS rgb 3");
    vtk = if vtk.binary {
        vtk.numbers("unsigned_char", &list(3 * n, |i| i * 7.0))
    } else {
        vtk.numbers("float", &list(3 * n, |i| i * 7.0 / 255.0))
    };
    vtk = vtk.line("VECTORS vec float").numbers("float", &list(3 * n, |i| i - 4.0));
    vtk = vtk.line("NORMALS nor float").numbers("float", &list(3 * n, |i| i));
    vtk = vtk.line("TEXTURE_COORDINATES tc 2 float").numbers("float", &list(2 * n, |i| i));
    vtk = vtk.line("TENSORS6 ten6 short").numbers("short", &list(6 * n, |i| i));
    vtk = vtk.line("TENSORS ten unsigned_char").numbers("unsigned_char", &list(9 * n, |i| i));
    vtk = vtk.line("GLOBAL_IDS gids vtkIdType").numbers("vtkIdType", &list(n, |i| i));
    vtk = vtk.line("PEDIGREE_IDS pids int").numbers("int", &list(n, |i| i + 5.0));
    vtk = vtk.line(&format!("FIELD FieldData {}", TYPES.len() + 5));
    for (kind, lowest) in TYPES {
        vtk =
            vtk.array(&format!("f%25{kind}%20%22x%22"), 1, kind, &list(n, |i| lowest + i / 2.0 * 2.0 % 5.0));
    }
    vtk = vtk.line("NULL_ARRAY").array("bits", 1, "bit", &list(n, |i| i % 3.0 % 2.0));
    vtk = vtk.line("names 1 3 string");
    vtk = if vtk.binary { vtk.raw(b"\xc0\xc3a b\x80\x02\n\x20\n") } else { vtk.line("\na%20b\nPOINTS") };
    vtk = vtk.line("things 1 2 variant").line("11 1.5\n13 x%20y\n");
    vtk = vtk.array("pair", 2, "double", &list(2 * n, |i| i * i));
    vtk.line("METADATA\nCOMPONENT_NAMES\nfirst%20one\n\nINFORMATION 1\nNAME L2_NORM_RANGE LOCATION vtkDataArray\nDATA 2 0 1\n")
}

/// Metadata as VTK writes it, and `METADATA` without anything.
const METADATA: &str = "METADATA\nINFORMATION 2\nNAME L2_NORM_FINITE_RANGE LOCATION vtkDataArray\nDATA 2 0 2.4 \n\
                        NAME L2_NORM_RANGE LOCATION vtkDataArray\nDATA 2 0 2.4 \n";

fn image(version: &str, binary: bool) -> Vtk {
    let vtk = Vtk::new(version, binary).line("DATASET STRUCTURED_POINTS").line("FIELD FieldData 2");
    let vtk = vtk.array("TIME", 1, "double", &[1.5]).line("note 1 1 string");
    let vtk = if binary { vtk.raw(b"\xc4note\n") } else { vtk.line("a%20note").line("") };
    vtk.line("DIMENSIONS 3 2 2").line("SPACING 0.5 1 2").line("ORIGIN -1 2 3")
}

fn rectilinear(version: &str, binary: bool) -> Vtk {
    let vtk = Vtk::new(version, binary).line("DATASET RECTILINEAR_GRID").line("DIMENSIONS 3 4 3");
    let vtk = vtk.line("X_COORDINATES 3 double").numbers("double", &[0.0, 1.0, 3.0]);
    let vtk = vtk.line("Y_COORDINATES 4 float").numbers("float", &[0.0, 1.0, 2.0, 3.0]).line(METADATA);
    vtk.line("Z_COORDINATES 3 int").numbers("int", &[4.0, 3.0, 2.0])
}

/// 3 x 2 x 2 points.
fn structured(version: &str, binary: bool, kind: &str, at: impl Fn(f64, f64, f64) -> [f64; 3]) -> Vtk {
    let places = list(12, |i| i);
    let numbers: Vec<f64> =
        places.iter().flat_map(|i| at(i % 3.0, (i / 3.0).floor() % 2.0, (i / 6.0).floor())).collect();
    Vtk::new(version, binary)
        .line("DATASET STRUCTURED_GRID")
        .line("DIMENSIONS 3 2 2")
        .line(&format!("POINTS 12 {kind}"))
        .numbers(kind, &numbers)
}

/// The corners of a cube and a point over it.
const NINE: [f64; 27] = [
    0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, //
    0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 0.5, 0.5, 2.0,
];

/// A hexahedron, a pyramid on it, a triangle, a tetrahedron of volume zero.
const CELLS: [&[u32]; 4] = [&[0, 1, 2, 3, 4, 5, 6, 7], &[4, 5, 6, 7, 8], &[0, 1, 2], &[0, 1, 2, 3]];
const CELL_TYPES: [f64; 4] = [12.0, 14.0, 5.0, 10.0];

fn unstructured(version: &str, binary: bool, offsets: bool) -> Vtk {
    let vtk = Vtk::new(version, binary).line("DATASET UNSTRUCTURED_GRID").line("FIELD FieldData 1");
    let vtk = vtk.array("cycle", 1, "int", &[7.0]).line("POINTS 9 float").numbers("float", &NINE);
    let nodes: Vec<f64> = CELLS.iter().flat_map(|cell| cell.iter().map(|&n| f64::from(n))).collect();
    let vtk = if offsets {
        vtk.line("CELLS 5 20")
            .line("OFFSETS vtktypeint64")
            .numbers("vtktypeint64", &[0.0, 8.0, 13.0, 16.0, 20.0])
            .line("CONNECTIVITY vtktypeint64")
            .numbers("vtktypeint64", &nodes)
    } else {
        let inline: Vec<f64> = CELLS
            .iter()
            .flat_map(|cell| std::iter::once(cell.len() as f64).chain(cell.iter().map(|&n| f64::from(n))))
            .collect();
        vtk.line("CELLS 4 24").numbers("int", &inline)
    };
    vtk.line("CELL_TYPES 4")
        .numbers("int", &CELL_TYPES)
        .line("CELL_DATA 4")
        .scalars("number", "int", &list(4, |i| i + 10.0))
        .line("POINT_DATA 9")
        .scalars("height", "float", &list(9, |i| i * 0.5))
}

fn vertices(version: &str, binary: bool, offsets: bool) -> Vtk {
    let vtk =
        Vtk::new(version, binary).line("DATASET POLYDATA").line("POINTS 9 double").numbers("double", &NINE);
    let vtk = if offsets {
        vtk.line("VERTICES 3 9")
            .line("OFFSETS vtktypeint64")
            .numbers("vtktypeint64", &[0.0, 1.0, 9.0])
            .line("CONNECTIVITY vtktypeint64")
            .numbers("vtktypeint64", &list(9, |i| i))
    } else {
        vtk.line("VERTICES 1 10").numbers("int", &list(10, |i| if i == 0.0 { 9.0 } else { i - 1.0 }))
    };
    vtk.line("POINT_DATA 9").line("FIELD FieldData 1").array("velocity", 3, "float", &list(27, |i| i))
}

/// Files with numbers that are as long as the machine had them, between others.
fn longs(bytes: usize, last: bool) -> Vtk {
    let long = |values: &[f64]| -> Vec<u8> {
        let of = |&value: &f64| (value as i64).to_be_bytes()[8 - bytes..].to_vec();
        values.iter().flat_map(of).collect()
    };
    let vtk = Vtk::new("3.0", true).line("DATASET STRUCTURED_POINTS").line("DIMENSIONS 2 2 2");
    let vtk = vtk.line("SPACING 1 1 1").line("ORIGIN 0 0 0").line("POINT_DATA 8").line("SCALARS a long 1");
    let vtk = vtk.line("LOOKUP_TABLE default").raw(&long(&list(8, |i| i - 2.0))).line("");
    let vtk = vtk.line("FIELD f 2").line("b 2 8 unsigned_long").raw(&long(&list(16, |i| i))).line("");
    let vtk = vtk.line("c 1 8 long").raw(&long(&list(8, |i| -i)));
    if last { vtk } else { vtk.line("").line("NORMALS n float").numbers("float", &list(24, |i| i)) }
}

/// One file for each encoding and branch.
pub fn samples() -> Vec<Sample> {
    let twelve = list(12, |i| i * i);
    let oblique = |x, y, z| [x + 0.5 * y, 2.0 * y, 3.0 * z + 0.25 * x];
    let curved = |x: f64, y, z| [x + 0.125 * x * x, 2.0 * y, 3.0 * z];
    let mut samples = vec![
        attributes(image("5.1", false).line("POINT_DATA 12")).sample("image as text"),
        attributes(image("4.2", true).line("POINT_DATA 12")).sample("image in binary"),
        Vtk::new("1.0", true)
            .line("dataset structured_points")
            .line("dimensions 2 2 2")
            .line("aspect_ratio 1 -2 3")
            .line("origin 0 0 0")
            .line("point_data 8")
            .line("scalars s unsigned_char")
            .raw(b"\n\0 SCALA")
            .sample("image of version 1 without lookup table"),
        Vtk::new("3.0", false)
            .line("DATASET STRUCTURED_POINTS\nEXTENT 1 2 -1 1 4 5\nSPACING 1 2 3\nORIGIN 10 20 30")
            .line(
                "DIRECTION 0 -1 0 1 0 0 0 0 1\nCELL_DATA 2\nPOINT_DATA 12\nSCALARS s short 2 LOOKUP_TABLE t",
            )
            .numbers("short", &list(24, |i| -i))
            .sample("image with extent and direction"),
        rectilinear("2.0", false)
            .line("POINT_DATA 36")
            .scalars("s", "float", &list(36, |i| i))
            .sample("rectilinear grid as text"),
        rectilinear("5.1", true)
            .line("CELL_DATA 12")
            .scalars("s", "short", &list(12, |i| i))
            .sample("rectilinear grid in binary with cell data"),
        structured("3.0", false, "double", oblique)
            .line("POINT_DATA 12")
            .scalars("s", "int", &twelve)
            .sample("oblique structured grid as text"),
        structured("5.1", true, "float", curved)
            .line("CELL_DATA 2")
            .scalars("c", "float", &[5.0, 6.0])
            .line("POINT_DATA 12")
            .scalars("s", "float", &twelve)
            .sample("curved structured grid in binary"),
        structured("3.0", true, "float", curved)
            .line("BLANKING 12 unsigned_char")
            .numbers("unsigned_char", &list(12, |i| f64::from(i != 2.0)))
            .line("CELL_DATA 2")
            .scalars("c", "float", &[5.0, 6.0])
            .line("POINT_DATA 12")
            .scalars("s", "float", &twelve)
            .sample("curved structured grid with a blank point"),
        unstructured("2.0", false, false).sample("mesh as text"),
        unstructured("3.0", true, false).sample("mesh in binary"),
        unstructured("5.1", false, true).sample("mesh as text with offsets"),
        unstructured("5.1", true, true).sample("mesh in binary with offsets"),
        vertices("3.0", false, false).sample("vertices as text"),
        vertices("5.1", true, true).sample("vertices in binary"),
        Vtk::new("3.0", true)
            .line("DATASET UNSTRUCTURED_GRID\nPOINTS 9 float")
            .numbers("float", &NINE)
            .sample("points alone"),
        longs(4, false).sample("long numbers of 4 bytes"),
        longs(8, false).sample("long numbers of 8 bytes"),
        longs(4, true).sample("long numbers of 4 bytes at the end"),
        longs(8, true).sample("long numbers of 8 bytes at the end"),
    ];
    let text = String::from_utf8(unstructured("3.0", false, false).bytes).unwrap();
    samples.push(Sample::one(
        "mesh with other line ends",
        "a.vtk",
        text.replace('\n', "\r\n").replace(" \r\n", "\r\n\t\r\n"),
    ));
    samples.push(Sample::one("packed", "a.vtk.gz", gzip(&unstructured("3.0", true, false).bytes)));
    samples
}

#[track_caller]
fn sample(what: &str) -> Sample {
    samples().into_iter().find(|sample| sample.what == what).unwrap()
}

fn with_array(array: &str) -> ReadOptions {
    ReadOptions { array: Some(array.into()), ..OPTIONS }
}

#[track_caller]
fn read_array(sample: &Sample, array: &str) -> Loaded {
    sample.read(&with_array(array)).unwrap_or_else(|e| panic!("{}, {array}: {e}", sample.what))
}

#[track_caller]
fn grid_values(sample: &Sample, array: &str) -> Vec<f64> {
    stored(&grid(read_array(sample, array)))
}

#[test]
fn every_sample_is_read() {
    for sample in samples() {
        let loaded = sample.loaded();
        assert_eq!(loaded.report.format, "VTK legacy", "{}", sample.what);
        let size: usize = sample.files.iter().map(|(_, bytes)| bytes.len()).sum();
        assert!(size < 4200, "{}: {size}", sample.what);
    }
}

#[test]
fn every_kind_of_array_as_text_and_in_binary() {
    for what in ["image as text", "image in binary"] {
        let sample = sample(what);
        let loaded = sample.loaded();
        assert_eq!(loaded.report.shown.as_deref(), Some("point:my scalars"));
        assert_eq!(loaded.report.arrays.len(), 10 + TYPES.len() + 1, "{what}");
        assert!(loaded.report.warnings.is_empty(), "{what}: {:?}", loaded.report.warnings);
        let notes = [
            "arrays of the data set as a whole left out: TIME",
            "arrays without numbers left out: note, names, things",
        ];
        assert_eq!(loaded.report.notes, notes, "{what}");
        let image = grid(loaded);
        assert_eq!(image.dims(), [3, 2, 2]);
        assert_eq!(
            (image.origin(), image.spacing()),
            (DVec3::new(-1.0, 2.0, 3.0), DVec3::new(0.5, 1.0, 2.0))
        );
        assert_eq!(stored(&image), list(12, |i| i * 0.5 - 3.0));
        let every = |from: usize, step: usize| list(12, move |i| i * step as f64 + from as f64);
        let rgb = grid(read_array(&sample, "rgb:g"));
        assert!(matches!(rgb.samples(), Samples::U8(_)), "{what}");
        assert_eq!(stored(&rgb), list(12, |i| (3.0 * i + 1.0) * 7.0));
        assert_eq!(grid_values(&sample, "vec:2"), list(12, |i| 3.0 * i - 2.0), "{what}");
        assert_eq!(grid_values(&sample, "nor:z"), every(2, 3));
        assert_eq!(grid_values(&sample, "tc:1"), every(1, 2));
        assert_eq!(grid_values(&sample, "ten6:5"), every(5, 6));
        assert_eq!(grid_values(&sample, "ten:8"), every(8, 9));
        assert_eq!(grid_values(&sample, "gids"), every(0, 1));
        assert_eq!(grid_values(&sample, "point:pids"), every(5, 1));
        for (kind, lowest) in TYPES {
            let expected = list(12, |i| lowest + i / 2.0 * 2.0 % 5.0);
            assert_eq!(grid_values(&sample, &format!("f%{kind} \"x\"")), expected, "{what}: {kind}");
        }
        assert_eq!(grid_values(&sample, "bits"), list(12, |i| i % 3.0 % 2.0), "{what}");
        assert_eq!(grid_values(&sample, "pair:0"), list(12, |i| 4.0 * i * i));
        assert_eq!(grid_values(&sample, "pair:1"), list(12, |i| (2.0 * i + 1.0).powi(2)));
    }
}

#[test]
fn images_lie_where_the_file_says() {
    let old = grid(sample("image of version 1 without lookup table").loaded());
    assert_eq!(stored(&old), b"\n\0 SCALA".iter().map(|&b| f64::from(b)).collect::<Vec<_>>());
    assert_eq!(old.spacing(), DVec3::new(1.0, 2.0, 3.0));
    assert_eq!(old.world_of_index(DVec3::ONE), DVec3::new(1.0, -2.0, 3.0), "a negative step is kept");

    let loaded = sample("image with extent and direction").loaded();
    assert_eq!(loaded.report.shown.as_deref(), Some("point:s:magnitude"));
    let turned = grid(loaded);
    assert_eq!(turned.dims(), [2, 3, 2]);
    // The first sample has the index (1, -1, 4); the matrix is given by rows: x becomes y, y becomes -x.
    assert_eq!(turned.origin(), DVec3::new(10.0 + 2.0, 20.0 + 1.0, 30.0 + 12.0));
    assert_eq!(turned.world_of_index(DVec3::X) - turned.origin(), DVec3::new(0.0, 1.0, 0.0));
    assert_eq!(turned.world_of_index(DVec3::Y) - turned.origin(), DVec3::new(-2.0, 0.0, 0.0));

    let bare = Vtk::new("3.0", false).line("DATASET STRUCTURED_POINTS\nDIMENSIONS 2 2 2\nPOINT_DATA 8");
    let loaded = bare.scalars("s", "int", &list(8, |i| i)).sample("no spacing").loaded();
    assert_eq!(loaded.report.warnings, ["SPACING is missing: 1 is taken", "ORIGIN is missing: 0 is taken"]);
    assert_eq!(grid(loaded).spacing(), DVec3::ONE);
}

#[test]
fn rectilinear_grids_are_brought_onto_even_lattices() {
    let loaded = sample("rectilinear grid as text").loaded();
    assert!(loaded.report.notes[0].contains("x: gaps from 1 to 2, resampled"), "{:?}", loaded.report.notes);
    let rectilinear = grid(loaded);
    assert_eq!(rectilinear.dims(), [4, 4, 3]);
    assert_eq!(rectilinear.world_of_index(DVec3::splat(2.0)), DVec3::new(2.0, 2.0, 2.0), "z falls");
    assert_eq!(stored(&rectilinear)[..5], [0.0, 1.0, 1.5, 2.0, 3.0]);

    let cells = sample("rectilinear grid in binary with cell data").loaded();
    assert_eq!(cells.report.shown.as_deref(), Some("cell:s"));
    let cells = grid(cells);
    assert_eq!((cells.dims(), cells.origin()), ([2, 3, 2], DVec3::new(0.5, 0.5, 3.5)));
    assert_eq!(stored(&cells), list(12, |i| i));
}

#[test]
fn structured_grids_are_lattices_or_hexahedra() {
    let loaded = sample("oblique structured grid as text").loaded();
    assert_eq!(loaded.report.notes, ["the structured grid's points lie on an even lattice"]);
    let oblique = grid(loaded);
    assert_eq!(oblique.dims(), [3, 2, 2]);
    let to_world = DMat3::from_cols_array(&[1.0, 0.0, 0.25, 0.5, 2.0, 0.0, 0.0, 0.0, 3.0]);
    assert!(oblique.index_to_world().abs_diff_eq(to_world, 1e-14));
    assert_eq!(stored(&oblique), list(12, |i| i * i));

    let curved = sample("curved structured grid in binary");
    let loaded = curved.loaded();
    assert_eq!(loaded.report.notes[0], "the structured grid is curved: it is read as hexahedra");
    let volume = mesh(loaded);
    assert_eq!(volume.points()[5], DVec3::new(2.5, 2.0, 0.0));
    let TetScalars::Point(values) = volume.scalars() else { panic!() };
    assert_eq!(values.iter().map(|&v| f64::from(v)).collect::<Vec<_>>(), list(12, |i| i * i));
    assert!((total(&volume) - 2.5 * 2.0 * 3.0).abs() < 1e-12, "hexahedra fill the grid");
    let cells = mesh(read_array(&curved, "cell:c"));
    let TetScalars::Cell(values) = cells.scalars() else { panic!() };
    for (tet, value) in cells.cells().iter().zip(values) {
        let first = tet.iter().any(|&i| cells.points()[i as usize].x < 1.0);
        assert_eq!(*value, if first { 5.0 } else { 6.0 });
    }

    let blank = sample("curved structured grid with a blank point");
    let cells = mesh(read_array(&blank, "cell:c"));
    assert_eq!(cells.scalars().values(), [5.0; 6], "data follows its cells");
    let blank = blank.loaded();
    assert_eq!(
        blank.report.notes[1..],
        ["1 hexahedra with a hidden point left out", "1 hexahedra became 6 tetrahedra"]
    );
    assert!((total(&mesh(blank)) - 1.125 * 2.0 * 3.0).abs() < 1e-12, "the second hexahedron is hidden");
    // A lattice keeps its hidden points, as NaN.
    let lattice = structured("3.0", false, "float", |x, y, z| [x, y, z])
        .line("BLANKING 12 unsigned_char")
        .numbers("unsigned_char", &list(12, |i| f64::from(i != 7.0)))
        .line("POINT_DATA 12")
        .scalars("s", "float", &list(12, |i| i));
    let values = stored(&grid(lattice.sample("blank lattice").loaded()));
    assert!(values[7].is_nan() && values.iter().filter(|v| v.is_nan()).count() == 1);
}

fn total(mesh: &volraster::scene::Tets) -> f64 {
    let volume = |tet: &[u32; 4]| {
        let [a, b, c, d] = tet.map(|i| mesh.points()[i as usize]);
        (b - a).cross(c - a).dot(d - a) / 6.0
    };
    mesh.cells().iter().map(volume).sum()
}

#[test]
fn meshes_in_all_forms_are_the_same() {
    for what in [
        "mesh as text",
        "mesh in binary",
        "mesh as text with offsets",
        "mesh in binary with offsets",
        "mesh with other line ends",
        "packed",
    ] {
        let sample = sample(what);
        let loaded = sample.loaded();
        assert_eq!(loaded.report.shown.as_deref(), Some("point:height"), "{what}");
        assert!(loaded.report.notes.contains(&"1 tetrahedra without volume left out".to_owned()), "{what}");
        let heights = mesh(loaded);
        let TetScalars::Point(values) = heights.scalars() else { panic!() };
        assert_eq!(values[..], [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0], "{what}");
        let expected: Vec<DVec3> = NINE.as_chunks::<3>().0.iter().map(|&p| DVec3::from_array(p)).collect();
        assert_eq!(heights.points(), expected, "{what}");
        assert!((total(&heights) - 1.0 - 1.0 / 3.0).abs() < 1e-12, "{what}");
        let numbers = mesh(read_array(&sample, "number"));
        let TetScalars::Cell(values) = numbers.scalars() else { panic!() };
        let pyramid = numbers.cells().iter().map(|tet| tet.contains(&8));
        assert!(values.iter().zip(pyramid).all(|(&v, is)| v == if is { 11.0 } else { 10.0 }), "{what}");
    }
}

#[test]
fn vertices_and_points_alone_are_points() {
    for what in ["vertices as text", "vertices in binary"] {
        let sample = sample(what);
        let loaded = sample.loaded();
        assert_eq!(loaded.report.shown.as_deref(), Some("point:velocity:magnitude"));
        let all = points(loaded);
        assert_eq!((all.centres().len(), all.centres()[8]), (9, DVec3::new(0.5, 0.5, 2.0)), "{what}");
        let y = points(read_array(&sample, "velocity:y"));
        assert_eq!(y.scalars().unwrap()[..3], [1.0, 4.0, 7.0], "{what}");
    }
    assert_eq!(points(sample("points alone").loaded()).scalars(), None);
    // Binary data may end without a line end.
    let mut vtk = Vtk::new("3.0", true).line("DATASET POLYDATA\nPOINTS 9 float").numbers("float", &NINE);
    vtk.bytes.pop();
    let vtk = vtk.line("POINT_DATA 9").scalars("s", "int", &list(9, |i| i));
    assert_eq!(points(vtk.sample("no line end").loaded()).scalars().unwrap()[8], 8.0);
}

#[test]
fn long_numbers_are_as_long_as_they_fit() {
    for (bytes, note) in [(4, true), (8, false)] {
        for last in [false, true] {
            let sample = longs(bytes, last).sample("long");
            let notes = sample.loaded().report.notes;
            assert_eq!(
                notes.iter().any(|n| n.starts_with("numbers of type long have 4 bytes")),
                note,
                "{notes:?}"
            );
            assert_eq!(grid_values(&sample, "a"), list(8, |i| i - 2.0), "{bytes} {last}");
            assert_eq!(grid_values(&sample, "b:1"), list(8, |i| 2.0 * i + 1.0), "{bytes} {last}");
            assert_eq!(grid_values(&sample, "c"), list(8, |i| -i), "{bytes} {last}");
        }
    }
}

#[test]
fn ghost_levels_of_old_files_are_ghosts() {
    let vtk = |version, name: &str| {
        unstructured(version, true, false)
            .line("CELL_DATA 4\nFIELD f 1")
            .array(name, 1, "unsigned_char", &[0.0, 2.0, 0.0, 0.0])
            .sample("ghosts")
            .loaded()
    };
    for loaded in [vtk("3.0", "vtkGhostLevels"), vtk("4.2", "vtkGhostType")] {
        let ghosts = loaded.report.notes.contains(&"1 ghost cells left out".to_owned());
        // 2 is a level, but no type that hides a cell.
        assert_eq!(ghosts, (total(&mesh(loaded)) - 1.0).abs() < 1e-12);
    }
    assert!((total(&mesh(vtk("3.0", "vtkGhostLevels"))) - 1.0).abs() < 1e-12);
    assert!(total(&mesh(vtk("4.2", "vtkGhostType"))) > 1.3);
}

#[test]
fn arrays_of_another_size_are_left_out() {
    let vtk = unstructured("3.0", false, false).line("FIELD f 3").array("short%20one", 1, "int", &[1.0, 2.0]);
    let vtk = vtk.array("none", 1, "int", &[]).line("wide 0 9 int");
    let report = vtk.sample("misfits").loaded().report;
    let warning = "arrays left out: point:short one (i32) has 2 tuples instead of 9, \
                   point:none (i32) has 0 tuples instead of 9";
    assert_eq!(report.warnings, [warning]);
    assert_eq!(report.arrays.len(), 2);
    assert!(report.notes.iter().any(|n| n.contains("without components") && n.ends_with("left out: wide")));
}

#[test]
fn what_is_wrong_is_refused_with_its_place() {
    let text =
        |body: &str| Sample::one("text", "a.vtk", format!("# vtk DataFile Version 3.0\nt\nASCII\n{body}"));
    let binary = |body: &[u8]| {
        Sample::one("binary", "a.vtk", [b"# vtk DataFile Version 3.0\nt\nBINARY\n", body].concat())
    };
    let image = "DATASET STRUCTURED_POINTS\nDIMENSIONS 2 2 2\nSPACING 1 1 1\nORIGIN 0 0 0\n";
    let mesh = "DATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\n";
    let data = "POINT_DATA 4\nSCALARS s int\nLOOKUP_TABLE default\n1 2 3 4\n";
    for (sample, parts) in [
        (Sample::one("v", "a.vtk", "# vtk DataFile Version x\n\nASCII\n"), ["line 1", "a number like 3.0"]),
        (Sample::one("n", "a.vtk", "hello\n"), ["line 1: \"hello\"", "must be \"# vtk DataFile Version\""]),
        (
            Sample::one("k", "a.vtk", "# vtk DataFile Version 3.0\nt\nTEXT\n"),
            ["line 3: \"TEXT\"", "must be ASCII or BINARY"],
        ),
        (text("POINT_DATA 3"), ["line 4: \"POINT_DATA\"", "must be DATASET"]),
        (text("DATASET TABLE\n"), ["line 4: DATASET \"TABLE\"", "must be one of STRUCTURED_POINTS, RECT"]),
        (
            text("DATASET POLYDATA\nDIMENSIONS 1 2 3\n"),
            ["line 5: \"DIMENSIONS\"", "is not a keyword of POLYDATA"],
        ),
        (text("DATASET POLYDATA\nPOINTS 3 quad\n"), ["line 5: type \"quad\"", "must be one of bit, char"]),
        (text("DATASET POLYDATA\nPOINTS -3 float\n"), ["line 5: \"-3\"", "must be the number of points"]),
        (text("DATASET POLYDATA\nPOINTS 3"), ["line 5", "ends before a type"]),
        (
            text("DATASET POLYDATA\nPOINTS 3 float\n1 2 3\n"),
            ["line 5: 9 numbers are announced", "at most 4 can follow"],
        ),
        (text("DATASET POLYDATA\nPOINTS 1 string\n1\n2\n3\n"), ["type string", "numbers are needed"]),
        (
            text("DATASET POLYDATA\nPOINTS 1 float\n1 2 three\n"),
            ["line 6: \"three\"", "must be a number, 1 more are announced"],
        ),
        (
            text("DATASET POLYDATA\nPOINTS 1 int\n1 2 3.5\n"),
            ["line 6: \"3.5\"", "must be a number of type i32"],
        ),
        (text("DATASET POLYDATA\nPOINTS 6148914691236517206 float\n"), ["line 5", "too many numbers"]),
        (text("DATASET POLYDATA\n"), ["POINTS", "missing: POLYDATA needs it"]),
        (text(&format!("{image}DIMENSIONS 2 2 2\n")), ["line 8: DIMENSIONS", "given before"]),
        (
            text(&format!("{image}SCALARS s int\n")),
            ["line 8: SCALARS", "must follow POINT_DATA or CELL_DATA"],
        ),
        (text(&format!("{image}POINT_DATA 7\n")), ["POINT_DATA: 7", "the data set has 8"]),
        (text(&format!("{image}POINT_DATA 8\nPOINT_DATA 9\n")), ["line 9: 9", "the data before is for 8"]),
        (text(&format!("{image}CELL_DATA 8\n")), ["CELL_DATA: 8", "the data set has 1"]),
        (text(image), ["arrays: none", "a grid needs point or cell data"]),
        (
            text("DATASET STRUCTURED_POINTS\nEXTENT 1 0 3 1 2 3\n"),
            ["line 5: EXTENT 3 to 1", "must not decrease"],
        ),
        (text("DATASET STRUCTURED_POINTS\n"), ["DIMENSIONS", "missing: STRUCTURED_POINTS needs it"]),
        (
            text("DATASET STRUCTURED_POINTS\nDIMENSIONS 4294967295 4294967295 4294967295\n"),
            ["DIMENSIONS", "more points than 64 bits"],
        ),
        (
            text("DATASET RECTILINEAR_GRID\nDIMENSIONS 2 2 2\nX_COORDINATES 3 int 1 2 3"),
            ["X_COORDINATES: 3", "DIMENSIONS has 2"],
        ),
        (
            text("DATASET RECTILINEAR_GRID\nDIMENSIONS 2 2 2\n"),
            ["X_COORDINATES", "missing: RECTILINEAR_GRID"],
        ),
        (
            text("DATASET STRUCTURED_GRID\nDIMENSIONS 2 2 2\nPOINTS 1 int 1 2 3"),
            ["POINTS: 1", "2 x 2 x 2 are needed"],
        ),
        (
            text("DATASET STRUCTURED_GRID\nDIMENSIONS 1 1 1\nPOINTS 1 int 1 2 3"),
            ["DIMENSIONS: 1 x 1 x 1 has 1", "at least 2"],
        ),
        (
            text("DATASET STRUCTURED_GRID\nDIMENSIONS 2 2 2\nBLANKING 1 int\n1"),
            ["line 7: BLANKING", "type unsigned_char"],
        ),
        (text(&format!("{mesh}CELLS 1 5\n4 0 1 2 3\n{data}")), ["CELL_TYPES", "missing: UNSTRUCTURED_GRID"]),
        (
            text(&format!("{mesh}CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 2\n10 10\n")),
            ["array of line 9: CELL_TYPES 2", "there are 1 cells"],
        ),
        (
            text(&format!("{mesh}CELLS 1 5\n5 0 1 2 3\nCELL_TYPES 1\n10\n")),
            ["array of line 7: cell 0", "5 nodes, fewer are left"],
        ),
        (
            text(&format!("{mesh}CELLS 2 6\n5 0 1 2 3 3\nCELL_TYPES 2\n10 1\n")),
            ["array of line 7: cell 0", "5 nodes"],
        ),
        (
            text(&format!("{mesh}CELLS 2 5\n3 0 1 2 3\nCELL_TYPES 2\n10 1\n")),
            ["array of line 7: cell 1", "3 nodes"],
        ),
        (
            text(&format!("{mesh}CELLS 2 7\n4 0 1 2 3 0 0\nCELL_TYPES 2\n10 1\n")),
            ["array of line 7", "2 cells have fewer than 7 numbers"],
        ),
        (
            text(&format!("{mesh}CELLS 2 5\n3 0 1 2 0\nCELL_TYPES 2\n10 1\n{data}")),
            ["cells", "cell 0: 3 nodes, tetrahedra have 4"],
        ),
        (
            text(&format!("{mesh}CELLS 3 2\n0 0\nCELL_TYPES 3\n1 1 1\n")),
            ["array of line 7", "3 cells in 2 numbers"],
        ),
        (
            text(&format!("{mesh}CELLS 1 5\n4 0 1 2 -3\nCELL_TYPES 1\n10\n")),
            ["array of line 7: -3", "must be from 0 to"],
        ),
        (
            text(&format!("{mesh}CELLS 1 5\n4 0 1 2 4\nCELL_TYPES 1\n10\n{data}")),
            ["node 4", "there are 4 points"],
        ),
        (
            text(&format!("{mesh}CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n300\n{data}")),
            ["array of line 9", "cell type 300"],
        ),
        (
            text(&format!(
                "{mesh}CELLS 2 4\nOFFSETS int\n1 4\nCONNECTIVITY int\n0 1 2 3\nCELL_TYPES 1\n10\n"
            )),
            ["array of line 8", "the first offset is 1"],
        ),
        (
            text(&format!("{mesh}CELLS 2 4\nOFFSETS int\n0 4\nNODES int\n")),
            ["line 10: \"NODES\"", "must be CONNECTIVITY"],
        ),
        (
            text(&format!(
                "{mesh}CELLS 2 4\nOFFSETS int\n0 4\nCONNECTIVITY float\n0 1 2 3\nCELL_TYPES 1\n10\n"
            )),
            ["type f32", "indices are whole numbers"],
        ),
        (
            text(&format!("{mesh}{data}FIELD f 2\na 1 1 int\n3\n")),
            ["line 14", "ends before the name of an array"],
        ),
        (
            text(&format!("{mesh}{data}VECTORS v float\n1 2 3 4\n")),
            ["12 numbers are announced", "at most 5 can follow"],
        ),
        (text(&format!("{mesh}{data}7\n")), ["line 11: \"7\"", "data before it is longer"]),
        (
            text(
                "DATASET POLYDATA\nPOINTS 3 int\n0 0 0 1 0 0 0 1 0\nPOLYGONS 1 4\n3 0 1 2\nLINES 1 3\n2 0 1\n",
            ),
            ["cells: 1 polylines, 1 polygons", "a volume needs solid cells"],
        ),
        (
            text("DATASET POLYDATA\nPOINTS 1 int\n0 0 0\nVERTICES 40000000 2\n1 0\n"),
            ["array of line 7", "40000000 cells in 2 numbers: too few"],
        ),
        (
            text("DATASET POLYDATA\nPOINTS 1 int\n0 0 0\nPOLYGONS 40000000 2\n1 0\n"),
            ["array of line 7", "40000000 cells in 2 numbers: too few"],
        ),
        (
            text(&format!("{mesh}CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n42\n{data}")),
            ["cells: 1 of type 42 (polyhedra): ", "are supported"],
        ),
        (
            text(&format!("{mesh}CELLS 2 6\n3 0 1 2 1 3\nCELL_TYPES 2\n5 72\n{data}")),
            ["cells: 1 of type 72 (of a higher order): ", "are supported"],
        ),
        (
            binary(b"DATASET POLYDATA\nPOINTS 3 float\n123456"),
            ["before byte 68: 36 bytes", "at most 6 can follow"],
        ),
        (
            binary(b"DATASET POLYDATA\nPOINTS 1 float x\n123456789012"),
            ["before byte 70: \"x\"", "must begin on the next line"],
        ),
        (
            binary(b"DATASET POLYDATA\nPOINTS 1 float\n123456789012345"),
            ["before byte", "\"345\": is not a keyword"],
        ),
        (
            binary(b"DATASET POLYDATA\nFIELD f 1\na 1 2 string\n\xc1a"),
            ["before byte", "ends before string 1 of 2"],
        ),
        (
            binary(b"DATASET POLYDATA\nFIELD f 1\na 1 2 string\n\x3f\xff\xff\xff\xff\xff\xff\xffa"),
            ["bytes are announced", "at most 9 can follow"],
        ),
    ] {
        sample.refused(&parts);
    }
}

#[test]
fn memory_is_limited_before_it_is_taken() {
    for (sample, place) in [
        ("mesh as text", "POINTS"),
        ("image in binary", "dimensions"),
        ("rectilinear grid as text", "_COORDINATES"),
        ("curved structured grid in binary", "POINTS"),
        ("vertices in binary", "POINTS"),
    ] {
        let error = self::sample(sample).read(&ReadOptions::within(40)).unwrap_err();
        support::assert_refusal(&error, &[place, "of memory: ", "left of the limit of 40"], sample);
    }
    // A hostile size that a packed file might hold is refused when it does not.
    let bomb = b"# vtk DataFile Version 3.0\nt\nBINARY\nDATASET POLYDATA\nPOINTS 4000 float\n123";
    Sample::one("bomb", "a.vtk", gzip(bomb)).refused(&["ends here: 47997 more bytes are announced"]);
    let mut packed = gzip(&unstructured("3.0", true, false).bytes);
    let sum = packed.len() - 6;
    packed[sum] ^= 1;
    Sample::one("sum", "a.vtk", packed).refused(&["a packed stream is damaged"]);
}

/// The samples of a `.npy` file of 16-bit numbers.
fn npy(path: &std::path::Path) -> Vec<f64> {
    let bytes = fs::read(path).unwrap();
    let header = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    bytes[header..].as_chunks::<2>().0.iter().map(|&b| f64::from(i16::from_le_bytes(b))).collect()
}

#[test]
fn shared_images() {
    if let (Some(loaded), Some(reference)) =
        (shared_loaded("format_conformance/head_i16_binary.vtk"), shared("format_conformance/head_i16.npy"))
    {
        let head = grid(loaded);
        assert_eq!(head.dims(), [64, 64, 40]);
        assert_eq!(head.spacing(), DVec3::new(3.2, 3.2, 1.5));
        assert_eq!(head.origin(), DVec3::new(-100.0, 20.5, 7.25));
        assert!(matches!(head.samples(), Samples::I16(_)));
        assert_eq!(stored(&head), npy(&reference));
    }
    if let Some(loaded) = shared_loaded("structured/iron_protein.vtk") {
        let iron = grid(loaded);
        assert_eq!((iron.dims(), iron.spacing(), iron.range()), ([68; 3], DVec3::ONE, [0.0, 255.0]));
        assert_eq!(weighted(stored(&iron)), 16_528_161.0);
    }
}

/// A sum that knows the order: every value counts once to seven times, by its place.
fn weighted(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().zip((1..=7).cycle()).map(|(value, times)| value * f64::from(times)).sum()
}

#[track_caller]
fn assert_near(value: f64, wanted: f64) {
    assert!((value - wanted).abs() <= 1e-6 * wanted.abs().max(1.0), "{value}, not {wanted}");
}

/// Numbers of points, sums and the last point as another reader gives them.
#[test]
fn shared_meshes_and_points() {
    if let Some(loaded) = shared_loaded("unstructured/post_small.vtk") {
        assert_eq!(loaded.report.shown.as_deref(), Some("point:Pressure"));
        let post = mesh(loaded);
        assert_eq!((post.points().len(), post.cells().len()), (2288, 8750));
        let sum: DVec3 = post.points().iter().sum();
        assert!(
            sum.abs_diff_eq(DVec3::new(86.987_818_419_933_32, 0.0, 632.993_857_895_955_4), 1e-9),
            "{sum}"
        );
        let TetScalars::Point(values) = post.scalars() else { panic!() };
        assert_near(weighted(values.iter().map(|&v| f64::from(v))), 7_216.757_849_782_705);
    }
    if let Some(loaded) = shared_loaded("unstructured/tiny_tets_ascii.vtk") {
        let tiny = mesh(loaded);
        assert_eq!((tiny.points().len(), tiny.cells().len()), (55, 160));
        let sum: DVec3 = tiny.points().iter().sum();
        let wanted = DVec3::new(20.779_084_316_913_213, -55.348_257_321_864_37, 1.116_823_263_466_358_2);
        assert!(sum.abs_diff_eq(wanted, 1e-9), "{sum}");
        let TetScalars::Point(values) = tiny.scalars() else { panic!() };
        assert_eq!(weighted(values.iter().map(|&v| f64::from(v))), 676.0);
    }
    for (name, count, sum, ids) in [
        (
            "bunny_fluid_7706",
            7706,
            [1_203.143_139_020_030_5, 10_506.900_533_020_496, -1_183.077_046_958_555],
            118_785_915.0,
        ),
        (
            "sailors_knot_19539",
            19539,
            [2.136_377_657_475_35, 1_191.198_792_682_153, -516.361_148_315_554_6],
            763_486_425.0,
        ),
    ] {
        let name = format!("particles/{name}.vtk");
        let Some(path) = shared(&name) else { continue };
        let all = points(volraster::io::read(&path, &with_array("id")).unwrap());
        assert_eq!(all.centres().len(), count);
        let found: DVec3 = all.centres().iter().sum();
        assert!(found.abs_diff_eq(DVec3::from_array(sum), 1e-8), "{found}");
        assert_eq!(weighted(all.scalars().unwrap().iter().map(|&v| f64::from(v))), ids);
        if name.contains("bunny") {
            let z = points(volraster::io::read(&path, &with_array("velocity:z")).unwrap());
            assert_near(weighted(z.scalars().unwrap().iter().map(|&v| f64::from(v))), 2_661.620_357_750_915);
        }
    }
}

#[test]
fn what_moves_an_image_is_told() {
    let old = sample("image of version 1 without lookup table").loaded();
    assert!(
        old.report.notes.contains(&"negative spacing: axes are reversed".to_owned()),
        "{:?}",
        old.report.notes
    );
    let turned = sample("image with extent and direction").loaded();
    let note = "indices begin at 1 -1 4: the origin is moved there";
    assert!(turned.report.notes.contains(&note.to_owned()), "{:?}", turned.report.notes);
}

#[test]
fn the_last_spacing_counts() {
    let image = |spacings: &str| {
        let head =
            format!("DATASET STRUCTURED_POINTS\nDIMENSIONS 2 2 2\nORIGIN 0 0 0\n{spacings}\nPOINT_DATA 8");
        Vtk::new("3.0", false).line(&head).scalars("s", "int", &list(8, |i| i)).sample("spacings").loaded()
    };
    let same = image("SPACING 1 2 3\nASPECT_RATIO 1 2 3");
    assert!(same.report.warnings.is_empty(), "{:?}", same.report.warnings);
    assert_eq!(grid(same).spacing(), DVec3::new(1.0, 2.0, 3.0));
    let other = image("SPACING 1 2 3\nASPECT_RATIO 1 2 4");
    assert_eq!(
        other.report.warnings,
        ["ASPECT_RATIO 1 2 4: the previous spacing was 1 2 3, the last one is used"]
    );
    assert_eq!(grid(other).spacing(), DVec3::new(1.0, 2.0, 4.0));
}
