//! What is said to people: notes, warnings, progress and errors on stderr, and which exit code an error has.
//!
//! Each warning is said once. Output that scripts read goes to stdout through [`Report::out`].

use std::collections::BTreeSet;
use std::fmt;
use std::io::{self, Write};
use std::process::ExitCode;
use std::sync::{Mutex, PoisonError};

use tyndall::Error;

use crate::args::Common;
use crate::progress::Bars;

/// Why the command ends without success.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The library says why, about the input or a setting.
    Library(Error),
    /// The picture could not be written.
    Output(Error),
    /// The command line makes no sense.
    Usage(String),
    /// A picture would show nothing.
    Unseen(String),
    /// Some pictures failed, each was reported.
    Partial(String),
    /// Stopped from outside; what is finished.
    Interrupted(String),
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        match error {
            Error::Interrupted => Self::Interrupted("nothing written".into()),
            error => Self::Library(error),
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Library(error @ Error::Memory { what, needed_bytes, available_bytes, hint }) => {
                let (needed, available) = (bytes(*needed_bytes), bytes(*available_bytes));
                write!(
                    f,
                    "error[E-{}]: {what} needs {needed}, {available} are available — {hint}",
                    error.code()
                )
            }
            Self::Library(error) | Self::Output(error) => write!(f, "error[E-{}]: {error}", error.code()),
            Self::Usage(text) => write!(f, "error[E-usage]: {text}"),
            Self::Unseen(text) => write!(f, "error[E-view]: {text}"),
            Self::Partial(text) => write!(f, "error[E-partial]: {text}"),
            Self::Interrupted(text) => write!(f, "interrupted: {text}"),
        }
    }
}

impl Failure {
    /// 2 usage, 3 input, 4 resources, 5 backend, 6 partial; 130 as a shell does for an interrupted command.
    pub(crate) fn code(&self) -> u8 {
        match self {
            Self::Usage(_) | Self::Library(Error::Setting { .. }) | Self::Output(Error::Setting { .. }) => 2,
            Self::Unseen(_) | Self::Library(Error::Format { .. } | Error::Io { .. }) => 3,
            Self::Library(Error::Memory { .. }) | Self::Output(_) => 4,
            Self::Library(Error::Device(_)) => 5,
            Self::Partial(_) => 6,
            Self::Interrupted(_) | Self::Library(Error::Interrupted) => 130,
        }
    }

    pub(crate) fn exit_code(&self) -> ExitCode {
        ExitCode::from(self.code())
    }
}

/// What a verb returns.
pub(crate) type Outcome<T> = std::result::Result<T, Failure>;

/// Speaks to people.
pub(crate) struct Report {
    quiet: bool,
    verbose: bool,
    said: Mutex<BTreeSet<String>>,
    bars: Bars,
}

impl Report {
    pub(crate) fn new(common: &Common) -> Self {
        let Common { quiet, verbose, .. } = *common;
        Self { quiet, verbose, said: Mutex::default(), bars: Bars::new(quiet) }
    }

    /// Listens to long work.
    pub(crate) fn progress(&self) -> &Bars {
        &self.bars
    }

    /// What was chosen and done.
    pub(crate) fn note(&self, text: impl fmt::Display) {
        if !self.quiet {
            self.line(&format!("{text}"));
        }
    }

    /// Whether anybody is curious: then what takes time to find out is worth it.
    pub(crate) fn is_verbose(&self) -> bool {
        self.verbose
    }

    /// What only the curious want to know.
    pub(crate) fn detail(&self, text: impl fmt::Display) {
        if self.verbose {
            self.line(&format!("{text}"));
        }
    }

    /// What may be wrong; the same words are said once.
    pub(crate) fn warn(&self, text: &str) {
        let mut said = self.said.lock().unwrap_or_else(PoisonError::into_inner);
        if !self.quiet && said.insert(text.to_string()) {
            self.line(&format!("warning: {text}"));
        }
    }

    /// Why something failed.
    pub(crate) fn error(&self, failure: &Failure) {
        self.line(&failure.to_string());
    }

    /// One line on stderr, not mixed with a progress bar.
    fn line(&self, text: &str) {
        self.bars.clear();
        // Without a stderr there is nobody to tell.
        let _ = writeln!(io::stderr().lock(), "{text}");
    }

    /// Output for scripts and people, on stdout; ends quietly if the reader has gone.
    pub(crate) fn out(&self, text: &str) -> Outcome<()> {
        self.bars.clear();
        print(text.as_bytes())
    }
}

/// Prints to stdout; a reader that has gone is no error.
pub(crate) fn print(text: &[u8]) -> Outcome<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure::Output(Error::io("stdout", error)))
        }
        _ => Ok(()),
    }
}

/// A count of things for people: `1 particle`, `1,204 particles`.
pub(crate) fn counted(count: usize, thing: &str) -> String {
    format!("{} {thing}{}", tyndall::scene::grouped(count), if count == 1 { "" } else { "s" })
}

/// A size of memory for people.
pub(crate) fn bytes(count: u64) -> String {
    let units = ["B", "KiB", "MiB", "GiB", "TiB", "PiB"];
    let mut size = count as f64;
    let mut unit = 0;
    while size >= 1024.0 && unit + 1 < units.len() {
        (size, unit) = (size / 1024.0, unit + 1);
    }
    if unit == 0 { format!("{count} B") } else { format!("{size:.1} {}", units[unit]) }
}

/// A time for people.
pub(crate) fn seconds(secs: f64) -> String {
    match secs {
        secs if secs < 10.0 => format!("{secs:.2} s"),
        secs if secs < 120.0 => format!("{secs:.1} s"),
        secs if secs < 7200.0 => format!("{:.0} min", secs / 60.0),
        secs => format!("{:.1} h", secs / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_times_are_short() {
        assert_eq!([0, 1023, 1024, 21 << 30].map(bytes), ["0 B", "1023 B", "1.0 KiB", "21.0 GiB"]);
        assert_eq!([0.5, 95.0, 600.0, 9000.0].map(seconds), ["0.50 s", "95.0 s", "10 min", "2.5 h"]);
    }

    #[test]
    fn who_can_mend_it_decides_the_exit_code() {
        let io = || Error::io("a", io::Error::from(io::ErrorKind::NotFound));
        let memory = Error::Memory {
            what: "it".into(),
            needed_bytes: 2 << 30,
            available_bytes: 1 << 30,
            hint: "try".into(),
        };
        let code = |failure: Failure| failure.code();
        assert_eq!(code(Error::setting("a", "b", "c").into()), 2);
        assert_eq!((code(io().into()), code(Failure::Output(io()))), (3, 4));
        let memory = Failure::from(memory);
        assert_eq!(
            (memory.to_string(), memory.code()),
            ("error[E-memory]: it needs 2.0 GiB, 1.0 GiB are available — try".into(), 4)
        );
        assert_eq!((code(Error::Device("x".into()).into()), code(Error::Interrupted.into())), (5, 130));
    }
}
