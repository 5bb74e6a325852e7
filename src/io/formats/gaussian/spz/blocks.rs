//! The blocks of splats: one property of all of them each.

use crate::io::build::gaussians::Columns;
use crate::io::file::half::from_half;
use crate::num;
use crate::scene::harmonics;

/// A property of all splats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Block {
    Positions,
    Opacities,
    Colours,
    Scales,
    Rotations,
    Harmonics,
}

impl Block {
    /// The blocks, in the order of the file.
    pub(super) const ALL: [Self; 6] =
        [Self::Positions, Self::Opacities, Self::Colours, Self::Scales, Self::Rotations, Self::Harmonics];

    /// Returns the name for messages.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Positions => "positions",
            Self::Opacities => "opacities",
            Self::Colours => "colours",
            Self::Scales => "scales",
            Self::Rotations => "rotations",
            Self::Harmonics => "harmonics",
        }
    }
}

/// The properties of a file that decide how the bytes of its splats are read.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coding {
    pub(super) version: u32,
    /// Bits behind the point of a coordinate.
    pub(super) bits: u8,
    pub(super) degree: u32,
}

/// Range of the constant coefficient: a byte is ½ ± ½ of `1 / COLOUR`.
pub(super) const COLOUR: f64 = 0.15;

impl Coding {
    /// Returns the bytes of a splat in a block.
    pub(super) fn width(self, block: Block) -> usize {
        match block {
            Block::Positions if self.version == 1 => 6,
            Block::Positions => 9,
            Block::Opacities => 1,
            Block::Colours | Block::Scales => 3,
            Block::Rotations if self.version < 3 => 3,
            Block::Rotations => 4,
            Block::Harmonics => 3 * (harmonics::count(self.degree) - 1),
        }
    }

    /// Decodes a splat of a block, with as many bytes as [`Self::width`] says.
    pub(super) fn decode(self, block: Block, row: &[u8], columns: &mut Columns, i: usize) {
        let byte = |k: usize| f64::from(row[k]);
        let parts = &mut columns.parts;
        match block {
            Block::Positions => {
                parts.centres[i] = [0, 1, 2].map(|k| {
                    if self.version == 1 {
                        from_half(u16::from_le_bytes([row[2 * k], row[2 * k + 1]]))
                    } else {
                        // The sign is in the highest of 24 bits.
                        let high = [0, row[3 * k], row[3 * k + 1], row[3 * k + 2]];
                        let fixed = i32::from_le_bytes(high) >> 8;
                        num::f32_of(f64::from(fixed) / f64::from(1_u32 << self.bits))
                    }
                });
            }
            Block::Opacities => parts.opacities[i] = num::f32_of(byte(0) / 255.0),
            Block::Colours => {
                for (k, c) in columns.harmonics(i).iter_mut().zip(0..3) {
                    *k = num::f32_of((byte(c) / 255.0 - 0.5) / COLOUR);
                }
            }
            Block::Scales => {
                parts.log_scales[i] = [0, 1, 2].map(|k| num::f32_of(byte(k) / 16.0 - 10.0));
            }
            Block::Rotations if self.version < 3 => {
                let [x, y, z] = [0, 1, 2].map(|k| byte(k) / 127.5 - 1.0);
                let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
                parts.rotations[i] = [w, x, y, z].map(num::f32_of);
            }
            Block::Rotations => {
                let word = u32::from_le_bytes([row[0], row[1], row[2], row[3]]);
                parts.rotations[i] = smallest_three(word).map(num::f32_of);
            }
            Block::Harmonics => {
                for (k, byte) in columns.harmonics(i)[3..].iter_mut().zip(row) {
                    *k = (f32::from(*byte) - 128.0) / 128.0;
                }
            }
        }
    }
}

/// Returns the quaternion w, x, y, z of a word: two bits tell the largest of x, y, z, w, which is left out; the others follow
/// with sign and magnitude.
fn smallest_three(word: u32) -> [f64; 4] {
    let part = |shift: u32| {
        let bits = word >> shift;
        let size = f64::from(bits & 511) / 511.0 * std::f64::consts::FRAC_1_SQRT_2;
        if bits & 512 == 0 { size } else { -size }
    };
    let [a, b, c] = [part(20), part(10), part(0)];
    let mut xyzw = [a, b, c, (1.0 - a * a - b * b - c * c).max(0.0).sqrt()];
    xyzw[num::index(word >> 30)..].rotate_right(1);
    let [x, y, z, w] = xyzw;
    [w, x, y, z]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotations_have_their_largest_part_where_the_word_says() {
        let word = |largest: u32, parts: [u32; 3]| largest << 30 | parts[0] << 20 | parts[1] << 10 | parts[2];
        let root = std::f64::consts::FRAC_1_SQRT_2;
        for (word, expected) in [
            (word(3, [0, 0, 0]), [1.0, 0.0, 0.0, 0.0]),
            (word(0, [0, 0, 0]), [0.0, 1.0, 0.0, 0.0]),
            (word(3, [511, 0, 0]), [root, root, 0.0, 0.0]),
            (word(3, [0, 1023, 0]), [root, 0.0, -root, 0.0]),
            (word(1, [511, 0, 1023]), [-root, root, 0.0, 0.0]),
            // More than a unit quaternion has: the largest part is 0.
            (word(2, [511, 511, 511]), [root, root, root, 0.0]),
        ] {
            let found = smallest_three(word);
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-7), "{found:?} {expected:?}");
        }
    }

    #[test]
    fn coordinates_have_a_sign_and_a_point_and_quaternions_a_last_part() {
        let source = crate::io::file::source::Source::in_memory(&[("a", b"")]).unwrap();
        let options = crate::io::options::ReadOptions::default();
        let mut budget = crate::io::file::budget::Budget::new(&source, &options);
        let mut columns = Columns::new(&source, &mut budget, 1, 0).unwrap();
        let coding = Coding { version: 3, bits: 12, degree: 0 };
        let row = [0, 0x10, 0, 0, 0xf0, 0xff, 0xff, 0xff, 0x7f];
        coding.decode(Block::Positions, &row, &mut columns, 0);
        assert_eq!(columns.parts.centres[0], [1.0, -1.0, 8_388_607.0 / 4096.0]);
        let halves = [0x00, 0x3c, 0x00, 0xc0, 0x00, 0x38];
        Coding { version: 1, ..coding }.decode(Block::Positions, &halves, &mut columns, 0);
        assert_eq!(columns.parts.centres[0], [1.0, -2.0, 0.5]);
        // The last part of a quaternion of version 2 follows from the others: 0.36, 0.48, 0 leave 0.8.
        Coding { version: 2, ..coding }.decode(Block::Rotations, &[173, 189, 128], &mut columns, 0);
        let expected = [0.8, 0.36, 0.48, 0.0];
        let found = columns.parts.rotations[0];
        assert!(found.iter().zip(expected).all(|(a, b): (&f32, f32)| (a - b).abs() < 0.005), "{found:?}");
    }
}
