//! Gmsh meshes: every version and encoding hold the same, every element type fills its shape.

use glam::DVec3;
use volraster::io::{Progress, ReadOptions};
use volraster::scene::{TetScalars, Tets};

use super::support::*;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Numbers {
    Words,
    Little,
    Big,
}

/// How a file is written.
#[derive(Clone, Copy, Debug)]
struct Style {
    version: u8,
    numbers: Numbers,
    size: u8,
}

const STYLES: [Style; 9] = [
    Style { version: 2, numbers: Numbers::Words, size: 8 },
    Style { version: 2, numbers: Numbers::Little, size: 8 },
    Style { version: 2, numbers: Numbers::Big, size: 8 },
    Style { version: 2, numbers: Numbers::Big, size: 4 },
    Style { version: 4, numbers: Numbers::Words, size: 8 },
    Style { version: 4, numbers: Numbers::Little, size: 8 },
    Style { version: 4, numbers: Numbers::Big, size: 8 },
    Style { version: 4, numbers: Numbers::Little, size: 4 },
    Style { version: 4, numbers: Numbers::Words, size: 4 },
];

/// A type, an entity that is its own physical group, and numbers with nodes.
type Block = (i32, i32, Vec<(u64, Vec<u64>)>);

struct Writer {
    style: Style,
    out: Vec<u8>,
}

impl Writer {
    fn new(style: Style) -> Self {
        let mut writer = Self { style, out: Vec::new() };
        let binary = u8::from(style.numbers != Numbers::Words);
        let version = if style.version == 2 { "2.2" } else { "4.1" };
        writer.text(&format!("$MeshFormat\n{version} {binary} {}\n", style.size));
        if binary == 1 {
            writer.int(1);
            writer.text("\n");
        }
        writer.text("$EndMeshFormat\n");
        writer
    }

    fn text(&mut self, text: &str) {
        self.out.extend_from_slice(text.as_bytes());
    }

    fn put<const N: usize>(&mut self, word: String, little: [u8; N]) {
        match self.style.numbers {
            Numbers::Words => self.text(&format!("{word} ")),
            Numbers::Little => self.out.extend_from_slice(&little),
            Numbers::Big => self.out.extend(little.into_iter().rev()),
        }
    }

    fn int(&mut self, number: i32) {
        self.put(number.to_string(), number.to_le_bytes());
    }

    fn wide(&mut self, number: u64) {
        if self.style.size == 4 {
            self.put(number.to_string(), u32::try_from(number).unwrap().to_le_bytes());
        } else {
            self.put(number.to_string(), number.to_le_bytes());
        }
    }

    /// A tag, as the version has it.
    fn tag(&mut self, tag: u64) {
        if self.style.version == 2 { self.int(i32::try_from(tag).unwrap()) } else { self.wide(tag) }
    }

    fn real(&mut self, number: f64) {
        if self.style.version == 2 && self.style.size == 4 {
            self.put(number.to_string(), (number as f32).to_le_bytes());
        } else {
            self.put(number.to_string(), number.to_le_bytes());
        }
    }

    /// Ends a line of words.
    fn row(&mut self) {
        if self.style.numbers == Numbers::Words {
            self.text("\n");
        }
    }

    fn section(&mut self, name: &str, fill: impl FnOnce(&mut Self)) {
        self.text(&format!("${name}\n"));
        fill(self);
        if self.style.numbers != Numbers::Words {
            self.text("\n");
        }
        self.text(&format!("$End{name}\n"));
    }

    /// All nodes, in blocks of an entity of each dimension with or without parameters.
    fn nodes(&mut self, nodes: &[(u64, [f64; 3])]) {
        self.section("Nodes", |w| {
            if w.style.version == 2 {
                w.text(&format!("{}\n", nodes.len()));
                for (tag, point) in nodes {
                    w.tag(*tag);
                    point.iter().for_each(|x| w.real(*x));
                    w.row();
                }
                return;
            }
            let half = nodes.len() / 2;
            for number in [3, nodes.len() as u64, 1, 99] {
                w.wide(number);
            }
            w.row();
            for (dimension, parametric, nodes) in
                [(2, 1, &nodes[..half]), (1, 1, &nodes[half..half]), (3, 0, &nodes[half..])]
            {
                [dimension, 1, parametric].into_iter().for_each(|n| w.int(n));
                w.wide(nodes.len() as u64);
                w.row();
                for (tag, _) in nodes {
                    w.tag(*tag);
                    w.row();
                }
                for (_, point) in nodes {
                    point.iter().for_each(|x| w.real(*x));
                    if parametric == 1 {
                        w.real(0.25);
                        w.real(0.5);
                    }
                    w.row();
                }
            }
        });
    }

    fn elements(&mut self, blocks: &[Block]) {
        self.section("Elements", |w| {
            let all: usize = blocks.iter().map(|(_, _, elements)| elements.len()).sum();
            if w.style.version == 2 {
                w.text(&format!("{all}\n"));
            } else {
                [blocks.len() as u64, all as u64, 1, 99].into_iter().for_each(|n| w.wide(n));
                w.row();
            }
            for (kind, entity, elements) in blocks {
                let count = elements.len();
                match (w.style.version, w.style.numbers) {
                    (2, Numbers::Words) => {}
                    (2, _) => [*kind, count as i32, 2].into_iter().for_each(|n| w.int(n)),
                    _ => {
                        [3, *entity, *kind].into_iter().for_each(|n| w.int(n));
                        w.wide(count as u64);
                        w.row();
                    }
                }
                for (number, nodes) in elements {
                    w.tag(*number);
                    if w.style.version == 2 {
                        if w.style.numbers == Numbers::Words {
                            w.int(*kind);
                            w.int(2);
                        }
                        w.int(*entity);
                        w.int(77);
                    }
                    nodes.iter().for_each(|node| w.tag(*node));
                    w.row();
                }
            }
        });
    }

    fn data(&mut self, section: &str, name: &str, tags: &[i32], tuples: &[(u64, Vec<f64>)]) {
        self.section(section, |w| {
            let components = tuples.first().map_or(1, |(_, tuple)| tuple.len());
            let (step, more) = tags.split_first().unwrap();
            w.text(&format!("1\n\"{name}\"\n1\n0.5\n{}\n", 3 + more.len()));
            w.text(&format!("{step}\n{components}\n{}\n", tuples.len()));
            more.iter().for_each(|tag| w.text(&format!("{tag}\n")));
            for (tag, tuple) in tuples {
                w.int(i32::try_from(*tag).unwrap());
                if section == "ElementNodeData" {
                    w.int(1);
                }
                tuple.iter().for_each(|x| w.real(*x));
                w.row();
            }
        });
    }
}

const NODES: [(u64, [f64; 3]); 5] = [
    (10, [0.0, 0.0, 0.0]),
    (3, [1.0, 0.0, 0.0]),
    (7, [0.0, 1.0, 0.0]),
    (900_000, [0.0, 0.0, 1.0]),
    (5, [1.0, 1.0, 1.0]),
];

/// Two tetrahedra, a triangle and a vertex, with views of every kind.
fn mesh(style: Style) -> Vec<u8> {
    let mut w = Writer::new(style);
    w.text(
        "$PhysicalNames\n2\n2 8 \"skin\"\n3 4 \"core\"\n$EndPhysicalNames\n$Strange\nanything\n$EndStrange\n",
    );
    if style.version == 4 {
        w.section("Entities", |w| {
            [1, 1, 0, 2].into_iter().for_each(|n| w.wide(n));
            w.row();
            w.int(1);
            (0..3).for_each(|_| w.real(0.5));
            w.wide(0);
            w.row();
            w.int(1);
            (0..6).for_each(|_| w.real(0.5));
            w.wide(1);
            w.int(6);
            w.wide(2);
            w.int(1);
            w.int(-1);
            w.row();
            for (tag, groups) in [(4, vec![-4, 9]), (6, vec![])] {
                w.int(tag);
                (0..6).for_each(|_| w.real(0.5));
                w.wide(groups.len() as u64);
                groups.into_iter().for_each(|group| w.int(group));
                w.wide(0);
                w.row();
            }
        });
        w.section("PartitionedEntities", |w| {
            for number in [1, 1] {
                w.wide(number);
            }
            w.int(9);
            w.int(1);
            [0, 0, 0, 1].into_iter().for_each(|n| w.wide(n));
            w.row();
            [6, 3, 4].into_iter().for_each(|n| w.int(n));
            w.wide(1);
            w.int(1);
            (0..6).for_each(|_| w.real(0.5));
            w.wide(1);
            w.int(6);
            w.wide(0);
            w.row();
        });
    }
    w.nodes(&NODES);
    w.elements(&[
        (15, 1, vec![(1, vec![10])]),
        (2, 8, vec![(2, vec![10, 3, 7])]),
        (4, 4, vec![(50, vec![10, 3, 7, 900_000])]),
        (4, 6, vec![(40, vec![3, 7, 900_000, 5])]),
    ]);
    w.text("$Periodic\n0\n$EndPeriodic\n");
    let one = |values: &[f64]| {
        NODES.iter().map(|node| node.0).zip(values.iter().map(|&v| vec![v])).collect::<Vec<_>>()
    };
    w.data("NodeData", "T", &[0], &one(&[0.5, 1.5, 2.5, 3.5, 4.5]));
    w.data("NodeData", "T", &[3], &[(5, vec![50.5]), (3, vec![51.5]), (10, vec![52.5])]);
    let vectors: Vec<_> = NODES.iter().map(|(tag, [x, y, z])| (*tag, vec![3.0 * x, 4.0 * y, *z])).collect();
    w.data("NodeData", "U", &[0], &vectors);
    w.data("ElementData", "E", &[0], &[(40, vec![-1.25]), (50, vec![8.5]), (2, vec![99.0])]);
    w.data("ElementNodeData", "edges", &[0], &[(40, vec![1.0])]);
    w.out
}

fn styled(style: Style) -> Sample {
    let what: &'static str = Box::leak(format!("{style:?}").into_boxed_str());
    Sample::one(what, "a.msh", mesh(style))
}

/// A tetrahedron in words, with more behind it.
fn words(version: &str, nodes: &str, elements: &str, more: &str) -> Vec<u8> {
    format!(
        "$MeshFormat\n{version} 0 8\n$EndMeshFormat\n$Nodes\n{nodes}$EndNodes\n$Elements\n{elements}$EndElements\n\
         {more}"
    )
    .into_bytes()
}

const FOUR: &str = "4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n";
const DATA: &str = "$NodeData\n1\n\"T\"\n0\n3\n0\n1\n4\n1 1\n2 2\n3 3\n4 4\n$EndNodeData\n";

fn tetrahedron(more: &str) -> Vec<u8> {
    words("2.2", FOUR, "1\n1 4 2 0 1 1 2 3 4\n", more)
}

/// Small files of every version and encoding.
pub fn samples() -> Vec<Sample> {
    let mut samples: Vec<Sample> = STYLES.into_iter().map(styled).collect();
    samples.push(Sample::one("gzip", "a.msh.gz", gzip(&mesh(STYLES[0]))));
    samples.push(Sample::one("gzip, binary", "a.msh.gz", gzip(&mesh(STYLES[5]))));
    let comments = [b"$Comments\nby hand\n$EndComments\n".as_slice(), &tetrahedron(DATA)].concat();
    samples.push(Sample::one("comments first", "a", comments));
    let text = String::from_utf8(tetrahedron(DATA)).unwrap();
    samples.push(Sample::one("carriage returns", "a.msh", text.replace('\n', "\r\n")));
    let parametric = text
        .replace("Nodes", "ParametricNodes")
        .replace("1 0 0 0\n2 1 0 0\n3 0 1 0\n", "1 0 0 0 0 1\n2 1 0 0 1 1 .5\n3 0 1 0 2 1 .5 .5\n")
        .replace("4 0 0 1\n$", "4 0 0 1 3 1\n$");
    samples.push(Sample::one("parametric nodes of version 2", "a.msh", parametric));
    samples.push(Sample::one(
        "points alone",
        "a.msh",
        format!("$MeshFormat\n2 0 8\n$EndMeshFormat\n$Nodes\n{FOUR}$EndNodes\n{DATA}"),
    ));
    samples.extend(SHAPES.iter().flat_map(|shape| {
        [STYLES[0], STYLES[5]].map(|style| Sample::one(shape.name, "a.msh", shape.file(style)))
    }));
    samples
}

fn read(sample: &Sample, array: &str) -> (Tets, Vec<String>, Vec<String>) {
    let options = ReadOptions { array: Some(array.to_owned()), ..OPTIONS };
    let loaded = sample.read(&options).unwrap_or_else(|e| panic!("{}: {e}", sample.what));
    let (notes, warnings) = (loaded.report.notes.clone(), loaded.report.warnings.clone());
    (super::support::mesh(loaded), notes, warnings)
}

#[test]
fn every_version_and_encoding_holds_the_same() {
    for sample in &samples()[..STYLES.len() + 2] {
        let what = sample.what;
        let loaded = sample.loaded();
        let arrays: Vec<String> = loaded.report.arrays.iter().map(ToString::to_string).collect();
        let real = if what.contains("version: 2") && what.contains("size: 4") { "f32" } else { "f64" };
        let wanted = [
            format!("point:T ({real})"),
            format!("point:T@3 ({real})"),
            format!("point:U ({real} x 3)"),
            format!("cell:E ({real})"),
            "cell:gmsh:physical (i32)".to_owned(),
        ];
        assert_eq!(arrays, wanted, "{what}");
        assert_eq!(loaded.report.shown.as_deref(), Some("point:T"));
        let (tets, notes, warnings) = read(sample, "T");
        assert_eq!(tets.points(), NODES.map(|(_, point)| DVec3::from(point)), "{what}");
        assert_eq!(tets.cells(), [[0, 1, 2, 3], [1, 2, 3, 4]], "{what}");
        assert_eq!(*tets.scalars(), TetScalars::Point(vec![0.5, 1.5, 2.5, 3.5, 4.5]), "{what}");
        assert_eq!(
            notes,
            [
                "edges: is $ElementNodeData, left out",
                "section $Strange left out",
                "2 cells without volume (surfaces, lines, vertices) left out",
                "gmsh:physical: 4 is \"core\"",
            ],
            "{what}"
        );
        assert!(warnings.is_empty(), "{what}: {warnings:?}");

        let (tets, _, warnings) = read(sample, "U:y");
        assert_eq!(*tets.scalars(), TetScalars::Point(vec![0.0, 0.0, 4.0, 0.0, 4.0]), "{what}");
        assert!(warnings.is_empty(), "{what}: {warnings:?}");
        let (tets, ..) = read(sample, "U");
        assert_eq!(tets.scalars().values()[4], 26.0_f32.sqrt(), "{what}");
        let (tets, _, warnings) = read(sample, "E");
        assert_eq!(*tets.scalars(), TetScalars::Cell(vec![8.5, -1.25]), "{what}");
        assert!(warnings.is_empty(), "{what}: {warnings:?}");
        let (tets, ..) = read(sample, "gmsh:physical");
        assert_eq!(*tets.scalars(), TetScalars::Cell(vec![4.0, 6.0]), "{what}");
    }
}

#[test]
fn what_has_no_value_is_vacuum() {
    let more = "$NodeData\n1\n\"a\"\n0\n3\n0\n1\n5\n1 1\n4 2\n9 3\n2 4\n2 5\n$EndNodeData\n\
        $ElementData\n2\n\"e\"\n\"scheme\"\n0\n3\n0\n1\n1\n2 1\n$EndElementData\n";
    let elements = "2\n1 4 0 1 2 3 4\n2 4 0 1 2 5 4\n";
    let nodes = "5\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 0 -1 0\n";
    let sample = Sample::one("a subset", "a.msh", words("2.1", nodes, elements, more));
    let options = ReadOptions { array: Some("a".to_owned()), ..OPTIONS };
    sample.read(&options).map(|_| ()).unwrap_err();
    let (tets, _, warnings) = read(&sample, "e");
    assert_eq!(tets.scalars().values()[1], 1.0);
    assert!(tets.scalars().values()[0].is_nan() && tets.blank_count() == 1);
    assert_eq!(
        warnings,
        [
            "e: 1 of 2 solid elements have no value: they are NaN",
            "e: has an interpolation scheme: between nodes it is interpolated linearly anyway",
        ]
    );
    let more = more.replace("1 1\n4 2", "1 1\n4 2\n3 7").replace("1\n5\n", "1\n6\n");
    let sample = Sample::one("a subset", "a.msh", words("2.1", nodes, elements, &more));
    let (tets, _, warnings) = read(&sample, "a");
    assert_eq!(tets.scalars().values()[..4], [1.0, 5.0, 7.0, 2.0]);
    assert!(tets.scalars().values()[4].is_nan());
    assert_eq!(
        warnings,
        [
            "a: 1 of 5 nodes have no value: they are NaN",
            "a: 1 values are given more than once: the last one is used",
            "a: 1 values belong to no node or element in this file",
        ]
    );
}

#[test]
fn steps_and_partitions_of_a_view() {
    let view = |step: &str, tags: &str| {
        format!("$NodeData\n1\n\"p\"\n1\n0\n{tags}\n{step}\n1\n2\n").replace("\n4\n", "\n4\n")
    };
    // Two pieces of one step, another step, and a second view of that name and step.
    let more = [
        view("0", "4") + "1\n1 1\n2 2\n$EndNodeData\n",
        view("0", "4") + "2\n3 3\n4 4\n$EndNodeData\n",
        view("5", "3") + "1 1\n2 2\n$EndNodeData\n",
        view("0", "3") + "1 -1\n2 -2\n$EndNodeData\n",
    ]
    .concat();
    let sample = Sample::one("pieces", "a.msh", tetrahedron(&more));
    let loaded = sample.loaded();
    let names: Vec<&str> = loaded.report.arrays.iter().map(|array| array.name.as_str()).collect();
    assert_eq!(names, ["p", "p@5", "p@0#2"]);
    assert_eq!(read(&sample, "p").0.scalars().values(), [1.0, 2.0, 3.0, 4.0]);
}

#[test]
fn elements_of_several_groups_count_once() {
    let more = "$ElementData\n1\n\"e\"\n0\n3\n0\n1\n1\n2 6\n$EndElementData\n";
    let elements = "3\n1 4 2 7 1 1 2 3 4\n2 4 2 8 1 1 2 3 4\n3 2 2 8 1 1 2 3\n";
    let sample = Sample::one("twice", "a.msh", words("2.2", FOUR, elements, more));
    let (tets, notes, warnings) = read(&sample, "e");
    assert_eq!((tets.cells().len(), tets.scalars().values()), (1, &[6.0][..]));
    assert!(notes.contains(&"1 elements that repeat for further physical groups left out".to_owned()));
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(read(&sample, "gmsh:physical").0.scalars().values(), [7.0]);
}

#[test]
fn groups_are_shown_where_there_is_nothing_else() {
    let file = |group: &str| words("2.2", FOUR, &format!("1\n1 4 2 {group} 1 1 2 3 4\n"), "");
    let loaded = Sample::one("groups alone", "a.msh", file("3")).loaded();
    assert_eq!(loaded.report.shown.as_deref(), Some("cell:gmsh:physical"));
    Sample::one("nothing", "a.msh", file("0")).refused(&["arrays: none: a mesh needs point or cell data"]);
    let more = DATA.replace("\n1\n4\n1 1\n2 2\n3 3\n4 4", "\n3\n4\n1 1 0 0\n2 2 0 0\n3 3 0 0\n4 4 0 0");
    let file = words("2.2", FOUR, "1\n1 4 2 3 1 1 2 3 4\n", &more);
    let loaded = Sample::one("a vector", "a.msh", file).loaded();
    assert_eq!(loaded.report.shown.as_deref(), Some("point:T:magnitude"), "before numbers of groups");
}

/// An element type: corners of a shape of known volume, and the nodes behind them as the means of corners.
struct Shape {
    name: &'static str,
    kind: i32,
    corners: &'static [[f64; 3]],
    means: &'static [&'static [usize]],
    volume: f64,
    /// Nodes that are left out.
    extra: usize,
}

const T: &[[f64; 3]] = &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
const H: &[[f64; 3]] = &[
    [0.0, 0.0, 0.0],
    [2.0, 0.0, 0.0],
    [2.0, 3.0, 0.0],
    [0.0, 3.0, 0.0],
    [0.0, 0.0, 4.0],
    [2.0, 0.0, 4.0],
    [2.0, 3.0, 4.0],
    [0.0, 3.0, 4.0],
];
const P: &[[f64; 3]] =
    &[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 4.0], [2.0, 0.0, 4.0], [0.0, 3.0, 4.0]];
const Y: &[[f64; 3]] = &[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 3.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 4.0]];
const T_EDGES: &[&[usize]] = &[&[0, 1], &[1, 2], &[2, 0], &[3, 0], &[2, 3], &[1, 3]];
const H_MEANS: &[&[usize]] = &[
    &[0, 1],
    &[0, 3],
    &[0, 4],
    &[1, 2],
    &[1, 5],
    &[2, 3],
    &[2, 6],
    &[3, 7],
    &[4, 5],
    &[4, 7],
    &[5, 6],
    &[6, 7],
    &[0, 1, 2, 3],
    &[0, 1, 4, 5],
    &[0, 3, 4, 7],
    &[1, 2, 5, 6],
    &[2, 3, 6, 7],
    &[4, 5, 6, 7],
    &[0, 1, 2, 3, 4, 5, 6, 7],
];
const P_MEANS: &[&[usize]] = &[
    &[0, 1],
    &[0, 2],
    &[0, 3],
    &[1, 2],
    &[1, 4],
    &[2, 5],
    &[3, 4],
    &[3, 5],
    &[4, 5],
    &[0, 1, 3, 4],
    &[0, 2, 3, 5],
    &[1, 2, 4, 5],
];
const Y_MEANS: &[&[usize]] =
    &[&[0, 1], &[0, 3], &[0, 4], &[1, 2], &[1, 4], &[2, 3], &[2, 4], &[3, 4], &[0, 1, 2, 3]];

const SHAPES: [Shape; 11] = [
    Shape { name: "tetrahedron of 4", kind: 4, corners: T, means: &[], volume: 1.0 / 6.0, extra: 0 },
    Shape { name: "hexahedron of 8", kind: 5, corners: H, means: &[], volume: 24.0, extra: 0 },
    Shape { name: "prism of 6", kind: 6, corners: P, means: &[], volume: 12.0, extra: 0 },
    Shape { name: "pyramid of 5", kind: 7, corners: Y, means: &[], volume: 8.0, extra: 0 },
    Shape { name: "tetrahedron of 10", kind: 11, corners: T, means: T_EDGES, volume: 1.0 / 6.0, extra: 0 },
    Shape { name: "hexahedron of 27", kind: 12, corners: H, means: H_MEANS, volume: 24.0, extra: 0 },
    Shape { name: "prism of 18", kind: 13, corners: P, means: P_MEANS, volume: 12.0, extra: 3 },
    Shape { name: "pyramid of 14", kind: 14, corners: Y, means: Y_MEANS, volume: 8.0, extra: 1 },
    Shape {
        name: "hexahedron of 20",
        kind: 17,
        corners: H,
        means: H_MEANS.split_at(12).0,
        volume: 24.0,
        extra: 0,
    },
    Shape { name: "prism of 15", kind: 18, corners: P, means: P_MEANS.split_at(9).0, volume: 12.0, extra: 0 },
    Shape {
        name: "pyramid of 13",
        kind: 19,
        corners: Y,
        means: Y_MEANS.split_at(8).0,
        volume: 8.0,
        extra: 0,
    },
];

impl Shape {
    fn points(&self) -> Vec<DVec3> {
        let mut points: Vec<DVec3> = self.corners.iter().map(|&corner| corner.into()).collect();
        for corners in self.means {
            let sum: DVec3 = corners.iter().map(|&corner| points[corner]).sum();
            points.push(sum / corners.len() as f64);
        }
        points
    }

    fn file(&self, style: Style) -> Vec<u8> {
        let mut w = Writer::new(style);
        let points = self.points();
        let nodes: Vec<(u64, [f64; 3])> = (1..).zip(points.iter().map(|p| p.to_array())).collect();
        w.nodes(&nodes);
        w.elements(&[(self.kind, 1, vec![(1, (1..=points.len() as u64).collect())])]);
        let values = points.iter().map(|p| vec![p.x + 2.0 * p.y + 4.0 * p.z]);
        w.data("NodeData", "f", &[0], &(1..).zip(values).collect::<Vec<_>>());
        w.out
    }
}

#[test]
fn every_element_type_fills_its_shape() {
    for shape in &SHAPES {
        for style in STYLES {
            let loaded = Sample::one(shape.name, "a.msh", shape.file(style)).loaded();
            let told =
                loaded.report.notes.iter().any(|note| note.contains("in the middle of faces left out"));
            assert_eq!(told, shape.extra > 0, "{}", shape.name);
            let tets = super::support::mesh(loaded);
            // Any two nodes exchanged would overlap or leave gaps.
            let volume: f64 = tets
                .cells()
                .iter()
                .map(|cell| cell.map(|i| tets.points()[i as usize]))
                .map(|[a, b, c, d]| (b - a).cross(c - a).dot(d - a) / 6.0)
                .sum();
            assert!(
                (volume - shape.volume).abs() < 1e-6 * shape.volume,
                "{} {style:?}: {volume}",
                shape.name
            );
            // Nodes of opposite sides exchanged would keep the sum: no tetrahedron may lie in another.
            let solid: Vec<[DVec3; 4]> =
                tets.cells().iter().map(|cell| cell.map(|i| tets.points()[i as usize])).collect();
            let near =
                |cell: &[DVec3; 4]| cell.map(|corner| corner * 0.8 + cell.iter().sum::<DVec3>() * 0.05);
            for place in solid.iter().flat_map(near) {
                let inside = |[a, b, c, d]: &[DVec3; 4]| {
                    [[a, b, c], [a, d, b], [a, c, d], [b, d, c]]
                        .iter()
                        .all(|[p, q, r]| (**q - **p).cross(**r - **p).dot(place - **p) > 1e-9)
                };
                assert_eq!(solid.iter().filter(|cell| inside(cell)).count(), 1, "{} {place}", shape.name);
            }
            // The element is split at its own nodes, or at a centre with the value of its shape functions.
            for (point, value) in tets.points().iter().zip(tets.scalars().values()) {
                let wanted = point.x + 2.0 * point.y + 4.0 * point.z;
                assert!((f64::from(*value) - wanted).abs() < 1e-5, "{}: {value} {wanted}", shape.name);
            }
            // A hexahedron of 27 has its centre; new points are behind.
            let mut used = vec![false; tets.points().len()];
            tets.cells().iter().flatten().for_each(|&i| used[i as usize] = true);
            assert_eq!(used.iter().filter(|used| !**used).count(), shape.extra, "{}", shape.name);
        }
    }
}

#[test]
fn tags_may_be_any_numbers() {
    let nodes =
        "1 4 1 9\n3 1 0 4\n18446744073709551615\n0\n9223372036854775808\n12\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n";
    let elements = "1 1 1 1\n3 1 4 1\n5 18446744073709551615 0 9223372036854775808 12\n";
    let values = "12 4\n9223372036854775808 3\n0 2\n18446744073709551615 1";
    let data = DATA.replace("1 1\n2 2\n3 3\n4 4", values);
    let sample = Sample::one("huge tags", "a.msh", words("4.1", nodes, elements, &data));
    assert_eq!(read(&sample, "T").0.scalars().values(), [1.0, 2.0, 3.0, 4.0]);
    let data = "$ElementData\n1\n\"e\"\n0\n3\n0\n1\n1\n5 2.5\n$EndElementData\n";
    let sample = Sample::one("huge tags", "a.msh", words("4.1", nodes, elements, data));
    let (tets, ..) = read(&sample, "e");
    assert_eq!(tets.cells(), [[0, 1, 2, 3]]);
}

#[test]
fn broken_rules_are_refused_in_one_line() {
    let whole = String::from_utf8(tetrahedron(DATA)).unwrap();
    let four = String::from_utf8(words(
        "4.1",
        "1 4 1 4\n3 1 0 4\n1\n2\n3\n4\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n",
        "1 1 1 1\n3 1 4 1\n1 1 2 3 4\n",
        DATA,
    ))
    .unwrap();
    Sample::one("the second as it is", "a.msh", four.clone()).loaded();
    let cases: &[(&str, &str, &str, &str)] = &[
        (&whole, "2.2 0 8", "4 0 8", "line 2: version \"4\": 2.0 to 2.2 and 4.1 are supported"),
        (&whole, "2.2 0 8", "2.2 2 8", "line 2: file type 2: must be 0 for text or 1 for binary"),
        (&whole, "2.2 0 8", "2.2 0 16", "line 2: data of 16 bytes: must be 4 or 8"),
        (&whole, "2.2 0 8\n", "2.2 1 8\nabcd", "mark of byte order"),
        (&whole, "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n", "$NOD\n", "line 1: $NOD: is of version 1"),
        (&whole, "$EndMeshFormat", "$End", "line 3: \"$End\": must be $EndMeshFormat"),
        (
            &whole,
            "$Nodes\n",
            "$Elements\n0\n$EndElements\n$Nodes\n",
            "line 4: $Elements: $Nodes must come before",
        ),
        (&whole, "$Elements\n", "$Nodes\n", "line 11: $Nodes: a second one"),
        (&whole, "$Nodes\n", "Nodes\n", "line 4: \"Nodes\": must begin a section"),
        (&whole, "$Nodes\n4\n", "$Foo\n", "line 4: $Foo: there is no $EndFoo"),
        (&whole, "\n4\n1 0 0 0", "\n4000000\n1 0 0 0", "4000000 nodes: the"),
        (&whole, "\n4\n1 0 0 0", "\n5\n1 0 0 0", "line 10: \"$EndNodes\": must be a node's number"),
        (&whole, "\n4\n1 0 0 0", "\n-4\n1 0 0 0", "line 5: \"-4\": must be the number of nodes"),
        (&whole, "\n4 0 0 1\n", "\n", "line 9: \"$EndNodes\""),
        (&whole, "\n4 0 0 1\n", "\n4 0 0 1\n5 0 0 1\n", "line 10: \"5 0 0 1\": must be $EndNodes"),
        (&whole, "\n4 0 0 1\n", "\n4 0 0 1 7\n", "line 9: \"7\": must not follow here"),
        (&whole, "\n4 0 0 1\n", "\n4 0 0\n", "line 9: ends before a coordinate"),
        (&whole, "\n4 0 0 1\n", "\n-4 0 0 1\n", "line 9: \"-4\": must be a node's number"),
        (&whole, "\n4 0 0 1\n", "\n3 0 0 1\n", "node 3: there are two of this number"),
        (&whole, "1 4 2 0 1 1 2 3 4", "1 4 2 0 1 1 2 3 5", "line 13: element 1: there is no node 5"),
        (&whole, "1 4 2 0 1 1 2 3 4", "1 4 2 0 1 1 2 3", "line 13: ends before a node"),
        (&whole, "1 4 2 0 1 1 2 3 4", "1 4 -2 0 1 1 2 3", "line 13: \"-2\": must be a number of tags"),
        (
            &whole,
            "1 4 2 0 1 1 2 3 4",
            "1 29 2 0 1 1 2 3",
            "elements of type 29 (tetrahedra of a higher order)",
        ),
        (&whole, "1 4 2 0 1 1 2 3 4", "1 4 99999 0 1 1 2 3", "elements of this type: the"),
        (&whole, "$Elements\n1\n", "$Elements\n2\n", "line 14: \"$EndElements\""),
        (&whole, "\"T\"\n0\n3\n0\n1\n4\n", "\"T\"\n0\n3\n0\n1\n99\n", "99 tuples: the"),
        (&whole, "\"T\"\n0\n3\n0\n1\n4\n", "\"T\"\n0\n3\n0\n0\n4\n", "0 components: must be from 1 to 1024"),
        (
            &whole,
            "\"T\"\n0\n3\n0\n1\n4\n",
            "\"T\"\n0\n2\n0\n1\n",
            "2 integer tags: step, components and number of tuples",
        ),
        (&whole, "\"T\"\n0\n3\n0\n1\n4\n", "\"T\"\n0\n3\n0\n1\n-4\n", "-4 tuples: must not be negative"),
        (&whole, "\"T\"\n0\n3\n0\n1\n4\n", "\"T\"\n0\n3\n0\n1\n3\n", "\"4 4\": 3 tuples are announced"),
        (&whole, "\n4 4\n", "\n", "\"$EndNodeData\": must be a tag"),
        (&whole, "\n4 4\n", "\n4 four\n", "line 26: \"four\": must be a value"),
        (&whole, "\n4 4\n$EndNodeData", "\n4 4", "line 22: $NodeData: there is no $EndNodeData"),
        (&whole, "$NodeData", "$ElementNodeData", "$ElementNodeData: there is no $EndElementNodeData"),
        (&four, "\n3 1 0 4\n", "\n3 1 0 5\n", "a block of 5 nodes: 4 in all are announced"),
        (&four, "\n3 1 0 4\n", "\n3 1 0 3\n", "line 10: ends before a coordinate"),
        (&four, "$Nodes\n1 4 1 4\n", "$Nodes\n1 5 1 4\n", "$Nodes: 5 are announced, the blocks hold 4"),
        (
            &four,
            "$Elements\n1 1 1 1\n",
            "$Elements\n1 2 1 1\n",
            "$Elements: 2 are announced, the blocks hold 1",
        ),
        (&four, "\n3 1 4 1\n", "\n3 1 4 2\n", "a block of 2 elements: 1 are left of those announced"),
        (&four, "\n3 1 4 1\n", "\n3 1 140 1\n", "elements of type 140 (unknown)"),
    ];
    let mut others = Vec::new();
    for (text, from, to, rule) in cases {
        let broken = text.replacen(from, to, 1);
        assert_ne!(broken, **text, "{from}");
        let error = Sample::one("broken", "a.msh", broken).read(&OPTIONS).expect_err(rule);
        assert_refusal(&error, &["a.msh: "], rule);
        if !error.to_string().contains(rule) {
            others.push(format!("\"{rule}\" is not in: {error}"));
        }
    }
    assert!(others.is_empty(), "{}", others.join("\n"));
    Sample::one("no mesh", "a.msh", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n").refused(&["$Nodes: missing"]);
    let options = |array: &str| ReadOptions { array: Some(array.to_owned()), ..OPTIONS };
    for wanted in ["edges", "point:edges", "edges:0"] {
        let error = styled(STYLES[0]).read(&options(wanted)).unwrap_err();
        assert_refusal(&error, &["array \"edges\": is $ElementNodeData"], wanted);
    }
    let error = styled(STYLES[0]).read(&options("T@1")).unwrap_err();
    assert_refusal(&error, &["array \"T@1\": no such array: there are point:T (f64)"], "T@1");
    let error = styled(STYLES[1]).read(&ReadOptions::within(200)).unwrap_err();
    assert_refusal(&error, &["nodes: 240 bytes of memory: 200 are left of the limit of 200"], "memory");
}

#[test]
fn real_files_in_words_and_binary_hold_the_same() {
    let Some(words) = shared_loaded("format_conformance/post_small_msh22_ascii.msh") else { return };
    let Some(binary) = shared_loaded("format_conformance/post_small_msh41_bin.msh") else { return };
    for loaded in [&words, &binary] {
        assert_eq!(loaded.report.shown.as_deref(), Some("point:Pressure"));
        assert!(loaded.report.notes.is_empty() && loaded.report.warnings.is_empty(), "{:?}", loaded.report);
    }
    let (words, binary) = (super::support::mesh(words), super::support::mesh(binary));
    assert_eq!((words.points().len(), words.cells().len()), (2288, 8750));
    assert_eq!(words.cells(), binary.cells());
    assert_eq!(words.scalars(), binary.scalars(), "nine digits tell 32-bit floats apart");
    assert!(words.points().iter().zip(binary.points()).all(|(a, b)| a.abs_diff_eq(*b, 1e-8)));
    assert_eq!(words.points()[2], DVec3::new(0.509_574_711, 0.0, 0.0));
    assert_eq!(words.scalars().values()[0], 0.955_898_4);
    assert_eq!(words.range().map(|value| (value * 1000.0).round()), [355.0, 1641.0]);
}

/// A view of one value on a node.
fn view(name: &str, partition: usize, tag: usize) -> String {
    format!("$NodeData\n1\n\"{name}\"\n0\n4\n0\n1\n1\n{partition}\n{tag} {tag}\n$EndNodeData\n")
}

#[test]
fn pieces_of_a_packed_view_are_read_on_the_way() {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    let more: String = (0..200).map(|i| view("p", i, 1 + i % 4)).collect();
    let folder = Folder::new();
    let path = folder.write("a.msh.gz", gzip(&tetrahedron(&more)));
    let calls = Arc::new(AtomicUsize::new(0));
    let counter = calls.clone();
    let progress = Progress::new(move |_, _| {
        counter.fetch_add(1, Ordering::Relaxed);
    });
    let options = ReadOptions { progress: Some(progress), ..OPTIONS };
    let loaded = volraster::io::read(&path, &options).unwrap();
    assert_eq!(super::support::mesh(loaded).scalars().values(), [1.0, 2.0, 3.0, 4.0]);
    let calls = calls.load(Ordering::Relaxed);
    assert!((1..40).contains(&calls), "{calls} pieces of the file were read");
}

#[test]
fn views_count_as_memory() {
    let more: String = (0..1000).map(|i| view(&format!("{i:0200}"), 0, 1)).collect();
    let sample = Sample::one("views", "a.msh", tetrahedron(&(DATA.to_owned() + &more)));
    let error = sample.read(&ReadOptions::within(100_000)).unwrap_err();
    assert_refusal(&error, &["views: ", "left of the limit of 100000"], "views");
    sample.loaded();
    let more = more.replace("NodeData", "ElementNodeData").replace("\n1 1\n$", "\n1 1 1\n$");
    let sample = Sample::one("left out", "a.msh", tetrahedron(&(DATA.to_owned() + &more)));
    let error = sample.read(&ReadOptions::within(100_000)).unwrap_err();
    assert_refusal(&error, &["views: ", "left of the limit of 100000"], "left out");
}

#[test]
fn long_lists_are_told_in_part() {
    let names: String = (1..=20).map(|i| format!("3 {i} \"n{i}\"\n")).collect();
    let edges: String = (10..30)
        .map(|i| {
            view(&format!("e{i}"), 0, 1)
                .replace("NodeData", "ElementNodeData")
                .replace("\n1 1\n$", "\n1 1 1\n$")
        })
        .collect();
    let more = format!("$PhysicalNames\n20\n{names}$EndPhysicalNames\n{edges}{DATA}");
    let elements = "1\n1 4 2 7 1 1 2 3 4\n";
    let notes = Sample::one("many", "a.msh", words("2.2", FOUR, elements, &more)).loaded().report.notes;
    let of = |what: &str| notes.iter().filter(|note| note.contains(what)).count();
    assert_eq!((of("is $ElementNodeData, left out"), of("gmsh:physical: ")), (16, 17), "{notes:?}");
    for note in ["gmsh:physical: and 4 more names", "and 4 more arrays of $ElementNodeData left out"] {
        assert!(notes.contains(&note.to_owned()), "{note}: {notes:?}");
    }
}

#[test]
fn lists_that_grew_are_given_back() {
    let elements: String =
        (0..1000).map(|i| format!("{} 4 0 {}\n", i + 1, ["1 2 3 4", "2 1 4 3"][i % 2])).collect();
    let sample = Sample::one("many", "a.msh", words("2.2", FOUR, &format!("1000\n{elements}"), DATA));
    // 33 bytes of each element, and 36 kB of the list of nodes with the one before; 16 bytes of a tetrahedron.
    sample.read(&ReadOptions::within(80_000)).unwrap();
    let error = sample.read(&ReadOptions::within(60_000)).unwrap_err();
    assert_refusal(&error, &["elements: ", "left of the limit of 60000"], "elements");
}

#[test]
fn numbers_are_as_c_prints_them() {
    let nodes = FOUR.replacen('4', "5", 1) + "5 1 1 1\n";
    let elements = "2\n1 4 0 1 2 3 4\n2 4 0 5 2 3 4\n";
    let data = DATA.replace("1\n4\n1 1", "1\n5\n5 -nan(ind)\n1 +1.e0");
    let loaded = Sample::one("nan", "a.msh", words("2.2", &nodes, elements, &data)).loaded();
    assert_eq!(super::support::mesh(loaded).blank_count(), 1);
}
