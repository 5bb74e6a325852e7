//! From the entries of a directory to a page.

use tiff::tags::{CompressionMethod, Tag};

use crate::error::Result;
use crate::io::file::decode::MAX_COMPONENTS;
use crate::io::file::sample_type::SampleType;
use crate::io::formats::tiff::file::{Directory, IMAGE_DEPTH, TILE_DEPTH};
use crate::io::formats::tiff::page::{Page, name};
use crate::num::wide;

impl Directory<'_> {
    /// Makes a page of the entries.
    pub(crate) fn page(&self) -> Result<Page> {
        let (width, height) = (self.extent(Tag::ImageWidth)?, self.extent(Tag::ImageLength)?);
        for tag in [IMAGE_DEPTH, TILE_DEPTH] {
            let depth = self.number(tag, 1)?;
            if depth > 1 {
                let rule = "volumes within a page are not supported, one page for each slice is";
                return Err(self.error(tag, format!("{depth}: {rule}")));
            }
        }
        let samples = self.number(Tag::SamplesPerPixel, 1)?;
        let samples = usize::try_from(samples)
            .ok()
            .filter(|samples| (1..=MAX_COMPONENTS).contains(samples))
            .ok_or_else(|| {
                self.error(Tag::SamplesPerPixel, format!("{samples}: must be 1 to {MAX_COMPONENTS}"))
            })?;
        let extra = match self.find(Tag::ExtraSamples) {
            Some(entry) => self.file.numbers(self.number, &entry, wide(samples))?,
            None => Vec::new(),
        };
        let bits = self.uniform(Tag::BitsPerSample, 1)?;
        let format = self.uniform(Tag::SampleFormat, 1)?;
        let kind = self.sample_type(format, bits)?;
        let photometric = self.photometric(samples)?;
        let planar = match self.number(Tag::PlanarConfiguration, 1)? {
            1 => false,
            2 => samples > 1,
            other => return Err(self.error(Tag::PlanarConfiguration, format!("{other}: must be 1 or 2"))),
        };
        let order = self.number(Tag::FillOrder, 1)?;
        if order != 1 {
            let rule = format!("{order}: only 1, the highest bit first, is supported");
            return Err(self.error(Tag::FillOrder, rule));
        }
        let compression = self.compression(bits, samples, planar)?;
        let predictor = self.predictor(compression, bits, format)?;
        let tiles = self.find(Tag::TileOffsets).is_some();
        let (chunk, offsets, counts) = if tiles {
            let chunk = [self.extent(Tag::TileWidth)?, self.extent(Tag::TileLength)?];
            (chunk, Tag::TileOffsets, Tag::TileByteCounts)
        } else {
            let rows = self.number(Tag::RowsPerStrip, height.into())?.min(height.into());
            ([width, self.positive(Tag::RowsPerStrip, rows)?], Tag::StripOffsets, Tag::StripByteCounts)
        };
        let page = Page {
            number: self.number,
            width,
            height,
            bits: u16::try_from(bits).unwrap_or(0),
            kind,
            // Undefined samples count as unsigned.
            format: if format == 4 { 1 } else { format },
            samples,
            extra,
            photometric,
            planar,
            compression,
            predictor,
            chunk,
            tiles,
            offsets: self.find(offsets).ok_or_else(|| self.error(offsets, "missing"))?,
            counts: self.find(counts),
            tables: self.find(Tag::JPEGTables).filter(|_| compression == CompressionMethod::ModernJPEG),
        };
        if page.counts.is_none() && compression != CompressionMethod::None {
            return Err(self.error(counts, "missing"));
        }
        Ok(page)
    }

    /// Reads a positive number of pixels.
    fn extent(&self, tag: Tag) -> Result<u32> {
        self.positive(tag, self.number(tag, 0)?)
    }

    fn positive(&self, tag: Tag, value: u64) -> Result<u32> {
        let extent = u32::try_from(value).ok().filter(|&extent| extent > 0);
        extent.ok_or_else(|| self.error(tag, format!("{value}: must be 1 to {}", u32::MAX)))
    }

    /// Returns the type of samples with this code of the sample format and this number of bits.
    fn sample_type(&self, format: u64, bits: u64) -> Result<SampleType> {
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
                let rule = "whole numbers of 1, 2, 4, 8, 16, 32 and 64 bits and floats of 16, 32 and 64 bits";
                let rule = format!("{bits} bits of sample format {format}: {rule} are supported");
                return Err(self.error(Tag::BitsPerSample, rule));
            }
        })
    }

    /// Reads the code of the photometric interpretation: grey, RGB or palette.
    fn photometric(&self, samples: usize) -> Result<u64> {
        let photometric = self.number(Tag::PhotometricInterpretation, 1)?;
        let other = match photometric {
            2 if samples < 3 => {
                return Err(self.error(Tag::SamplesPerPixel, format!("{samples}: RGB has at least 3")));
            }
            0..=4 => return Ok(photometric),
            5 => "CMYK",
            6 => "YCbCr",
            8..=10 => "Lab",
            32803 => "colour filter array",
            _ => "of no known meaning",
        };
        let rule = format!("{photometric} ({other}): grey, RGB and palette images are supported");
        Err(self.error(Tag::PhotometricInterpretation, rule))
    }

    /// Reads the compression, which must fit the samples.
    fn compression(&self, bits: u64, samples: usize, planar: bool) -> Result<CompressionMethod> {
        let code = self.number(Tag::Compression, 1)?;
        let method = u16::try_from(code).ok().and_then(CompressionMethod::from_u16);
        match method.filter(|method| name(*method).is_some()) {
            None => {
                let rule = "uncompressed, LZW, Deflate, PackBits, JPEG and CCITT Group 4 are supported";
                Err(self.error(Tag::Compression, format!("{code}{}: {rule}", unsupported(code))))
            }
            Some(CompressionMethod::Fax4) if bits != 1 || samples != 1 => {
                let rule = format!("{bits} x {samples}: CCITT Group 4 has one bit for a pixel");
                Err(self.error(Tag::BitsPerSample, rule))
            }
            Some(CompressionMethod::ModernJPEG) if bits != 8 || !(planar || matches!(samples, 1 | 3 | 4)) => {
                let rule = format!("{bits} x {samples}: JPEG of 1, 3 or 4 samples of 8 bits is supported");
                Err(self.error(Tag::BitsPerSample, rule))
            }
            Some(method) => Ok(method),
        }
    }

    /// Reads the predictor, which must fit compression and samples.
    fn predictor(&self, compression: CompressionMethod, bits: u64, format: u64) -> Result<u64> {
        use CompressionMethod::{Deflate, LZW, OldDeflate};
        let predictor = self.number(Tag::Predictor, 1)?;
        let fits = match predictor {
            1 => true,
            2 | 3 if !matches!(compression, LZW | Deflate | OldDeflate) => false,
            2 => bits >= 8,
            3 => format == 3,
            _ => false,
        };
        if fits {
            return Ok(predictor);
        }
        let packed = name(compression).unwrap_or_default();
        let rule = format!("not known with {packed} samples of {bits} bits and format {format}");
        Err(self.error(Tag::Predictor, format!("{predictor}: {rule}")))
    }
}

/// Names a compression that is not supported, with a blank before it.
fn unsupported(code: u64) -> &'static str {
    match code {
        2 => " (CCITT modified Huffman)",
        3 => " (CCITT Group 3)",
        6 => " (old JPEG)",
        34712 | 33003 | 33005 => " (JPEG 2000)",
        34887 => " (LERC)",
        34925 => " (LZMA)",
        50000 => " (Zstandard)",
        50001 => " (WebP)",
        50002 | 52546 => " (JPEG XL)",
        _ => "",
    }
}
