//! The data elements of a DICOM file that place and decode its samples.

use std::io::{self, Read as _};
use std::path::PathBuf;

use flate2::bufread::DeflateDecoder;
use glam::DVec3;

use crate::error::{Error, Result};
use crate::io::samples::Endian;
use crate::io::source::{Budget, Encoding, Source};
use crate::io::text;
use crate::num;

/// Group and element.
pub(super) type Tag = (u16, u16);

/// Most sequences and items within each other.
const MAX_DEPTH: usize = 32;

/// Longest value that is looked at, in bytes.
const MAX_VALUE: u64 = 1024;

/// Most frames of a file.
pub(super) const MAX_FRAMES: usize = 1 << 16;

const SHARED: Tag = (0x5200, 0x9229);
const PER_FRAME: Tag = (0x5200, 0x9230);
const ITEM: Tag = (0xfffe, 0xe000);
const ITEM_END: Tag = (0xfffe, 0xe00d);
const SEQUENCE_END: Tag = (0xfffe, 0xe0dd);
const UNDEFINED: u64 = 0xffff_ffff;

/// The macros of functional groups that are looked into.
const MACROS: [Tag; 4] = [(0x0020, 0x9113), (0x0020, 0x9116), (0x0028, 0x9110), (0x0028, 0x9145)];

/// How a data set is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Syntax {
    explicit: bool,
    endian: Endian,
}

/// How samples are packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Packing {
    Native,
    Jpeg,
    RunLength,
    /// One that is not read.
    Other,
}

/// Where a frame lies, and what its numbers mean. What is left out may stand in a place that holds for
/// more frames.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Plane {
    pub(super) position: Option<[f64; 3]>,
    pub(super) orientation: Option<[f64; 6]>,
    /// Distance of rows, then of columns.
    pub(super) spacing: Option<[f64; 2]>,
    pub(super) slope: Option<f64>,
    pub(super) intercept: Option<f64>,
}

impl Plane {
    /// Filled up from what holds for more frames.
    fn or(self, other: Self) -> Self {
        Self {
            position: self.position.or(other.position),
            orientation: self.orientation.or(other.orientation),
            spacing: self.spacing.or(other.spacing),
            slope: self.slope.or(other.slope),
            intercept: self.intercept.or(other.intercept),
        }
    }
}

/// Where the samples are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Pixels {
    /// So many bytes from a place.
    Plain { at: u64, len: u64 },
    /// Places and lengths of the offset table and of fragments.
    Fragments(Vec<(u64, u64)>),
}

/// A file without its samples.
#[derive(Clone, Debug)]
pub(super) struct Header {
    /// The file, for messages.
    pub(super) path: PathBuf,
    pub(super) endian: Endian,
    pub(super) packing: Packing,
    pub(super) syntax: String,
    pub(super) series: String,
    pub(super) photometric: String,
    pub(super) rows: u64,
    pub(super) columns: u64,
    pub(super) samples: u64,
    pub(super) allocated: u64,
    pub(super) stored: u64,
    pub(super) high: u64,
    pub(super) signed: bool,
    /// Whether samples are floats.
    pub(super) float: bool,
    /// NumberOfFrames, where there is one.
    pub(super) frames: Option<u64>,
    pub(super) plane: Plane,
    /// Of a file that says it for each frame.
    pub(super) planes: Vec<Plane>,
    pub(super) pixels: Option<Pixels>,
    /// Bytes that were taken from the budget for it.
    pub(super) taken: u64,
    /// Bytes that were taken for its data set, where that is deflated.
    pub(super) inflated: u64,
    /// What is not applied.
    pub(super) warnings: Vec<&'static str>,
}

impl Header {
    /// An error that names the file.
    pub(super) fn error(&self, place: impl Into<String>, rule: impl Into<String>) -> Error {
        Error::file(&self.path, place, rule)
    }

    /// Where a frame lies.
    pub(super) fn plane_of(&self, frame: usize) -> Plane {
        self.planes.get(frame).copied().unwrap_or_default().or(self.plane)
    }

    /// Bytes of a frame that is not packed.
    pub(super) fn frame_bytes(&self) -> u64 {
        self.rows.saturating_mul(self.columns).saturating_mul(self.allocated / 8)
    }
}

/// Reads what there is to know of a file; with it the file that places count in, which is another one
/// where the data set is deflated. What a file takes that cannot be read is given back.
pub(super) fn read(source: &Source, account: &mut Account) -> Result<(Header, Source)> {
    account.taken = 0;
    let read = read_within(source, account);
    if read.is_err() {
        account.budget.put_back(account.taken);
    }
    read
}

/// What is taken from a budget, file by file.
pub(super) struct Account<'b> {
    pub(super) budget: Budget<'b>,
    /// For the file that is being read.
    taken: u64,
    /// Whether something was refused for want of memory: no file is damaged then.
    pub(super) full: bool,
}

impl<'b> Account<'b> {
    pub(super) fn new(budget: Budget<'b>) -> Self {
        Self { budget, taken: 0, full: false }
    }

    fn take(&mut self, place: &str, bytes: u64) -> Result<()> {
        self.budget.take(place, bytes).inspect_err(|_| self.full = true)?;
        self.taken = self.taken.saturating_add(bytes);
        Ok(())
    }

    /// For so many things of a type.
    fn take_for<T>(&mut self, count: usize) -> Result<()> {
        self.take("header", num::wide(count.saturating_mul(size_of::<T>())))
    }
}

fn read_within(source: &Source, account: &mut Account) -> Result<(Header, Source)> {
    let mut walk = Walk::new(source, account);
    let (begin, syntax_uid) = walk.meta()?;
    let (syntax, packing) = match syntax_uid.as_str() {
        "" => (walk.guess(begin)?, Packing::Native),
        "1.2.840.10008.1.2" => (Syntax { explicit: false, endian: Endian::Little }, Packing::Native),
        "1.2.840.10008.1.2.2" => (Syntax { explicit: true, endian: Endian::Big }, Packing::Native),
        uid => {
            let packing = match uid {
                "1.2.840.10008.1.2.1" | "1.2.840.10008.1.2.1.98" | "1.2.840.10008.1.2.1.99" => {
                    Packing::Native
                }
                "1.2.840.10008.1.2.5" => Packing::RunLength,
                "1.2.840.10008.1.2.4.50"
                | "1.2.840.10008.1.2.4.51"
                | "1.2.840.10008.1.2.4.57"
                | "1.2.840.10008.1.2.4.70" => Packing::Jpeg,
                _ => Packing::Other,
            };
            (Syntax { explicit: true, endian: Endian::Little }, packing)
        }
    };
    if syntax_uid == "1.2.840.10008.1.2.1.99" {
        let inflated = inflate(source, begin, account)?;
        let mut header = Walk::new(&inflated, account).data_set(0, syntax, packing, syntax_uid, source)?;
        header.inflated = inflated.len();
        header.taken = header.taken.saturating_sub(header.inflated);
        return Ok((header, inflated));
    }
    let header = walk.data_set(begin, syntax, packing, syntax_uid, source)?;
    Ok((header, source.clone()))
}

/// What a transfer syntax is called that is not read.
pub(super) fn named(uid: &str) -> &'static str {
    match uid {
        "1.2.840.10008.1.2.4.80" | "1.2.840.10008.1.2.4.81" => " (JPEG-LS)",
        "1.2.840.10008.1.2.4.90" | "1.2.840.10008.1.2.4.91" => " (JPEG 2000)",
        "1.2.840.10008.1.2.4.92" | "1.2.840.10008.1.2.4.93" => " (JPEG 2000 of several components)",
        "1.2.840.10008.1.2.4.110" | "1.2.840.10008.1.2.4.111" | "1.2.840.10008.1.2.4.112" => " (JPEG XL)",
        "1.2.840.10008.1.2.4.201" | "1.2.840.10008.1.2.4.202" | "1.2.840.10008.1.2.4.203" => {
            " (high-throughput JPEG 2000)"
        }
        "1.2.840.10008.1.2.4.100" | "1.2.840.10008.1.2.4.101" => " (MPEG-2)",
        "1.2.840.10008.1.2.4.102" | "1.2.840.10008.1.2.4.103" => " (MPEG-4)",
        _ => "",
    }
}

/// A deflated data set, unpacked in memory.
fn inflate(source: &Source, begin: u64, account: &mut Account) -> Result<Source> {
    const PLACE: &str = "deflated data set";
    let open = || DeflateDecoder::new(source.reader(begin, Encoding::Raw));
    let damaged = |error| source.error(PLACE, format!("is damaged: {error}"));
    // Its size is known only behind it: it is gone through twice, and nothing is taken that is not needed.
    let most = Encoding::Zlib.most(source.len());
    let len = io::copy(&mut open().take(most), &mut io::sink()).map_err(damaged)?;
    account.take(PLACE, len)?;
    let mut bytes = Vec::new();
    usize::try_from(len)
        .ok()
        .and_then(|len| bytes.try_reserve_exact(len).ok())
        .ok_or_else(|| source.error(PLACE, format!("{len} bytes: memory is full")))?;
    let read = open().take(len).read_to_end(&mut bytes).map_err(damaged)?;
    if num::wide(read) != len {
        return Err(source.error(PLACE, "changed while it was read"));
    }
    Source::unpacked(source.path(), bytes)
}

/// A data element's header.
#[derive(Clone, Copy, Debug)]
struct Element {
    tag: Tag,
    vr: [u8; 2],
    /// Where its value is.
    at: u64,
    len: u64,
}

/// A sequence or an item that has begun.
struct Open {
    tag: Tag,
    /// Where it ends, unless a delimiter says so.
    end: Option<u64>,
    syntax: Syntax,
}

/// A pass through a file, in one direction.
struct Walk<'a, 'b> {
    source: &'a Source,
    account: &'a mut Account<'b>,
    /// A piece of the file, and where it begins.
    window: Vec<u8>,
    start: u64,
}

impl<'a, 'b> Walk<'a, 'b> {
    /// Bytes that are read at a time.
    const WINDOW: u64 = 1 << 14;

    fn new(source: &'a Source, account: &'a mut Account<'b>) -> Self {
        Self { source, account, window: Vec::new(), start: 0 }
    }

    fn error(&self, at: u64, rule: impl Into<String>) -> Error {
        self.source.error(format!("byte {at}"), rule)
    }

    /// A few bytes from a place.
    fn bytes(&mut self, at: u64, len: u64) -> Result<&[u8]> {
        let all = self.source.len();
        let end = at.checked_add(len).filter(|&end| end <= all);
        let Some(end) = end else {
            return Err(self.error(at, format!("needs {len} bytes here, the file has {all} in all")));
        };
        let window_end = self.start.saturating_add(u64::try_from(self.window.len()).unwrap_or(0));
        if at < self.start || end > window_end {
            let size = len.max(Self::WINDOW).min(all - at);
            self.window = self.source.bytes(at, size)?;
            self.start = at;
        }
        let first = usize::try_from(at - self.start).unwrap_or(usize::MAX);
        let count = usize::try_from(len).unwrap_or(usize::MAX);
        Ok(&self.window[first..first + count])
    }

    fn number(&mut self, at: u64, len: u64, endian: Endian) -> Result<u64> {
        Ok(endian.whole(self.bytes(at, len)?))
    }

    fn element(&mut self, at: u64, syntax: Syntax) -> Result<Element> {
        let Syntax { explicit, endian } = syntax;
        let part = |number: u64| u16::try_from(number).unwrap_or(0);
        let tag = (part(self.number(at, 2, endian)?), part(self.number(at + 2, 2, endian)?));
        if !explicit || tag.0 == 0xfffe {
            let len = self.number(at + 4, 4, endian)?;
            return Ok(Element { tag, vr: [0; 2], at: at + 8, len });
        }
        let vr = self.bytes(at + 4, 2)?;
        let vr = [vr[0], vr[1]];
        if !vr.iter().all(u8::is_ascii_uppercase) {
            return Err(self.error(
                at,
                format!(
                    "\"{}\": element ({:04x},{:04x}) must have a type of two letters",
                    vr.escape_ascii(),
                    tag.0,
                    tag.1
                ),
            ));
        }
        let long = matches!(
            &vr,
            b"OB"
                | b"OD"
                | b"OF"
                | b"OL"
                | b"OV"
                | b"OW"
                | b"SQ"
                | b"SV"
                | b"UC"
                | b"UN"
                | b"UR"
                | b"UT"
                | b"UV"
        );
        if long {
            let len = self.number(at + 8, 4, endian)?;
            Ok(Element { tag, vr, at: at + 12, len })
        } else {
            let len = self.number(at + 6, 2, endian)?;
            Ok(Element { tag, vr, at: at + 8, len })
        }
    }

    /// The group of meta elements: where it ends, and the transfer syntax.
    fn meta(&mut self) -> Result<(u64, String)> {
        let head = self.source.head();
        let mut at = if head.get(128..132) == Some(b"DICM") { 132 } else { 0 };
        let syntax = Syntax { explicit: true, endian: Endian::Little };
        let mut uid = String::new();
        while at + 8 <= self.source.len() && self.number(at, 2, Endian::Little)? == 2 {
            let element = self.element(at, syntax)?;
            if element.tag == (0x0002, 0x0010) {
                uid = self.text(&element)?;
            }
            at = self.behind(&element)?;
        }
        Ok((at, uid))
    }

    /// Whether types are written, where no meta element says so.
    fn guess(&mut self, at: u64) -> Result<Syntax> {
        let explicit = self.bytes(at.saturating_add(4), 2)?.iter().all(u8::is_ascii_uppercase);
        Ok(Syntax { explicit, endian: Endian::Little })
    }

    /// Where an element of a known length ends.
    fn behind(&self, element: &Element) -> Result<u64> {
        let end = element.at.checked_add(element.len).filter(|&end| end <= self.source.len());
        let ((group, number), len) = (element.tag, element.len);
        end.ok_or_else(|| {
            let left = self.source.len().saturating_sub(element.at);
            self.error(element.at, format!("({group:04x},{number:04x}) has {len} bytes: {left} are left"))
        })
    }

    fn value(&mut self, element: &Element) -> Result<&[u8]> {
        let ((group, number), len) = (element.tag, element.len);
        if len > MAX_VALUE {
            let rule = format!("({group:04x},{number:04x}) has {len} bytes: at most {MAX_VALUE}");
            return Err(self.error(element.at, rule));
        }
        self.bytes(element.at, len)
    }

    fn text(&mut self, element: &Element) -> Result<String> {
        let text = String::from_utf8_lossy(self.value(element)?).into_owned();
        let text = text.trim_matches(|c: char| c == '\0' || c.is_whitespace());
        // It may come to be shown: a message has one line.
        Ok(text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect())
    }

    /// Decimal numbers, separated by backslashes; None where the value is empty.
    fn decimals<const N: usize>(&mut self, element: &Element) -> Result<Option<[f64; N]>> {
        let text = self.text(element)?;
        if text.is_empty() {
            return Ok(None);
        }
        let numbers: Vec<f64> = text
            .split('\\')
            .filter_map(|word| word.trim().parse().ok())
            .filter(|n: &f64| n.is_finite())
            .collect();
        let wanted = text.split('\\').count() == N && numbers.len() == N;
        let numbers = <[f64; N]>::try_from(numbers).ok().filter(|_| wanted);
        numbers.map(Some).ok_or_else(|| {
            let (group, number) = element.tag;
            let shown = text::shown(&text);
            self.error(element.at, format!("({group:04x},{number:04x}) \"{shown}\": must be {N} numbers"))
        })
    }

    /// A whole number of 2 bytes.
    fn short(&mut self, element: &Element, endian: Endian) -> Result<u64> {
        let ((group, number), len) = (element.tag, element.len);
        if len < 2 {
            let rule = format!("({group:04x},{number:04x}) has {len} bytes: must be a number of 2");
            return Err(self.error(element.at, rule));
        }
        self.number(element.at, 2, endian)
    }

    /// Walks through the data set as far as the samples.
    fn data_set(
        &mut self,
        begin: u64,
        syntax: Syntax,
        packing: Packing,
        syntax_uid: String,
        named: &Source,
    ) -> Result<Header> {
        let endian = syntax.endian;
        let mut header = Header {
            path: named.path().to_path_buf(),
            endian,
            packing,
            syntax: syntax_uid,
            series: String::new(),
            photometric: String::new(),
            rows: 0,
            columns: 0,
            samples: 1,
            allocated: 0,
            stored: 0,
            high: 0,
            signed: false,
            float: false,
            frames: None,
            plane: Plane::default(),
            planes: Vec::new(),
            pixels: None,
            taken: 0,
            inflated: 0,
            warnings: Vec::new(),
        };
        let mut shared = Plane::default();
        let mut high = None;
        let mut open: Vec<Open> = Vec::new();
        let mut at = begin;
        loop {
            // What ends here, ends.
            while let Some(end) = open.last().and_then(|last| last.end) {
                if at < end {
                    break;
                }
                if at > end {
                    return Err(
                        self.error(at, format!("a sequence or item ends at byte {end}, within an element"))
                    );
                }
                open.pop();
            }
            let left = self.source.len().saturating_sub(at);
            if left == 0 && open.is_empty() {
                break;
            }
            // Padding at the end is not worth a refusal, an element that is cut short is.
            if left < 8 && open.is_empty() && self.bytes(at, left)?.iter().all(|&byte| byte == 0) {
                break;
            }
            let syntax = open.last().map_or(syntax, |last| last.syntax);
            let element = self.element(at, syntax)?;
            match element.tag {
                ITEM_END | SEQUENCE_END => {
                    let sequence = element.tag == SEQUENCE_END;
                    // A delimiter ends what has no length; those beyond are left alone.
                    if open.last().is_some_and(|last| last.end.is_none() && (last.tag != ITEM) == sequence) {
                        open.pop();
                    } else if open.is_empty() {
                        return Err(self.error(at, "a delimiter where nothing is open"));
                    }
                    at = element.at;
                    continue;
                }
                ITEM => {
                    if open.last().is_none_or(|last| last.tag == ITEM) {
                        return Err(self.error(at, "an item outside a sequence"));
                    }
                    let end = self.end(&element)?;
                    self.push(&mut open, at, Open { tag: ITEM, end, syntax })?;
                    if open.len() == 2 && open[0].tag == PER_FRAME {
                        // They are counted before: elements are in the order of their numbers.
                        let frames = header.frames.unwrap_or(1);
                        if num::wide(header.planes.len()) >= frames || header.planes.len() == MAX_FRAMES {
                            let most = frames.min(num::wide(MAX_FRAMES));
                            return Err(self.error(at, format!("more than {most} items for {frames} frames")));
                        }
                        self.account.take_for::<Plane>(1)?;
                        header.planes.push(Plane::default());
                    }
                    at = element.at;
                    continue;
                }
                (0x7fe0, 0x0008..=0x0010) if open.is_empty() => {
                    header.float = element.tag.1 != 0x0010;
                    header.pixels = Some(self.pixels(&element, syntax)?);
                    break;
                }
                _ => {}
            }
            if open.last().is_some_and(|last| last.tag != ITEM) {
                return Err(self.error(at, "an element within a sequence, outside its items"));
            }
            if open.is_empty() && element.tag == (0x0028, 0x3000) && element.len > 0 {
                const WARNING: &str = "ModalityLUTSequence is not applied: values are as stored";
                if header.warnings.is_empty() {
                    header.warnings.push(WARNING);
                }
            }
            // Packed samples of an icon, say.
            if element.len == UNDEFINED
                && (element.tag == (0x7fe0, 0x0010) || matches!(&element.vr, b"OB" | b"OW"))
            {
                at = self.fragments(&element, syntax, None)?;
                continue;
            }
            let looked = match open.len() {
                0 => matches!(element.tag, SHARED | PER_FRAME),
                2 => matches!(open[0].tag, SHARED | PER_FRAME) && MACROS.contains(&element.tag),
                _ => false,
            };
            if element.len == UNDEFINED || looked {
                let end = self.end(&element)?;
                // A sequence of unknown type is written without types.
                let syntax = if element.vr == *b"UN" {
                    Syntax { explicit: false, endian: Endian::Little }
                } else {
                    syntax
                };
                self.push(&mut open, at, Open { tag: element.tag, end, syntax })?;
                at = element.at;
                continue;
            }
            let behind = self.behind(&element)?;
            match open.len() {
                0 => {
                    self.of_file(&element, endian, &mut header, &mut high)?;
                    self.of_plane(&element, &mut header.plane)?;
                }
                4 if open[0].tag == SHARED && MACROS.contains(&open[2].tag) => {
                    self.of_plane(&element, &mut shared)?;
                }
                4 if open[0].tag == PER_FRAME && MACROS.contains(&open[2].tag) => {
                    if let Some(plane) = header.planes.last_mut() {
                        self.of_plane(&element, plane)?;
                    }
                }
                _ => {}
            }
            at = behind;
        }
        if let Some(open) = open.last() {
            let (group, number) = open.tag;
            return Err(self.error(at, format!("({group:04x},{number:04x}) does not end")));
        }
        header.plane = shared.or(header.plane);
        // A single frame is the file.
        if header.frames.unwrap_or(1) == 1
            && let [own] = header.planes[..]
        {
            header.plane = own.or(header.plane);
            header.planes = Vec::new();
        }
        let texts = [&header.series, &header.photometric, &header.syntax].map(String::capacity);
        self.account.take_for::<u8>(texts.iter().sum::<usize>() + header.path.capacity())?;
        self.account.take_for::<Header>(1)?;
        header.taken = self.account.taken;
        header.high = high.unwrap_or(header.stored.saturating_sub(1));
        Ok(header)
    }

    fn push(&self, open: &mut Vec<Open>, at: u64, next: Open) -> Result<()> {
        if open.len() == MAX_DEPTH {
            return Err(self.error(at, format!("more than {MAX_DEPTH} sequences within each other")));
        }
        open.push(next);
        Ok(())
    }

    /// Where a sequence or an item ends; None where a delimiter says so.
    fn end(&self, element: &Element) -> Result<Option<u64>> {
        if element.len == UNDEFINED { Ok(None) } else { self.behind(element).map(Some) }
    }

    fn of_file(
        &mut self,
        element: &Element,
        endian: Endian,
        header: &mut Header,
        high: &mut Option<u64>,
    ) -> Result<()> {
        match element.tag {
            (0x0020, 0x000e) => header.series = self.text(element)?,
            (0x0028, 0x0002) => header.samples = self.short(element, endian)?,
            (0x0028, 0x0004) => header.photometric = self.text(element)?,
            (0x0028, 0x0008) => {
                let text = self.text(element)?;
                if !text.is_empty() {
                    let frames = text.parse().ok().filter(|frames| *frames > 0);
                    let rule = || {
                        format!("NumberOfFrames \"{}\": must be a whole number from 1", text::shown(&text))
                    };
                    header.frames = Some(frames.ok_or_else(|| self.error(element.at, rule()))?);
                }
            }
            (0x0028, 0x0010) => header.rows = self.short(element, endian)?,
            (0x0028, 0x0011) => header.columns = self.short(element, endian)?,
            (0x0028, 0x0100) => header.allocated = self.short(element, endian)?,
            (0x0028, 0x0101) => header.stored = self.short(element, endian)?,
            (0x0028, 0x0102) => *high = Some(self.short(element, endian)?),
            (0x0028, 0x0103) => header.signed = self.short(element, endian)? != 0,
            _ => {}
        }
        Ok(())
    }

    fn of_plane(&mut self, element: &Element, plane: &mut Plane) -> Result<()> {
        match element.tag {
            (0x0020, 0x0032) => plane.position = self.decimals(element)?,
            (0x0020, 0x0037) => plane.orientation = self.decimals(element)?,
            (0x0028, 0x0030) => plane.spacing = self.decimals(element)?,
            (0x0028, 0x1052) => plane.intercept = self.decimals::<1>(element)?.map(|[n]| n),
            (0x0028, 0x1053) => plane.slope = self.decimals::<1>(element)?.map(|[n]| n),
            _ => {}
        }
        Ok(())
    }

    fn pixels(&mut self, element: &Element, syntax: Syntax) -> Result<Pixels> {
        if element.len != UNDEFINED {
            self.behind(element)?;
            return Ok(Pixels::Plain { at: element.at, len: element.len });
        }
        let mut fragments = Vec::new();
        self.fragments(element, syntax, Some(&mut fragments))?;
        Ok(Pixels::Fragments(fragments))
    }

    /// Goes over the offset table and the fragments of an element, and lists them; where it ends.
    fn fragments(
        &mut self,
        element: &Element,
        syntax: Syntax,
        mut list: Option<&mut Vec<(u64, u64)>>,
    ) -> Result<u64> {
        let mut at = element.at;
        loop {
            let item = self.element(at, syntax)?;
            match item.tag {
                SEQUENCE_END => return Ok(item.at),
                ITEM if item.len != UNDEFINED => {
                    at = self.behind(&item)?;
                    let Some(list) = &mut list else { continue };
                    if list.len() == 2 * MAX_FRAMES {
                        return Err(self.error(at, format!("more than {} fragments", 2 * MAX_FRAMES)));
                    }
                    self.account.take_for::<(u64, u64)>(1)?;
                    list.push((item.at, item.len));
                }
                (group, number) => {
                    let rule = format!("({group:04x},{number:04x}): must be an item of samples");
                    return Err(self.error(at, rule));
                }
            }
        }
    }
}

/// A position as a vector.
pub(super) fn vector(numbers: &[f64]) -> DVec3 {
    DVec3::new(numbers[0], numbers[1], numbers[2])
}
