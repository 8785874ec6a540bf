//! Values as Python writes them: texts, integers, truth values, lists, tuples, dictionaries. As much as an NPY header needs.

/// A value.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Literal {
    Text(String),
    Integer(u64),
    Truth(bool),
    /// A list or a tuple.
    List(Vec<Literal>),
    Dictionary(Vec<(Literal, Literal)>),
}

/// Nested deeper than this is refused.
const DEPTH_MAX: usize = 40;

/// The one value that the text holds; else what was wanted.
pub(super) fn parse(text: &str) -> Result<Literal, String> {
    let mut parser = Parser { rest: text };
    let value = parser.value(0)?;
    parser.skip_blanks();
    // Some writers end the header with a zero.
    if parser.rest.trim_matches(['\0', ' ', '\n']).is_empty() {
        Ok(value)
    } else {
        Err(parser.wanted("the end"))
    }
}

struct Parser<'a> {
    rest: &'a str,
}

impl Parser<'_> {
    fn value(&mut self, depth: usize) -> Result<Literal, String> {
        if depth > DEPTH_MAX {
            return Err("it is nested too deeply".into());
        }
        self.skip_blanks();
        for (word, truth) in [("True", true), ("False", false)] {
            if let Some(rest) = self.rest.strip_prefix(word) {
                self.rest = rest;
                return Ok(Literal::Truth(truth));
            }
        }
        for prefix in ["u'", "b'", "u\"", "b\""] {
            if self.rest.starts_with(prefix) {
                self.rest = &self.rest[1..];
            }
        }
        match self.rest.chars().next() {
            Some(quote @ ('\'' | '"')) => self.text(quote),
            Some('0'..='9') => self.integer(),
            Some('(') => self.list(')', depth),
            Some('[') => self.list(']', depth),
            Some('{') => self.dictionary(depth),
            _ => Err(self.wanted("a value")),
        }
    }

    fn text(&mut self, quote: char) -> Result<Literal, String> {
        let mut text = String::new();
        let mut letters = self.rest[1..].char_indices();
        while let Some((place, letter)) = letters.next() {
            match letter {
                letter if letter == quote => {
                    self.rest = &self.rest[1 + place + 1..];
                    return Ok(Literal::Text(text));
                }
                // Only quotes and backslashes are escaped in names that anyone uses; others keep their backslash.
                '\\' => match letters.next() {
                    Some((_, letter @ ('\\' | '\'' | '"'))) => text.push(letter),
                    Some((_, letter)) => text.extend(['\\', letter]),
                    None => break,
                },
                letter => text.push(letter),
            }
        }
        Err("a text has no end".into())
    }

    fn integer(&mut self) -> Result<Literal, String> {
        let end = self.rest.find(|letter: char| !letter.is_ascii_digit()).unwrap_or(self.rest.len());
        let value = self.rest[..end].parse().map_err(|_| self.wanted("an integer below 2^64"))?;
        // Python 2 marks long integers with an L.
        self.rest = self.rest[end..].trim_start_matches('L');
        Ok(Literal::Integer(value))
    }

    fn list(&mut self, end: char, depth: usize) -> Result<Literal, String> {
        self.rest = &self.rest[1..];
        let mut values = Vec::new();
        while !self.take(end) {
            values.push(self.value(depth + 1)?);
            if !self.take(',') && !self.peek(end) {
                return Err(self.wanted("a comma"));
            }
        }
        Ok(Literal::List(values))
    }

    fn dictionary(&mut self, depth: usize) -> Result<Literal, String> {
        self.rest = &self.rest[1..];
        let mut entries = Vec::new();
        while !self.take('}') {
            let key = self.value(depth + 1)?;
            if !self.take(':') {
                return Err(self.wanted("a colon"));
            }
            entries.push((key, self.value(depth + 1)?));
            if !self.take(',') && !self.peek('}') {
                return Err(self.wanted("a comma"));
            }
        }
        Ok(Literal::Dictionary(entries))
    }

    fn peek(&mut self, mark: char) -> bool {
        self.skip_blanks();
        self.rest.starts_with(mark)
    }

    fn take(&mut self, mark: char) -> bool {
        let found = self.peek(mark);
        if found {
            self.rest = &self.rest[mark.len_utf8()..];
        }
        found
    }

    fn skip_blanks(&mut self) {
        self.rest = self.rest.trim_start();
    }

    fn wanted(&self, wanted: &str) -> String {
        let found: String = self.rest.chars().take(20).collect();
        format!("{wanted} was wanted, '{found}' was found")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_python_writes_is_understood() {
        let text = |text: &str| Literal::Text(text.into());
        let parsed = parse("{'a\\'b': [(u'x', \"<f4\", (3,)), ()], 'n': 12L, 'f': False, }  \n").unwrap();
        let member = Literal::List(vec![text("x"), text("<f4"), Literal::List(vec![Literal::Integer(3)])]);
        let wanted = vec![
            (text("a'b"), Literal::List(vec![member, Literal::List(vec![])])),
            (text("n"), Literal::Integer(12)),
            (text("f"), Literal::Truth(false)),
        ];
        assert_eq!(parsed, Literal::Dictionary(wanted));
    }

    #[test]
    fn what_is_damaged_is_refused() {
        for text in [
            "",
            "{",
            "{'a'",
            "{'a':",
            "{'a':1",
            "[1 2]",
            "'a",
            "'\\",
            "-1",
            "1 2",
            "99999999999999999999",
            "(,)",
        ] {
            assert!(parse(text).is_err(), "{text}");
        }
        assert!(parse(&"[".repeat(100_000)).is_err());
    }
}
