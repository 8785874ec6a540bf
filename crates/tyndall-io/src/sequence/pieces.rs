//! Frames that are spread over files: `dump.%`, one for each processor, or group of processors, that wrote.
//!
//! The first `%` of a name stands for the number of a piece: 0, 1, … without a gap, each a file of as many frames. Frame by frame the
//! pieces follow each other as if one had written them. Source: LAMMPS documentation of `dump`, and of `nfile` and `fileper` of
//! `dump_modify`.

use std::io;
use std::path::{Path, PathBuf, is_separator};

use rayon::prelude::*;
use tyndall::{Error, Progress, Result};

use super::file::{Asked, FileSource, file_name};
use super::{Frame, Options, Source};
use crate::read::{Feature, Others, Span, TakePiece};
use crate::topology::Topology;

/// So many compressed files are kept open at the place where the next frame begins; systems often allow a thousand.
const MOST_OPEN: usize = 256;

/// Whether a name has a place for the number of a piece: a `%` that no `d` follows, as in `%04d`, with or without digits between.
pub fn has_place(name: &Path) -> bool {
    name.to_str().is_some_and(|name| place(name).is_some())
}

fn place(name: &str) -> Option<usize> {
    let is_lone =
        |&at: &usize| !name[at + 1..].trim_start_matches(|it: char| it.is_ascii_digit()).starts_with('d');
    name.match_indices('%').map(|(at, _)| at).find(is_lone)
}

/// The files of the pieces of which `name` is the name, by their numbers; `None` if it has no place for a number, or there is a file of
/// that very name. Fails if there are none, and where a number is missing between others.
pub(super) fn files(name: &Path) -> Result<Option<Vec<PathBuf>>> {
    let Some((text, at)) = name.to_str().and_then(|text| Some((text, place(text)?))) else { return Ok(None) };
    if name.exists() {
        return Ok(None);
    }
    // The number may stand in the name of a folder: FOLDER/HEAD%TAIL/REST.
    let (before, after) = (&text[..at], &text[at + 1..]);
    let (folder, head) = before.split_at(before.rfind(is_separator).map_or(0, |at| at + 1));
    let (tail, rest) = after.split_at(after.find(is_separator).unwrap_or(after.len()));
    let entries = std::fs::read_dir(if folder.is_empty() { "." } else { folder });
    let numbered = |entry: io::Result<std::fs::DirEntry>| {
        let entry = entry.ok()?.file_name();
        let digits = entry.to_str()?.strip_prefix(head)?.strip_suffix(tail)?;
        let number: usize = digits.parse().ok().filter(|_| digits.bytes().all(|it| it.is_ascii_digit()))?;
        let path = PathBuf::from(format!("{before}{digits}{after}"));
        (rest.is_empty() || path.exists()).then_some((number, digits.len(), path))
    };
    let mut found: Vec<(usize, usize, PathBuf)> =
        entries.into_iter().flatten().filter_map(numbered).collect();
    found.sort_unstable();
    let Some((last, width, _)) = found.last() else {
        return Err(Error::io(name, io::Error::new(io::ErrorKind::NotFound, "no file has such a name")));
    };
    // Numbers are written with zeros in front if the first one is.
    let width = if found[0].1 > 1 { *width } else { 1 };
    for (wanted, (number, _, path)) in found.iter().enumerate() {
        if *number < wanted {
            let what = format!("there are two files of piece {number}");
            return Err(Error::format(path, "", what, "are they of one dump?"));
        }
        if *number > wanted {
            let missing = format!("{before}{wanted:0width$}{after}");
            let what = format!("this piece is missing, of those from 0 to {last}");
            return Err(Error::format(
                missing,
                "",
                what,
                "was everything copied? files of one dump only have such names",
            ));
        }
    }
    Ok(Some(found.into_iter().map(|(_, _, path)| path).collect()))
}

/// The files over which frames are spread.
pub(super) struct Pieces {
    pub(super) name: PathBuf,
    pub(super) files: Vec<FileSource>,
    pub(super) frame_count: usize,
    /// What is wrong with them as a whole.
    warnings: Vec<String>,
}

impl Pieces {
    /// Opens the files of which `name` is the name.
    pub(super) fn open(
        name: &Path,
        paths: &[PathBuf],
        options: &Options,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let open = |path: &PathBuf| match progress.cancelled() {
            true => Err(Error::Interrupted),
            false => FileSource::open(path, options, false, progress),
        };
        let mut files: Vec<FileSource> = paths.par_iter().map(open).collect::<Result<_>>()?;
        let format = files[0].format;
        if !format.has(Feature::Pieces) {
            let what = format!("files of the format {} are no pieces of frames", format.title);
            let hint = format!(
                "give them without %, as frames by themselves; in pieces are {}",
                Feature::Pieces.formats()
            );
            return Err(Error::format(&files[0].path, "", what, hint));
        }
        if let Some(other) = files.iter().find(|it| it.format.title != format.title) {
            let [one, first] = [other.format.title, format.title];
            let what = format!(
                "this piece is of the format {one}, {} of the format {first}",
                file_name(&files[0].path)
            );
            return Err(Error::format(&other.path, "", what, "are they of one dump?"));
        }
        let mut warnings: Vec<String> = files.iter_mut().filter_map(|file| file.warning.take()).collect();
        if warnings.len() > 2 {
            let more = format!("{} more pieces are like that", warnings.len() - 1);
            warnings = vec![warnings.swap_remove(0), more];
        }
        let by_frames = |file: &&FileSource| file.index.frames.len();
        let (Some(least), Some(most)) =
            (files.iter().min_by_key(by_frames), files.iter().rev().max_by_key(by_frames))
        else {
            return Err(Error::setting("input", name.display(), "give at least one file"));
        };
        let frame_count = by_frames(&least);
        if frame_count < by_frames(&most) {
            let frames = |of: &FileSource| counted(of.index.frames.len(), "frame");
            let what = format!("{}, {} has {}", frames(least), file_name(&most.path), frames(most));
            if options.strict {
                let hint = format!("without --strict the first {frame_count} frames are read");
                return Err(Error::format(&least.path, "", format!("this piece has {what}"), hint));
            }
            warnings.push(format!(
                "{} has {what} — the first {frame_count} are read (use --strict to fail)",
                file_name(&least.path)
            ));
        }
        Ok(Self { name: name.to_path_buf(), files, frame_count, warnings })
    }

    /// Reads a frame.
    pub(super) fn frame(
        &self,
        frame: usize,
        options: &Options,
        topology: Option<&Topology>,
        progress: &dyn Progress,
    ) -> Result<Frame> {
        let rest = Rest { files: &self.files[1..], frame, options };
        let mut frame = self.files[0].frame(frame, Asked { options, topology, others: &rest }, progress)?;
        frame.warnings.extend(self.warnings.iter().cloned());
        Ok(frame)
    }
}

/// `1 frame` or `2 frames`.
fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// The files behind the first one, of which a frame is read.
struct Rest<'a> {
    files: &'a [FileSource],
    frame: usize,
    options: &'a Options,
}

impl Others for Rest<'_> {
    fn places(&self) -> Vec<(&Path, Span)> {
        self.files.iter().map(|file| (&*file.path, file.index.frames[self.frame])).collect()
    }

    fn texts(&self, take: &mut TakePiece, progress: &dyn Progress) -> Result<()> {
        let asked = Asked { options: self.options, topology: None, others: &() };
        for (place, file) in self.files.iter().enumerate() {
            file.text(self.frame, asked, progress, &mut *take)?;
            if place >= MOST_OPEN {
                file.close();
            }
        }
        Ok(())
    }
}

/// Warns where frames have fewer pieces than those beside them: the last ones may not have been copied.
pub(super) fn compare(sources: &mut [Source]) {
    let counts: Vec<Option<(usize, String)>> = sources
        .iter()
        .map(|source| match source {
            Source::Pieces(pieces) => Some((pieces.files.len(), file_name(&pieces.name))),
            _ => None,
        })
        .collect();
    for (place, source) in sources.iter_mut().enumerate() {
        let Source::Pieces(pieces) = source else { continue };
        let beside = [place.wrapping_sub(1), place + 1].map(|it| counts.get(it)?.as_ref());
        if let Some((count, other)) =
            beside.into_iter().flatten().find(|(count, _)| *count > pieces.files.len())
        {
            pieces.warnings.push(format!(
                "{} has {}, {other} has {count}: is one missing?",
                file_name(&pieces.name),
                counted(pieces.files.len(), "piece")
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_percent_sign_alone_is_the_place_of_a_piece() {
        for (name, expected) in [
            ("dump.%", true),
            ("dump.%.bin", true),
            ("p%/dump.100.txt", true),
            ("dump.%04d.%.bin", true),
            ("dump.%04d.bin", false),
            ("dump.%d", false),
            ("dump.bin", false),
            ("ä%4", true),
        ] {
            assert_eq!(has_place(Path::new(name)), expected, "{name}");
        }
    }

    #[test]
    fn pieces_are_found_by_their_numbers() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let found = |name: &str| {
            let files = files(&path(name)).map_err(|error| error.to_string())?;
            let names =
                |files: Vec<PathBuf>| files.iter().map(|it| file_name(it)).collect::<Vec<_>>().join(" ");
            Ok(files.map(names))
        };
        (0..11).for_each(|k| std::fs::write(path(&format!("a.{k}.txt")), "").unwrap());
        let all = (0..11).map(|k| format!("a.{k}.txt")).collect::<Vec<_>>().join(" ");
        assert_eq!(found("a.%.txt"), Ok(Some(all)));
        assert_eq!(found("a.txt"), Ok(None));
        assert!(found("b.%.txt").is_err_and(|it: String| it.contains("no file has such a name")));
        std::fs::remove_file(path("a.4.txt")).unwrap();
        let message = found("a.%.txt").unwrap_err();
        assert!(message.contains("a.4.txt") && message.contains("from 0 to 10"), "{message}");
        ["b00", "b02"].iter().for_each(|name| std::fs::write(path(name), "").unwrap());
        assert!(found("b%").is_err_and(|it| it.contains("b01")));
        std::fs::write(path("b0"), "").unwrap();
        assert!(found("b%").is_err_and(|it| it.contains("two files of piece 0")));
        std::fs::write(path("b%"), "").unwrap();
        assert_eq!(found("b%"), Ok(None), "a file of that very name");
        for k in 0..2 {
            std::fs::create_dir(path(&format!("p{k}"))).unwrap();
            std::fs::write(path(&format!("p{k}/dump")), "").unwrap();
        }
        std::fs::create_dir(path("p2")).unwrap();
        assert_eq!(found("p%/dump"), Ok(Some("dump dump".into())));
    }
}
