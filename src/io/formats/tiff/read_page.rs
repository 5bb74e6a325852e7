//! From the entries of a directory to a page.

use crate::error::{Error, Result};
use crate::io::file::decode::MAX_COMPONENTS;
use crate::io::file::sample_type::SampleType;
use crate::io::file::source::Source;
use crate::io::formats::tiff::file::{Entry, File, find, place_of};
use crate::io::formats::tiff::page::{Compression, Page};
use crate::num::wide;

impl File<'_> {
    /// Reads the directory at an offset as a page.
    pub(crate) fn page(&mut self, number: usize, offset: u64) -> Result<Page> {
        let (entries, _) = self.directory(number, offset)?;
        self.page_of(number, &entries)
    }

    /// Makes a page of the entries of a directory; `number` is for messages.
    pub(crate) fn page_of(&mut self, number: usize, entries: &[Entry]) -> Result<Page> {
        let at = Place { source: self.source, number };
        let [width, height] = self.extents(&at, entries)?;
        let samples = self.number(number, entries, 277, 1)?;
        let samples = usize::try_from(samples)
            .ok()
            .filter(|samples| (1..=MAX_COMPONENTS).contains(samples))
            .ok_or_else(|| at.error(277, format!("{samples}: must be 1 to {MAX_COMPONENTS}")))?;
        let extra = match find(entries, 338) {
            Some(entry) => self.numbers(number, &entry, wide(samples))?,
            None => Vec::new(),
        };

        let bits = self.uniform(number, entries, 258, 1)?;
        let format = self.uniform(number, entries, 339, 1)?;
        let kind = sample_type(&at, format, bits)?;
        let photometric = self.photometric(&at, entries, samples)?;
        let planar = match self.number(number, entries, 284, 1)? {
            1 => false,
            2 => samples > 1,
            other => return Err(at.error(284, format!("{other}: must be 1 or 2"))),
        };
        let order = self.number(number, entries, 266, 1)?;
        if order != 1 {
            return Err(at.error(266, format!("{order}: only 1, the highest bit first, is supported")));
        }
        let compression = self.compression(&at, entries, bits, samples, planar)?;
        let predictor = self.number(number, entries, 317, 1)?;
        check_predictor(&at, predictor, compression, bits, format)?;

        let tiles = find(entries, 324).is_some();
        let chunk = self.chunk(&at, entries, tiles, [width, height])?;
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
            offsets: find(entries, offsets).ok_or_else(|| at.error(offsets, "missing"))?,
            counts: find(entries, counts),
            tables: find(entries, 347).filter(|_| compression == Compression::Jpeg),
        };
        if page.counts.is_none() && compression != Compression::None {
            return Err(at.error(counts, "missing"));
        }
        Ok(page)
    }

    /// Width and height in pixels; the depth must be 1.
    fn extents(&mut self, at: &Place, entries: &[Entry]) -> Result<[u32; 2]> {
        let width = at.extent(self.number(at.number, entries, 256, 0)?, 256)?;
        let height = at.extent(self.number(at.number, entries, 257, 0)?, 257)?;
        for tag in [32997, 32998] {
            let depth = self.number(at.number, entries, tag, 1)?;
            if depth > 1 {
                let rule =
                    format!("{depth}: volumes within a page are not supported, one page for each slice is");
                return Err(at.error(tag, rule));
            }
        }
        Ok([width, height])
    }

    /// The code of the photometric interpretation: grey, RGB or palette.
    fn photometric(&mut self, at: &Place, entries: &[Entry], samples: usize) -> Result<u64> {
        let photometric = self.number(at.number, entries, 262, 1)?;
        let name = match photometric {
            0..=4 => "",
            5 => " (CMYK)",
            6 => " (YCbCr)",
            8..=10 => " (Lab)",
            32803 => " (colour filter array)",
            _ => " (of no known meaning)",
        };
        if photometric > 4 {
            return Err(
                at.error(262, format!("{photometric}{name}: grey, RGB and palette images are supported"))
            );
        }
        if photometric == 2 && samples < 3 {
            return Err(at.error(277, format!("{samples}: RGB has at least 3")));
        }
        Ok(photometric)
    }

    /// The compression, which must fit the samples.
    fn compression(
        &mut self,
        at: &Place,
        entries: &[Entry],
        bits: u64,
        samples: usize,
        planar: bool,
    ) -> Result<Compression> {
        let code = self.number(at.number, entries, 259, 1)?;
        let Some(&(_, compression)) = Compression::ALL.iter().find(|(known, _)| *known == code) else {
            let rule = "uncompressed, LZW, Deflate, PackBits, JPEG and CCITT Group 4 are supported";
            return Err(at.error(259, format!("{code}{}: {rule}", Compression::other(code))));
        };
        match compression {
            Compression::Fax4 if bits != 1 || samples != 1 => {
                Err(at.error(258, format!("{bits} x {samples}: CCITT Group 4 has one bit for a pixel")))
            }
            Compression::Jpeg if bits != 8 || !(planar || matches!(samples, 1 | 3 | 4)) => {
                let rule = format!("{bits} x {samples}: JPEG of 1, 3 or 4 samples of 8 bits is supported");
                Err(at.error(258, rule))
            }
            _ => Ok(compression),
        }
    }

    /// Width and height of a strip or tile, in pixels.
    fn chunk(&mut self, at: &Place, entries: &[Entry], tiles: bool, extents: [u32; 2]) -> Result<[u32; 2]> {
        let [width, height] = extents.map(u64::from);
        let (across, down) = if tiles { (322, 323) } else { (256, 278) };
        let chunk = if tiles {
            [self.number(at.number, entries, 322, 0)?, self.number(at.number, entries, 323, 0)?]
        } else {
            [width, self.number(at.number, entries, 278, height)?.min(height)]
        };
        Ok([at.extent(chunk[0], across)?, at.extent(chunk[1], down)?])
    }
}

/// A page, for messages.
struct Place<'a> {
    source: &'a Source,
    number: usize,
}

impl Place<'_> {
    /// An error about the value of a tag.
    fn error(&self, tag: u16, rule: impl Into<String>) -> Error {
        self.source.error(place_of(self.number, tag), rule)
    }

    /// A positive number of pixels.
    fn extent(&self, value: u64, tag: u16) -> Result<u32> {
        let extent = u32::try_from(value).ok().filter(|&extent| extent > 0);
        extent.ok_or_else(|| self.error(tag, format!("{value}: must be 1 to {}", u32::MAX)))
    }
}

/// The type of samples with this code of the sample format and this number of bits.
fn sample_type(at: &Place, format: u64, bits: u64) -> Result<SampleType> {
    Ok(match (format, bits) {
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
            let rule = format!(
                "{bits} bits of sample format {format}: whole numbers of 1, 2, 4, 8, 16, 32 and 64 bits and \
                 floats of 16, 32 and 64 bits are supported"
            );
            return Err(at.error(258, rule));
        }
    })
}

/// Whether the predictor fits compression and samples.
fn check_predictor(
    at: &Place,
    predictor: u64,
    compression: Compression,
    bits: u64,
    format: u64,
) -> Result<()> {
    let fits = match predictor {
        1 => true,
        2 | 3 if !matches!(compression, Compression::Lzw | Compression::Deflate) => false,
        2 => bits >= 8,
        3 => format == 3,
        _ => false,
    };
    if fits {
        return Ok(());
    }
    let packed = format!("{} samples of {bits} bits and format {format}", compression.name());
    Err(at.error(317, format!("{predictor}: not known with {packed}")))
}
