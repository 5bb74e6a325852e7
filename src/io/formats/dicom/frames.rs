//! The samples of a frame: uncompressed, run-length encoded or JPEG.

use dicom_pixeldata::PixelDecoder as _;

use crate::error::Result;
use crate::io::file::sample_type::{Endian, SampleType};
use crate::io::file::source::Source;
use crate::io::file::text;
use crate::io::formats::dicom::header::{Header, Pixels};
use crate::io::formats::dicom::syntax::{self, Packing};
use crate::io::formats::jpeg;
use crate::num::wide;

/// Returns the type of the samples after unused bits are removed.
pub(crate) fn kind(header: &Header) -> Result<SampleType> {
    let Header { allocated, stored, high, signed, .. } = *header;
    if header.samples != 1 {
        return Err(header.error("SamplesPerPixel", format!("{}: 1 is supported", header.samples)));
    }
    if !matches!(header.photometric.as_str(), "MONOCHROME1" | "MONOCHROME2") {
        let shown = text::shown(&header.photometric);
        let rule = format!("\"{shown}\": MONOCHROME1 and MONOCHROME2 are supported");
        return Err(header.error("PhotometricInterpretation", rule));
    }
    let rule = match allocated {
        32 if header.float => return Ok(SampleType::F32),
        64 if header.float => return Ok(SampleType::F64),
        _ if header.float => "floats have 32 or 64",
        8 if header.syntax.endian == Endian::Big => "with big-endian data, 16 and 32 are supported",
        8 | 16 | 32 => "",
        _ => "8, 16 and 32 are supported",
    };
    if !rule.is_empty() {
        return Err(header.error("BitsAllocated", format!("{allocated}: {rule}")));
    }
    if stored == 0 || stored > allocated || high >= allocated || high + 1 < stored {
        let rule = format!("{stored} up to bit {high}: do not fit in {allocated}");
        return Err(header.error("BitsStored, HighBit", rule));
    }
    Ok(match (allocated, signed) {
        (8, false) => SampleType::U8,
        (8, true) => SampleType::I8,
        (16, false) => SampleType::U16,
        (16, true) => SampleType::I16,
        (_, false) => SampleType::U32,
        (_, true) => SampleType::I32,
    })
}

/// Checks that the data of a file can hold these frames, before memory is allocated.
pub(crate) fn check(header: &Header) -> Result<()> {
    let Some(pixels) = &header.pixels else {
        return Err(header.error("PixelData", "there is none"));
    };
    let Header { packing, rows, columns, allocated, frames, ref uid, .. } = *header;
    if packing == Packing::Other {
        let rule = "uncompressed, deflated, RLE and JPEG (baseline, extended, lossless) data are supported";
        let rule = format!("{}{}: {rule}", text::shown(uid), syntax::named(uid));
        return Err(header.error("TransferSyntaxUID", rule));
    }
    if rows == 0 || columns == 0 {
        return Err(header.error("Rows, Columns", format!("{rows}, {columns}: must be positive")));
    }
    let needed = header.frame_bytes().saturating_mul(frames);
    let rule = match pixels {
        Pixels::Plain { len, .. } if packing == Packing::Native => {
            // A padding byte may make the length even.
            if needed == *len || needed.checked_next_multiple_of(2) == Some(*len) {
                return Ok(());
            }
            let samples = format!("{columns} x {rows} samples of {allocated} bits in {frames} frames");
            format!("{len} bytes: {samples} need {needed}")
        }
        Pixels::Plain { .. } => format!("transfer syntax {uid} has fragments"),
        Pixels::Fragments(list) => {
            let stored: u64 = list.iter().skip(1).map(|(_, len)| len).sum();
            let most = stored.saturating_mul(match packing {
                Packing::Native | Packing::Other => 1,
                // Two bytes encode up to 128.
                Packing::RunLength => 64,
                // One bit encodes a block of 64 samples of two bytes; lossless, one sample.
                Packing::Jpeg => 1024,
            });
            if needed <= most {
                return Ok(());
            }
            format!("{stored} packed bytes hold at most {most}: {frames} frames need {needed}")
        }
    };
    Err(header.error("PixelData", rule))
}

/// Returns the memory that decoding a frame takes in addition to the result, in bytes.
pub(crate) fn scratch(header: &Header) -> u64 {
    let frame = header.frame_bytes();
    let stored = match &header.pixels {
        Some(Pixels::Fragments(list)) => {
            list.iter().map(|(_, len)| *len).sum::<u64>().min(frame.saturating_mul(2))
        }
        _ => 0,
    };
    let own = if header.packing == Packing::Jpeg { 8 } else { 2 };
    // The compressed frame is held alone, within a data set for the decoder, and in the decoder's own form.
    frame.saturating_mul(own).saturating_add(stored.saturating_mul(4))
}

/// Returns the bytes of a frame and their byte order.
pub(crate) fn bytes(data: &Source, header: &Header, frame: usize) -> Result<(Vec<u8>, Endian)> {
    let size = header.frame_bytes();
    let (bytes, endian) = match &header.pixels {
        Some(Pixels::Plain { at, .. }) => {
            (data.bytes(at.saturating_add(size.saturating_mul(wide(frame))), size)?, header.syntax.endian)
        }
        Some(Pixels::Fragments(list)) => {
            let mut packed = packed(header, data, list, frame)?;
            match header.packing {
                Packing::Native | Packing::Other => {
                    let len = wide(packed.len());
                    // A padding byte may make the length even.
                    if len != size && len != size.next_multiple_of(2) {
                        let rule = format!("a frame of {len} bytes: {size} are needed");
                        return Err(header.error("PixelData", rule));
                    }
                    packed.truncate(usize::try_from(size).unwrap_or(usize::MAX));
                    (packed, Endian::Little)
                }
                Packing::RunLength => (run_lengths(&packed, header)?, Endian::Little),
                Packing::Jpeg => (decoded(&packed, header)?, Endian::NATIVE),
            }
        }
        None => return Err(header.error("PixelData", "there is none")),
    };
    Ok((masked(bytes, endian, header), endian))
}

/// Joins the fragments of a frame.
fn packed(header: &Header, data: &Source, list: &[(u64, u64)], frame: usize) -> Result<Vec<u8>> {
    let size = header.frame_bytes();
    let frames = usize::try_from(header.frames).unwrap_or(usize::MAX);
    let error = |rule: String| Err(header.error("PixelData", rule));
    let Some((table, fragments)) = list.split_first() else {
        return error("has no offset table".to_owned());
    };
    let own: &[(u64, u64)] = if frames == 1 {
        fragments
    } else if fragments.len() == frames {
        &fragments[frame..=frame]
    } else if table.1 == wide(frames).saturating_mul(4) {
        // Offsets count from the item of the first fragment.
        let first = fragments.first().map_or(0, |(at, _)| at.saturating_sub(8));
        let offset = |frame: usize| -> Result<u64> {
            let bytes = data.bytes(table.0.saturating_add(wide(frame).saturating_mul(4)), 4)?;
            Ok(first.saturating_add(Endian::Little.whole(&bytes)))
        };
        let begin = offset(frame)?;
        let end = if frame + 1 < frames { offset(frame + 1)? } else { u64::MAX };
        let place = |wanted: u64| fragments.partition_point(|(at, _)| at.saturating_sub(8) < wanted);
        let (begin, end) = (place(begin), place(end));
        if begin >= end {
            return error(format!("frame {}: its offsets hold no fragment", frame + 1));
        }
        &fragments[begin..end]
    } else {
        let count = fragments.len();
        return error(format!("{count} fragments for {frames} frames, and no table of offsets"));
    };
    let total: u64 = own.iter().map(|(_, len)| len).sum();
    let most = size.saturating_mul(2).saturating_add(1 << 16);
    if total > most {
        return error(format!("frame {}: {total} packed bytes for {size}", frame + 1));
    }
    let mut bytes = Vec::new();
    for &(at, len) in own {
        bytes.extend(data.bytes(at, len)?);
    }
    Ok(bytes)
}

/// Decodes run lengths: one segment per byte of a sample, the most significant first.
fn run_lengths(packed: &[u8], header: &Header) -> Result<Vec<u8>> {
    let error = |rule: String| header.error("PixelData: RLE", rule);
    let word = |i: usize| {
        let word = packed.get(4 * i..4 * i + 4).map(|bytes| Endian::Little.whole(bytes));
        word.and_then(|word| usize::try_from(word).ok()).unwrap_or(usize::MAX)
    };
    let planes = usize::try_from(header.allocated / 8).unwrap_or(1);
    if packed.len() < 64 || word(0) != planes {
        return Err(error(format!("{} segments: {planes} are needed", word(0))));
    }
    let count = usize::try_from(header.rows.saturating_mul(header.columns)).unwrap_or(usize::MAX);
    let mut bytes = vec![0_u8; count.saturating_mul(planes)];
    for plane in 0..planes {
        let begin = word(1 + plane);
        let end = if plane + 1 < planes { word(2 + plane) } else { packed.len() };
        let Some(segment) = packed.get(begin..end).filter(|_| begin >= 64) else {
            let there = packed.len();
            return Err(error(format!("segment {plane} from byte {begin} to {end}: there are {there}")));
        };
        // The result is little-endian.
        let mut targets = bytes.iter_mut().skip(planes - 1 - plane).step_by(planes);
        let (mut left, mut rest) = (count, segment);
        while left > 0 {
            let early = || error(format!("segment {plane} ends {left} samples early"));
            let (&control, after) = rest.split_first().ok_or_else(early)?;
            // Below 128 a run of different bytes follows, above it one byte that is repeated; 128 means nothing.
            let (run, stored) = match usize::from(control) {
                different @ 0..=127 => ((different + 1).min(left), (different + 1).min(left)),
                128 => (0, 0),
                repeated => ((257 - repeated).min(left), 1),
            };
            let (values, after) = after.split_at_checked(stored).ok_or_else(early)?;
            let targets = targets.by_ref().take(run);
            targets.zip(values.iter().cycle()).for_each(|(target, byte)| *target = *byte);
            (left, rest) = (left - run, after);
        }
    }
    Ok(bytes)
}

fn decoded(packed: &[u8], header: &Header) -> Result<Vec<u8>> {
    let error = |rule: String| header.error("PixelData: JPEG", rule);
    let frame = jpeg::frame(packed).map_err(|why| error(why.to_owned()))?;
    let bits = u64::from(frame.bits);
    let fits = u64::from(frame.width) == header.columns
        && u64::from(frame.height) == header.rows
        && frame.components == 1
        && (if header.allocated == 8 { bits <= 8 } else { bits > 8 && bits <= 16 })
        && matches!(header.allocated, 8 | 16);
    if !fits {
        return Err(error(format!(
            "{} x {} pixels, {} x {bits} bits: {} x {} pixels of {} bits are needed",
            frame.width, frame.height, frame.components, header.columns, header.rows, header.allocated
        )));
    }
    let data_set = data_set(packed, header);
    let damaged = |why: &dyn std::error::Error| error(format!("is damaged: {}", deepest(why)));
    let object = dicom_object::from_reader(data_set.as_slice()).map_err(|error| damaged(&error))?;
    drop(data_set);
    let decoded = object.decode_pixel_data_frame(0).map_err(|error| damaged(&error))?;
    let bytes = decoded.data().to_vec();
    if wide(bytes.len()) != header.frame_bytes() {
        return Err(error(format!("{} bytes: {} are needed", bytes.len(), header.frame_bytes())));
    }
    Ok(bytes)
}

/// Returns the message of the innermost cause.
fn deepest(error: &dyn std::error::Error) -> String {
    let deepest = std::iter::successors(Some(error), |error| error.source()).last().unwrap_or(error);
    // Messages of decoders may have several lines.
    deepest.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Writes a minimal data set of one frame, for the decoder.
fn data_set(packed: &[u8], header: &Header) -> Vec<u8> {
    let mut bytes = vec![0; 128];
    bytes.extend_from_slice(b"DICM");
    // All values, also the identifiers of JPEG, have an even length.
    let mut put = |tag: [u16; 2], vr: &[u8; 2], value: &[u8]| {
        bytes.extend(tag.iter().flat_map(|part| part.to_le_bytes()));
        bytes.extend_from_slice(vr);
        bytes.extend_from_slice(&u16::try_from(value.len()).unwrap_or(0).to_le_bytes());
        bytes.extend_from_slice(value);
    };
    let uid = header.uid.as_bytes();
    put([2, 0], b"UL", &u32::try_from(8 + uid.len()).unwrap_or(0).to_le_bytes());
    put([2, 0x10], b"UI", uid);
    put([0x28, 0x02], b"US", &[1, 0]);
    put([0x28, 0x04], b"CS", b"MONOCHROME2 ");
    for (element, number) in [
        (0x10, header.rows),
        (0x11, header.columns),
        (0x100, header.allocated),
        (0x101, header.stored),
        (0x102, header.high),
        (0x103, u64::from(header.signed)),
    ] {
        put([0x28, element], b"US", &u16::try_from(number).unwrap_or(0).to_le_bytes());
    }
    bytes.extend_from_slice(&[0xe0, 0x7f, 0x10, 0, b'O', b'B', 0, 0, 0xff, 0xff, 0xff, 0xff]);
    bytes.extend_from_slice(&[0xfe, 0xff, 0x00, 0xe0, 0, 0, 0, 0]);
    bytes.extend_from_slice(&[0xfe, 0xff, 0x00, 0xe0]);
    let len = u32::try_from(packed.len().next_multiple_of(2)).unwrap_or(0);
    bytes.extend_from_slice(&len.to_le_bytes());
    bytes.extend_from_slice(packed);
    bytes.extend(std::iter::repeat_n(0, packed.len() % 2));
    bytes.extend_from_slice(&[0xfe, 0xff, 0xdd, 0xe0, 0, 0, 0, 0]);
    bytes
}

/// Masks the bits outside those stored, and extends the sign.
fn masked(mut bytes: Vec<u8>, endian: Endian, header: &Header) -> Vec<u8> {
    let Header { allocated, stored, high, signed, .. } = *header;
    if header.float || stored == allocated {
        return bytes;
    }
    let size = usize::try_from(allocated / 8).unwrap_or(1);
    for sample in bytes.chunks_exact_mut(size) {
        let mut value = (endian.whole(sample) >> (high + 1 - stored)) & ((1 << stored) - 1);
        if signed && value >> (stored - 1) == 1 {
            value |= u64::MAX << stored;
        }
        match endian {
            Endian::Little => sample.copy_from_slice(&value.to_le_bytes()[..size]),
            Endian::Big => sample.copy_from_slice(&value.to_be_bytes()[8 - size..]),
        }
    }
    bytes
}
