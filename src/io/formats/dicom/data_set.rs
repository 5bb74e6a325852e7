//! The pass through a data set that collects the header. Sequences are tracked on a bounded stack, without recursion.

use std::io::{self, Read as _};

use flate2::bufread::DeflateDecoder;

use crate::error::Result;
use crate::io::file::sample_type::Endian;
use crate::io::file::source::{Encoding, Source};
use crate::io::file::text;
use crate::io::formats::dicom::account::Account;
use crate::io::formats::dicom::elements::{Element, ITEM, ITEM_END, SEQUENCE_END, Tag, UNDEFINED, Walk};
use crate::io::formats::dicom::header::{Header, MAX_FRAMES, Pixels, Plane};
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
    let read = read_within(source, account);
    if read.is_err() {
        account.budget.put_back(account.taken);
    }
    read
}

fn read_within(source: &Source, account: &mut Account) -> Result<(Header, Source)> {
    let mut walk = Walk::new(source, account);
    let (begin, syntax_uid) = walk.meta()?;
    let (syntax, packing) = match syntax_uid.as_str() {
        "" => (walk.guess(begin)?, Packing::Native),
        uid => (Syntax::of(uid), Packing::of(uid)),
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

/// The results of the pass so far.
struct State {
    header: Header,
    /// Values that the shared functional groups give for all frames.
    shared: Plane,
    /// HighBit, if given.
    high: Option<u64>,
    /// Open sequences and items, the outermost first.
    open: Vec<Open>,
    /// The byte order of the data set.
    endian: Endian,
}

/// An open sequence or item.
struct Open {
    tag: Tag,
    /// Its end, unless a delimiter ends it.
    end: Option<u64>,
    syntax: Syntax,
}

impl<'a, 'b> Walk<'a, 'b> {
    /// Reads the data set up to its samples.
    fn data_set(
        &mut self,
        begin: u64,
        syntax: Syntax,
        packing: Packing,
        syntax_uid: String,
        named: &Source,
    ) -> Result<Header> {
        let mut state = State {
            header: Header::empty(named.path(), syntax, packing, syntax_uid),
            shared: Plane::default(),
            high: None,
            open: Vec::new(),
            endian: syntax.endian,
        };
        let mut at = begin;
        loop {
            self.close_ended(at, &mut state.open)?;
            if self.is_over(at, &state.open)? {
                break;
            }
            let syntax = state.open.last().map_or(syntax, |last| last.syntax);
            let element = self.element(at, syntax)?;
            at = match element.tag {
                ITEM_END | SEQUENCE_END => self.delimiter(at, &element, &mut state.open)?,
                ITEM => self.item(at, &element, syntax, &mut state)?,
                (0x7fe0, 0x0008..=0x0010) if state.open.is_empty() => {
                    state.header.float = element.tag.1 != 0x0010;
                    state.header.pixels = Some(self.pixels(&element, syntax)?);
                    break;
                }
                _ => self.entry(at, &element, syntax, &mut state)?,
            };
        }
        self.finish(at, state)
    }

    /// Closes the sequences and items whose length ends here.
    fn close_ended(&self, at: u64, open: &mut Vec<Open>) -> Result<()> {
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
        Ok(())
    }

    /// Whether the data set ends here: at the end of the file, or at zero padding shorter than an element's header.
    fn is_over(&mut self, at: u64, open: &[Open]) -> Result<bool> {
        let left = self.source.len().saturating_sub(at);
        if left >= 8 || !open.is_empty() {
            return Ok(false);
        }
        Ok(left == 0 || self.bytes(at, left)?.iter().all(|&byte| byte == 0))
    }

    /// Handles a delimiter and returns the offset after it. It closes only what has no length of its own.
    fn delimiter(&self, at: u64, element: &Element, open: &mut Vec<Open>) -> Result<u64> {
        let sequence = element.tag == SEQUENCE_END;
        if open.last().is_some_and(|last| last.end.is_none() && (last.tag != ITEM) == sequence) {
            open.pop();
        } else if open.is_empty() {
            return Err(self.error(at, "a delimiter where nothing is open"));
        }
        Ok(element.at)
    }

    /// Opens an item and returns the offset of its first element.
    fn item(&mut self, at: u64, element: &Element, syntax: Syntax, state: &mut State) -> Result<u64> {
        let State { header, open, .. } = state;
        if open.last().is_none_or(|last| last.tag == ITEM) {
            return Err(self.error(at, "an item outside a sequence"));
        }
        let end = self.end(element)?;
        self.push(open, at, Open { tag: ITEM, end, syntax })?;
        if open.len() == 2 && open[0].tag == PER_FRAME {
            // NumberOfFrames comes earlier: elements are sorted by tag.
            let frames = header.frames.unwrap_or(1);
            if num::wide(header.planes.len()) >= frames || header.planes.len() == MAX_FRAMES {
                let most = frames.min(num::wide(MAX_FRAMES));
                return Err(self.error(at, format!("more than {most} items for {frames} frames")));
            }
            self.account.take_for::<Plane>(1)?;
            header.planes.push(Plane::default());
        }
        Ok(element.at)
    }

    /// Reads an element that is neither an item nor a delimiter; returns the offset of the next one to read.
    fn entry(&mut self, at: u64, element: &Element, syntax: Syntax, state: &mut State) -> Result<u64> {
        let State { header, open, .. } = state;
        if open.last().is_some_and(|last| last.tag != ITEM) {
            return Err(self.error(at, "an element within a sequence, outside its items"));
        }
        if open.is_empty() && element.tag == (0x0028, 0x3000) && element.len > 0 {
            const WARNING: &str = "ModalityLUTSequence is not applied: values are as stored";
            if header.warnings.is_empty() {
                header.warnings.push(WARNING);
            }
        }
        // Fragments outside the image, such as those of an icon.
        if element.len == UNDEFINED
            && (element.tag == (0x7fe0, 0x0010) || matches!(&element.vr, b"OB" | b"OW"))
        {
            return self.fragments(element, syntax, None);
        }
        let entered = match open.len() {
            0 => matches!(element.tag, SHARED | PER_FRAME),
            2 => matches!(open[0].tag, SHARED | PER_FRAME) && MACROS.contains(&element.tag),
            _ => false,
        };
        if element.len == UNDEFINED || entered {
            let end = self.end(element)?;
            // A sequence of unknown type is encoded with implicit types.
            let syntax = if element.vr == *b"UN" {
                Syntax { explicit: false, endian: Endian::Little }
            } else {
                syntax
            };
            self.push(open, at, Open { tag: element.tag, end, syntax })?;
            return Ok(element.at);
        }
        let behind = self.behind(element)?;
        self.value_of(element, state)?;
        Ok(behind)
    }

    /// Stores the value of an element, where it belongs to the file or to a functional group.
    fn value_of(&mut self, element: &Element, state: &mut State) -> Result<()> {
        let State { header, shared, high, open, endian } = state;
        match open.len() {
            0 => {
                self.of_file(element, *endian, header, high)?;
                self.of_plane(element, &mut header.plane)
            }
            4 if open[0].tag == SHARED && MACROS.contains(&open[2].tag) => self.of_plane(element, shared),
            4 if open[0].tag == PER_FRAME && MACROS.contains(&open[2].tag) => {
                match header.planes.last_mut() {
                    Some(plane) => self.of_plane(element, plane),
                    None => Ok(()),
                }
            }
            _ => Ok(()),
        }
    }

    /// Completes the header after the last element.
    fn finish(&mut self, at: u64, state: State) -> Result<Header> {
        let State { mut header, shared, high, open, .. } = state;
        if let Some(open) = open.last() {
            let (group, number) = open.tag;
            return Err(self.error(at, format!("({group:04x},{number:04x}) does not end")));
        }
        header.plane = shared.or(header.plane);
        // The groups of a single frame hold for the file.
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

    /// Puts a sequence or an item on the stack.
    fn push(&self, open: &mut Vec<Open>, at: u64, next: Open) -> Result<()> {
        if open.len() == MAX_DEPTH {
            return Err(self.error(at, format!("more than {MAX_DEPTH} sequences within each other")));
        }
        open.push(next);
        Ok(())
    }

    /// Returns the end of a sequence or an item; None if a delimiter ends it.
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

    /// Lists the offset table and the fragments of an element; returns its end.
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
