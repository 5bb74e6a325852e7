//! PLY: every encoding holds the same, arrays by name, broken headers and data.

use glam::DVec3;
use volraster::io::ReadOptions;
use volraster::scene::KernelSize;

use super::support::*;

const PROPERTIES: &str = "property float x\nproperty double y\nproperty short z\nproperty uchar red\n\
    property uint8 green\nproperty uchar blue\nproperty float32 nx\nproperty float64 ny\nproperty float nz\n\
    property int32 scale_0\nproperty uint scale_1\nproperty int64 big\nproperty uint64 huge\nproperty char c\n\
    property uint16 opacity\n";

/// Three vertices with a property of every type.
const ROWS: [[f64; 15]; 3] = [
    [0.5, 1.25, -3.0, 1.0, 2.0, 2.0, 0.0, 0.0, 1.0, -7.0, 8.0, -9.0, 10.0, -11.0, 12.0],
    [1.5, -2.25, 300.0, 255.0, 0.0, 9.0, 0.0, 3.0, 4.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0],
    [-1e3, 0.0, 0.0, 2.0, 3.0, 6.0, 1.0, 2.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 65535.0],
];

#[derive(Clone, Copy, PartialEq)]
pub enum Encoding {
    Words,
    Little,
    Big,
}

pub const ENCODINGS: [Encoding; 3] = [Encoding::Words, Encoding::Little, Encoding::Big];

/// Numbers of the types of C: `b` to `q` signed, upper case unsigned, `f` and `d` floats.
pub fn put(out: &mut Vec<u8>, encoding: Encoding, kind: char, number: f64) {
    let little: Vec<u8> = match kind {
        'b' => (number as i8).to_le_bytes().to_vec(),
        'B' => (number as u8).to_le_bytes().to_vec(),
        'h' => (number as i16).to_le_bytes().to_vec(),
        'H' => (number as u16).to_le_bytes().to_vec(),
        'i' => (number as i32).to_le_bytes().to_vec(),
        'I' => (number as u32).to_le_bytes().to_vec(),
        'q' => (number as i64).to_le_bytes().to_vec(),
        'Q' => (number as u64).to_le_bytes().to_vec(),
        'f' => (number as f32).to_le_bytes().to_vec(),
        'd' => number.to_le_bytes().to_vec(),
        _ => panic!("{kind}"),
    };
    match encoding {
        Encoding::Words => out.extend(format!("{number} ").bytes()),
        Encoding::Little => out.extend(little),
        Encoding::Big => out.extend(little.into_iter().rev()),
    }
}

pub fn name(encoding: Encoding) -> &'static str {
    match encoding {
        Encoding::Words => "ascii",
        Encoding::Little => "binary_little_endian",
        Encoding::Big => "binary_big_endian",
    }
}

/// With a list in each vertex or not, elements before and behind.
fn file(encoding: Encoding, lists: bool) -> Vec<u8> {
    let list = if lists { "property list uchar float tail\n" } else { "" };
    let mut out = format!(
        "ply\nformat {} 1.0\ncomment made by hand\nobj_info nothing\nelement camera 2\nproperty float f\n\
         element empty 9\nelement vertex 3\n{PROPERTIES}{list}element face 2\nproperty list uchar int vertex_indices\n\
         element edge 1\nproperty int a\nproperty int b\nend_header\n",
        name(encoding)
    )
    .into_bytes();
    let row = |out: &mut Vec<u8>, kinds: &str, numbers: &[f64]| {
        kinds.chars().zip(numbers).for_each(|(kind, number)| put(out, encoding, kind, *number));
        if encoding == Encoding::Words {
            out.push(b'\n');
        }
    };
    row(&mut out, "f", &[1.0]);
    row(&mut out, "f", &[2.0]);
    for (i, numbers) in ROWS.iter().enumerate() {
        if lists {
            let tail: Vec<f64> = std::iter::once(i as f64).chain((0..i).map(|i| i as f64)).collect();
            let kinds = format!("fdhBBBfdfiIqQbHB{}", "f".repeat(i));
            row(&mut out, &kinds, &[numbers.as_slice(), &tail].concat());
        } else {
            row(&mut out, "fdhBBBfdfiIqQbH", numbers);
        }
    }
    row(&mut out, "Biii", &[3.0, 0.0, 1.0, 2.0]);
    row(&mut out, "B", &[0.0]);
    row(&mut out, "ii", &[0.0, 1.0]);
    out
}

/// Points in words.
fn words(properties: &str, rows: &str) -> String {
    let count = rows.lines().count();
    format!("ply\nformat ascii 1.0\nelement vertex {count}\n{properties}end_header\n{rows}")
}

const XYZ: &str = "property float x\nproperty float y\nproperty float z\n";

/// Small files of every encoding.
pub fn samples() -> Vec<Sample> {
    let mut samples = Vec::new();
    for encoding in ENCODINGS {
        samples.push(Sample::one(name(encoding), "a.ply", file(encoding, false)));
        samples.push(Sample::one("with lists", "a.ply", file(encoding, true)));
        samples.push(Sample::one("gzip", "a.ply.gz", gzip(&file(encoding, false))));
    }
    samples.push(Sample::one("no name", "a", words(XYZ, "1 2 3\n4 5 6\n")));
    samples.push(Sample::one(
        "carriage returns",
        "a.ply",
        words(XYZ, "1 2 3\n\n 4 nan -inf \n").replace('\n', "\r\n").replace("vertex 3", "vertex 2"),
    ));
    let tensor =
        ["xx", "xy", "xz", "yy", "yz", "zz"].map(|part| format!("property float cov_{part}\n")).concat();
    samples.push(Sample::one(
        "covariances",
        "a.ply",
        words(&format!("{XYZ}{tensor}"), "1 2 3 1 .1 .2 2 .3 3\n"),
    ));
    samples
}

#[test]
fn every_encoding_holds_the_same() {
    for sample in samples().into_iter().take(9) {
        let what = sample.what;
        let read = |array: &str| {
            let options = ReadOptions { array: Some(array.to_owned()), ..OPTIONS };
            let points = points(sample.read(&options).unwrap_or_else(|e| panic!("{what}: {e}")));
            points.scalars().unwrap().to_vec()
        };
        let column = |i: usize| ROWS.map(|row| row[i] as f32);
        for (i, name) in
            ["nx", "ny", "nz", "scale_0", "scale_1", "big", "huge", "c", "opacity"].iter().enumerate()
        {
            assert_eq!(read(name), column(6 + i), "{what}: {name}");
        }
        assert_eq!(read("colour:g"), column(4), "{what}");
        assert_eq!(read("colour"), [3.0, f32::hypot(255.0, 9.0), 7.0], "{what}");
        assert_eq!(read("normal"), [1.0, 5.0, 3.0], "{what}");
        assert_eq!(read("scale:1"), column(10), "{what}");

        let loaded = sample.loaded();
        let arrays: Vec<String> = loaded.report.arrays.iter().map(ToString::to_string).collect();
        assert_eq!(
            arrays,
            [
                "point:big (i64)",
                "point:huge (u64)",
                "point:c (i8)",
                "point:opacity (u16)",
                "point:red (u8)",
                "point:green (u8)",
                "point:blue (u8)",
                "point:nx (f32)",
                "point:ny (f64)",
                "point:nz (f32)",
                "point:scale_0 (i32)",
                "point:scale_1 (u32)",
                "point:colour (u8 x 3)",
                "point:normal (f64 x 3)",
                "point:scale (f64 x 2)",
            ],
            "{what}"
        );
        let mut notes = vec![
            "2 elements \"camera\" left out",
            "9 elements \"empty\" left out",
            "2 faces left out: points are read",
            "1 elements \"edge\" left out",
        ];
        if what == "with lists" {
            notes.push("property \"tail\": a list, left out");
        }
        assert_eq!(loaded.report.notes, notes, "{what}");
        let centres = ROWS.map(|[x, y, z, ..]| DVec3::new(x, y, z));
        assert_eq!(points(loaded).centres(), centres, "{what}");
    }
}

#[test]
fn sizes_come_from_arrays_that_are_named() {
    let sample = samples().pop().unwrap();
    let options = ReadOptions { covariance: Some("cov".to_owned()), ..OPTIONS };
    let size = points(sample.read(&options).unwrap()).size().clone();
    assert_eq!(size, KernelSize::Covariances(vec![[1.0, 0.1, 0.2, 2.0, 0.3, 3.0]]));
    let options =
        ReadOptions { radius: Some("cov_yy".to_owned()), weight: Some("cov:5".to_owned()), ..OPTIONS };
    let read = points(sample.read(&options).unwrap());
    assert_eq!((read.size(), read.weights()), (&KernelSize::Radii(vec![2.0]), Some(&[3.0][..])));
}

#[test]
fn places_that_are_not_finite_are_left_out() {
    let all = samples();
    let loaded = all[all.len() - 2].loaded();
    assert_eq!(loaded.report.notes, ["1 points with positions that are not finite left out"]);
    assert_eq!(points(loaded).centres(), [DVec3::new(1.0, 2.0, 3.0)]);
}

#[test]
fn broken_rules_are_refused_in_one_line() {
    let good = words(&format!("{XYZ}property uchar c\n"), "1.5 2 3 4\n5 6 7 8\n");
    Sample::one("as it is", "a.ply", good.clone()).loaded();
    let cases = [
        ("ply\n", "ply x\n", "line 1: \"ply x\": must be ply and a line feed"),
        ("ply\n", "ply\rformat\n", "line 1: \"ply format\": must be ply"),
        ("ascii", "text", "line 2: \"format text 1.0\": must be ascii, binary_little_endian or"),
        ("1.0", "1.1", "line 2: \"format ascii 1.1\": the version must be 1.0"),
        ("format ascii 1.0\n", "", "header: has no format"),
        (
            "format ascii 1.0\n",
            "format ascii 1.0\nformat ascii 1.0\n",
            "line 3: \"format ascii 1.0\": a second format",
        ),
        ("element vertex 2\n", "", "line 3: \"property float x\": belongs to no element"),
        ("element vertex 2\n", "element vertex -2\n", "line 3: \"element vertex -2\": must end in a count"),
        ("element vertex 2\n", "element vertex 2 2\n", "must be format, element, property, comment"),
        ("element vertex 2\n", "element point 2\n", "element vertex: none: elements are point"),
        ("element vertex 2\n", "element vertex 0\nelement vertex 2\n", "a second element of this name"),
        (
            "element vertex 2\n",
            "element vertex 18446744073709551615\n",
            "18446744073709551615: the 18 bytes that follow",
        ),
        ("element vertex 2\n", "element vertex 3\n", "3: the 18 bytes that follow cannot hold them"),
        ("element vertex 2\n", "element vertex 1\n", "line 10: \"5\": more than the header announces"),
        (
            "property float y\n",
            "property float x\n",
            "line 5: \"property float x\": a second property of this name",
        ),
        ("property float y\n", "property real y\n", "line 5: \"property real y\": \"real\" is not a type"),
        ("property float y\n", "property list float int y\n", "\"float\" is not a type of a length"),
        ("property float y\n", "property list int y\n", "line 5: \"property list int y\": must be format"),
        ("property float y\n", "property a b c y\n", "must be a type and a name, or a list"),
        (
            "property float y\n",
            "property float w\n",
            "element vertex: has no property \"y\" that is a number",
        ),
        ("end_header\n", "end\n", "line 8: \"end\": must be format"),
        ("5 6 7 8\n", "5 6 7\n", "line 10: ends before property c"),
        ("5 6 7 8\n", "5 6 7 8 9\n", "line 10: \"9\": must not follow here"),
        ("5 6 7 8\n", "5 6 seven 8\n", "line 10: \"seven\": property z must be a number of type f32"),
        ("5 6 7 8\n", "5 6 7 256\n", "line 10: \"256\": property c must be a number of type u8"),
        ("5 6 7 8\n", "        \n", "line 11: ends after 1 of 2 vertex"),
    ];
    for (from, to, rule) in cases {
        let broken = good.replacen(from, to, 1);
        assert_ne!(broken, good, "{from}");
        Sample::one("broken", "a.ply", broken).refused(&["a.ply: ", rule]);
    }
    Sample::one("cut", "a.ply", &good.as_bytes()[..38]).refused(&["ends before end_header"]);
    Sample::one("long", "a.ply", format!("ply\n{}", "comment\n".repeat(200_000)))
        .refused(&["header longer than 1048576 bytes"]);
    let long = words(&format!("{XYZ}property int {}\n", "n".repeat(257)), "1 2 3 4\n");
    Sample::one("long", "a.ply", long).refused(&["line 7: ", "a name of 257 bytes: must be at most 256"]);
    Sample::one("none", "a.ply", words(XYZ, "")).refused(&["points", "there must be at least one"]);
    for encoding in [Encoding::Little, Encoding::Big] {
        let good = file(encoding, false);
        Sample::one("one more", "a.ply", [good.as_slice(), b"\n"].concat())
            .refused(&[&format!("byte {}: more than the header announces", good.len())]);
        let short = |file: &[u8], less: usize| Sample::one("cut", "a.ply", &file[..file.len() - less]);
        short(&good, 1).refused(&["element edge: 1: the 7 bytes that follow cannot hold them"]);
        short(&good, 9).refused(&["element face: ends between 1 and all 2"]);
        short(&good, 23).refused(&["element vertex: 3: the"]);
        short(&file(encoding, true), 27).refused(&["list of 2 is longer than what follows"]);
    }
    let negative = [
        b"ply\nformat binary_little_endian 1.0\nelement face 1\nproperty list char int i\nelement vertex 0\n"
            .as_slice(),
        XYZ.as_bytes(),
        b"end_header\n\xff",
    ];
    Sample::one("negative", "a.ply", negative.concat()).refused(&["property i: a list of -1"]);
    let error = Sample::one("memory", "a.ply", file(Encoding::Big, false))
        .read(&ReadOptions::within(50))
        .unwrap_err();
    assert_refusal(&error, &["points: 72 bytes of memory: 50 are left of the limit of 50"], "memory");
}

#[test]
fn numbers_are_as_c_prints_them() {
    let text = words(&format!("{XYZ}property float T\n"), "1 2 3 -nan(ind)\n4 5 6 nan(0x1)\n7 8 9 1.e1\n");
    let scalars = points(Sample::one("nan", "a.ply", text).loaded()).scalars().unwrap().to_vec();
    assert!(scalars[0].is_nan() && scalars[1].is_nan() && scalars[2] == 10.0, "{scalars:?}");
}
