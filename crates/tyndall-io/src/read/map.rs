//! A file, and its bytes as memory: mapped, not copied.
//!
//! Takes a path, gives the file or its bytes. What was read of a map stays in memory as long as nothing else needs the room; [`Map::released`]
//! gives it back earlier, so that a reader needs little beside what it makes. The one place with `unsafe` in the readers.
#![allow(unsafe_code)]

use std::fs::File;
use std::ops::Deref;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use memmap2::Mmap;
use tyndall::{Error, Progress, Result};

use super::unpack::MARK;

/// So many bytes are read between two times that pages are given back.
const RELEASE_BYTES: u64 = 8 << 20;

/// A file that is mapped.
#[derive(Debug)]
pub(crate) struct Map {
    file: Mmap,
    /// Where its content begins: behind the mark of UTF-8, if there is one.
    start: usize,
}

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
pub(crate) fn map(path: &Path) -> Result<Map> {
    let map = map_in_pieces(path)?;
    // Advice only: without it reading works as well.
    #[cfg(unix)]
    let _ = map.advise(memmap2::Advice::Sequential);
    let start = if map.starts_with(MARK) { MARK.len() } else { 0 };
    Ok(Map { file: map, start })
}

/// Maps the whole of `path`, of which only some will be read.
pub(crate) fn map_in_pieces(path: &Path) -> Result<Mmap> {
    let file = open(path)?;
    // SAFETY: the map is read-only and private to this process. That no other process truncates the file while it is
    // mapped cannot be enforced; the system would then end us with SIGBUS, never give us wrong memory. This risk is
    // accepted, as by every program that maps its input.
    unsafe { Mmap::map(&file) }.map_err(|source| Error::io(path, source))
}

impl Deref for Map {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.file[self.start..]
    }
}

impl Map {
    /// Tells `progress` what it is told, and gives back the map's pages whenever some more of it was read.
    pub(crate) fn released<'a>(&'a self, progress: &'a dyn Progress) -> Released<'a> {
        released([self], progress)
    }

    /// Gives back the pages that are in memory. What is looked at again comes from the system's cache.
    fn release(&self) {
        // SAFETY: nobody writes to the map, so that what is dropped is what the file has, and comes back from there.
        #[cfg(unix)]
        let _ = unsafe { self.file.unchecked_advise(memmap2::UncheckedAdvice::DontNeed) };
    }
}

/// The same for several maps that are read together.
pub(crate) fn released<'a>(
    maps: impl IntoIterator<Item = &'a Map>,
    progress: &'a dyn Progress,
) -> Released<'a> {
    Released { maps: maps.into_iter().collect(), progress, bytes: AtomicU64::new(0) }
}

/// A progress under which the pages of maps are given back.
pub(crate) struct Released<'a> {
    maps: Vec<&'a Map>,
    progress: &'a dyn Progress,
    bytes: AtomicU64,
}

impl Progress for Released<'_> {
    fn begin(&self, stage: &str, total: Option<u64>, unit: &'static str) {
        self.progress.begin(stage, total, unit);
    }

    fn advance(&self, amount: u64) {
        self.progress.advance(amount);
        let before = self.bytes.fetch_add(amount, Ordering::Relaxed);
        if before / RELEASE_BYTES != (before + amount) / RELEASE_BYTES {
            self.maps.iter().for_each(|map| map.release());
        }
    }

    fn cancelled(&self) -> bool {
        self.progress.cancelled()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_given_back_is_there_again() {
        let path = std::env::temp_dir().join(format!("tyndall-map-{}", std::process::id()));
        let bytes: Vec<u8> = (0..3u32 << 20).map(|place| (place >> 8) as u8).collect();
        std::fs::write(&path, &bytes).unwrap();
        let map = map(&path).unwrap();
        let progress = map.released(&());
        for _ in 0..3 {
            assert!(map[..] == bytes);
            progress.advance(RELEASE_BYTES / 2 + 1);
        }
        std::fs::remove_file(&path).unwrap();
    }
}
