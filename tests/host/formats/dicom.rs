//! DICOM series.

use std::io::Write as _;

use glam::{DMat3, DVec3};
use volraster::io::{ReadOptions, read};
use volraster::scene::{Anatomy, Samples};

use crate::formats::support::{Folder, OPTIONS, Sample, assert_refusal, grid, shared, shared_loaded, stored};
use crate::formats::tiff::{JPEG, JPEG_VALUES};

/// How a data set is written.
#[derive(Clone, Copy, Debug)]
struct Syntax {
    uid: &'static str,
    explicit: bool,
    large_first: bool,
}

const EXPLICIT: Syntax = Syntax { uid: "1.2.840.10008.1.2.1", explicit: true, large_first: false };
const IMPLICIT: Syntax = Syntax { uid: "1.2.840.10008.1.2", explicit: false, large_first: false };
const LARGE_FIRST: Syntax = Syntax { uid: "1.2.840.10008.1.2.2", explicit: true, large_first: true };
const DEFLATED: Syntax = Syntax { uid: "1.2.840.10008.1.2.1.99", ..EXPLICIT };
const RUN_LENGTHS: Syntax = Syntax { uid: "1.2.840.10008.1.2.5", ..EXPLICIT };
const BASELINE: Syntax = Syntax { uid: "1.2.840.10008.1.2.4.50", ..EXPLICIT };
const LOSSLESS: Syntax = Syntax { uid: "1.2.840.10008.1.2.4.70", ..EXPLICIT };

/// 4 x 2 samples of 16 bits in lossless JPEG: 1000, 1003, 1010, 900, 5, 70, 4095, 0.
#[rustfmt::skip]
const LOSSLESS_JPEG: &[u8] = &[
    0xff, 0xd8, 0xff, 0xc3, 0x00, 0x0b, 0x10, 0x00, 0x02, 0x00, 0x04, 0x01, 0x01, 0x11, 0x00, 0xff, 0xc4, 0x00, 0x19, 0x00, 0x00, 0x02, 0x03, 0x01, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x07, 0x0c, 0x02, 0x03, 0x0a, 0x0f, 0xff, 0xda, 0x00, 0x08, 0x01, 0x01, 0x00, 0x01, 0x00, 0x00, 0xe0, 0x7c, 0xf3, 0xbc, 0x23, 0x81, 0xc2, 0x0b, 0xf7, 0x28, 0x00, 0x7f, 0xff, 0xd9,
];

/// The value of a data element.
#[derive(Clone, Debug)]
enum Value {
    Text(&'static str, String),
    Short(u16),
    Bytes(&'static str, Vec<u8>),
    /// Items, with lengths or with delimiters.
    Items(Vec<Elements>, bool),
    /// A table of offsets and fragments.
    Fragments(Vec<Vec<u8>>),
}

type Elements = Vec<((u16, u16), Value)>;

impl Syntax {
    fn put(self, bytes: &mut Vec<u8>, number: u32, size: usize) {
        if self.large_first {
            bytes.extend_from_slice(&number.to_be_bytes()[4 - size..]);
        } else {
            bytes.extend_from_slice(&number.to_le_bytes()[..size]);
        }
    }

    fn tag(self, bytes: &mut Vec<u8>, tag: (u16, u16)) {
        self.put(bytes, tag.0.into(), 2);
        self.put(bytes, tag.1.into(), 2);
    }

    fn element(self, bytes: &mut Vec<u8>, tag: (u16, u16), value: &Value) {
        let (vr, contents, undefined) = match value {
            Value::Text(vr, text) => {
                let mut text = text.clone().into_bytes();
                if text.len() % 2 == 1 {
                    text.push(if *vr == "UI" { 0 } else { b' ' });
                }
                (*vr, text, false)
            }
            Value::Short(number) => {
                let mut bytes = Vec::new();
                self.put(&mut bytes, u32::from(*number), 2);
                ("US", bytes, false)
            }
            Value::Bytes(vr, bytes) => (*vr, bytes.clone(), false),
            Value::Items(items, undefined) => {
                let mut bytes = Vec::new();
                for item in items {
                    let contents = self.elements(item);
                    self.tag(&mut bytes, (0xfffe, 0xe000));
                    self.put(&mut bytes, if *undefined { u32::MAX } else { contents.len() as u32 }, 4);
                    bytes.extend(contents);
                    if *undefined {
                        self.tag(&mut bytes, (0xfffe, 0xe00d));
                        self.put(&mut bytes, 0, 4);
                    }
                }
                if *undefined {
                    self.tag(&mut bytes, (0xfffe, 0xe0dd));
                    self.put(&mut bytes, 0, 4);
                }
                ("SQ", bytes, *undefined)
            }
            Value::Fragments(list) => {
                let mut bytes = Vec::new();
                for fragment in list {
                    self.tag(&mut bytes, (0xfffe, 0xe000));
                    self.put(&mut bytes, fragment.len() as u32, 4);
                    bytes.extend(fragment);
                }
                self.tag(&mut bytes, (0xfffe, 0xe0dd));
                self.put(&mut bytes, 0, 4);
                ("OB", bytes, true)
            }
        };
        let len = if undefined { u32::MAX } else { contents.len() as u32 };
        self.tag(bytes, tag);
        if !self.explicit {
            self.put(bytes, len, 4);
        } else if ["OB", "OW", "OF", "OD", "SQ", "UN"].contains(&vr) {
            bytes.extend_from_slice(vr.as_bytes());
            bytes.extend_from_slice(&[0, 0]);
            self.put(bytes, len, 4);
        } else {
            bytes.extend_from_slice(vr.as_bytes());
            self.put(bytes, len, 2);
        }
        bytes.extend(contents);
    }

    fn elements(self, elements: &Elements) -> Vec<u8> {
        let mut sorted = elements.clone();
        sorted.sort_by_key(|(tag, _)| *tag);
        let mut bytes = Vec::new();
        for (tag, value) in &sorted {
            self.element(&mut bytes, *tag, value);
        }
        bytes
    }

    fn file(self, elements: &Elements) -> Vec<u8> {
        let mut meta = Vec::new();
        EXPLICIT.element(&mut meta, (2, 0x10), &Value::Text("UI", self.uid.into()));
        let mut bytes = [&[0; 128][..], b"DICM"].concat();
        EXPLICIT.element(&mut bytes, (2, 0), &Value::Bytes("UL", (meta.len() as u32).to_le_bytes().to_vec()));
        bytes.extend(meta);
        let data = self.elements(elements);
        if self.uid == DEFLATED.uid {
            let mut encoder = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::best());
            encoder.write_all(&data).unwrap();
            bytes.extend(encoder.finish().unwrap());
        } else {
            bytes.extend(data);
        }
        bytes
    }
}

fn text(vr: &'static str, text: impl Into<String>) -> Value {
    Value::Text(vr, text.into())
}

fn decimals(numbers: &[f64]) -> Value {
    text("DS", numbers.iter().map(ToString::to_string).collect::<Vec<_>>().join("\\"))
}

const POSITION: (u16, u16) = (0x20, 0x32);
const ORIENTATION: (u16, u16) = (0x20, 0x37);
const SPACING: (u16, u16) = (0x28, 0x30);
const SERIES: (u16, u16) = (0x20, 0x0e);
const PIXELS: (u16, u16) = (0x7fe0, 0x10);

/// 4 x 2 samples of 16 bits at a height.
fn slice(z: f64, pixels: Value) -> Elements {
    vec![
        (SERIES, text("UI", "1.2.3")),
        (POSITION, decimals(&[1.0, 2.0, z])),
        (ORIENTATION, decimals(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0])),
        ((0x28, 0x02), Value::Short(1)),
        ((0x28, 0x04), text("CS", "MONOCHROME2")),
        ((0x28, 0x10), Value::Short(2)),
        ((0x28, 0x11), Value::Short(4)),
        (SPACING, decimals(&[0.5, 0.25])),
        ((0x28, 0x100), Value::Short(16)),
        ((0x28, 0x101), Value::Short(16)),
        ((0x28, 0x102), Value::Short(15)),
        ((0x28, 0x103), Value::Short(0)),
        (PIXELS, pixels),
    ]
}

fn with(elements: &Elements, tag: (u16, u16), value: Value) -> Elements {
    let mut elements: Elements = elements.iter().filter(|(other, _)| *other != tag).cloned().collect();
    elements.push((tag, value));
    elements
}

fn without(elements: &Elements, tag: (u16, u16)) -> Elements {
    elements.iter().filter(|(other, _)| *other != tag).cloned().collect()
}

fn words(numbers: impl IntoIterator<Item = u16>) -> Value {
    Value::Bytes("OW", numbers.into_iter().flat_map(u16::to_le_bytes).collect())
}

/// Three slices with the samples 0 to 23, 1.5 apart.
fn ramp() -> Vec<Elements> {
    (0..3).map(|z| slice(10.0 + 1.5 * f64::from(z), words(8 * z..8 * (z + 1)))).collect()
}

/// A series whose file names say nothing of the order; the first is neither end of it.
fn series(what: &'static str, syntax: Syntax, slices: &[Elements]) -> Sample {
    let mut order: Vec<usize> = (0..slices.len()).collect();
    order.rotate_left(1);
    let files = order.iter().enumerate().map(|(i, &z)| (format!("f/{i}"), syntax.file(&slices[z]))).collect();
    Sample { what, files }
}

fn each(slices: &[Elements], change: impl Fn(usize, &Elements) -> Elements) -> Vec<Elements> {
    slices.iter().enumerate().map(|(i, slice)| change(i, slice)).collect()
}

/// Run lengths of 16-bit samples: high bytes as one run, low bytes as they are.
fn run_lengths(numbers: &[u8]) -> Vec<u8> {
    let mut segments = vec![vec![(257 - numbers.len()) as u8, 0]];
    segments.push([&[numbers.len() as u8 - 1], numbers].concat());
    let mut bytes: Vec<u8> = [2_u32, 64, 66].iter().flat_map(|n| n.to_le_bytes()).collect();
    bytes.resize(64, 0);
    bytes.extend(segments.concat());
    bytes.resize(bytes.len().next_multiple_of(2), 0);
    bytes
}

/// One file of three frames, the last one first.
fn enhanced(undefined: bool) -> Elements {
    let item = |tag, elements| vec![(tag, Value::Items(vec![elements], undefined))];
    let frame = |z: f64| {
        let mut frame: Elements = item((0x20, 0x9113), vec![(POSITION, decimals(&[1.0, 2.0, z]))]);
        frame.extend(item((0x20, 0x9111), vec![((0x20, 0x9056), text("SH", "1"))]));
        frame
    };
    let mut shared: Elements =
        item((0x20, 0x9116), vec![(ORIENTATION, decimals(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0]))]);
    shared.extend(item((0x28, 0x9110), vec![(SPACING, decimals(&[0.5, 0.25]))]));
    shared.extend(item(
        (0x28, 0x9145),
        vec![((0x28, 0x1052), decimals(&[-5.0])), ((0x28, 0x1053), decimals(&[2.0]))],
    ));
    let order = [2, 0, 1];
    let frames = order.iter().map(|&z| frame(10.0 + 1.5 * f64::from(z))).collect();
    let mut file = slice(0.0, words(order.iter().flat_map(|&z| 8 * z..8 * (z + 1))));
    for tag in [POSITION, ORIENTATION, SPACING] {
        file = without(&file, tag);
    }
    file.push(((0x28, 0x08), text("IS", "3")));
    file.push(((0x5200, 0x9229), Value::Items(vec![shared], undefined)));
    file.push(((0x5200, 0x9230), Value::Items(frames, undefined)));
    // Something nested that nobody asks for.
    file.push(((0x08, 0x1140), Value::Items(vec![item((0x40, 0x275), Vec::new()), Vec::new()], undefined)));
    file
}

/// Small files that cover the format.
pub fn samples() -> Vec<Sample> {
    let ramp = ramp();
    let mut samples: Vec<Sample> = [("explicit", EXPLICIT), ("implicit", IMPLICIT), ("deflated", DEFLATED)]
        .map(|(what, syntax)| series(what, syntax, &ramp))
        .to_vec();
    let swapped = each(&ramp, |z, slice| {
        let z = z as u16;
        let bytes = (8 * z..8 * (z + 1)).flat_map(u16::to_be_bytes).collect();
        with(slice, PIXELS, Value::Bytes("OW", bytes))
    });
    samples.push(series("large first", LARGE_FIRST, &swapped));
    let packed = each(&ramp, |z, slice| {
        let numbers: Vec<u8> = (8 * z as u8..8 * (z as u8 + 1)).collect();
        with(slice, PIXELS, Value::Fragments(vec![Vec::new(), run_lengths(&numbers)]))
    });
    samples.push(series("run lengths", RUN_LENGTHS, &packed));
    let bare = Sample {
        what: "without a preamble",
        files: (0..3)
            .map(|z| (format!("{z}.x"), IMPLICIT.elements(&with(&ramp[z], (8, 0x16), text("UI", "1.2")))))
            .collect(),
    };
    samples.push(bare);
    let lossless = each(&ramp, |z, slice| {
        let (a, b) = LOSSLESS_JPEG.split_at(30 + 2 * z);
        with(slice, PIXELS, Value::Fragments(vec![Vec::new(), a.to_vec(), b.to_vec()]))
    });
    samples.push(series("lossless JPEG", LOSSLESS, &lossless));
    let baseline = each(&ramp, |_, slice| {
        let mut slice = with(slice, PIXELS, Value::Fragments(vec![Vec::new(), [JPEG, &[0]].concat()]));
        for (element, value) in [(0x10, 8), (0x11, 8), (0x100, 8), (0x101, 8), (0x102, 7)] {
            slice = with(&slice, (0x28, element), Value::Short(value));
        }
        slice
    });
    samples.push(series("baseline JPEG", BASELINE, &baseline));
    for (what, syntax, undefined) in [
        ("frames", EXPLICIT, false),
        ("frames with delimiters", EXPLICIT, true),
        ("implicit frames", IMPLICIT, false),
        ("implicit frames with delimiters", IMPLICIT, true),
    ] {
        samples.push(Sample::one(what, "a.dcm", syntax.file(&enhanced(undefined))));
    }
    let packed = [2_u8, 0, 1].map(|z| run_lengths(&(8 * z..8 * (z + 1)).collect::<Vec<u8>>()));
    let whole = [vec![Vec::new()], packed.to_vec()].concat();
    let frames = with(&enhanced(true), PIXELS, Value::Fragments(whole));
    samples.push(Sample::one("packed frames", "a.dcm", RUN_LENGTHS.file(&frames)));
    let halves = packed.iter().flat_map(|frame| [frame[..10].to_vec(), frame[10..].to_vec()]);
    let step = packed[0].len() as u32 + 16;
    let table = [0, step, 2 * step].iter().flat_map(|n| n.to_le_bytes()).collect();
    let split = std::iter::once(table).chain(halves).collect();
    let frames = with(&enhanced(false), PIXELS, Value::Fragments(split));
    samples.push(Sample::one("packed frames with a table", "a.dcm", RUN_LENGTHS.file(&frames)));
    // 12 bits, signed, from bit 2 on, with other things beside.
    let twelve = each(&ramp, |z, slice| {
        let numbers = (0..8).map(|i| (((8 * z as u16 + i).wrapping_sub(4) & 0xfff) << 2) | 0xc003);
        let slice = with(slice, (0x28, 0x101), Value::Short(12));
        let slice = with(&slice, (0x28, 0x102), Value::Short(13));
        with(&with(&slice, (0x28, 0x103), Value::Short(1)), PIXELS, words(numbers))
    });
    samples.push(series("12 bits", EXPLICIT, &twelve));
    let floats = each(&ramp, |z, slice| {
        let bytes = (0..8).flat_map(|i| (0.5 * (8 * z + i) as f32).to_le_bytes()).collect();
        let slice = with(&without(slice, PIXELS), (0x28, 0x100), Value::Short(32));
        with(&slice, (0x7fe0, 0x08), Value::Bytes("OF", bytes))
    });
    samples.push(series("floats", EXPLICIT, &floats));
    samples.push(series("slopes", EXPLICIT, &sloped(&ramp)));
    samples.push(series("tilt", EXPLICIT, &tilted()));
    samples.push(series("uneven", EXPLICIT, &uneven()));
    samples
}

/// Slope 1 + z and intercept -z.
fn sloped(slices: &[Elements]) -> Vec<Elements> {
    each(slices, |z, slice| {
        let slice = with(slice, (0x28, 0x1052), decimals(&[-(z as f64)]));
        with(&slice, (0x28, 0x1053), decimals(&[1.0 + z as f64]))
    })
}

/// Each slice is shifted along y.
fn tilted() -> Vec<Elements> {
    each(&ramp(), |z, slice| with(slice, POSITION, decimals(&[1.0, 2.0 + z as f64, 10.0 + 1.5 * z as f64])))
}

/// Heights 10, 11, 14.
fn uneven() -> Vec<Elements> {
    each(&ramp(), |z, slice| with(slice, POSITION, decimals(&[1.0, 2.0, [10.0, 11.0, 14.0][z]])))
}

#[track_caller]
fn named(what: &str) -> Sample {
    samples().into_iter().find(|sample| sample.what == what).unwrap_or_else(|| panic!("{what}"))
}

fn upto(count: u32) -> Vec<f64> {
    (0..count).map(f64::from).collect()
}

#[test]
fn syntaxes_and_packings() {
    for what in ["explicit", "implicit", "deflated", "large first", "run lengths", "without a preamble"] {
        let loaded = named(what).loaded();
        assert_eq!(loaded.report.format, "DICOM");
        assert!(loaded.report.warnings.is_empty(), "{what}: {:?}", loaded.report.warnings);
        let grid = grid(loaded);
        assert_eq!(*grid.samples(), Samples::U16((0..24).collect()), "{what}");
        assert_eq!((grid.dims(), grid.anatomy()), ([4, 2, 3], Anatomy::Lps), "{what}");
        assert_eq!(grid.origin(), DVec3::new(1.0, 2.0, 10.0), "{what}");
        assert_eq!(grid.index_to_world(), DMat3::from_diagonal(DVec3::new(0.25, 0.5, 1.5)), "{what}");
    }
    assert_eq!(stored(&grid(named("12 bits").loaded())), (-4..20).map(f64::from).collect::<Vec<_>>());
    let floats = grid(named("floats").loaded());
    assert_eq!(stored(&floats), (0..24).map(|i| 0.5 * f64::from(i)).collect::<Vec<_>>());
}

#[test]
fn jpeg() {
    let image = grid(named("lossless JPEG").loaded());
    let wanted = [1000, 1003, 1010, 900, 5, 70, 4095, 0].repeat(3);
    assert_eq!(*image.samples(), Samples::U16(wanted));
    let loaded = named("baseline JPEG").loaded();
    assert!(loaded.report.notes.iter().any(|note| note.contains("lossy")), "{:?}", loaded.report.notes);
    for (value, wanted) in stored(&grid(loaded)).iter().zip(JPEG_VALUES.iter().cycle()) {
        assert!((value - f64::from(*wanted)).abs() <= 1.0, "{value} {wanted}");
    }
}

#[test]
fn bytes_behind_a_jpeg_are_left_alone() {
    let again = [LOSSLESS_JPEG, &LOSSLESS_JPEG[2..15], &[0xff, 0xe0, 0x7f, 0xff]].concat();
    let packed = Value::Fragments(vec![Vec::new(), again]);
    let slices = each(&ramp(), |_, slice| with(slice, PIXELS, packed.clone()));
    let wanted = [1000, 1003, 1010, 900, 5, 70, 4095, 0].repeat(3);
    let image = grid(series("behind", LOSSLESS, &slices).loaded());
    assert_eq!(*image.samples(), Samples::U16(wanted));
}

#[test]
fn fragments_within_sequences_are_passed_over() {
    let packed = || Value::Fragments(vec![Vec::new(), LOSSLESS_JPEG.to_vec()]);
    for (what, syntax) in [("explicit", EXPLICIT), ("implicit", IMPLICIT)] {
        for undefined in [true, false] {
            let icon =
                Value::Items(vec![vec![((0x28, 0x10), Value::Short(9)), (PIXELS, packed())]], undefined);
            let slices = each(&ramp(), |_, slice| with(slice, (0x88, 0x200), icon.clone()));
            let image = grid(series(what, syntax, &slices).loaded());
            assert_eq!(*image.samples(), Samples::U16((0..24).collect()), "{what}");
        }
    }
    // Others are known by their types.
    let slices = each(&ramp(), |_, slice| with(slice, (0x42, 0x11), packed()));
    assert_eq!(*grid(series("OB", EXPLICIT, &slices).loaded()).samples(), Samples::U16((0..24).collect()));
}

#[test]
fn slices_cut_short_are_not_passed_over() {
    // 16 bytes of samples behind 12 that say so.
    for cut in [28, 24, 20, 18, 1] {
        let folder = Folder::new();
        for (i, slice) in ramp().iter().enumerate() {
            let mut bytes = EXPLICIT.file(slice);
            if i == 2 {
                bytes.truncate(bytes.len() - cut);
            }
            folder.write(&format!("{i}.dcm"), bytes);
        }
        let error = read(folder.path(""), &OPTIONS).unwrap_err();
        assert_refusal(&error, &["2.dcm: "], "folder");
        let loaded = read(folder.path("0.dcm"), &OPTIONS).unwrap();
        let warnings = &loaded.report.warnings;
        assert!(warnings[0].starts_with("left out: ") && warnings[0].contains("2.dcm: "), "{warnings:?}");
        assert!(warnings[1].contains("1 damaged file") && warnings[1].contains("missing"), "{warnings:?}");
        assert_eq!(grid(loaded).dims(), [4, 2, 2]);
    }
    // Of another series, or without rows, it is none of them.
    let folder = Folder::new();
    for (i, slice) in ramp().iter().enumerate() {
        folder.write(&format!("{i}.dcm"), EXPLICIT.file(slice));
    }
    folder.write("9.dcm", EXPLICIT.file(&with(&without(&ramp()[0], PIXELS), SERIES, text("UI", "1.9"))));
    let loaded = read(folder.path("0.dcm"), &OPTIONS).unwrap();
    assert!(loaded.report.warnings.is_empty(), "{:?}", loaded.report.warnings);
    let none = EXPLICIT.file(&without(&without(&ramp()[0], PIXELS), (0x28, 0x10)));
    // Padding is zero.
    folder.write("9.dcm", [&none[..], &[0; 7]].concat());
    assert_eq!(grid(read(folder.path(""), &OPTIONS).unwrap()).dims(), [4, 2, 3]);
    folder.write("9.dcm", [&none[..], &[0, 0, 1]].concat());
    assert_refusal(&read(folder.path(""), &OPTIONS).unwrap_err(), &["9.dcm: byte"], "no padding");
}

#[test]
fn damaged_neighbours_are_listed_as_far_as_they_fit() {
    let mut sample = named("explicit");
    let cut = sample.files[0].1[..200].to_vec();
    for i in 0..10 {
        sample = sample.with(&format!("f/x{i}"), cut.clone());
    }
    let warnings = sample.loaded().report.warnings;
    assert_eq!(warnings.len(), 9, "{warnings:?}");
    assert!(warnings[7].contains("f/x7: "), "{warnings:?}");
    assert!(warnings[8].contains("10 damaged files") && warnings[8].contains("missing"), "{warnings:?}");
}

#[test]
fn a_lookup_table_is_warned_of_once() {
    let lut = || ((0x28, 0x3000), Value::Items(vec![Vec::new()], false));
    let slices = each(&ramp(), |_, slice| [slice.clone(), vec![lut(), lut()]].concat());
    let warnings = series("tables", EXPLICIT, &slices).loaded().report.warnings;
    assert_eq!(warnings, ["ModalityLUTSequence is not applied: values are as stored"]);
}

#[test]
fn frames_of_one_file() {
    for what in [
        "frames",
        "frames with delimiters",
        "implicit frames",
        "implicit frames with delimiters",
        "packed frames",
        "packed frames with a table",
    ] {
        let grid = grid(named(what).loaded());
        assert_eq!(*grid.samples(), Samples::U16((0..24).collect()), "{what}");
        assert_eq!(grid.range(), [-5.0, 41.0], "{what}");
        assert_eq!(grid.index_to_world(), DMat3::from_diagonal(DVec3::new(0.25, 0.5, 1.5)), "{what}");
    }
}

#[test]
fn values_after_slopes() {
    let loaded = named("slopes").loaded();
    assert!(loaded.report.notes.iter().any(|note| note.contains("slope")), "{:?}", loaded.report.notes);
    let wanted: Vec<f64> =
        upto(24).iter().map(|n| (n / 8.0).floor()).zip(upto(24)).map(|(z, n)| (1.0 + z) * n - z).collect();
    assert_eq!(stored(&grid(loaded)), wanted);
    let same = each(&ramp(), |_, slice| with(slice, (0x28, 0x1053), decimals(&[0.5])));
    let grid = grid(series("one slope", EXPLICIT, &same).loaded());
    assert_eq!((grid.samples().type_name(), grid.range()), ("u16", [0.0, 11.5]));
    let white = each(&ramp(), |_, slice| with(slice, (0x28, 4), text("CS", "MONOCHROME1")));
    let loaded = series("white", EXPLICIT, &white).loaded();
    assert!(loaded.report.notes.iter().any(|note| note.contains("MONOCHROME1")));
}

#[test]
fn tilt_shears_and_uneven_distances_are_resampled() {
    let loaded = named("tilt").loaded();
    assert!(
        loaded.report.notes.iter().any(|note| note.contains("33.69 degrees")),
        "{:?}",
        loaded.report.notes
    );
    let image = grid(loaded);
    let axis = image.index_to_world().z_axis;
    assert!((axis - DVec3::new(0.0, 1.0, 1.5)).length() < 1e-12, "{axis}");
    assert_eq!(*image.samples(), Samples::U16((0..24).collect()));

    let loaded = named("uneven").loaded();
    assert_eq!(loaded.report.warnings, ["distances of slices are uneven: 1, 3 mm"]);
    assert_eq!(loaded.report.file_range, Some([0.0, 23.0]));
    let image = grid(loaded);
    assert_eq!((image.dims(), image.spacing()), ([4, 2, 5], DVec3::new(0.25, 0.5, 1.0)));
    let column: Vec<f64> = (0..5).map(|z| image.value(0, 0, z)).collect();
    for (value, wanted) in column.iter().zip([0.0, 8.0, 8.0 + 8.0 / 3.0, 8.0 + 16.0 / 3.0, 16.0]) {
        assert!((value - wanted).abs() < 1e-6, "{column:?}");
    }
}

#[test]
fn a_single_slice_is_a_slab() {
    const THICKNESS: (u16, u16) = (0x18, 0x50);
    let one = &ramp()[1];
    for (slice, thickness, whence) in [
        (with(one, THICKNESS, decimals(&[3.0])), 3.0, "its SliceThickness"),
        (with(one, THICKNESS, text("DS", "5,0")), 0.25, "a pixel: it has no usable SliceThickness"),
        (with(one, THICKNESS, decimals(&[0.0])), 0.25, "a pixel: it has no usable SliceThickness"),
        (one.clone(), 0.25, "a pixel: it has no usable SliceThickness"),
    ] {
        let loaded = Sample::one("one", "a.dcm", EXPLICIT.file(&slice)).loaded();
        let warning = format!("1 slice: it is drawn as a slab of {thickness} mm, {whence}");
        assert_eq!(loaded.report.warnings, [warning]);
        let grid = grid(loaded);
        assert_eq!(*grid.samples(), Samples::U16((8..16).chain(8..16).collect()));
        assert_eq!((grid.dims(), grid.spacing()), ([4, 2, 2], DVec3::new(0.25, 0.5, thickness)));
        assert_eq!(grid.origin(), DVec3::new(1.0, 2.0, 11.5 - 0.5 * thickness));
    }
}

/// The 128 bytes before "DICM" may be the header of a TIFF file (PS3.10, 7.1), so that both kinds of programs read it.
#[test]
fn a_preamble_of_another_format_is_still_dicom() {
    let files = ramp().into_iter().enumerate().map(|(z, slice)| {
        let mut bytes = EXPLICIT.file(&slice);
        bytes[..8].copy_from_slice(b"II*\0\x10\x05\0\0");
        (format!("f/{z}.dcm"), bytes)
    });
    let sample = Sample { what: "dual", files: files.collect() };
    let folder = Folder::new();
    for (name, bytes) in &sample.files {
        folder.write(name, bytes);
    }
    for loaded in [sample.loaded(), read(folder.path("f"), &OPTIONS).unwrap()] {
        assert_eq!((loaded.report.format, grid(loaded).dims()), ("DICOM", [4, 2, 3]));
    }
}

#[test]
fn rows_and_columns_may_point_anywhere() {
    // Columns run along -z, rows along y: the normal is +x.
    let turned = each(&ramp(), |z, slice| {
        let slice = with(slice, POSITION, decimals(&[-2.0 * z as f64, 0.0, 0.0]));
        with(&slice, ORIENTATION, decimals(&[0.0, 1.0, 0.0, 0.0, 0.0, -1.0]))
    });
    let grid = grid(series("turned", EXPLICIT, &turned).loaded());
    let axes = DMat3::from_cols(DVec3::Y * 0.25, DVec3::Z * -0.5, DVec3::X * -2.0);
    assert_eq!(grid.index_to_world(), axes);
    assert_eq!(grid.value(0, 0, 0), 0.0);
    assert_eq!(grid.origin(), DVec3::ZERO);
}

#[test]
fn refusals_name_the_file_and_the_rule() {
    let refused = |what, change: &dyn Fn(usize, &Elements) -> Elements, parts: &[&str]| {
        series(what, EXPLICIT, &each(&ramp(), change)).refused(parts);
    };
    let all = |what, tag, value: Value, parts: &[&str]| {
        refused(what, &|_, slice| with(slice, tag, value.clone()), parts);
    };
    let last = |what, tag, value: Value, parts: &[&str]| {
        refused(
            what,
            &|z, slice| if z == 2 { with(slice, tag, value.clone()) } else { slice.clone() },
            parts,
        );
    };
    last(
        "twice",
        POSITION,
        decimals(&[1.0, 2.0, 10.0]),
        &["f/2: ImagePositionPatient: 1 and 2 lie at the same place"],
    );
    last("beside", POSITION, decimals(&[1.0, 3.0, 14.0]), &["0 lies", "beside the line from 2 to 1"]);
    last(
        "turned",
        ORIENTATION,
        decimals(&[0.0, 1.0, 0.0, 1.0, 0.0, 0.0]),
        &["f/1: slice: ImageOrientationPatient"],
    );
    last("pixels", SPACING, decimals(&[0.5, 0.5]), &["f/1: slice: PixelSpacing [0.5, 0.5]"]);
    last(
        "signs",
        (0x28, 0x103),
        Value::Short(1),
        &["f/1: samples: 4 x 2 MONOCHROME2 samples, signed, 16 of 16"],
    );
    last("no slope", (0x28, 0x1053), decimals(&[0.0]), &["f/1: slice: RescaleSlope 0"]);
    refused("no position", &|_, slice| without(slice, POSITION), &["slice: no ImagePositionPatient"]);
    refused("no orientation", &|_, slice| without(slice, ORIENTATION), &["ImageOrientationPatient: missing"]);
    refused("no samples", &|_, slice| without(slice, PIXELS), &["PixelData: there is none"]);
    all("position", POSITION, text("DS", "1\\2\\x"), &["(0020,0032) \"1\\2\\x\": must be 3 numbers"]);
    all(
        "skew",
        ORIENTATION,
        decimals(&[1.0, 0.0, 0.0, 0.6, 0.8, 0.0]),
        &["must have unit length and be at right angles"],
    );
    all("no size", SPACING, decimals(&[0.0, 1.0]), &["PixelSpacing: 0, 1: must be positive"]);
    all("colours", (0x28, 4), text("CS", "RGB"), &["PhotometricInterpretation: \"RGB\""]);
    all("palette", (0x28, 4), text("CS", "PALETTE COLOR"), &["\"PALETTE COLOR\": MONOCHROME1"]);
    all("three samples", (0x28, 2), Value::Short(3), &["SamplesPerPixel: 3"]);
    all("bits", (0x28, 0x100), Value::Short(1), &["BitsAllocated: 1: 8, 16 and 32"]);
    all(
        "stored",
        (0x28, 0x101),
        Value::Short(17),
        &["BitsStored, HighBit: 17 up to bit 15: do not fit in 16"],
    );
    all(
        "rows",
        (0x28, 0x10),
        Value::Short(9),
        &["PixelData: 16 bytes: 4 x 9 samples of 16 bits in 1 frames need 72"],
    );
    all("huge", (0x28, 0x10), Value::Short(u16::MAX), &["need 524280"]);
    all("no columns", (0x28, 0x11), Value::Short(0), &["Rows, Columns: 2, 0"]);
    all("long", SPACING, text("DS", "1".repeat(2000)), &["(0028,0030) has 2000 bytes: at most 1024"]);
    for (uid, name) in
        [("1.2.840.10008.1.2.4.90", "(JPEG 2000)"), ("1.2.840.10008.1.2.4.80", "(JPEG-LS)"), ("9.9", "9.9:")]
    {
        series("syntax", Syntax { uid, ..EXPLICIT }, &ramp()).refused(&["TransferSyntaxUID", name]);
    }
    series("plain", BASELINE, &ramp())
        .refused(&["PixelData: transfer syntax 1.2.840.10008.1.2.4.50 has fragments"]);
    let fragments =
        |list: Vec<Vec<u8>>| each(&ramp(), |_, slice| with(slice, PIXELS, Value::Fragments(list.clone())));
    series("empty", RUN_LENGTHS, &fragments(vec![Vec::new()])).refused(&["0 packed bytes hold at most 0"]);
    series("short", RUN_LENGTHS, &fragments(vec![Vec::new(), run_lengths(&[1; 7])]))
        .refused(&["RLE: segment 0 ends 1 samples early"]);
    series("one segment", RUN_LENGTHS, &fragments(vec![Vec::new(), vec![1; 70]]))
        .refused(&["segments: 2 are needed"]);
    series("another size", LOSSLESS, &fragments(vec![Vec::new(), JPEG.to_vec()]))
        .refused(&["JPEG: 8 x 8 pixels, 1 x 8 bits: 4 x 2 pixels of 16"]);
    let mut damaged = LOSSLESS_JPEG.to_vec();
    damaged[36] = 0xff;
    series("damaged", LOSSLESS, &fragments(vec![Vec::new(), damaged])).refused(&["JPEG: is damaged"]);

    let frames = |what, change: &dyn Fn(Elements) -> Elements, parts: &[&str]| {
        Sample::one(what, "a.dcm", EXPLICIT.file(&change(enhanced(true)))).refused(parts);
    };
    let per_frame = (0x5200, 0x9230);
    frames("no places", &|file| without(&file, per_frame), &["frame 1: no ImagePositionPatient of its own"]);
    frames("count", &|file| with(&file, (0x28, 8), text("IS", "4")), &["3 items for 4 frames"]);
    frames("no count", &|file| with(&file, (0x28, 8), text("IS", "-1")), &["NumberOfFrames \"-1\""]);
    frames(
        "more items",
        &|file| with(&file, (0x28, 8), text("IS", "2")),
        &["byte", "more than 2 items for 2 frames"],
    );
    frames("many", &|file| with(&file, (0x28, 8), text("IS", "99999999")), &["99999999"]);
    frames(
        "few items",
        &|file| with(&file, per_frame, Value::Items(vec![Vec::new()], true)),
        &["1 items for 3 frames"],
    );
}

#[test]
fn broken_structures_are_refused() {
    let refused = |what, data: Vec<u8>, parts: &[&str]| {
        let file = EXPLICIT.file(&Vec::new());
        Sample::one(what, "a.dcm", [file, data].concat()).refused(parts);
    };
    let deep = b"\x08\0\x40\x11SQ\0\0\xff\xff\xff\xff\xfe\xff\0\xe0\xff\xff\xff\xff".repeat(1000);
    refused("deep", deep, &["more than 32 sequences within each other"]);
    refused("long", b"\x08\0\x18\0UI\xff\x7f12".to_vec(), &["(0008,0018) has 32767 bytes: 2 are left"]);
    refused(
        "no type",
        b"\x08\0\x18\0\x01\x02\x03\x04".to_vec(),
        &["element (0008,0018) must have a type of two letters"],
    );
    refused("open", b"\x08\0\x40\x11SQ\0\0\xff\xff\xff\xff".to_vec(), &["needs", "bytes here"]);
    refused("an item", b"\xfe\xff\0\xe0\0\0\0\0".to_vec(), &["an item outside a sequence"]);
    refused("a delimiter", b"\xfe\xff\xdd\xe0\0\0\0\0".to_vec(), &["a delimiter where nothing is open"]);
    let within = b"\x08\0\x40\x11SQ\0\0\xff\xff\xff\xff\x08\0\x18\0UI\0\0".to_vec();
    refused("no item", within, &["an element within a sequence, outside its items"]);
    let beyond = b"\0\x52\x29\x92SQ\0\0\x10\0\0\0\xfe\xff\0\xe0\x08\0\0\0\x08\0\x18\0UI\x02\x0012".to_vec();
    refused("beyond", beyond, &["a sequence or item ends at byte", "within an element"]);
    let fragment = b"\xe0\x7f\x10\0OB\0\0\xff\xff\xff\xff\xfe\xff\0\xe0\xff\xff\xff\x7f".to_vec();
    refused("a fragment", fragment, &["(fffe,e000) has 2147483647 bytes: 0 are left"]);
    refused(
        "no item of samples",
        b"\xe0\x7f\x10\0OB\0\0\xff\xff\xff\xff\x08\0\x18\0UI\0\0".to_vec(),
        &["must be an item of samples"],
    );
}

#[test]
fn memory_stays_within_the_limit() {
    let sample = named("explicit");
    assert!(sample.read(&ReadOptions::within(47)).unwrap_err().to_string().contains("of the limit of 47"));
    let huge = series(
        "huge",
        EXPLICIT,
        &each(&ramp(), |_, slice| with(slice, SERIES, text("UI", "1".repeat(1000)))),
    );
    let error = huge.read(&ReadOptions::within(2000)).unwrap_err().to_string();
    assert!(error.contains("header: ") && error.contains("of the limit of 2000"), "{error}");
    sample.read(&ReadOptions::within(48 + (1 << 17))).unwrap();
    let zeros = with(&slice(0.0, words([])), (8, 8), Value::Bytes("OB", vec![0; 1 << 20]));
    let bomb = Sample::one("bomb", "a.dcm", DEFLATED.file(&zeros));
    let error = bomb.read(&ReadOptions::within(1 << 18)).unwrap_err();
    assert_refusal(&error, &["deflated data set: 1048", "of the limit of 262144"], "bomb");
    // A data set that fits is held once.
    let large = with(&enhanced(true), (8, 8), Value::Bytes("OB", vec![0; 1 << 20]));
    let large = Sample::one("large", "a.dcm", DEFLATED.file(&large));
    large.read(&ReadOptions::within((1 << 20) + (1 << 18))).unwrap();
}

#[test]
fn damage_never_panics() {
    for sample in samples() {
        let bytes = &sample.files[0].1;
        for at in 120..bytes.len() {
            for change in [1, 0x80, 0xff] {
                let mut sample = sample.clone();
                sample.files[0].1[at] ^= change;
                let _ = sample.read(&ReadOptions::within(1 << 20));
            }
            let mut sample = sample.clone();
            sample.files[0].1.truncate(at);
            let _ = sample.read(&ReadOptions::within(1 << 20));
        }
    }
}

#[test]
fn folders_hold_one_series() {
    let folder = Folder::new();
    for (i, slice) in ramp().iter().enumerate() {
        folder.write(&format!("{}.dcm", 9 - i), EXPLICIT.file(slice));
    }
    folder.write("DICOMDIR", EXPLICIT.file(&Vec::new()));
    let loaded = read(folder.path(""), &OPTIONS).unwrap();
    assert!(loaded.report.notes.contains(&"left out: DICOMDIR".to_owned()), "{:?}", loaded.report.notes);
    assert_eq!(*grid(loaded).samples(), Samples::U16((0..24).collect()));

    folder.write("other.dcm", EXPLICIT.file(&with(&ramp()[0], SERIES, text("UI", "1.2.4"))));
    let error = read(folder.path(""), &OPTIONS).unwrap_err();
    let parts = ["SeriesInstanceUID: 2 series: 1.2.3 of 3 files, 1.2.4 of 1 files", "name one file"];
    assert_refusal(&error, &parts, "two series");
    let loaded = read(folder.path("8.dcm"), &OPTIONS).unwrap();
    assert!(
        loaded.report.notes.iter().any(|note| note.starts_with("2 DICOM files")),
        "{:?}",
        loaded.report.notes
    );
    assert_eq!(*grid(loaded).samples(), Samples::U16((0..24).collect()));
}

#[test]
fn real_series() {
    let Some(loaded) = shared_loaded("structured/dicom_ge_head") else { return };
    assert_eq!(
        loaded.report.warnings,
        ["distances of slices are uneven: 4.22 (4 times), 1.14, 7.38 (4 times) mm"]
    );
    assert!(
        loaded.report.notes.iter().any(|note| note.contains("18.50 degrees")),
        "{:?}",
        loaded.report.notes
    );
    let image = grid(loaded);
    assert_eq!((image.dims(), image.anatomy()), ([512, 512, 43], Anatomy::Lps));
    assert_eq!(image.origin(), DVec3::new(-125.0, -123.540_456_9, 43.816_058_6));
    let axes = image.index_to_world();
    assert!((axes.y_axis - 0.488_281_2 * DVec3::new(0.0, 0.948_323_7, -0.317_304_7)).length() < 1e-7);
    assert!((axes.z_axis * 42.0 - DVec3::new(0.0, 0.0, 47.54)).length() < 1e-9, "{}", axes.z_axis);
    // The first and the last slice are as the files have them.
    for (z, name) in [(0, "10.dcm"), (42, "19.dcm")] {
        let bytes = std::fs::read(shared("structured/dicom_ge_head").unwrap().join(name)).unwrap();
        let pixels = bytes[bytes.len() - 512 * 512 * 2..].as_chunks::<2>().0;
        for (i, pair) in pixels.iter().enumerate().step_by(7) {
            let (x, y) = ((i % 512) as u32, (i / 512) as u32);
            assert_eq!(image.value(x, y, z), f64::from(i16::from_le_bytes(*pair)), "{name} {x} {y}");
        }
    }
}
