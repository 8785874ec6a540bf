//! MessagePack: values that borrow from the bytes.
//!
//! Invariant: nothing is made that the bytes do not fill, and nothing is nested deeper than [`DEEPEST`]. Source: msgpack.org, specification.

/// Nothing that is read here is nested deeper.
const DEEPEST: usize = 32;

/// A value.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value<'a> {
    Nil,
    Bool(bool),
    Integer(i64),
    Float(f64),
    Text(&'a str),
    Bytes(&'a [u8]),
    List(Vec<Value<'a>>),
    Map(Vec<(Value<'a>, Value<'a>)>),
}

impl<'a> Value<'a> {
    /// The value of a map under this name.
    pub(super) fn get(&self, name: &str) -> Option<&Value<'a>> {
        match self {
            Self::Map(entries) => {
                entries.iter().find(|(key, _)| *key == Value::Text(name)).map(|(_, value)| value)
            }
            _ => None,
        }
    }

    pub(super) fn list(&self) -> Option<&[Value<'a>]> {
        if let Self::List(list) = self { Some(list) } else { None }
    }

    pub(super) fn text(&self) -> Option<&'a str> {
        if let Self::Text(text) = self { Some(text) } else { None }
    }

    pub(super) fn bytes(&self) -> Option<&'a [u8]> {
        if let Self::Bytes(bytes) = self { Some(bytes) } else { None }
    }

    /// A number that is not negative.
    pub(super) fn count(&self) -> Option<usize> {
        match *self {
            Self::Integer(number) => usize::try_from(number).ok(),
            // Some writers have floats where whole numbers would do.
            Self::Float(number) if number >= 0.0 && number.fract() == 0.0 && number < 1e15 => {
                Some(number as usize)
            }
            _ => None,
        }
    }

    pub(super) fn number(&self) -> Option<f64> {
        match *self {
            Self::Integer(number) => Some(number as f64),
            Self::Float(number) => Some(number),
            _ => None,
        }
    }
}

/// Reads the first value of `bytes`; on failure says at which byte.
pub(super) fn read(bytes: &[u8]) -> Result<Value<'_>, usize> {
    let mut reader = Reader { bytes, place: 0 };
    reader.value(0).ok_or(reader.place)
}

struct Reader<'a> {
    bytes: &'a [u8],
    place: usize,
}

impl<'a> Reader<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let taken = self.bytes.get(self.place..self.place.checked_add(count)?)?;
        self.place += count;
        Some(taken)
    }

    /// An unsigned number of so many bytes.
    fn unsigned(&mut self, count: usize) -> Option<u64> {
        Some(self.take(count)?.iter().fold(0, |number, &byte| number << 8 | u64::from(byte)))
    }

    /// A signed one.
    fn signed(&mut self, count: usize) -> Option<i64> {
        let shift = 64 - 8 * count as u32;
        Some(((self.unsigned(count)? << shift) as i64) >> shift)
    }

    fn text(&mut self, count: usize) -> Option<Value<'a>> {
        std::str::from_utf8(self.take(count)?).ok().map(Value::Text)
    }

    fn list(&mut self, count: usize, depth: usize) -> Option<Value<'a>> {
        // An entry has a byte at least.
        if count > self.bytes.len() - self.place {
            return None;
        }
        (0..count).map(|_| self.value(depth + 1)).collect::<Option<_>>().map(Value::List)
    }

    fn map(&mut self, count: usize, depth: usize) -> Option<Value<'a>> {
        if count > (self.bytes.len() - self.place) / 2 {
            return None;
        }
        let entry = |reader: &mut Self| Some((reader.value(depth + 1)?, reader.value(depth + 1)?));
        (0..count).map(|_| entry(self)).collect::<Option<_>>().map(Value::Map)
    }

    fn value(&mut self, depth: usize) -> Option<Value<'a>> {
        if depth > DEEPEST {
            return None;
        }
        let code = self.unsigned(1)? as u8;
        Some(match code {
            0x00..=0x7f => Value::Integer(code.into()),
            0x80..=0x8f => self.map(usize::from(code & 15), depth)?,
            0x90..=0x9f => self.list(usize::from(code & 15), depth)?,
            0xa0..=0xbf => self.text(usize::from(code & 31))?,
            0xc0 => Value::Nil,
            0xc2 | 0xc3 => Value::Bool(code == 0xc3),
            0xc4..=0xc6 => {
                let count = self.unsigned(1 << (code - 0xc4))?;
                Value::Bytes(self.take(count as usize)?)
            }
            0xca => Value::Float(f32::from_bits(self.unsigned(4)? as u32).into()),
            0xcb => Value::Float(f64::from_bits(self.unsigned(8)?)),
            0xcc..=0xcf => {
                let number = self.unsigned(1 << (code - 0xcc))?;
                i64::try_from(number).map_or(Value::Float(number as f64), Value::Integer)
            }
            0xd0..=0xd3 => Value::Integer(self.signed(1 << (code - 0xd0))?),
            0xd9..=0xdb => {
                let count = self.unsigned(1 << (code - 0xd9))?;
                self.text(count as usize)?
            }
            0xdc | 0xdd => {
                let count = self.unsigned(2 << (code - 0xdc))?;
                self.list(count as usize, depth)?
            }
            0xde | 0xdf => {
                let count = self.unsigned(2 << (code - 0xde))?;
                self.map(count as usize, depth)?
            }
            0xe0..=0xff => Value::Integer(i64::from(code as i8)),
            // Extensions (0xc7 to 0xc9, 0xd4 to 0xd8) and what is not defined.
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_kinds_of_values_are_read() {
        let cases: [(&[u8], Value); 17] = [
            (&[7], Value::Integer(7)),
            (&[0xff], Value::Integer(-1)),
            (&[0xc0], Value::Nil),
            (&[0xc3], Value::Bool(true)),
            (&[0xcd, 1, 2], Value::Integer(258)),
            (&[0xcf, 255, 255, 255, 255, 255, 255, 255, 255], Value::Float(u64::MAX as f64)),
            (&[0xd0, 0xff], Value::Integer(-1)),
            (&[0xd1, 0x80, 0], Value::Integer(-32768)),
            (&[0xd3, 255, 255, 255, 255, 255, 255, 255, 254], Value::Integer(-2)),
            (&[0xca, 0x3f, 0x80, 0, 0], Value::Float(1.0)),
            (&[0xcb, 0x40, 0, 0, 0, 0, 0, 0, 0], Value::Float(2.0)),
            (&[0xa2, b'o', b'k'], Value::Text("ok")),
            (&[0xd9, 1, b'x'], Value::Text("x")),
            (&[0xc4, 2, 1, 2], Value::Bytes(&[1, 2])),
            (&[0x92, 1, 2], Value::List(vec![Value::Integer(1), Value::Integer(2)])),
            (&[0xdc, 0, 1, 0xc2], Value::List(vec![Value::Bool(false)])),
            (&[0xde, 0, 1, 0xa1, b'a', 5], Value::Map(vec![(Value::Text("a"), Value::Integer(5))])),
        ];
        for (bytes, wanted) in cases {
            assert_eq!(read(bytes), Ok(wanted), "{bytes:?}");
            for length in 0..bytes.len() {
                assert!(read(&bytes[..length]).is_err(), "{bytes:?} cut to {length}");
            }
        }
    }

    #[test]
    fn hostile_counts_and_depths_are_refused() {
        assert!(read(&[0xdd, 255, 255, 255, 255, 0]).is_err());
        assert!(read(&[0xdf, 255, 255, 255, 255, 0]).is_err());
        assert!(read(&[0xc6, 255, 255, 255, 255, 0]).is_err());
        assert!(read(&[0x91; 100_000]).is_err());
        assert!(read(&[0xd4, 0, 0]).is_err() && read(&[0xa1, 0xff]).is_err());
    }
}
