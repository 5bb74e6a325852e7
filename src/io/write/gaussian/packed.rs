//! Compressed PLY: chunks of 256 splats near each other, with their ranges, and words of 32 bits for each splat.

use std::io::Write as _;
use std::path::Path;

use crate::error::Result;
use crate::io::write::gaussian::codes::{Clipped, comments, harmonics_of, smallest_three, up_to_third};
use crate::num;
use crate::replace::replace;
use crate::scene::{Axes, Gaussians, harmonics};

/// Splats of a chunk.
const CHUNK: usize = 256;

/// The least logarithm of a length: that of flat splats is not finite.
const FLAT: f32 = -Gaussians::MOST_LOG_SCALE;

pub(super) fn write(path: &Path, splats: &Gaussians, texts: &[String]) -> Result<Vec<String>> {
    let splats = &splats.turned(Axes::Rdf);
    let (degree, note) = up_to_third(splats);
    let rest = harmonics::count(degree) - 1;
    let order = by_place(splats);
    let mut clipped = Clipped::default();
    let (mut ranges, mut words) = (Vec::new(), Vec::with_capacity(16 * order.len()));
    for chunk in order.chunks(CHUNK) {
        // Positions, logarithms of lengths, colours.
        let numbers = |i: usize| {
            let scales = splats.log_scales()[i].map(|log| log.max(FLAT));
            let colour =
                [0, 1, 2].map(|c| num::f32_of(0.5 + harmonics::C0 * f64::from(harmonics_of(splats, i)[c])));
            [splats.centres()[i], scales, colour]
        };
        let mut range = [[[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]]; 3];
        for &i in chunk {
            for ([low, high], numbers) in range.iter_mut().zip(numbers(i)) {
                for (k, number) in numbers.into_iter().enumerate() {
                    (low[k], high[k]) = (low[k].min(number), high[k].max(number));
                }
            }
        }
        ranges.extend(range.as_flattened().as_flattened().iter().flat_map(|number| number.to_le_bytes()));
        for &i in chunk {
            let mut share = |of: usize, k: usize, bits: u32| {
                let [low, high] = range[of].map(|end| f64::from(end[k]));
                let most = (1 << bits) - 1;
                let share = (f64::from(numbers(i)[of][k]) - low) / (high - low).max(f64::MIN_POSITIVE);
                clipped.code("numbers", share * f64::from(most), most)
            };
            let mut triple = |of: usize| share(of, 0, 11) << 21 | share(of, 1, 10) << 11 | share(of, 2, 11);
            let (position, scale) = (triple(0), triple(1));
            let colour = [0, 1, 2].map(|c| share(2, c, 8));
            let opacity = clipped.code("opacities", 255.0 * f64::from(splats.opacities()[i]), 255);
            let colour = colour[0] << 24 | colour[1] << 16 | colour[2] << 8 | opacity;
            let (largest, others) = smallest_three(splats.rotations()[i]);
            let [a, b, c] = others.map(|part| {
                let share = part * std::f64::consts::FRAC_1_SQRT_2 + 0.5;
                clipped.code("rotations", 1023.0 * share, 1023)
            });
            let rotation = largest << 30 | a << 20 | b << 10 | c;
            words.extend([position, rotation, scale, colour].iter().flat_map(|word| word.to_le_bytes()));
        }
    }
    let mut bytes = Vec::with_capacity(3 * rest * order.len());
    for &i in &order {
        let own = harmonics_of(splats, i);
        for (c, k) in (0..3).flat_map(|c| (1..=rest).map(move |k| (c, k))) {
            bytes.push(byte(&mut clipped, own[3 * k + c]));
        }
    }
    let header = header(splats, texts, rest);
    replace(path, |writer| {
        [header.as_bytes(), &ranges, &words, &bytes].into_iter().try_for_each(|part| writer.write_all(part))
    })?;
    let flat = splats.log_scales().as_flattened().iter().filter(|log| **log < FLAT).count();
    let flat = (flat > 0).then(|| format!("{flat} lengths of 0 become e^{FLAT}"));
    Ok(note.into_iter().chain(clipped.note()).chain(flat).collect())
}

fn header(splats: &Gaussians, texts: &[String], rest: usize) -> String {
    let count = splats.len();
    let ends = ["x", "y", "z", "scale_x", "scale_y", "scale_z", "r", "g", "b"];
    let ranges: String = ends
        .chunks(3)
        .flat_map(|ends| {
            ["min", "max"].map(|end| {
                ends.iter().map(|name| format!("property float {end}_{name}\n")).collect::<String>()
            })
        })
        .collect();
    let words: String = ["position", "rotation", "scale", "color"]
        .map(|name| format!("property uint packed_{name}\n"))
        .concat();
    let sh = if rest == 0 {
        String::new()
    } else {
        let bytes: String = (0..3 * rest).map(|i| format!("property uchar f_rest_{i}\n")).collect();
        format!("element sh {count}\n{bytes}")
    };
    format!(
        "ply\nformat binary_little_endian 1.0\n{}element chunk {}\n{ranges}element vertex {count}\n{words}{sh}end_header\n",
        comments(splats, texts),
        count.div_ceil(CHUNK)
    )
}

/// Returns the byte of a coefficient: the bin from -4 to 4 that it lies in.
fn byte(clipped: &mut Clipped, coefficient: f32) -> u8 {
    if coefficient.abs() > 4.0 {
        clipped.count("harmonics");
    }
    num::u8_code(((f64::from(coefficient) / 8.0 + 0.5) * 256.0).floor())
}

/// Returns the splats in the order of a curve that fills space (Morton 1966): those of a chunk are near each other, and its ranges
/// small.
fn by_place(splats: &Gaussians) -> Vec<usize> {
    let [low, high] = splats.bounds();
    let size = (high - low).max(glam::DVec3::splat(f64::MIN_POSITIVE));
    let key = |i: usize| {
        let share = (splats.centre(i) - low) / size * f64::from(0x1f_ffff);
        share
            .to_array()
            .into_iter()
            .map(|place| spread(num::u64_of(place)))
            .enumerate()
            .map(|(k, bits)| bits << k)
            .sum::<u64>()
    };
    let mut order: Vec<(u64, usize)> = (0..splats.len()).map(|i| (key(i), i)).collect();
    order.sort_unstable();
    order.into_iter().map(|(_, i)| i).collect()
}

/// Returns a number of 21 bits with two zeros between all bits.
fn spread(number: u64) -> u64 {
    (0..21).map(|bit| (number >> bit & 1) << (3 * bit)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_spread() {
        assert_eq!(spread(0b1011), 0b1_000_001_001);
        assert_eq!(spread(0x1f_ffff), 0x1249_2492_4924_9249);
    }
}
