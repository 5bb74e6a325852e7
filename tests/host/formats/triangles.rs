//! Triangle meshes of PLY and OBJ: polygons, indices of every kind, broken files, damaged ones.

use glam::DVec3;
use volraster::io::{ReadOptions, Triangles, read_triangles, read_triangles_memory};

use super::mutations;
use super::support::*;

fn read(name: &str, bytes: &[u8]) -> volraster::Result<Triangles> {
    read_triangles_memory(&[(name, bytes)], &OPTIONS)
}

#[track_caller]
fn refused(name: &str, bytes: &[u8], parts: &[&str]) {
    assert_refusal(&read(name, bytes).expect_err("must be refused"), parts, name);
}

/// A square, a triangle and a pentagon over five points, as fans.
const FANS: [[u32; 3]; 6] = [[0, 1, 2], [0, 2, 3], [4, 0, 1], [0, 1, 2], [0, 2, 3], [0, 3, 4]];
const FACES: [&[u32]; 3] = [&[0, 1, 2, 3], &[4, 0, 1], &[0, 1, 2, 3, 4]];
const POINTS: [[f64; 3]; 5] =
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.5], [1.0, 1.0, 0.25], [0.0, 1.0, -2.0], [0.5, 0.5, 1e3]];

/// The faces in PLY, with other properties around the list, an element before and one behind; indices of a type.
fn ply(format: &str, index: &str, faces_first: bool) -> Vec<u8> {
    let words = format == "ascii";
    let big = format == "binary_big_endian";
    let put = |out: &mut Vec<u8>, kind: &str, number: f64| {
        let mut bytes = match kind {
            "uchar" => (number as u8).to_le_bytes().to_vec(),
            "short" => (number as i16).to_le_bytes().to_vec(),
            "int" => (number as i32).to_le_bytes().to_vec(),
            "uint" => (number as u32).to_le_bytes().to_vec(),
            "float" => (number as f32).to_le_bytes().to_vec(),
            _ => number.to_le_bytes().to_vec(),
        };
        if words {
            bytes = format!("{number} ").into_bytes();
        } else if big {
            bytes.reverse();
        }
        out.extend(bytes);
    };
    let of_vertices =
        "element vertex 5\nproperty uchar red\nproperty double x\nproperty double y\nproperty float z\n";
    let of_faces = format!(
        "element face 3\nproperty uchar shine\nproperty list uchar float texcoord\n\
         property list uchar {index} vertex_indices\nproperty float area\n"
    );
    let (first, second) = if faces_first { (&*of_faces, of_vertices) } else { (of_vertices, &*of_faces) };
    let mut out = format!(
        "ply\nformat {format} 1.0\ncomment c\nelement camera 1\nproperty float f\n{first}{second}element edge 1\n\
         property int a\nend_header\n"
    )
    .into_bytes();
    let line = |out: &mut Vec<u8>, numbers: &[(&str, f64)]| {
        numbers.iter().for_each(|(kind, number)| put(out, kind, *number));
        if words {
            out.push(b'\n');
        }
    };
    line(&mut out, &[("float", 2.0)]);
    let vertices = |out: &mut Vec<u8>| {
        for [x, y, z] in POINTS {
            line(out, &[("uchar", 7.0), ("double", x), ("double", y), ("float", z)]);
        }
    };
    let faces = |out: &mut Vec<u8>| {
        for (i, face) in FACES.into_iter().enumerate() {
            let mut row = vec![("uchar", 1.0), ("uchar", i as f64)];
            row.extend((0..i).map(|_| ("float", 0.25)));
            row.push(("uchar", face.len() as f64));
            row.extend(face.iter().map(|&point| (index, f64::from(point))));
            row.push(("float", 9.5));
            line(out, &row);
        }
    };
    if faces_first {
        faces(&mut out);
        vertices(&mut out);
    } else {
        vertices(&mut out);
        faces(&mut out);
    }
    line(&mut out, &[("int", 3.0)]);
    out
}

const FORMATS: [&str; 3] = ["ascii", "binary_little_endian", "binary_big_endian"];

fn obj() -> String {
    let vertices = POINTS.map(|[x, y, z]| format!("v {x} {y} {z}\n")).concat();
    format!(
        "# made by hand\nmtllib a.mtl\no thing\n{vertices}vn 0 0 1\nvt 0 0\ng first side\ns off\nusemtl m\n\
         f 1/1/1 2/1/1 3/1/1 4/1/1\nf -1//1 -5//1 -4//1\ng second\nf 1/1 2/1 \\\n 3/1 4/1 5/1 # five\nl 1 2\np 1\n"
    )
}

fn ply_samples() -> Vec<Sample> {
    let mut samples = Vec::new();
    for format in FORMATS {
        for index in ["int", "uchar", "uint", "short"] {
            samples.push(Sample::one(format, "a.ply", ply(format, index, index == "uchar")));
        }
    }
    samples.push(Sample::one("gzip", "a.ply.gz", gzip(&ply(FORMATS[1], "int", false))));
    samples
}

fn obj_samples() -> Vec<Sample> {
    vec![
        Sample::one("obj", "a.obj", obj()),
        Sample::one("ends of lines", "a.OBJ", obj().replace('\n', "\r\n")),
        Sample::one("gzip", "a.obj.gz", gzip(obj().as_bytes())),
        Sample::one("weights and colours", "a.obj", "v 1 2 3 1\nv 1 2 4 0 0 1\nv 2 2 2 1 0 0 1\nf 1 2 3\n"),
    ]
}

#[test]
fn polygons_are_fans_in_every_encoding() {
    let want = Triangles { points: POINTS.map(DVec3::from).to_vec(), triangles: FANS.to_vec() };
    for Sample { what, files } in ply_samples().iter().chain(&obj_samples()[..3]) {
        let (name, bytes) = &files[0];
        assert_eq!(read(name, bytes).unwrap(), want, "{what}");
    }
    // By content, not by name; and from a file.
    assert_eq!(read("a.txt", &ply("ascii", "int", false)).unwrap(), want);
    let path = std::env::temp_dir().join(format!("volraster-triangles-{}.obj", std::process::id()));
    std::fs::write(&path, obj()).unwrap();
    assert_eq!(read_triangles(&path, &OPTIONS).unwrap(), want);
    std::fs::remove_file(&path).unwrap();
    // The other name of the list, and no name of the file that is known.
    let text = String::from_utf8(ply("ascii", "int", false)).unwrap();
    assert_eq!(read("a", text.replace("vertex_indices", "vertex_index").as_bytes()).unwrap(), want);
}

#[test]
fn relative_indices_count_from_where_they_stand() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 1\nf -1 -2 -3\nf 5 1 2\nv 9 9 9\n";
    assert_eq!(read("a.obj", text.as_bytes()).unwrap().triangles, [[0, 1, 2], [3, 2, 1], [4, 0, 1]]);
    let last = read("a.obj", obj_samples()[3].files[0].1.as_slice()).unwrap();
    assert_eq!(last.points[2], DVec3::splat(2.0));
}

#[test]
fn broken_obj_is_refused_by_its_line() {
    let good = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    read("a.obj", good.as_bytes()).unwrap();
    let cases: &[(&str, &str, &str)] = &[
        ("v 1 0 0", "v 1 0", "line 2: \"v 1 0\": must be three coordinates"),
        ("v 1 0 0", "v 1 0 0 1 1", "line 2: \"v 1 0 0 1 1\": must be three coordinates"),
        ("v 1 0 0", "v 1 zero 0", "line 2: \"zero\": must be a number"),
        ("v 1 0 0", "v 1 inf 0", "line 2: \"inf\": a coordinate must be finite"),
        ("v 1 0 0", "v 1 nan 0", "line 2: \"nan\": a coordinate must be finite"),
        ("f 1 2 3", "f 1 2", "line 4: a face of 2 corners: must have at least 3"),
        ("f 1 2 3", "f", "line 4: a face of 0 corners"),
        ("f 1 2 3", "f 1 2 0", "line 4: \"0\": indices begin at 1"),
        ("f 1 2 3", "f 1 2 4", "line 4: vertex 4: there are 3"),
        ("f 1 2 3", "f 1 2 -4", "line 4: \"-4\": is before the first vertex"),
        ("f 1 2 3", "f 1 2 4294967296", "line 4: \"4294967296\": is too large an index"),
        ("f 1 2 3", "f 1 2 -9223372036854775808", "is before the first vertex"),
        ("f 1 2 3", "f 1 2 99999999999999999999", "must begin with an index"),
        ("f 1 2 3", "f 1 2 3/1/1/1", "line 4: \"3/1/1/1\": must be vertex, vertex/texture"),
        ("f 1 2 3", "f 1 2 3/x", "line 4: \"3/x\": must be vertex, vertex/texture"),
        ("f 1 2 3", "f 1 2 /3", "line 4: \"/3\": must begin with an index"),
        ("f 1 2 3", "face 1 2 3", "line 4: \"face\": is not a statement of OBJ"),
        ("f 1 2 3", "p 1 2 3", "content: has no face"),
    ];
    for (from, to, rule) in cases {
        let broken = good.replacen(from, to, 1);
        assert_ne!(broken, good, "{from}");
        refused("a.obj", broken.as_bytes(), &["a.obj: ", rule]);
    }
    refused("a.stl", good.as_bytes(), &["a.stl: content", "PLY (.ply)", "OBJ (.obj)"]);
    refused("a.obj", &[b'x'; 70_000], &["longer than 65536 bytes"]);
    refused("a.obj", "f 1 \\\n".repeat(400_000).as_bytes(), &["a statement longer than 1048576 bytes"]);
    // A point takes 24 bytes, and room grows by halves.
    let many = "v 0 0 0\n".repeat(1000) + "f 1 2 3\n";
    let within = |bytes| read_triangles_memory(&[("a.obj", many.as_bytes())], &ReadOptions::within(bytes));
    assert!(within(40_000 + 12 * 64).is_ok());
    assert_refusal(&within(20_000).unwrap_err(), &["a.obj: points: ", "of the limit of 20000"], "memory");
}

#[test]
fn broken_ply_is_refused_by_its_face() {
    for format in FORMATS {
        let good = ply(format, "int", false);
        let broken = |from: &str, to: &str| {
            let at = good.windows(from.len()).position(|bytes| bytes == from.as_bytes()).unwrap();
            [&good[..at], to.as_bytes(), &good[at + from.len()..]].concat()
        };
        refused("a.ply", &broken("vertex_indices", "vertices"), &["element face: has no list"]);
        refused("a.ply", &broken("element face 3", "element side 3"), &["element face: none"]);
        refused("a.ply", &broken("element face 3", "element face 9999999"), &["element face: 9999999: the"]);
        refused("a.ply", &broken("list uchar int", "list uchar float"), &["must be whole numbers"]);
        refused("a.ply", &broken("double x", "double u"), &["element vertex: has no property \"x\""]);
        refused("a.ply", &[&good, b"1".as_slice()].concat(), &["more than the header announces"]);
        refused("a.ply", &good[..good.len() - 30], &["a.ply: "]);
        // 60 bytes for the points, and 72 for the first room of triangles.
        let within = |bytes| read_triangles_memory(&[("a.ply", &good)], &ReadOptions::within(bytes));
        assert!(within(120 + 12 * 64).is_ok());
        assert!(within(119 + 12 * 64).is_err());
    }
    let text = String::from_utf8(ply("ascii", "int", false)).unwrap();
    let words = |from: &str, to: &str, rule: &str| {
        assert!(text.contains(from), "{from}");
        refused("a.ply", text.replacen(from, to, 1).as_bytes(), &["a.ply: ", rule]);
    };
    words("4 0 1 2 3 9.5", "4 0 1 2 5 9.5", "face 0: vertex 5: there are 5, from 0 on");
    words("4 0 1 2 3 9.5", "4 0 1 2 -1 9.5", "face 0: vertex -1: there are 5, from 0 on");
    words("4 0 1 2 3 9.5", "4 0 1 2 2.5 9.5", "\"2.5\": must be an index");
    words("4 0 1 2 3 9.5", "2 0 1 9.5", "face 0: a face of 2 corners: must have at least 3");
    words("4 0 1 2 3 9.5", "0 9.5", "face 0: a face of 0 corners: must have at least 3");
    words("4 0 1 2 3 9.5", "4 0 1 2 3 9.5 8", "\"8\": must not follow here");
    words("4 0 1 2 3 9.5", "-4 0 1 2 3 9.5", "\"-4\": must be the length of a list");
    words("0.5 0.5 1000", "0.5 nan 1000", "vertex 4: [0.5, NaN, 1000]: must be finite");
}

#[test]
fn damaged_ply_is_data_or_one_line() {
    mutations::damage_by(
        |files, options| read_triangles_memory(files, options).map(drop),
        "ply",
        &ply_samples(),
    );
}

#[test]
fn damaged_obj_is_data_or_one_line() {
    mutations::damage_by(
        |files, options| read_triangles_memory(files, options).map(drop),
        "obj",
        &obj_samples(),
    );
}
