//! Number conversions with explicit behaviour, so that `as` is confined to this file.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the one place where rounding and saturating casts are made, each by a named function"
)]

/// Returns the nearest `f32`.
pub(crate) fn f32_of(value: f64) -> f32 {
    value as f32
}

/// Returns the nearest `f32` of each component.
pub(crate) fn vec3_of(value: glam::DVec3) -> glam::Vec3 {
    glam::Vec3::new(f32_of(value.x), f32_of(value.y), f32_of(value.z))
}

/// Converts an index or a length; exact below 2^53.
pub(crate) const fn f64_of(value: usize) -> f64 {
    value as f64
}

/// Converts a count; exact below 2^53.
pub(crate) fn f64_of_u64(value: u64) -> f64 {
    value as f64
}

/// Returns the nearest half-precision number, of two the even one, as its bits. What exceeds their range becomes its end.
pub(crate) fn half_of(value: f32) -> u16 {
    const LEAST_NORMAL: f32 = 6.103_515_6e-5;
    const MOST: f32 = 65_504.0;
    let (bits, magnitude) = (value.abs().to_bits(), value.abs());
    let code = if magnitude >= MOST {
        0x7bff
    } else if magnitude < LEAST_NORMAL {
        // Steps of 2^-24.
        u32_of((f64::from(magnitude) * 16_777_216.0).round_ties_even())
    } else {
        (bits + 0xfff + (bits >> 13 & 1) - (112 << 23)) >> 13
    };
    let sign = if value.is_sign_negative() { 0x8000 } else { 0 };
    u16::try_from(code).unwrap_or(0x7bff) | sign
}

/// Truncates towards zero and saturates at both ends; NaN gives 0.
pub(crate) fn usize_of(value: f64) -> usize {
    value as usize
}

/// Truncates towards zero and saturates at both ends; NaN gives 0.
pub(crate) fn u32_of(value: f64) -> u32 {
    value as u32
}

/// Truncates towards zero and saturates at both ends; NaN gives 0.
pub(crate) fn u64_of(value: f64) -> u64 {
    value as u64
}

/// Rounds to the nearest code and saturates at both ends; NaN gives 0.
pub(crate) fn u8_code(value: f64) -> u8 {
    value.round() as u8
}

/// Rounds to the nearest code and saturates at both ends; NaN gives 0.
pub(crate) fn u16_code(value: f64) -> u16 {
    value.round() as u16
}

/// Rounds to the nearest code and saturates at both ends; NaN gives 0.
pub(crate) fn i16_code(value: f64) -> i16 {
    value.round() as i16
}

/// A type of numbers that has a nearest one to each `f64`.
#[cfg(feature = "io")]
pub(crate) trait Nearest {
    /// Returns the nearest number. Whole numbers saturate at both ends, and NaN gives 0.
    fn of(value: f64) -> Self;
}

#[cfg(feature = "io")]
macro_rules! nearest {
    ($map:expr; $($type:ty)*) => {
        $(impl Nearest for $type {
            fn of(value: f64) -> Self {
                $map(value) as $type
            }
        })*
    };
}
#[cfg(feature = "io")]
nearest!(f64::round; u8 i8 u16 i16 u32 i32 u64 i64);
#[cfg(feature = "io")]
nearest!(std::convert::identity::<f64>; f32 f64);

/// Converts a 32-bit count to an index; exact on every platform that this crate builds for.
pub(crate) const fn index(value: u32) -> usize {
    value as usize
}

/// Converts a size in bytes to one that memory can have.
pub(crate) fn usize_of_u64(value: u64) -> usize {
    usize::try_from(value).unwrap_or(usize::MAX)
}

/// Converts a length to a 64-bit count; exact on every platform that this crate builds for.
pub(crate) fn wide(value: usize) -> u64 {
    u64::try_from(value).unwrap_or(u64::MAX)
}

/// Converts a length to a 32-bit count; saturates.
pub(crate) fn count(value: usize) -> u32 {
    u32::try_from(value).unwrap_or(u32::MAX)
}
