//! Rows, made by all threads and written in order.

use std::io::{self, Write};

use rayon::prelude::*;
use tyndall::particles::{Attribute, View};

/// Rows that a thread makes at a time.
const JOB_ROWS: usize = 1 << 12;
/// Jobs whose rows wait to be written.
const JOBS: usize = 64;

/// Writes `count` rows: `row` appends the bytes of row `id`. What it needs for rows that follow each other is made by `start`.
pub(super) fn write<S>(
    out: &mut (impl Write + ?Sized),
    count: usize,
    start: impl Fn() -> S + Sync,
    row: impl Fn(&mut Vec<u8>, usize, &mut S) + Sync,
) -> io::Result<()> {
    for first in (0..count).step_by(JOB_ROWS * JOBS) {
        let last = count.min(first + JOB_ROWS * JOBS);
        let begins: Vec<usize> = (first..last).step_by(JOB_ROWS).collect();
        let make = |&begin: &usize| {
            let mut bytes = Vec::with_capacity(64 * JOB_ROWS);
            let mut state = start();
            (begin..last.min(begin + JOB_ROWS)).for_each(|id| row(&mut bytes, id, &mut state));
            bytes
        };
        let parts: Vec<Vec<u8>> = begins.par_iter().map(make).collect();
        parts.iter().try_for_each(|bytes| out.write_all(bytes))?;
    }
    Ok(())
}

/// Writes `count` rows of a fixed layout.
pub(super) fn write_fixed(
    out: &mut (impl Write + ?Sized),
    count: usize,
    row: impl Fn(&mut Vec<u8>, usize) + Sync,
) -> io::Result<()> {
    write(out, count, || (), |bytes, id, ()| row(bytes, id))
}

/// Appends the components of an attribute of particle `id`, as they are stored, little-endian; words as their codes.
pub(super) fn stored(bytes: &mut Vec<u8>, attribute: &Attribute, id: usize) {
    let range = id * attribute.components..(id + 1) * attribute.components;
    match attribute.values.view() {
        View::F32(values) => values[range].iter().for_each(|it| bytes.extend(it.to_le_bytes())),
        View::F64(values) => values[range].iter().for_each(|it| bytes.extend(it.to_le_bytes())),
        View::I32(values) => values[range].iter().for_each(|it| bytes.extend(it.to_le_bytes())),
        View::I64(values) => values[range].iter().for_each(|it| bytes.extend(it.to_le_bytes())),
        View::U8(values) => bytes.extend_from_slice(&values[range]),
        View::Text { codes, .. } => codes[range].iter().for_each(|it| bytes.extend(it.to_le_bytes())),
    }
}
