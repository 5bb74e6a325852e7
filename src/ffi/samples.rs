//! Samples of a grid, of any type.

use bytemuck::{AnyBitPattern, NoUninit};

use super::argument::{self, choice};
use crate::error::{Error, Result};
use crate::io::SampleType;
use crate::num;
use crate::scene::Samples;

/// Type of samples.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum vr_sample_type {
    /// 8-bit unsigned.
    VR_SAMPLE_U8 = 1,
    /// 16-bit unsigned.
    VR_SAMPLE_U16 = 2,
    /// 16-bit signed.
    VR_SAMPLE_I16 = 3,
    /// 32-bit float. NaN marks vacuum.
    VR_SAMPLE_F32 = 4,
    /// 8-bit signed; kept as 32-bit float.
    VR_SAMPLE_I8 = 5,
    /// 32-bit unsigned; kept as 32-bit float.
    VR_SAMPLE_U32 = 6,
    /// 32-bit signed; kept as 32-bit float.
    VR_SAMPLE_I32 = 7,
    /// 64-bit unsigned; kept as 32-bit float.
    VR_SAMPLE_U64 = 8,
    /// 64-bit signed; kept as 32-bit float.
    VR_SAMPLE_I64 = 9,
    /// 64-bit float; kept as 32-bit float.
    VR_SAMPLE_F64 = 10,
}

const SAMPLE_TYPES: [(SampleType, u32); 10] = [
    (SampleType::U8, vr_sample_type::VR_SAMPLE_U8 as u32),
    (SampleType::U16, vr_sample_type::VR_SAMPLE_U16 as u32),
    (SampleType::I16, vr_sample_type::VR_SAMPLE_I16 as u32),
    (SampleType::F32, vr_sample_type::VR_SAMPLE_F32 as u32),
    (SampleType::I8, vr_sample_type::VR_SAMPLE_I8 as u32),
    (SampleType::U32, vr_sample_type::VR_SAMPLE_U32 as u32),
    (SampleType::I32, vr_sample_type::VR_SAMPLE_I32 as u32),
    (SampleType::U64, vr_sample_type::VR_SAMPLE_U64 as u32),
    (SampleType::I64, vr_sample_type::VR_SAMPLE_I64 as u32),
    (SampleType::F64, vr_sample_type::VR_SAMPLE_F64 as u32),
];

/// Copies samples of one type.
///
/// # Safety
///
/// `samples` is null or has that many bytes.
pub(super) unsafe fn samples(
    dims: [u32; 3],
    sample_type: u32,
    samples: *const std::ffi::c_void,
    bytes: usize,
) -> Result<Samples> {
    let kind = choice(sample_type, &SAMPLE_TYPES, "sample_type")?;
    let needed = dims.iter().try_fold(kind.bytes(), |bytes, &n| bytes.checked_mul(u64::from(n)));
    if needed != Some(num::wide(bytes)) {
        let needed = needed.map_or("more than 2^64".to_string(), |needed| needed.to_string());
        let why = format!("{dims:?} samples of type {} need {needed} bytes, {bytes} are given", kind.name());
        return Err(Error::invalid("sample_bytes", why));
    }
    // SAFETY: the caller's promise.
    let bytes = unsafe { argument::array(samples.cast::<u8>(), bytes, "samples") }?;
    Ok(match kind {
        SampleType::U8 => Samples::U8(copied(bytes, |s| s)?),
        SampleType::U16 => Samples::U16(copied(bytes, |s| s)?),
        SampleType::I16 => Samples::I16(copied(bytes, |s| s)?),
        SampleType::F32 => Samples::F32(copied(bytes, |s| s)?),
        SampleType::I8 => Samples::F32(copied(bytes, |s: i8| f32::from(s))?),
        SampleType::U32 => Samples::F32(copied(bytes, |s: u32| s as f32)?),
        SampleType::I32 => Samples::F32(copied(bytes, |s: i32| s as f32)?),
        SampleType::U64 => Samples::F32(copied(bytes, |s: u64| s as f32)?),
        SampleType::I64 => Samples::F32(copied(bytes, |s: i64| s as f32)?),
        SampleType::F64 => Samples::F32(copied(bytes, num::f32_of)?),
    })
}

/// Copies and converts numbers from memory of any alignment.
fn copied<T: AnyBitPattern, U: NoUninit>(bytes: &[u8], convert: impl Fn(T) -> U) -> Result<Vec<U>> {
    let mut list = Vec::new();
    let count = bytes.len() / size_of::<T>();
    list.try_reserve_exact(count)
        .map_err(|error| Error::invalid("samples", format!("no memory for a copy of {count}: {error}")))?;
    list.extend(bytes.chunks_exact(size_of::<T>()).map(|b| convert(bytemuck::pod_read_unaligned(b))));
    Ok(list)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_of_every_type_are_copied_from_any_place() {
        fn check<T: NoUninit + Copy>(kind: vr_sample_type, values: [T; 8], want: Samples) {
            let bytes: &[u8] = bytemuck::cast_slice(&values);
            // Not aligned.
            let mut memory = vec![0xee_u8; bytes.len() + 1];
            memory[1..].copy_from_slice(bytes);
            // SAFETY: that many bytes follow.
            let got = unsafe { samples([2; 3], kind as u32, memory[1..].as_ptr().cast(), bytes.len()) };
            assert_eq!(got.unwrap(), want, "{kind:?}");
        }
        use vr_sample_type::*;
        let floats = |values: [f32; 8]| Samples::F32(values.to_vec());
        check(VR_SAMPLE_U8, [0_u8, 1, 2, 3, 4, 5, 6, 255], Samples::U8(vec![0, 1, 2, 3, 4, 5, 6, 255]));
        let u16s = [0_u16, 1, 258, 3, 4, 5, 6, 65535];
        check(VR_SAMPLE_U16, u16s, Samples::U16(u16s.to_vec()));
        let i16s = [0_i16, -1, 258, 3, 4, 5, 6, -32768];
        check(VR_SAMPLE_I16, i16s, Samples::I16(i16s.to_vec()));
        let f32s = [0.0_f32, -1.5, 1e30, 3.0, 4.0, 5.0, 6.0, f32::INFINITY];
        check(VR_SAMPLE_F32, f32s, floats(f32s));
        check(VR_SAMPLE_I8, [-128_i8, 1, 2, 3, 4, 5, 6, 127], floats([-128., 1., 2., 3., 4., 5., 6., 127.]));
        let large = 4_294_967_296.0;
        check(VR_SAMPLE_U32, [u32::MAX, 1, 2, 3, 4, 5, 6, 7], floats([large, 1., 2., 3., 4., 5., 6., 7.]));
        check(VR_SAMPLE_I32, [-5_i32, 1, 2, 3, 4, 5, 6, 7], floats([-5., 1., 2., 3., 4., 5., 6., 7.]));
        check(VR_SAMPLE_U64, [1_u64 << 32, 1, 2, 3, 4, 5, 6, 7], floats([large, 1., 2., 3., 4., 5., 6., 7.]));
        check(
            VR_SAMPLE_I64,
            [-(1_i64 << 32), 1, 2, 3, 4, 5, 6, 7],
            floats([-large, 1., 2., 3., 4., 5., 6., 7.]),
        );
        check(
            VR_SAMPLE_F64,
            [0.1_f64, 1., 2., 3., 4., 5., 6., 1e300],
            floats([0.1, 1., 2., 3., 4., 5., 6., f32::INFINITY]),
        );
    }

    #[test]
    fn sizes_are_checked_before_anything_is_read() {
        let place = std::ptr::dangling::<u8>().cast();
        // SAFETY: refused before anything is read.
        let refused =
            |dims, kind, bytes| unsafe { samples(dims, kind, place, bytes) }.unwrap_err().to_string();
        assert!(refused([2; 3], 2, 8).contains("need 16 bytes, 8 are given"));
        assert!(refused([u32::MAX; 3], 10, usize::MAX).contains("more than 2^64"));
        assert!(refused([2; 3], 0, 8).contains("sample_type: 0"));
        assert!(refused([2; 3], 11, 8).contains("must be one of 1, 2"));
    }

    #[test]
    fn codes_are_all_different() {
        let codes: std::collections::BTreeSet<u32> = SAMPLE_TYPES.iter().map(|(_, code)| *code).collect();
        assert_eq!(codes.len(), SampleType::ALL.len());
        for kind in SampleType::ALL {
            assert!(SAMPLE_TYPES.iter().any(|(known, _)| *known == kind), "{kind:?}");
        }
    }
}
