//! MetaImage.

use glam::{DMat3, DVec3};
use volraster::io::{ReadOptions, read, read_memory};
use volraster::scene::{Anatomy, Rescale, Samples};

use super::support::{OPTIONS, Sample, grid, gzip, shared, shared_loaded, stored, zlib};

/// The header of 4 x 3 x 2 samples, with keys before the last.
fn header(kind: &str, more: &str, data: &str) -> Vec<u8> {
    format!("ObjectType = Image\nNDims = 3\n{more}DimSize = 4 3 2\nElementType = {kind}\nElementDataFile = {data}\n")
        .into_bytes()
}

fn bytes() -> Vec<u8> {
    (1..=24).collect()
}

fn values() -> Vec<f64> {
    (1..=24).map(f64::from).collect()
}

fn local(what: &'static str, kind: &str, more: &str, data: &[u8]) -> Sample {
    Sample::one(what, "a.mha", [&header(kind, more, "LOCAL"), data].concat())
}

fn words() -> Vec<u8> {
    values().iter().map(|value| format!("{value}\n")).collect::<String>().into_bytes()
}

/// Files that all hold 1 to 24.
fn same() -> Vec<Sample> {
    let two = |at: usize| bytes()[12 * at..12 * at + 12].to_vec();
    let one = |what, more: &str, name: &str, data: Vec<u8>| {
        Sample::one(what, "a.mhd", header("MET_UCHAR", more, name)).with(name, data)
    };
    vec![
        local("local", "MET_UCHAR", "BinaryData = True\n", &bytes()),
        local("zlib", "MET_UCHAR", "CompressedData = True\n", &zlib(&bytes())),
        local("gzip", "MET_UCHAR", "CompressedData = True\n", &gzip(&bytes())),
        local(
            "sized zlib",
            "MET_UCHAR",
            &format!("CompressedData = True\nCompressedDataSize = {}\n", zlib(&bytes()).len()),
            &zlib(&bytes()),
        ),
        local("words", "MET_SHORT", "BinaryData = False\n", &words()),
        local("words of floats", "MET_FLOAT", "BinaryData = False\n", &words()),
        local("from the end", "MET_UCHAR", "HeaderSize = -1\n", &[b"junk".as_slice(), &bytes()].concat()),
        local("far into the file", "MET_UCHAR", "HeaderSize = 200\n", &{
            let begin = header("MET_UCHAR", "HeaderSize = 200\n", "LOCAL").len();
            [vec![b'j'; 200 - begin], bytes()].concat()
        }),
        one("one file", "", "a.raw", bytes()),
        one("a name with blanks", "", "a 1 2.raw", bytes()),
        one("a name with a percent sign", "", "50%.raw", bytes()),
        one("one zlib file", "CompressedData = True\n", "a.zraw", zlib(&bytes())),
        one("one file of words", "BinaryData = 0\n", "a.txt", words()),
        one("after a head", "HeaderSize = 3\n", "a.raw", [b"abc".as_slice(), &bytes()].concat()),
        one("before the end", "HeaderSize = -1\n", "a.raw", [b"abcd".as_slice(), &bytes()].concat()),
        one("a head before zlib", "HeaderSize = 2\nCompressedData = t\n", "a.raw", [b"ab".as_slice(), &zlib(&bytes())].concat()),
        Sample::one("a list", "a.mhd", [header("MET_UCHAR", "", "LIST"), b"one.raw\n\ntwo b.raw\n".to_vec()].concat())
            .with("one.raw", two(0))
            .with("two b.raw", two(1)),
        Sample::one("a list of slices", "a.mhd", [header("MET_UCHAR", "HeaderSize = 1\n", "LIST 2"), b"one.raw\r\ntwo.raw".to_vec()].concat())
            .with("one.raw", [vec![0], two(0)].concat())
            .with("two.raw", [vec![0], two(1)].concat()),
        Sample::one("a list of zlib", "a.mhd", [header("MET_UCHAR", "CompressedData = True\n", "LIST"), b"one.z\ntwo.z\n".to_vec()].concat())
            .with("one.z", zlib(&two(0)))
            .with("two.z", zlib(&two(1))),
        Sample::one("a list of rows", "a.mhd", {
            let names: String = (0..6).map(|i| format!("{i}.raw\n")).collect();
            [header("MET_UCHAR", "", "LIST 1"), names.into_bytes()].concat()
        })
        .with("0.raw", [1, 2, 3, 4])
        .with("1.raw", [5, 6, 7, 8])
        .with("2.raw", [9, 10, 11, 12])
        .with("3.raw", [13, 14, 15, 16])
        .with("4.raw", [17, 18, 19, 20])
        .with("5.raw", [21, 22, 23, 24]),
        Sample::one("a list of one", "a.mhd", [header("MET_UCHAR", "", "LIST 3"), b"all.raw\n".to_vec()].concat())
            .with("all.raw", bytes()),
        Sample::one("a pattern", "a.mhd", header("MET_UCHAR", "", "s%03d.raw 7 9 2"))
            .with("s007.raw", two(0))
            .with("s009.raw", two(1)),
        Sample::one("a pattern alone", "a.mhd", header("MET_UCHAR", "", "s%d.raw"))
            .with("s1.raw", two(0))
            .with("s2.raw", two(1)),
        Sample::one("a falling pattern with a blank", "a.mhd", header("MET_UCHAR", "", "s %d.raw 2 1 -1"))
            .with("s 2.raw", two(0))
            .with("s 1.raw", two(1)),
        Sample::one(
            "four axes",
            "a.mha",
            [
                b"NDims = 4\nDimSize = 4 3 2 1\nElementSpacing = 1 1 1 9\nOffset = 0 0 0 5\n\
                  TransformMatrix = 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n"
                    .as_slice(),
                &bytes(),
            ]
            .concat(),
        ),
        Sample::one(
            "colons and carriage returns",
            "a.mha",
            [
                b"Comment: any = thing\r\nNDims : 3\r\nDimSize:4 3 2\r\n\r\nElementType = MET_UCHAR\r\nElementDataFile=Local\r\n"
                    .as_slice(),
                &bytes(),
            ]
            .concat(),
        ),
        Sample::one("known by its name alone", "a.mhd", {
            [b"Unknown = 1\nUnknown = 2\n".to_vec(), header("MET_UCHAR", "", "LOCAL"), bytes()].concat()
        }),
    ]
}

/// Files of three components: sample i holds i, 2 i and -2 i.
fn vectors() -> Sample {
    let tuple = |i: i16| [i, 2 * i, -2 * i].map(i16::to_be_bytes).concat();
    let data: Vec<u8> = (1..=24).flat_map(tuple).collect();
    local("vectors", "MET_SHORT", "ElementNumberOfChannels = 3\nBinaryDataByteOrderMSB = True\n", &data)
}

/// A file with all that places it.
fn placed(more: &str) -> Sample {
    local("placed", "MET_UCHAR", more, &bytes())
}

pub fn samples() -> Vec<Sample> {
    let mut all = same();
    all.push(vectors());
    all.push(placed(
        "ElementSpacing = -2 0.5 1e1\nOrigin = 1 -2 3.5\nRotation = 0 1 0 -1 0 0 0 0 1\nCenterOfRotation = 1 2 3\n\
         AnatomicalOrientation = PRI\nElementToIntensityFunctionSlope = 2\nElementToIntensityFunctionOffset = -1\n",
    ));
    all
}

#[test]
fn every_way_to_keep_the_data_holds_the_same() {
    for sample in same() {
        let loaded = sample.loaded();
        assert_eq!(loaded.report.format, "MetaImage", "{}", sample.what);
        assert_eq!(loaded.report.warnings, [""; 0], "{}", sample.what);
        assert!(loaded.report.arrays.is_empty(), "{}", sample.what);
        let grid = grid(loaded);
        assert_eq!(grid.dims(), [4, 3, 2], "{}", sample.what);
        assert_eq!(stored(&grid), values(), "{}", sample.what);
        assert_eq!(grid.index_to_world(), DMat3::IDENTITY, "{}", sample.what);
        assert_eq!((grid.origin(), grid.anatomy()), (DVec3::ZERO, Anatomy::Unknown), "{}", sample.what);
    }
}

#[test]
fn every_type_in_both_byte_orders() {
    for (name, little, big) in [
        ("MET_CHAR", vec![0xfe], vec![0xfe]),
        ("MET_SHORT", vec![0xfe, 0xff], vec![0xff, 0xfe]),
        ("MET_INT", vec![0xfe, 0xff, 0xff, 0xff], vec![0xff, 0xff, 0xff, 0xfe]),
        ("MET_LONG", vec![0xfe, 0xff, 0xff, 0xff], vec![0xff, 0xff, 0xff, 0xfe]),
        ("MET_LONG_LONG", (-2_i64).to_le_bytes().to_vec(), (-2_i64).to_be_bytes().to_vec()),
        ("MET_FLOAT", (-2_f32).to_le_bytes().to_vec(), (-2_f32).to_be_bytes().to_vec()),
        ("MET_DOUBLE", (-2_f64).to_le_bytes().to_vec(), (-2_f64).to_be_bytes().to_vec()),
        ("MET_UCHAR", vec![254], vec![254]),
        ("MET_USHORT", vec![254, 0], vec![0, 254]),
        ("MET_UINT", vec![254, 0, 0, 0], vec![0, 0, 0, 254]),
        ("MET_ULONG", vec![254, 0, 0, 0], vec![0, 0, 0, 254]),
        ("MET_ULONG_LONG", 254_u64.to_le_bytes().to_vec(), 254_u64.to_be_bytes().to_vec()),
    ] {
        let value = if name.starts_with("MET_U") { 254.0 } else { -2.0 };
        for (more, bytes) in [
            ("", &little),
            ("BinaryDataByteOrderMSB = False\n", &little),
            ("BinaryDataByteOrderMSB = True\n", &big),
            ("ElementByteOrderMSB = true\n", &big),
        ] {
            let grid = grid(local("types", name, more, &bytes.repeat(24)).loaded());
            assert_eq!(stored(&grid), [value; 24], "{name} {more}");
        }
    }
}

#[test]
fn components_are_chosen() {
    let read = |array: Option<&str>| {
        let options = ReadOptions { array: array.map(str::to_owned), ..OPTIONS };
        vectors().read(&options).unwrap()
    };
    let loaded = read(None);
    assert_eq!(loaded.report.shown.as_deref(), Some("point:values:magnitude"));
    assert_eq!(loaded.report.arrays[0].to_string(), "point:values (i16 x 3)");
    assert_eq!(stored(&grid(loaded)), values().map_each(|v| 3.0 * v));
    let loaded = read(Some("values:z"));
    assert_eq!(loaded.report.shown.as_deref(), Some("point:values:2"));
    assert!(matches!(grid(loaded.clone()).samples(), Samples::I16(_)));
    assert_eq!(stored(&grid(loaded)), values().map_each(|v| -2.0 * v));
    let wrong = |array: &str| {
        let options = ReadOptions { array: Some(array.to_owned()), ..OPTIONS };
        vectors().read(&options).unwrap_err().to_string()
    };
    assert!(wrong("values:3").contains("below 3"));
    assert!(wrong("density").contains("there are point:values (i16 x 3)"));
    let options = ReadOptions { radius: Some("values".into()), ..OPTIONS };
    assert!(vectors().read(&options).unwrap_err().to_string().contains("a grid has no radius"));
}

trait MapEach {
    fn map_each(self, f: impl Fn(f64) -> f64) -> Vec<f64>;
}

impl MapEach for Vec<f64> {
    fn map_each(self, f: impl Fn(f64) -> f64) -> Vec<f64> {
        self.into_iter().map(f).collect()
    }
}

#[test]
fn rows_of_the_matrix_are_the_directions_of_the_axes() {
    // As SimpleITK writes an image whose direction matrix has these numbers as columns.
    let more = "TransformMatrix = 0.6 0.8 0 -0.48 0.36 0.8 0.64 -0.48 0.6\nOffset = 10 20 30\nElementSpacing = 1 2 3\n";
    let grid = grid(placed(more).loaded());
    let x = grid.world_of_index(DVec3::X) - grid.origin();
    assert!(x.distance(DVec3::new(0.6, 0.8, 0.0)) < 1e-12);
    let y = grid.world_of_index(DVec3::Y) - grid.origin();
    assert!(y.distance(2.0 * DVec3::new(-0.48, 0.36, 0.8)) < 1e-12);
    let z = grid.world_of_index(DVec3::Z) - grid.origin();
    assert!(z.distance(3.0 * DVec3::new(0.64, -0.48, 0.6)) < 1e-12);
    assert_eq!(grid.origin(), DVec3::new(10.0, 20.0, 30.0));
}

#[test]
fn all_names_place_alike() {
    let all = |names: [&str; 3], more: &str| {
        let [spacing, origin, matrix] = names;
        let sample =
            placed(&format!("{spacing} = 2 3 4\n{origin} = 5 6 7\n{matrix} = 0 1 0 -1 0 0 0 0 1\n{more}"));
        let loaded = sample.loaded();
        assert_eq!(loaded.report.warnings, [""; 0]);
        let grid = grid(loaded);
        assert_eq!(grid.world_of_index(DVec3::ONE), DVec3::new(5.0 - 3.0, 6.0 + 2.0, 7.0 + 4.0), "{names:?}");
    };
    all(["ElementSpacing", "Offset", "TransformMatrix"], "ElementSize = 9 9 9\n");
    all(["ElementSize", "Position", "Rotation"], "Offset = 5 6 7.0\n");
    all(["ElementSpacing", "Origin", "Orientation"], "Rotation = 0 1 0 -1 0 0 0 0 1\n");
}

#[test]
fn what_is_odd_is_told() {
    let loaded = placed("ElementSpacing = 1 -2 3\nCenterOfRotation = 0 0 7\n").loaded();
    assert_eq!(
        loaded.report.notes,
        ["a negative spacing reverses its axis", "CenterOfRotation [0, 0, 7] does not move the image"]
    );
    assert_eq!(grid(loaded).world_of_index(DVec3::ONE), DVec3::new(1.0, -2.0, 3.0));
    let packed = zlib(&bytes());
    let stale = "CompressedData = True\nCompressedDataSize = 5\n";
    let loaded = local("stale size", "MET_UCHAR", stale, &packed).loaded();
    assert!(loaded.report.warnings[0].contains(&format!("CompressedDataSize 5: {} bytes", packed.len())));
    assert_eq!(stored(&grid(loaded)), values());
}

#[test]
fn an_orientation_makes_the_world_that_of_patients() {
    let read = |more: &str| {
        let loaded = placed(more).loaded();
        (grid(loaded.clone()).anatomy(), loaded.report.warnings)
    };
    let fits = |more: &str| assert_eq!(read(more), (Anatomy::Lps, Vec::new()), "{more}");
    let none = |more: &str| assert_eq!(read(more), (Anatomy::Unknown, Vec::new()), "{more}");
    none("");
    none("AnatomicalOrientation = ???\n");
    none("AnatomicalOrientation =\n");
    fits("AnatomicalOrientation = RAI\n");
    // As SimpleITK names these directions.
    fits("AnatomicalOrientation = LAI\nTransformMatrix = -1 0 0 0 1 0 0 0 1\n");
    fits("AnatomicalOrientation = ASR\nTransformMatrix = 0 1 0 0 0 -1 1 0 0\n");
    fits("AnatomicalOrientation = LAI\nElementSpacing = -1 1 1\n");
    let (anatomy, warnings) = read("AnatomicalOrientation = LPS\n");
    assert_eq!(anatomy, Anatomy::Lps);
    assert!(warnings[0].contains("LPS does not fit the directions"), "{warnings:?}");
    for wrong in ["RAR", "RA", "up", "RAIS"] {
        let (anatomy, warnings) = read(&format!("AnatomicalOrientation = {wrong}\n"));
        assert_eq!(anatomy, Anatomy::Unknown);
        assert!(warnings[0].contains(&format!("\"{wrong}\": no orientation")), "{warnings:?}");
    }
}

#[test]
fn intensities_are_rescaled() {
    let both = "ElementToIntensityFunctionSlope = -2\nElementToIntensityFunctionOffset = 5\nElementMin = 3\n";
    let grid_ = grid(placed(both).loaded());
    assert_eq!(grid_.rescale(), Rescale { slope: -2.0, intercept: 5.0 });
    assert_eq!(grid_.value(1, 0, 0), 1.0);
    assert_eq!(grid_.range(), [-43.0, 3.0]);
    let vector = |more: &str| {
        let data: Vec<u8> = (1..=24).flat_map(|i| [3 * i, 4 * i]).collect();
        local("rescaled vectors", "MET_UCHAR", &format!("ElementNumberOfChannels = 2\n{more}"), &data)
    };
    // The length of a turned vector is not negative.
    let turned = grid(vector("ElementToIntensityFunctionSlope = -2\n").loaded());
    assert_eq!(turned.range(), [10.0, 240.0]);
    vector(both).refused(&["ElementToIntensityFunctionOffset", "choose a component, such as values:0"]);
    let options = ReadOptions { array: Some("values:1".into()), ..OPTIONS };
    assert_eq!(grid(vector(both).read(&options).unwrap()).value(0, 0, 0), -3.0);
}

#[test]
fn what_breaks_a_rule_is_refused_by_place() {
    let with = |more: &str, parts: &[&str]| local("more", "MET_UCHAR", more, &bytes()).refused(parts);
    let swap = |from: &str, to: &str, parts: &[&str]| {
        let text = String::from_utf8(header("MET_UCHAR", "", "LOCAL")).unwrap().replace(from, to);
        Sample::one("swapped", "a.mha", [text.as_bytes(), &bytes()].concat()).refused(parts);
    };
    let file = |name: &str, parts: &[&str]| {
        Sample::one("named", "a.mhd", header("MET_UCHAR", "", name)).with("s1.raw", [0; 12]).refused(parts);
    };
    swap("ObjectType = Image", "ObjectType = Tube", &["line 1, ObjectType", "\"Tube\"", "must be Image"]);
    swap("NDims = 3", "NDims = 2", &["line 2, NDims", "\"2\"", "a volume has 3"]);
    swap("NDims = 3\n", "", &["NDims", "missing"]);
    swap("DimSize", "DimSizes", &["DimSize", "missing"]);
    swap("DimSize", "dimsize", &["line 3", "dimsize: must be spelt DimSize"]);
    swap("ElementType = MET_UCHAR\n", "", &["ElementType", "missing"]);
    swap("ElementDataFile = LOCAL\n", "", &["line"]);
    swap("4 3 2", "4 3", &["line 3, DimSize", "2 numbers", "needs 3"]);
    swap("4 3 2", "4 3 0", &["\"0\"", "whole number from 1"]);
    swap("4 3 2", "4 3 -2", &["\"-2\""]);
    swap("4 3 2", "24 1 1", &["DimSize", "at least 2"]);
    swap("4 3 2", "4 3 3", &["needs 36 bytes", "24 are there"]);
    swap("4 3 2", "4 2 2", &["needs 16 bytes", "24 are there"]);
    swap("4 3 2", "4000 4000 4000", &["DimSize", "limit is 1073741824"]);
    swap("NDims = 3", "NDims = 4", &["3 numbers: NDims 4 needs 4"]);
    swap("NDims = 3\nDimSize = 4 3 2", "NDims = 4\nDimSize = 2 3 2 2", &["last extent of 2", "must be 1"]);
    swap("MET_UCHAR", "MET_UCHAR_ARRAY", &["ElementType", "MET_UCHAR_ARRAY", "must be MET_CHAR"]);
    with("BinaryData = maybe\n", &["line 3, BinaryData", "\"maybe\"", "True or False"]);
    with("BinaryData = False\nCompressedData = True\n", &["CompressedData", "text data"]);
    with(
        "BinaryDataByteOrderMSB = 0\nElementByteOrderMSB = 1\n",
        &["must not differ from BinaryDataByteOrderMSB"],
    );
    with("ElementSpacing = 1 2\n", &["line 3, ElementSpacing", "\"1 2\"", "3 numbers"]);
    with("ElementSpacing = 1 2 x\n", &["ElementSpacing", "3 numbers"]);
    with("ElementSpacing = 1 0 1\n", &["line 3, ElementSpacing", "positive"]);
    with("ElementSize = 1 nan 1\n", &["line 3, ElementSize", "positive"]);
    with("Position = 1 inf 1\n", &["line 3, Position", "finite"]);
    with("Offset = 1 2 3\nOrigin = 1 2 4\n", &["line 4, Origin", "must not differ from Offset"]);
    with("Rotation = 1 0 0 0 1 0 0 0\n", &["Rotation", "9 numbers"]);
    with("Rotation = 1 0 0 0 1 0 1 1 0\n", &["line 3, Rotation", "span space"]);
    with("CenterOfRotation = 1\n", &["CenterOfRotation", "3 numbers"]);
    with("ElementNumberOfChannels = 0\n", &["line 3, ElementNumberOfChannels", "at least 1"]);
    with("ElementNumberOfChannels = 9999999\n", &["ElementNumberOfChannels", "must be 1 to 1024"]);
    with("ElementNumberOfChannels = 2\n", &["needs 48 bytes", "24 are there"]);
    with("ElementToIntensityFunctionSlope = 0\n", &["ElementToIntensityFunctionSlope", "not zero"]);
    with("HeaderSize = -2\n", &["HeaderSize", "at least -1"]);
    with("HeaderSize = 3\n", &["HeaderSize", "3", "within the header"]);
    with("HeaderSize = 99999\n", &["needs 24 bytes", "0 are there"]);
    with("HeaderSize = -1\nCompressedData = True\n", &["HeaderSize", "without compression"]);
    with("CompressedData = True\n", &["zlib stream is damaged"]);
    with("CompressedDataSize = x\n", &["CompressedDataSize", "whole number"]);
    with("NDims = 3\n", &["line 3", "given before, on line 2"]);
    with("what is this\n", &["line 3", "key = value"]);
    with("BinaryData = False\n", &["needs 24 numbers"]);
    file("", &["ElementDataFile", "empty"]);
    file("none.raw", &["none.raw", "cannot open"]);
    file("LIST 7", &["\"7\"", "1 to 3 axes"]);
    file("LIST 2 3", &["must be LIST"]);
    file("LIST", &["0 files", "need 2"]);
    file("s%d.raw 1 3 1", &["3 files", "need 2"]);
    file("s%d.raw 1 2 0", &["step must not be 0"]);
    file("s%d.raw 1 2 -1", &["leads away"]);
    // From that number on, as many as there are slices.
    file("s%d.raw 1", &["s2.raw", "cannot open"]);
    file("s%d.raw 9223372036854775807", &["1 files", "need 2"]);
    file("s%d.raw 1 2 1", &["s2.raw", "cannot open"]);
    file("s1.raw", &["s1.raw", "needs 24 bytes", "12 are there"]);
    file("s1.raw\nElementSpacing = 1 2 3", &["line 6", "must be the last key"]);
    let mixed = [
        b"NDims = 4\nDimSize = 4 3 2 1\nRotation = 1 0 0 0 0 1 0 0 0 0 1 2 0 0 0 1\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n".as_slice(),
        &bytes(),
    ];
    Sample::one("mixed", "a.mha", mixed.concat()).refused(&["line 3, Rotation", "2: the fourth axis"]);
    let bomb = zlib(&vec![0; 1 << 20]);
    local("a bomb", "MET_UCHAR", "CompressedData = True\n", &bomb).refused(&["needs 24 bytes", "holds more"]);
    let cut = &zlib(&bytes())[..20];
    local("cut", "MET_UCHAR", "CompressedData = True\n", cut).refused(&["needs 24 bytes"]);
    let endless = [b"NDims = 3\n".to_vec(), b"Comment = padding\n".repeat(70_000)].concat();
    Sample::one("endless", "a.mha", endless).refused(&["ElementDataFile", "missing"]);
    Sample::one("empty", "a.mha", "").refused(&["ElementDataFile", "missing"]);
}

#[test]
fn content_is_known_by_its_keys() {
    let sample = &same()[0];
    let files = [("anything", sample.files[0].1.as_slice())];
    assert_eq!(read_memory(&files, &OPTIONS).unwrap().report.format, "MetaImage");
}

#[test]
fn real_files_have_their_known_sizes_and_ranges() {
    for (name, dims, spacing, range, warnings) in [
        ("structured/head_mr/HeadMRVolume.mhd", [48, 62, 42], DVec3::splat(4.0), [0.0, 255.0], 0),
        ("structured/frog_labels/frogtissue.mhd", [500, 470, 136], DVec3::new(1.0, 1.0, 1.5), [0.0, 29.0], 1),
        (
            "structured/heart_mask/mask.mhd",
            [512, 512, 317],
            DVec3::new(0.361328, 0.361328, 0.5),
            [0.0, 1.0],
            0,
        ),
        ("format_conformance/head_i16.mha", [64, 64, 40], DVec3::new(3.2, 3.2, 1.5), [-1024.0, 2902.0], 0),
        ("format_conformance/head_i16_be.mhd", [64, 64, 40], DVec3::new(3.2, 3.2, 1.5), [-1024.0, 2902.0], 0),
    ] {
        let Some(loaded) = shared_loaded(name) else { return };
        // The labels' CompressedDataSize is that of another file.
        assert_eq!(loaded.report.warnings.len(), warnings, "{name}");
        let grid = grid(loaded);
        assert_eq!(grid.dims(), dims, "{name}");
        assert!(grid.spacing().distance(spacing) < 1e-6, "{name}");
        assert_eq!(grid.range(), range, "{name}");
    }
}

#[test]
fn the_conformance_head_is_that_of_the_reference() {
    let Some(reference) = shared("format_conformance/head_i16.npy") else { return };
    let reference = stored(&grid(read(reference, &OPTIONS).unwrap()));
    for name in ["head_i16.mha", "head_i16_be.mhd"] {
        let Some(loaded) = shared_loaded(&format!("format_conformance/{name}")) else { return };
        let grid = grid(loaded);
        assert!(stored(&grid) == reference, "{name}");
        assert_eq!(grid.origin(), DVec3::new(-100.0, 20.5, 7.25), "{name}");
    }
}
