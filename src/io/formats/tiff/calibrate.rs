//! Calibration from the first page's tags.

use crate::error::Result;
use crate::io::file::sample_type::SampleType;
use crate::io::formats::tiff::calibration::{Calibration, Resolution};
use crate::io::formats::tiff::description;
use crate::io::formats::tiff::file::{Entry, File, LSM, find, index, place_of};
use crate::io::formats::tiff::page::Page;

/// The limit on bytes of the description that are read.
const MAX_DESCRIPTION: u64 = 4 << 20;

impl<'a> File<'a> {
    /// Reads the calibration from the first page.
    pub(crate) fn calibration(&mut self, page: &Page, entries: &[Entry]) -> Result<Calibration> {
        let description = match find(entries, 270).filter(|entry| entry.size() == 1) {
            Some(entry) => {
                let len = entry.count.min(MAX_DESCRIPTION);
                self.piece(&place_of(page.number, 270), entry.at, len)?
            }
            None => Vec::new(),
        };
        let end = description.iter().position(|&byte| byte == 0).unwrap_or(description.len());
        let description = String::from_utf8_lossy(&description[..end]);
        let pixels = [self.fraction(page.number, entries, 282)?, self.fraction(page.number, entries, 283)?];
        let unit = self.number(page.number, entries, 296, 2)?;
        let bits = matches!(page.kind, SampleType::U8 | SampleType::U16).then_some(page.bits);
        let integer_bits = bits.filter(|_| page.samples == 1);
        let resolution = Resolution { pixels, unit };
        let mut calibration = description::calibration(&description, resolution, integer_bits);

        if let Some(entry) = find(entries, LSM) {
            self.microscope(page, &entry, &mut calibration)?;
        }
        let orientation = self.number(page.number, entries, 274, 1)?;
        if orientation != 1 {
            calibration.warnings.push(format!(
                "Orientation {orientation} is not applied: rows and columns lie as they are stored"
            ));
        }
        Ok(calibration)
    }

    /// Reads the beginning of the tag of Zeiss microscopes.
    fn microscope(&mut self, page: &Page, entry: &Entry, calibration: &mut Calibration) -> Result<()> {
        /// The number of bytes that are read.
        const LEN: u64 = 64;
        let bytes = if entry.size() == 1 && entry.count >= LEN {
            self.piece(&place_of(page.number, LSM), entry.at, LEN)?
        } else {
            vec![0; index(LEN)]
        };
        let [magic, width, height, slices, frames] =
            [0, 8, 12, 16, 24].map(|at| self.whole(&bytes[at..at + 4]));
        // Counts are signed 32-bit numbers.
        let counts = [slices, frames].iter().all(|count| (1..=0x7fff_ffff).contains(count));
        let same = (width, height) == (u64::from(page.width), u64::from(page.height));
        let why = match magic {
            0x0030_494c | 0x0040_494c if counts && same => {
                let sizes = [40, 48, 56].map(|at| f64::from_bits(self.whole(&bytes[at..at + 8])));
                calibration.microscope(sizes, slices, frames);
                return Ok(());
            }
            0x0030_494c | 0x0040_494c if counts => {
                format!("{width} x {height} pixels, the page has {} x {}", page.width, page.height)
            }
            0x0030_494c | 0x0040_494c => format!("{slices} slices, {frames} points in time"),
            _ => "is none that is known".to_owned(),
        };
        calibration.warnings.push(format!(
            "CZ_LSMINFO: {why}: the size of a voxel was not read, and time steps may be stacked as slices"
        ));
        Ok(())
    }
}
