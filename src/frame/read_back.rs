//! Converts texels that were read back to float32.

use ash::vk;
use bytemuck::Pod;

use crate::num;

/// Converts texels of a format that techniques accumulate in to float32 RGBA. Every other format is taken for 32-bit float.
pub(crate) fn pixels(bytes: &[u8], format: vk::Format) -> Vec<[f32; 4]> {
    match format {
        vk::Format::R8G8B8A8_UNORM => texels(bytes, |code: u8| f32::from(code) / 255.0),
        vk::Format::R16G16B16A16_UNORM => texels(bytes, |code: u16| f32::from(code) / 65535.0),
        vk::Format::R16G16B16A16_SFLOAT => texels(bytes, half_to_f32),
        _ => texels(bytes, |value: f32| value),
    }
}

fn texels<T: Pod>(bytes: &[u8], value: impl Fn(T) -> f32) -> Vec<[f32; 4]> {
    let texels = bytes.chunks_exact(size_of::<[T; 4]>());
    texels.map(|texel| bytemuck::pod_read_unaligned::<[T; 4]>(texel).map(&value)).collect()
}

/// Converts IEEE 754 binary16 to binary32, exactly.
fn half_to_f32(half: u16) -> f32 {
    let sign = if half & 0x8000 == 0 { 1.0 } else { -1.0 };
    let (exponent, fraction) = (i32::from(half >> 10 & 31), f64::from(half & 0x3ff));
    let magnitude = match exponent {
        0 => fraction * (-24.0_f64).exp2(),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1024.0 + fraction) * f64::from(exponent - 25).exp2(),
    };
    num::f32_of(sign * magnitude)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_read_exactly() {
        for (bits, value) in [
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x3555, 0.333_251_95),
            (0x0001, 5.960_464_5e-8),
            (0x7bff, 65504.0),
            (0x7c00, f32::INFINITY),
        ] {
            assert_eq!(half_to_f32(bits), value, "{bits:#x}");
        }
        assert!(half_to_f32(0x7e00).is_nan());
    }
}
