//! Samples as files store them: types, byte orders, size checks and decoding.

use std::io::{ErrorKind, Read};

use super::ReadOptions;
use super::source::Source;
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
    /// 32-bit float.
    F32,
    /// 64-bit float; kept as 32-bit float.
    F64,
}

impl SampleType {
    /// Every type.
    pub const ALL: [Self; 8] =
        [Self::U8, Self::I8, Self::U16, Self::I16, Self::U32, Self::I32, Self::F32, Self::F64];

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
            Self::F64 => 8,
        }
    }

    /// Size in memory, in bytes.
    #[must_use]
    pub fn stored_bytes(self) -> u64 {
        match self {
            Self::U8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::I8 | Self::U32 | Self::I32 | Self::F32 | Self::F64 => 4,
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

/// Where the samples lie in a file, and how they are written.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stream {
    pub(crate) dims: [u32; 3],
    pub(crate) kind: SampleType,
    pub(crate) endian: Endian,
    /// Where the stream starts in the file.
    pub(crate) offset: u64,
    /// Whether the stream is compressed from there on.
    pub(crate) gzip: bool,
    /// Bytes of the (inflated) stream before the first sample.
    pub(crate) skip: u64,
}

/// The most by which deflate shrinks its input: 258 bytes in two bits (RFC 1951), rounded up.
const DEFLATE_RATIO: u64 = 1032;

/// Number of samples and their size in the file, in bytes, checked against the memory limit.
pub(crate) fn data_size(
    source: &Source,
    place: &str,
    dims: [u32; 3],
    kind: SampleType,
    options: &ReadOptions,
) -> Result<(usize, u64)> {
    let [x, y, z] = dims;
    if let Some(extent) = dims.iter().find(|&&extent| extent < 2) {
        return Err(
            source.error(place, format!("{x} x {y} x {z} has {extent}: every extent must be at least 2"))
        );
    }
    let overflow =
        || source.error(place, format!("{x} x {y} x {z} samples are more than memory can address"));
    let count =
        dims.iter().try_fold(1_u64, |n, &extent| n.checked_mul(u64::from(extent))).ok_or_else(overflow)?;
    let memory = count.checked_mul(kind.stored_bytes()).ok_or_else(overflow)?;
    if memory > options.max_bytes {
        return Err(source.error(
            place,
            format!("{x} x {y} x {z} samples take {memory} bytes: the limit is {}", options.max_bytes),
        ));
    }
    let in_file = count.checked_mul(kind.bytes()).ok_or_else(overflow)?;
    Ok((usize::try_from(count).map_err(|_| overflow())?, in_file))
}

/// Reads the samples of a stream that must hold exactly them.
pub(crate) fn read(source: &Source, place: &str, stream: &Stream, options: &ReadOptions) -> Result<Samples> {
    let (count, bytes) = data_size(source, place, stream.dims, stream.kind, options)?;
    let [x, y, z] = stream.dims;
    let wanted = format!("{bytes} bytes for {x} x {y} x {z} samples of type {}", stream.kind.name());
    let available = source.len().saturating_sub(stream.offset);
    let end = stream.skip.checked_add(bytes);
    let end = end.ok_or_else(|| source.error("data", format!("skips {} bytes: overflows", stream.skip)))?;
    // The file's size answers before memory is taken.
    if stream.gzip {
        let most = available.saturating_mul(DEFLATE_RATIO);
        if end > most {
            return Err(source
                .error("data", format!("needs {wanted}: {available} compressed bytes hold at most {most}")));
        }
    } else if end != available {
        let left = available.saturating_sub(stream.skip);
        return Err(source.error(
            format!("data at byte {}", stream.offset.saturating_add(stream.skip)),
            format!("needs {wanted}: {left} are there"),
        ));
    }

    let mut reader = Counted { inner: source.reader(stream.offset, stream.gzip)?, count: 0 };
    let describe = |error: std::io::Error, got: u64| match error.kind() {
        ErrorKind::UnexpectedEof => {
            let got = got.saturating_sub(stream.skip);
            source.error("data", format!("needs {wanted}: ends after {got}"))
        }
        ErrorKind::OutOfMemory => source.error(place, format!("needs {wanted}: memory is full")),
        ErrorKind::InvalidData | ErrorKind::InvalidInput => {
            source.error("data", format!("gzip stream is damaged after {got} inflated bytes: {error}"))
        }
        _ => Error::io(source.path(), "cannot read", error),
    };
    let samples = skip(&mut reader, stream.skip)
        .and_then(|()| decode(&mut reader, count, stream.kind, stream.endian))
        .map_err(|error| describe(error, reader.count))?;
    // One byte more shows excess, and makes gzip check its sums.
    let mut more = [0_u8];
    match reader.read(&mut more) {
        Ok(0) => Ok(samples),
        Ok(_) => Err(source.error("data", format!("needs {wanted}: the stream holds more"))),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => {
            Err(source.error("data", "gzip stream ends before its check sum"))
        }
        Err(error) => Err(describe(error, reader.count)),
    }
}

/// A reader that counts what went through it, so that messages can say how much there was.
struct Counted<R> {
    inner: R,
    count: u64,
}

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let got = self.inner.read(buffer)?;
        self.count = self.count.saturating_add(u64::try_from(got).unwrap_or(u64::MAX));
        Ok(got)
    }
}

fn skip(reader: &mut impl Read, bytes: u64) -> std::io::Result<()> {
    let skipped = std::io::copy(&mut reader.take(bytes), &mut std::io::sink())?;
    if skipped < bytes { Err(ErrorKind::UnexpectedEof.into()) } else { Ok(()) }
}

fn decode(
    reader: &mut impl Read,
    count: usize,
    kind: SampleType,
    endian: Endian,
) -> std::io::Result<Samples> {
    /// The conversion for the byte order.
    macro_rules! order {
        ($type:ty) => {
            match endian {
                Endian::Little => <$type>::from_le_bytes,
                Endian::Big => <$type>::from_be_bytes,
            }
        };
    }
    /// The same, narrowed to the nearest 32-bit float.
    macro_rules! narrowed {
        ($type:ty) => {{
            let number = order!($type);
            convert(reader, count, move |bytes| num::f32_of(f64::from(number(bytes)))).map(Samples::F32)
        }};
    }
    match kind {
        SampleType::U8 => convert(reader, count, |[byte]| byte).map(Samples::U8),
        SampleType::U16 => convert(reader, count, order!(u16)).map(Samples::U16),
        SampleType::I16 => convert(reader, count, order!(i16)).map(Samples::I16),
        SampleType::F32 => convert(reader, count, order!(f32)).map(Samples::F32),
        SampleType::I8 => narrowed!(i8),
        SampleType::U32 => narrowed!(u32),
        SampleType::I32 => narrowed!(i32),
        SampleType::F64 => narrowed!(f64),
    }
}

/// Reads `count` numbers of `N` bytes, a block at a time, so that only the result takes memory.
fn convert<T, const N: usize>(
    reader: &mut impl Read,
    count: usize,
    number: impl Fn([u8; N]) -> T,
) -> std::io::Result<Vec<T>> {
    const BLOCK: usize = 1 << 16;
    let mut values = Vec::new();
    values.try_reserve_exact(count).map_err(|_| ErrorKind::OutOfMemory)?;
    let mut block = [0_u8; BLOCK];
    while values.len() < count {
        let take = (count - values.len()).min(BLOCK / N);
        let bytes = &mut block[..take * N];
        reader.read_exact(bytes)?;
        values.extend(bytes.as_chunks::<N>().0.iter().map(|&bytes| number(bytes)));
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_type_decodes_in_both_byte_orders() {
        let get = |kind, endian, bytes: &[u8]| decode(&mut &*bytes, 1, kind, endian).unwrap();
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
            assert_eq!(one(SampleType::F32, 1.5_f32.to_be_bytes().into()), Samples::F32(vec![1.5]));
            assert_eq!(one(SampleType::F64, (-2.5_f64).to_be_bytes().into()), Samples::F32(vec![-2.5]));
        }
    }

    #[test]
    fn names_are_those_of_scene_files() {
        for kind in SampleType::ALL {
            assert_eq!(SampleType::from_name(kind.name()).unwrap(), kind);
        }
        assert!(SampleType::from_name("int16").unwrap_err().to_string().contains("u8, i8, u16"));
    }
}
