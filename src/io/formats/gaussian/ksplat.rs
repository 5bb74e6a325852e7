//! `.ksplat`, version 0.1, known by the file name alone: sections of records, quantised at levels 1 and 2.
//!
//! A header of 4096 bytes, then one of 1024 bytes for each section, then the sections' data: the sizes of partial buckets, the
//! centres of all buckets, the records. A record has position, lengths, quaternion w, x, y, z, a byte each for red, green,
//! blue and opacity, and harmonics: of each degree all coefficients of red, then of green, then of blue. Level 0 has float32;
//! level 1 positions of 16 bits around the centre of a bucket, and half-precision numbers; level 2 has harmonics of 8 bits. Axes
//! are right, down, front.

use crate::error::Result;
use crate::io::build::gaussians::{About, Columns};
use crate::io::file::budget::Budget;
use crate::io::file::half::from_half;
use crate::io::file::scanner::Scanner;
use crate::io::file::source::Source;
use crate::io::formats::gaussian::rows::rows;
use crate::io::options::Request;
use crate::io::reader::Reader;
use crate::io::report::Found;
use crate::num;
use crate::scene::{Axes, TrainedMode, harmonics};

pub(crate) struct Ksplat;

/// Size of the file's header, in bytes.
const HEADER: u64 = 4096;
/// Size of a section's header, in bytes.
const SECTION: u64 = 1024;
/// The highest degree of harmonics.
const MOST_DEGREE: u32 = 3;
/// Bytes of the centre of a bucket.
const CENTRE: u64 = 12;
/// The range of positions of 16 bits where a section has none.
const RANGE: u32 = 32_767;
/// Limits of harmonics of 8 bits where the file has none.
const LIMITS: [f32; 2] = [-1.5, 1.5];

impl Reader for Ksplat {
    fn name(&self) -> &'static str {
        "ksplat"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["ksplat"]
    }

    fn recognises(&self, _: &Source) -> bool {
        false
    }

    fn read(&self, source: &Source, request: &Request) -> Result<Found> {
        if source.is_gzip() {
            return Err(source.error("content", "a gzip stream: unpack it first"));
        }
        let mut budget = Budget::new(source, request);
        let header = Header::read(source)?;
        let sections = header.sections(source)?;
        let count = sections.iter().map(|section| section.count).sum();
        let degree = sections.iter().map(|section| section.degree).max().unwrap_or(0);
        let mut notes = Vec::new();
        if header.count != count {
            notes.push(format!("the header announces {} splats, the sections have {count}", header.count));
        }
        let mut columns = Columns::new(source, &mut budget, count, degree)?;
        let mut first = 0;
        for section in &sections {
            let buckets = section.buckets(source, &mut budget, header.level)?;
            let mut scanner = Scanner::resume(source, section.records, 0)?;
            let count = usize::try_from(section.count).unwrap_or(usize::MAX);
            rows(&mut scanner, count, header.record(section.degree), &mut |i, row| {
                header.decode(section, &buckets, (i, first + i), row, &mut columns);
            })?;
            budget.put_back(section.bytes());
            first += count;
        }
        let about = About {
            format: ["ksplat 0.1, level 0", "ksplat 0.1, level 1", "ksplat 0.1, level 2"][header.level],
            axes: Axes::Rdf.into(),
            axes_from: "the convention of .ksplat files",
            mode: TrainedMode::Unknown,
            texts: Vec::new(),
            notes,
        };
        columns.finish(source, &mut budget, about, request)
    }
}

/// Reads little-endian numbers at offsets, 0 behind the end.
#[derive(Clone, Copy)]
struct Words<'a>(&'a [u8]);

impl Words<'_> {
    fn bytes<const N: usize>(self, at: usize) -> [u8; N] {
        self.0.get(at..).and_then(<[u8]>::first_chunk).copied().unwrap_or([0; N])
    }

    fn u16(self, at: usize) -> u16 {
        u16::from_le_bytes(self.bytes(at))
    }

    fn u32(self, at: usize) -> u32 {
        u32::from_le_bytes(self.bytes(at))
    }

    fn f32(self, at: usize) -> f32 {
        f32::from_le_bytes(self.bytes(at))
    }

    fn half(self, at: usize) -> f32 {
        from_half(self.u16(at))
    }
}

/// The header of the file.
struct Header {
    /// The number of headers of sections.
    sections: u32,
    /// The number of splats, for a note only.
    count: u64,
    /// The level of compression, 0 to 2.
    level: usize,
    /// The coefficients that bytes 0 and 255 stand for.
    limits: [f32; 2],
}

/// A section: records with common buckets.
struct Section {
    /// The number of splats.
    count: u64,
    /// Splats in a full bucket.
    capacity: u64,
    full: u64,
    partial: u64,
    /// The number of centres.
    buckets: u64,
    /// The offset of the sizes of partial buckets.
    data: u64,
    /// Bytes of a bucket.
    bucket: u64,
    /// The offset of the records.
    records: u64,
    /// The length of a unit of a position of 16 bits, and the position that stands for the centre.
    unit: f64,
    zero: f64,
    degree: u32,
}

/// The centres of buckets, and where each ends that is not full.
struct Buckets {
    centres: Vec<[f32; 3]>,
    /// The number of splats up to the end of each partial bucket.
    ends: Vec<u64>,
}

impl Header {
    fn read(source: &Source) -> Result<Self> {
        let wrong = |rule: String| source.error("header", rule);
        let head = source.head();
        if num::wide(head.len()) < HEADER {
            return Err(wrong(format!("{} bytes: must have {HEADER}", head.len())));
        }
        let (words, [major, minor]) = (Words(head), [head[0], head[1]]);
        if [major, minor] != [0, 1] {
            return Err(wrong(format!("version {major}.{minor}: must be 0.1")));
        }
        let level = usize::from(words.u16(20));
        if level > 2 {
            return Err(wrong(format!("compression level {level}: must be 0 to 2")));
        }
        let or = |value: f32, default: f32| if value == 0.0 { default } else { value };
        let limits = [or(words.f32(36), LIMITS[0]), or(words.f32(40), LIMITS[1])];
        let sections = words.u32(4);
        let end = u64::from(sections).saturating_mul(SECTION).saturating_add(HEADER);
        if end > source.len() {
            return Err(wrong(format!("{sections} sections: their headers need {end} bytes")));
        }
        Ok(Self { sections, count: words.u32(16).into(), level, limits })
    }

    /// Returns the bytes of a record.
    fn record(&self, degree: u32) -> usize {
        let others = 3 * (harmonics::count(degree) - 1);
        match self.level {
            0 => 4 * (3 + 3 + 4) + 4 + 4 * others,
            1 => 2 * (3 + 3 + 4) + 4 + 2 * others,
            _ => 2 * (3 + 3 + 4) + 4 + others,
        }
    }

    /// Reads the headers of sections, and finds their data, which must end with the file.
    fn sections(&self, source: &Source) -> Result<Vec<Section>> {
        let mut data = HEADER + u64::from(self.sections) * SECTION;
        let mut sections = Vec::new();
        for i in 0..self.sections {
            let wrong = |rule: String| source.error(format!("section {i}"), rule);
            let bytes = source.bytes(HEADER + u64::from(i) * SECTION, 44)?;
            let words = Words(&bytes);
            let [count, most, capacity, buckets] = [0, 4, 8, 12].map(|at| u64::from(words.u32(at)));
            let [full, partial] = [32, 36].map(|at| u64::from(words.u32(at)));
            let (bucket, degree) = (u64::from(words.u16(20)), u32::from(words.u16(40)));
            let (block, range) = (words.f32(16), if words.u32(24) == 0 { RANGE } else { words.u32(24) });
            if degree > MOST_DEGREE {
                return Err(wrong(format!("degree {degree}: must be 0 to {MOST_DEGREE}")));
            }
            if count > most {
                return Err(wrong(format!("{count} splats: there are places for {most}")));
            }
            if buckets > 0 && bucket != CENTRE {
                return Err(wrong(format!("{bucket} bytes for a bucket: must be {CENTRE}")));
            }
            if full.saturating_add(partial) > buckets {
                return Err(wrong(format!(
                    "{full} full and {partial} partial buckets: there are centres of {buckets}"
                )));
            }
            // No number has more than 32 bits, and no record more than 8.
            let records = data + 4 * partial + bucket * buckets;
            let end = records.saturating_add(most.saturating_mul(num::wide(self.record(degree))));
            if end > source.len() {
                return Err(wrong(format!("ends at byte {end}: the file has {}", source.len())));
            }
            let unit = f64::from(block) / 2.0 / f64::from(range);
            if count > 0 {
                let zero = f64::from(range);
                sections.push(Section {
                    count,
                    capacity,
                    full,
                    partial,
                    buckets,
                    data,
                    bucket,
                    records,
                    unit,
                    zero,
                    degree,
                });
            }
            data = end;
        }
        if data != source.len() {
            let rule = format!("the sections end at byte {data}: the file has {}", source.len());
            return Err(source.error("sections", rule));
        }
        Ok(sections)
    }

    /// Decodes a record: that of a splat of a section, and of all splats.
    fn decode(
        &self,
        section: &Section,
        buckets: &Buckets,
        (i, splat): (usize, usize),
        row: &[u8],
        columns: &mut Columns,
    ) {
        let words = Words(row);
        let (size, number): (usize, &dyn Fn(usize) -> f32) =
            if self.level == 0 { (4, &|k| words.f32(4 * k)) } else { (2, &|k| words.half(2 * k)) };
        columns.parts.centres[splat] = if self.level == 0 {
            [0, 1, 2].map(number)
        } else {
            let centre = buckets.centre(section, num::wide(i));
            [0, 1, 2].map(|k| {
                let steps = f64::from(words.u16(2 * k)) - section.zero;
                num::f32_of(steps * section.unit + f64::from(centre[k]))
            })
        };
        columns.parts.log_scales[splat] = [3, 4, 5].map(|k| num::f32_of(f64::from(number(k)).ln()));
        columns.parts.rotations[splat] = [6, 7, 8, 9].map(number);
        let byte = |at: usize| row.get(at).copied().map_or(0.0, f64::from);
        let colour = 10 * size;
        columns.set_colour(splat, [0, 1, 2].map(|k| byte(colour + k) / 255.0));
        columns.parts.opacities[splat] = num::f32_of(byte(colour + 3) / 255.0);
        let [low, high] = self.limits.map(f64::from);
        let coefficient = |place: usize| match self.level {
            0 => words.f32(colour + 4 + 4 * place),
            1 => words.half(colour + 4 + 2 * place),
            _ => num::f32_of(low + byte(colour + 4 + place) / 255.0 * (high - low)),
        };
        let own = columns.harmonics(splat);
        let mut place = 0;
        for l in 1..=section.degree {
            let functions = harmonics::count(l - 1)..harmonics::count(l);
            for channel in 0..3 {
                for function in functions.clone() {
                    own[3 * function + channel] = coefficient(place);
                    place += 1;
                }
            }
        }
    }
}

impl Section {
    /// Returns the memory of buckets, as bytes of the file and decoded.
    fn bytes(&self) -> u64 {
        24 * self.buckets + 12 * self.partial
    }

    /// Reads the centres of buckets, and checks that each splat has one.
    fn buckets(&self, source: &Source, budget: &mut Budget, level: usize) -> Result<Buckets> {
        budget.take("buckets", self.bytes())?;
        let sizes = source.bytes(self.data, 4 * self.partial)?;
        let mut end = self.full.saturating_mul(self.capacity);
        let ends: Vec<u64> = sizes
            .as_chunks()
            .0
            .iter()
            .map(|size| {
                end = end.saturating_add(u32::from_le_bytes(*size).into());
                end
            })
            .collect();
        if end < self.count && level > 0 {
            let rule = format!("{} splats: the buckets hold {end}", self.count);
            return Err(source.error("buckets", rule));
        }
        let bytes = source.bytes(self.data + 4 * self.partial, self.bucket * self.buckets)?;
        let centres = bytes.chunks_exact(12).map(|row| [0, 4, 8].map(|at| Words(row).f32(at))).collect();
        Ok(Buckets { centres, ends })
    }
}

impl Buckets {
    /// Returns the centre of the bucket of a splat.
    fn centre(&self, section: &Section, i: u64) -> [f32; 3] {
        let full = section.full.saturating_mul(section.capacity);
        let place = if i < full {
            i / section.capacity.max(1)
        } else {
            section.full + num::wide(self.ends.partition_point(|end| *end <= i))
        };
        usize::try_from(place).ok().and_then(|place| self.centres.get(place)).copied().unwrap_or([0.0; 3])
    }
}
