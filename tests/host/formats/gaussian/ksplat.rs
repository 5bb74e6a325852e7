//! `.ksplat`: sections of records at three levels of compression, known by the file name.

use volraster::scene::Axes;
use volraster::scene::harmonics::C0;

use super::super::support::*;

/// A section to write: splats, places for them, splats in a bucket, full buckets, sizes of others, degree.
#[derive(Clone, Copy)]
struct Part<'a> {
    count: usize,
    most: usize,
    capacity: u32,
    full: u32,
    partial: &'a [u32],
    degree: usize,
}

const PART: Part<'static> = Part { count: 5, most: 5, capacity: 2, full: 2, partial: &[1], degree: 0 };

const fn half(value: u8) -> u16 {
    // 0, 1, 2 and 0.5.
    match value {
        0 => 0,
        1 => 0x3c00,
        2 => 0x4000,
        _ => 0x3800,
    }
}

/// The bytes of a coefficient: its place in the record, 0 to 2, and 1/2 for 3.
fn coefficients(level: u16, degree: usize) -> Vec<u8> {
    (0..3 * degree * (degree + 2))
        .flat_map(|place| match level {
            0 => [0.0_f32, 1.0, 2.0, 0.5][place % 4].to_le_bytes().to_vec(),
            1 => half((place % 4) as u8).to_le_bytes().to_vec(),
            _ => vec![(place * 5 % 256) as u8],
        })
        .collect()
}

fn record(level: u16, degree: usize, i: usize) -> Vec<u8> {
    let position = [1.0_f32, 2.0, 3.0].map(|x| x + i as f32);
    let shape = [1_u8, 2, 3, 0, 1, 0, 0];
    let mut out: Vec<u8> = if level == 0 {
        let shape = shape.map(|value| [0.0_f32, 1.0, 2.0, 0.5][usize::from(value)]);
        position.into_iter().chain(shape).flat_map(f32::to_le_bytes).collect()
    } else {
        // Units of 5 / 2 / 1000 around 1000.
        let steps = [1000_u16, 1400, 600 + i as u16];
        steps.into_iter().chain(shape.map(half)).flat_map(u16::to_le_bytes).collect()
    };
    out.extend([255, 0, 51, 204]);
    out.extend(coefficients(level, degree));
    out
}

fn section(level: u16, part: Part, header: &mut Vec<u8>, data: &mut Vec<u8>) {
    let Part { count, most, capacity, full, partial, degree } = part;
    let buckets = full + partial.len() as u32;
    let mut own = Vec::new();
    for word in [count as u32, most as u32, capacity, buckets] {
        own.extend(word.to_le_bytes());
    }
    own.extend(5.0_f32.to_le_bytes());
    own.extend([12, 0, 0, 0]);
    for word in [1000, 0, full, partial.len() as u32] {
        own.extend(u32::to_le_bytes(word));
    }
    own.extend((degree as u16).to_le_bytes());
    own.resize(1024, 0);
    header.extend(own);
    partial.iter().for_each(|size| data.extend(size.to_le_bytes()));
    for bucket in 0..buckets {
        [10.0, 0.0, bucket as f32].iter().for_each(|x| data.extend(x.to_le_bytes()));
    }
    (0..most).for_each(|i| data.extend(record(level, degree, i)));
}

fn file(level: u16, parts: &[Part]) -> Vec<u8> {
    let mut out = vec![0, 1, 0, 0];
    let count: usize = parts.iter().map(|part| part.count).sum();
    for word in [parts.len(), parts.len(), count, count] {
        out.extend((word as u32).to_le_bytes());
    }
    out.extend(level.to_le_bytes());
    out.resize(36, 0);
    out.extend([-2.0_f32, 3.1].iter().flat_map(|limit| limit.to_le_bytes()));
    out.resize(4096, 0);
    let mut data = Vec::new();
    parts.iter().for_each(|part| section(level, *part, &mut out, &mut data));
    out.extend(data);
    out
}

pub fn samples() -> Vec<Sample> {
    let sample = |what, level, parts: &[Part]| Sample::one(what, "a.ksplat", file(level, parts));
    vec![
        sample("level 0", 0, &[PART]),
        sample("level 1", 1, &[Part { degree: 1, most: 7, ..PART }, PART]),
        sample("level 2", 2, &[Part { degree: 3, ..PART }]),
    ]
}

#[test]
fn records_are_decoded_at_every_level() {
    for level in 0..=2 {
        for degree in 0..=3 {
            let loaded = Sample::one("records", "a.ksplat", file(level, &[Part { degree, ..PART }])).loaded();
            assert_eq!(loaded.report.format, format!("ksplat 0.1, level {level}"));
            assert!(loaded.report.notes.is_empty(), "{:?}", loaded.report.notes);
            let splats = gaussians(loaded);
            assert_eq!((splats.len(), splats.degree(), splats.axes()), (5, degree as u32, Axes::Rdf));
            // Two full buckets of two splats, and one splat.
            let expected = [0, 1, 2, 3, 4].map(|i| match level {
                0 => [1.0, 2.0, 3.0].map(|x| x + i as f32),
                _ => [10.0, 1.0, (i / 2) as f32 - 1.0 + i as f32 * 0.0025],
            });
            for (found, expected) in splats.centres().iter().zip(expected) {
                assert!(
                    found.iter().zip(expected).all(|(a, b): (&f32, f32)| (a - b).abs() < 1e-6),
                    "{found:?} {expected:?}"
                );
            }
            assert_eq!(splats.log_scales(), [[0.0, 2.0_f32.ln(), 0.5_f32.ln()]; 5]);
            assert_eq!(splats.rotations(), [[0.0, 1.0, 0.0, 0.0]; 5]);
            assert_eq!(splats.opacities(), [0.8; 5]);
            let own = &splats.harmonics()[..3 * (degree + 1) * (degree + 1)];
            for (found, byte) in own.iter().zip([255.0, 0.0, 51.0]) {
                assert!((f64::from(*found) - (byte / 255.0 - 0.5) / C0).abs() < 1e-6);
            }
            // All coefficients of a channel of a degree are together.
            let mut place = 0;
            for l in 1..=degree {
                for channel in 0..3 {
                    for function in l * l..(l + 1) * (l + 1) {
                        let expected = match level {
                            0 | 1 => [0.0, 1.0, 2.0, 0.5][place % 4],
                            _ => -2.0 + (place * 5 % 256) as f32 / 255.0 * 5.1,
                        };
                        let found = own[3 * function + channel];
                        assert!((found - expected).abs() < 1e-5, "{l} {channel} {function}");
                        place += 1;
                    }
                }
            }
        }
    }
}

#[test]
fn sections_follow_each_other_with_places_left_empty() {
    for level in 0..=2 {
        let parts = [
            Part { most: 9, degree: 1, ..PART },
            Part { count: 0, most: 3, ..PART },
            Part { count: 3, most: 3, capacity: 9, full: 0, partial: &[1, 2], degree: 0 },
        ];
        let splats = gaussians(Sample::one("sections", "a.ksplat", file(level, &parts)).loaded());
        assert_eq!((splats.len(), splats.degree()), (8, 1));
        assert_eq!(splats.centres()[0], splats.centres()[5]);
        if level > 0 {
            // Buckets of one and two.
            let z = splats.centres()[5..].iter().map(|centre| centre[2]).collect::<Vec<_>>();
            assert!(z[0] == -1.0 && (z[1] - 0.0025).abs() < 1e-6 && (z[2] - 0.005).abs() < 1e-6, "{z:?}");
        }
        // The coefficients that a section lacks are 0.
        assert!(splats.harmonics()[5 * 12 + 3..].chunks(12).all(|own| own[..9] == [0.0; 9]));
    }
}

#[test]
fn headers_without_limits_have_the_defaults() {
    let mut bytes = file(2, &[Part { degree: 1, ..PART }]);
    bytes[36..44].fill(0);
    bytes[4096 + 24..4096 + 28].fill(0);
    let splats = gaussians(Sample::one("defaults", "a.ksplat", bytes).loaded());
    assert_eq!(splats.harmonics()[3], -1.5);
    let expected = (1400.0 - 32_767.0) * 2.5 / 32_767.0;
    assert!((f64::from(splats.centres()[0][1]) - expected).abs() < 1e-6);
}

#[test]
fn headers_that_lie_are_refused() {
    let whole = file(1, &[PART, Part { degree: 1, ..PART }]);
    let change = |changes: &[(usize, u8)], parts: &[&str]| {
        let mut bytes = whole.clone();
        changes.iter().for_each(|(at, value)| bytes[*at] = *value);
        Sample::one("changed", "a.ksplat", bytes).refused(parts);
    };
    let second = 4096 + 1024;
    change(&[(0, 1)], &["version 1.1: must be 0.1"]);
    change(&[(1, 2)], &["version 0.2"]);
    change(&[(20, 3)], &["compression level 3: must be 0 to 2"]);
    change(&[(7, 255)], &["sections: their headers need"]);
    change(&[(4, 1)], &["sections end at byte"]);
    change(&[(second + 40, 4)], &["section 1", "degree 4: must be 0 to 3"]);
    change(&[(second, 6)], &["6 splats: there are places for 5"]);
    change(&[(second + 20, 16)], &["16 bytes for a bucket"]);
    change(&[(second + 32, 3)], &["3 full and 1 partial buckets", "centres of 3"]);
    change(&[(second + 7, 255)], &["section 1", "ends at byte"]);
    change(&[(second + 15, 255)], &["section 1", "ends at byte"]);
    change(&[(second + 8, 1)], &["5 splats: the buckets hold 3"]);
    change(&[(second + 40, 0)], &["sections end at byte"]);
    Sample::one("short", "a.ksplat", &whole[..4000]).refused(&["header", "4000 bytes: must have 4096"]);
    Sample::one("cut", "a.ksplat", &whole[..whole.len() - 1]).refused(&["section 1", "ends at byte"]);
    Sample::one("long", "a.ksplat", [&whole[..], &[0]].concat()).refused(&["sections end at byte"]);
    Sample::one("packed", "a.ksplat", gzip(&whole)).refused(&["gzip"]);
    Sample::one("no sections", "a.ksplat", file(0, &[])).refused(&["at least one"]);
    let mut more = whole.clone();
    more[16] = 99;
    let loaded = Sample::one("announced", "a.ksplat", more).loaded();
    assert_eq!(loaded.report.notes, ["the header announces 99 splats, the sections have 10"]);
}
