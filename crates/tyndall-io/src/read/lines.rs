//! The lines of a text one by one, for formats whose lines mean different things.

/// Lines of a text, from a place on.
#[derive(Clone)]
pub(crate) struct Lines<'a> {
    text: &'a [u8],
    /// Where the next line begins, and its number.
    pub(crate) place: usize,
    pub(crate) number: u64,
}

impl<'a> Lines<'a> {
    /// From byte `place` on, where the line with that number begins.
    pub(crate) fn new(text: &'a [u8], place: usize, number: u64) -> Self {
        Self { text, place, number }
    }

    /// What is not passed yet.
    pub(crate) fn rest(&self) -> &'a [u8] {
        self.text.get(self.place..).unwrap_or_default()
    }

    /// Passes over `count` lines; gives them, or `None` if there are fewer.
    pub(crate) fn block(&mut self, count: u64) -> Option<&'a [u8]> {
        let rest = self.rest();
        let end = match count {
            0 => 0,
            _ => {
                let last = memchr::memchr_iter(b'\n', rest).nth(usize::try_from(count - 1).ok()?);
                match last {
                    Some(end) => end + 1,
                    None => {
                        let lines = memchr::memchr_iter(b'\n', rest).count() as u64;
                        let open = u64::from(!rest.is_empty() && !rest.ends_with(b"\n"));
                        (lines + open == count).then_some(rest.len())?
                    }
                }
            }
        };
        (self.place, self.number) = (self.place + end, self.number + count);
        Some(&rest[..end])
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        (!self.rest().is_empty()).then(|| self.block(1)).flatten().map(<[u8]>::trim_ascii)
    }
}
