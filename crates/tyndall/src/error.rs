//! Everything that can go wrong, sorted by who can mend it.
//!
//! Each message is one line: what, where, why, and what to try. The library prints nothing; a shell prints the error once.

use std::path::PathBuf;

/// What the fallible edges of Tyndall return.
pub type Result<T> = std::result::Result<T, Error>;

/// Why something could not be done.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The content of a file is not what it should be: its author can mend it.
    #[error("{what} ({}{}{place}) — {hint}", path.display(), if place.is_empty() { "" } else { ": " })]
    Format {
        /// The file.
        path: PathBuf,
        /// Where in the file: a line, a byte offset, a frame, an array. Empty for the whole file.
        place: String,
        /// What was wanted and what was found.
        what: String,
        /// What to try.
        hint: String,
    },
    /// A setting has a value that it cannot have: the caller can mend it.
    #[error("{name} cannot be '{value}' — {allowed}")]
    Setting {
        /// The setting's name, as the command line and the scene file spell it.
        name: String,
        /// The value that was given.
        value: String,
        /// Which values are allowed, or what to give instead.
        allowed: String,
    },
    /// More memory is needed than there is.
    #[error("{what} needs {needed_bytes} bytes of memory, {available_bytes} are available — {hint}")]
    Memory {
        /// What needs it.
        what: String,
        /// How much it needs.
        needed_bytes: u64,
        /// How much there is.
        available_bytes: u64,
        /// What to try.
        hint: String,
    },
    /// The device that should render cannot.
    #[error("{0}")]
    Device(String),
    /// The operating system refused to read or write.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The caller asked to stop.
    #[error("interrupted")]
    Interrupted,
}

impl Error {
    /// A [`Error::Format`]: `what` is wrong at `place` of `path`, try `hint`.
    ///
    /// Words of a damaged file may be long and have control characters: these are replaced by U+FFFD, and more than 500
    /// characters are shortened, so that the message stays one line that a terminal can show.
    pub fn format(
        path: impl Into<PathBuf>,
        place: impl Into<String>,
        what: impl Into<String>,
        hint: impl Into<String>,
    ) -> Self {
        let (place, what) = (printable(place.into()), printable(what.into()));
        Self::Format { path: path.into(), place, what, hint: hint.into() }
    }

    /// A [`Error::Setting`]: `name` was given `value`, but `allowed`.
    pub fn setting(name: impl Into<String>, value: impl ToString, allowed: impl Into<String>) -> Self {
        Self::Setting { name: name.into(), value: value.to_string(), allowed: allowed.into() }
    }

    /// A [`Error::Io`] about `path`.
    pub fn io(path: impl Into<PathBuf>, source: std::io::Error) -> Self {
        Self::Io { path: path.into(), source }
    }

    /// A short code for the error's kind, as printed in `error[E-code]`.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Format { .. } => "format",
            Self::Setting { .. } => "setting",
            Self::Memory { .. } => "memory",
            Self::Device(_) => "device",
            Self::Io { .. } => "io",
            Self::Interrupted => "interrupted",
        }
    }
}

/// The text on one line of at most 500 characters.
fn printable(text: String) -> String {
    const MOST: usize = 500;
    let is_long = text.chars().nth(MOST).is_some();
    if !is_long && !text.contains(char::is_control) {
        return text;
    }
    let shown = text.chars().take(if is_long { MOST - 1 } else { MOST });
    let shown = shown.map(|it| if it.is_control() { char::REPLACEMENT_CHARACTER } else { it });
    shown.chain(is_long.then_some('…')).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_a_damaged_file_stay_on_one_line() {
        let told = |what: &str| Error::format("a.csv", "line\n2", what, "mend it").to_string();
        assert_eq!(told("found 'a\0\x1bé'"), "found 'a\u{fffd}\u{fffd}é' (a.csv: line\u{fffd}2) — mend it");
        assert!(told(&"é".repeat(500)).starts_with(&"é".repeat(500)));
        assert!(told(&"é".repeat(501)).starts_with(&format!("{}… (a.csv", "é".repeat(499))));
    }
}
