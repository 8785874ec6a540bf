//! A file, and its bytes as memory: mapped, not copied.
//!
//! Takes a path, gives the file or its bytes. What was read of a map stays in memory as long as nothing else needs the room; [`Map::released`]
//! gives it back earlier, so that a reader needs little beside what it makes. The one place with `unsafe` in the readers.
#![allow(unsafe_code)]

use std::fs::File;
use std::ops::{Deref, Range};
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};

use memmap2::Mmap;
use tyndall::{Error, Progress, Result};

use super::unpack::MARK;

/// So many bytes are read between two times that pages are given back.
pub(crate) const RELEASE_BYTES: u64 = 8 << 20;
/// So many times a whole map is given back, at most, while as much is read as it has.
const WHOLE: u64 = 256;
/// So many ranges are looked at for one that a new one continues: a few threads with some columns each.
const RECENT: usize = 64;

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

/// The same for content that is no text, whatever it begins with.
#[cfg(feature = "hdf5")]
pub(crate) fn map_binary(path: &Path) -> Result<Map> {
    Ok(Map { file: map_in_pieces(path)?, start: 0 })
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

    /// Gives back the pages that `range` of the content touches. What is looked at again comes from the system's cache.
    pub(crate) fn release(&self, range: Range<usize>) {
        let (start, end) = (self.start + range.start, (self.start + range.end).min(self.file.len()));
        // SAFETY: nobody writes to the map, so that what is dropped is what the file has, and comes back from there.
        #[cfg(unix)]
        let _ = unsafe {
            let length = end.saturating_sub(start);
            self.file.unchecked_advise_range(memmap2::UncheckedAdvice::DontNeed, start, length)
        };
    }

    /// The same for `bytes` of the content; does nothing if these are others.
    #[cfg(feature = "hdf5")]
    pub(crate) fn give_back(&self, bytes: &[u8]) {
        if let Some(range) = self.range_of(bytes) {
            self.release(range);
        }
    }

    /// Where `bytes` stand in the content, if they do.
    fn range_of(&self, bytes: &[u8]) -> Option<Range<usize>> {
        let start = (bytes.as_ptr() as usize).checked_sub(self.as_ptr() as usize)?;
        (start + bytes.len() <= self.len()).then(|| start..start + bytes.len())
    }
}

/// The same for several maps that are read together.
pub(crate) fn released<'a>(
    maps: impl IntoIterator<Item = &'a Map>,
    progress: &'a dyn Progress,
) -> Released<'a> {
    let maps: Vec<&Map> = maps.into_iter().collect();
    let due = Mutex::new(Due::new(&maps.iter().map(|map| map.len()).collect::<Vec<_>>()));
    Released { maps, progress, due }
}

/// A progress under which the pages of maps are given back: those that [`Progress::let_go`] names, and now and then all, because a reader
/// may not name what it is done with.
pub(crate) struct Released<'a> {
    maps: Vec<&'a Map>,
    progress: &'a dyn Progress,
    due: Mutex<Due>,
}

impl Released<'_> {
    fn due(&self) -> MutexGuard<'_, Due> {
        self.due.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Progress for Released<'_> {
    fn begin(&self, stage: &str, total: Option<u64>, unit: &'static str) {
        self.progress.begin(stage, total, unit);
    }

    fn advance(&self, amount: u64) {
        self.progress.advance(amount);
        let due = self.due().advance(amount);
        for (place, range) in due {
            self.maps[place].release(range);
        }
    }

    fn cancelled(&self) -> bool {
        self.progress.cancelled()
    }

    fn let_go(&self, bytes: &[u8]) {
        let found = self.maps.iter().enumerate().find_map(|(place, map)| Some((place, map.range_of(bytes)?)));
        match found {
            Some((place, range)) => self.due().let_go(place, range),
            None => self.progress.let_go(bytes),
        }
    }
}

/// Which ranges of maps are to be given back, and when.
///
/// A map is given back as a whole at most [`WHOLE`] times while as much is read as it has, whatever its size: the system looks at every page
/// of it, so that a fixed number of bytes between two times would be work in the square of the size.
#[derive(Debug, Default)]
struct Due {
    lengths: Vec<usize>,
    /// Ranges that were let go since pages were given back last.
    ranges: Vec<(usize, Range<usize>)>,
    /// Whether the reader names what it is done with.
    is_told: bool,
    /// Bytes that were read since ranges were given back, and since all was.
    since_ranges: u64,
    since_all: u64,
}

impl Due {
    fn new(lengths: &[usize]) -> Self {
        Self { lengths: lengths.to_vec(), ..Self::default() }
    }

    /// Range `range` of map `place` is not looked at again.
    fn let_go(&mut self, place: usize, range: Range<usize>) {
        self.is_told = true;
        // Columns of one row overlap, and rows follow each other.
        let touches = |it: &&mut (usize, Range<usize>)| {
            it.0 == place && it.1.start <= range.end && range.start <= it.1.end
        };
        match self.ranges.iter_mut().rev().take(RECENT).find(touches) {
            Some((_, known)) => *known = known.start.min(range.start)..known.end.max(range.end),
            None => self.ranges.push((place, range)),
        }
    }

    /// `amount` more was read; what is to be given back.
    fn advance(&mut self, amount: u64) -> Vec<(usize, Range<usize>)> {
        self.since_ranges += amount;
        self.since_all += amount;
        let total: usize = self.lengths.iter().sum();
        let least = if self.is_told { 4 * RELEASE_BYTES } else { RELEASE_BYTES };
        if self.since_all >= least.max(total as u64 / WHOLE) {
            (self.since_ranges, self.since_all) = (0, 0);
            self.ranges.clear();
            return self.lengths.iter().enumerate().map(|(place, length)| (place, 0..*length)).collect();
        }
        if self.since_ranges < RELEASE_BYTES {
            return Vec::new();
        }
        self.since_ranges = 0;
        std::mem::take(&mut self.ranges)
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
        progress.let_go(&map[5 << 12..2 << 20]);
        let other = [0; 9];
        progress.let_go(&other);
        assert_eq!(progress.due().ranges, [(0, 5 << 12..2 << 20)]);
        std::fs::remove_file(&path).unwrap();
    }

    #[test]
    fn how_often_a_page_is_given_back_does_not_grow_with_the_file() {
        for length in [1usize << 28, 1 << 36, 1 << 43] {
            let (mut due, mut times) = (Due::new(&[length]), 0);
            let step = (length / 4096) as u64;
            for _ in 0..4096 {
                times += due.advance(step).len() as u64;
            }
            assert!((1..=WHOLE).contains(&times), "{length}: {times}");
        }
    }

    #[test]
    fn what_threads_let_go_is_given_back_once() {
        // Two threads, each with its half of the rows; a row of 16 bytes has two columns.
        let (rows, job) = (1usize << 24, 1usize << 16);
        let mut due = Due::new(&[16 * rows]);
        let mut given = vec![0u8; rows / job];
        let mut give = |due: &mut Due, amount: u64| {
            for (_, range) in due.advance(amount) {
                assert!(range.len() == 16 * rows || range.len() <= 2 * RELEASE_BYTES as usize, "{range:?}");
                let jobs = range.start / (16 * job)..range.end.div_ceil(16 * job);
                if range.len() < 16 * rows {
                    given[jobs].iter_mut().for_each(|it| *it += 1);
                }
            }
        };
        for start in (0..rows / 2).step_by(job) {
            for start in [start, rows / 2 + start] {
                for column in [0, 8] {
                    due.let_go(0, 16 * start + column..16 * (start + job - 1) + column + 8);
                }
                give(&mut due, 16 * job as u64);
            }
        }
        // Every fourth time all is given back.
        assert!(given.iter().all(|it| *it <= 2), "{given:?}");
        let named = given.iter().filter(|it| **it > 0).count();
        assert!(4 * named >= 2 * given.len(), "{named} of {}", given.len());
        assert!(due.ranges.len() <= 4, "{:?}", due.ranges);
    }
}
