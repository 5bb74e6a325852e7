//! From the entries of a directory to a page.

use crate::error::Result;
use crate::io::file::decode::MAX_COMPONENTS;
use crate::io::file::sample_type::SampleType;
use crate::io::formats::tiff::file::{Entry, File, find, place_of};
use crate::io::formats::tiff::page::{Compression, Page};
use crate::num::wide;

impl<'a> File<'a> {
    pub(crate) fn page(&mut self, number: usize, offset: u64) -> Result<Page> {
        let (entries, _) = self.directory(number, offset)?;
        self.page_of(number, &entries)
    }

    pub(crate) fn page_of(&mut self, number: usize, entries: &[Entry]) -> Result<Page> {
        let source = self.source;
        let error = |tag, rule: String| source.error(place_of(number, tag), rule);
        let extent = |value: u64, tag| {
            let extent = u32::try_from(value).ok().filter(|&extent| extent > 0);
            extent.ok_or_else(|| error(tag, format!("{value}: must be 1 to {}", u32::MAX)))
        };
        let width = extent(self.number(number, entries, 256, 0)?, 256)?;
        let height = extent(self.number(number, entries, 257, 0)?, 257)?;
        for tag in [32997, 32998] {
            let depth = self.number(number, entries, tag, 1)?;
            if depth > 1 {
                let rule =
                    format!("{depth}: volumes within a page are not supported, one page for each slice is");
                return Err(error(tag, rule));
            }
        }
        let samples = self.number(number, entries, 277, 1)?;
        let samples = usize::try_from(samples)
            .ok()
            .filter(|samples| (1..=MAX_COMPONENTS).contains(samples))
            .ok_or_else(|| error(277, format!("{samples}: must be 1 to {MAX_COMPONENTS}")))?;
        let extra = match find(entries, 338) {
            Some(entry) => self.numbers(number, &entry, wide(samples))?,
            None => Vec::new(),
        };

        let bits = self.uniform(number, entries, 258, 1)?;
        let format = self.uniform(number, entries, 339, 1)?;
        let kind = match (format, bits) {
            (1 | 4, 1 | 2 | 4 | 8) => SampleType::U8,
            (1 | 4, 16) => SampleType::U16,
            (1 | 4, 32) => SampleType::U32,
            (1 | 4, 64) => SampleType::U64,
            (2, 8) => SampleType::I8,
            (2, 16) => SampleType::I16,
            (2, 32) => SampleType::I32,
            (2, 64) => SampleType::I64,
            (3, 16 | 32) => SampleType::F32,
            (3, 64) => SampleType::F64,
            _ => {
                return Err(error(
                    258,
                    format!(
                        "{bits} bits of sample format {format}: whole numbers of 1, 2, 4, 8, 16, 32 and 64 bits and \
                         floats of 16, 32 and 64 bits are supported"
                    ),
                ));
            }
        };
        let photometric = self.number(number, entries, 262, 1)?;
        let name = match photometric {
            0..=4 => "",
            5 => " (CMYK)",
            6 => " (YCbCr)",
            8..=10 => " (Lab)",
            32803 => " (colour filter array)",
            _ => " (of no known meaning)",
        };
        if photometric > 4 {
            return Err(error(
                262,
                format!("{photometric}{name}: grey, RGB and palette images are supported"),
            ));
        }
        if photometric == 2 && samples < 3 {
            return Err(error(277, format!("{samples}: RGB has at least 3")));
        }
        let planar = match self.number(number, entries, 284, 1)? {
            1 => false,
            2 => samples > 1,
            other => return Err(error(284, format!("{other}: must be 1 or 2"))),
        };
        let order = self.number(number, entries, 266, 1)?;
        if order != 1 {
            return Err(error(266, format!("{order}: only 1, the highest bit first, is supported")));
        }
        let code = self.number(number, entries, 259, 1)?;
        let Some(&(_, compression)) = Compression::ALL.iter().find(|(known, _)| *known == code) else {
            let rule = "uncompressed, LZW, Deflate, PackBits, JPEG and CCITT Group 4 are supported";
            return Err(error(259, format!("{code}{}: {rule}", Compression::other(code))));
        };
        match compression {
            Compression::Fax4 if bits != 1 || samples != 1 => {
                return Err(error(258, format!("{bits} x {samples}: CCITT Group 4 has one bit for a pixel")));
            }
            Compression::Jpeg if bits != 8 || !(planar || matches!(samples, 1 | 3 | 4)) => {
                return Err(error(
                    258,
                    format!("{bits} x {samples}: JPEG of 1, 3 or 4 samples of 8 bits is supported"),
                ));
            }
            _ => {}
        }
        let predictor = self.number(number, entries, 317, 1)?;
        let fits = match predictor {
            1 => true,
            2 | 3 if !matches!(compression, Compression::Lzw | Compression::Deflate) => false,
            2 => bits >= 8,
            3 => format == 3,
            _ => false,
        };
        if !fits {
            let packed = format!("{} samples of {bits} bits and format {format}", compression.name());
            return Err(error(317, format!("{predictor}: not known with {packed}")));
        }

        let tiles = find(entries, 324).is_some();
        let chunk = if tiles {
            [self.number(number, entries, 322, 0)?, self.number(number, entries, 323, 0)?]
        } else {
            [u64::from(width), self.number(number, entries, 278, u64::from(height))?.min(u64::from(height))]
        };
        let (across, down) = if tiles { (322, 323) } else { (256, 278) };
        let chunk = [extent(chunk[0], across)?, extent(chunk[1], down)?];
        let (offsets, counts) = if tiles { (324, 325) } else { (273, 279) };
        let page = Page {
            number,
            width,
            height,
            bits: u16::try_from(bits).unwrap_or(0),
            kind,
            half: format == 3 && bits == 16,
            samples,
            extra,
            photometric,
            planar,
            compression,
            predictor,
            chunk,
            tiles,
            offsets: find(entries, offsets).ok_or_else(|| error(offsets, "missing".to_owned()))?,
            counts: find(entries, counts),
            tables: find(entries, 347).filter(|_| compression == Compression::Jpeg),
        };
        if page.counts.is_none() && compression != Compression::None {
            return Err(error(counts, "missing".to_owned()));
        }
        Ok(page)
    }
}
