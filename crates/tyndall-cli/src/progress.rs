//! Progress bars, and the wish to stop.
//!
//! A bar is drawn only on a terminal. Ctrl-C and the system's requests to end set a flag that long work looks at.

use std::fmt::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
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
            (_, Some(_)) => "{done}/{all} UNIT {rate}/s",
            (_, None) => "{done} UNIT {rate}/s",
        };
        let amounts = amounts.replace("UNIT", unit);
        let template = match total {
            Some(_) => format!("{stage:<8} {{wide_bar}} {amounts} {{eta}}"),
            None => format!("{stage:<8} {{spinner}} {amounts} {{elapsed}}"),
        };
        let bar = ProgressBar::with_draw_target(total, ProgressDrawTarget::stderr_with_hz(8));
        if let Ok(style) = ProgressStyle::with_template(&template) {
            let done =
                |state: &ProgressState, out: &mut dyn Write| _ = out.write_str(&compact(state.pos() as f64));
            let all = |state: &ProgressState, out: &mut dyn Write| {
                _ = out.write_str(&compact(state.len().unwrap_or_default() as f64));
            };
            let rate =
                |state: &ProgressState, out: &mut dyn Write| _ = out.write_str(&compact(state.per_sec()));
            bar.set_style(style.with_key("done", done).with_key("all", all).with_key("rate", rate));
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

/// A large number in few letters: `57.1 M`.
fn compact(number: f64) -> String {
    let (size, unit) = match number {
        number if number >= 1e9 => (number * 1e-9, " G"),
        number if number >= 1e6 => (number * 1e-6, " M"),
        number if number >= 1e4 => (number * 1e-3, " k"),
        number => return format!("{number:.0}"),
    };
    let decimals = if size < 100.0 { 1 } else { 0 };
    format!("{size:.decimals$}{unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_numbers_take_few_letters() {
        let told = [0.0, 9999.4, 12_345.0, 57_096_044.4, 122_880_000.0, 2e9].map(compact);
        assert_eq!(told, ["0", "9999", "12.3 k", "57.1 M", "123 M", "2.0 G"]);
    }
}
