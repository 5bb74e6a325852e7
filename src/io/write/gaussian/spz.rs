//! SPZ: blocks of one property each, in one gzip stream or in zstd streams.

use std::io::Write as _;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use ruzstd::encoding::{CompressionLevel, compress_to_vec};

use crate::error::{Error, Result};
use crate::io::write::gaussian::codes::{Clipped, harmonics_of, smallest_three};
use crate::num;
use crate::replace::replace;
use crate::scene::{Axes, Gaussians, TrainedMode};

/// Bits behind the point of a coordinate, where 24 bits reach far enough.
const BITS: u32 = 12;

/// The largest coordinate, in steps.
const MOST: f64 = 8_388_607.0;

pub(super) fn write(path: &Path, splats: &Gaussians, version: u32) -> Result<Vec<String>> {
    if !(3..=4).contains(&version) {
        return Err(Error::invalid("SPZ version", format!("{version}: must be 3 or 4")));
    }
    let Ok(count) = u32::try_from(splats.len()) else {
        return Err(Error::invalid("splats", format!("{}: SPZ holds fewer than 2^32", splats.len())));
    };
    let splats = &splats.turned(Axes::Rub);
    let (bits, mut notes) = fraction(splats);
    let mut clipped = Clipped::default();
    let blocks = blocks(splats, bits, &mut clipped);
    notes.extend(clipped.note());
    let blocks: Vec<&Vec<u8>> = blocks.iter().filter(|block| !block.is_empty()).collect();

    let mut header = b"NGSP".to_vec();
    header.extend(version.to_le_bytes());
    header.extend(count.to_le_bytes());
    let streams = if version == 4 { blocks.len() } else { 0 };
    let antialiased = u32::from(splats.mode() == TrainedMode::Antialiased);
    header.extend(
        [splats.degree(), bits, antialiased, num::count(streams)].map(|number| number.to_le_bytes()[0]),
    );
    replace(path, |writer| {
        if version == 3 {
            let mut packed = GzEncoder::new(writer, Compression::default());
            packed.write_all(&header)?;
            blocks.iter().try_for_each(|block| packed.write_all(block))?;
            return packed.finish().map(drop);
        }
        // The table follows the header.
        header.extend(32_u32.to_le_bytes());
        header.extend([0; 12]);
        writer.write_all(&header)?;
        let packed: Vec<Vec<u8>> =
            blocks.iter().map(|block| compress_to_vec(block.as_slice(), CompressionLevel::Fastest)).collect();
        for (packed, block) in packed.iter().zip(&blocks) {
            for size in [packed.len(), block.len()] {
                writer.write_all(&num::wide(size).to_le_bytes())?;
            }
        }
        packed.iter().try_for_each(|packed| writer.write_all(packed))
    })?;
    Ok(notes)
}

/// Returns the bits behind the point with which all coordinates fit, and a note if they are others than usual.
fn fraction(splats: &Gaussians) -> (u32, Vec<String>) {
    let [low, high] = splats.bounds();
    let farthest = low.abs().max(high.abs()).max_element();
    // A scene of less than a unit of length would be coarse.
    let usual = if (high - low).max_element() < 1.0 { 20 } else { BITS };
    let bits = (0..=usual).rev().find(|bits| (farthest * f64::from(1 << bits)).round() <= MOST).unwrap_or(0);
    let note = (bits != BITS).then(|| format!("coordinates are multiples of 2^-{bits}"));
    (bits, note.into_iter().collect())
}

/// Returns the blocks: positions, opacities, colours, lengths, rotations, harmonics.
fn blocks(splats: &Gaussians, bits: u32, clipped: &mut Clipped) -> [Vec<u8>; 6] {
    let [mut positions, mut opacities, mut colours, mut scales, mut rotations, mut harmonics] =
        [const { Vec::new() }; 6];
    let byte = |clipped: &mut Clipped, what: &'static str, value: f64| {
        clipped.code(what, value, 255).to_le_bytes()[0]
    };
    for i in 0..splats.len() {
        for x in splats.centres()[i] {
            let steps = (f64::from(x) * f64::from(1_u32 << bits)).round();
            let within = steps.clamp(-MOST, MOST);
            if steps != within {
                clipped.count("coordinates");
            }
            // The two's complement of 24 bits.
            let code = num::u32_of(if within < 0.0 { within + 16_777_216.0 } else { within });
            positions.extend_from_slice(&code.to_le_bytes()[..3]);
        }
        opacities.push(byte(clipped, "opacities", 255.0 * f64::from(splats.opacities()[i])));
        let own = harmonics_of(splats, i);
        for k in &own[..3] {
            colours.push(byte(clipped, "colours", 255.0 * (0.15 * f64::from(*k) + 0.5)));
        }
        for log in splats.log_scales()[i] {
            scales.push(byte(clipped, "lengths", 16.0 * (f64::from(log) + 10.0)));
        }
        let [w, x, y, z] = splats.rotations()[i];
        let (largest, others) = smallest_three([x, y, z, w]);
        let word = others.into_iter().fold(largest, |word, part| {
            let size = clipped.code("rotations", 511.0 * std::f64::consts::SQRT_2 * part.abs(), 511);
            word << 10 | u32::from(part < 0.0) << 9 | size
        });
        rotations.extend(word.to_le_bytes());
        for k in &own[3..] {
            harmonics.push(byte(clipped, "harmonics", 128.0 * f64::from(*k) + 128.0));
        }
    }
    [positions, opacities, colours, scales, rotations, harmonics]
}
