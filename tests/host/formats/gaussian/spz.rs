//! SPZ, versions 1 to 4: blocks, extensions, headers that lie.

use ruzstd::encoding::{CompressionLevel, compress_to_vec};
use volraster::scene::{Axes, TrainedMode};

use super::super::support::*;

/// The blocks of three splats.
fn blocks(version: u32, degree: usize) -> Vec<Vec<u8>> {
    let positions = if version == 1 {
        [0x3c00_u16, 0xc000, 0x3800].repeat(3).iter().flat_map(|half| half.to_le_bytes()).collect()
    } else {
        // 1, -2, 0.5 at 12 bits.
        [[0_u8, 0x10, 0], [0, 0xe0, 0xff], [0, 8, 0]].as_flattened().repeat(3)
    };
    let rotations = if version < 3 {
        [255_u8, 128, 128, 0, 128, 128, 128, 128, 128].to_vec()
    } else {
        [3_u32 << 30, 0, 3 << 30 | 1023 << 10].iter().flat_map(|word| word.to_le_bytes()).collect()
    };
    vec![
        positions,
        vec![0, 51, 255],
        vec![0, 255, 128, 0, 0, 0, 10, 20, 30],
        vec![160, 144, 128, 0, 255, 16, 96, 96, 96],
        rotations,
        (0..3 * 3 * degree * (degree + 2)).map(|i| (i * 5 % 256) as u8).collect(),
    ]
}

fn header(version: u32, degree: u8, flags: u8, last: u8) -> Vec<u8> {
    let mut out = b"NGSP".to_vec();
    out.extend(version.to_le_bytes());
    out.extend(3_u32.to_le_bytes());
    out.extend([degree, 12, flags, last]);
    out
}

fn extension(kind: u32, payload: &[u8]) -> Vec<u8> {
    [&kind.to_le_bytes()[..], &(payload.len() as u32).to_le_bytes(), payload].concat()
}

/// A file of versions 1 to 3, before it is packed.
fn plain(version: u32, degree: u8, flags: u8, extensions: &[u8]) -> Vec<u8> {
    let blocks = blocks(version, degree.into()).concat();
    [header(version, degree, flags, 0), blocks, extensions.to_vec()].concat()
}

fn packed(version: u32, degree: u8) -> Vec<u8> {
    gzip(&plain(version, degree, 0, &[]))
}

/// A file of version 4.
fn streams(degree: u8, flags: u8, extensions: &[u8]) -> Vec<u8> {
    let blocks: Vec<Vec<u8>> =
        blocks(4, degree.into()).into_iter().filter(|block| !block.is_empty()).collect();
    let packed: Vec<Vec<u8>> =
        blocks.iter().map(|block| compress_to_vec(block.as_slice(), CompressionLevel::Fastest)).collect();
    let mut out = header(4, degree, flags, blocks.len() as u8);
    out.extend((32 + extensions.len() as u32).to_le_bytes());
    out.extend([0; 12]);
    out.extend(extensions);
    for (block, packed) in blocks.iter().zip(&packed) {
        out.extend((packed.len() as u64).to_le_bytes());
        out.extend((block.len() as u64).to_le_bytes());
    }
    out.extend(packed.concat());
    out
}

const AXES: u32 = 0xadbe_0003;

pub fn samples() -> Vec<Sample> {
    let other = extension(7, b"unknown");
    let axes = extension(AXES, &8_u32.to_le_bytes());
    let both = [other, axes].concat();
    vec![
        Sample::one("version 1", "a.spz", packed(1, 0)),
        Sample::one("version 2", "a.spz", packed(2, 1)),
        Sample::one("version 3", "a.spz", gzip(&plain(3, 3, 2, &both))),
        Sample::one("version 4", "a.spz", streams(0, 0, &[])),
        Sample::one("version 4, degree 4", "a.spz", streams(4, 3, &both)),
    ]
}

#[test]
fn blocks_are_decoded_in_every_version() {
    for version in 1..=4 {
        for degree in 0..=4 {
            let bytes = if version < 4 { packed(version, degree) } else { streams(degree, 0, &[]) };
            let loaded = Sample::one("blocks", "a.spz", bytes).loaded();
            assert_eq!(loaded.report.format, format!("SPZ {version}"));
            let splats = gaussians(loaded);
            assert_eq!((splats.len(), splats.degree(), splats.axes()), (3, degree.into(), Axes::Rub));
            assert_eq!(splats.centres(), [[1.0, -2.0, 0.5]; 3]);
            assert_eq!(splats.opacities(), [0.0, 0.2, 1.0]);
            assert_eq!(
                splats.log_scales(),
                [[0.0, -1.0, -2.0], [-10.0, 255.0 / 16.0 - 10.0, -9.0], [-4.0; 3]]
            );
            let width = 3 * (usize::from(degree) + 1).pow(2);
            assert!((splats.harmonics()[0] + 0.5 / 0.15).abs() < 1e-6);
            assert!((splats.harmonics()[1] - 0.5 / 0.15).abs() < 1e-6);
            let rest: Vec<f32> = splats.harmonics().chunks(width).flat_map(|own| own[3..].to_vec()).collect();
            for (i, found) in rest.into_iter().enumerate() {
                assert_eq!(found, ((i * 5 % 256) as f32 - 128.0) / 128.0);
            }
            let half = 0.5_f32.sqrt();
            let expected = if version < 3 {
                [[0.0, 1.0, 0.004, 0.004], [0.0, -1.0, 0.004, 0.004], [1.0, 0.004, 0.004, 0.004]]
            } else {
                [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [half, 0.0, -half, 0.0]]
            };
            for (found, expected) in splats.rotations().iter().zip(expected) {
                assert!(
                    found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-3),
                    "{found:?} {expected:?}"
                );
            }
        }
    }
}

#[test]
fn extensions_and_flags_are_understood() {
    let axes = |number: u32| extension(AXES, &number.to_le_bytes());
    let other = extension(0xadbe_0002, &[1; 12]);
    for version in [3, 4] {
        let file = |flags: u8, extensions: &[u8]| {
            let bytes = if version == 3 {
                gzip(&plain(3, 1, flags, extensions))
            } else {
                streams(1, flags, extensions)
            };
            Sample::one("extensions", "a.spz", bytes)
        };
        for (number, own, x) in [
            (6, Axes::Rdf, 1.0),
            (7, Axes::Luf, 1.0),
            (8, Axes::Luf, -1.0),
            (12, Axes::Rfu, 1.0),
            (0, Axes::Rub, 1.0),
        ] {
            let loaded = file(3, &[other.clone(), axes(number)].concat()).loaded();
            assert!(loaded.report.notes[0].contains("0xadbe0002 left out"), "{:?}", loaded.report.notes);
            let splats = gaussians(loaded);
            assert_eq!((splats.axes(), splats.centres()[0][0]), (own, x), "{number}");
            assert_eq!(splats.mode(), TrainedMode::Antialiased);
        }
        file(2, &axes(17)).refused(&["axes 17: must be 0 to 16"]);
        file(2, &extension(AXES, &[0; 3])).refused(&["axes take 4"]);
        let mut long = other.clone();
        long[4] = 200;
        let rule = if version == 3 { "188 more bytes are announced" } else { "longer than what follows" };
        file(2, &long).refused(&["byte", rule]);
        let rule = if version == 3 { "data: ends too early" } else { "ends early" };
        file(2, &axes(6)[..6]).refused(&[rule]);
    }
    // Not announced: excess data.
    Sample::one("excess", "a.spz", gzip(&plain(3, 0, 0, &axes(6))))
        .refused(&["more than the header announces"]);
}

#[test]
fn headers_that_lie_are_refused() {
    let change = |bytes: &[u8], at: usize, value: u8| {
        let mut bytes = bytes.to_vec();
        bytes[at] = value;
        bytes
    };
    let legacy = |at: usize, value: u8, parts: &[&str]| {
        Sample::one("legacy", "a.spz", gzip(&change(&plain(2, 1, 0, &[]), at, value))).refused(parts);
    };
    legacy(4, 0, &["version 0: must be 1 to 4"]);
    legacy(4, 5, &["version 5"]);
    legacy(4, 4, &["version 4: must not be a gzip stream"]);
    legacy(11, 255, &["splats: more than"]);
    legacy(8, 4, &["data", "ends too early"]);
    legacy(8, 2, &["more than the header announces"]);
    legacy(8, 0, &["more than the header announces"]);
    legacy(12, 5, &["degree 5: must be 0 to 4"]);
    legacy(13, 25, &["25 fractional bits"]);
    Sample::one("not packed", "a.spz", plain(2, 0, 0, &[])).refused(&["version 2: must be a gzip stream"]);
    Sample::one("short", "a.spz", gzip(b"NGSP\x02\0\0\0")).refused(&["header", "ends early"]);
    let whole = streams(1, 0, &[]);
    let new = |at: usize, value: u8, parts: &[&str]| {
        Sample::one("streams", "a.spz", change(&whole, at, value)).refused(parts);
    };
    new(15, 5, &["5 streams: 6 are needed"]);
    new(16, 31, &["table of streams", "byte 31"]);
    new(18, 255, &["table of streams", "must lie between"]);
    new(32, 1, &["do not end with the file"]);
    new(39, 255, &["do not end with the file"]);
    new(40, 28, &["28 bytes of positions: 3 splats have 27"]);
    new(32 + 6 * 16, 0, &["stream of positions", "no zstd stream"]);
    new(8, 4, &["bytes of positions: 4 splats have 36"]);
    // A byte behind the end of the last stream, which the table counts.
    let mut behind = whole.clone();
    behind.push(0);
    behind[32 + 16 * 5] += 1;
    Sample::one("behind", "a.spz", behind).refused(&["stream of harmonics", "1 bytes follow its end"]);
    let mut long = whole.clone();
    long.push(0);
    Sample::one("long", "a.spz", long).refused(&["do not end with the file"]);
    Sample::one("cut", "a.spz", &whole[..whole.len() - 1]).refused(&["do not end with the file"]);
}
