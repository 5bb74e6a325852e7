//! Stored samples of a grid.

use super::on_demand::OnDemand;

/// The types of samples that a device stores.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SampleKind {
    U8,
    U16,
    I16,
    F32,
}

/// The samples of a grid in the type that the device stores.
///
/// Readers convert other types (`i8`, `u32`, `i32`, `u64`, `i64`, `f64`) to `f32`.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// 8-bit unsigned.
    U8(Vec<u8>),
    /// 16-bit unsigned.
    U16(Vec<u16>),
    /// 16-bit signed.
    I16(Vec<i16>),
    /// 32-bit float. NaN marks vacuum.
    F32(Vec<f32>),
    /// Read box by box from where they are kept, because memory has no room for all.
    OnDemand(OnDemand),
}

impl Samples {
    /// Returns the type of the samples.
    pub(crate) fn kind(&self) -> SampleKind {
        match self {
            Self::U8(_) => SampleKind::U8,
            Self::U16(_) => SampleKind::U16,
            Self::I16(_) => SampleKind::I16,
            Self::F32(_) => SampleKind::F32,
            Self::OnDemand(samples) => samples.kind(),
        }
    }

    /// Returns the number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::U8(v) => v.len(),
            Self::U16(v) => v.len(),
            Self::I16(v) => v.len(),
            Self::F32(v) => v.len(),
            Self::OnDemand(samples) => samples.len(),
        }
    }

    /// Returns whether there are no samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the sample's stored number, before the grid's rescale.
    ///
    /// # Panics
    ///
    /// When `index` is not below [`Samples::len`]. Samples on demand that cannot be read are NaN.
    #[must_use]
    pub fn get(&self, index: usize) -> f64 {
        match self {
            Self::U8(v) => f64::from(v[index]),
            Self::U16(v) => f64::from(v[index]),
            Self::I16(v) => f64::from(v[index]),
            Self::F32(v) => f64::from(v[index]),
            Self::OnDemand(samples) => samples.get(index),
        }
    }

    /// Returns the name of the type in scene files.
    #[must_use]
    pub fn type_name(&self) -> &'static str {
        match self.kind() {
            SampleKind::U8 => "u8",
            SampleKind::U16 => "u16",
            SampleKind::I16 => "i16",
            SampleKind::F32 => "f32",
        }
    }

    /// Returns the size of one sample in bytes.
    #[must_use]
    pub fn sample_bytes(&self) -> usize {
        match self.kind() {
            SampleKind::U8 => 1,
            SampleKind::U16 | SampleKind::I16 => 2,
            SampleKind::F32 => 4,
        }
    }

    /// Returns the range of finite values, the number of NaN and the number of infinities. Without finite
    /// values the range is empty. Samples on demand are not counted: the range is that of their overview, and of floats one is taken to be NaN
    /// and one infinite.
    pub(crate) fn statistics(&self) -> ([f64; 2], usize, usize) {
        fn integers<T: Copy + Ord>(values: &[T]) -> [f64; 2]
        where
            f64: From<T>,
        {
            match (values.iter().min(), values.iter().max()) {
                (Some(&lo), Some(&hi)) => [f64::from(lo), f64::from(hi)],
                _ => [f64::INFINITY, f64::NEG_INFINITY],
            }
        }
        match self {
            Self::OnDemand(samples) => {
                let unknown = usize::from(samples.kind() == SampleKind::F32);
                (samples.overview().samples.statistics().0, unknown, unknown)
            }
            Self::U8(v) => (integers(v), 0, 0),
            Self::U16(v) => (integers(v), 0, 0),
            Self::I16(v) => (integers(v), 0, 0),
            Self::F32(v) => {
                let mut range = [f64::INFINITY, f64::NEG_INFINITY];
                let (mut nan, mut infinite) = (0, 0);
                for &value in v {
                    if value.is_finite() {
                        range[0] = range[0].min(f64::from(value));
                        range[1] = range[1].max(f64::from(value));
                    } else if value.is_nan() {
                        nan += 1;
                    } else {
                        infinite += 1;
                    }
                }
                (range, nan, infinite)
            }
        }
    }
}
