//! Frames, opened lazily: many files, or many frames in a file.

use std::path::PathBuf;

use tyndall::{Particles, Progress, Result};

/// What the caller knows better than the file.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Names of the columns of a table, in order, instead of its header.
    pub columns: Option<Vec<String>>,
    /// The format's name, instead of recognition by content.
    pub format: Option<String>,
    /// Whether a truncated file is an error; else its whole frames are read, with a warning.
    pub strict: bool,
}

/// One frame of a sequence.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Its particles.
    pub particles: Particles,
    /// What was guessed while reading, one line each.
    pub conventions: Vec<String>,
    /// What the user should know, one line each.
    pub warnings: Vec<String>,
}

/// A list of frames. Only what was asked for is read.
pub struct Sequence {
    paths: Vec<PathBuf>,
}

impl Sequence {
    /// Opens files, in the given order, as one sequence. A path that begins with `synthetic:` names a procedural source.
    pub fn open(paths: &[PathBuf], _options: &Options) -> Result<Self> {
        Ok(Self { paths: paths.to_vec() })
    }

    /// How many frames there are.
    #[expect(clippy::len_without_is_empty, reason = "a sequence has a frame, or it does not open")]
    pub fn len(&self) -> usize {
        self.paths.len()
    }

    /// The format's name, as printed to people.
    pub fn format(&self) -> &str {
        ""
    }

    /// Reads frame `frame`, counted from 0.
    pub fn frame(&self, _frame: usize, _progress: &dyn Progress) -> Result<Frame> {
        Err(tyndall::Error::Interrupted)
    }
}
