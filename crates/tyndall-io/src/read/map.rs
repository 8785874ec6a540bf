//! A file's bytes as memory: mapped, not copied.
//!
//! Takes a path, gives its bytes. The one place with `unsafe` in the readers.
#![allow(unsafe_code)]

use std::fs::File;
use std::path::Path;

use memmap2::Mmap;
use tyndall::{Error, Result};

/// Maps the whole of `path`, to be read mostly from front to back.
pub(crate) fn map(path: &Path) -> Result<Mmap> {
    let map = map_in_pieces(path)?;
    // Advice only: without it reading works as well.
    #[cfg(unix)]
    let _ = map.advise(memmap2::Advice::Sequential);
    Ok(map)
}

/// Maps the whole of `path`, of which only some will be read.
pub(crate) fn map_in_pieces(path: &Path) -> Result<Mmap> {
    let file = File::open(path).map_err(|source| Error::io(path, source))?;
    // SAFETY: the map is read-only and private to this process. That no other process truncates the file while it is
    // mapped cannot be enforced; the system would then end us with SIGBUS, never give us wrong memory. This risk is
    // accepted, as by every program that maps its input.
    unsafe { Mmap::map(&file) }.map_err(|source| Error::io(path, source))
}
