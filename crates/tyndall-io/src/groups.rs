//! Groups of atoms of a GROMACS index file: which atoms of a topology a trajectory has.
//!
//! A name in brackets begins a group; the numbers of its atoms follow, from 1, between blanks, on as many lines as they take. What follows `;`
//! is a comment. Source: GROMACS reference manual, file format ndx.

use std::path::{Path, PathBuf};

use tyndall::scene::grouped;
use tyndall::{Error, Result};

use crate::read;

/// The setting's name.
pub(crate) const SETTING: &str = "--index";
const HINT: &str = "write it with gmx make_ndx: [ NAME ], and numbers of atoms from 1 on the lines behind it";
/// So many groups are named in a message.
const LISTED: usize = 12;

/// Atoms of a topology, in the order of a trajectory.
#[derive(Debug, PartialEq)]
pub(crate) struct Group {
    /// Its name.
    pub(crate) name: String,
    /// Their places in the topology, from 0.
    pub(crate) atoms: Vec<u32>,
}

/// The groups of a file.
#[derive(Debug)]
pub(crate) struct Groups {
    pub(crate) path: PathBuf,
    groups: Vec<Group>,
    /// The name or number of the one that is asked for.
    asked: Option<String>,
}

impl Groups {
    /// Reads `FILE`, or `FILE:GROUP` where there is no file of that whole name.
    pub(crate) fn open(named: &Path) -> Result<Self> {
        let (path, asked) = parted(named);
        let groups = parse(&path, &read::map(&path)?)?;
        Ok(Self { path, groups, asked })
    }

    /// The group that is asked for; else the only one, else that which has as many atoms as `count` says.
    ///
    /// Fails with [`Error::Setting`] if there is no such group, or several.
    pub(crate) fn choose(mut self, count: impl FnOnce() -> Result<usize>) -> Result<Group> {
        let place = match &self.asked {
            Some(asked) => self.called(asked)?,
            None if self.groups.len() == 1 => 0,
            None => self.fitting(count()?)?,
        };
        Ok(self.groups.swap_remove(place))
    }

    /// The place of the group of that name, else of that number, counted from 0, as GROMACS' programs ask for them.
    fn called(&self, asked: &str) -> Result<usize> {
        let places: Vec<usize> = (0..self.groups.len()).filter(|&it| self.groups[it].name == asked).collect();
        let number = || asked.parse().ok().filter(|&place: &usize| place < self.groups.len());
        match places[..] {
            [place] => Ok(place),
            [] => number().ok_or_else(|| {
                self.refused(asked, "the name or the number from 0 of a group", 0..self.groups.len())
            }),
            _ => Err(self.refused(asked, "a number: several groups have this name", places)),
        }
    }

    /// The place of the one group that has so many atoms; of several with the same atoms that of the first.
    fn fitting(&self, count: usize) -> Result<usize> {
        let places: Vec<usize> =
            (0..self.groups.len()).filter(|&it| self.groups[it].atoms.len() == count).collect();
        let atoms = |place: usize| &self.groups[place].atoms;
        let named = self.path.display();
        match places[..] {
            [first, ref others @ ..] if others.iter().all(|&it| atoms(it) == atoms(first)) => Ok(first),
            [] => {
                let allowed =
                    format!("a file of which a group has {} atoms, as the trajectory has", grouped(count));
                Err(self.refused(&named.to_string(), &allowed, 0..self.groups.len()))
            }
            _ => {
                let allowed =
                    format!("without a group, as several have {} atoms: {named}:NAME", grouped(count));
                Err(self.refused(&named.to_string(), &allowed, places))
            }
        }
    }

    /// The error about a choice, which says what these groups are.
    fn refused(&self, value: &str, allowed: &str, places: impl IntoIterator<Item = usize>) -> Error {
        let mut groups = places.into_iter().map(|place| {
            let Group { name, atoms } = &self.groups[place];
            format!("{place} {name} ({})", grouped(atoms.len()))
        });
        let mut list: Vec<String> = groups.by_ref().take(LISTED).collect();
        list.extend(groups.next().map(|_| "...".into()));
        Error::setting(SETTING, value, format!("{allowed}; groups (atoms): {}", list.join(", ")))
    }
}

/// A file's name, and that of the group behind it.
fn parted(named: &Path) -> (PathBuf, Option<String>) {
    let text = named.to_str().filter(|_| !named.exists()).unwrap_or_default();
    let file = text.match_indices(':').map(|(at, _)| at).find(|&at| Path::new(&text[..at]).is_file());
    match file {
        Some(at) => (text[..at].into(), Some(text[at + 1..].trim().to_string())),
        None => (named.to_path_buf(), None),
    }
}

/// The groups of a file of this content.
fn parse(path: &Path, bytes: &[u8]) -> Result<Vec<Group>> {
    let mut groups: Vec<Group> = Vec::new();
    for (place, line) in bytes.split(|&byte| byte == b'\n').enumerate() {
        let line = String::from_utf8_lossy(line.split(|&byte| byte == b';').next().unwrap_or_default());
        let line = line.trim();
        let fault = |what: String| Error::format(path, format!("line {}", place + 1), what, HINT);
        if let Some(name) = line.strip_prefix('[') {
            let name = name.strip_suffix(']').map(str::trim).filter(|name| !name.is_empty());
            let name =
                name.ok_or_else(|| fault(format!("wanted a name in brackets alone, found '{line}'")))?;
            groups.push(Group { name: name.to_string(), atoms: Vec::new() });
            continue;
        }
        for word in line.split_whitespace() {
            let group =
                groups.last_mut().ok_or_else(|| fault(format!("wanted a group's name, found '{word}'")))?;
            let atom = word.parse().ok().and_then(|number: u32| number.checked_sub(1));
            group.atoms.push(
                atom.ok_or_else(|| fault(format!("wanted the number of an atom, from 1, found '{word}'")))?,
            );
        }
    }
    match groups.is_empty() {
        true => Err(Error::format(path, "", "the file has no group", HINT)),
        false => Ok(groups),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "; of water\n[ System ]\n   1    2\t3 4\r\n 5 6\n\n[ SOL ]\n4 5 6 ; the second\n[Water]\n4 5 6\n[ Ions ]\n[ 0 ]\n3 1";

    fn groups(asked: Option<&str>) -> Groups {
        let path = PathBuf::from("a.ndx");
        let groups = parse(&path, FILE.as_bytes()).unwrap();
        Groups { path, groups, asked: asked.map(String::from) }
    }

    fn chosen(asked: Option<&str>, count: usize) -> std::result::Result<String, String> {
        let group = groups(asked).choose(|| Ok(count)).map_err(|error| error.to_string())?;
        Ok(format!("{} {:?}", group.name, group.atoms))
    }

    #[test]
    fn names_in_brackets_begin_groups_of_numbers_from_1() {
        let read: Vec<String> =
            groups(None).groups.iter().map(|it| format!("{} {:?}", it.name, it.atoms)).collect();
        assert_eq!(
            read,
            ["System [0, 1, 2, 3, 4, 5]", "SOL [3, 4, 5]", "Water [3, 4, 5]", "Ions []", "0 [2, 0]"]
        );
    }

    #[test]
    fn a_group_is_chosen_by_name_number_or_size() {
        for (asked, wanted) in [("Water", "Water"), ("0", "0 [2"), ("1", "SOL"), ("3", "Ions")] {
            assert!(chosen(Some(asked), 9).unwrap().starts_with(wanted), "{asked}");
        }
        assert!(chosen(None, 6).unwrap().starts_with("System"));
        assert!(chosen(None, 3).unwrap().starts_with("SOL"), "others have the same atoms");
        let alone = Groups { groups: vec![Group { name: "A".into(), atoms: vec![7] }], ..groups(None) };
        assert_eq!(alone.choose(|| Ok(5)).unwrap().name, "A", "the only one");
    }

    #[test]
    fn what_cannot_be_chosen_says_which_groups_there_are() {
        for (asked, count, parts) in [
            (Some("Protein"), 9, ["'Protein' — the name or the number", "0 System (6), 1 SOL (3)"]),
            (Some("5"), 9, ["'5'", "4 0 (2)"]),
            (Some(""), 9, ["the name", "3 Ions (0)"]),
            (None, 4, ["'a.ndx' — a file of which a group has 4 atoms", "2 Water (3)"]),
        ] {
            let message = chosen(asked, count).unwrap_err();
            assert!(parts.iter().all(|part| message.contains(part)), "{message}");
        }
        let twins = || {
            let twin = |atoms: [u32; 2]| Group { name: "A".into(), atoms: atoms.to_vec() };
            vec![twin([0, 1]), twin([0, 2])]
        };
        let message =
            Groups { groups: twins(), ..groups(Some("A")) }.choose(|| Ok(2)).unwrap_err().to_string();
        assert!(
            message.contains("several groups have this name; groups (atoms): 0 A (2), 1 A (2)"),
            "{message}"
        );
        let message = Groups { groups: twins(), ..groups(None) }.choose(|| Ok(2)).unwrap_err().to_string();
        assert!(message.contains("several have 2 atoms: a.ndx:NAME"), "{message}");
        let many = (0..99).map(|_| Group { name: "A".into(), atoms: vec![] }).collect();
        let message = Groups { groups: many, ..groups(None) }.choose(|| Ok(2)).unwrap_err().to_string();
        assert!(message.ends_with("11 A (0), ..."), "{message}");
    }

    #[test]
    fn what_is_no_index_file_says_where() {
        for (text, parts) in [
            ("", ["no group", "(a.ndx)"]),
            ("; nothing\n\n", ["no group", "make_ndx"]),
            ("1 2 3\n[ A ]\n", ["a.ndx: line 1", "found '1'"]),
            ("[ A ]\n1 0\n", ["line 2", "from 1, found '0'"]),
            ("[ A ]\n1\n-4", ["line 3", "found '-4'"]),
            ("[ A ]\n99999999999999999999", ["line 2", "found '99999999999999999999'"]),
            ("[ A ]\n1.5", ["line 2", "'1.5'"]),
            ("[ A\n1", ["line 1", "'[ A'"]),
            ("[ ]\n1", ["line 1", "'[ ]'"]),
            ("[ A ] 1 2\n", ["line 1", "alone"]),
            ("\u{0}\u{1}[", ["line 1", "found"]),
        ] {
            let message = parse(Path::new("a.ndx"), text.as_bytes()).unwrap_err().to_string();
            assert!(parts.iter().all(|part| message.contains(part)), "{text}: {message}");
        }
        assert!(parse(Path::new("a.ndx"), b"\xff\xfe\x00[").is_err());
    }

    #[test]
    fn the_name_of_a_group_follows_that_of_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("a.ndx"), FILE).unwrap();
        let of = |name: &str| {
            let (file, asked) = parted(&path(name));
            (file.file_name().unwrap().to_string_lossy().into_owned(), asked)
        };
        assert_eq!(of("a.ndx"), ("a.ndx".into(), None));
        assert_eq!(of("a.ndx:SOL"), ("a.ndx".into(), Some("SOL".into())));
        assert_eq!(of("a.ndx:A:B"), ("a.ndx".into(), Some("A:B".into())));
        assert_eq!(of("b.ndx:SOL").1, None);
        std::fs::write(path("a.ndx:SOL"), FILE).unwrap();
        assert_eq!(of("a.ndx:SOL"), ("a.ndx:SOL".into(), None), "a file of the whole name");
        assert!(Groups::open(&path("b.ndx:SOL")).is_err() && Groups::open(folder.path()).is_err());
    }
}
