//! Files by patterns, and the numbers of their frames.
//!
//! A name that is no file may have a place for a number (`spray.####.prt`, `%04d`, `$F4`): it stands for all files with a number there, in
//! its order, and frames are then called by these numbers. Or it may have `*`, `?` and `[...]`, which shells leave to us in quotes. A `%` for the
//! pieces of a frame stays one: see [`tyndall_io::Sequence::open`].

use std::cmp::Ordering;
use std::io;
use std::path::{Path, PathBuf};

use tyndall::{Error, Result};
use tyndall_io::read::TimeCode;
use tyndall_io::sequence::is_in_pieces;

use crate::input::args::Input;
use crate::output::Pattern;
use crate::report::{Failure, Outcome};
use crate::values::{Slice, frame as frame_number};

/// Puts files in the place of patterns. Fails if there are none of such a name.
pub(crate) fn expand(input: &mut Input) -> Outcome<()> {
    let mut files = Vec::with_capacity(input.files.len());
    let mut numbers = Vec::new();
    let patterns = input.files.len();
    for name in std::mem::take(&mut input.files) {
        let pattern = Pattern::new(&name);
        let is_literal = name.exists() || name.to_str().is_none_or(|it| it.starts_with("synthetic:"));
        if is_literal {
            files.push(name);
        } else if pattern.is_numbered() {
            let found = numbered(&name, &pattern)?;
            numbers.extend(found.iter().map(|(number, _)| *number));
            files.extend(found.into_iter().map(|(_, path)| path));
        } else if name.to_string_lossy().contains(['*', '?', '[']) {
            files.extend(globbed(&name)?);
        } else {
            files.push(name);
        }
    }
    input.files = files;
    input.numbers =
        Some(numbers).filter(|it| patterns == 1 && it.len() == input.files.len() && !it.is_empty());
    Ok(())
}

/// The error about a pattern that no file has.
fn none_of(name: &Path) -> Failure {
    Error::io(name, io::Error::new(io::ErrorKind::NotFound, "no file has such a name")).into()
}

/// The files that have a number where a pattern has a place for it, by the numbers.
fn numbered(name: &Path, pattern: &Pattern) -> Outcome<Vec<(usize, PathBuf)>> {
    let folder = match name.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let entries = std::fs::read_dir(folder).map_err(|_| none_of(name))?;
    let of_entry = |entry: std::fs::DirEntry| {
        let path = name.with_file_name(entry.file_name());
        names_of(name, path).into_iter().find_map(|path| Some((pattern.number(&path)?, path)))
    };
    let mut found: Vec<(usize, PathBuf)> = entries.flatten().filter_map(of_entry).collect();
    found.sort_unstable();
    found.dedup();
    if found.is_empty() { Err(none_of(name)) } else { Ok(found) }
}

/// The names that a file may have for a pattern: its own, or, where the pattern has a place for the number of a piece, those with such a
/// place instead of one of its numbers.
fn names_of(pattern: &Path, path: PathBuf) -> Vec<PathBuf> {
    let Some(text) = path.to_str().filter(|_| is_in_pieces(pattern)) else { return vec![path] };
    let is_digit = |at: usize| text.as_bytes().get(at).is_some_and(u8::is_ascii_digit);
    let starts = (0..text.len()).filter(|&at| is_digit(at) && (at == 0 || !is_digit(at - 1)));
    let ended = |start: usize| (start..).find(|&at| !is_digit(at)).map(|end| (start, end));
    starts
        .filter_map(ended)
        .map(|(start, end)| format!("{}%{}", &text[..start], &text[end..]).into())
        .collect()
}

/// The files that are like a pattern; numbers in their names count as numbers.
fn globbed(name: &Path) -> Outcome<Vec<PathBuf>> {
    let wrong =
        |error: glob::PatternError| Failure::from(Error::setting("FILE", name.display(), error.to_string()));
    let text = name.to_string_lossy();
    let pattern = glob::Pattern::new(&text).map_err(wrong)?;
    let options = glob::MatchOptions { require_literal_separator: true, ..Default::default() };
    let paths = match is_in_pieces(name) {
        true => glob::glob(&text.replace('%', "*")),
        false => glob::glob(&text),
    };
    let files = paths.map_err(wrong)?.flatten().filter(|path| path.is_file());
    let is_alike = |path: &PathBuf| !is_in_pieces(name) || pattern.matches_path_with(path, options);
    let mut found: Vec<PathBuf> =
        files.filter_map(|path| names_of(name, path).into_iter().find(is_alike)).collect();
    found.sort_unstable_by(|a, b| natural(&a.to_string_lossy(), &b.to_string_lossy()));
    found.dedup();
    if found.is_empty() { Err(none_of(name)) } else { Ok(found) }
}

/// The order in which `run.9` comes before `run.10`.
fn natural(a: &str, b: &str) -> Ordering {
    let (mut a, mut b) = (a, b);
    loop {
        let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
        let (in_a, in_b) = (digits(a), digits(b));
        if in_a > 0 && in_b > 0 {
            let [one, other] = [a[..in_a].trim_start_matches('0'), b[..in_b].trim_start_matches('0')];
            let by_value = one.len().cmp(&other.len()).then_with(|| one.cmp(other)).then(in_a.cmp(&in_b));
            if by_value != Ordering::Equal {
                return by_value;
            }
            (a, b) = (&a[in_a..], &b[in_b..]);
            continue;
        }
        match (a.chars().next(), b.chars().next()) {
            (Some(one), Some(other)) if one == other => {
                (a, b) = (&a[one.len_utf8()..], &b[other.len_utf8()..]);
            }
            (one, other) => return one.cmp(&other),
        }
    }
}

/// The frames of a sequence by their numbers: those in the names of the files, if there is one, else counted from 0.
pub(crate) struct Numbers {
    count: usize,
    /// In ascending order.
    of_files: Option<Vec<usize>>,
}

impl Numbers {
    /// Of a sequence of so many frames.
    pub(crate) fn of(input: &Input, count: usize) -> Self {
        Self { count, of_files: input.numbers.clone().filter(|numbers| numbers.len() == count) }
    }

    /// How many frames there are.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// The number of a frame, which is counted from 0.
    pub(crate) fn number(&self, frame: usize) -> usize {
        self.of_files.as_ref().map_or(frame, |numbers| numbers[frame])
    }

    /// The time of a frame on a stage's clock: the number of its file, else counted from the start.
    pub(crate) fn time_code(&self, frame: usize) -> TimeCode {
        match &self.of_files {
            Some(numbers) => TimeCode::At(numbers[frame] as f64),
            None => TimeCode::FromStart(frame as f64),
        }
    }

    /// The frame of a number; negative ones count from the end.
    fn frame(&self, number: i64) -> Result<usize> {
        let Some(numbers) = self.of_files.as_ref().filter(|_| number >= 0) else {
            return frame_number(number, self.count);
        };
        let (first, last) = (numbers[0], numbers[self.count - 1]);
        let allowed = || format!("no file has this number; they are from {first} to {last}, -1 is the last");
        numbers.binary_search(&(number as usize)).map_err(|_| Error::setting("--frame", number, allowed()))
    }

    /// The frames of a slice: START and STOP are numbers, STEP counts frames.
    fn slice(&self, slice: &Slice) -> Vec<usize> {
        match &self.of_files {
            None => slice.of(self.count),
            Some(numbers) => slice.among(numbers),
        }
    }

    /// Which frames are taken: the one, those of the slice, or all if `takes_all`, else the first.
    pub(crate) fn chosen(
        &self,
        frame: Option<i64>,
        frames: Option<&Slice>,
        takes_all: bool,
    ) -> Outcome<Vec<usize>> {
        let chosen = match (frame, frames) {
            (Some(number), _) => vec![self.frame(number)?],
            (None, Some(slice)) => self.slice(slice),
            (None, None) if takes_all => (0..self.count).collect(),
            (None, None) => vec![0],
        };
        if chosen.is_empty() {
            let [first, last] = [0, self.count - 1].map(|frame| self.number(frame));
            let text = format!("--frames takes no frame — it takes none of the frames {first} to {last}");
            return Err(Failure::Usage(text));
        }
        Ok(chosen)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_count_as_numbers() {
        let mut names = ["run.10", "run.9", "run.010", "a2b3", "a2b12", "a10b1", "run.", "é2", "é10", "run"];
        names.sort_unstable_by(|a, b| natural(a, b));
        assert_eq!(
            names,
            ["a2b3", "a2b12", "a10b1", "run", "run.", "run.9", "run.10", "run.010", "é2", "é10"]
        );
    }

    #[test]
    fn frames_are_called_by_the_numbers_of_their_files() {
        let numbers = Numbers { count: 5, of_files: Some(vec![101, 102, 104, 110, 120]) };
        assert_eq!((numbers.frame(104).unwrap(), numbers.frame(-1).unwrap(), numbers.number(3)), (2, 4, 110));
        assert!(numbers.frame(103).unwrap_err().to_string().contains("they are from 101 to 120"));
        for (slice, expected) in [
            (":", vec![0, 1, 2, 3, 4]),
            ("102:120", vec![1, 2, 3]),
            ("103:", vec![2, 3, 4]),
            ("::2", vec![0, 2, 4]),
            ("-2:", vec![3, 4]),
            ("110", vec![3]),
            ("::-1", vec![4, 3, 2, 1, 0]),
            ("115:101:-2", vec![3, 1]),
            ("0:50", vec![]),
        ] {
            assert_eq!(numbers.slice(&slice.parse().unwrap()), expected, "{slice}");
        }
        let plain = Numbers { count: 5, of_files: None };
        assert_eq!(
            (plain.frame(4).unwrap(), plain.number(4), plain.slice(&"1:3".parse().unwrap())),
            (4, 4, vec![1, 2])
        );
    }
}
