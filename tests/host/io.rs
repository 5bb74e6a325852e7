//! Reading volumes and scene files, writing images: round trips, refusals, hostile input, real files.

#![expect(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

use std::fs;
use std::path::{Path, PathBuf};

use crate::folder::{Folder, OPTIONS};
use crate::formats::support::{gzip, shared};
use glam::{DMat3, DVec3};
use volraster::Image;
use volraster::Result;
use volraster::io::scene_file::{LoadedScene, PRESETS, SceneFile};
use volraster::io::{
    Data, Endian, Loaded, RawLayout, ReadOptions, Report, SampleType, known_formats, read_exr, read_grid,
    read_raw, write_exr, write_image, write_png,
};
use volraster::scene::{Anatomy, Field, Grid, Kernel, Lighting, Mode, Points, Projection, Samples};

/// The message, after checking that it is one line and names the file.
#[track_caller]
fn refusal<T: std::fmt::Debug>(result: Result<T>, path: &Path) -> String {
    let error = result.expect_err("must be refused");
    let text = error.to_string();
    assert!(text.contains(&*path.to_string_lossy()), "names no file: {text}");
    assert!(!text.contains('\n'), "more than one line: {text}");
    assert_eq!(error.exit_code(), 2, "{text}");
    text
}

#[track_caller]
fn contains(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "\"{part}\" is not in: {text}");
    }
}

// ---------------------------------------------------------------------------------------------------
// NRRD

/// The extents of [`ramp`].
const SIZES: [u32; 3] = [4, 3, 2];

fn nrrd(header: &str, data: &[u8]) -> Vec<u8> {
    [b"NRRD0004\n", header.as_bytes(), b"\n\n", data].concat()
}

fn basic(encoding: &str, more: &str) -> String {
    let more = if more.is_empty() { String::new() } else { format!("\n{more}") };
    format!("type: uchar\ndimension: 3\nsizes: 4 3 2\nencoding: {encoding}{more}")
}

fn ramp() -> Vec<u8> {
    (1..=24).collect()
}

#[test]
fn nrrd_raw_and_gzip_attached_and_detached_hold_the_same() {
    let folder = Folder::new();
    folder.write("data.raw", ramp());
    folder.write("data.gz", gzip(&ramp()));
    folder.write("lines.raw", [b"one\ntwo\n".as_slice(), &ramp()].concat());
    folder.write("tail.raw", [b"anything".as_slice(), &ramp()].concat());
    folder.write("lines.gz", [b"one\n".as_slice(), &gzip(&[b"xyz".as_slice(), &ramp()].concat())].concat());
    let files = [
        folder.write("raw.nrrd", nrrd(&basic("raw", ""), &ramp())),
        folder
            .write("gzip.nrrd", nrrd(&basic("gzip", "# a comment\nkey:=value: with colon"), &gzip(&ramp()))),
        folder.write(
            "crlf.nrrd",
            [
                nrrd(&basic("RAW", ""), &[])
                    .iter()
                    .flat_map(|&b| if b == b'\n' { vec![b'\r', b] } else { vec![b] })
                    .collect(),
                ramp(),
            ]
            .concat(),
        ),
        folder.write("a.nhdr", nrrd(&basic("raw", "data file: data.raw"), &[])),
        folder.write("b.nhdr", nrrd(&basic("gz", "datafile: ./data.gz"), &[])),
        folder.write("c.nhdr", nrrd(&basic("raw", "data file: lines.raw\nline skip: 1\nbyte skip: 4"), &[])),
        folder.write("d.nhdr", nrrd(&basic("raw", "data file: tail.raw\nbyteskip: -1"), &[])),
        folder.write("e.nhdr", nrrd(&basic("gzip", "data file: lines.gz\nlineskip: 1\nbyte skip: 3"), &[])),
        // A detached header may end with its file.
        folder.write("f.nhdr", format!("NRRD0001\n{}", basic("raw", "data file: data.raw"))),
        // The content decides, not the name.
        folder.write("gzip.nii", nrrd(&basic("gzip", ""), &gzip(&ramp()))),
    ];
    for file in files {
        let grid = read_grid(&file, &OPTIONS).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(grid.dims(), SIZES, "{}", file.display());
        assert_eq!(grid.samples(), &Samples::U8(ramp()), "{}", file.display());
    }
}

#[test]
fn nrrd_types_have_all_their_names() {
    let folder = Folder::new();
    let names: [(&str, usize, &str); 29] = [
        ("signed char", 1, "f32"),
        ("int8", 1, "f32"),
        ("int8_t", 1, "f32"),
        ("uchar", 1, "u8"),
        ("unsigned char", 1, "u8"),
        ("uint8", 1, "u8"),
        ("uint8_t", 1, "u8"),
        ("short", 2, "i16"),
        ("short int", 2, "i16"),
        ("signed short", 2, "i16"),
        ("signed short int", 2, "i16"),
        ("int16", 2, "i16"),
        ("int16_t", 2, "i16"),
        ("ushort", 2, "u16"),
        ("unsigned short", 2, "u16"),
        ("unsigned short int", 2, "u16"),
        ("uint16", 2, "u16"),
        ("uint16_t", 2, "u16"),
        ("int", 4, "f32"),
        ("signed int", 4, "f32"),
        ("int32", 4, "f32"),
        ("int32_t", 4, "f32"),
        ("uint", 4, "f32"),
        ("unsigned int", 4, "f32"),
        ("uint32", 4, "f32"),
        ("uint32_t", 4, "f32"),
        ("float", 4, "f32"),
        ("double", 8, "f32"),
        ("Double", 8, "f32"),
    ];
    for (name, size, stored) in names {
        for (endian, at) in [("little", 0), ("big", size - 1)] {
            // Integers hold 0, 1, 2, ...; the same bytes are tiny floats.
            let data: Vec<u8> =
                (0..24_u8).flat_map(|i| (0..size).map(move |byte| if byte == at { i } else { 0 })).collect();
            let header = format!("type: {name}\ndimension: 3\nsizes: 4 3 2\nencoding: raw\nendian: {endian}");
            let grid = read_grid(folder.write("t.nrrd", nrrd(&header, &data)), &OPTIONS).unwrap();
            assert_eq!(grid.samples().type_name(), stored, "{name}");
            if !["float", "double", "Double"].contains(&name) {
                assert_eq!(grid.value(1, 2, 1), 21.0, "{name} {endian}");
            }
        }
    }
}

#[test]
fn nrrd_places_the_grid() {
    let folder = Folder::new();
    let read = |more: &str| {
        let path = folder.write("p.nrrd", nrrd(&basic("raw", more), &ramp()));
        read_grid(path, &OPTIONS).unwrap_or_else(|error| panic!("{more}: {error}"))
    };
    let grid = read("spacings: 2 0.5 nan");
    assert_eq!((grid.spacing(), grid.origin()), (DVec3::new(2.0, 0.5, 1.0), DVec3::ZERO));
    assert_eq!(grid.anatomy(), Anatomy::Unknown);
    assert_eq!(read("spacings: 1 -3 1").world_of_index(DVec3::ONE), DVec3::new(1.0, -3.0, 1.0));

    let space =
        "space: left-posterior-superior\nspace directions: (0, 2,0) (-3,0,0)(0,0,4)\nspace origin: (1,2,-3)";
    let grid = read(space);
    assert_eq!(grid.anatomy(), Anatomy::Lps);
    assert_eq!(grid.index_to_world(), DMat3::from_cols(DVec3::Y * 2.0, DVec3::X * -3.0, DVec3::Z * 4.0));
    assert_eq!(grid.origin(), DVec3::new(1.0, 2.0, -3.0));

    for (name, anatomy) in [
        ("RAS", Anatomy::Ras),
        ("Right-Anterior-Superior", Anatomy::Ras),
        ("left-anterior-superior", Anatomy::Las),
        ("LPS", Anatomy::Lps),
        ("3D-left-handed", Anatomy::Unknown),
        ("scanner-xyz", Anatomy::Unknown),
    ] {
        // A space with spacings is legal, and real files have it.
        assert_eq!(read(&format!("space: {name}\nspacings: 1 1 1")).anatomy(), anatomy, "{name}");
    }
}

#[test]
fn nrrd_refuses_by_place_and_rule() {
    let folder = Folder::new();
    folder.write("data.raw", ramp());
    let check = |bytes: Vec<u8>, parts: &[&str]| {
        let path = folder.write("bad.nrrd", bytes);
        contains(&refusal(read_grid(&path, &OPTIONS), &path), parts);
    };
    let with = |more: &str, parts: &[&str]| check(nrrd(&basic("raw", more), &ramp()), parts);
    let swap = |from: &str, to: &str, parts: &[&str]| {
        check(nrrd(&basic("raw", "").replace(from, to), &ramp()), parts);
    };
    with("endian: middle", &["line 6, endian", "\"middle\"", "little or big"]);
    with("sizes: 4 3 2", &["line 6", "given before, on line 4"]);
    with("colour: red", &["line 6", "no such field"]);
    with("nonsense", &["line 6", "field: value"]);
    with("kinds: RGB-color domain domain", &["line 6, kinds", "RGB-color"]);
    with("space: LPS\nspace directions: none (1,0,0) (0,1,0)", &["line 7, space directions", "none"]);
    with("space directions: (1,0,0) (0,1,0)", &["2 vectors"]);
    with("space directions: (1,0,0) (0,1,0) (0,0,x)", &["like (1,0,0)"]);
    with("space directions: (1,0,0) (0,1,0) (1,1,0)", &["space directions", "span space"]);
    with("space directions: (0,0,0) (0,1,0) (1,1,0)", &["space directions"]);
    with("space directions: (1,0,0) (0,1,0) (0,0,1)\nspacings: 1 1 1", &["line 7, spacings", "together"]);
    with("space origin: (1,2)", &["space origin"]);
    with("space origin: (nan,2,3)", &["finite"]);
    with("space: right-up", &["line 6, space", "right-up", "left-posterior-superior"]);
    with("space: RAS\nspace dimension: 3", &["together"]);
    with("spacings: 1 0 1", &["line 6, spacings", "positive"]);
    with("spacings: 1 1", &["3 numbers"]);
    with("spacings: 1 one 1", &["3 numbers"]);
    with("line skip: -1", &["line 6, line skip"]);
    with("line skip: 9", &["line skip", "9"]);
    with("byte skip: 3", &["needs 24 bytes", "21 are there"]);
    with("byte skip: 9223372036854775807", &["needs 24 bytes", "0 are there"]);
    with("byte skip: -2", &["-1"]);
    let missing = folder.path("missing.raw");
    let path = folder.write("bad.nhdr", nrrd(&basic("raw", "data file: missing.raw"), &[]));
    contains(&refusal(read_grid(path, &OPTIONS), &missing), &["cannot open"]);
    with("data file: LIST", &["several files"]);
    with("data file: slice.%03d.raw 1 9 1", &["several files"]);
    let path = folder.write("bad.nhdr", nrrd(&basic("raw", "data file: ."), &[]));
    contains(&refusal(read_grid(path, &OPTIONS), folder.root()), &["regular file"]);
    swap("encoding: raw", "encoding: bzip2", &["line 5, encoding", "bzip2", "raw and gzip"]);
    swap("encoding: raw", "encoding: ascii", &["needs 24 numbers", "24 bytes hold at most 13"]);
    swap("encoding: raw", "encoding: hex", &["hex"]);
    swap("encoding: raw", "comment: x", &["no such field"]);
    swap("\nencoding: raw", "", &["encoding", "missing"]);
    swap("type: uchar", "type: block", &["line 2, type", "block"]);
    swap("type: uchar", "type: int64", &["endian", "missing", "i64"]);
    swap("type: uchar", "type: short", &["endian", "missing", "i16"]);
    swap("dimension: 3", "dimension: 4", &["line 4, sizes", "3 numbers", "needs 4"]);
    swap("dimension: 3", "dimension: 2", &["line 3, dimension", "2"]);
    swap("sizes: 4 3 2", "sizes: 4 3", &["2 numbers"]);
    swap("sizes: 4 3 2", "sizes: 4 -3 2", &["\"-3\""]);
    swap("sizes: 4 3 2", "sizes: 4 0 2", &["\"0\""]);
    swap("sizes: 4 3 2", "sizes: 24 1 1", &["at least 2"]);
    swap("sizes: 4 3 2", "sizes: 4294967295 4294967295 4294967295", &["sizes", "memory can address"]);
    swap("sizes: 4 3 2", "sizes: 4294967295 65536 65536", &["limit is 1073741824"]);
    swap("sizes: 4 3 2", "sizes: 99999999999 2 2", &["99999999999"]);
    swap("sizes: 4 3 2", "sizes: 4000 4000 4000", &["64000000000 bytes", "limit is 1073741824"]);
    swap("sizes: 4 3 2", "sizes: 4 3 3", &["needs 36 bytes", "24 are there"]);
    swap("sizes: 4 3 2", "sizes: 4 2 2", &["needs 16 bytes", "24 are there"]);
    check(b"NRRD0009\n\n".to_vec(), &["line 1", "NRRD0001 to NRRD0006"]);
    check(b"NRRD0004\ntype: uchar\n".to_vec(), &["no empty line"]);
    let endless = [b"NRRD0004\n".to_vec(), b"# padding\n".repeat(200_000)].concat();
    check(endless, &["no empty line", "1048576"]);
    check(nrrd(&basic("gzip", "byte skip: -1"), &gzip(&ramp())), &["byte skip", "raw"]);
}

#[test]
fn gzip_streams_are_read_no_further_than_announced() {
    let folder = Folder::new();
    let check = |data: &[u8], parts: &[&str]| {
        let path = folder.write("z.nrrd", nrrd(&basic("gzip", ""), data));
        contains(&refusal(read_grid(&path, &OPTIONS), &path), parts);
    };
    check(&gzip(&ramp()[..20]), &["needs 24 bytes", "ends after 20"]);
    check(&gzip(&[ramp(), vec![0]].concat()), &["needs 24 bytes", "holds more"]);
    // Four gigabytes of zeros: refused after 25 bytes, so at once, not after the seconds they take.
    let bomb = gzip(&vec![0; 16 << 20]).repeat(256);
    let start = std::time::Instant::now();
    check(&bomb, &["needs 24 bytes", "holds more"]);
    let path = folder.write("bomb.nii", [gzip(&small().file(&ramp())), bomb].concat());
    contains(&refusal(read_grid(&path, &OPTIONS), &path), &["needs 24 bytes", "holds more"]);
    assert!(start.elapsed().as_millis() < 1000, "the bomb was inflated");
    let mut flipped = gzip(&ramp());
    let end = flipped.len();
    flipped[end - 6] ^= 1;
    check(&flipped, &["damaged"]);
    check(b"not gzip at all, certainly", &["damaged"]);
    // A header that announces more than the compressed bytes can hold takes no memory.
    let header = basic("gzip", "").replace("4 3 2", "1000 1000 1000");
    let path = folder.write("z.nrrd", nrrd(&header, &gzip(&ramp())));
    contains(
        &refusal(read_grid(&path, &OPTIONS), &path),
        &["needs 1000000000 bytes", "compressed bytes hold at most"],
    );
    // Members one after another are one stream.
    let members = [gzip(&ramp()[..10]), gzip(&ramp()[10..])].concat();
    let path = folder.write("z.nrrd", nrrd(&basic("gzip", ""), &members));
    assert_eq!(read_grid(path, &OPTIONS).unwrap().samples(), &Samples::U8(ramp()));
}

// ---------------------------------------------------------------------------------------------------
// NIfTI-1

/// A header of 348 bytes with four of extension flags, written by the standard's table of offsets.
struct Header {
    bytes: Vec<u8>,
    big: bool,
}

impl Header {
    fn new(dims: [i16; 3], datatype: i16, bits: i16, big: bool) -> Self {
        let mut header = Self { bytes: vec![0; 352], big };
        header.put(0, 348_i32.to_be_bytes());
        for (i, value) in [3, dims[0], dims[1], dims[2], 1, 1, 1, 1].into_iter().enumerate() {
            header.short(40 + 2 * i, value);
        }
        header.short(70, datatype);
        header.short(72, bits);
        for i in 0..8 {
            header.float(76 + 4 * i, 1.0);
        }
        header.float(108, 352.0);
        header.bytes[344..348].copy_from_slice(b"n+1\0");
        header
    }

    /// Big-endian bytes, turned round where the file is little-endian.
    fn put<const N: usize>(&mut self, at: usize, mut bytes: [u8; N]) {
        if !self.big {
            bytes.reverse();
        }
        self.bytes[at..at + N].copy_from_slice(&bytes);
    }

    fn short(&mut self, at: usize, value: i16) {
        self.put(at, value.to_be_bytes());
    }

    fn float(&mut self, at: usize, value: f32) {
        self.put(at, value.to_be_bytes());
    }

    fn with(mut self, change: impl FnOnce(&mut Self)) -> Self {
        change(&mut self);
        self
    }

    fn file(&self, data: &[u8]) -> Vec<u8> {
        [self.bytes.as_slice(), data].concat()
    }
}

fn small() -> Header {
    Header::new([4, 3, 2], 2, 8, false)
}

#[test]
fn nifti_holds_the_same_in_every_packing() {
    let folder = Folder::new();
    let pair = small().with(|h| {
        h.bytes[344..348].copy_from_slice(b"ni1\0");
        h.float(108, 0.0);
    });
    folder.write("pair.img", ramp());
    folder.write("packed.img.gz", gzip(&ramp()));
    let files = [
        folder.write("a.nii", small().file(&ramp())),
        folder.write("a.nii.gz", gzip(&small().file(&ramp()))),
        folder.write("named_wrong.dat", small().file(&ramp())),
        folder.write("pair.hdr", &pair.bytes),
        folder.path("pair.img"),
        folder.write("packed.hdr.gz", gzip(&pair.bytes[..348])),
        folder.path("packed.img.gz"),
        folder.write("later.nii", small().with(|h| h.float(108, 360.0)).file(&[vec![9; 8], ramp()].concat())),
    ];
    for file in files {
        let grid = read_grid(&file, &OPTIONS).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!((grid.dims(), grid.samples()), (SIZES, &Samples::U8(ramp())), "{}", file.display());
        assert_eq!(grid.anatomy(), Anatomy::Unknown);
    }
}

#[test]
fn nifti_types_in_both_byte_orders() {
    let folder = Folder::new();
    for big in [false, true] {
        let kinds: [(i16, usize, &str); 6] =
            [(2, 1, "u8"), (256, 1, "f32"), (4, 2, "i16"), (512, 2, "u16"), (8, 4, "f32"), (768, 4, "f32")];
        for (code, size, stored) in kinds {
            let at = if big { size - 1 } else { 0 };
            let data: Vec<u8> =
                (0..24_u8).flat_map(|i| (0..size).map(move |byte| if byte == at { i } else { 0 })).collect();
            let header = Header::new([4, 3, 2], code, i16::try_from(size * 8).unwrap(), big);
            let grid = read_grid(folder.write("t.nii", header.file(&data)), &OPTIONS).unwrap();
            assert_eq!(grid.samples().type_name(), stored);
            assert_eq!(grid.value(1, 2, 1), 21.0, "{code} {big}");
        }
        let order = |mut bytes: Vec<u8>| {
            if !big {
                bytes.reverse();
            }
            bytes
        };
        let floats: Vec<u8> =
            (0..24_u8).flat_map(|i| order((f32::from(i) / 2.0).to_be_bytes().into())).collect();
        let doubles: Vec<u8> =
            (0..24_u8).flat_map(|i| order((f64::from(i) / 2.0).to_be_bytes().into())).collect();
        for (code, bits, data) in [(16, 32, floats), (64, 64, doubles)] {
            let header = Header::new([4, 3, 2], code, bits, big);
            let grid = read_grid(folder.write("t.nii", header.file(&data)), &OPTIONS).unwrap();
            assert_eq!((grid.value(1, 2, 1), grid.samples().type_name()), (10.5, "f32"));
        }
    }
}

#[test]
fn nifti_places_and_rescales() {
    let folder = Folder::new();
    let read = |header: Header| read_grid(folder.write("p.nii", header.file(&ramp())), &OPTIONS).unwrap();
    let sizes = |h: &mut Header| {
        h.float(80, 2.0);
        h.float(84, -3.0);
        h.float(88, 0.0);
    };
    let grid = read(small().with(sizes));
    assert_eq!((grid.spacing(), grid.anatomy()), (DVec3::new(2.0, 3.0, 1.0), Anatomy::Unknown));

    // A quarter turn about z: x to y, y to -x; qfac turns z round.
    let quarter = |h: &mut Header| {
        sizes(h);
        h.float(76, -1.0);
        h.short(252, 1);
        h.float(264, std::f32::consts::FRAC_1_SQRT_2);
        for (i, value) in [7.0, 8.0, 9.0].into_iter().enumerate() {
            h.float(268 + 4 * i, value);
        }
    };
    let grid = read(small().with(quarter));
    let expected = DVec3::new(7.0 - 3.0, 8.0 + 2.0, 9.0 - 1.0);
    assert!(
        (grid.world_of_index(DVec3::ONE) - expected).length() < 1e-6,
        "{}",
        grid.world_of_index(DVec3::ONE)
    );
    assert_eq!(grid.anatomy(), Anatomy::Ras);

    // The sform wins.
    let rows = [1.0, 0.0, 0.5, 10.0, 0.0, -2.0, 0.0, 20.0, 0.0, 0.0, 4.0, 30.0];
    let grid = read(small().with(quarter).with(|h| {
        h.short(254, 2);
        for (i, value) in rows.into_iter().enumerate() {
            h.float(280 + 4 * i, value);
        }
    }));
    assert!((grid.world_of_index(DVec3::ONE) - DVec3::new(11.5, 18.0, 34.0)).length() < 1e-12);
    assert_eq!(grid.anatomy(), Anatomy::Ras);

    for (slope, inter, value) in
        [(0.0, 5.0, 24.0), (f32::NAN, 5.0, 24.0), (2.0, -8.0, 40.0), (-1.0, 0.0, -24.0)]
    {
        let grid = read(small().with(|h| {
            h.float(112, slope);
            h.float(116, inter);
        }));
        assert_eq!(grid.value(3, 2, 1), value);
        assert_eq!(grid.samples().type_name(), "u8");
    }
    // Further dimensions of one are no dimensions.
    let grid = read(small().with(|h| h.short(40, 5)));
    assert_eq!(grid.dims(), SIZES);
}

#[test]
fn nifti_refuses_by_field_and_rule() {
    let folder = Folder::new();
    for packed in [false, true] {
        let check = |header: Header, parts: &[&str]| {
            let bytes = header.file(&ramp());
            let path = folder.write("bad.nii", if packed { gzip(&bytes) } else { bytes });
            contains(&refusal(read_grid(&path, &OPTIONS), &path), parts);
        };
        let with = |change: fn(&mut Header), parts: &[&str]| check(small().with(change), parts);
        with(|h| h.put(0, 347_i32.to_be_bytes()), &["sizeof_hdr", "347", "348"]);
        with(|h| h.put(0, 540_i32.to_be_bytes()), &["NIfTI-2"]);
        with(|h| h.bytes[344..348].copy_from_slice(b"abc\0"), &["magic", "abc"]);
        with(|h| h.bytes[344..348].copy_from_slice(b"ni1\0"), &["magic", ".hdr"]);
        with(|h| h.short(40, 0), &["dim[0]", "1 to 7"]);
        with(|h| h.short(40, 8), &["dim[0]", "8"]);
        with(|h| h.short(40, -3), &["dim[0]", "-3"]);
        with(|h| h.short(40, 2), &["dim[0]", "three"]);
        with(|h| h.short(42, -4), &["dim[1]", "-4"]);
        with(|h| h.short(44, 0), &["dim[2]", "0"]);
        with(|h| h.short(46, 1), &["at least 2"]);
        with(
            |h| {
                h.short(40, 4);
                h.short(48, 7)
            },
            &["dim[4]", "7", "three dimensions"],
        );
        with(
            |h| {
                h.short(40, 5);
                h.short(50, 3)
            },
            &["dim[5]", "3"],
        );
        with(|h| h.short(70, 128), &["datatype", "128", "Rgb24"]);
        with(|h| h.short(70, 3), &["datatype", "3"]);
        with(|h| h.float(108, 351.0), &["vox_offset", "351", "at least 352"]);
        with(|h| h.float(108, 352.5), &["vox_offset", "352.5"]);
        with(|h| h.float(108, f32::NAN), &["vox_offset"]);
        with(|h| h.float(108, f32::INFINITY), &["vox_offset"]);
        with(|h| h.float(108, -352.0), &["vox_offset"]);
        with(|h| h.float(112, f32::INFINITY), &["scl_slope"]);
        with(
            |h| {
                h.float(112, 1.0);
                h.float(116, f32::NAN)
            },
            &["scl_slope, scl_inter"],
        );
        with(|h| h.short(254, 1), &["srow"]);
        with(
            |h| {
                h.short(252, 1);
                h.float(256, f32::NAN)
            },
            &["quatern"],
        );
        with(
            |h| {
                h.short(252, 1);
                h.float(268, f32::INFINITY)
            },
            &["quatern"],
        );
        with(
            |h| [42, 44, 46].into_iter().for_each(|at| h.short(at, i16::MAX)),
            &["dim", "limit is 1073741824"],
        );
        let needs = if packed { "compressed" } else { "24 are there" };
        with(
            |h| {
                h.short(42, 900);
                h.short(44, 900)
            },
            &["needs 1620000 bytes", needs],
        );
        let needs = if packed { "ends after 24" } else { "24 are there" };
        with(|h| h.short(46, 3), &["needs 36 bytes", needs]);
        let needs = if packed { "holds more" } else { "24 are there" };
        with(|h| h.short(44, 2), &["needs 16 bytes", needs]);
        with(|h| h.float(108, 1e9), &["needs 24 bytes"]);
    }
    let path =
        folder.write("lonely.hdr", small().with(|h| h.bytes[344..348].copy_from_slice(b"ni1\0")).bytes);
    let text = read_grid(&path, &OPTIONS).unwrap_err().to_string();
    contains(&text, &["lonely.img", "cannot open"]);
}

// ---------------------------------------------------------------------------------------------------
// Every cut, every flip

#[test]
fn a_file_cut_anywhere_is_refused() {
    let folder = Folder::new();
    let spaced = "spacings: 1 1 1\nspace: RAS";
    let files = [
        ("cut.nrrd", nrrd(&basic("raw", spaced), &ramp())),
        ("cut.nrrd", nrrd(&basic("gzip", spaced), &gzip(&ramp()))),
        ("cut.nii", small().file(&ramp())),
        ("cut.nii", Header::new([4, 3, 2], 2, 8, true).file(&ramp())),
        ("cut.nii.gz", gzip(&small().file(&ramp()))),
    ];
    for (name, bytes) in files {
        for length in 0..bytes.len() {
            let path = folder.write(name, &bytes[..length]);
            refusal(read_grid(&path, &OPTIONS), &path);
        }
        read_grid(folder.write(name, &bytes), &OPTIONS).unwrap();
    }
}

/// A limit of 64 bytes: whatever a flipped header says, more than that must not come back.
#[test]
fn a_flipped_byte_never_panics_and_never_exceeds_the_limit() {
    let folder = Folder::new();
    let options = ReadOptions::within(64);
    let header = basic("raw", "spacings: 1 1 1\nspace: LPS\nbyte skip: 0\nendian: little");
    let files = [
        ("flip.nrrd", nrrd(&header, &ramp()), header.len() + 11),
        ("flip.nii", small().with(|h| h.short(252, 1)).file(&ramp()), 352),
        ("flip.nii.gz", gzip(&small().file(&ramp())), 60),
    ];
    for (name, bytes, end) in files {
        for at in 0..end {
            for flip in [0x01, 0x02, 0x04, 0x08, 0x10, 0x20, 0x40, 0x80, 0xff] {
                let mut bytes = bytes.clone();
                let Some(byte) = bytes.get_mut(at) else { continue };
                *byte ^= flip;
                if let Ok(grid) = read_grid(folder.write(name, &bytes), &options) {
                    assert!(grid.samples().len() * grid.samples().sample_bytes() <= 64);
                }
            }
        }
    }
}

#[test]
fn the_memory_limit_is_exact_and_counts_the_samples_as_they_are_kept() {
    let folder = Folder::new();
    let path = folder.write("a.nrrd", nrrd(&basic("raw", ""), &ramp()));
    read_grid(&path, &ReadOptions::within(24)).unwrap();
    let text = refusal(read_grid(&path, &ReadOptions::within(23)), &path);
    contains(&text, &["24 bytes", "limit is 23"]);
    let path = folder.write("b.nrrd", nrrd(&basic("raw", "").replace("uchar", "signed char"), &ramp()));
    contains(&refusal(read_grid(&path, &ReadOptions::within(95)), &path), &["96 bytes"]);
}

#[test]
fn what_no_format_knows_gets_a_list() {
    let folder = Folder::new();
    let path = folder.write("notes.txt", "some text");
    contains(
        &refusal(read_grid(&path, &OPTIONS), &path),
        &["known format", "NRRD (.nrrd", ".nii.gz", "scene file"],
    );
    contains(&known_formats(), &["NRRD", "NIfTI-1", ".nhdr"]);
    let path = folder.write("empty.nii", "");
    contains(&refusal(read_grid(&path, &OPTIONS), &path), &["header", "348 bytes", "0 are there"]);
    let path = folder.path("absent.nrrd");
    contains(&refusal(read_grid(&path, &OPTIONS), &path), &["cannot open"]);
    contains(&refusal(read_grid(folder.root(), &OPTIONS), &folder.path("empty.nii")), &["0 are there"]);
}

#[test]
fn raw_files_are_what_the_layout_says() {
    let folder = Folder::new();
    let data: Vec<u8> = (0..24_i16).flat_map(|i| (i * -100).to_be_bytes()).collect();
    let path = folder.write("a.raw", [vec![1, 2, 3], data.clone()].concat());
    let layout = RawLayout { endian: Endian::Big, offset: 3, ..RawLayout::new(SIZES, SampleType::I16) };
    let grid = read_raw(&path, &layout, &OPTIONS).unwrap();
    assert_eq!(grid.value(3, 2, 1), -2300.0);
    let packed = folder.write("a.raw.gz", gzip(&[vec![1, 2, 3], data].concat()));
    assert_eq!(read_raw(packed, &layout, &OPTIONS).unwrap().samples(), grid.samples());
    for (offset, there) in [(0, "51"), (4, "47"), (u64::MAX, "overflows")] {
        contains(&refusal(read_raw(&path, &RawLayout { offset, ..layout }, &OPTIONS), &path), &[there]);
    }
    let bad = RawLayout { spacing: DVec3::new(1.0, 0.0, 1.0), ..layout };
    contains(&refusal(read_raw(&path, &bad, &OPTIONS), &path), &["spacing", "positive"]);
    // Samples that look like gzip are samples.
    let magic = [vec![0x1f, 0x8b], vec![0; 22]].concat();
    let path = folder.write("magic.raw", &magic);
    let grid = read_raw(path, &RawLayout::new(SIZES, SampleType::U8), &OPTIONS).unwrap();
    assert_eq!(grid.samples(), &Samples::U8(magic));
}

// ---------------------------------------------------------------------------------------------------
// Images

fn picture() -> Image {
    let pixels = (0..15_u8).map(|i| [f32::from(i) * 0.07, 1e-30, -3.5e7, f32::from(i) / 14.0]).collect();
    Image::new(5, 3, pixels).unwrap()
}

#[test]
fn exr_keeps_every_bit() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    write_exr(&path, &picture()).unwrap();
    assert_eq!(read_exr(&path, &OPTIONS).unwrap(), picture());
    contains(&refusal(read_exr(&path, &ReadOptions::within(239)), &path), &["5 x 3", "239"]);
    // The channels' names and type are what other programs read.
    let meta = exr::meta::MetaData::read_from_file(&path, true).unwrap();
    let channels: Vec<String> =
        meta.headers[0].channels.list.iter().map(|c| format!("{} {:?}", c.name, c.sample_type)).collect();
    assert_eq!(channels, ["A F32", "B F32", "G F32", "R F32"]);
    let bytes = fs::read(&path).unwrap();
    for length in (0..bytes.len()).step_by(7) {
        let path = folder.write("cut.exr", &bytes[..length]);
        refusal(read_exr(&path, &OPTIONS), &path);
    }
    for at in 0..bytes.len() {
        for flip in [0x01, 0x10, 0x80, 0xff] {
            let mut bytes = bytes.clone();
            bytes[at] ^= flip;
            // Only that it comes back: many flips are other valid images.
            let _ = read_exr(folder.write("flip.exr", bytes), &ReadOptions::within(1 << 16));
        }
    }
}

#[test]
fn exr_keeps_nan_and_infinity() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.0];
    write_exr(&path, &Image::new(2, 1, vec![odd; 2]).unwrap()).unwrap();
    let back = read_exr(&path, &OPTIONS).unwrap().pixel(1, 0);
    assert_eq!(back.map(f32::to_bits), odd.map(f32::to_bits));
}

#[test]
fn png_is_composited_encoded_and_the_right_way_up() {
    let folder = Folder::new();
    let path = folder.path("a.png");
    let pixels = vec![[0.5, 0.5, 0.5, 0.5], [0.0; 4], [1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]];
    let image = Image::new(2, 2, pixels).unwrap();
    write_png(&path, &image, [0.0, 1.0, 0.0, 1.0]).unwrap();
    let back = ::image::open(&path).unwrap();
    assert_eq!(back.color(), ::image::ColorType::Rgb8);
    let back = back.to_rgb8();
    assert_eq!(back.get_pixel(0, 0).0, [188, 255, 188]);
    assert_eq!(back.get_pixel(1, 0).0, [0, 255, 0]);
    assert_eq!(back.get_pixel(0, 1).0, [255, 0, 0]);
    assert_eq!(back.get_pixel(1, 1).0, [0, 0, 255]);
    write_png(&path, &image, [0.0; 4]).unwrap();
    assert_eq!(::image::open(&path).unwrap().to_rgba8().get_pixel(0, 0).0, [255, 255, 255, 128]);
}

#[test]
fn writing_fails_in_one_line_and_leaves_nothing() {
    let folder = Folder::new();
    let inside = folder.write("file", "x").join("a.png");
    contains(&refusal(write_image(&inside, &picture(), [0.0; 4]), &inside), &["cannot write"]);
    let absent = folder.path("absent").join("a.exr");
    contains(&refusal(write_image(&absent, &picture(), [0.0; 4]), &absent), &["cannot write"]);
    let taken = folder.path("taken.exr");
    fs::create_dir(&taken).unwrap();
    contains(&refusal(write_image(&taken, &picture(), [0.0; 4]), &taken), &["file type", "regular file"]);
    let odd = folder.path("a.jpg");
    contains(&refusal(write_image(&odd, &picture(), [0.0; 4]), &odd), &[".exr or .png"]);
    assert_eq!(folder.names(""), ["file", "taken.exr"]);
    for name in ["a.EXR", "b.png"] {
        write_image(folder.path(name), &picture(), [0.0; 4]).unwrap();
    }
    assert_eq!(folder.names("").len(), 4);
}

// ---------------------------------------------------------------------------------------------------
// Scene files

const FIELD: &str = r#""volume": {"field": "blobs", "dims": [8, 9, 10], "type": "u8"}"#;

fn scene(folder: &Folder, rest: &str) -> (PathBuf, Result<LoadedScene>) {
    let loaded = folder.scene(&format!("{{{FIELD}{rest}}}"));
    (folder.path("scene.json"), loaded)
}

#[test]
fn the_example_of_the_design_loads() {
    let folder = Folder::new();
    folder.write("head.nrrd", nrrd(&basic("raw", ""), &ramp()));
    let path = folder.write(
        "scene.json",
        r#"{
      "volume":  {"file": "head.nrrd"},
      "transfer": [[0, 0,0,0, 0], [80, 0.9,0.6,0.4, 0.02], [255, 1,1,1, 0.8]],
      "camera":  {"eye": [2,1.5,3.8], "target": [0,0,0], "up": [0,1,0], "fov_y_deg": 42},
      "image":   {"width": 320, "height": 200},
      "background": [0,0.5,0,1],
      "technique": {"name": "slabs", "step": 0.5, "bits": 8, "exact": true, "filter": "cubic"}
    }"#,
    );
    let loaded = LoadedScene::load_any(&path, &OPTIONS).unwrap();
    assert_eq!(loaded.scene.grid().unwrap().samples(), &Samples::U8(ramp()));
    assert_eq!(loaded.scene.transfer.at(80.0), (DVec3::new(0.9, 0.6, 0.4), 0.02));
    assert_eq!(loaded.camera.eye, DVec3::new(2.0, 1.5, 3.8));
    assert_eq!(loaded.camera.projection, Projection::Perspective { fov_y_deg: 42.0 });
    assert!(!loaded.camera_is_automatic);
    assert_eq!((loaded.width, loaded.height, loaded.background), (320, 200, [0.0, 0.5, 0.0, 1.0]));
    let technique = loaded.technique.unwrap();
    assert_eq!(technique.name, "slabs");
    let options: Vec<_> = technique.options.iter().map(|(key, value)| format!("{key}={value}")).collect();
    assert_eq!(options, ["step=0.5", "bits=8", "exact=true", "filter=cubic"]);
}

#[test]
fn what_is_left_out_is_chosen_and_data_alone_takes_the_same_way() {
    let folder = Folder::new();
    let data = folder.write("head.nrrd", nrrd(&basic("raw", ""), &ramp()));
    let path = folder.write("scene.json", r#"{"volume": {"file": "head.nrrd"}}"#);
    let named = LoadedScene::load_any(&path, &OPTIONS).unwrap();
    let alone = LoadedScene::load_any(&data, &OPTIONS).unwrap();
    assert!(named.camera_is_automatic && alone.camera_is_automatic);
    assert_eq!(named.camera, alone.camera);
    assert_eq!(named.scene.transfer, alone.scene.transfer);
    assert_eq!((named.width, named.height, named.background), (512, 512, [0.0, 0.0, 0.0, 1.0]));
    assert!(named.technique.is_none());
    let (_, loaded) = scene(&folder, r#", "image": {"height": 64}"#);
    let loaded = loaded.unwrap();
    assert_eq!((loaded.width, loaded.height), (512, 64));
    assert_eq!(
        loaded.scene.grid().unwrap().samples(),
        Field::Blobs.sample([8, 9, 10], "u8").unwrap().samples()
    );
}

#[test]
fn raw_volumes_are_placed_by_rows() {
    let folder = Folder::new();
    folder.write("a.raw", ramp());
    let loaded = folder.scene(
        r#"{"volume": {"file": "a.raw", "dims": [4,3,2], "type": "u8",
        "spacing": [1,2,3], "origin": [5,6,7], "direction": [0,-1,0, 1,0,0, 0,0,1]}}"#,
    );
    let grid = loaded.unwrap().scene.grid().unwrap().clone();
    // Rows of the matrix: x' = -y, y' = x.
    assert_eq!(grid.world_of_index(DVec3::ONE), DVec3::new(5.0 - 2.0, 6.0 + 1.0, 7.0 + 3.0));
}

#[test]
fn presets_stretch_and_scale() {
    let folder = Folder::new();
    let transfer = |spec: &str| scene(&folder, &format!(r#", "transfer": {spec}"#)).1.unwrap().scene.transfer;
    let fog = transfer(r#"{"preset": "fog", "range": [0, 255]}"#);
    assert_eq!(fog.at(153.0), (DVec3::new(0.9, 0.85, 0.3), 3.0));
    assert_eq!((fog.domain(), fog.max_tau()), ([0.0, 255.0], 8.0));
    let shells = transfer(r#"{"preset": "shells", "range": [0, 1], "tau_scale": 2}"#);
    assert_eq!(shells.at(0.5), (DVec3::new(1.0, 0.8, 0.3), 60.0));
    // Without a range: the data's.
    let grid = Field::Blobs.sample([8, 9, 10], "u8").unwrap();
    assert_eq!(transfer(r#"{"preset": "grey"}"#).domain(), grid.range());
    for preset in PRESETS {
        let made = transfer(&format!(r#"{{"preset": "{}", "tau_scale": 3}}"#, preset.name));
        assert_eq!(
            made,
            preset.transfer(&grid.clone().into(), None, None, Some(3.0)).unwrap(),
            "{}",
            preset.name
        );
    }
    folder.write("knots.json", "[[0,0,0,0,0],[1,1,1,1,9]]");
    folder.write("preset.json", r#"{"preset": "fog", "range": [0, 255]}"#);
    assert_eq!(transfer(r#"{"file": "knots.json"}"#).max_tau(), 9.0);
    assert_eq!(transfer(r#"{"file": "preset.json"}"#), fog);
}

#[test]
fn modes_and_isosurfaces_are_read() {
    let folder = Folder::new();
    let of = |rest: &str| scene(&folder, rest).1.unwrap().scene;
    let (lit, usual) = (Mode::Lit(Lighting::default()), Lighting::default());
    assert_eq!(of("").mode, Mode::Emission);
    assert_eq!(of(r#", "mode": "emission""#).mode, Mode::Emission);
    assert_eq!(of(r#", "mode": "lit""#).mode, lit);
    assert_eq!(of(r#", "lighting": {}"#).mode, lit);
    let keys = r#", "mode": "lit", "lighting": {"ambient": 0.1, "diffuse": 0.9, "specular": 0, "shininess": 5,
        "direction": [0, 3, 4], "least_gradient": 2}"#;
    let want = Lighting {
        ambient: 0.1,
        diffuse: 0.9,
        specular: 0.0,
        shininess: 5.0,
        direction: Some(DVec3::new(0.0, 3.0, 4.0)),
        least_gradient: Some(2.0),
    };
    assert_eq!(of(keys).mode, Mode::Lit(want));
    // An isosurface is lit, and opaque within a small part of a voxel.
    let iso = of(r#", "transfer": {"isosurface": 10.5, "colour": [1, 0.5, 0]}"#);
    assert_eq!(iso.mode, lit);
    assert_eq!((iso.transfer.at(10.49).1, iso.transfer.at(10.5).0), (0.0, DVec3::new(1.0, 0.5, 0.0)));
    assert!(iso.transfer.at(10.5).1 * iso.grid().unwrap().spacing().min_element() > 100.0);
    assert_eq!(of(r#", "transfer": {"isosurface": 10.5}, "mode": "emission""#).mode, Mode::Emission);
    let specular = of(r#", "transfer": {"isosurface": 10.5}, "lighting": {"specular": 1}"#).mode;
    assert_eq!(specular, Mode::Lit(Lighting { specular: 1.0, ..usual }));
    // The automatic transfer function of a maximum is transparent at its least scalar and opaque at its greatest.
    let maximum = of(r#", "mode": "maximum""#);
    let ([low, high], voxel) = (maximum.transfer.domain(), maximum.grid().unwrap().spacing().min_element());
    assert_eq!((maximum.mode, maximum.transfer.at(low).1), (Mode::Maximum, 0.0));
    let opacity = |s: f64| -(-maximum.transfer.at(s).1 * voxel).exp_m1();
    assert!((opacity(high) - 0.98).abs() < 1e-12 && (opacity(0.5 * (low + high)) - 0.49).abs() < 1e-12);
}

#[test]
fn scene_files_are_refused_by_place_and_rule() {
    let folder = Folder::new();
    folder.write("a.raw", ramp());
    folder.write("loop.json", r#"{"file": "loop.json"}"#);
    let check = |rest: &str, parts: &[&str]| {
        let (path, loaded) = scene(&folder, rest);
        contains(&refusal(loaded, &path), parts);
    };
    check(r#", "light": 1"#, &["light", "line 1", "`volume`", "`technique`"]);
    check(r#", "image": {"size": 1}"#, &["image", "size", "`width`", "`height`"]);
    check(r#", "image": {"width": 0}"#, &["width", "1 to 32768"]);
    check(r#", "image": {"width": -1}"#, &["image.width", "-1"]);
    check(r#", "mesh": {"file": "x"}"#, &["mesh", "one of `volume`, `mesh`, `points` and `gaussians`"]);
    check(r#", "points": 1"#, &["points", "1"]);
    check(r#", "points": {"file": "x"}"#, &["points", "one of `volume`, `mesh`, `points` and `gaussians`"]);
    check(r#", "opaque": {}"#, &["opaque", "a sequence"]);
    check(",\n \"camera\": {\"eye\": [1,2]}", &["line 2", "camera.eye", "length 2"]);
    check(
        r#", "camera": {"eye": [1,2,3], "target": [0,0,0], "up": [0,1,0]}"#,
        &["camera", "fov_y_deg or half_height"],
    );
    check(
        r#", "camera": {"eye": [1,2,3], "target": [0,0,0], "up": [0,1,0], "fov_y_deg": 30, "half_height": 1}"#,
        &["fov_y_deg or half_height"],
    );
    check(
        r#", "camera": {"eye": [0,0,0], "target": [0,0,0], "up": [0,1,0], "fov_y_deg": 30}"#,
        &["camera", "coincide"],
    );
    check(
        r#", "camera": {"eye": [0,2,0], "target": [0,0,0], "up": [0,1,0], "fov_y_deg": 30}"#,
        &["camera up"],
    );
    check(
        r#", "camera": {"eye": [1,2,3], "target": [0,0,0], "up": [0,1,0], "fov": 30}"#,
        &["fov", "`fov_y_deg`"],
    );
    check(r#", "background": [0,0,0]"#, &["background", "length 3"]);
    check(r#", "background": [0,-1,0,1]"#, &["background", "negative"]);
    check(r#", "background": [0,0,0,2]"#, &["background", "alpha"]);
    check(r#", "transfer": [[0,0,0,0]]"#, &["transfer[0]", "length 4"]);
    check(r#", "transfer": []"#, &["transfer function", "0 knots"]);
    check(r#", "transfer": [[1,0,0,0,0],[0,0,0,0,0]]"#, &["knot 1", "below"]);
    check(r#", "transfer": 7"#, &["transfer", "preset"]);
    check(r#", "transfer": {"preset": "nice"}"#, &["transfer.preset", "nice", "fog", "shells"]);
    check(r#", "transfer": {"preset": "fog", "range": [1, 1]}"#, &["transfer.range", "[1, 1]"]);
    check(r#", "transfer": {"preset": "fog", "tau_scale": -1}"#, &["transfer.tau_scale", "-1"]);
    check(
        r#", "transfer": {"preset": "fog", "hue": 1}"#,
        &["transfer", "hue", "`tau_scale`", "`isosurface`"],
    );
    check(
        r#", "transfer": {"preset": "fog", "colour": [1, 1, 1]}"#,
        &["transfer", "`isosurface` and `colour`"],
    );
    check(
        r#", "transfer": {"isosurface": 3e9}"#,
        &["transfer.isosurface: 3000000000: the data has scalars from"],
    );
    check(r#", "mode": "mip""#, &["mode: \"mip\": must be one of emission, lit, maximum"]);
    check(r#", "mode": "maximum", "lighting": {}"#, &["lighting: belongs to mode lit, not to maximum"]);
    check(r#", "lighting": {"shine": 1}"#, &["lighting.shine", "`shininess`"]);
    check(r#", "lighting": {"shininess": 0}"#, &["lighting.shininess: 0: must be 1 to 1024"]);
    check(r#", "lighting": {"direction": [0, 0, 0]}"#, &["lighting.direction: ", "length above 0"]);
    check(r#", "mode": "lit", "kernels": {"kernel": "tent"}"#, &["mode: lit: requires a grid", "of kernels"]);
    check(r#", "transfer": {"range": [0, 1]}"#, &["transfer", "preset"]);
    check(r#", "transfer": {"file": "x.json", "preset": "fog"}"#, &["either"]);
    check(r#", "technique": {"step": 1}"#, &["technique", "name"]);
    check(r#", "technique": "slabs""#, &["technique", "object"]);
    check(r#", "technique": {"name": "slabs", "step": [1]}"#, &["technique.step", "number"]);
    check(r#", "technique": {"name": "slabs", "step": {"a": 1}}"#, &["technique.step", "number"]);
    check(r#", "technique": {"name": "slabs", "step": null}"#, &["technique.step"]);
    check(r#", "technique": {"name": "slabs", "step": 1, "step": 2}"#, &["duplicate", "step"]);
    check(r#", "image": {}, "image": {}"#, &["duplicate", "image"]);
    check(r#"} {"#, &["line 1"]);
    let looped = folder.path("loop.json");
    contains(
        &refusal(scene(&folder, r#", "transfer": {"file": "loop.json"}"#).1, &looped),
        &["must not name another"],
    );

    let volume = |spec: &str, parts: &[&str]| {
        let loaded = folder.scene(&format!("{{\"volume\": {spec}}}"));
        contains(&refusal(loaded, &folder.path("scene.json")), parts);
    };
    volume("{}", &["volume", "`file` or `field`"]);
    volume("3", &["volume", "object"]);
    volume(r#"{"file": "a.raw", "field": "blobs"}"#, &["not both"]);
    volume(r#"{"path": "a.raw"}"#, &["path", "`file`"]);
    volume(r#"{"file": "a.raw", "dims": [4,3,2]}"#, &["volume.type", "missing"]);
    volume(r#"{"file": "a.raw", "type": "u8"}"#, &["volume.dims", "missing"]);
    volume(r#"{"file": "a.raw", "offset": 4}"#, &["volume.offset", "dims"]);
    volume(
        r#"{"file": "a.raw", "dims": [4,3,2], "type": "u8", "array": "a"}"#,
        &["volume.array", "\"a\"", "raw"],
    );
    volume(r#"{"field": "blobs", "dims": [4,3,2], "array": "a"}"#, &["volume.array", "\"a\"", "fields"]);
    volume(r#"{"file": "a.raw", "array": 1}"#, &["volume.array", "string"]);
    volume(r#"{"file": "a.raw", "dims": [4,3,2], "type": "int17"}"#, &["volume.type", "int17", "i16"]);
    volume(r#"{"file": "a.raw", "dims": [4,3,2], "type": "u8", "endian": "pdp"}"#, &["volume.endian", "pdp"]);
    volume(r#"{"file": "a.raw", "dims": [4,-3,2], "type": "u8"}"#, &["volume.dims[1]", "-3"]);
    volume(r#"{"file": "a.raw", "dims": [4,3], "type": "u8"}"#, &["volume.dims", "length 2"]);
    volume(r#"{"file": "a.raw", "dims": [4,3,2], "type": "u8", "offset": -1}"#, &["volume.offset"]);
    volume(r#"{"file": "a.raw", "dims": [4,3,2], "type": "u8", "spacing": [1,1,1e999]}"#, &["out of range"]);
    volume(r#"{"field": "cubes", "dims": [4,3,2]}"#, &["volume.field", "cubes", "blobs"]);
    volume(r#"{"field": "blobs"}"#, &["volume.dims"]);
    volume(r#"{"field": "blobs", "dims": [1,3,2]}"#, &["volume.dims", "at least 2"]);
    volume(r#"{"field": "blobs", "dims": [4000,4000,4000]}"#, &["volume.dims", "limit"]);
    volume(r#"{"field": "blobs", "dims": [4294967295,4294967295,4294967295]}"#, &["volume.dims", "limit"]);
    volume(r#"{"field": "blobs", "dims": [4,3,2], "type": "f64"}"#, &["volume.type", "f64", "f32"]);
    volume(r#"{"field": "blobs", "dims": [4,3,2], "spacing": [1,1,1]}"#, &["volume.spacing", "cube"]);
    let raw = folder.path("a.raw");
    let path = folder.write("scene.json", r#"{"volume": {"file": "a.raw", "dims": [4,3,3], "type": "u8"}}"#);
    contains(&refusal(SceneFile::load(path, &OPTIONS), &raw), &["needs 36 bytes", "24 are there"]);
    for text in ["", "[]", "{\"volume\"", "nul", "{} x", "\u{0}", "{\"volume\": {\"file\": \"\"}}"] {
        let path = folder.write("scene.json", text);
        SceneFile::load(&path, &OPTIONS).expect_err(text);
    }
    let path = folder.write("scene.json", "{}");
    contains(&refusal(SceneFile::load(&path, &OPTIONS), &path), &["volume", "missing"]);
    let path = folder.write("scene.json", "[".repeat(100_000));
    refusal(SceneFile::load(&path, &OPTIONS), &path);
}

/// Data in memory takes all that a scene file says of its kind but the data itself.
#[test]
fn scene_files_describe_data_that_is_given() {
    let points: Data = Points::new(vec![DVec3::ZERO, DVec3::X]).unwrap().into();
    let splats: Data = Field::Blobs.splats(9).unwrap().into();
    let with = |data: &Data, text: &str| {
        let given = Loaded { data: data.clone(), report: Report::default() };
        SceneFile::with_data(text, given, &OPTIONS)
    };
    let text = r#"{"kernels": {"kernel": "bspline"}, "image": {"width": 7, "height": 5}}"#;
    let loaded = with(&points, text).unwrap();
    assert_eq!([loaded.width, loaded.height], [7, 5]);
    assert_eq!(loaded.scene.kernels.unwrap().kernel, Kernel::BSpline);
    assert!(with(&splats, "{}").is_ok());
    let refused = |data: &Data, text: &str, parts: &[&str]| {
        contains(&refusal(with(data, text), Path::new("scene")), parts);
    };
    refused(&points, r#"{"mesh": {"file": "a.vtu"}}"#, &["mesh", "given"]);
    refused(&points, r#"{"width": 7}"#, &["width", "unknown"]);
    refused(&splats, r#"{"kernels": {"kernel": "tent"}}"#, &["kernels", "of their own"]);
    refused(&splats, r#"{"transfer": {"preset": "fog"}}"#, &["transfer"]);
}

// ---------------------------------------------------------------------------------------------------
// Real files

fn close(a: DVec3, b: DVec3) -> bool {
    (a - b).length() < 1e-5 * (1.0 + b.length())
}

#[test]
fn real_scans_have_their_known_sizes_and_ranges() {
    let Some(folder) = shared("") else { return };
    let read = |name: &str| {
        read_grid(folder.join("structured").join(name), &OPTIONS).unwrap_or_else(|e| panic!("{e}"))
    };
    let facts = |grid: &Grid| (grid.dims(), grid.samples().type_name(), grid.range());

    let tooth = read("tooth/tooth.nhdr");
    assert_eq!((tooth.dims(), tooth.samples().type_name()), ([103, 94, 161], "u16"));
    // Read in the wrong byte order nearly the whole range of the type is used.
    assert!(tooth.range()[1] < 2000.0, "{:?}", tooth.range());

    let fetal = read("fetal_T2.nrrd");
    assert_eq!((fetal.dims(), fetal.samples().type_name()), ([117, 159, 126], "f32"));
    assert!(fetal.range()[0] == 0.0 && (fetal.range()[1] - 710.68).abs() < 0.005, "{:?}", fetal.range());
    assert!(close(fetal.spacing(), DVec3::splat(0.859_375)));
    assert!(close(fetal.origin(), DVec3::new(-49.84375, 67.890625, -53.7109375)));
    assert_eq!(fetal.anatomy(), Anatomy::Lps);

    assert_eq!(facts(&read("bonsai.nii.gz")), ([256, 256, 256], "u8", [0.0, 255.0]));
    assert_eq!(facts(&read("engine.nii.gz")), ([256, 256, 128], "u8", [0.0, 255.0]));
    assert_eq!(facts(&read("heptane.nii.gz")), ([302, 302, 302], "u8", [0.0, 255.0]));
    assert_eq!(facts(&read("fuel.nii.gz")), ([64, 33, 32], "u8", [0.0, 255.0]));

    let gadolinium = read("MR_Gd.nii.gz");
    assert_eq!((gadolinium.dims(), gadolinium.samples().type_name()), ([176, 188, 144], "u8"));
    assert!(gadolinium.range()[0] == 0.0 && (gadolinium.range()[1] - 1653.0).abs() < 0.01);
    assert!((gadolinium.spacing() - DVec3::new(0.976_56, 0.976_56, 1.0026)).length() < 1e-4);

    // Turned about x: y and z of the world mix, x stays.
    let pitch = read("CT_pitch.nii.gz");
    assert_eq!(facts(&pitch), ([175, 248, 58], "u8", [0.0, 255.0]));
    assert!((pitch.spacing() - DVec3::new(0.8125, 0.8125, 2.397_05)).length() < 1e-4);
    let columns = pitch.index_to_world();
    assert!(close(columns.x_axis, DVec3::new(0.8125, 0.0, 0.0)));
    assert!(close(columns.y_axis, DVec3::new(0.0, 0.779_041, -0.230_762)));
    assert!(close(columns.z_axis, DVec3::new(0.0, 0.680_799, 2.298_338)));
    assert!(close(pitch.origin(), DVec3::new(-69.020_76, -134.385_6, -13.568_82)));
    assert_eq!(pitch.anatomy(), Anatomy::Ras);
}

/// The samples of a version 1 `.npy` file of little-endian 16-bit integers.
fn npy(path: &Path) -> Vec<i16> {
    let bytes = fs::read(path).unwrap();
    assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
    let header = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let text = String::from_utf8_lossy(&bytes[10..10 + header]);
    contains(&text, &["'<i2'", "'fortran_order': False", "(40, 64, 64)"]);
    bytes[10 + header..].chunks_exact(2).map(|pair| i16::from_le_bytes([pair[0], pair[1]])).collect()
}

#[test]
fn one_head_in_every_format_has_the_same_values() {
    let Some(folder) = shared("") else { return };
    let folder = folder.join("format_conformance");
    let expected = npy(&folder.join("head_i16.npy"));
    assert_eq!(expected.len(), 64 * 64 * 40);

    let own = Folder::new();
    let json = format!(
        r#"{{"volume": {{"file": {:?}, "dims": [64, 64, 40], "type": "i16", "endian": "big",
            "spacing": [3.2, 3.2, 1.5], "origin": [-100, 20.5, 7.25]}}}}"#,
        fs::canonicalize(folder.join("head_i16_be.raw")).unwrap()
    );
    let raw = own.write("head.json", json);
    let files = ["head_i16_gzip.nrrd", "head_i16_be_raw.nrrd", "head_i16.nii.gz", "head_u16_slope.nii.gz"];
    let files = files.map(|name| folder.join(name)).into_iter().chain([raw]);
    for file in files {
        let grid = LoadedScene::load_any(&file, &OPTIONS)
            .unwrap_or_else(|e| panic!("{e}"))
            .scene
            .grid()
            .unwrap()
            .clone();
        let name = file.display();
        let slope = file.ends_with("head_u16_slope.nii.gz");
        assert_eq!(grid.dims(), [64, 64, 40], "{name}");
        assert!(close(grid.spacing(), DVec3::new(3.2, 3.2, 1.5)), "{name}: {}", grid.spacing());
        let mut index = 0;
        for z in 0..40 {
            for y in 0..64 {
                for x in 0..64 {
                    let value = f64::from(expected[index]);
                    // The file with a slope stores value + 1024 and halves it.
                    let value = if slope { 0.5 * (value + 1024.0) - 1024.0 } else { value };
                    assert_eq!(grid.value(x, y, z), value, "{name}: [{x}, {y}, {z}]");
                    index += 1;
                }
            }
        }
        // The same place: NIfTI counts right and anterior as positive, the others left and posterior.
        let flip = if grid.anatomy() == Anatomy::Ras { DVec3::new(-1.0, -1.0, 1.0) } else { DVec3::ONE };
        if !slope {
            assert!(close(grid.origin() * flip, DVec3::new(-100.0, 20.5, 7.25)), "{name}: {}", grid.origin());
        }
        assert!(close(grid.index_to_world() * DVec3::ONE * flip, DVec3::new(3.2, 3.2, 1.5)), "{name}");
    }
}
