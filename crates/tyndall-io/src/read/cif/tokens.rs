//! The tokens of CIF, and what they make: items with a value, and loops.
//!
//! Values are separated by blanks; those in quotes end where a quote is followed by a blank, and those that begin with a semicolon at a line's
//! start go to the next such line. A hash begins a comment. Source: IUCr, CIF 1.1 syntax.

/// A value, or what it may be taken for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Token<'a> {
    pub(super) text: &'a [u8],
    /// Whether it stood in quotes or between semicolons: it is no keyword then, nor a sign for a missing value.
    pub(super) is_quoted: bool,
    /// Where it begins.
    pub(super) place: usize,
    /// The number of that line, counted from 1.
    pub(super) line: u64,
}

impl<'a> Token<'a> {
    /// The value, unless it is one of the signs for a missing one.
    pub(super) fn told(&self) -> Option<&'a [u8]> {
        (self.is_quoted || !matches!(self.text, b"." | b"?")).then_some(self.text)
    }

    fn is_keyword(&self) -> bool {
        let begins =
            |word: &[u8]| self.text.len() >= word.len() && self.text[..word.len()].eq_ignore_ascii_case(word);
        !self.is_quoted
            && (begins(b"data_")
                || begins(b"save_")
                || self.is_loop()
                || begins(b"global_")
                || begins(b"stop_"))
    }

    fn is_loop(&self) -> bool {
        !self.is_quoted && self.text.eq_ignore_ascii_case(b"loop_")
    }

    fn is_name(&self) -> bool {
        !self.is_quoted && self.text.starts_with(b"_")
    }
}

/// What follows in a file.
#[derive(Debug)]
pub(super) enum Event<'a> {
    /// A name and its value.
    Item(String, Token<'a>),
    /// The names of a loop. Its values follow: see [`Tokens::row`]. Those that are not taken are passed over.
    Loop(Vec<String>),
}

/// The tokens from a place on.
#[derive(Clone, Debug)]
pub(super) struct Tokens<'a> {
    bytes: &'a [u8],
    place: usize,
    line: u64,
    /// A token that was looked at.
    ahead: Option<Token<'a>>,
}

impl<'a> Tokens<'a> {
    pub(super) fn new(bytes: &'a [u8], place: usize, line: u64) -> Self {
        Self { bytes, place, line, ahead: None }
    }

    /// The next token without taking it.
    fn peek(&mut self) -> Option<Token<'a>> {
        if self.ahead.is_none() {
            self.ahead = self.read();
        }
        self.ahead
    }

    fn take(&mut self) -> Option<Token<'a>> {
        self.peek();
        self.ahead.take()
    }

    fn read(&mut self) -> Option<Token<'a>> {
        // Blanks and comments.
        loop {
            match *self.bytes.get(self.place)? {
                b'\n' => {
                    self.line += 1;
                    self.place += 1;
                }
                b' ' | b'\t' | b'\r' => self.place += 1,
                b'#' => self.place = self.line_end(self.place),
                _ => break,
            }
        }
        let (place, line) = (self.place, self.line);
        let first = self.bytes[place];
        let starts_line = place == 0 || self.bytes[place - 1] == b'\n';
        let (text, is_quoted) = match first {
            b';' if starts_line => (self.semicolons(), true),
            b'\'' | b'"' => (self.quoted(first), true),
            _ => {
                let rest = &self.bytes[place..];
                let end = rest
                    .iter()
                    .position(|it| matches!(it, b' ' | b'\t' | b'\n' | b'\r'))
                    .unwrap_or(rest.len());
                self.place += end;
                (&rest[..end], false)
            }
        };
        Some(Token { text, is_quoted, place, line })
    }

    fn line_end(&self, from: usize) -> usize {
        memchr::memchr(b'\n', &self.bytes[from..]).map_or(self.bytes.len(), |end| from + end)
    }

    /// The text up to the quote that a blank follows, or to the line's end.
    fn quoted(&mut self, quote: u8) -> &'a [u8] {
        let start = self.place + 1;
        let end = self.line_end(start);
        let line = &self.bytes[start..end];
        let ends = |at: &usize| line.get(at + 1).is_none_or(|it| matches!(it, b' ' | b'\t' | b'\r'));
        let closing = memchr::memchr_iter(quote, line).find(ends);
        self.place = closing.map_or(end, |at| start + at + 1);
        &line[..closing.unwrap_or(line.len())]
    }

    /// The text up to the next line that begins with a semicolon.
    fn semicolons(&mut self) -> &'a [u8] {
        let start = self.place + 1;
        let found = memchr::memmem::find(&self.bytes[start..], b"\n;");
        let end = found.map_or(self.bytes.len(), |at| start + at);
        let text = &self.bytes[start..end];
        self.line += memchr::memchr_iter(b'\n', text).count() as u64 + u64::from(found.is_some());
        self.place = if found.is_some() { end + 2 } else { end };
        text.strip_suffix(b"\r").unwrap_or(text)
    }

    /// The next item or loop.
    pub(super) fn next_event(&mut self) -> Option<Event<'a>> {
        loop {
            let token = self.take()?;
            let name = |token: &Token| String::from_utf8_lossy(token.text).into_owned();
            if token.is_loop() {
                let mut names = Vec::new();
                while let Some(it) = self.peek().filter(Token::is_name) {
                    names.push(name(&it));
                    self.take();
                }
                if !names.is_empty() {
                    return Some(Event::Loop(names));
                }
            } else if token.is_name()
                && let Some(value) = self.value()
            {
                return Some(Event::Item(name(&token), value));
            }
        }
    }

    /// The next value, if one follows.
    fn value(&mut self) -> Option<Token<'a>> {
        self.peek().filter(|it| !it.is_keyword() && !it.is_name())?;
        self.take()
    }

    /// The next row of a loop of `count` columns, in place of what `row` had. Says how many values there were: fewer at the loop's end.
    pub(super) fn row(&mut self, count: usize, row: &mut Vec<Token<'a>>) -> usize {
        row.clear();
        while row.len() < count
            && let Some(value) = self.value()
        {
            row.push(value);
        }
        row.len()
    }

    /// Whether nothing but comments follows.
    pub(super) fn at_end(&mut self) -> bool {
        self.peek().is_none()
    }

    /// Where the next token begins, or the bytes end.
    pub(super) fn place(&mut self) -> usize {
        self.peek().map_or(self.bytes.len(), |it| it.place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> Vec<(String, bool, u64)> {
        let mut tokens = Tokens::new(text.as_bytes(), 0, 1);
        std::iter::from_fn(|| tokens.take())
            .map(|it| (String::from_utf8_lossy(it.text).into_owned(), it.is_quoted, it.line))
            .collect()
    }

    #[test]
    fn quotes_comments_and_long_texts_are_told_apart() {
        let text = "data_x # a comment\n 'it''s a' \"b\"c\" d#e 'O5'' ?\r\n;long\n text;\n;'?'\n\"open\nlast";
        let wanted = [
            ("data_x", false, 1),
            ("it''s a", true, 2),
            ("b\"c", true, 2),
            ("d#e", false, 2),
            ("O5'", true, 2),
            ("?", false, 2),
            ("long\n text;", true, 3),
            ("?", true, 5),
            ("open", true, 6),
            ("last", false, 7),
        ];
        let wanted: Vec<_> =
            wanted.iter().map(|(text, quoted, line)| (text.to_string(), *quoted, *line)).collect();
        assert_eq!(words(text), wanted);
        for text in ["", " \n", ";", ";\n", "'", "\"", "#", "loop_", "_a"] {
            words(text);
        }
    }

    #[test]
    fn loops_end_where_a_name_or_keyword_follows() {
        let text = b"data_a _one 1 loop_ _x.a _x.b 1 'loop_' 3 '_c' LOOP_ _y 5 _z ?";
        let mut tokens = Tokens::new(text, 0, 1);
        assert!(
            matches!(tokens.next_event(), Some(Event::Item(name, value)) if name == "_one" && value.text == b"1")
        );
        assert!(matches!(tokens.next_event(), Some(Event::Loop(names)) if names == ["_x.a", "_x.b"]));
        let mut row = Vec::new();
        assert_eq!([tokens.row(2, &mut row), tokens.row(2, &mut row), tokens.row(2, &mut row)], [2, 2, 0]);
        assert!(matches!(tokens.next_event(), Some(Event::Loop(names)) if names == ["_y"]));
        // Values that nobody took are passed over.
        assert!(
            matches!(tokens.next_event(), Some(Event::Item(name, value)) if name == "_z" && value.told().is_none())
        );
        assert!(tokens.at_end() && tokens.next_event().is_none());
    }
}
