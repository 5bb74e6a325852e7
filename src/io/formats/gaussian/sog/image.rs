//! Lossless WebP images, whose colours are not multiplied by alpha.

use std::io::Cursor;

use image_webp::WebPDecoder;

use crate::error::Result;
use crate::io::file::budget::Budget;
use crate::io::file::source::Source;
use crate::io::file::text::{plain, shown};
use crate::num;

/// A decoded image.
pub(super) struct Image {
    pub(super) width: usize,
    pub(super) height: usize,
    channels: usize,
    bytes: Vec<u8>,
}

/// Memory of tables of Huffman codes for each byte of a stream. A code of 2,328 symbols takes 135 bytes at least, and becomes a tree
/// and a table of 79 KB.
const TABLES: u64 = 600;
/// The greatest number of tables that a stream can announce: five for each of 65,536 groups, one of which has more than 256
/// symbols.
const MOST_TABLES: u64 = 65_536 * (79 + 4 * 13) * 1024;

impl Image {
    /// Decodes an image with at least `least` pixels.
    pub(super) fn decode(
        source: &Source,
        name: &str,
        bytes: &[u8],
        budget: &mut Budget,
        least: usize,
    ) -> Result<Self> {
        let wrong = |rule: String| source.error(format!("image {}", shown(name)), rule);
        let damaged =
            |error: image_webp::DecodingError| wrong(format!("no WebP image: {}", plain(&error.to_string())));
        let mut decoder = WebPDecoder::new(Cursor::new(bytes)).map_err(damaged)?;
        if decoder.is_lossy() || decoder.is_animated() {
            return Err(wrong("must be a lossless WebP image, and a single one".to_owned()));
        }
        let (width, height) = decoder.dimensions();
        let (width, height) = (num::index(width), num::index(height));
        let pixels = width.saturating_mul(height);
        if pixels < least.max(1) {
            return Err(wrong(format!("{width} x {height} pixels: must be at least {}", least.max(1))));
        }
        let channels = if decoder.has_alpha() { 4 } else { 3 };
        // Without alpha the decoder has four channels as well. Transforms have a pixel for 16 at most, three times.
        let size = num::wide(pixels).saturating_mul(num::wide(channels));
        let beside = num::wide(pixels).saturating_mul(if channels == 4 { 2 } else { 6 });
        let tables = num::wide(bytes.len()).saturating_mul(TABLES).min(MOST_TABLES);
        budget.take(name, size.saturating_add(beside).saturating_add(tables))?;
        let mut decoded = Vec::new();
        let count = usize::try_from(size).unwrap_or(usize::MAX);
        decoded.try_reserve_exact(count).map_err(|_| wrong("memory is full".to_owned()))?;
        decoded.resize(count, 0);
        decoder.read_image(&mut decoded).map_err(damaged)?;
        budget.put_back(beside.saturating_add(tables));
        Ok(Self { width, height, channels, bytes: decoded })
    }

    /// Returns red, green, blue and alpha.
    pub(super) fn pixel(&self, i: usize) -> [u8; 4] {
        match self.bytes.get(i * self.channels..(i + 1) * self.channels) {
            Some(&[r, g, b, a]) => [r, g, b, a],
            Some(&[r, g, b]) => [r, g, b, 255],
            _ => [0; 4],
        }
    }

    /// Frees the image.
    pub(super) fn put_back(self, budget: &mut Budget) {
        budget.put_back(num::wide(self.bytes.len()));
    }
}
