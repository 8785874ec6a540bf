//! Files that are cut short: an error that names the file, or the whole frames before the cut, never a part of a frame in silence.

use std::path::PathBuf;

use crate::attempt::Seen;
use crate::files::{Folder, name, samples, shared};
use crate::watch::watched;

/// Where a file is cut: all over it, at ends of lines, at multiples of eight, and within its last bytes.
fn places(bytes: &[u8]) -> Vec<usize> {
    let spread = (1..=38).map(|k| {
        let place = bytes.len() * k / 39;
        match k % 3 {
            0 => memchr(&bytes[place..]).map_or(place, |end| place + end + 1),
            1 => place / 8 * 8,
            _ => place,
        }
    });
    let mut places: Vec<usize> = spread.chain((1..=12).map(|k| bytes.len().saturating_sub(k))).collect();
    places.retain(|&it| it > 0 && it < bytes.len());
    places.sort();
    places.dedup();
    places
}

fn memchr(bytes: &[u8]) -> Option<usize> {
    bytes.iter().take(4096).position(|&it| it == b'\n')
}

/// What a cut file does in silence that its format gives no means to notice.
fn cannot_be_noticed(name: &str, bytes: &[u8], cut: usize) -> bool {
    let at_line = bytes[cut - 1] == b'\n' || bytes[cut] == b'\n' || bytes[cut] == b'\r';
    match name.rsplit('.').next() {
        // Tables and IMD tell nowhere how many rows they have.
        Some("csv" | "imd") => at_line,
        // Between two blocks a file ends that has fewer quantities, of all its particles.
        Some("vtk") => {
            [&b"POINT_DATA"[..], b"FIELD"].iter().any(|it| bytes[cut..].trim_ascii_start().starts_with(it))
        }
        Some("gadget2") => {
            bytes[cut..].get(4..8).is_some_and(|it| it.is_ascii())
                && bytes[cut..].get(..4) == Some(&[0, 0, 0, 8])
        }
        _ => false,
    }
}

/// Cuts files at fifty places each; says what was wrong.
fn check(files: &[PathBuf], neighbors: &[PathBuf]) {
    let folder = Folder::with_neighbors(&format!("cut-{}", files.len()), neighbors);
    let mut wrong = Vec::new();
    for file in files {
        let (bytes, name) = (std::fs::read(file).unwrap(), name(file));
        let path = folder.file(&name, &bytes);
        let whole = match watched(&path, content_bytes(&bytes)) {
            Ok(Ok(whole)) => whole,
            Ok(Err(_)) => Vec::new(),
            Err(error) => {
                wrong.push(format!("{name}: {error}"));
                continue;
            }
        };
        for cut in places(&bytes) {
            std::fs::write(&path, &bytes[..cut]).unwrap();
            let what = format!("{name} cut to {cut} of {} bytes", bytes.len());
            let frames = match watched(&path, content_bytes(&bytes)) {
                Ok(Ok(frames)) => frames,
                Ok(Err(_)) => continue,
                Err(error) => {
                    wrong.push(format!("{what}: {error}"));
                    continue;
                }
            };
            let at_end_of_frame = || {
                let before = bytes[..cut].trim_ascii_end().len().saturating_sub(3);
                std::fs::write(&path, &bytes[..before]).unwrap();
                let before = watched(&path, content_bytes(&bytes));
                !matches!(before, Ok(Ok(before)) if is_silent(&before, &whole) && before.len() == frames.len())
            };
            let same = same(&frames, &whole);
            let silent =
                is_silent(&frames, &whole) && (!same || frames.len() != whole.len() && !at_end_of_frame());
            if silent && !cannot_be_noticed(&name, &bytes, cut) {
                let counts = |frames: &[Seen]| frames.iter().map(|it| it.particles).collect::<Vec<_>>();
                let (found, all) = (counts(&frames), counts(&whole));
                wrong.push(format!("{what}: {found:?} of {all:?} particles in silence, the same: {same}"));
            }
        }
        std::fs::write(&path, &bytes).unwrap();
    }
    assert!(wrong.is_empty(), "{} faults:\n{}", wrong.len(), wrong.join("\n"));
}

/// Whether all frames are those of the whole file.
fn same(frames: &[Seen], whole: &[Seen]) -> bool {
    frames.iter().zip(whole).all(|(cut, all)| cut.hash == all.hash && cut.particles == all.particles)
}

/// Whether no frame has a warning that the whole file has not.
fn is_silent(frames: &[Seen], whole: &[Seen]) -> bool {
    let known = |warning: &String| whole.iter().any(|it| it.warnings.contains(warning));
    frames.iter().all(|it| it.warnings.iter().all(known))
}

/// How much there is once it is unpacked.
pub(crate) fn content_bytes(bytes: &[u8]) -> usize {
    bytes.len() * if bytes.starts_with(&[0x1f, 0x8b]) { 20 } else { 1 }
}

#[test]
fn samples_that_are_cut_say_so() {
    let files = samples();
    check(&files, &files);
}

#[test]
fn real_files_that_are_cut_say_so() {
    check(&shared(3 << 20), &[]);
}

#[test]
fn a_frame_with_another_value_and_a_word_about_it_are_noticed() {
    let frame = |hash, warnings: &[&str]| Seen {
        particles: 3,
        hash,
        warnings: warnings.iter().map(|it| it.to_string()).collect(),
    };
    let whole = [frame(1, &["known"]), frame(2, &[])];
    assert!(same(&[frame(1, &[])], &whole) && is_silent(&[frame(1, &["known"])], &whole));
    assert!(!same(&[frame(1, &[]), frame(3, &[])], &whole));
    assert!(!same(&[Seen { particles: 2, ..frame(1, &[]) }], &whole));
    assert!(!is_silent(&[frame(1, &["it is cut"])], &whole));
}
