//! NIfTI-1: the seeds of its mutations. `tests/io.rs` has its rules.

use super::support::{Sample, gzip, stored};

/// A header of 352 bytes by the standard's table of offsets, and six samples of each type.
fn file(datatype: i16, bits: i16, big: bool, magic: &[u8; 4], change: impl Fn(&mut Header)) -> Header {
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

/// Files of both byte orders, packed and not, in one file and in two.
pub fn samples() -> Vec<Sample> {
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
        Sample::one("u8", "a.nii", file(2, 8, false, single, |_| ()).with(&ramp)),
        Sample::one("packed", "a.nii.gz", gzip(&file(2, 8, false, single, |_| ()).with(&ramp))),
        Sample::one("big-endian i16, sform", "a.nii", file(4, 16, true, single, placed).with(&words)),
        Sample::one("f32, qform, rescale", "a.nii", file(16, 32, false, single, turned).with(&floats)),
        Sample::one("f64", "a.nii", file(64, 64, false, single, |_| ()).with(&wide)),
        Sample::one("pair", "a.hdr", file(2, 8, false, b"ni1\0", |_| ()).bytes).with("a.img", ramp.clone()),
        Sample::one("packed pair", "a.img.gz", gzip(&ramp))
            .with("a.hdr.gz", gzip(&file(2, 8, false, b"ni1\0", placed).bytes)),
    ]
}

#[test]
fn samples_hold_the_same() {
    for sample in samples() {
        let grid = super::support::grid(sample.loaded());
        assert_eq!(grid.dims(), [3, 2, 2], "{}", sample.what);
        assert_eq!(stored(&grid), (1..=12).map(f64::from).collect::<Vec<_>>(), "{}", sample.what);
    }
}

#[test]
fn mutations() {
    super::mutations::damage("NIfTI-1", &samples());
}
