//! Names of numbered pictures: `%04d`, `####` and `$F4` stand for a number.

use std::path::{Path, PathBuf};

/// A picture's name, with or without a place for a number.
pub(crate) struct Pattern {
    before: String,
    digits: Option<usize>,
    after: String,
    path: PathBuf,
}

impl Pattern {
    /// Finds the place of the number in the file's name: the last one written in a known way.
    pub(crate) fn new(path: &Path) -> Self {
        let text = path.to_str().unwrap_or_default();
        let found = percent(text).or_else(|| houdini(text)).or_else(|| hashes(text));
        let (start, end, digits) =
            found.map_or((0, 0, None), |(start, end, digits)| (start, end, Some(digits)));
        Self { before: text[..start].into(), digits, after: text[end..].into(), path: path.into() }
    }

    /// Whether there is a place for a number.
    pub(crate) fn is_numbered(&self) -> bool {
        self.digits.is_some()
    }

    /// The name of picture `number`.
    pub(crate) fn name(&self, number: usize) -> PathBuf {
        match self.digits {
            Some(digits) => format!("{}{number:0digits$}{}", self.before, self.after).into(),
            None => self.path.clone(),
        }
    }
}

/// `%d`, `%4d` or `%04d`: start, end, digits.
fn percent(text: &str) -> Option<(usize, usize, usize)> {
    text.rmatch_indices('%').find_map(|(start, _)| {
        let width: String = text[start + 1..].chars().take_while(char::is_ascii_digit).collect();
        let end = start + 1 + width.len();
        let digits = if width.is_empty() { 1 } else { width.parse().ok().filter(|digits| *digits <= 20)? };
        text[end..].starts_with('d').then_some((start, end + 1, digits))
    })
}

/// `$F` or `$F4`.
fn houdini(text: &str) -> Option<(usize, usize, usize)> {
    let start = text.rfind("$F")?;
    match text[start + 2..].chars().next().and_then(|digit| digit.to_digit(10)) {
        Some(digits) => Some((start, start + 3, digits as usize)),
        None => Some((start, start + 2, 1)),
    }
}

/// A run of `#`.
fn hashes(text: &str) -> Option<(usize, usize, usize)> {
    let end = text.rfind('#')? + 1;
    let start = text[..end].trim_end_matches('#').len();
    (end - start <= 20).then_some((start, end, end - start))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_take_their_place() {
        for (pattern, name) in [
            ("a.%04d.png", "a.0012.png"),
            ("a%d.png", "a12.png"),
            ("d#/a####.exr", "d#/a0012.exr"),
            ("a.$F4.exr", "a.0012.exr"),
            ("a$F.exr", "a12.exr"),
            ("100%.png", "100%.png"),
            ("ä%03d.png", "ä012.png"),
        ] {
            assert_eq!(Pattern::new(Path::new(pattern)).name(12), Path::new(name), "{pattern}");
        }
        assert!(!Pattern::new(Path::new("a.png")).is_numbered());
        assert!(Pattern::new(Path::new("a.#.png")).is_numbered());
    }
}
