//! Raw samples by name and by JSON.

use glam::{DMat3, DVec3};
use volraster::io::scene_file::LoadedScene;
use volraster::io::{Endian, ReadOptions, read};
use volraster::scene::Samples;

use super::support::{Folder, OPTIONS, Sample, assert_refusal, grid, gzip, shared, stored};

fn bytes() -> Vec<u8> {
    (1..=24).collect()
}

fn values() -> Vec<f64> {
    (1..=24).map(f64::from).collect()
}

/// 1 to 24 in a type of so many bytes.
fn wide(size: usize, endian: Endian) -> Vec<u8> {
    let number = |i: u8| {
        let mut bytes = vec![0; size];
        bytes[if endian == Endian::Little { 0 } else { size - 1 }] = i;
        bytes
    };
    (1..=24).flat_map(number).collect()
}

fn floats(endian: Endian) -> Vec<u8> {
    let number = |i: u8| match endian {
        Endian::Little => f32::from(i).to_le_bytes(),
        Endian::Big => f32::from(i).to_be_bytes(),
    };
    (1..=24).flat_map(number).collect()
}

/// Files of 4 x 3 x 2 samples 1 to 24 without placement.
fn same() -> Vec<Sample> {
    use Endian::{Big, Little};
    let mut all: Vec<Sample> = [
        ("a_4x3x2_uint8.raw", bytes()),
        ("4X3X2-U8.RAW", bytes()),
        ("a.4x3x2.uchar.raw", bytes()),
        ("v1.2_a 4x3x2 int8.raw", bytes()),
        ("binned 2x2_4x3x2_byte.raw", bytes()),
        ("a_4x3x2_u8.raw.gz", gzip(&bytes())),
        ("uint16_4x3x2.raw", wide(2, Little)),
        ("a_4x3x2_int16_le.raw", wide(2, Little)),
        ("a_4x3x2_int16_be.raw", wide(2, Big)),
        ("a-4x3x2-u16be.raw", wide(2, Big)),
        ("a.4x3x2.short.big.raw", wide(2, Big)),
        ("short_story_4x3x2_int32.raw", wide(4, Little)),
        ("a_4x3x2_u32_big.raw", wide(4, Big)),
        ("a_4x3x2_uint64_little.raw", wide(8, Little)),
        ("a_4x3x2_i64be.raw", wide(8, Big)),
        ("a_4x3x2_float32.raw", floats(Little)),
        ("a_4x3x2_float_be.raw", floats(Big)),
        ("a_4x3x2_f32.raw", floats(Little)),
        // A word elsewhere is a word.
        ("to_be_4x3x2_i16.raw", wide(2, Little)),
    ]
    .into_iter()
    .map(|(name, bytes)| Sample::one("by name", name, bytes))
    .collect();
    all.push(
        Sample::one("by JSON", "a.raw", wide(2, Big))
            .with("a.json", r#"{"dims": [4, 3, 2], "type": "int16", "endian": "big"}"#),
    );
    all.push(
        Sample::one("JSON wins over the name", "a_2x2x2_u8.raw", wide(2, Little))
            .with("a_2x2x2_u8.json", r#"{"dims": [4, 3, 2], "type": "u16", "file": "a_2x2x2_u8.raw"}"#),
    );
    all.push(Sample::one("a scene beside it says nothing of it", "a_4x3x2_u8.raw", bytes()).with(
        "a_4x3x2_u8.json",
        r#"{"volume": {"file": "a_4x3x2_u8.raw", "dims": [9, 9, 9], "type": "u8"}}"#,
    ));
    all.push(
        Sample::one("JSON itself", "a.json", r#"{"dims": [4, 3, 2], "type": "U8"}"#).with("a.raw", bytes()),
    );
    all.push(
        Sample::one("JSON of a packed file", "a.json", r#"{"dims": [4, 3, 2], "type": "u8"}"#)
            .with("a.raw.gz", gzip(&bytes())),
    );
    all.push(
        Sample::one(
            "JSON that names a file",
            "a.json",
            r#"{"file": "b.dat", "dims": [4, 3, 2], "type": "f32", "offset": 3}"#,
        )
        .with("b.dat", [b"abc".as_slice(), &floats(Endian::Little)].concat()),
    );
    all
}

pub fn samples() -> Vec<Sample> {
    let mut all = same();
    all.push(Sample::one("spacing in the name", "a_4x3x2_u8_0.5x0.5x1.0.raw", bytes()));
    all.push(
        Sample::one("all keys", "a.json", r#"{"file": "b.raw", "dims": [4, 3, 2], "type": "u8", "endian": "little", "spacing": [1, 2, 3], "origin": [5, 6, 7], "direction": [0, -1, 0, 1, 0, 0, 0, 0, 1], "offset": 0}"#)
            .with("b.raw", bytes()),
    );
    all
}

#[test]
fn names_and_json_tell_the_layout() {
    for sample in same() {
        let name = &sample.files[0].0;
        let loaded = sample.loaded();
        assert_eq!(loaded.report.format, "raw samples", "{name}");
        let grid = grid(loaded);
        assert_eq!(grid.dims(), [4, 3, 2], "{name}");
        assert_eq!(stored(&grid), values(), "{name}");
        assert_eq!((grid.index_to_world(), grid.origin()), (DMat3::IDENTITY, DVec3::ZERO), "{name}");
    }
}

#[test]
fn what_a_name_leaves_open_is_told() {
    let notes = |name: &str, bytes: Vec<u8>| Sample::one("notes", name, bytes).loaded().report.notes;
    assert_eq!(notes("a_4x3x2_u8.raw", bytes()), ["layout from the name: 4 x 3 x 2 samples of type u8"]);
    let open = notes("a_4x3x2_i16.raw", wide(2, Endian::Little));
    assert_eq!(open[1], "the name gives no byte order: little-endian");
    assert_eq!(notes("a_4x3x2_i16_le.raw", wide(2, Endian::Little)).len(), 1);
    let spaced = Sample::one("spacing", "a_0.5x0.25x1_4x3x2_u8.raw", bytes()).loaded();
    assert_eq!(spaced.report.notes[1], "spacing from the name: 0.5 0.25 1");
    assert_eq!(grid(spaced).spacing(), DVec3::new(0.5, 0.25, 1.0));
}

#[test]
fn json_places_the_samples() {
    let grid = grid(samples().last().unwrap().loaded());
    // Rows of the matrix: x' = -y, y' = x.
    assert_eq!(grid.world_of_index(DVec3::ONE), DVec3::new(5.0 - 2.0, 6.0 + 1.0, 7.0 + 3.0));
    assert_eq!(grid.samples(), &Samples::U8(bytes()));
}

#[test]
fn what_breaks_a_rule_is_refused() {
    let name = |name: &str, parts: &[&str]| Sample::one("name", name, bytes()).refused(parts);
    name("a_4x3x3_u8.raw", &["4 x 3 x 3 samples of type u8 need 36 bytes: the file has 24"]);
    name("a_4x3x2_u16.raw", &["need 48 bytes: the file has 24"]);
    name("a_4x3_u8.raw", &["no size", "head_256x256x128_int16.raw"]);
    name("a_4x3x2.raw", &["no sample type", "a_4x3x2.json beside it"]);
    name("a_4x3x2_u8_i8.raw", &["u8 and i8", "only one"]);
    name("a_4x3x2_2x3x4_u8.raw", &["[4, 3, 2] and [2, 3, 4]", "only one"]);
    name("a_4x3x2x1_u8.raw", &["\"4x3x2x1\"", "neither three extents"]);
    name("a_4x3x99999999999_u8.raw", &["\"4x3x99999999999\""]);
    name("a.0.5x0.5x1.0.4x3x2_u8.raw", &["\"5x0\"", "neither"]);
    name("a_4x3x2_u8_0.5x1x1_1x1x0.5.raw", &["more than one spacing"]);
    name("a_4x3x2_u8_0.5x0.0x1.raw", &["spacing", "positive"]);
    name("a_24x1x1_u8.raw", &["at least 2"]);
    name("a_4000000000x4000000000x4000000000_u8.raw", &["memory can address"]);
    name("a_4000x4000x4000_u8.raw", &["limit is 1073741824"]);
    Sample::one("short", "a_4x3x2_u8.raw.gz", gzip(&bytes()[1..]))
        .refused(&["needs 24 bytes", "ends after 23"]);
    Sample::one("a header is there", "tooth.raw", bytes())
        .with("tooth.nhdr", "")
        .refused(&["read tooth.nhdr instead"]);

    let json = |text: &str, parts: &[&str]| {
        Sample::one("json", "a.json", text).with("a.raw", bytes()).refused(parts)
    };
    json(
        r#"{"dims": [4, 3, 2], "type": "u8", "colour": 1}"#,
        &["line 1", "colour", "unknown field", "`spacing`"],
    );
    json(r#"{"dims": [4, 3, 2]}"#, &["missing field `type`"]);
    json(r#"{"dims": [4, 3], "type": "u8"}"#, &["dims"]);
    json(r#"{"dims": [4, 3, -2], "type": "u8"}"#, &["dims[2]", "-2"]);
    json(r#"{"dims": [4, 3, 2], "type": "uint7"}"#, &["type", "\"uint7\"", "u8, i8"]);
    json(r#"{"dims": [4, 3, 2], "type": "u8", "endian": "middle"}"#, &["endian", "little or big"]);
    json(r#"{"dims": [4, 3, 2], "type": "u8", "offset": 1}"#, &["a.raw", "needs 24 bytes", "23 are there"]);
    json(r#"{"dims": [4, 3, 2], "type": "u8", "spacing": [1, 0, 1]}"#, &["spacing", "positive"]);
    json(r#"{"dims": [4, 3, 2], "type": "u8", "file": "b.raw"}"#, &["b.raw", "cannot open"]);
    json(r#"{"dims": [4, 3, 2], "type": "u8"} x"#, &["line 1, column 35"]);
    json(r#"{"volume": {"file": "a.raw"}}"#, &["no layout of raw samples", "`volume`"]);
    json(r#"{"dims": [4, 3, 2], "volume": 1, "type": "u8"}"#, &["no layout of raw samples"]);
    json(&"[".repeat(100_000), &["line 1"]);
    json("", &["line 1"]);
    Sample::one("another's", "a.raw", bytes())
        .with("a.json", r#"{"dims": [4, 3, 2], "type": "u8", "file": "b.raw"}"#)
        .refused(&["a.json: file", "\"b.raw\"", "lies beside a.raw"]);
    let options = ReadOptions { array: Some("density".into()), ..OPTIONS };
    let error = Sample::one("array", "a_4x3x2_u8.raw", bytes()).read(&options).unwrap_err();
    assert_refusal(&error, &["array \"density\"", "there are point:values (u8)"], "array");
}

#[test]
fn scenes_and_layouts_share_an_ending() {
    let folder = Folder::new();
    folder.write("a.raw", bytes());
    let layout = folder.write("a.json", r#"{"dims": [4, 3, 2], "type": "u8"}"#);
    let scene = folder.write("scene.json", r#"{"volume": {"file": "a.json"}, "image": {"width": 64}}"#);
    let alone = LoadedScene::load_any(layout, &OPTIONS).unwrap();
    let named = LoadedScene::load_any(&scene, &OPTIONS).unwrap();
    assert_eq!(alone.scene.grid().unwrap().samples(), &Samples::U8(bytes()));
    assert_eq!(named.scene.grid().unwrap().samples(), &Samples::U8(bytes()));
    assert_eq!((alone.width, named.width), (512, 64));
    // What is wrong with a scene is still told of the scene.
    let wrong = folder.write("wrong.json", r#"{"dims": [4, 3, 2], "points": {}}"#);
    let error = LoadedScene::load_any(wrong, &OPTIONS).unwrap_err();
    assert_refusal(&error, &["unknown field `dims`"], "a scene");
    assert_refusal(&read(scene, &OPTIONS).unwrap_err(), &["no layout of raw samples"], "a scene as data");
}

#[test]
fn the_conformance_head_is_that_of_the_reference() {
    let Some(reference) = shared("format_conformance/head_i16.npy") else { return };
    let reference = stored(&grid(read(reference, &OPTIONS).unwrap()));
    for name in ["head_i16_be.json", "head_i16_be.raw"] {
        let Some(path) = shared(&format!("format_conformance/{name}")) else { return };
        let grid = grid(read(path, &OPTIONS).unwrap());
        assert!(stored(&grid) == reference, "{name}");
        assert_eq!(grid.spacing(), DVec3::new(3.2, 3.2, 1.5), "{name}");
        assert_eq!(grid.origin(), DVec3::new(-100.0, 20.5, 7.25), "{name}");
    }
    let Some(tooth) = shared("structured/tooth/tooth.raw") else { return };
    assert_refusal(&read(tooth, &OPTIONS).unwrap_err(), &["read tooth.nhdr instead"], "tooth");
}

/// A file that is meant to describe the samples and is no JSON must not be passed over.
#[test]
fn a_broken_sidecar_is_told() {
    let broken = r#"{"dims": [4, 3, 2], "type": "u8", "spacing": [1, 1, 3],}"#;
    Sample::one("broken", "a_4x3x2_u8.raw", bytes()).with("a_4x3x2_u8.json", broken).refused(&[
        "a_4x3x2_u8.json",
        "line 1",
        "trailing comma",
    ]);
    // Somebody else's JSON is left alone.
    let other = r#"{"EchoTime": 0.03}"#;
    let loaded = Sample::one("other", "a_4x3x2_u8.raw", bytes()).with("a_4x3x2_u8.json", other).loaded();
    assert_eq!(grid(loaded).dims(), [4, 3, 2]);
}
