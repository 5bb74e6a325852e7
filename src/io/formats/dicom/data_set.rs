//! The pass through a data set that collects the header. Sequences are tracked on a bounded stack, without recursion.

use std::io::{self, Read as _};

use flate2::bufread::DeflateDecoder;

use crate::error::Result;
use crate::io::file::sample_type::Endian;
use crate::io::file::source::{Encoding, Source};
use crate::io::file::text;
use crate::io::formats::dicom::elements::{
    Element, ITEM, ITEM_END, SEQUENCE_END, Tag, UNDEFINED, Walk, named,
};
use crate::io::formats::dicom::header::{Account, Header, MAX_FRAMES, Pixels, Plane};
use crate::io::formats::dicom::syntax::{Packing, Syntax};
use crate::num;

/// The limit on nested sequences and items.
const MAX_DEPTH: usize = 32;

const SHARED: Tag = (0x5200, 0x9229);
const PER_FRAME: Tag = (0x5200, 0x9230);

/// The functional group macros that are read: plane position, plane orientation, pixel measures, value
/// transformation.
const MACROS: [Tag; 4] = [(0x0020, 0x9113), (0x0020, 0x9116), (0x0028, 0x9110), (0x0028, 0x9145)];

/// Reads the header of a file. Also returns the file that its offsets refer to: another one if the data set is
/// deflated. If reading fails, the memory taken is returned to the budget.
pub(crate) fn read(source: &Source, account: &mut Account) -> Result<(Header, Source)> {
    account.taken = 0;
    read_within(source, account).inspect_err(|_| account.budget.put_back(account.taken))
}

fn read_within(source: &Source, account: &mut Account) -> Result<(Header, Source)> {
    let mut walk = Walk::new(source);
    let (begin, uid) = walk.meta()?;
    let (syntax, packing) = match uid.as_str() {
        "" => (walk.guess(begin)?, Packing::Native),
        uid => (Syntax::of(uid), Packing::of(uid)),
    };
    let deflated = uid == "1.2.840.10008.1.2.1.99";
    let path = source.path().to_path_buf();
    let header = Header { path, syntax, packing, uid, samples: 1, frames: 1, ..Header::default() };
    if deflated {
        let inflated = inflate(source, begin, account)?;
        let mut header = Pass::new(Walk::new(&inflated), account, header).run(0)?;
        header.inflated = inflated.len();
        header.taken = header.taken.saturating_sub(header.inflated);
        return Ok((header, inflated));
    }
    let header = Pass::new(walk, account, header).run(begin)?;
    Ok((header, source.clone()))
}

/// Inflates a deflated data set in memory.
fn inflate(source: &Source, begin: u64, account: &mut Account) -> Result<Source> {
    const PLACE: &str = "deflated data set";
    let open = || DeflateDecoder::new(source.reader(begin, Encoding::Raw));
    let damaged = |error| source.error(PLACE, format!("is damaged: {error}"));
    // The size is known only at the end: a first pass counts, so that exactly the needed memory is taken.
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

/// A pass through a data set, with its results so far.
struct Pass<'a, 'b> {
    walk: Walk<'a>,
    account: &'a mut Account<'b>,
    header: Header,
    /// Values that the shared functional groups give for all frames.
    shared: Plane,
    /// HighBit, if given.
    high: Option<u64>,
    /// Open sequences and items, the outermost first.
    open: Vec<Open>,
}

struct Open {
    tag: Tag,
    /// Its end, unless a delimiter ends it.
    end: Option<u64>,
    syntax: Syntax,
}

impl<'a, 'b> Pass<'a, 'b> {
    fn new(walk: Walk<'a>, account: &'a mut Account<'b>, header: Header) -> Self {
        Self { walk, account, header, shared: Plane::default(), high: None, open: Vec::new() }
    }

    /// Reads the data set up to its samples.
    fn run(mut self, begin: u64) -> Result<Header> {
        let mut at = begin;
        loop {
            self.close_ended(at)?;
            if self.is_over(at)? {
                break;
            }
            let syntax = self.open.last().map_or(self.header.syntax, |last| last.syntax);
            let element = self.walk.element(at, syntax)?;
            at = match element.tag {
                ITEM_END | SEQUENCE_END => self.delimiter(at, &element)?,
                ITEM => self.item(at, &element, syntax)?,
                (0x7fe0, 0x0008..=0x0010) if self.open.is_empty() => {
                    self.header.float = element.tag.1 != 0x0010;
                    self.header.pixels = Some(self.pixels(&element, syntax)?);
                    break;
                }
                _ => self.entry(at, &element, syntax)?,
            };
        }
        self.finish(at)
    }

    /// Closes the sequences and items whose length ends here.
    fn close_ended(&mut self, at: u64) -> Result<()> {
        while let Some(end) = self.open.last().and_then(|last| last.end).filter(|&end| end <= at) {
            if at > end {
                let rule = format!("a sequence or item ends at byte {end}, within an element");
                return Err(self.walk.error(at, rule));
            }
            self.open.pop();
        }
        Ok(())
    }

    /// Whether the data set ends here: at the end of the file, or at zero padding shorter than an element's header.
    fn is_over(&mut self, at: u64) -> Result<bool> {
        let left = self.walk.source.len().saturating_sub(at);
        if left >= 8 || !self.open.is_empty() {
            return Ok(false);
        }
        Ok(left == 0 || self.walk.bytes(at, left)?.iter().all(|&byte| byte == 0))
    }

    /// Handles a delimiter and returns the offset after it. It closes only what has no length of its own.
    fn delimiter(&mut self, at: u64, element: &Element) -> Result<u64> {
        let sequence = element.tag == SEQUENCE_END;
        match self.open.last() {
            None => return Err(self.walk.error(at, "a delimiter where nothing is open")),
            Some(last) if last.end.is_none() && (last.tag != ITEM) == sequence => _ = self.open.pop(),
            Some(_) => {}
        }
        Ok(element.at)
    }

    /// Opens an item and returns the offset of its first element.
    fn item(&mut self, at: u64, element: &Element, syntax: Syntax) -> Result<u64> {
        if self.open.last().is_none_or(|last| last.tag == ITEM) {
            return Err(self.walk.error(at, "an item outside a sequence"));
        }
        self.push(at, element, syntax)?;
        if self.open.len() == 2 && self.open[0].tag == PER_FRAME {
            // NumberOfFrames comes earlier: elements are sorted by tag.
            let frames = self.header.frames;
            let most = frames.min(num::wide(MAX_FRAMES));
            if num::wide(self.header.planes.len()) >= most {
                return Err(self.walk.error(at, format!("more than {most} items for {frames} frames")));
            }
            self.account.take_for::<Plane>(1)?;
            self.header.planes.push(Plane::default());
        }
        Ok(element.at)
    }

    /// Reads an element that is neither an item nor a delimiter; returns the offset of the next one to read.
    fn entry(&mut self, at: u64, element: &Element, syntax: Syntax) -> Result<u64> {
        if self.open.last().is_some_and(|last| last.tag != ITEM) {
            return Err(self.walk.error(at, "an element within a sequence, outside its items"));
        }
        self.header.table |= self.open.is_empty() && element.tag == (0x0028, 0x3000) && element.len > 0;
        // Fragments outside the image, such as those of an icon.
        if element.len == UNDEFINED
            && (element.tag == (0x7fe0, 0x0010) || matches!(&element.vr, b"OB" | b"OW"))
        {
            return self.fragments(element, syntax, None);
        }
        let entered = match self.open.len() {
            0 => matches!(element.tag, SHARED | PER_FRAME),
            2 => matches!(self.open[0].tag, SHARED | PER_FRAME) && MACROS.contains(&element.tag),
            _ => false,
        };
        if element.len == UNDEFINED || entered {
            // A sequence of unknown type is encoded with implicit types.
            let implicit = Syntax { explicit: false, endian: Endian::Little };
            self.push(at, element, if element.vr == *b"UN" { implicit } else { syntax })?;
            return Ok(element.at);
        }
        let behind = self.walk.behind(element)?;
        self.value_of(element)?;
        Ok(behind)
    }

    /// Stores the value of an element, where it belongs to the file or to a functional group.
    fn value_of(&mut self, element: &Element) -> Result<()> {
        let plane = match &self.open[..] {
            [] => {
                self.of_file(element)?;
                Some(&mut self.header.plane)
            }
            [group, _, part, _] if MACROS.contains(&part.tag) => match group.tag {
                SHARED => Some(&mut self.shared),
                PER_FRAME => self.header.planes.last_mut(),
                _ => None,
            },
            _ => None,
        };
        let (Some(plane), walk) = (plane, &mut self.walk) else { return Ok(()) };
        match element.tag {
            // Only a single slice needs it.
            (0x0018, 0x0050) => plane.thickness = walk.decimals(element).ok().flatten().map(|[n]| n),
            (0x0020, 0x0032) => plane.position = walk.decimals(element)?,
            (0x0020, 0x0037) => plane.orientation = walk.decimals(element)?,
            (0x0028, 0x0030) => plane.spacing = walk.decimals(element)?,
            (0x0028, 0x1052) => plane.intercept = walk.decimals(element)?.map(|[n]| n),
            (0x0028, 0x1053) => plane.slope = walk.decimals(element)?.map(|[n]| n),
            _ => {}
        }
        Ok(())
    }

    fn of_file(&mut self, element: &Element) -> Result<()> {
        let Self { walk, header, .. } = self;
        let number = match element.tag {
            (0x0020, 0x000e) => return walk.text(element).map(|text| header.series = text),
            (0x0028, 0x0004) => return walk.text(element).map(|text| header.photometric = text),
            (0x0028, 0x0008) => {
                let text = walk.text(element)?;
                let frames = text.parse().ok().filter(|frames| *frames > 0);
                if frames.is_none() && !text.is_empty() {
                    let text = text::shown(&text);
                    let rule = format!("NumberOfFrames \"{text}\": must be a whole number from 1");
                    return Err(walk.error(element.at, rule));
                }
                header.frames = frames.unwrap_or(header.frames);
                return Ok(());
            }
            (0x0028, 0x0002 | 0x0010 | 0x0011 | 0x0100..=0x0103) => {
                walk.short(element, header.syntax.endian)?
            }
            _ => return Ok(()),
        };
        match element.tag.1 {
            0x0002 => header.samples = number,
            0x0010 => header.rows = number,
            0x0011 => header.columns = number,
            0x0100 => header.allocated = number,
            0x0101 => header.stored = number,
            0x0102 => self.high = Some(number),
            _ => header.signed = number != 0,
        }
        Ok(())
    }

    /// Completes the header after the last element.
    fn finish(self, at: u64) -> Result<Header> {
        let Self { walk, account, mut header, shared, high, open } = self;
        if let Some(open) = open.last() {
            return Err(walk.error(at, format!("{} does not end", named(open.tag))));
        }
        header.plane = shared.or(header.plane);
        // The groups of a single frame hold for the file.
        if header.frames == 1
            && let [own] = header.planes[..]
        {
            header.plane = own.or(header.plane);
            header.planes = Vec::new();
        }
        let texts = [&header.series, &header.photometric, &header.uid].map(String::capacity);
        account.take_for::<u8>(texts.iter().sum::<usize>() + header.path.capacity())?;
        account.take_for::<Header>(1)?;
        header.taken = account.taken;
        header.high = high.unwrap_or(header.stored.saturating_sub(1));
        Ok(header)
    }

    fn push(&mut self, at: u64, element: &Element, syntax: Syntax) -> Result<()> {
        let end = if element.len == UNDEFINED { None } else { Some(self.walk.behind(element)?) };
        if self.open.len() == MAX_DEPTH {
            return Err(self.walk.error(at, format!("more than {MAX_DEPTH} sequences within each other")));
        }
        self.open.push(Open { tag: element.tag, end, syntax });
        Ok(())
    }

    fn pixels(&mut self, element: &Element, syntax: Syntax) -> Result<Pixels> {
        if element.len != UNDEFINED {
            self.walk.behind(element)?;
            return Ok(Pixels::Plain { at: element.at, len: element.len });
        }
        let mut fragments = Vec::new();
        self.fragments(element, syntax, Some(&mut fragments))?;
        Ok(Pixels::Fragments(fragments))
    }

    /// Lists the offset table and the fragments of an element; returns its end.
    fn fragments(
        &mut self,
        element: &Element,
        syntax: Syntax,
        mut list: Option<&mut Vec<(u64, u64)>>,
    ) -> Result<u64> {
        let mut at = element.at;
        loop {
            let item = self.walk.element(at, syntax)?;
            match item.tag {
                SEQUENCE_END => return Ok(item.at),
                ITEM if item.len != UNDEFINED => {
                    at = self.walk.behind(&item)?;
                    let Some(list) = &mut list else { continue };
                    if list.len() == 2 * MAX_FRAMES {
                        let rule = format!("more than {} fragments", 2 * MAX_FRAMES);
                        return Err(self.walk.error(at, rule));
                    }
                    self.account.take_for::<(u64, u64)>(1)?;
                    list.push((item.at, item.len));
                }
                tag => {
                    return Err(self.walk.error(at, format!("{}: must be an item of samples", named(tag))));
                }
            }
        }
    }
}
