//! NIfTI-1: what is doubtful is told. `tests/host/io.rs` covers the rest.

use glam::DVec3;
use volraster::io::ReadOptions;

use super::support::{OPTIONS, Sample, grid, gzip, stored};

/// 4 x 3 x 2 bytes 1 to 24 with shorts, floats and bytes put into the header.
fn file(shorts: &[(usize, i16)], floats: &[(usize, f32)]) -> Vec<u8> {
    let mut bytes = vec![0; 352];
    bytes[..4].copy_from_slice(&348_i32.to_le_bytes());
    let sizes = [3, 4, 3, 2, 1, 1, 1, 1];
    let basic = sizes.iter().enumerate().map(|(i, &n)| (40 + 2 * i, n)).chain([(70, 2), (72, 8)]);
    for (at, value) in basic.chain(shorts.iter().copied()) {
        bytes[at..at + 2].copy_from_slice(&value.to_le_bytes());
    }
    let basic = (0..8).map(|i| (76 + 4 * i, 1.0)).chain([(108, 352.0)]);
    for (at, value) in basic.chain(floats.iter().copied()) {
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
    }
    bytes[344..348].copy_from_slice(b"n+1\0");
    bytes.extend(1..=24);
    bytes
}

const QFORM: (usize, i16) = (252, 1);
const QUATERN_B: usize = 256;
const PIXDIM: usize = 76;

/// 4 x 3 x 2 bytes.
fn bytes() -> Vec<Sample> {
    let mut big = file(&[], &[]);
    big[344..348].copy_from_slice(b"ni1\0");
    big[108..112].copy_from_slice(&0_f32.to_le_bytes());
    let image = big.split_off(352);
    vec![
        Sample::one("plain", "a.nii", file(&[], &[(112, 2.0), (116, -1.0)])),
        Sample::one("gzip", "a.nii.gz", gzip(&file(&[QFORM], &[(QUATERN_B, 0.5), (PIXDIM, -1.0)]))),
        Sample::one("sform", "a.nii", file(&[(254, 1)], &[(280, 2.0), (300, 2.0), (320, 3.0), (292, 7.0)])),
        Sample::one("one of four axes", "a.nii", file(&[(40, 4)], &[])),
        Sample::one("a pair", "a.hdr", big).with("a.img", image),
    ]
}

/// A header of 352 bytes by the standard's table of offsets, and six samples of each type.
fn typed(datatype: i16, bits: i16, big: bool, magic: &[u8; 4], change: impl Fn(&mut Header)) -> Header {
    let mut header = Header { bytes: vec![0; 352], big };
    header.put(0, 348_i32.to_be_bytes());
    for (i, value) in [3, 3, 2, 2, 1, 1, 1, 1_i16].into_iter().enumerate() {
        header.put(40 + 2 * i, value.to_be_bytes());
    }
    header.put(70, datatype.to_be_bytes());
    header.put(72, bits.to_be_bytes());
    for i in 0..8 {
        header.put(76 + 4 * i, 1_f32.to_be_bytes());
    }
    header.put(108, if magic == b"n+1\0" { 352_f32 } else { 0.0 }.to_be_bytes());
    header.bytes[344..348].copy_from_slice(magic);
    change(&mut header);
    header
}

struct Header {
    bytes: Vec<u8>,
    big: bool,
}

impl Header {
    /// Big-endian bytes, turned round where the file is little-endian.
    fn put<const N: usize>(&mut self, at: usize, mut bytes: [u8; N]) {
        if !self.big {
            bytes.reverse();
        }
        self.bytes[at..at + N].copy_from_slice(&bytes);
    }

    fn with(mut self, data: &[u8]) -> Vec<u8> {
        self.bytes.extend_from_slice(data);
        self.bytes
    }
}

/// 3 x 2 x 2 numbers of several types, in both byte orders, packed and not, in one file and in two.
fn types() -> Vec<Sample> {
    let ramp: Vec<u8> = (1..=12).collect();
    let words: Vec<u8> = (1..=12_i16).flat_map(i16::to_be_bytes).collect();
    let floats: Vec<u8> = (1..=12_i16).flat_map(|n| f32::from(n).to_le_bytes()).collect();
    let wide: Vec<u8> = (1..=12_i16).flat_map(|n| f64::from(n).to_le_bytes()).collect();
    let single = b"n+1\0";
    let placed = |h: &mut Header| {
        h.put(254, 1_i16.to_be_bytes());
        for (i, value) in
            [0.0, -2.0, 0.0, 5.0, 1.5, 0.0, 0.0, -3.0, 0.0, 0.0, 3.0, 1.0_f32].into_iter().enumerate()
        {
            h.put(280 + 4 * i, value.to_be_bytes());
        }
    };
    let turned = |h: &mut Header| {
        h.put(252, 2_i16.to_be_bytes());
        h.put(76, (-1_f32).to_be_bytes());
        h.put(264, 0.5_f32.to_be_bytes());
        h.put(112, (-0.5_f32).to_be_bytes());
        h.put(116, 100_f32.to_be_bytes());
    };
    vec![
        Sample::one("u8", "a.nii", typed(2, 8, false, single, |_| ()).with(&ramp)),
        Sample::one("packed", "a.nii.gz", gzip(&typed(2, 8, false, single, |_| ()).with(&ramp))),
        Sample::one("big-endian i16, sform", "a.nii", typed(4, 16, true, single, placed).with(&words)),
        Sample::one("f32, qform, rescale", "a.nii", typed(16, 32, false, single, turned).with(&floats)),
        Sample::one("f64", "a.nii", typed(64, 64, false, single, |_| ()).with(&wide)),
        Sample::one("pair", "a.hdr", typed(2, 8, false, b"ni1\0", |_| ()).bytes).with("a.img", ramp.clone()),
        Sample::one("packed pair", "a.img.gz", gzip(&ramp))
            .with("a.hdr.gz", gzip(&typed(2, 8, false, b"ni1\0", placed).bytes)),
    ]
}

/// Both.
pub fn samples() -> Vec<Sample> {
    [bytes(), types()].concat()
}

#[test]
fn seeds_hold_what_they_should() {
    for (samples, dims) in [(bytes(), [4, 3, 2]), (types(), [3, 2, 2])] {
        for sample in samples {
            let grid = grid(sample.loaded());
            assert_eq!(grid.dims(), dims, "{}", sample.what);
            let ramp: Vec<f64> = (1..=dims.iter().product()).map(f64::from).collect();
            assert_eq!(stored(&grid), ramp, "{}", sample.what);
        }
    }
}

#[test]
fn doubtful_placements_are_told() {
    let read = |shorts: &[(usize, i16)], floats: &[(usize, f32)]| {
        let loaded = Sample::one("doubt", "a.nii", file(shorts, floats)).loaded();
        let warnings = loaded.report.warnings.clone();
        (grid(loaded).world_of_index(DVec3::ONE), warnings)
    };
    let fine = |shorts: &[(usize, i16)], floats: &[(usize, f32)]| assert_eq!(read(shorts, floats).1, [""; 0]);
    fine(&[QFORM], &[]);
    fine(&[QFORM], &[(PIXDIM, -1.0)]);
    fine(&[QFORM], &[(PIXDIM, 0.0)]);
    fine(&[QFORM], &[(QUATERN_B, 1.0)]);
    fine(&[QFORM], &[(QUATERN_B, 0.6), (QUATERN_B + 4, 0.8)]);
    // Without a qform its numbers mean nothing, and with an sform neither.
    fine(&[], &[(PIXDIM, -2.0), (QUATERN_B, 7.0)]);
    fine(&[QFORM, (254, 1)], &[(PIXDIM, -2.0), (280, 1.0), (300, 1.0), (320, 1.0)]);

    let (corner, warnings) = read(&[QFORM], &[(PIXDIM, -2.0)]);
    assert_eq!(corner, DVec3::new(1.0, 1.0, -1.0));
    assert!(warnings[0].contains("pixdim[0] is -2"), "{warnings:?}");
    let (corner, warnings) = read(&[QFORM], &[(QUATERN_B, 3.0)]);
    assert!(corner.distance(DVec3::new(1.0, -1.0, -1.0)) < 1e-12, "{corner}");
    assert!(warnings[0].contains("squares sum up to 9.000000"), "{warnings:?}");
    let (corner, warnings) = read(&[QFORM], &[(PIXDIM + 4, -2.0)]);
    assert_eq!(corner, DVec3::new(2.0, 1.0, 1.0));
    assert!(warnings[0].contains("pixdim is negative"), "{warnings:?}");
}

#[test]
fn further_axes_are_refused_by_what_they_are() {
    let refused = |shorts: &[(usize, i16)], parts: &[&str]| {
        Sample::one("axes", "a.nii", file(shorts, &[])).refused(parts);
    };
    refused(&[(40, 4), (48, 2)], &["dim[4]", "2 times", "must be 1"]);
    refused(&[(40, 5), (50, 3)], &["dim[5]", "3 components", "must be 1"]);
    refused(&[(40, 6), (52, 9)], &["dim[6]", "9 entries", "must be 1"]);
    let options = ReadOptions { array: Some("density".into()), ..OPTIONS };
    let error = samples()[0].read(&options).unwrap_err().to_string();
    assert!(error.contains("there are point:values (u8)"), "{error}");
}

#[test]
fn what_other_programs_take_is_taken_with_a_warning() {
    let read = |name: &str, bytes: Vec<u8>| {
        let loaded = Sample::one("odd", name, bytes).loaded();
        let warnings = loaded.report.warnings.clone();
        (stored(&grid(loaded)), warnings)
    };
    let ramp: Vec<f64> = (1..=24).map(f64::from).collect();
    let (values, warnings) = read("a.nii", file(&[(72, 16)], &[]));
    assert_eq!((values, warnings.len()), (ramp.clone(), 1));
    assert!(warnings[0].contains("bitpix is 16") && warnings[0].contains("u8"), "{warnings:?}");
    let (values, warnings) = read("a.nii", file(&[], &[(108, 0.0)]));
    assert_eq!((values, warnings.len()), (ramp.clone(), 1));
    assert!(warnings[0].contains("taken as 352"), "{warnings:?}");
    // A single file by the name of a pair's image.
    assert_eq!(read("a.img", file(&[], &[])), (ramp, vec![]));
}

/// Samples that begin as a gzip stream does are samples.
#[test]
fn an_image_may_begin_with_any_bytes() {
    let mut header = file(&[], &[(108, 0.0)]);
    header.truncate(352);
    header[344..348].copy_from_slice(b"ni1\0");
    let mut image: Vec<u8> = (1..=24).collect();
    image[..2].copy_from_slice(&[0x1f, 0x8b]);
    let loaded = Sample::one("pair", "a.hdr", header).with("a.img", image).loaded();
    assert_eq!(stored(&grid(loaded))[..3], [31.0, 139.0, 3.0]);
}
