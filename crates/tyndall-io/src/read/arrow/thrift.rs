//! Thrift's compact protocol, as far as Parquet's headers need it: walked over, with a function that takes the fields it wants.
//!
//! Invariant: nothing is read beyond the bytes, no list is longer than they are, and nothing is nested deeper than [`DEEPEST`]. Source:
//! Apache Thrift, "Thrift compact protocol encoding".

/// Nothing in a header is nested deeper.
const DEEPEST: usize = 16;
/// Groups of columns in groups of columns; more are a mistake, or an attack.
const DEEPEST_SCHEMA: usize = 64;

/// What a field has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    True,
    False,
    Integer,
    Struct,
    List,
    Other(u8),
}

/// Bytes, and where the next value stands.
pub(super) struct Reader<'a> {
    bytes: &'a [u8],
    pub(super) place: usize,
}

impl<'a> Reader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, place: 0 }
    }

    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let taken = self.bytes.get(self.place..self.place.checked_add(count)?)?;
        self.place += count;
        Some(taken)
    }

    fn byte(&mut self) -> Option<u8> {
        Some(self.take(1)?[0])
    }

    fn unsigned(&mut self) -> Option<u64> {
        let mut number = 0u64;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            number |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(number);
            }
        }
        None
    }

    /// A whole number.
    pub(super) fn integer(&mut self) -> Option<i64> {
        let number = self.unsigned()?;
        Some((number >> 1) as i64 ^ -((number & 1) as i64))
    }

    /// The fields of a struct. `visit` is given number and kind, and says whether it has taken the value; what it has not is passed over.
    pub(super) fn fields(
        &mut self,
        mut visit: impl FnMut(&mut Self, i64, Kind) -> Option<bool>,
    ) -> Option<()> {
        self.fields_within(0, &mut visit)
    }

    fn fields_within(
        &mut self,
        depth: usize,
        visit: &mut dyn FnMut(&mut Self, i64, Kind) -> Option<bool>,
    ) -> Option<()> {
        let mut number = 0i64;
        loop {
            let head = self.byte()?;
            if head == 0 {
                return Some(());
            }
            number = match head >> 4 {
                0 => self.integer()?,
                step => number.checked_add(step.into())?,
            };
            let kind = kind(head & 15);
            if !visit(self, number, kind)? {
                self.skip(kind, depth + 1)?;
            }
        }
    }

    /// The number and kind of the elements of a list.
    pub(super) fn list(&mut self) -> Option<(usize, Kind)> {
        let head = self.byte()?;
        let count = match head >> 4 {
            15 => usize::try_from(self.unsigned()?).ok()?,
            count => count.into(),
        };
        // An element has a byte at least.
        (count <= self.bytes.len() - self.place).then_some((count, kind(head & 15)))
    }

    fn skip(&mut self, kind: Kind, depth: usize) -> Option<()> {
        if depth > DEEPEST {
            return None;
        }
        match kind {
            Kind::True | Kind::False => {}
            Kind::Integer => drop(self.unsigned()?),
            Kind::Struct => self.fields_within(depth, &mut |_, _, _| Some(false))?,
            Kind::List => {
                let (count, kind) = self.list()?;
                for _ in 0..count {
                    match kind {
                        Kind::True | Kind::False => drop(self.byte()?),
                        kind => self.skip(kind, depth + 1)?,
                    }
                }
            }
            Kind::Other(3) => drop(self.byte()?),
            Kind::Other(7) => drop(self.take(8)?),
            Kind::Other(8) => {
                let count = usize::try_from(self.unsigned()?).ok()?;
                self.take(count)?;
            }
            // Maps, and what is not defined, are in no header of Parquet.
            Kind::Other(_) => return None,
        }
        Some(())
    }
}

fn kind(code: u8) -> Kind {
    match code {
        1 => Kind::True,
        2 => Kind::False,
        4..=6 => Kind::Integer,
        9 | 10 => Kind::List,
        12 => Kind::Struct,
        code => Kind::Other(code),
    }
}

/// Whether the schema in a file's metadata nests groups no deeper than one may follow them.
pub(super) fn is_shallow(metadata: &[u8]) -> bool {
    let mut children: Vec<i64> = Vec::new();
    let read = Reader::new(metadata).fields(|reader, number, kind| {
        if (number, kind) != (2, Kind::List) {
            return Some(false);
        }
        let (count, _) = reader.list()?;
        for _ in 0..count {
            let mut mine = 0;
            reader.fields(|reader, number, kind| {
                let is_count = (number, kind) == (5, Kind::Integer);
                if is_count {
                    mine = reader.integer()?;
                }
                Some(is_count)
            })?;
            children.push(mine);
        }
        Some(true)
    });
    let mut open: Vec<i64> = Vec::new();
    for count in children {
        while open.last() == Some(&0) {
            open.pop();
        }
        if let Some(left) = open.last_mut() {
            *left -= 1;
        }
        if count > 0 {
            open.push(count);
        }
        if open.len() > DEEPEST_SCHEMA {
            return false;
        }
    }
    read.is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_visited_or_passed_over() {
        // 1: i32 -3; 2: list of two structs; 4: true; 20 (long form): binary "ab"; 21: double.
        let mut bytes = vec![0x15, 5, 0x19, 0x2c, 0x15, 2, 0, 0, 0x21, 0x08, 40, 2, b'a', b'b', 0x17];
        bytes.extend([0; 8]);
        bytes.push(0);
        let mut seen = Vec::new();
        let mut reader = Reader::new(&bytes);
        reader
            .fields(|reader, number, kind| {
                let value = if kind == Kind::Integer { reader.integer()? } else { 0 };
                seen.push((number, value));
                Some(kind == Kind::Integer)
            })
            .unwrap();
        assert_eq!((seen, reader.place), (vec![(1, -3), (2, 0), (4, 0), (20, 0), (21, 0)], bytes.len()));
        for length in 0..bytes.len() {
            assert!(Reader::new(&bytes[..length]).fields(|_, _, _| Some(false)).is_none(), "{length}");
        }
    }

    #[test]
    fn hostile_counts_and_depths_are_refused() {
        assert!(Reader::new(&[0x19, 0xfc, 0xff, 0xff, 0x7f, 0, 0]).fields(|_, _, _| Some(false)).is_none());
        assert!(Reader::new(&[0x1c; 10_000]).fields(|_, _, _| Some(false)).is_none());
        // A group of a group of a group …, each of one.
        let group = [0x55, 2, 0];
        let nested = |count: u8| [&[0x29, 0xfc, count][..], &group.repeat(count.into()), &[0]].concat();
        assert!(is_shallow(&nested(20)) && !is_shallow(&nested(100)));
    }
}
