//! Bands: tiles that are drawn together because their entries fit one buffer.

use crate::num;

/// Consecutive tiles of an image that are drawn together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Band {
    /// Number of the first tile, row by row.
    pub(crate) first: u32,
    /// Number of tiles.
    pub(crate) tiles: u32,
}

impl Band {
    /// Cuts the tiles from `begin` to before `end` into bands of at most `widest`.
    pub(crate) fn cut([begin, end]: [u32; 2], widest: u32) -> impl Iterator<Item = Self> {
        let band = move |first| Self { first, tiles: widest.min(end - first) };
        (begin..end).step_by(num::index(widest)).map(band)
    }
}

/// Cuts an image into bands of at most `soft` entries and `widest` tiles each; a tile of more entries is a band of its own.
///
/// `entries` are those of each tile. Returns the bands, and the entries of the fullest.
///
/// # Errors
///
/// The entries of a single tile that exceeds `hard`.
pub(crate) fn cut_into_bands(
    entries: impl IntoIterator<Item = u64>,
    [soft, hard]: [u64; 2],
    widest: u32,
) -> std::result::Result<(Vec<Band>, u64), u64> {
    let mut bands = vec![Band { first: 0, tiles: 0 }];
    let (mut sum, mut fullest) = (0_u64, 0_u64);
    for (tile, count) in (0_u32..).zip(entries) {
        if count > hard {
            return Err(count);
        }
        let last = bands.len() - 1;
        if (sum + count > soft && bands[last].tiles > 0) || bands[last].tiles >= widest {
            bands.push(Band { first: tile, tiles: 1 });
            sum = count;
        } else {
            bands[last].tiles += 1;
            sum += count;
        }
        fullest = fullest.max(sum);
    }
    Ok((bands, fullest))
}
