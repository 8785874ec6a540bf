//! Reads the next frame while something is made of the last one.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, Scope, ScopedJoinHandle};

use tyndall::{Progress, Result};
use tyndall_io::{Frame, Sequence};

use crate::dry_run::available_bytes;
use crate::progress;
use crate::report::Report;

/// A frame is read ahead where so many times the memory of the last one is free: it, and what is made of the last one.
const ROOM: u64 = 8;

/// Frames that are asked for in an order that is known beforehand.
pub(crate) struct Ahead<'scope, 'env> {
    sequence: &'env Sequence,
    scope: &'scope Scope<'scope, 'env>,
    /// Frames in their order.
    numbers: &'env [usize],
    /// Memory that may be used, instead of what is free.
    limit_bytes: Option<u64>,
    end: &'env End,
    next: Option<(usize, ScopedJoinHandle<'scope, Result<Frame>>)>,
}

/// Whether what is read ahead is still of use.
struct End(AtomicBool);

impl Progress for End {
    fn begin(&self, _stage: &str, _total: Option<u64>, _unit: &'static str) {}

    fn advance(&self, _amount: u64) {}

    fn cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed) || progress::stopped()
    }
}

/// Does work that asks for frames of a sequence, mostly those of these numbers in this order.
pub(crate) fn reading<T>(
    sequence: &Sequence,
    numbers: &[usize],
    limit_bytes: Option<u64>,
    work: impl FnOnce(&mut Ahead) -> T,
) -> T {
    let end = End(AtomicBool::new(false));
    thread::scope(|scope| {
        let done = work(&mut Ahead { sequence, scope, numbers, limit_bytes, end: &end, next: None });
        end.0.store(true, Ordering::Relaxed);
        done
    })
}

impl Ahead<'_, '_> {
    /// The frame of that number; begins to read the one after it.
    pub(crate) fn frame(&mut self, number: usize, report: &Report) -> Result<Frame> {
        let frame = match self.next.take() {
            Some((begun, reading)) if begun == number => {
                reading.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?
            }
            _ => self.sequence.frame(number, report.progress())?,
        };
        let after = self.numbers.iter().skip_while(|it| **it != number).find(|it| **it != number);
        let room = self.limit_bytes.or_else(available_bytes);
        if let Some(&after) = after
            && room.is_none_or(|room| room >= ROOM * frame.particles.bytes())
        {
            let (sequence, end) = (self.sequence, self.end);
            self.next = Some((after, self.scope.spawn(move || sequence.frame(after, end))));
        }
        Ok(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::Common;

    #[test]
    fn frames_are_those_that_are_asked_for_in_any_order() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.xyz");
        let text: String =
            (1..=6).map(|count| format!("{count}\n\n{}", "Cu 1 2 3\n".repeat(count))).collect();
        std::fs::write(&path, text).unwrap();
        let sequence = Sequence::open(&[path], &tyndall_io::Options::default(), &()).unwrap();
        let report = Report::new(&Common { quiet: true, verbose: false, threads: None });
        for asked in [vec![0, 2, 4, 5], vec![5, 5, 1, 0], vec![]] {
            for limit in [None, Some(1)] {
                reading(&sequence, &asked, limit, |ahead| {
                    for number in asked.iter().copied().chain([3, 0]) {
                        let frame = ahead.frame(number, &report).unwrap();
                        assert_eq!(frame.particles.len(), number + 1);
                        assert!(limit.is_none() || ahead.next.is_none());
                    }
                    assert!(ahead.frame(9, &report).is_err());
                });
            }
        }
    }
}
