//! Numbers of other bits than a machine's: types that say where in their bytes the bits of a number are, such as the floats of 16 to
//! 24 bits that SWIFT packs with the N-bit filter (FMantissa9, BFloat16, DMantissa13, …).
//!
//! Takes the message of a type and numbers as they are stored, gives numbers of a kind that holds them all.
//! Source: HDF5 File Format Specification 3.0, "Datatype Message"; io_compression.c of SWIFT for the types that are common.

use super::rows::Native;
use crate::read::numbers::Kind;

/// Where the bits of a number are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Form {
    Integer { at: u32, bits: u32, signed: bool },
    Float { sign: u32, exponent: Field, mantissa: Field, bias: i64, implied: bool, wide: bool },
}

/// Some bits, counted from the lowest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Field {
    at: u32,
    bits: u32,
}

impl Field {
    fn of(self, number: u64) -> u64 {
        number >> self.at & low(self.bits)
    }
}

/// The lowest `bits` bits, 1 to 64.
fn low(bits: u32) -> u64 {
    u64::MAX >> (64 - bits)
}

impl Form {
    /// The form that the message of a type tells; `None` for a machine's own, and for what is no number.
    pub(super) fn of(message: &[u8]) -> Option<Self> {
        let word = |at: usize| Some(u32::from_le_bytes(*message.get(at..)?.first_chunk()?));
        let (flags, room) = (word(0)? >> 8, word(4)?.checked_mul(8).filter(|room| *room <= 64)?);
        let (at, bits) = (word(8)? & 0xffff, word(8)? >> 16);
        let fits = |it: Field| it.bits > 0 && it.at + it.bits <= room;
        match message[0] & 0x0f {
            0 if fits(Field { at, bits }) && bits < room => {
                Some(Self::Integer { at, bits, signed: flags & 8 != 0 })
            }
            1 => {
                let [exponent_at, exponent_bits, mantissa_at, mantissa_bits] =
                    word(12)?.to_le_bytes().map(u32::from);
                let (exponent, mantissa) = (
                    Field { at: exponent_at, bits: exponent_bits },
                    Field { at: mantissa_at, bits: mantissa_bits },
                );
                let (sign, bias, implied) = (flags >> 8 & 0xff, word(16)?, flags >> 4 & 3 == 2);
                let fields = [sign, exponent_at, exponent_bits, mantissa_at, mantissa_bits, bias];
                let native = match room {
                    16 => [15, 10, 5, 0, 10, 15],
                    32 => [31, 23, 8, 0, 23, 127],
                    _ => [63, 52, 11, 0, 52, 1023],
                };
                let known = fits(exponent) && fits(mantissa) && sign < room && exponent.bits <= 15;
                let wide = exponent.bits > 8 || mantissa.bits > 23;
                let form = Self::Float { sign, exponent, mantissa, bias: bias.into(), implied, wide };
                (known && (fields != native || !implied)).then_some(form)
            }
            _ => None,
        }
    }

    /// The kind that holds all such numbers, which are stored as `stored`.
    pub(super) fn kind(self, stored: Kind) -> Kind {
        match self {
            Self::Integer { .. } => stored,
            Self::Float { wide: false, .. } => Kind::F32,
            Self::Float { wide: true, .. } => Kind::F64,
        }
    }

    /// Numbers that are stored in `size` bytes each, in this machine's order, as those of [`Form::kind`].
    pub(super) fn apply(self, bytes: &[u8], size: usize) -> Native {
        let numbers = bytes.chunks_exact(size).map(word);
        match self {
            Self::Integer { .. } => {
                let whole = |number: u64| {
                    if cfg!(target_endian = "big") { number << (64 - 8 * size) } else { number }
                };
                let bytes =
                    numbers.flat_map(|it| whole(self.integer(it)).to_ne_bytes().into_iter().take(size));
                Native::of(bytes.collect::<Vec<u8>>())
            }
            Self::Float { wide: true, .. } => {
                Native::of(numbers.map(|it| self.float(it)).collect::<Vec<f64>>())
            }
            Self::Float { .. } => Native::of(numbers.map(|it| self.float(it) as f32).collect::<Vec<f32>>()),
        }
    }

    fn integer(self, number: u64) -> u64 {
        let Self::Integer { at, bits, signed } = self else { return number };
        let value = Field { at, bits }.of(number);
        let gap = 64 - bits;
        if signed { ((value << gap) as i64 >> gap) as u64 } else { value }
    }

    fn float(self, number: u64) -> f64 {
        let Self::Float { sign, exponent, mantissa, bias, implied, .. } = self else { return number as f64 };
        let (power, digits) = (exponent.of(number), mantissa.of(number));
        let size = if power == low(exponent.bits) {
            if digits == 0 { f64::INFINITY } else { f64::NAN }
        } else {
            // Subnormal numbers lack the leading bit and have the least normal exponent.
            let leading = implied && power > 0;
            let digits = digits as f64 + if leading { f64::from(mantissa.bits).exp2() } else { 0.0 };
            let least = if implied { power.max(1) } else { power + 1 };
            digits * ((least as i64 - bias - i64::from(mantissa.bits)) as f64).exp2()
        };
        if number >> sign & 1 == 1 { -size } else { size }
    }
}

/// A number of up to eight bytes in this machine's order.
fn word(bytes: &[u8]) -> u64 {
    let mut word = [0; 8];
    let start = if cfg!(target_endian = "big") { 8 - bytes.len() } else { 0 };
    word[start..start + bytes.len()].copy_from_slice(bytes);
    u64::from_ne_bytes(word)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The message of a float: bytes, sign, exponent, mantissa, bias.
    fn message(size: u32, sign: u8, [at, bits]: [u8; 2], [low, digits]: [u8; 2], bias: u32) -> Vec<u8> {
        let head = [0x11, 0x20, sign, 0];
        let fields = [0, 0, sign + 1, 0, at, bits, low, digits];
        [&head[..], &size.to_le_bytes(), &fields, &bias.to_le_bytes()].concat()
    }

    #[test]
    fn machine_numbers_have_no_form() {
        assert_eq!(Form::of(&message(2, 15, [10, 5], [0, 10], 15)), None);
        assert_eq!(Form::of(&message(4, 31, [23, 8], [0, 23], 127)), None);
        assert_eq!(Form::of(&message(8, 63, [52, 11], [0, 52], 1023)), None);
        assert_eq!(Form::of(&[0x10, 8, 0, 0, 4, 0, 0, 0, 0, 0, 32, 0]), None);
        for message in [
            &b""[..],
            &[0x11; 9],
            &message(4, 31, [31, 8], [0, 23], 127),
            &message(4, 40, [23, 8], [0, 23], 127),
        ] {
            assert_eq!(Form::of(message), None);
        }
    }

    #[test]
    fn short_floats_are_long_ones_without_their_last_bits() {
        let form = Form::of(&message(2, 15, [7, 8], [0, 7], 127)).unwrap();
        assert_eq!(form.kind(Kind::F16), Kind::F32);
        for bits in 0..=u16::MAX {
            let wanted = f32::from_bits(u32::from(bits) << 16);
            let found = f32::from_ne_bytes(*form.apply(&bits.to_ne_bytes(), 2).first_chunk().unwrap());
            assert!(
                found.to_bits() == wanted.to_bits() || found.is_nan() && wanted.is_nan(),
                "{bits:#x}: {found}"
            );
        }
        // The exponent of a double, in four bytes.
        let form = Form::of(&message(4, 20, [9, 11], [0, 9], 1023)).unwrap();
        assert_eq!(form.kind(Kind::F32), Kind::F64);
        for wanted in [1.5, -0.625, 1e300f64, 3e-310] {
            let bits = (wanted.to_bits() >> 43) as u32;
            let found = f64::from_ne_bytes(*form.apply(&bits.to_ne_bytes(), 4).first_chunk().unwrap());
            assert_eq!(found, f64::from_bits(wanted.to_bits() >> 43 << 43));
        }
    }

    #[test]
    fn whole_numbers_within_their_bytes_keep_their_sign() {
        // Twelve bits from the third on.
        let signed = Form::of(&[0x10, 8, 0, 0, 4, 0, 0, 0, 3, 0, 12, 0]).unwrap();
        let unsigned = Form::of(&[0x10, 0, 0, 0, 4, 0, 0, 0, 3, 0, 12, 0]).unwrap();
        let number = |form: Form, value: i32| {
            let bytes = ((value & 0xfff) << 3).to_ne_bytes();
            i32::from_ne_bytes(*form.apply(&bytes, 4).first_chunk().unwrap())
        };
        assert_eq!([-2048, -1, 0, 2047].map(|it| number(signed, it)), [-2048, -1, 0, 2047]);
        assert_eq!(number(unsigned, 4095), 4095);
    }
}
