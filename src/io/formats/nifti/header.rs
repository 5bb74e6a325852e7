//! The header of 348 bytes, in either byte order.

use crate::error::Result;
use crate::io::file::sample_type::Endian;
use crate::io::file::source::Source;

/// Size of the header, in bytes.
pub(crate) const HEADER: usize = 348;

/// The magic of a file that holds header and samples.
pub(crate) const SINGLE: [u8; 4] = *b"n+1\0";

/// The magic of a header whose samples lie in a file of their own.
pub(crate) const PAIR: [u8; 4] = *b"ni1\0";

/// The fields of the header that place, scale and decode samples, named as in the format's description.
#[derive(Debug)]
pub(crate) struct Header {
    pub(crate) dim: [i16; 8],
    pub(crate) datatype: i16,
    pub(crate) bitpix: i16,
    pub(crate) pixdim: [f32; 8],
    pub(crate) vox_offset: f32,
    pub(crate) scl_slope: f32,
    pub(crate) scl_inter: f32,
    pub(crate) xyzt_units: u8,
    pub(crate) qform_code: i16,
    pub(crate) sform_code: i16,
    /// `quatern_b`, `quatern_c` and `quatern_d`, as 64-bit floats like the following ones.
    pub(crate) quatern: [f64; 3],
    /// `qoffset_x`, `qoffset_y` and `qoffset_z`.
    pub(crate) qoffset: [f64; 3],
    /// `srow_x`, `srow_y` and `srow_z`.
    pub(crate) srow: [[f64; 4]; 3],
    /// Whether the samples follow the header.
    pub(crate) single: bool,
}

impl Header {
    /// Parses the first bytes of a file, and returns the header with its byte order.
    ///
    /// # Errors
    ///
    /// If the file is too short, the size field is not 348 in either byte order, the magic is not NIfTI-1's, or the
    /// rank is not 1 to 7.
    pub(crate) fn parse(source: &Source) -> Result<(Self, Endian)> {
        let bytes = source.head().first_chunk::<HEADER>().ok_or_else(|| {
            source.error("header", format!("needs {HEADER} bytes, {} are there", source.head().len()))
        })?;
        let size = array(bytes, 0);
        let endian = match (i32::from_le_bytes(size), i32::from_be_bytes(size)) {
            (348, _) => Endian::Little,
            (_, 348) => Endian::Big,
            (540, _) | (_, 540) => {
                return Err(source.error("sizeof_hdr", "540: NIfTI-2 is not supported, NIfTI-1 has 348"));
            }
            (size, _) => return Err(source.error("sizeof_hdr", format!("{size}: must be 348"))),
        };
        let magic: [u8; 4] = array(bytes, 344);
        if magic != SINGLE && magic != PAIR {
            let shown = magic.escape_ascii();
            let rule = format!("\"{shown}\": must be \"n+1\" or \"ni1\"; Analyze 7.5 is not supported");
            return Err(source.error("magic (byte 344)", rule));
        }
        let header = Self::decode(bytes, endian, magic == SINGLE);
        let rank = header.dim[0];
        if !(1..=7).contains(&rank) {
            return Err(source.error("dim[0]", format!("{rank}: must be 1 to 7")));
        }
        Ok((header, endian))
    }

    /// Reads the fields at their offsets.
    fn decode(bytes: &[u8; HEADER], endian: Endian, single: bool) -> Self {
        let short = |at: usize| i16::from_le_bytes(endian.to_little(array(bytes, at)));
        let float = |at: usize| f32::from_le_bytes(endian.to_little(array(bytes, at)));
        let three = |at: usize| [at, at + 4, at + 8].map(|at| f64::from(float(at)));
        let row = |at: usize| [at, at + 4, at + 8, at + 12].map(|at| f64::from(float(at)));
        Self {
            dim: [0, 1, 2, 3, 4, 5, 6, 7].map(|axis| short(40 + 2 * axis)),
            datatype: short(70),
            bitpix: short(72),
            pixdim: [0, 1, 2, 3, 4, 5, 6, 7].map(|axis| float(76 + 4 * axis)),
            vox_offset: float(108),
            scl_slope: float(112),
            scl_inter: float(116),
            xyzt_units: bytes[123],
            qform_code: short(252),
            sform_code: short(254),
            quatern: three(256),
            qoffset: three(268),
            srow: [280, 296, 312].map(row),
            single,
        }
    }
}

/// `N` bytes of the header from an offset, which all fit.
fn array<const N: usize>(bytes: &[u8; HEADER], at: usize) -> [u8; N] {
    bytes.get(at..).and_then(<[u8]>::first_chunk).copied().unwrap_or([0; N])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_at_their_offsets_in_both_byte_orders() {
        let header = |endian: Endian| {
            let mut bytes = vec![0_u8; HEADER];
            let mut put = |at: usize, little: &[u8]| {
                let mut own = little.to_vec();
                if endian == Endian::Big {
                    own.reverse();
                }
                bytes[at..at + own.len()].copy_from_slice(&own);
            };
            put(0, &348_i32.to_le_bytes());
            for (at, value) in [(40, 3_i16), (46, -5), (70, 16), (72, 32), (252, 1), (254, 2)] {
                put(at, &value.to_le_bytes());
            }
            for (at, value) in [
                (76, -1_f32),
                (88, 0.5),
                (108, 352.0),
                (112, 2.0),
                (116, 3.0),
                (264, 4.0),
                (276, 6.0),
                (324, 7.0),
            ] {
                put(at, &value.to_le_bytes());
            }
            bytes[344..].copy_from_slice(&SINGLE);
            Header::parse(&Source::in_memory(&[("a.nii", &bytes)]).unwrap()).unwrap()
        };
        for wanted in [Endian::Little, Endian::Big] {
            let (header, endian) = header(wanted);
            assert_eq!(endian, wanted);
            assert_eq!((header.dim[0], header.dim[3], header.datatype, header.bitpix), (3, -5, 16, 32));
            assert_eq!((header.qform_code, header.sform_code, header.single), (1, 2, true));
            assert_eq!((header.pixdim[0], header.pixdim[3], header.vox_offset), (-1.0, 0.5, 352.0));
            assert_eq!((header.scl_slope, header.scl_inter), (2.0, 3.0));
            assert_eq!((header.quatern[2], header.qoffset[2], header.srow[2][3]), (4.0, 6.0, 7.0));
        }
    }
}
