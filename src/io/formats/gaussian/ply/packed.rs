//! Compressed PLY files: rows of the element `chunk` hold the ranges of 256 vertices each, whose numbers are packed in
//! words of 32 bits. Coefficients of harmonics are bytes of the element `sh`.

use crate::error::Result;
use crate::io::build::gaussians::{Columns, missing};
use crate::io::file::budget::Budget;
use crate::io::file::sample_type::SampleType;
use crate::io::file::scanner::Scanner;
use crate::io::formats::gaussian::ply::properties::{about, error, find, place_of, places, rest};
use crate::io::formats::ply::header::{Element, Header};
use crate::io::options::Request;
use crate::io::report::Found;
use crate::num;

/// Vertices of a chunk.
const CHUNK: usize = 256;

const WORDS: [&str; 4] = ["packed_position", "packed_rotation", "packed_scale", "packed_color"];

/// Names of least and greatest values: of positions, of logarithms of lengths, of colours.
const RANGES: [[[&str; 3]; 2]; 3] = [
    [["min_x", "min_y", "min_z"], ["max_x", "max_y", "max_z"]],
    [["min_scale_x", "min_scale_y", "min_scale_z"], ["max_scale_x", "max_scale_y", "max_scale_z"]],
    [["min_r", "min_g", "min_b"], ["max_r", "max_g", "max_b"]],
];

/// The ranges of a chunk, in the order of [`RANGES`].
type Ranges = [[[f64; 3]; 2]; 3];

pub(super) fn read(mut scanner: Scanner, header: &Header, request: &Request) -> Result<Found> {
    let source = scanner.source();
    let mut budget = Budget::new(source, request);
    let missing_element = |name: &str| source.error(format!("element {name}"), "is missing");
    let element = |name: &str| find(header, name).map(|place| &header.elements[place]);
    let vertex = element("vertex").ok_or_else(|| missing_element("vertex"))?;
    let chunk = element("chunk").ok_or_else(|| missing_element("chunk"))?;
    if chunk.count != vertex.count.div_ceil(num::wide(CHUNK)) {
        let rule = format!("{} for {} vertices: must be one for each {CHUNK}", chunk.count, vertex.count);
        return Err(error(&scanner, chunk, rule));
    }
    let words = places(&scanner, vertex, &WORDS)?;
    if let Some(&place) = words.iter().find(|&&place| vertex.properties[place].kind != SampleType::U32) {
        let rule = format!("property {}: must be of type uint", vertex.properties[place].name);
        return Err(error(&scanner, vertex, rule));
    }
    let sh = element("sh");
    let (bytes, degree) = sh.map_or(Ok((Vec::new(), 0)), |sh| rest(&scanner, sh))?;
    if let Some(sh) = sh.filter(|sh| sh.count != vertex.count) {
        let rule = format!("{} for {} vertices: must be one for each", sh.count, vertex.count);
        return Err(error(&scanner, sh, rule));
    }

    // Memory is taken by this count, also before its element is reached.
    header.holds(&scanner, vertex)?;
    let (mut columns, mut ranges, mut packed) = (None, Vec::new(), Vec::new());
    for element in &header.elements {
        match element.name.as_str() {
            "chunk" => {
                header.holds(&scanner, element)?;
                budget.take("chunks", chunk.count.saturating_mul(num::wide(size_of::<Ranges>())))?;
                ranges = read_ranges(&mut scanner, header, chunk)?;
            }
            "vertex" => {
                header.holds(&scanner, vertex)?;
                budget.take("packed splats", vertex.count.saturating_mul(16))?;
                packed.reserve_exact(num::usize_of(num::f64_of_u64(vertex.count)));
                header.each(&mut scanner, vertex, &words, &mut |row| {
                    packed.push([0, 1, 2, 3].map(|i| num::u32_of(row[i])));
                })?;
            }
            "sh" => {
                header.holds(&scanner, element)?;
                let columns = columns.insert(Columns::new(source, &mut budget, vertex.count, degree)?);
                let mut i = 0;
                header.each(&mut scanner, element, &bytes, &mut |row| {
                    for (place, value) in row.iter().enumerate() {
                        columns.set_rest(i, place, num::f32_of(coefficient(*value)));
                    }
                    i += 1;
                })?;
            }
            _ => header.pass(&mut scanner, element)?,
        }
    }
    header.end(&mut scanner)?;
    let mut columns = match columns {
        Some(columns) => columns,
        None => Columns::new(source, &mut budget, vertex.count, degree)?,
    };
    for (i, words) in packed.iter().enumerate() {
        unpack(&mut columns, i, *words, &ranges[i / CHUNK]);
    }
    drop(packed);
    columns.finish(source, &mut budget, about(header, "compressed PLY", &["chunk", "vertex", "sh"]), request)
}

/// Reads the ranges of all chunks. Without those of colours, colours are from 0 to 1.
fn read_ranges(scanner: &mut Scanner, header: &Header, chunk: &Element) -> Result<Vec<Ranges>> {
    let has_colours = RANGES[2].as_flattened().iter().any(|name| place_of(chunk, name).is_some());
    let names = RANGES[..if has_colours { 3 } else { 2 }].as_flattened().as_flattened();
    let wanted = names
        .iter()
        .map(|name| place_of(chunk, name).ok_or_else(|| error(scanner, chunk, missing(name))))
        .collect::<Result<Vec<_>>>()?;
    let mut all = Vec::new();
    header.each(scanner, chunk, &wanted, &mut |row| {
        let mut ranges: Ranges = [[[0.0; 3], [1.0; 3]]; 3];
        for (number, value) in ranges.as_flattened_mut().as_flattened_mut().iter_mut().zip(row) {
            *number = *value;
        }
        all.push(ranges);
    })?;
    Ok(all)
}

/// Returns the coefficient of a byte: the middle of its bin, with the ends at ±4.
fn coefficient(byte: f64) -> f64 {
    match byte {
        0.0 => -4.0,
        255.0 => 4.0,
        _ => 8.0 * ((byte + 0.5) / 256.0 - 0.5),
    }
}

/// Unpacks the numbers of a splat.
fn unpack(columns: &mut Columns, i: usize, [position, rotation, scale, colour]: [u32; 4], ranges: &Ranges) {
    let share = |word: u32, shift: u32, bits: u32| {
        let most = (1_u32 << bits) - 1;
        f64::from((word >> shift) & most) / f64::from(most)
    };
    let triple = |word: u32| [share(word, 21, 11), share(word, 11, 10), share(word, 0, 11)];
    let mix = |[low, high]: &[[f64; 3]; 2], share: [f64; 3]| {
        [0, 1, 2].map(|k| low[k] * (1.0 - share[k]) + high[k] * share[k])
    };
    columns.parts.centres[i] = mix(&ranges[0], triple(position)).map(num::f32_of);
    columns.parts.log_scales[i] = mix(&ranges[1], triple(scale)).map(num::f32_of);
    let rgb = [share(colour, 24, 8), share(colour, 16, 8), share(colour, 8, 8)];
    columns.set_colour(i, mix(&ranges[2], rgb));
    columns.parts.opacities[i] = num::f32_of(share(colour, 0, 8));
    let others = [20, 10, 0].map(|shift| (share(rotation, shift, 10) - 0.5) * std::f64::consts::SQRT_2);
    columns.parts.rotations[i] = with_largest(num::index(rotation >> 30), others).map(num::f32_of);
}

/// Returns a quaternion of three of its parts in order, without the largest one, which is not negative.
fn with_largest(largest: usize, others: [f64; 3]) -> [f64; 4] {
    let [a, b, c] = others;
    let last = (1.0 - a * a - b * b - c * c).max(0.0).sqrt();
    let mut parts = [a, b, c, last];
    parts[largest..].rotate_right(1);
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_part_is_put_back_in_its_place() {
        let last = (1.0_f64 - 0.1 * 0.1 - 0.2 * 0.2 - 0.3 * 0.3).sqrt();
        for (largest, expected) in [
            (0, [last, 0.1, 0.2, 0.3]),
            (1, [0.1, last, 0.2, 0.3]),
            (2, [0.1, 0.2, last, 0.3]),
            (3, [0.1, 0.2, 0.3, last]),
        ] {
            assert_eq!(with_largest(largest, [0.1, 0.2, 0.3]), expected);
        }
        assert_eq!(with_largest(0, [0.8, 0.8, 0.8])[0], 0.0);
    }

    #[test]
    fn bytes_are_the_middles_of_their_bins() {
        assert_eq!([0.0, 255.0, 127.0, 128.0].map(coefficient), [-4.0, 4.0, -0.015_625, 0.015_625]);
    }
}
