//! Scene files.
use crate::args;
use crate::report::{Outcome, Report};
pub(super) fn run(_args: &args::Render, _report: &Report) -> Outcome<()> { Ok(()) }
