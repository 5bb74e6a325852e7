//! Samples as files store them: types, byte orders, size checks and decoding.

use std::collections::TryReserveError;
use std::io::{ErrorKind, Read};

use super::ReadOptions;
use super::arrays::Pick;
use super::source::{Encoding, Source};
use super::text::{self, Scanner};
use crate::error::{Error, Result};
use crate::num;
use crate::scene::Samples;

/// The type of a sample in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleType {
    /// 8-bit unsigned.
    U8,
    /// 8-bit signed; kept as 32-bit float.
    I8,
    /// 16-bit unsigned.
    U16,
    /// 16-bit signed.
    I16,
    /// 32-bit unsigned; kept as 32-bit float.
    U32,
    /// 32-bit signed; kept as 32-bit float.
    I32,
    /// 64-bit unsigned; kept as 32-bit float.
    U64,
    /// 64-bit signed; kept as 32-bit float.
    I64,
    /// 32-bit float.
    F32,
    /// 64-bit float; kept as 32-bit float.
    F64,
}

impl SampleType {
    /// Every type.
    pub const ALL: [Self; 10] = [
        Self::U8,
        Self::I8,
        Self::U16,
        Self::I16,
        Self::U32,
        Self::I32,
        Self::U64,
        Self::I64,
        Self::F32,
        Self::F64,
    ];

    /// The name that scene files use.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::U8 => "u8",
            Self::I8 => "i8",
            Self::U16 => "u16",
            Self::I16 => "i16",
            Self::U32 => "u32",
            Self::I32 => "i32",
            Self::U64 => "u64",
            Self::I64 => "i64",
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }

    /// The type of a name.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] with the allowed names.
    pub fn from_name(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name).ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            Error::invalid("type", format!("\"{name}\": must be one of {names}"))
        })
    }

    /// Size in the file, in bytes.
    #[must_use]
    pub fn bytes(self) -> u64 {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }

    /// Size in memory, in bytes.
    #[must_use]
    pub fn stored_bytes(self) -> u64 {
        match self {
            Self::U8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::I8 | Self::U32 | Self::I32 | Self::U64 | Self::I64 | Self::F32 | Self::F64 => 4,
        }
    }
}

/// The order of the bytes of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Endian {
    /// Least significant byte first.
    Little,
    /// Most significant byte first.
    Big,
}

impl Endian {
    /// The order of the machine.
    pub(crate) const NATIVE: Self = if cfg!(target_endian = "little") { Self::Little } else { Self::Big };

    /// Bytes of a whole number, at most 8.
    pub(crate) fn whole(self, bytes: &[u8]) -> u64 {
        let add = |sum: u64, byte: &u8| (sum << 8) | u64::from(*byte);
        match self {
            Self::Little => bytes.iter().rev().fold(0, add),
            Self::Big => bytes.iter().fold(0, add),
        }
    }
}

/// What the samples of a grid are.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layout {
    pub(crate) dims: [u32; 3],
    pub(crate) kind: SampleType,
    pub(crate) endian: Endian,
    /// Numbers at each sample, and which of them is read.
    pub(crate) components: usize,
    pub(crate) pick: Pick,
}

impl Layout {
    /// One number at each sample.
    pub(crate) fn scalar(dims: [u32; 3], kind: SampleType, endian: Endian) -> Self {
        Self { dims, kind, endian, components: 1, pick: Pick::Component(0) }
    }
}

/// One file's share of the samples, and how it lies there.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    pub(crate) source: Source,
    /// Where the stream starts in the file.
    pub(crate) offset: u64,
    /// How it is packed from there on.
    pub(crate) encoding: Encoding,
    /// Bytes of the unpacked stream before the first sample.
    pub(crate) skip: u64,
    /// Whether the numbers are words.
    pub(crate) text: bool,
}

impl Part {
    /// A file of which so many bytes are samples, behind some that are not. Samples may begin with gzip's two
    /// magic bytes: a file of exactly the right size is not packed.
    pub(crate) fn sized(source: Source, skip: u64, bytes: u64) -> Self {
        let raw = skip.checked_add(bytes) == Some(source.len());
        let encoding = if raw { Encoding::Raw } else { source.encoding() };
        Self { source, offset: 0, encoding, skip, text: false }
    }
}

/// Number of samples and their size in the file, in bytes, checked against the memory limit.
pub(crate) fn data_size(
    source: &Source,
    place: &str,
    layout: &Layout,
    options: &ReadOptions,
) -> Result<(usize, u64)> {
    let [x, y, z] = layout.dims;
    if let Some(extent) = layout.dims.iter().find(|&&extent| extent < 2) {
        return Err(
            source.error(place, format!("{x} x {y} x {z} has {extent}: every extent must be at least 2"))
        );
    }
    let overflow =
        || source.error(place, format!("{x} x {y} x {z} samples are more than memory can address"));
    let count = layout
        .dims
        .iter()
        .try_fold(1_u64, |n, &extent| n.checked_mul(u64::from(extent)))
        .ok_or_else(overflow)?;
    let stored = if layout.pick == Pick::Magnitude { 4 } else { layout.kind.stored_bytes() };
    let memory = count.checked_mul(stored).ok_or_else(overflow)?;
    if memory > options.max_bytes {
        return Err(source.error(
            place,
            format!("{x} x {y} x {z} samples take {memory} bytes: the limit is {}", options.max_bytes),
        ));
    }
    let tuple = u64::try_from(layout.components).ok().and_then(|n| n.checked_mul(layout.kind.bytes()));
    let in_file = tuple.and_then(|tuple| count.checked_mul(tuple)).ok_or_else(overflow)?;
    Ok((usize::try_from(count).map_err(|_| overflow())?, in_file))
}

/// Reads samples from files that hold exactly them, each the same share, one after the other.
///
/// `source` and `place` are the header's. A part is asked for when its turn comes, so that few files are
/// open at a time.
pub(crate) fn read(
    source: &Source,
    place: &str,
    layout: &Layout,
    parts: usize,
    part: &dyn Fn(usize) -> Result<Part>,
    options: &ReadOptions,
) -> Result<Samples> {
    let (count, bytes) = data_size(source, place, layout, options)?;
    if parts == 0 || count % parts != 0 {
        return Err(source.error(place, format!("{count} samples do not divide into {parts} files")));
    }
    let mut samples = Samples::none(layout.kind, layout.pick);
    for i in 0..parts {
        let share = Share { count: count / parts, bytes: bytes / num::wide(parts) };
        let part = part(i)?;
        share.check(&part, layout)?;
        if i == 0 {
            // The first file's size has answered for its share; the others must have as much.
            let full = |_| source.error(place, format!("{count} samples: memory is full"));
            samples.reserve(count).map_err(full)?;
        }
        share.read(&part, layout, &mut samples)?;
    }
    Ok(samples)
}

/// What one file must hold.
struct Share {
    count: usize,
    bytes: u64,
}

impl Share {
    fn wanted(&self, layout: &Layout) -> String {
        let [x, y, z] = layout.dims;
        let all = if layout.components == 1 {
            format!("{x} x {y} x {z} samples")
        } else {
            format!("{x} x {y} x {z} samples of {} components", layout.components)
        };
        format!("{} bytes for {} of {all} of type {}", self.bytes, self.count, layout.kind.name())
    }

    /// Whether the file can hold it, before memory is taken.
    fn check(&self, part: &Part, layout: &Layout) -> Result<()> {
        let source = &part.source;
        let stored = source.len().saturating_sub(part.offset);
        let end = part.skip.checked_add(self.bytes);
        let end = end.ok_or_else(|| source.error("data", format!("skips {} bytes: overflows", part.skip)))?;
        let most = part.encoding.most(stored);
        if part.text {
            let numbers = text::most_numbers(most);
            let wanted = self.bytes / layout.kind.bytes();
            if wanted > numbers {
                return Err(source.error(
                    "data",
                    format!("needs {wanted} numbers: {stored} bytes hold at most {numbers}"),
                ));
            }
        } else if part.encoding != Encoding::Raw {
            if end > most {
                return Err(source.error(
                    "data",
                    format!("needs {}: {stored} compressed bytes hold at most {most}", self.wanted(layout)),
                ));
            }
        } else if end != stored {
            return Err(source.error(
                format!("data at byte {}", part.offset.saturating_add(part.skip)),
                format!("needs {}: {} are there", self.wanted(layout), stored.saturating_sub(part.skip)),
            ));
        }
        Ok(())
    }

    fn read(&self, part: &Part, layout: &Layout, samples: &mut Samples) -> Result<()> {
        let source = &part.source;
        let packed = source.reader(part.offset, part.encoding);
        let most = part.encoding.most(source.len().saturating_sub(part.offset));
        let mut scanner = Scanner::of(source, packed, most);
        scanner.skip(part.skip)?;
        if part.text {
            // Words have no byte order: they come as little-endian bytes.
            let words = Layout { endian: Endian::Little, ..*layout };
            append(&mut scanner.numbers(layout.kind), self.count, &words, samples)
                .map_err(|error| self.describe(error, 0, part, layout))?;
            return match scanner.word()?.map(text::shown) {
                Some(word) => Err(scanner.error(format!("\"{word}\": more numbers than announced"))),
                None => Ok(()),
            };
        }
        let begin = scanner.position();
        append(&mut scanner, self.count, layout, samples)
            .map_err(|error| self.describe(error, scanner.position() - begin, part, layout))?;
        // One byte more shows excess, and makes gzip check its sums.
        let mut more = [0_u8];
        match scanner.read(&mut more) {
            Ok(0) => Ok(()),
            Ok(_) => {
                Err(source.error("data", format!("needs {}: the stream holds more", self.wanted(layout))))
            }
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => {
                Err(source
                    .error("data", format!("{} stream ends before its check sum", part.encoding.name())))
            }
            Err(error) => Err(self.describe(error, self.bytes, part, layout)),
        }
    }

    fn describe(&self, error: std::io::Error, got: u64, part: &Part, layout: &Layout) -> Error {
        let source = &part.source;
        match error.kind() {
            ErrorKind::UnexpectedEof if part.text => source
                .error("data", format!("needs {} numbers: there are fewer", self.count * layout.components)),
            ErrorKind::UnexpectedEof => {
                source.error("data", format!("needs {}: ends after {got}", self.wanted(layout)))
            }
            ErrorKind::InvalidData | ErrorKind::InvalidInput => source.error(
                "data",
                format!("{} stream is damaged after {got} unpacked bytes: {error}", part.encoding.name()),
            ),
            _ => source.io_error(error),
        }
    }
}

impl Samples {
    /// An empty list of the type that keeps such numbers.
    pub(crate) fn none(kind: SampleType, pick: Pick) -> Self {
        match (pick, kind) {
            (Pick::Component(_), SampleType::U8) => Self::U8(Vec::new()),
            (Pick::Component(_), SampleType::U16) => Self::U16(Vec::new()),
            (Pick::Component(_), SampleType::I16) => Self::I16(Vec::new()),
            _ => Self::F32(Vec::new()),
        }
    }

    /// Makes room for exactly so many.
    pub(crate) fn reserve(&mut self, count: usize) -> std::result::Result<(), TryReserveError> {
        match self {
            Self::U8(v) => v.try_reserve_exact(count),
            Self::U16(v) => v.try_reserve_exact(count),
            Self::I16(v) => v.try_reserve_exact(count),
            Self::F32(v) => v.try_reserve_exact(count),
        }
    }

    /// As 32-bit floats.
    pub(crate) fn into_f32(self) -> Vec<f32> {
        match self {
            Self::U8(v) => v.into_iter().map(f32::from).collect(),
            Self::U16(v) => v.into_iter().map(f32::from).collect(),
            Self::I16(v) => v.into_iter().map(f32::from).collect(),
            Self::F32(v) => v,
        }
    }
}

/// Reads `count` tuples and appends what `layout` picks of each, a block at a time, so that only the
/// result takes memory. The extents of the layout do not count.
///
/// # Errors
///
/// Of the reader; [`ErrorKind::UnexpectedEof`] where it ends; [`ErrorKind::OutOfMemory`].
pub(crate) fn append(
    reader: &mut dyn Read,
    count: usize,
    layout: &Layout,
    samples: &mut Samples,
) -> std::io::Result<()> {
    samples.reserve(count).map_err(|_| ErrorKind::OutOfMemory)?;
    let Layout { kind, endian, components, pick, .. } = *layout;
    /// The conversion for the byte order.
    macro_rules! order {
        ($type:ty) => {
            match endian {
                Endian::Little => <$type>::from_le_bytes,
                Endian::Big => <$type>::from_be_bytes,
            }
        };
    }
    /// Into a list of the file's own type.
    macro_rules! kept {
        ($type:ty, $list:expr, $at:expr) => {
            convert(reader, count, components, order!($type), |tuple| tuple[$at], $list)
        };
    }
    /// Into the nearest 32-bit floats.
    macro_rules! narrowed {
        ($type:ty, $list:expr) => {{
            let number = order!($type);
            let wide = move |bytes| number(bytes) as f64;
            match pick {
                Pick::Component(at) => {
                    convert(reader, count, components, wide, |tuple| num::f32_of(tuple[at]), $list)
                }
                Pick::Magnitude => {
                    let length = |tuple: &[f64]| num::f32_of(magnitude(tuple));
                    convert(reader, count, components, wide, length, $list)
                }
            }
        }};
    }
    match (samples, kind, pick) {
        (Samples::U8(v), SampleType::U8, Pick::Component(at)) => kept!(u8, v, at),
        (Samples::U16(v), SampleType::U16, Pick::Component(at)) => kept!(u16, v, at),
        (Samples::I16(v), SampleType::I16, Pick::Component(at)) => kept!(i16, v, at),
        (Samples::F32(v), SampleType::F32, Pick::Component(at)) => kept!(f32, v, at),
        (Samples::F32(v), kind, _) => match kind {
            SampleType::U8 => narrowed!(u8, v),
            SampleType::I8 => narrowed!(i8, v),
            SampleType::U16 => narrowed!(u16, v),
            SampleType::I16 => narrowed!(i16, v),
            SampleType::U32 => narrowed!(u32, v),
            SampleType::I32 => narrowed!(i32, v),
            SampleType::U64 => narrowed!(u64, v),
            SampleType::I64 => narrowed!(i64, v),
            SampleType::F32 => narrowed!(f32, v),
            SampleType::F64 => narrowed!(f64, v),
        },
        // A list that was begun as another type.
        _ => Err(ErrorKind::Unsupported.into()),
    }
}

/// The Euclidean length.
fn magnitude(tuple: &[f64]) -> f64 {
    tuple.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Reads `count` numbers and appends them as 64-bit floats: coordinates, where picking would come later.
pub(crate) fn append_f64(
    reader: &mut dyn Read,
    count: usize,
    kind: SampleType,
    endian: Endian,
    values: &mut Vec<f64>,
) -> std::io::Result<()> {
    values.try_reserve_exact(count).map_err(|_| ErrorKind::OutOfMemory)?;
    macro_rules! wide {
        ($type:ty) => {{
            let number = match endian {
                Endian::Little => <$type>::from_le_bytes,
                Endian::Big => <$type>::from_be_bytes,
            };
            convert(reader, count, 1, move |bytes| number(bytes) as f64, |tuple| tuple[0], values)
        }};
    }
    match kind {
        SampleType::U8 => wide!(u8),
        SampleType::I8 => wide!(i8),
        SampleType::U16 => wide!(u16),
        SampleType::I16 => wide!(i16),
        SampleType::U32 => wide!(u32),
        SampleType::I32 => wide!(i32),
        SampleType::U64 => wide!(u64),
        SampleType::I64 => wide!(i64),
        SampleType::F32 => wide!(f32),
        SampleType::F64 => wide!(f64),
    }
}

/// Reads `count` whole numbers from 0 to 2^32 - 2 and appends them: indices, offsets and types.
///
/// # Errors
///
/// As [`append`]; [`ErrorKind::InvalidData`] with the number that is out of range, or where the type is a
/// float.
pub(crate) fn append_indices(
    reader: &mut dyn Read,
    count: usize,
    kind: SampleType,
    endian: Endian,
    values: &mut Vec<u32>,
) -> std::io::Result<()> {
    values.try_reserve_exact(count).map_err(|_| ErrorKind::OutOfMemory)?;
    let mut wrong = None;
    macro_rules! whole {
        ($type:ty) => {{
            let number = match endian {
                Endian::Little => <$type>::from_le_bytes,
                Endian::Big => <$type>::from_be_bytes,
            };
            let mut index = |tuple: &[$type]| {
                u32::try_from(tuple[0]).ok().filter(|&i| i < u32::MAX).unwrap_or_else(|| {
                    wrong.get_or_insert_with(|| tuple[0].to_string());
                    0
                })
            };
            convert(reader, count, 1, number, &mut index, values)
        }};
    }
    match kind {
        SampleType::U8 => whole!(u8),
        SampleType::I8 => whole!(i8),
        SampleType::U16 => whole!(u16),
        SampleType::I16 => whole!(i16),
        SampleType::U32 => whole!(u32),
        SampleType::I32 => whole!(i32),
        SampleType::U64 => whole!(u64),
        SampleType::I64 => whole!(i64),
        SampleType::F32 | SampleType::F64 => {
            return Err(std::io::Error::new(
                ErrorKind::InvalidData,
                format!("type {}: indices are whole numbers", kind.name()),
            ));
        }
    }?;
    match wrong {
        Some(number) => {
            let rule = format!("{number}: must be from 0 to {}", u32::MAX - 1);
            Err(std::io::Error::new(ErrorKind::InvalidData, rule))
        }
        None => Ok(()),
    }
}

/// Most components of a tuple.
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
            let mut samples = Samples::none(kind, Pick::Component(0));
            append(&mut &*bytes, 1, &Layout::scalar([1; 3], kind, endian), &mut samples).unwrap();
            samples
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
            let mut samples = Samples::none(layout.kind, pick);
            append(&mut &*bytes, 2, &layout, &mut samples).map(|()| samples)
        };
        assert_eq!(read(Pick::Component(1)).unwrap(), Samples::I16(vec![4, 12]));
        assert_eq!(read(Pick::Magnitude).unwrap(), Samples::F32(vec![5.0, 13.0]));
    }

    #[test]
    fn indices_are_whole_and_in_range() {
        let read = |bytes: &[u8], kind| {
            let mut values = Vec::new();
            let count = bytes.len() / usize::try_from(kind_bytes(kind)).unwrap();
            append_indices(&mut &*bytes, count, kind, Endian::Little, &mut values).map(|()| values)
        };
        fn kind_bytes(kind: SampleType) -> u64 {
            kind.bytes()
        }
        assert_eq!(read(&[1, 0, 2, 0], SampleType::U16).unwrap(), [1, 2]);
        assert!(read(&(-1_i64).to_le_bytes(), SampleType::I64).unwrap_err().to_string().contains("-1"));
        assert!(read(&u64::MAX.to_le_bytes(), SampleType::U64).is_err());
        assert!(read(&1_f32.to_le_bytes(), SampleType::F32).is_err());
    }

    #[test]
    fn names_are_those_of_scene_files() {
        for kind in SampleType::ALL {
            assert_eq!(SampleType::from_name(kind.name()).unwrap(), kind);
        }
        assert!(SampleType::from_name("int16").unwrap_err().to_string().contains("u8, i8, u16"));
    }
}
