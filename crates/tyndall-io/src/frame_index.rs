//! Where the frames of long texts are, kept from one run to the next, so that a trajectory is passed over once.
//!
//! An index lies in a folder of the user's under a hash of its file's path, and is used as long as the file has the same size, time of
//! change and format. If anything about it is odd, the file is scanned as if there was none; that it cannot be written is no error.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};
use twox_hash::XxHash3_64;

use crate::read::{Index, Span};
use crate::write::atomically;

/// The first bytes of an index; another layout has another number.
const MAGIC: [u8; 8] = *b"TynIdx01";
/// Shorter files are scanned in no time.
const WORTH: u64 = 16 << 20;
/// A file that was changed so short a while ago may change again within the same tick of its clock.
const SETTLED: Duration = Duration::from_secs(3);
/// So many indexes are kept; then the oldest goes.
const MOST: usize = 1000;

/// What an index begins with, behind its length; then for each frame three words: offset, line, and size + 1 or 0; then a checksum.
#[derive(Serialize, Deserialize)]
struct Head {
    of: File,
    cut: bool,
    doubt: Option<String>,
    units: Option<String>,
    title: Option<String>,
    frames: u64,
}

/// Which file an index is of, and as what it was read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct File {
    path: PathBuf,
    bytes: u64,
    /// When it was changed, in nanoseconds since 1970.
    changed: u128,
    format: String,
    version: String,
}

/// The place of a file's index.
pub(crate) struct Place {
    of: File,
    place: PathBuf,
}

impl Place {
    /// The place in `folder` of the index of a file that is read as `format`; none for a file that is short or was changed just now.
    pub(crate) fn of(folder: &Path, path: &Path, format: &str) -> Option<Self> {
        let data = fs::metadata(path).ok()?;
        let changed = data.modified().ok()?;
        let is_settled = SystemTime::now().duration_since(changed).is_ok_and(|age| age >= SETTLED);
        if data.len() < WORTH || !is_settled {
            return None;
        }
        let path = path.canonicalize().ok()?;
        let name = format!("{:016x}", XxHash3_64::oneshot(path.as_os_str().as_encoded_bytes()));
        let of = File {
            path,
            bytes: data.len(),
            changed: changed.duration_since(UNIX_EPOCH).ok()?.as_nanos(),
            format: format.into(),
            version: env!("CARGO_PKG_VERSION").into(),
        };
        Some(Self { of, place: folder.join(name) })
    }

    /// The index that is there.
    pub(crate) fn load(&self) -> Option<Index> {
        let bytes = fs::read(&self.place).ok()?;
        let (body, sum) = bytes.split_last_chunk::<8>()?;
        if XxHash3_64::oneshot(body) != u64::from_le_bytes(*sum) {
            return None;
        }
        let (length, rest) = body.strip_prefix(&MAGIC)?.split_first_chunk::<8>()?;
        let (head, frames) = rest.split_at_checked(u64::from_le_bytes(*length) as usize)?;
        let head: Head = serde_json::from_slice(head).ok()?;
        let (frames, []) = frames.as_chunks::<24>() else { return None };
        if head.of != self.of || frames.len() as u64 != head.frames {
            return None;
        }
        let word = |frame: &[u8; 24], at: usize| {
            u64::from_le_bytes(frame[8 * at..8 * at + 8].try_into().expect("three words"))
        };
        let span = |frame| Span {
            offset: word(frame, 0),
            line: word(frame, 1),
            bytes: word(frame, 2).checked_sub(1),
        };
        let Head { cut, doubt, units, title, .. } = head;
        Some(Index { frames: frames.iter().map(span).collect(), cut, doubt, units, title, files: Vec::new() })
    }

    /// Keeps an index. A failure only costs the next run its time.
    pub(crate) fn keep(&self, index: &Index) {
        let Index { frames, cut, doubt, units, title, .. } = index;
        let head = Head {
            of: self.of.clone(),
            cut: *cut,
            doubt: doubt.clone(),
            units: units.clone(),
            title: title.clone(),
            frames: frames.len() as u64,
        };
        let Ok(head) = serde_json::to_vec(&head) else { return };
        let mut bytes = MAGIC.to_vec();
        bytes.extend((head.len() as u64).to_le_bytes());
        bytes.extend(head);
        for Span { offset, line, bytes: size } in frames {
            for word in [*offset, *line, size.map_or(0, |it| it + 1)] {
                bytes.extend(word.to_le_bytes());
            }
        }
        bytes.extend(XxHash3_64::oneshot(&bytes).to_le_bytes());
        let folder = self.place.parent().unwrap_or(Path::new("."));
        if fs::create_dir_all(folder).is_ok()
            && atomically(&self.place, |file| file.write_all(&bytes)).is_ok()
        {
            forget_the_oldest(folder);
        }
    }
}

/// Removes what is beyond the most that is kept.
fn forget_the_oldest(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    let with_age = |entry: fs::DirEntry| Some((entry.metadata().ok()?.modified().ok()?, entry.path()));
    let mut entries: Vec<_> = entries.flatten().filter_map(with_age).collect();
    entries.sort_unstable();
    for (_, path) in &entries[..entries.len().saturating_sub(MOST)] {
        // Another process may have been faster.
        let _ = fs::remove_file(path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn index() -> Index {
        let span =
            |k: u64| Span { offset: 100 * k, line: 9 * k + 1, bytes: k.is_multiple_of(2).then_some(k) };
        Index {
            frames: (0..5).map(span).collect(),
            cut: true,
            units: Some("metal".into()),
            ..Index::default()
        }
    }

    /// A file of that length that was changed so many seconds ago.
    fn file(path: &Path, bytes: u64, age: u64) {
        let file = fs::File::create(path).unwrap();
        file.set_len(bytes).unwrap();
        file.set_modified(SystemTime::now() - Duration::from_secs(age)).unwrap();
    }

    #[test]
    fn an_index_is_that_of_its_file_and_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.dump");
        file(&path, WORTH, 100);
        let kept = folder.path().join("kept/indexes");
        let place = || Place::of(&kept, &path, "XYZ").unwrap();
        assert!(place().load().is_none());
        place().keep(&index());
        assert_eq!(format!("{:?}", place().load().unwrap()), format!("{:?}", index()));
        assert!(Place::of(&kept, &path, "LAMMPS dump").unwrap().load().is_none());
        // Longer, or changed at another time.
        file(&path, WORTH + 1, 100);
        assert!(place().load().is_none());
        file(&path, WORTH, 200);
        assert!(place().load().is_none());
    }

    #[test]
    fn a_sequence_keeps_its_index_and_uses_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.xyz");
        let frame = |comment: &str| format!("2\n{comment}\nCu 1 2 3\nCu 4 5 6\n");
        let text = |long: usize| frame("") + &frame(&"x".repeat(4 << 20)).repeat(long);
        fs::write(&path, text(4)).unwrap();
        let age = |path: &Path| {
            let file = fs::File::options().write(true).open(path).unwrap();
            file.set_modified(SystemTime::now() - Duration::from_secs(100)).unwrap();
        };
        age(&path);
        let kept = folder.path().join("kept");
        let options = crate::Options { index_folder: Some(kept.clone()), ..Default::default() };
        let open = || crate::Sequence::open(std::slice::from_ref(&path), &options, &()).unwrap();
        assert_eq!(open().len(), 5);
        let last = || open().frame(open().len() - 1, &()).unwrap().particles.world_position(1);
        assert_eq!(last(), [4.0, 5.0, 6.0]);
        // One that knows of fewer frames is believed, until the file changes.
        let place = Place::of(&kept, &path, "XYZ").unwrap();
        let mut index = place.load().unwrap();
        index.frames.truncate(3);
        place.keep(&index);
        assert_eq!((open().len(), last()), (3, [4.0, 5.0, 6.0]));
        fs::write(&path, text(5)).unwrap();
        assert_eq!(open().len(), 6);
        age(&path);
        assert_eq!(
            (open().len(), Place::of(&kept, &path, "XYZ").unwrap().load().unwrap().frames.len()),
            (6, 6)
        );
    }

    #[test]
    fn damage_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.dump");
        file(&path, WORTH, 100);
        let place = Place::of(folder.path(), &path, "XYZ").unwrap();
        place.keep(&index());
        let whole = fs::read(&place.place).unwrap();
        for at in 0..whole.len() {
            let mut damaged = whole.clone();
            damaged[at] ^= 4;
            fs::write(&place.place, damaged).unwrap();
            assert!(place.load().is_none(), "byte {at}");
            fs::write(&place.place, &whole[..at]).unwrap();
            assert!(place.load().is_none(), "cut at {at}");
        }
    }

    #[test]
    fn short_and_fresh_files_have_none_and_the_oldest_go() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.dump");
        file(&path, WORTH - 1, 100);
        assert!(Place::of(folder.path(), &path, "XYZ").is_none());
        file(&path, WORTH, 0);
        assert!(Place::of(folder.path(), &path, "XYZ").is_none());
        assert!(Place::of(folder.path(), Path::new("no such file"), "XYZ").is_none());
        let kept = folder.path().join("kept");
        fs::create_dir(&kept).unwrap();
        (0..MOST as u64 + 3).for_each(|k| file(&kept.join(k.to_string()), 0, 10_000 + k));
        forget_the_oldest(&kept);
        let left = |k: usize| kept.join(k.to_string()).exists();
        assert!(left(MOST - 1) && !left(MOST) && !left(MOST + 2));
    }
}
