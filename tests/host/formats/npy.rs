//! NPY.

use glam::DVec3;
use volraster::io::{Endian, ReadOptions};
use volraster::scene::Samples;

use super::support::{OPTIONS, Sample, grid, points, shared_loaded, stored};

/// A file of a version with a header as it stands and data.
fn file(version: u8, header: &str, data: &[u8]) -> Vec<u8> {
    let length = header.len();
    let mut bytes = b"\x93NUMPY".to_vec();
    bytes.extend([version, 0]);
    if version == 1 {
        bytes.extend((length as u16).to_le_bytes());
    } else {
        bytes.extend((length as u32).to_le_bytes());
    }
    [&bytes, header.as_bytes(), data].concat()
}

fn header(descr: &str, fortran: bool, shape: &str) -> String {
    let fortran = if fortran { "True" } else { "False" };
    let text = format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}");
    format!("{text:<117}\n")
}

fn array(what: &'static str, descr: &str, fortran: bool, shape: &str, data: &[u8]) -> Sample {
    Sample::one(what, "a.npy", file(1, &header(descr, fortran, shape), data))
}

fn bytes() -> Vec<u8> {
    (1..=24).collect()
}

/// 1 to 24, as numpy keeps an array of z, y, x = 2, 3, 4 in Fortran order.
fn turned() -> Vec<u8> {
    let mut all = Vec::new();
    for x in 0..4 {
        for y in 0..3 {
            for z in 0..2 {
                all.push(1 + x + 4 * y + 12 * z);
            }
        }
    }
    all
}

fn values() -> Vec<f64> {
    (1..=24).map(f64::from).collect()
}

/// Files of 1 to 24.
fn same() -> Vec<Sample> {
    let shape = "(2, 3, 4)";
    let mut all = vec![
        array("bytes", "|u1", false, shape, &bytes()),
        array("turned bytes", "|u1", true, shape, &turned()),
        array("signed", "|i1", false, shape, &bytes()),
        array("tuples of one", "|u1", false, "(2,3,4,1)", &bytes()),
        array("one of four axes", "|u1", false, "(1, 2, 3, 4)", &bytes()),
        array("one of four turned axes", "|u1", true, "(1, 2, 3, 4)", &turned()),
        Sample::one("version 2", "a.npy", file(2, &header("|u1", false, shape), &bytes())),
        Sample::one("version 3", "a.npy", file(3, &header("|u1", false, shape), &bytes())),
        Sample::one(
            "another order and quotes",
            "a.npy",
            file(1, "{\"shape\":(2L , 3,4),'fortran_order':False,  \"descr\":\"u1\"}", &bytes()),
        ),
        Sample::one("known by content", "a.dat", file(1, &header("|u1", false, shape), &bytes())),
    ];
    for (order, endian) in [("<", Endian::Little), (">", Endian::Big), ("=", Endian::Little)] {
        for (name, size, float) in [
            ("u2", 2, false),
            ("i2", 2, false),
            ("u4", 4, false),
            ("i4", 4, false),
            ("u8", 8, false),
            ("i8", 8, false),
            ("f2", 2, true),
            ("f4", 4, true),
            ("f8", 8, true),
        ] {
            let number = |i: &u8| {
                let mut bytes = match (float, size) {
                    (false, _) => u64::from(*i).to_le_bytes()[..size].to_vec(),
                    (true, 2) => half(*i).to_le_bytes().to_vec(),
                    (true, 4) => f32::from(*i).to_le_bytes().to_vec(),
                    (true, _) => f64::from(*i).to_le_bytes().to_vec(),
                };
                if endian == Endian::Big {
                    bytes.reverse();
                }
                bytes
            };
            let descr = format!("{order}{name}");
            for (fortran, numbers) in [(false, bytes()), (true, turned())] {
                let data: Vec<u8> = numbers.iter().flat_map(number).collect();
                all.push(array("types", &descr, fortran, shape, &data));
            }
        }
    }
    all
}

/// A small whole number in half precision.
fn half(i: u8) -> u16 {
    let exponent = i.ilog2() as u16;
    ((15 + exponent) << 10) | ((u16::from(i) << (10 - exponent)) & 0x3ff)
}

/// Sample i holds i, 2 i and -2 i, in both orders.
fn vectors() -> [Sample; 2] {
    let bytes_of = |list: Vec<i16>| list.into_iter().flat_map(i16::to_le_bytes).collect::<Vec<u8>>();
    let rows = (1..=24).flat_map(|i| [i, 2 * i, -2 * i]).collect();
    let planes =
        [1, 2, -2].into_iter().flat_map(|f| turned().into_iter().map(move |i| f * i16::from(i))).collect();
    [
        array("tuples", "<i2", false, "(2, 3, 4, 3)", &bytes_of(rows)),
        array("turned tuples", "<i2", true, "(2, 3, 4, 3)", &bytes_of(planes)),
    ]
}

/// Five rows: numbers of row i are 10 i, 10 i + 1, ...
fn rows(columns: usize, fortran: bool) -> Sample {
    let number = |row: usize, column: usize| (10.0 * row as f32 + column as f32).to_be_bytes();
    let mut data = Vec::new();
    if fortran {
        (0..columns).for_each(|column| (0..5).for_each(|row| data.extend(number(row, column))));
    } else {
        (0..5).for_each(|row| (0..columns).for_each(|column| data.extend(number(row, column))));
    }
    array("rows", ">f4", fortran, &format!("(5, {columns})"), &data)
}

pub fn samples() -> Vec<Sample> {
    let mut all = same();
    all.extend(vectors());
    all.extend([rows(3, false), rows(3, true), rows(5, false), rows(5, true)]);
    all.push(array("truth", "|b1", false, "(2, 2, 2)", &[0, 1, 1, 0, 0, 0, 1, 1]));
    all
}

#[test]
fn every_type_order_and_version_holds_the_same() {
    for sample in same() {
        let loaded = sample.loaded();
        assert_eq!(loaded.report.format, "NPY", "{}", sample.what);
        assert_eq!(loaded.report.warnings, [""; 0], "{}", sample.what);
        let notes = usize::from(sample.what.starts_with("one of four"));
        assert_eq!(loaded.report.notes.len(), notes, "{}", sample.what);
        let grid = grid(loaded);
        assert_eq!(grid.dims(), [4, 3, 2], "{}", sample.what);
        assert_eq!(stored(&grid), values(), "{}", sample.what);
    }
    let truth = grid(samples().last().unwrap().loaded());
    assert_eq!(truth.samples(), &Samples::U8(vec![0, 1, 1, 0, 0, 0, 1, 1]));
}

#[test]
fn components_are_chosen_in_both_orders() {
    for sample in vectors() {
        let read = |array: Option<&str>| {
            let options = ReadOptions { array: array.map(str::to_owned), ..OPTIONS };
            sample.read(&options).unwrap()
        };
        let loaded = read(None);
        assert_eq!(loaded.report.shown.as_deref(), Some("point:values:magnitude"));
        let scaled = |f: f64| values().iter().map(|v| f * v).collect::<Vec<_>>();
        assert_eq!(stored(&grid(loaded)), scaled(3.0), "{}", sample.what);
        for (part, factor) in [("x", 1.0), ("y", 2.0), ("2", -2.0)] {
            let grid = grid(read(Some(&format!("values:{part}"))));
            assert!(matches!(grid.samples(), Samples::I16(_)));
            assert_eq!(stored(&grid), scaled(factor), "{}", sample.what);
        }
    }
}

#[test]
fn blocks_are_turned_across_their_borders() {
    // More numbers than are read at a time, in extents without a common divisor.
    let [nx, ny, nz] = [37_usize, 29, 23];
    let value = |x: usize, y: usize, z: usize| ((x + 41 * y + 1009 * z) % 65_521) as u16;
    let mut data = Vec::new();
    for x in 0..nx {
        for y in 0..ny {
            for z in 0..nz {
                data.extend(value(x, y, z).to_le_bytes());
            }
        }
    }
    let grid = grid(array("large", "<u2", true, "(23, 29, 37)", &data).loaded());
    assert_eq!(grid.dims(), [37, 29, 23]);
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                assert_eq!(grid.samples().get(x + nx * (y + ny * z)), f64::from(value(x, y, z)));
            }
        }
    }
}

#[test]
fn rows_are_points() {
    for fortran in [false, true] {
        let plain = points(rows(3, fortran).loaded());
        let place = |row: f64| DVec3::new(10.0 * row, 10.0 * row + 1.0, 10.0 * row + 2.0);
        let places: Vec<DVec3> = [0.0, 1.0, 2.0, 3.0, 4.0].map(place).to_vec();
        assert_eq!(plain.centres(), places, "{fortran}");
        assert!(plain.scalars().is_none());
        let loaded = rows(5, fortran).loaded();
        let names: Vec<String> = loaded.report.arrays.iter().map(ToString::to_string).collect();
        assert_eq!(names, ["point:column 3 (f32)", "point:column 4 (f32)"]);
        assert_eq!(loaded.report.shown.as_deref(), Some("point:column 3"));
        let wide = points(loaded);
        assert_eq!(wide.centres(), places, "{fortran}");
        assert_eq!(wide.scalars().unwrap(), [3.0, 13.0, 23.0, 33.0, 43.0], "{fortran}");
        let options =
            ReadOptions { array: Some("column 4".into()), radius: Some("column 3".into()), ..OPTIONS };
        let other = points(rows(5, fortran).read(&options).unwrap());
        assert_eq!(other.scalars().unwrap(), [4.0, 14.0, 24.0, 34.0, 44.0], "{fortran}");
    }
}

#[test]
fn a_picture_is_suspected() {
    let loaded = array("picture", "|u1", false, "(16, 17, 3)", &[7; 16 * 17 * 3]).loaded();
    assert!(loaded.report.warnings[0].contains("3 samples along x"), "{:?}", loaded.report.warnings);
}

#[test]
fn what_breaks_a_rule_is_refused_by_place() {
    let shaped = |shape: &str, parts: &[&str]| array("shape", "|u1", false, shape, &bytes()).refused(parts);
    let typed =
        |descr: &str, parts: &[&str]| array("type", descr, false, "(2, 3, 4)", &bytes()).refused(parts);
    let head = |header: &str, parts: &[&str]| {
        Sample::one("header", "a.npy", file(1, header, &bytes())).refused(parts);
    };
    shaped("(2, 3, 5)", &["shape", "(2, 3, 5) of type |u1 needs 30 bytes: 24 are there"]);
    shaped("(2, 3, 3)", &["needs 18 bytes: 24 are there"]);
    shaped("(24,)", &["(24,): must be (z, y, x)"]);
    shaped("(12, 2)", &["(12, 2): must be", "k from 3 to 63"]);
    shaped("(24, 1, 1)", &["at least 2"]);
    shaped("(2, 2, 3, 1, 2)", &["must be (z, y, x)"]);
    shaped("(0, 3, 4)", &["needs 0 bytes: 24 are there"]);
    shaped("(4294967296, 4294967296, 4294967296)", &["needs more than 2^64 bytes"]);
    array("picture", "|u1", false, "(2, 64)", &[0; 128]).refused(&["(2, 64): must be"]);
    array("times", "|u1", false, "(2, 2, 2, 17)", &[0; 136]).refused(&["c at most 16"]);
    array("no points", "<f4", false, "(0, 3)", &[]).refused(&["a.npy"]);
    typed("|O", &["descr", "Python objects"]);
    typed("<c8", &["complex numbers"]);
    typed("<U4", &["strings"]);
    typed("<M8[ns]", &["times"]);
    typed("|V3", &["raw records"]);
    typed("<f16", &["floats of another size"]);
    typed("<u3", &["\"<u3\"", "must be b1, u1 to u8"]);
    typed("", &["descr", "must be b1"]);
    head(
        "{'descr': [('x', '<f4')], 'fortran_order': False, 'shape': (24,)}",
        &["descr", "record of several fields"],
    );
    head("{'descr': '|u1', 'fortran_order': False}", &["'shape' is missing"]);
    head("{'descr': '|u1', 'shape': (2,3,4)}", &["'fortran_order' is missing"]);
    head("{'fortran_order': False, 'shape': (2,3,4)}", &["'descr' is missing"]);
    head(
        "{'descr': '|u1', 'descr': '|u1', 'fortran_order': False, 'shape': (2,3,4)}",
        &["'descr' is there twice"],
    );
    head(
        "{'descr': '|u1', 'fortran_order': False, 'shape': (2,3,4), 'more': 1}",
        &["'more'", "must be descr"],
    );
    head("{'descr': '|u1', 'fortran_order': 0, 'shape': (2,3,4)}", &["True or False"]);
    head("{'descr': '|u1', 'fortran_order': False, 'shape': (2,3,4)} + x", &["nothing must follow"]);
    head("{'descr': '|u1', 'fortran_order': False, 'shape': (24)}", &["needs a comma"]);
    head("{'descr': '|u1', 'fortran_order': False, 'shape': (2,,3)}", &["a whole number must come here"]);
    head("{'descr': '|u1', 'fortran_order': False, 'shape': (2 3)}", &["must end here"]);
    head("{'descr': '|u1', 'fortran_order': False, 'shape': (-2,3,4)}", &["a whole number"]);
    head("{'descr': '|u1', 'fortran_order': False, 'shape': (99999999999999999999,)}", &["a whole number"]);
    head("{'descr': '|u1', 'fortran_order': False, 'shape': (2,3,4)", &["} must come here"]);
    head("{'descr: 1}", &["a string must come here"]);
    head("{'de\\'scr': 1}", &["a string must come here"]);
    head("", &["{ must come here"]);
    let whole = file(1, &header("|u1", false, "(2, 3, 4)"), &bytes());
    for length in 0..whole.len() {
        Sample::one("cut", "a.npy", &whole[..length]).refused(&["a.npy"]);
    }
    let mut other = whole.clone();
    other[6] = 4;
    Sample::one("version", "a.npy", other).refused(&["byte 6", "version 4.0"]);
    let long = file(2, &" ".repeat(70_000), &[]);
    Sample::one("long", "a.npy", long).refused(&["byte 8", "70000 bytes", "limit is 65536"]);
    Sample::one(
        "not text",
        "a.npy",
        file(1, "{", &[]).into_iter().map(|b| if b == b'{' { 0xff } else { b }).collect::<Vec<u8>>(),
    )
    .refused(&["header", "is not text"]);
    let options = ReadOptions::within(23);
    for (what, fortran) in [("limit", false), ("turned limit", true)] {
        let error = array(what, "|u1", fortran, "(2, 3, 4)", &bytes()).read(&options).unwrap_err();
        assert!(error.to_string().contains("24 bytes"), "{error}");
    }
    // Lengths in Fortran order take sums as well.
    let [_, turned] = vectors();
    assert!(turned.read(&ReadOptions::within(24 * 12)).is_ok());
    let error = turned.read(&ReadOptions::within(24 * 12 - 1)).unwrap_err();
    assert!(error.to_string().contains("288 bytes"), "{error}");
    let error = rows(3, false).read(&ReadOptions::within(5 * 24 - 1)).unwrap_err();
    assert!(error.to_string().contains("120 bytes"), "{error}");
}

#[test]
fn real_files_have_their_known_sizes_and_ranges() {
    let Some(halo) = shared_loaded("particles/dark_matter_halo.npy") else { return };
    let halo = points(halo);
    assert_eq!(halo.centres().len(), 32_314);
    let [lo, hi] = halo.bounds();
    assert!(lo.distance(DVec3::new(74.5, 16.2, 89.0)) < 0.15, "{lo}");
    assert!(hi.distance(DVec3::new(78.9, 22.8, 93.2)) < 0.15, "{hi}");
    let Some(head) = shared_loaded("format_conformance/head_i16.npy") else { return };
    let head = grid(head);
    assert_eq!((head.dims(), head.range()), ([64, 64, 40], [-1024.0, 2902.0]));
}

#[test]
fn values_beyond_f32_are_told() {
    let mut values = [1e300_f64; 24];
    values[5] = 2.0;
    let data: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    let loaded = Sample::one("large", "a.npy", file(1, &header("<f8", false, "(2, 3, 4)"), &data)).loaded();
    let warnings = loaded.report.warnings.clone();
    assert!(warnings.iter().any(|w| w.contains("23 samples are infinite, or beyond f32")), "{warnings:?}");
    Sample::one("packed", "a.npy.gz", super::support::gzip(&data)).refused(&["gzip", "unpack it first"]);
}

/// Pairs at 4 x 3 x 2 places in Fortran order; in C order they count down from the largest number.
pub fn fortran_i64() -> Sample {
    let mut numbers = Vec::new();
    for c in 0..2_i64 {
        for x in 0..4 {
            for y in 0..3 {
                for z in 0..2 {
                    numbers.extend((i64::MAX - (((z * 3 + y) * 4 + x) * 2 + c)).to_le_bytes());
                }
            }
        }
    }
    let header = "{'descr': '<i8', 'fortran_order': True, 'shape': (2, 3, 4, 2), }";
    let header = format!("{header:<117}\n");
    let begin = [b"\x93NUMPY\x01\x00".as_slice(), &(header.len() as u16).to_le_bytes()].concat();
    Sample::one("pairs in Fortran order", "a.npy", [begin, header.into_bytes(), numbers].concat())
}
