//! What the snapshots of cosmological and galactic simulations have in common: types of particles, files that belong together.

use std::path::{Path, PathBuf};

use tyndall::particles::{Attribute, Values};
use tyndall::{Error, Result};

use crate::sequence::Options;

/// A type of particles: its name, then other words for it that are understood.
pub(crate) type TypeNames = &'static [&'static str];

/// Gadget's six types, which AREPO and GIZMO share.
pub(crate) const GADGET_TYPES: [TypeNames; 6] = [
    &["gas"],
    &["halo", "dark", "dm"],
    &["disk"],
    &["bulge"],
    &["star", "stars"],
    &["boundary", "bndry", "bh", "blackhole"],
];

/// Which of the types the caller wants, by name or number: all if nothing is said.
pub(crate) fn wanted(options: &Options, types: &[TypeNames]) -> Result<Vec<bool>> {
    let Some(words) = &options.types else { return Ok(vec![true; types.len()]) };
    let mut wanted = vec![false; types.len()];
    for word in words.iter().map(|it| it.trim()) {
        let named = types.iter().position(|names| names.iter().any(|name| name.eq_ignore_ascii_case(word)));
        let numbered = || word.parse::<usize>().ok().filter(|&number| number < types.len());
        let place = named.or_else(numbered).ok_or_else(|| {
            let names: Vec<&str> = types.iter().map(|names| names[0]).collect();
            Error::setting("type", word, format!("{}, or 0 to {}", names.join(", "), types.len() - 1))
        })?;
        wanted[place] = true;
    }
    Ok(wanted)
}

/// The error where none of the wanted types has a particle; `present` are those that have.
pub(crate) fn none_wanted(options: &Options, present: &[&str]) -> Error {
    let words = options.types.as_ref().map_or(String::new(), |words| words.join(","));
    let there = if present.is_empty() { "none".to_string() } else { present.join(", ") };
    Error::setting("type", words, format!("a type that has particles here: {there}"))
}

/// The attribute `type`, as words, of runs of particles: the name of each run and its length.
pub(crate) fn type_attribute<'a>(runs: impl IntoIterator<Item = (&'a str, usize)>) -> Attribute {
    let (mut names, mut codes) = (Vec::<String>::new(), Vec::new());
    for (name, count) in runs {
        let known = names.iter().position(|it| it == name);
        let code = known.unwrap_or_else(|| {
            names.push(name.to_string());
            names.len() - 1
        });
        codes.resize(codes.len() + count, code as u32);
    }
    Attribute::new("type", 1, Values::Text { codes, names })
}

/// The files over which the snapshot of which `path` is a part is spread, in order: `snap.0`, `snap.1`, … or `snap.0.hdf5`, …
/// `None` if there is but one, or if the name has no number.
pub(crate) fn siblings(path: &Path, count: usize) -> Option<Vec<PathBuf>> {
    if count < 2 {
        return None;
    }
    let name = path.file_name()?.to_str()?;
    let words: Vec<&str> = name.split('.').collect();
    let is_number = |word: &&str| word.parse::<usize>().is_ok_and(|number| number < count);
    let place = words.iter().rposition(is_number).filter(|&place| place > 0)?;
    let digits = words[place].len();
    let padded = digits > 1 && words[place].starts_with('0');
    let sibling = |number: usize| {
        let number = if padded { format!("{number:0digits$}") } else { number.to_string() };
        let mut words = words.clone();
        words[place] = &number;
        path.with_file_name(words.join("."))
    };
    // More numbers than files that could be there are a damaged header.
    (count <= 1 << 16).then(|| (0..count).map(sibling).collect())
}

/// The files of a snapshot of which `path` is one of `count`: those that are there, and what is to be said about the others.
pub(crate) fn files(path: &Path, count: usize, strict: bool) -> Result<(Vec<PathBuf>, Option<String>)> {
    let Some(all) = siblings(path, count) else {
        let warning = (count > 1).then(|| {
            format!(
                "this is one of {count} files of a snapshot, but its name has no number by which to find the others: \
                 only its own particles are read"
            )
        });
        return Ok((vec![path.to_path_buf()], warning));
    };
    let (there, missing): (Vec<_>, Vec<_>) = all.into_iter().partition(|it| it == path || it.exists());
    if missing.is_empty() {
        return Ok((there, None));
    }
    let name = missing[0].file_name().unwrap_or_default().to_string_lossy().into_owned();
    let what = format!("missing: {} of the snapshot's {count} files, first {name}", missing.len());
    if strict {
        return Err(Error::format(path, "", what, "without --strict the others are read"));
    }
    Ok((there, Some(format!("{what}: the others are read (use --strict to fail)"))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_are_chosen_by_name_or_number() {
        let choose = |words: &[&str]| {
            let types = Some(words.iter().map(|it| it.to_string()).collect());
            wanted(&Options { types, ..Options::default() }, &GADGET_TYPES)
        };
        assert_eq!(choose(&["Gas", "4"]).unwrap(), [true, false, false, false, true, false]);
        assert_eq!(choose(&["dm"]).unwrap(), [false, true, false, false, false, false]);
        assert!(wanted(&Options::default(), &GADGET_TYPES).unwrap().iter().all(|&it| it));
        let message = choose(&["6"]).unwrap_err().to_string();
        assert!(message.contains("gas, halo, disk, bulge, star, boundary, or 0 to 5"), "{message}");
    }

    #[test]
    fn siblings_are_named_by_their_number() {
        let names = |path: &str, count| {
            let files = siblings(Path::new(path), count)?;
            Some(files.iter().map(|it| it.to_string_lossy().into_owned()).collect::<Vec<_>>())
        };
        assert_eq!(names("a.5/snap_010.0", 2).unwrap(), ["a.5/snap_010.0", "a.5/snap_010.1"]);
        assert_eq!(names("s.1.hdf5", 2).unwrap(), ["s.0.hdf5", "s.1.hdf5"]);
        assert_eq!(names("s.00.gz", 2).unwrap(), ["s.00.gz", "s.01.gz"]);
        assert_eq!(names("snap_010", 4), None);
        assert_eq!(names("0", 4), None);
        assert_eq!(names("s.0", 1), None);
        assert_eq!(names("s.0", usize::MAX), None);
    }

    #[test]
    fn a_type_that_returns_keeps_its_word() {
        let attribute = type_attribute([("gas", 2), ("star", 1), ("gas", 1)]);
        let names = vec!["gas".to_string(), "star".to_string()];
        assert_eq!(attribute.values, Values::Text { codes: vec![0, 0, 1, 0], names });
    }
}
