//! Reads one thing after the other from bytes: what the headers of binary files have in common.
//!
//! A [`Cursor`] fails with [`Error::Format`] where the bytes end, never panics, and asks for no memory that the bytes do not fill.

use std::path::Path;

use tyndall::{Error, Result};

use super::numbers::{Number, Order};

/// A place in the bytes of a file.
#[derive(Clone, Debug)]
pub(crate) struct Cursor<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    place: usize,
    /// In which order the bytes of numbers stand.
    pub(crate) order: Order,
    /// The way out that errors give.
    hint: &'static str,
    ended: bool,
}

impl<'a> Cursor<'a> {
    /// At byte `place` of a file; `hint` is what its errors advise.
    pub(crate) fn new(
        path: &'a Path,
        bytes: &'a [u8],
        place: usize,
        order: Order,
        hint: &'static str,
    ) -> Self {
        Self { path, bytes, place, order, hint, ended: false }
    }

    /// The file.
    pub(crate) fn path(&self) -> &'a Path {
        self.path
    }

    /// Where the next byte is, from the file's first.
    pub(crate) fn place(&self) -> usize {
        self.place
    }

    /// How many bytes are left.
    pub(crate) fn left(&self) -> usize {
        self.bytes.len().saturating_sub(self.place)
    }

    /// The next `count` bytes; `what` they are is said if they are not there.
    pub(crate) fn take(&mut self, count: usize, what: &str) -> Result<&'a [u8]> {
        let taken = self.place.checked_add(count).and_then(|end| self.bytes.get(self.place..end));
        let Some(taken) = taken else {
            self.ended = true;
            return Err(self.fault(format!("{what}: {count} bytes were wanted, {} are there", self.left())));
        };
        self.place += count;
        Ok(taken)
    }

    /// Passes over `count` bytes, as many as a file may claim.
    pub(crate) fn skip(&mut self, count: u64, what: &str) -> Result<()> {
        self.take(usize::try_from(count).unwrap_or(usize::MAX), what).map(drop)
    }

    /// Whether bytes were wanted that are not there: the content ends here.
    pub(crate) fn ended(&self) -> bool {
        self.ended
    }

    /// The next number.
    pub(crate) fn number<T: Number>(&mut self, what: &str) -> Result<T> {
        let bytes = self.take(T::SIZE, what)?;
        Ok(match self.order {
            Order::Little => T::from_bytes::<false>(bytes),
            Order::Big => T::from_bytes::<true>(bytes),
        })
    }

    /// A word of `count` bytes; what is not UTF-8 is replaced.
    pub(crate) fn text(&mut self, count: usize, what: &str) -> Result<String> {
        Ok(String::from_utf8_lossy(self.take(count, what)?).into_owned())
    }

    /// An [`Error::Format`] about this place.
    pub(crate) fn fault(&self, what: impl Into<String>) -> Error {
        Error::format(self.path, format!("byte {}", self.place), what, self.hint)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_follow_each_other_in_either_order() {
        let bytes = [1, 0, 0, 0, 2, 0xff, 0xfe, b'o', b'k'];
        let mut cursor = Cursor::new(Path::new("test"), &bytes, 0, Order::Little, "copy it again");
        assert_eq!(cursor.number::<u32>("a count").unwrap(), 1);
        assert_eq!((cursor.number::<u8>("a byte").unwrap(), cursor.place(), cursor.left()), (2, 5, 4));
        cursor.order = Order::Big;
        assert_eq!(
            (cursor.number::<u16>("a flag").unwrap(), cursor.text(2, "a word").unwrap()),
            (0xfffe, "ok".into())
        );
        let message = cursor.number::<f64>("a time").unwrap_err().to_string();
        assert!(
            message.contains("byte 9") && message.contains("a time: 8 bytes were wanted, 0 are there"),
            "{message}"
        );
        assert!(cursor.take(usize::MAX, "all").is_err() && cursor.ended());
        assert!(cursor.skip(u64::MAX, "more").is_err());
    }
}
