//! Samples of a stack as words of a storage buffer, as `glsl/stack.glsl` reads them.
//!
//! One word a sample, whatever its type, in the order of the stack's texels. Eight bits: the sample and its neighbours to the
//! right, above and above to the right, so that one word serves a bilinear look-up. Sixteen bits: the sample and its
//! neighbour to the right. Floats stand alone. At the last row and column the neighbour is the sample itself.

use std::sync::Arc;

use crate::gpu::Buffer;
use crate::num;
use crate::scene::{Grid, Samples};

/// A stack on the device.
#[derive(Debug)]
pub(crate) struct StackWords {
    pub(crate) axis: usize,
    pub(crate) buffer: Arc<Buffer>,
    /// Bits of a sample.
    pub(crate) bits: u32,
    /// Value of a stored number: `scale * stored + offset`.
    pub(crate) scale: f32,
    pub(crate) offset: f32,
}

/// Bytes of a grid's samples as words.
pub(crate) fn bytes(grid: &Grid) -> u64 {
    4 * num::wide(grid.samples().len())
}

/// Bits of a stored number, and what an all-zero one stands for.
pub(crate) fn code(samples: &Samples) -> (u32, f64) {
    match samples {
        Samples::U8(_) => (8, 0.0),
        Samples::U16(_) => (16, 0.0),
        // The smallest becomes 0.
        Samples::I16(_) => (16, -32768.0),
        Samples::F32(_) => (32, 0.0),
    }
}

/// Words of samples that lie in a stack's order, `dims` samples along each of its axes. `float` is what becomes of floats.
pub(crate) fn words(samples: &Samples, dims: [u32; 3], float: impl Fn(f32) -> f32) -> Vec<u32> {
    let [width, height, _] = dims.map(num::index);
    match samples {
        Samples::U8(v) => neighbourhoods(v, width, height, |row, above, x, right| {
            u32::from_le_bytes([row[x], row[right], above[x], above[right]])
        }),
        Samples::U16(v) => neighbourhoods(v, width, height, |row, _, x, right| {
            u32::from(row[x]) | u32::from(row[right]) << 16
        }),
        Samples::I16(v) => {
            let code = |value: i16| u32::from(value.cast_unsigned() ^ 0x8000);
            neighbourhoods(v, width, height, |row, _, x, right| code(row[x]) | code(row[right]) << 16)
        }
        Samples::F32(v) => v.iter().map(|&value| float(value).to_bits()).collect(),
    }
}

/// A word for each sample, from its row, the row above and the places of the sample and of its neighbour to the right.
fn neighbourhoods<T: Copy>(
    values: &[T],
    width: usize,
    height: usize,
    word: impl Fn(&[T], &[T], usize, usize) -> u32,
) -> Vec<u32> {
    let mut words = Vec::with_capacity(values.len());
    for slice in values.chunks_exact(width * height) {
        for y in 0..height {
            let row = &slice[y * width..][..width];
            let above = &slice[(y + 1).min(height - 1) * width..][..width];
            words.extend((0..width - 1).map(|x| word(row, above, x, x + 1)));
            words.push(word(row, above, width - 1, width - 1));
        }
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_holds_the_neighbourhood_and_repeats_the_edge() {
        let bytes: Vec<u8> = (0..12).collect();
        let got = words(&Samples::U8(bytes), [3, 2, 2], |x| x);
        assert_eq!(got.len(), 12);
        assert_eq!(got[0].to_le_bytes(), [0, 1, 3, 4]);
        assert_eq!(got[2].to_le_bytes(), [2, 2, 5, 5]);
        assert_eq!(got[3].to_le_bytes(), [3, 4, 3, 4]);
        assert_eq!(got[11].to_le_bytes(), [11, 11, 11, 11]);

        let pair = |word: u32| [word & 0xffff, word >> 16];
        let got = words(&Samples::U16(vec![7, 65535, 3]), [3, 1, 1], |x| x);
        assert_eq!(got.iter().map(|&w| pair(w)).collect::<Vec<_>>(), [[7, 65535], [65535, 3], [3, 3]]);
        let got = words(&Samples::I16(vec![i16::MIN, -1, i16::MAX]), [3, 1, 1], |x| x);
        assert_eq!(pair(got[0]), [0, 32767]);
        assert_eq!(pair(got[2]), [65535, 65535]);

        let got = words(&Samples::F32(vec![f32::INFINITY, 2.5]), [1, 1, 2], |x| x.min(9.0));
        assert_eq!(got, [9.0_f32.to_bits(), 2.5_f32.to_bits()]);
    }
}
