//! Tables of points in text.

use glam::DVec3;
use volraster::io::{ReadOptions, known_formats};
use volraster::scene::KernelSize;

use super::support::*;

/// Tables that hold the same: x, y, z and T.
const TABLES: [(&str, &str); 12] = [
    ("a.csv", "x,y,z,T\n1,2,3,4.5\n-1e3,.25,0,nan\n"),
    ("a.tsv", "X (m)\tY (m)\tZ (m)\tT\r\n1\t2\t3\t4.5\r\n-1e3\t.25\t0\t\r\n"),
    ("b.csv", "\u{feff}Points:0;Points:1;Points:2;T\n# a comment\n\n1;2;3;4.5\n-1e3;.25;0;NA\n"),
    ("c.csv", "\"px\" , \"py\",pz,\"T\"\n\"1\",2,3,4.5\n -1e3 , .25 ,0, n/a"),
    ("a.xyz", "# made by hand\n1 2 3 4.5\n  -1e3   .25\t0  NULL \n"),
    ("d.csv", "T,pos_z,pos_y,pos_x\n4.5,3,2,1\n,0,.25,-1e3\n"),
    ("e.csv", "x y z T\n1 2 3 4.5\n-1e3 .25 0 NaN\n"),
    ("a.txt", "# x y z T\n1 2 3 4.5\n-1e3 .25 0 nan\n"),
    ("b.txt", "Coordinates.x, Coordinates.y, Coordinates.z, T\n1, 2, 3, 4.5\n-1e3, .25, 0, nan\n"),
    ("f.csv", "name,x,y,z,T\n\"a, \"\"b\"\"\nc\",1,2,3,4.5\nd,-1e3,.25,0,\n"),
    ("g.csv", "name;x;y;z;T\n1a;1;2;3;4.5\n2;-1e3;.25;0;\n"),
    ("h.csv", "\"quoted x\" \"x\" y z T\n? 1 2 3 4.5\n? -1e3 .25 0 nan\n"),
];

const GROUPS: &str = "id,x,y,z,v_x,v_y,v_z,cov_xx,cov_xy,cov_xz,cov_yy,cov_yz,cov_zz,U:0,U:1,h\n\
    7,0,0,0,3,0,4,1,.5,.25,2,.125,3,5,12,.5\n\
    8,1,1,1,0,1,0,4,5,6,7,8,9,0,-2,.75\n";

/// Small tables of every kind.
pub fn samples() -> Vec<Sample> {
    let mut samples: Vec<Sample> =
        TABLES.iter().map(|(name, text)| Sample::one("x, y, z and T", name, *text)).collect();
    samples.push(Sample::one("gzip", "a.csv.gz", gzip(TABLES[0].1.as_bytes())));
    samples.push(Sample::one("groups", "groups.csv", GROUPS));
    samples
}

#[test]
fn every_kind_of_table_holds_the_same() {
    for sample in samples().into_iter().take(TABLES.len() + 1) {
        let name = sample.files[0].0.clone();
        let loaded = sample.loaded();
        let report = loaded.report.clone();
        assert_eq!(report.format, "CSV");
        let points = points(loaded);
        let centres = [DVec3::new(1.0, 2.0, 3.0), DVec3::new(-1000.0, 0.25, 0.0)];
        assert_eq!(points.centres(), centres, "{name}");
        let scalars = points.scalars().unwrap();
        assert!(scalars[0] == 4.5 && scalars[1].is_nan(), "{name}: {scalars:?}");
        let (shown, notes): (&str, &[&str]) = match name.as_str() {
            "a.xyz" => {
                ("point:column 4", &["the columns have no names: columns 1, 2 and 3 are taken as x, y and z"])
            }
            "f.csv" | "g.csv" => ("point:T", &["columns without numbers left out: name"]),
            "h.csv" => ("point:T", &["columns without numbers left out: quoted x"]),
            _ => ("point:T", &[]),
        };
        assert_eq!((report.shown.as_deref(), report.arrays.len()), (Some(shown), 1), "{name}");
        assert_eq!(report.notes, notes, "{name}");
        assert!(report.warnings.is_empty(), "{name}: {:?}", report.warnings);
    }
}

#[test]
fn columns_are_arrays_alone_and_together() {
    let sample = Sample::one("groups", "a.csv", GROUPS);
    let loaded = sample.loaded();
    assert_eq!(loaded.report.shown.as_deref(), Some("point:h"), "no numbering, and no component");
    let arrays: Vec<String> = loaded.report.arrays.iter().map(ToString::to_string).collect();
    assert_eq!(arrays[..3], ["point:id (i64)", "point:h (f64)", "point:v_x (i64)"]);
    assert_eq!(arrays[13..], ["point:v (i64 x 3)", "point:cov (f64 x 6)", "point:U (i64 x 2)"]);
    let read = |array: &str| {
        let options = ReadOptions { array: Some(array.to_owned()), ..OPTIONS };
        points(sample.read(&options).unwrap()).scalars().unwrap().to_vec()
    };
    assert_eq!(read("id"), [7.0, 8.0]);
    assert_eq!(read("v"), [5.0, 1.0]);
    assert_eq!((read("v_z"), read("v:z")), (vec![4.0, 0.0], vec![4.0, 0.0]));
    assert_eq!((read("U:1"), read("U")), (vec![12.0, -2.0], vec![13.0, 2.0]));
    let options = ReadOptions { covariance: Some("cov".into()), weight: Some("h".into()), ..OPTIONS };
    let read = points(sample.read(&options).unwrap());
    let tensors = vec![[1.0, 0.5, 0.25, 2.0, 0.125, 3.0], [4.0, 5.0, 6.0, 7.0, 8.0, 9.0]];
    assert_eq!((read.size(), read.weights()), (&KernelSize::Covariances(tensors), Some(&[0.5, 0.75][..])));
}

#[test]
fn what_stands_for_no_number_is_nan() {
    let loaded = Sample::one("gaps", "a.csv", "x,y,z,T,T\n1,2,3,,4\n,2,3,5,6\n7,8,9,0.5,7\n").loaded();
    assert_eq!(loaded.report.notes, ["1 points with positions that are not finite left out"]);
    assert_eq!(loaded.report.warnings, ["several columns \"T\": the first is read by this name"]);
    let kinds: Vec<String> = loaded.report.arrays.iter().map(ToString::to_string).collect();
    assert_eq!(kinds, ["point:T (f64)", "point:T (i64)"], "all cells count");
    let scalars = points(loaded).scalars().unwrap().to_vec();
    assert!(scalars[0].is_nan() && scalars[1] == 0.5, "{scalars:?}");
}

#[test]
fn without_names_the_first_numbers_are_positions() {
    let loaded = Sample::one("salt", "a.xyz", "Na 0 nan 0\nCl 1 2 3\n").loaded();
    assert_eq!(
        loaded.report.notes,
        [
            "the columns have no names: columns 2, 3 and 4 are taken as x, y and z",
            "columns without numbers left out: column 1",
            "1 points with positions that are not finite left out",
        ]
    );
    assert_eq!(points(loaded).centres(), [DVec3::new(1.0, 2.0, 3.0)]);
}

#[test]
fn broken_rules_are_refused_in_one_line() {
    let quote = format!("x,y,z\n\"{}", "1\n".repeat(600_000));
    let cases: [(&str, &[&str]); 17] = [
        ("", &["a.csv: rows: there is none"]),
        ("# only\n\n", &["rows: there is none"]),
        ("x,y,z\n", &["rows: there is none but that of names"]),
        ("a,b,c\n1,2,3\n", &["line 1: \"a, b, c\": no columns of positions"]),
        ("x,y,w\n1,2,3\n", &["line 1: \"x, y, w\": no columns of positions"]),
        ("3\nwater\nO 0 0\n", &["line 1: \"3\": no columns of positions"]),
        ("x,y,z,Z\n1,2,3,4\n", &["line 1: column 4 is a second column of the same coordinate"]),
        ("x,y,z\n\n1,2,3\r\n4,5\n", &["line 4: 2 cells: the first row has 3"]),
        ("x,y,z\n1,2,3\n# c\n4,5,6,7\n", &["line 4: 4 cells: the first row has 3"]),
        ("x,y,z\n1,2,3\n4,five,6\n", &["line 3, column 2 (y): \"five\": must be a number"]),
        ("x;y;z\n1;2;3,5\n", &["line 2, column 3 (z): \"3,5\": must be a number with a decimal point"]),
        ("x,y,z,T\n1,2,3,4\n\n4,5,6,hot\n", &["line 4, column 4 (T): \"hot\": must be a number"]),
        ("x,y,z\n1,2,\"3\" 4\n", &["line 2: \"4\": must not follow a quoted cell"]),
        ("x,y,z\n1,2,3\n1,2,\"3\n4\n", &["line 3: ends within quotes"]),
        ("\"\u{1}\"x,y,z\n", &["line 1: \"x,y,z\": must not follow a quoted cell"]),
        ("1,2,3\n4,x,6\n", &["line 2, column 2 (column 2): \"x\": must be a number"]),
        (&quote, &["line 2: a row longer than 1048576 bytes: is a quote open?"]),
    ];
    for (text, parts) in cases {
        Sample::one("broken", "a.csv", text).refused(parts);
    }
    Sample::one("16-bit units", "a.csv", b"\xff\xfex\0,\0")
        .refused(&["byte 0: text of 16-bit units: must be UTF-8"]);
    let wide = vec!["1"; 20_000].join(",");
    Sample::one("wide", "a.csv", wide).refused(&["line 1: 20000 columns: must be at most 16384"]);
    let error = Sample::one("memory", "a.csv", TABLES[0].1).read(&ReadOptions::within(47)).unwrap_err();
    assert_refusal(&error, &["points: 48 bytes of memory: 47 are left of the limit of 47"], "memory");
    let long = format!("x,y,z,{}\n1,2,3,4\n", "n".repeat(257));
    Sample::one("long", "a.csv", long).refused(&["line 1: column 4: its name is longer than 256 bytes"]);
    let options = ReadOptions { array: Some("name".to_owned()), ..OPTIONS };
    let error = Sample::one("two lines", "a.csv", "x,y,z,\"T\nK\"\n1,2,3,4\n").read(&options).unwrap_err();
    assert_refusal(&error, &["there are point:T K (i64)"], "two lines");
    let error = Sample::one("words", "f.csv", TABLES[9].1).read(&options).unwrap_err();
    assert_refusal(&error, &["array \"name\": no such array: there are point:T (f64)"], "words");
}

#[test]
fn text_files_are_tables_only_where_they_can_be_nothing_else() {
    for text in [
        "x y z\n",
        "a b c\n1 2 3\n",
        "1 2\n3 4\n",
        "1 2 3\n4 5\n",
        "1 2 3\n4 5 x\n",
        "x y z\nsome more words\n",
        "once upon a time\nthere was a table\n",
        "\"x y z\n1 2 3\n",
    ] {
        let error = Sample::one("no table", "a.txt", text).read(&OPTIONS).expect_err(text);
        assert_refusal(&error, &["content: unknown format"], text);
    }
    Sample::one("a table", "a.TXT", "1 2 3\n4 5 6\n").loaded();
    let error = Sample::one("another name", "a.dat", "x y z\n1 2 3\n").read(&OPTIONS).unwrap_err();
    assert_refusal(&error, &["content: unknown format"], "dat");
    // Content of other formats wins over the name.
    let ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\nproperty int y\nproperty int z\nend_header\n1 2 3\n";
    assert_eq!(Sample::one("PLY", "a.csv", ply).loaded().report.format, "PLY");
    assert!(known_formats().contains("CSV (.csv, .tsv, .xyz, "));
}

#[test]
fn numbers_are_as_c_prints_them() {
    let text = "x,y,z,T,name\n1,2,3,-nan(ind),nan\n4,5,6,nan(0x1),Nancy\n7,8,9,2.e1,nan\n";
    let loaded = Sample::one("nan", "a.csv", text).loaded();
    assert_eq!(loaded.report.notes, ["columns without numbers left out: name"]);
    let scalars = points(loaded).scalars().unwrap().to_vec();
    assert!(scalars[0].is_nan() && scalars[1].is_nan() && scalars[2] == 20.0, "{scalars:?}");
}
