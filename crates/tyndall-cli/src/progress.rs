//! Progress bars, and the wish to stop.
//!
//! A bar is drawn only on a terminal. Ctrl-C and the system's requests to end set a flag that long work looks at.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use tyndall::Progress;

/// Set by a signal, never cleared.
static STOP: AtomicBool = AtomicBool::new(false);

/// Lets signals stop the work. A second signal ends the process at once.
pub(crate) fn listen_to_signals() {
    let handler = || {
        if STOP.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    };
    // Fails only if a handler is there already; then the system's own ends the process.
    let _ = ctrlc::set_handler(handler);
}

/// Whether a signal asked to stop.
pub(crate) fn stopped() -> bool {
    STOP.load(Ordering::Relaxed)
}

/// One bar after the other, on stderr.
pub(crate) struct Bars {
    quiet: bool,
    bar: Mutex<Option<ProgressBar>>,
}

impl Bars {
    pub(crate) fn new(quiet: bool) -> Self {
        Self { quiet, bar: Mutex::default() }
    }

    /// Removes the bar from the terminal.
    pub(crate) fn clear(&self) {
        if let Some(bar) = self.bar.lock().unwrap_or_else(PoisonError::into_inner).take() {
            bar.finish_and_clear();
        }
    }
}

impl Drop for Bars {
    fn drop(&mut self) {
        self.clear();
    }
}

impl Progress for Bars {
    fn begin(&self, stage: &str, total: Option<u64>, unit: &'static str) {
        self.clear();
        if self.quiet {
            return;
        }
        let amounts = match (unit, total) {
            ("B", Some(_)) => "{bytes}/{total_bytes} {bytes_per_sec}",
            ("B", None) => "{bytes} {bytes_per_sec}",
            (_, Some(_)) => "{human_pos}/{human_len} {per_sec}",
            (_, None) => "{human_pos} {per_sec}",
        };
        let unit = if unit == "B" { "" } else { unit };
        let template = match total {
            Some(_) => format!("{stage:<8} {{wide_bar}} {amounts} {unit} {{eta}}"),
            None => format!("{stage:<8} {{spinner}} {amounts} {unit} {{elapsed}}"),
        };
        let bar = ProgressBar::with_draw_target(total, ProgressDrawTarget::stderr_with_hz(8));
        if let Ok(style) = ProgressStyle::with_template(&template) {
            bar.set_style(style);
        }
        *self.bar.lock().unwrap_or_else(PoisonError::into_inner) = Some(bar);
    }

    fn advance(&self, amount: u64) {
        if let Some(bar) = &*self.bar.lock().unwrap_or_else(PoisonError::into_inner) {
            bar.inc(amount);
        }
    }

    fn cancelled(&self) -> bool {
        stopped()
    }
}
