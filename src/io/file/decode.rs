//! Decoding of binary numbers, a block at a time, so that only the result is held in memory.

use std::collections::TryReserveError;
use std::io::{ErrorKind, Read};
use std::ops::Range;

use glam::DVec3;

use crate::io::file::sample_type::{Endian, Pick, SampleType, by_type};
use crate::num;
use crate::scene::Samples;

/// The type and arrangement of the samples of a grid.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layout {
    pub(crate) dims: [u32; 3],
    pub(crate) kind: SampleType,
    pub(crate) endian: Endian,
    /// The number of components per sample; `pick` is the part that is read.
    pub(crate) components: usize,
    pub(crate) pick: Pick,
}

impl Layout {
    /// Returns a layout with one number per sample.
    pub(crate) fn scalar(dims: [u32; 3], kind: SampleType, endian: Endian) -> Self {
        Self { dims, kind, endian, components: 1, pick: Pick::Component(0) }
    }
}

/// Numbers that have been read.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Values {
    /// One number of each tuple, in a type that is rendered.
    Samples(Samples),
    /// Whole tuples.
    Whole(Tuples),
}

/// Tuples in the type of the file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tuples {
    /// The size of a tuple, in bytes; not 0.
    pub(crate) size: usize,
    /// The numbers, as little-endian bytes.
    pub(crate) bytes: Vec<u8>,
}

impl Values {
    /// Returns an empty list that holds the picked part of tuples.
    pub(crate) fn none(kind: SampleType, components: usize, pick: Pick) -> Self {
        Self::Samples(match (pick, kind) {
            (Pick::Whole, _) => return Self::Whole(Tuples::none(kind, components)),
            (Pick::Component(_), SampleType::U8) => Samples::U8(Vec::new()),
            (Pick::Component(_), SampleType::U16) => Samples::U16(Vec::new()),
            (Pick::Component(_), SampleType::I16) => Samples::I16(Vec::new()),
            _ => Samples::F32(Vec::new()),
        })
    }

    /// Returns the number of tuples.
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Samples(samples) => samples.len(),
            Self::Whole(Tuples { size, bytes }) => bytes.len() / size,
        }
    }

    /// Reserves memory for `count` tuples.
    pub(crate) fn reserve(&mut self, count: usize) -> std::result::Result<(), TryReserveError> {
        match self {
            Self::Samples(Samples::U8(v)) => v.try_reserve_exact(count),
            Self::Samples(Samples::U16(v)) => v.try_reserve_exact(count),
            Self::Samples(Samples::I16(v)) => v.try_reserve_exact(count),
            Self::Samples(Samples::F32(v)) => v.try_reserve_exact(count),
            Self::Samples(Samples::OnDemand(_)) => Ok(()),
            Self::Whole(Tuples { size, bytes }) => bytes.try_reserve_exact(count.saturating_mul(*size)),
        }
    }

    /// Extends the list with zeros.
    pub(crate) fn resize(&mut self, count: usize) {
        match self {
            Self::Samples(Samples::U8(v)) => v.resize(count, 0),
            Self::Samples(Samples::U16(v)) => v.resize(count, 0),
            Self::Samples(Samples::I16(v)) => v.resize(count, 0),
            Self::Samples(Samples::F32(v)) => v.resize(count, 0.0),
            Self::Samples(Samples::OnDemand(_)) => {}
            Self::Whole(Tuples { size, bytes }) => bytes.resize(count * *size, 0),
        }
    }

    /// Copies a range of tuples from another list of the same type.
    pub(crate) fn copy(&mut self, to: usize, other: &Self, from: usize, count: usize) {
        fn put<T: Copy>(a: &mut [T], b: &[T], [to, from, count]: [usize; 3]) {
            a[to..to + count].copy_from_slice(&b[from..from + count]);
        }
        let range = [to, from, count];
        match (self, other) {
            (Self::Samples(Samples::U8(a)), Self::Samples(Samples::U8(b))) => put(a, b, range),
            (Self::Samples(Samples::U16(a)), Self::Samples(Samples::U16(b))) => put(a, b, range),
            (Self::Samples(Samples::I16(a)), Self::Samples(Samples::I16(b))) => put(a, b, range),
            (Self::Samples(Samples::F32(a)), Self::Samples(Samples::F32(b))) => put(a, b, range),
            (Self::Whole(a), Self::Whole(b)) => put(&mut a.bytes, &b.bytes, range.map(|n| n * b.size)),
            // Both lists have the type of the array.
            _ => {}
        }
    }

    /// Keeps the tuples that are marked.
    pub(crate) fn keep(&mut self, marked: &[bool]) {
        fn keep<T>(list: &mut Vec<T>, marked: &[bool], size: usize) {
            let mut i = 0;
            list.retain(|_| {
                i += 1;
                marked.get((i - 1) / size) == Some(&true)
            });
        }
        match self {
            Self::Samples(Samples::U8(v)) => keep(v, marked, 1),
            Self::Samples(Samples::U16(v)) => keep(v, marked, 1),
            Self::Samples(Samples::I16(v)) => keep(v, marked, 1),
            Self::Samples(Samples::F32(v)) => keep(v, marked, 1),
            Self::Samples(Samples::OnDemand(_)) => {}
            Self::Whole(Tuples { size, bytes }) => keep(bytes, marked, *size),
        }
    }

    /// Returns the samples; none if whole tuples were read.
    pub(crate) fn into_samples(self) -> Samples {
        match self {
            Self::Samples(samples) => samples,
            Self::Whole(_) => Samples::U8(Vec::new()),
        }
    }
}

impl From<Samples> for Values {
    fn from(samples: Samples) -> Self {
        Self::Samples(samples)
    }
}

impl Tuples {
    /// Returns an empty list.
    pub(crate) fn none(kind: SampleType, components: usize) -> Self {
        let size = usize::try_from(Pick::Whole.bytes(kind, components)).unwrap_or(usize::MAX);
        Self { size: size.max(1), bytes: Vec::new() }
    }

    /// Appends numbers of a type; whole numbers are those nearest to the given ones.
    pub(crate) fn push(&mut self, kind: SampleType, numbers: &[f64]) {
        macro_rules! put {
            ($type:ty) => {
                self.bytes.extend(numbers.iter().flat_map(|&x| <$type as num::Nearest>::of(x).to_le_bytes()))
            };
        }
        by_type!(kind, put)
    }
}

impl Samples {
    /// Converts to 32-bit floats.
    pub(crate) fn into_f32(self) -> Vec<f32> {
        match self {
            Self::U8(v) => v.into_iter().map(f32::from).collect(),
            Self::U16(v) => v.into_iter().map(f32::from).collect(),
            Self::I16(v) => v.into_iter().map(f32::from).collect(),
            Self::F32(v) => v,
            Self::OnDemand(v) => v.run(0..v.len()).into_f32(),
        }
    }
}

/// Reads `count` tuples and appends the selected part of each, a block at a time, so that only the result takes
/// memory. The extents of the layout are ignored.
///
/// # Errors
///
/// Errors of the reader; [`ErrorKind::UnexpectedEof`] if it ends early; [`ErrorKind::OutOfMemory`].
pub(crate) fn append(
    reader: &mut dyn Read,
    count: usize,
    layout: &Layout,
    values: &mut Values,
) -> std::io::Result<()> {
    values.reserve(count).map_err(|_| ErrorKind::OutOfMemory)?;
    let Layout { kind, endian, components, pick, .. } = *layout;
    let samples = match values {
        Values::Samples(samples) => samples,
        Values::Whole(tuples) => return append_whole(reader, count, layout, tuples),
    };
    /// Appends to a list of the file's own type.
    macro_rules! kept {
        ($type:ty, $list:expr, $at:expr) => {{
            let number = |bytes| <$type>::from_le_bytes(endian.to_little(bytes));
            convert(reader, count, components, number, |tuple| tuple[$at], $list)
        }};
    }
    /// Appends the nearest 32-bit floats.
    macro_rules! narrowed {
        ($type:ty, $list:expr) => {{
            let wide = |bytes| <$type>::from_le_bytes(endian.to_little(bytes)) as f64;
            match pick {
                Pick::Component(at) => {
                    convert(reader, count, components, wide, |tuple| num::f32_of(tuple[at]), $list)
                }
                Pick::Magnitude => {
                    let length = |tuple: &[f64]| num::f32_of(magnitude(tuple));
                    convert(reader, count, components, wide, length, $list)
                }
                Pick::Whole => Err(ErrorKind::Unsupported.into()),
            }
        }};
    }
    match (samples, kind, pick) {
        (Samples::U8(v), SampleType::U8, Pick::Component(at)) => kept!(u8, v, at),
        (Samples::U16(v), SampleType::U16, Pick::Component(at)) => kept!(u16, v, at),
        (Samples::I16(v), SampleType::I16, Pick::Component(at)) => kept!(i16, v, at),
        (Samples::F32(v), SampleType::F32, Pick::Component(at)) => kept!(f32, v, at),
        (Samples::F32(v), kind, _) => by_type!(kind, narrowed, v),
        // The list has been started with another type.
        _ => Err(ErrorKind::Unsupported.into()),
    }
}

/// Appends whole tuples.
fn append_whole(
    reader: &mut dyn Read,
    count: usize,
    layout: &Layout,
    tuples: &mut Tuples,
) -> std::io::Result<()> {
    const BLOCK: usize = 1 << 16;
    let Layout { kind, endian, components, .. } = *layout;
    if components == 0 || components > MAX_COMPONENTS {
        return Err(ErrorKind::Unsupported.into());
    }
    let bytes = &mut tuples.bytes;
    let mut left = count.saturating_mul(tuples.size);
    while left > 0 {
        let begin = bytes.len();
        bytes.resize(begin + left.min(BLOCK), 0);
        reader.read_exact(&mut bytes[begin..])?;
        left -= bytes.len() - begin;
    }
    if endian == Endian::Big {
        let size = usize::try_from(kind.bytes()).unwrap_or(1);
        let begin = bytes.len() - count * tuples.size;
        bytes[begin..].chunks_exact_mut(size).for_each(<[u8]>::reverse);
    }
    Ok(())
}

/// The Euclidean length of the tuple.
pub(crate) fn magnitude(tuple: &[f64]) -> f64 {
    tuple.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Reads `count` numbers, such as coordinates, and appends them as 64-bit floats.
pub(crate) fn append_f64(
    reader: &mut dyn Read,
    count: usize,
    kind: SampleType,
    endian: Endian,
    values: &mut Vec<f64>,
) -> std::io::Result<()> {
    append_wide(reader, count, 1, (kind, endian), |tuple| tuple[0], values)
}

/// Reads `count` points, three numbers each, and appends them.
pub(crate) fn append_points(
    reader: &mut dyn Read,
    count: usize,
    kind: SampleType,
    endian: Endian,
    points: &mut Vec<DVec3>,
) -> std::io::Result<()> {
    append_wide(reader, count, 3, (kind, endian), DVec3::from_slice, points)
}

/// Reads `count` tuples as 64-bit floats and appends a value for each.
fn append_wide<V>(
    reader: &mut dyn Read,
    count: usize,
    components: usize,
    (kind, endian): (SampleType, Endian),
    value: impl Fn(&[f64]) -> V,
    values: &mut Vec<V>,
) -> std::io::Result<()> {
    values.try_reserve_exact(count).map_err(|_| ErrorKind::OutOfMemory)?;
    macro_rules! wide {
        ($type:ty) => {{
            let number = |bytes| <$type>::from_le_bytes(endian.to_little(bytes)) as f64;
            convert(reader, count, components, number, value, values)
        }};
    }
    by_type!(kind, wide)
}

/// Reads `count` whole numbers from 0 to 2^32 - 2 and passes them on: indices, offsets and types.
///
/// # Errors
///
/// As [`append`]; [`ErrorKind::InvalidData`] with the number that is out of range, with the rule that `each` refuses a
/// number by, or if the type is a float.
pub(crate) fn each_index(
    reader: &mut dyn Read,
    count: usize,
    kind: SampleType,
    endian: Endian,
    each: &mut dyn FnMut(u32) -> std::result::Result<(), String>,
) -> std::io::Result<()> {
    /// The number of indices read before a wrong one ends reading.
    const SOME: usize = 1 << 13;
    let mut wrong = None;
    macro_rules! whole {
        ($type:ty, $count:expr) => {{
            let number = |bytes| <$type>::from_le_bytes(endian.to_little(bytes));
            let pass = |tuple: &[$type]| {
                let index = u32::try_from(tuple[0]).ok().filter(|&i| i < u32::MAX);
                let rule = || format!("{}: must be from 0 to {}", tuple[0], u32::MAX - 1);
                if wrong.is_none() {
                    wrong = index.ok_or_else(rule).and_then(&mut *each).err();
                }
            };
            convert(reader, $count, 1, number, pass, &mut Vec::new())
        }};
    }
    let mut left = count;
    while left > 0 {
        let some = left.min(SOME);
        match kind {
            SampleType::U8 => whole!(u8, some),
            SampleType::I8 => whole!(i8, some),
            SampleType::U16 => whole!(u16, some),
            SampleType::I16 => whole!(i16, some),
            SampleType::U32 => whole!(u32, some),
            SampleType::I32 => whole!(i32, some),
            SampleType::U64 => whole!(u64, some),
            SampleType::I64 => whole!(i64, some),
            SampleType::F32 | SampleType::F64 => {
                let rule = format!("type {}: indices are whole numbers", kind.name());
                Err(std::io::Error::new(ErrorKind::InvalidData, rule))
            }
        }?;
        if let Some(rule) = wrong {
            return Err(std::io::Error::new(ErrorKind::InvalidData, rule));
        }
        left -= some;
    }
    Ok(())
}

/// A reader of the bytes of numbers that are converted one by one. `next` returns the bytes of the next number and how
/// many of them count, or None at the end.
pub(crate) struct NumberBytes<F> {
    next: F,
    bytes: [u8; 8],
    /// The bytes of the last number that have not been read yet.
    left: Range<usize>,
}

impl<F: FnMut() -> std::io::Result<Option<([u8; 8], usize)>>> NumberBytes<F> {
    pub(crate) fn new(next: F) -> Self {
        Self { next, bytes: [0; 8], left: 0..0 }
    }
}

impl<F: FnMut() -> std::io::Result<Option<([u8; 8], usize)>>> Read for NumberBytes<F> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let mut filled = 0;
        while filled < buffer.len() {
            if self.left.is_empty() {
                let Some((bytes, size)) = (self.next)()? else { break };
                (self.bytes, self.left) = (bytes, 0..size);
            }
            let take = self.left.len().min(buffer.len() - filled);
            buffer[filled..filled + take].copy_from_slice(&self.bytes[self.left.start..][..take]);
            self.left.start += take;
            filled += take;
        }
        Ok(filled)
    }
}

/// The limit on components of a tuple.
pub(crate) const MAX_COMPONENTS: usize = 1024;

/// Reads `count` tuples of numbers of `N` bytes, a block at a time, and appends one value for each.
fn convert<T: Clone, V, const N: usize>(
    reader: &mut dyn Read,
    count: usize,
    components: usize,
    number: impl Fn([u8; N]) -> T,
    mut value: impl FnMut(&[T]) -> V,
    values: &mut Vec<V>,
) -> std::io::Result<()> {
    const BLOCK: usize = 1 << 16;
    if components == 0 || components > MAX_COMPONENTS {
        return Err(ErrorKind::Unsupported.into());
    }
    let tuple = N * components;
    let mut block = vec![0_u8; (BLOCK / tuple).clamp(1, count.max(1)) * tuple];
    let mut numbers: Vec<T> = Vec::with_capacity(components);
    let mut left = count;
    while left > 0 {
        let take = left.min(block.len() / tuple);
        let bytes = &mut block[..take * tuple];
        reader.read_exact(bytes)?;
        if components == 1 {
            values.extend(bytes.as_chunks::<N>().0.iter().map(|&bytes| value(&[number(bytes)])));
        } else {
            for bytes in bytes.chunks_exact(tuple) {
                numbers.clear();
                numbers.extend(bytes.as_chunks::<N>().0.iter().map(|&bytes| number(bytes)));
                values.push(value(&numbers));
            }
        }
        left -= take;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_type_decodes_in_both_byte_orders() {
        let get = |kind, endian, bytes: &[u8]| {
            let mut values = Values::none(kind, 1, Pick::Component(0));
            append(&mut &*bytes, 1, &Layout::scalar([1; 3], kind, endian), &mut values).unwrap();
            values.into_samples()
        };
        for (endian, flip) in [(Endian::Big, false), (Endian::Little, true)] {
            let order = |mut bytes: Vec<u8>| {
                if flip {
                    bytes.reverse();
                }
                bytes
            };
            let one = |kind, bytes: Vec<u8>| get(kind, endian, &order(bytes));
            assert_eq!(one(SampleType::U8, vec![200]), Samples::U8(vec![200]));
            assert_eq!(one(SampleType::I8, vec![200]), Samples::F32(vec![-56.0]));
            assert_eq!(one(SampleType::U16, 0x1234_u16.to_be_bytes().into()), Samples::U16(vec![0x1234]));
            assert_eq!(one(SampleType::I16, (-1000_i16).to_be_bytes().into()), Samples::I16(vec![-1000]));
            assert_eq!(one(SampleType::U32, 4_000_000_000_u32.to_be_bytes().into()), Samples::F32(vec![4e9]));
            assert_eq!(one(SampleType::I32, (-70_000_i32).to_be_bytes().into()), Samples::F32(vec![-7e4]));
            assert_eq!(
                one(SampleType::U64, (1_u64 << 40).to_be_bytes().into()),
                Samples::F32(vec![1_099_511_627_776.0])
            );
            assert_eq!(one(SampleType::I64, (-5_i64).to_be_bytes().into()), Samples::F32(vec![-5.0]));
            assert_eq!(one(SampleType::F32, 1.5_f32.to_be_bytes().into()), Samples::F32(vec![1.5]));
            assert_eq!(one(SampleType::F64, (-2.5_f64).to_be_bytes().into()), Samples::F32(vec![-2.5]));
        }
    }

    #[test]
    fn tuples_give_a_component_or_their_length() {
        let bytes: Vec<u8> = [3_i16, 4, 0, -5, 12, 0].iter().flat_map(|n| n.to_le_bytes()).collect();
        let read = |pick| {
            let layout =
                Layout { dims: [1; 3], kind: SampleType::I16, endian: Endian::Little, components: 3, pick };
            let mut values = Values::none(layout.kind, 3, pick);
            append(&mut &*bytes, 2, &layout, &mut values).map(|()| values)
        };
        assert_eq!(read(Pick::Component(1)).unwrap(), Samples::I16(vec![4, 12]).into());
        assert_eq!(read(Pick::Magnitude).unwrap(), Samples::F32(vec![5.0, 13.0]).into());
        assert_eq!(read(Pick::Whole).unwrap(), Values::Whole(Tuples { size: 6, bytes: bytes.clone() }));
    }

    #[test]
    fn indices_are_whole_and_in_range() {
        let read = |bytes: &[u8], kind| {
            let mut values = Vec::new();
            let count = bytes.len() / usize::try_from(kind_bytes(kind)).unwrap();
            each_index(&mut &*bytes, count, kind, Endian::Little, &mut |index| {
                values.push(index);
                if index == 7 { Err("7 is refused".to_owned()) } else { Ok(()) }
            })
            .map(|()| values)
        };
        fn kind_bytes(kind: SampleType) -> u64 {
            kind.bytes()
        }
        assert_eq!(read(&[1, 0, 2, 0], SampleType::U16).unwrap(), [1, 2]);
        assert!(read(&(-1_i64).to_le_bytes(), SampleType::I64).unwrap_err().to_string().contains("-1"));
        assert!(read(&u64::MAX.to_le_bytes(), SampleType::U64).is_err());
        assert_eq!(read(&[6, 7, 8], SampleType::U8).unwrap_err().to_string(), "7 is refused");
        assert!(read(&1_f32.to_le_bytes(), SampleType::F32).is_err());
    }
}
