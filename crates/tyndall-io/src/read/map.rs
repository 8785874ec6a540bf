//! A file, and its bytes as memory: mapped, not copied.
//!
//! Takes a path, gives the file or its bytes. The one place with `unsafe` in the readers.
#![allow(unsafe_code)]

use std::fs::File;
use std::path::Path;

use memmap2::Mmap;
use tyndall::{Error, Result};

/// Opens a regular file. Anything else is refused before it is opened: a pipe would let us wait for who writes to it.
pub(crate) fn open(path: &Path) -> Result<File> {
    let io = |source| Error::io(path, source);
    if !std::fs::metadata(path).map_err(io)?.is_file() {
        let hint = "give a regular file; what comes from a pipe has to be stored first";
        return Err(Error::format(path, "", "this is not a file", hint));
    }
    File::open(path).map_err(io)
}

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
    let file = open(path)?;
    // SAFETY: the map is read-only and private to this process. That no other process truncates the file while it is
    // mapped cannot be enforced; the system would then end us with SIGBUS, never give us wrong memory. This risk is
    // accepted, as by every program that maps its input.
    unsafe { Mmap::map(&file) }.map_err(|source| Error::io(path, source))
}
