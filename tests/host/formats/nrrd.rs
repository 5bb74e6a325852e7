//! NRRD: what it has beyond one raw or gzip file of numbers, which `tests/host/io.rs` covers.

use glam::{DMat3, DVec3};
use volraster::io::{ReadOptions, read};
use volraster::scene::Anatomy;

use super::support::{OPTIONS, Sample, grid, gzip, shared, shared_loaded, stored};

fn header(kind: &str, sizes: &str, more: &str) -> String {
    let rank = sizes.split(' ').count();
    format!("NRRD0005\ntype: {kind}\ndimension: {rank}\nsizes: {sizes}\n{more}")
}

fn bytes() -> Vec<u8> {
    (1..=24).collect()
}

fn values() -> Vec<f64> {
    (1..=24).map(f64::from).collect()
}

fn attached(what: &'static str, kind: &str, sizes: &str, more: &str, data: &[u8]) -> Sample {
    Sample::one(what, "a.nrrd", [header(kind, sizes, more).as_bytes(), b"\n", data].concat())
}

fn words() -> Vec<u8> {
    values().iter().map(|value| format!(" {value}")).collect::<String>().into_bytes()
}

/// Files that all hold 1 to 24.
fn same() -> Vec<Sample> {
    let half = |at: usize| bytes()[12 * at..12 * at + 12].to_vec();
    let detached = |what, more: &str| Sample::one(what, "a.nhdr", header("uchar", "4 3 2", more));
    let two = |what, more: &str| {
        let more = format!("encoding: raw\n{more}");
        detached(what, &more).with("s1.raw", half(0)).with("s2.raw", half(1))
    };
    let long = |order: fn(i64) -> [u8; 8]| (1..=24).flat_map(order).collect::<Vec<u8>>();
    vec![
        attached("ascii", "uchar", "4 3 2", "encoding: ascii\n", &words()),
        attached("text of floats", "float", "4 3 2", "encoding: text\n", &words()),
        attached("txt of longs", "long long", "4 3 2", "encoding: txt\n", &words()),
        attached(
            "text after lines",
            "short",
            "4 3 2",
            "encoding: ascii\nline skip: 1\nbyte skip: 3\n",
            &[b"1 2 3\nabc".as_slice(), &words()].concat(),
        ),
        attached("longs", "int64", "4 3 2", "encoding: raw\nendian: big\n", &long(i64::to_be_bytes)),
        attached(
            "unsigned longs",
            "ulonglong",
            "4 3 2",
            "encoding: raw\nendian: little\n",
            &long(i64::to_le_bytes),
        ),
        attached(
            "four axes",
            "uchar",
            "4 3 2 1",
            "encoding: raw\nkinds: domain domain domain time\n",
            &bytes(),
        ),
        attached(
            "five axes",
            "uchar",
            "1 4 3 2 1",
            "encoding: raw\nkinds: stub space space space list\n",
            &bytes(),
        ),
        attached(
            "an axis without direction",
            "uchar",
            "4 3 2 1",
            "encoding: raw\nspace dimension: 3\nspace directions: (1,0,0) (0,1,0) (0,0,1) none\n",
            &bytes(),
        ),
        two("a list", "data file: LIST\ns1.raw\n./s2.raw\n"),
        two("a list of slices", "data file: LIST 2\ns1.raw\ns2.raw\n\nnot read\n"),
        two("a list of slabs", "data file: LIST 3\ns1.raw\ns2.raw"),
        two("a pattern", "data file: s%d.raw 1 2 1\n"),
        two("a pattern of slices", "data file: ./s%01u.raw 1 2 1 2\n"),
        two("a pattern of slabs", "data file: s%d.raw 1 2 1 3\n"),
        detached("a falling pattern", "encoding: raw\ndata file: s%03d.raw 3 1 -2\n")
            .with("s003.raw", half(0))
            .with("s001.raw", half(1)),
        detached(
            "gzip in several files after lines",
            "encoding: gzip\nline skip: 1\nbyte skip: 2\ndata file: s%d.gz 1 2 1\n",
        )
        .with("s1.gz", [b"line\n".to_vec(), gzip(&[vec![0, 0], half(0)].concat())].concat())
        .with("s2.gz", [b"a longer line\n".to_vec(), gzip(&[vec![7, 7], half(1)].concat())].concat()),
        detached("ends of several files", "encoding: raw\nbyte skip: -1\ndata file: LIST\na\nb\n")
            .with("a", [vec![0; 5], half(0)].concat())
            .with("b", [vec![0; 9], half(1)].concat()),
        detached("text in several files", "encoding: ascii\ndata file: LIST\na\nb\n")
            .with("a", "1 2 3 4 5 6 7 8 9 10 11 12")
            .with("b", "13 14 15 16 17 18\n19 20 21 22 23 24\n"),
        detached("rows in files", "encoding: raw\ndata file: %d 0 5 1 1\n")
            .with("0", [1, 2, 3, 4])
            .with("1", [5, 6, 7, 8])
            .with("2", [9, 10, 11, 12])
            .with("3", [13, 14, 15, 16])
            .with("4", [17, 18, 19, 20])
            .with("5", [21, 22, 23, 24]),
        detached("a name with a percent sign", "encoding: raw\ndata file: s%d.raw\n")
            .with("s%d.raw", bytes()),
    ]
}

/// Sample i holds i, 2 i and 2 i.
fn vectors(what: &'static str, more: &str) -> Sample {
    let data: Vec<u8> = (1..=24).flat_map(|i| [i, 2 * i, 2 * i]).collect();
    attached(what, "uchar", "3 4 3 2", &format!("encoding: raw\n{more}"), &data)
}

fn vector_files() -> Vec<Sample> {
    let slices = |z: u8| (12 * z + 1..=12 * z + 12).flat_map(|i| [i, 2 * i, 2 * i]).collect::<Vec<u8>>();
    vec![
        vectors("vector", "kinds: vector domain domain domain\nspacings: nan 1 2 3\n"),
        vectors("colours", "kinds: RGB-color space space space\nspacings: NaN 1 2 3\n"),
        vectors("none", "space: LPS\nspace directions: none (1,0,0)(0,2,0) (0,0,3)\n"),
        Sample::one("several files", "a.nhdr", header("uchar", "3 4 3 2", "kinds: 3-vector domain domain domain\nspacings: nan 1 2 3\nencoding: raw\ndata file: s%d 0 1 1\n"))
            .with("s0", slices(0))
            .with("s1", slices(1)),
    ]
}

fn placed(more: &str) -> Sample {
    attached("placed", "uchar", "4 3 2", &format!("encoding: raw\n{more}"), &bytes())
}

pub fn samples() -> Vec<Sample> {
    let mut all = same();
    all.extend(vector_files());
    all.push(placed("space: LAS\nspace directions: (2,0,0) (0,0,1) (0,3,0)\nspace origin: (1,2,3)\n"));
    all.push(placed("axis mins: 1 2 3\naxis maxs: 5 8 7\ncenters: cell node ???\n"));
    all.push(attached("gzip", "ushort", "4 3 2", "encoding: gzip\nendian: big\n", &gzip(&[0, 3].repeat(24))));
    all
}

#[test]
fn every_way_to_keep_the_data_holds_the_same() {
    for sample in same() {
        let loaded = sample.loaded();
        assert_eq!(loaded.report.warnings, [""; 0], "{}", sample.what);
        assert!(loaded.report.arrays.is_empty(), "{}", sample.what);
        let grid = grid(loaded);
        assert_eq!(grid.dims(), [4, 3, 2], "{}", sample.what);
        assert_eq!(stored(&grid), values(), "{}", sample.what);
        assert_eq!(grid.index_to_world(), DMat3::IDENTITY, "{}", sample.what);
    }
}

#[test]
fn components_lie_on_the_first_axis() {
    for sample in vector_files() {
        let loaded = sample.loaded();
        assert_eq!(loaded.report.shown.as_deref(), Some("point:values:magnitude"), "{}", sample.what);
        let lengths = grid(loaded);
        assert_eq!(stored(&lengths), values().iter().map(|v| 3.0 * v).collect::<Vec<_>>(), "{}", sample.what);
        assert_eq!(lengths.dims(), [4, 3, 2], "{}", sample.what);
        assert_eq!(lengths.spacing(), DVec3::new(1.0, 2.0, 3.0), "{}", sample.what);
        let options = ReadOptions { array: Some("values:x".into()), ..OPTIONS };
        assert_eq!(stored(&grid(sample.read(&options).unwrap())), values(), "{}", sample.what);
    }
}

#[test]
fn layers_and_opacities_have_no_length() {
    for (kind, count) in [("list", 3), ("RGBA-color", 4), ("HSV-color", 3)] {
        let text = format!(
            "NRRD0004\ntype: uchar\ndimension: 4\nsizes: {count} 4 3 2\nkinds: {kind} domain domain domain\n\
             encoding: raw\n\n"
        );
        let data: Vec<u8> = values()
            .iter()
            .flat_map(|&v| (0..count).map(move |i| if i == 0 { v as u8 } else { 255 }))
            .collect();
        let loaded = Sample::one(kind, "a.nrrd", [text.into_bytes(), data].concat()).loaded();
        assert_eq!(loaded.report.shown.as_deref(), Some("point:values:0"), "{kind}");
        assert!(loaded.report.warnings[0].contains("the first of"), "{kind}: {:?}", loaded.report.warnings);
        assert_eq!(stored(&grid(loaded)), values(), "{kind}");
    }
}

/// What teem writes beside what places samples, with and without blanks.
#[test]
fn every_field_of_the_format_is_known() {
    let more = "units: \"mm\" \"mm\" \"mm\"\nspacedirections: (1,0,0) (0,2,0) (0,0,3)\nspace: RAS\n\
                spaceorigin: (1,2,3)\nmeasurementframe: (1,0,0) (0,1,0) (0,0,1)\n";
    let grid = grid(placed(more).loaded());
    assert_eq!((grid.origin(), grid.spacing()), (DVec3::new(1.0, 2.0, 3.0), DVec3::new(1.0, 2.0, 3.0)));
}

#[test]
fn a_header_of_many_lines_is_read_in_time() {
    // Looked at once a line, the long value would be passed over a hundred thousand times: half an hour.
    let text = format!("NRRD0004\ndata file: {}\n{}", "x".repeat(500_000), "#\n".repeat(100_000));
    Sample::one("long", "a.nhdr", text).refused(&["type", "missing"]);
}

#[test]
fn axis_mins_place_what_nothing_else_does() {
    let read = |more: &str| {
        let loaded = placed(more).loaded();
        let notes = loaded.report.notes.clone();
        let grid = grid(loaded);
        (grid.world_of_index(DVec3::ZERO), grid.world_of_index(DVec3::ONE) - grid.origin(), notes.len())
    };
    let all = DVec3::new;
    // Samples are the centres of cells where nothing else is said.
    assert_eq!(
        read("axis mins: 10 20 30\nspacings: 1 2 -3\n"),
        (all(10.5, 21.0, 28.5), all(1.0, 2.0, -3.0), 1)
    );
    assert_eq!(
        read("axismins: 10 20 30\nspacings: 1 2 3\ncenters: node cell node\n"),
        (all(10.0, 21.0, 30.0), all(1.0, 2.0, 3.0), 1)
    );
    assert_eq!(
        read("axis mins: 0 0 0\naxis maxs: 4 4 4\ncenterings: cell node cell\n"),
        (all(0.5, 0.0, 1.0), all(1.0, 2.0, 2.0), 1)
    );
    // Where one is unknown there is no place.
    assert_eq!(read("axis mins: 10 nan 30\nspacings: 1 2 3\n"), (DVec3::ZERO, all(1.0, 2.0, 3.0), 0));
    assert_eq!(
        read("axis mins: 9 9 9\nspace dimension: 3\nspace origin: (1,2,3)\n"),
        (all(1.0, 2.0, 3.0), DVec3::ONE, 0)
    );
    let directed = "space: RAS\nspace directions: (1,0,0) (0,1,0) (0,0,1)\naxis mins: 9 9 9\n";
    assert_eq!(read(directed), (DVec3::ZERO, DVec3::ONE, 0));
}

#[test]
fn spacings_in_a_space_are_taken_and_told() {
    let loaded = placed("space: left-posterior-superior\nspacings: 3 2 1\nspace origin: (1,2,3)\n").loaded();
    assert_eq!(loaded.report.warnings.len(), 1);
    assert!(loaded.report.warnings[0].contains("spacings in a space (left-posterior-superior)"));
    let grid = grid(loaded);
    assert_eq!((grid.spacing(), grid.origin()), (DVec3::new(3.0, 2.0, 1.0), DVec3::new(1.0, 2.0, 3.0)));
    assert_eq!(grid.anatomy(), Anatomy::Lps);
}

#[test]
fn what_breaks_a_rule_is_refused_by_place() {
    let with = |more: &str, parts: &[&str]| placed(more).refused(parts);
    let sized = |sizes: &str, more: &str, parts: &[&str]| {
        attached("sized", "uchar", sizes, &format!("encoding: raw\n{more}"), &bytes()).refused(parts);
    };
    let files = |more: &str, parts: &[&str]| {
        Sample::one("files", "a.nhdr", header("uchar", "4 3 2", &format!("encoding: raw\n{more}")))
            .with("s1.raw", [0; 12])
            .refused(parts);
    };
    sized("2 3 4 2", "", &["line 4, sizes", "2 on axis 4", "kind such as vector, or direction none"]);
    sized(
        "2 3 2 2",
        "kinds: domain domain domain vector\n",
        &["kinds", "\"vector\" on axis 4", "first axis"],
    );
    sized("3 2 2 2", "kinds: vector domain RGB-color domain\n", &["kinds", "\"RGB-color\" on axis 3"]);
    sized(
        "2 3 2 2",
        "kinds: RGB-color domain domain domain\n",
        &["kinds", "RGB-color: has 3 components, not 2"],
    );
    sized("3 2 2 2", "kinds: vector domain domain\n", &["kinds", "3 kinds: dimension 4 needs 4"]);
    sized(
        "2 2 3 2",
        "space dimension: 3\nspace directions: (1,0,0) none (0,1,0) (0,0,1)\n",
        &["sizes", "2 on axis 4"],
    );
    sized(
        "2 3 2 2 1",
        "kinds: vector domain domain domain domain\nspace dimension: 3\nspace directions: none (1,0,0) none (0,1,0) (0,0,1)\n",
        &["space directions", "none"],
    );
    sized("3 4 2 1", "kinds: vector domain domain domain\n", &["at least 2"]);
    sized("2000 2 2 2", "kinds: vector domain domain domain\n", &["2000 components: must be 1 to 1024"]);
    sized("1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1", "", &["line 3, dimension", "at most 16"]);
    sized("4 6", "", &["line 3, dimension", "\"2\"".trim_matches('"'), "a volume has 3"]);
    with("kinds: vector domain domain\n", &["kinds", "\"vector\"", "all three axes"]);
    with("axis mins: 1 2\n", &["line 6, axis mins", "3 numbers"]);
    with("axis mins: inf 2 3\n", &["finite"]);
    with("axis mins: 1 2 3\naxis maxs: 1 3 4\n", &["line 4, sizes", "positive"]);
    let text = |data: &str, parts: &[&str]| {
        attached("text", "uchar", "4 3 2", "encoding: ascii\n", data.as_bytes()).refused(parts);
    };
    let full = String::from_utf8(words()).unwrap();
    text(&full.replace(" 24", ""), &["needs 24 numbers: there are fewer"]);
    text(&format!("{full} 25"), &["\"25\"", "more numbers than announced"]);
    text(&full.replace(" 7 ", " 7.5 "), &["\"7.5\": must be a number of type u8"]);
    text(&full.replace(" 7 ", " 256 "), &["\"256\""]);
    let encoded = |encoding: &str, parts: &[&str]| {
        attached("encoded", "uchar", "4 3 2", &format!("encoding: {encoding}\n"), &bytes()).refused(parts);
    };
    encoded("hex", &["line 5, encoding", "\"hex\"", "are supported"]);
    encoded("bzip2", &["\"bzip2\""]);
    encoded("ascii\nbyte skip: -1", &["byte skip", "raw"]);
    files("data file: LIST\n", &["data file", "0 files", "several files of 2 axes needs 2"]);
    files("data file: LIST 4\ns1.raw\n", &["\"4\"", "1 to 3 axes"]);
    files("data file: LIST\ns1.raw\ns1.raw\ns1.raw\n", &["3 files", "needs 2"]);
    files("data file: LIST\ns1.raw\ns2.raw\n", &["s2.raw", "cannot open"]);
    files("data file: LIST 3\na\nb\nc\n", &["3 files", "divisor of the last size, 2"]);
    files("data file: s%d.raw 1 9 1\n", &["9 files", "needs 2"]);
    files("data file: s%d.raw 1 2 -1\n", &["leads away"]);
    files("data file: s%d.raw 1 2 0\n", &["step must not be 0"]);
    files("data file: s%d.raw 1 2 1 9\n", &["\"9\"", "1 to 3 axes"]);
    files("data file: s%d.raw -9223372036854775808 9223372036854775807 1\n", &["18446744073709551615 files"]);
    files("data file: s%d.raw 1 2 x\n", &["s%d.raw 1 2 x", "cannot open"]);
    files("data file:\n", &["data file", "empty"]);
    files("data file: s1.raw\n", &["needs 24 bytes", "12 are there"]);
    files("data file: LIST\ns1.raw\ns1.raw\nendian: big\n", &["3 files"]);
    let long = gzip(&[vec![b'x'; 1 << 20], vec![1; 12]].concat());
    let names = "z\n".repeat(600);
    let more = format!("encoding: gzip\nbyte skip: 1048576\ndata file: LIST\n{names}");
    Sample::one("skips", "a.nhdr", header("uchar", "4 3 600", &more))
        .with("z", long)
        .refused(&["byte skip", "269484032 bytes in 257 files: the limit is 268435456"]);
    let lines = [b"line\n".repeat(1 << 18), vec![1; 12]].concat();
    let more = format!("encoding: raw\nline skip: 262144\ndata file: LIST\n{names}");
    Sample::one("line skips", "a.nhdr", header("uchar", "4 3 600", &more))
        .with("z", lines)
        .refused(&["line skip", "the limit is 268435456"]);
    Sample::one("a short file", "a.nhdr", header("uchar", "4 3 2", "encoding: raw\ndata file: LIST\na\nb\n"))
        .with("a", [0; 12])
        .with("b", [0; 11])
        .refused(&["b: data at byte 0", "needs 12 bytes", "11 are there"]);
}

#[test]
fn real_files_have_their_known_sizes_and_ranges() {
    for (name, dims, spacing, range, warnings) in [
        ("structured/tooth/tooth.nhdr", [103, 94, 161], DVec3::ONE, [0.0, 1300.0], 0),
        ("structured/fetal_T2.nrrd", [117, 159, 126], DVec3::splat(0.859375), [0.0, 710.6776], 0),
        ("structured/headsq/quarter.nhdr", [64, 64, 93], DVec3::new(3.2, 3.2, 1.5), [0.0, 3926.0], 1),
        (
            "format_conformance/head_i16_be_raw.nrrd",
            [64, 64, 40],
            DVec3::new(3.2, 3.2, 1.5),
            [-1024.0, 2902.0],
            0,
        ),
        (
            "format_conformance/head_i16_gzip.nrrd",
            [64, 64, 40],
            DVec3::new(3.2, 3.2, 1.5),
            [-1024.0, 2902.0],
            0,
        ),
    ] {
        let Some(loaded) = shared_loaded(name) else { return };
        assert_eq!(loaded.report.warnings.len(), warnings, "{name}");
        let grid = grid(loaded);
        assert_eq!(grid.dims(), dims, "{name}");
        assert!(grid.spacing().distance(spacing) < 1e-6, "{name}");
        assert!((grid.range()[0] - range[0]).abs() + (grid.range()[1] - range[1]).abs() < 1e-3, "{name}");
    }
}

#[test]
fn the_head_in_93_files_holds_the_conformance_head() {
    let Some(whole) = shared_loaded("structured/headsq/quarter.nhdr") else { return };
    let whole = grid(whole);
    for name in ["head_i16.npy", "head_i16_be_raw.nrrd", "head_i16_gzip.nrrd"] {
        let Some(path) = shared(&format!("format_conformance/{name}")) else { return };
        // Slices 21 to 60 from 1, less 1024.
        let part: Vec<f64> = stored(&whole)[20 * 4096..60 * 4096].iter().map(|v| v - 1024.0).collect();
        assert!(stored(&grid(read(path, &OPTIONS).unwrap())) == part, "{name}");
    }
}
