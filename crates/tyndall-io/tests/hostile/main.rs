//! Files that lie: every reader gets files that are cut, damaged or made up, and must answer with whole frames or an error that names
//! the file; without a panic, soon, and in memory that the file's size bounds.
//!
//! The samples of `tests/data` are always there, one for every format; the shared real files are used where they are. How long each test
//! of random damage goes on is `TYNDALL_HOSTILE_SECS`, with which seed it begins `TYNDALL_HOSTILE_SEED`; files that a reader failed on are
//! kept in the folder `TYNDALL_HOSTILE_KEEP`. `fuzz/` has the same for libFuzzer.
#![allow(clippy::unwrap_used, reason = "all of this is tests")]

mod attempt;
mod bombs;
mod cut;
mod damage;
mod files;
mod headers;
mod memory;
mod watch;
