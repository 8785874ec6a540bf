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
    pub fn format(
        path: impl Into<PathBuf>,
        place: impl Into<String>,
        what: impl Into<String>,
        hint: impl Into<String>,
    ) -> Self {
        Self::Format { path: path.into(), place: place.into(), what: what.into(), hint: hint.into() }
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
