//! Half-precision numbers.

/// Converts a half-precision number (IEEE 754 binary16); the result is exact.
pub(crate) fn from_half(bits: u16) -> f32 {
    let fraction = f32::from(bits & 0x3ff);
    let size = match (bits >> 10) & 0x1f {
        0 => fraction / 16_777_216.0, // 2^-24
        31 if bits & 0x3ff == 0 => f32::INFINITY,
        31 => f32::NAN,
        exponent => (1024.0 + fraction) * f32::from_bits(u32::from(exponent + 102) << 23), // 2^(e - 25)
    };
    if bits & 0x8000 == 0 { size } else { -size }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_round_to_the_nearest() {
        use crate::num::half_of;
        for code in 0..0x7c00_u16 {
            for code in [code, code | 0x8000] {
                assert_eq!(half_of(from_half(code)), code);
            }
            // The middle of two goes to the even one.
            if code < 0x7bff {
                let middle = 0.5 * (from_half(code) + from_half(code + 1));
                assert_eq!(half_of(middle), code + code % 2, "{code:x}");
                assert_eq!(half_of(middle * 1.0001), code + 1);
            }
        }
        assert_eq!([f32::MAX, -7e4, f32::INFINITY].map(half_of), [0x7bff, 0xfbff, 0x7bff]);
    }

    #[test]
    fn halves_are_exact() {
        for (bits, value) in [
            (0x0000, 0.0),
            (0x0001, 5.960_464_5e-8),
            (0x03ff, 6.097_555e-5),
            (0x0400, 6.103_515_6e-5),
            (0x3555, 0.333_251_95),
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65504.0),
            (0xfc00, f32::NEG_INFINITY),
        ] {
            assert_eq!(from_half(bits).to_bits(), f32::to_bits(value), "{bits:#x}");
        }
        assert!(from_half(0x7e00).is_nan());
        assert!(from_half(0x8000).is_sign_negative());
    }
}
