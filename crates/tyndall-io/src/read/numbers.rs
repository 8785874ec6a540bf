//! The types of numbers in binary files, and how they are read from their bytes.

use tyndall::particles::Values;

/// In which order the bytes of a number stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Order {
    Little,
    Big,
}

/// The type of a number in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F16,
    F32,
    F64,
}

impl Kind {
    /// Its size in bytes.
    pub(crate) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 | Self::F16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// Whether there are values between whole numbers.
    pub(crate) fn is_float(self) -> bool {
        matches!(self, Self::F16 | Self::F32 | Self::F64)
    }

    /// `count` zeros of the narrowest column that holds every value of this kind; for `U64` those below 2^63.
    pub(crate) fn zeros(self, count: usize) -> Values {
        match self {
            Self::U8 => Values::U8(vec![0; count]),
            Self::I8 | Self::I16 | Self::U16 | Self::I32 => Values::I32(vec![0; count]),
            Self::U32 | Self::I64 | Self::U64 => Values::I64(vec![0; count]),
            Self::F16 | Self::F32 => Values::F32(vec![0.0; count]),
            Self::F64 => Values::F64(vec![0.0; count]),
        }
    }
}

/// A number that can be read from its bytes.
pub(crate) trait Number: Copy {
    const SIZE: usize;
    fn from_bytes<const BIG: bool>(bytes: &[u8]) -> Self;
}

macro_rules! numbers {
    ($($type:ty),*) => {$(
        impl Number for $type {
            const SIZE: usize = size_of::<$type>();
            #[inline(always)]
            fn from_bytes<const BIG: bool>(bytes: &[u8]) -> Self {
                let bytes = bytes.try_into().expect("the caller cuts SIZE bytes");
                if BIG { Self::from_be_bytes(bytes) } else { Self::from_le_bytes(bytes) }
            }
        }
    )*};
}
numbers!(i8, u8, i16, u16, i32, u32, i64, u64, f32, f64);

/// A 16-bit float, widened.
#[derive(Clone, Copy)]
pub(super) struct Half(pub(super) f32);

impl Number for Half {
    const SIZE: usize = 2;
    fn from_bytes<const BIG: bool>(bytes: &[u8]) -> Self {
        Self(widen_half(u16::from_bytes::<BIG>(bytes)))
    }
}

/// The value of an IEEE 754 binary16, exactly.
fn widen_half(bits: u16) -> f32 {
    let (exponent, fraction) = (u32::from(bits >> 10 & 31), u32::from(bits & 1023));
    let magnitude = match exponent {
        0 => fraction as f32 / (1 << 24) as f32,
        31 => f32::from_bits(0xff << 23 | fraction << 13),
        _ => f32::from_bits((exponent + 112) << 23 | fraction << 13),
    };
    if bits >> 15 == 1 { -magnitude } else { magnitude }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_floats_are_widened_exactly() {
        let cases = [
            (0x0000, 0.0),
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65504.0),
            (0x0001, 2f32.powi(-24)),
            (0x03ff, 1023.0 * 2f32.powi(-24)),
            (0x0400, 2f32.powi(-14)),
            (0x3555, 0.333_251_95),
            (0xfc00, f32::NEG_INFINITY),
        ];
        for (bits, value) in cases {
            assert_eq!(widen_half(bits), value, "{bits:#06x}");
        }
        assert!(widen_half(0x7e00).is_nan());
    }
}
