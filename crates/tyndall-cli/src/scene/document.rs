//! A scene file, read: what each of its keys says, as words of the command line, with the line that says it.

use std::ffi::OsString;
use std::path::Path;

use clap::Id;
use serde::Deserialize;
use toml::Spanned;
use toml::de::{DeTable, DeValue};
use tyndall::Error;
use tyndall::names::nearest;

use super::grid::Grid;
use super::keys::{FILES, Key, Keys, Values};
use super::layer;
use super::values::{camera_words, light_with_file, light_words, word};
use crate::camera;
use crate::report::{Failure, Outcome};

/// What a key says.
#[derive(Debug)]
pub(super) struct Said {
    pub(super) id: Id,
    /// Words of the command line, of the files the files, each with its line.
    pub(super) words: Vec<(OsString, usize)>,
    pub(super) line: usize,
}

/// A scene file, read.
#[derive(Debug)]
pub(super) struct Document {
    pub(super) said: Vec<Said>,
    pub(super) grid: Option<Grid>,
}

/// Only the table that is read as a whole.
#[derive(Deserialize)]
struct Grids {
    grid: Option<Grid>,
}

/// Where an error is, and what.
type Wrong = (usize, String);

/// Reads the `text` of the file `path`, of which names of files are relative to `folder`.
pub(super) fn read(path: &Path, text: &str, folder: &Path, keys: &Keys) -> Outcome<Document> {
    Reader { text, folder, keys, said: Vec::new() }.document().map_err(|(line, what)| error(path, line, what))
}

/// What is wrong in a line of a scene file.
pub(super) fn error(path: &Path, line: usize, what: String) -> Failure {
    let place = if line == 0 { String::new() } else { format!("line {line}") };
    Error::format(path, place, what, "docs/scenes.md explains scene files, 'tyndall schema' lists their keys")
        .into()
}

struct Reader<'a> {
    text: &'a str,
    folder: &'a Path,
    keys: &'a Keys,
    said: Vec<Said>,
}

impl Reader<'_> {
    fn document(mut self) -> Result<Document, Wrong> {
        let malformed = |error: toml::de::Error| {
            let start = error.span().map_or(0, |span| span.start);
            (self.line(start), error.message().lines().next().unwrap_or_default().to_string())
        };
        let tables = DeTable::parse(self.text).map_err(malformed)?;
        let Grids { mut grid } = toml::from_str(self.text).map_err(malformed)?;
        if let Some(grid) = &mut grid {
            grid.file = self.folder.join(&grid.file);
        }
        for (name, value) in tables.get_ref() {
            let line = self.line(name.span().start);
            match (&**name.get_ref(), value.get_ref()) {
                ("grid", _) => {}
                // A flag that may be repeated stands beside the tables too, a table for each time.
                (name @ ("light" | "camera" | "layer"), DeValue::Array(_)) => {
                    let key =
                        self.keys.flag(name).ok_or_else(|| (line, format!("no key is called '{name}'")))?;
                    self.key(key, value)?;
                }
                (table, DeValue::Table(entries)) => self.table(table, entries, line)?,
                (name, _) => return Err((line, self.outside(name))),
            }
        }
        let files = self.keys.files().map(Key::id);
        if grid.is_some() && self.said.iter().any(|said| Some(&said.id) == files) {
            return Err((0, "[grid] and [particles] exclude each other".into()));
        }
        Ok(Document { said: self.said, grid })
    }

    /// What a name that is neither in a table nor one says about itself.
    fn outside(&self, name: &str) -> String {
        let name = name.replace('_', "-");
        match self.keys.flag(&name) {
            Some(key) => format!("'{name}' stands outside of a table, it is one of [{}]", key.table),
            None => format!("'{name}' is no table"),
        }
    }

    fn table(&mut self, name: &str, entries: &DeTable, line: usize) -> Result<(), Wrong> {
        let tables = self.keys.tables();
        if !tables.contains(&name) {
            let known = tables.into_iter().chain(["grid", "layer", "light"]);
            let meant =
                nearest(name, known).map_or(String::new(), |meant| format!(", did you mean [{meant}]?"));
            return Err((line, format!("no table is called [{name}]{meant}")));
        }
        for (key, value) in entries {
            let line = self.line(key.span().start);
            let found = self.keys.find(name, key.get_ref()).map_err(|what| (line, what))?;
            if self.said.iter().any(|said| said.id == *found.id()) {
                return Err((line, format!("[{name}] says '{}' twice", found.name)));
            }
            self.key(found, value)?;
        }
        if name == FILES[0] && entries.is_empty() {
            return Err((line, "[particles] needs files = [\"NAME\"]".into()));
        }
        Ok(())
    }

    /// Notes what a key says.
    fn key(&mut self, key: &Key, value: &Spanned<DeValue>) -> Result<(), Wrong> {
        let line = self.line(value.span().start);
        let at_line = |what: String| (line, format!("[{}] {}: {what}", key.table, key.name));
        let values = match value.get_ref() {
            _ if self.said.iter().any(|said| said.id == *key.id()) => {
                return Err(at_line("it is said twice".into()));
            }
            DeValue::Array(values) if key.arg.is_positional() || key.values() == Values::Several => {
                let values = values.iter().map(|value| {
                    let line = self.line(value.span().start);
                    let text = self.text(key, value.get_ref()).map_err(|what| (line, at_line(what).1))?;
                    Ok((text, line))
                });
                values.collect::<Result<Vec<_>, Wrong>>()?
            }
            DeValue::Boolean(is_on) if key.values() == Values::Switch || key.may_be_bare() => {
                let word = if key.may_be_bare() { "auto" } else { "" };
                if *is_on { vec![(word.into(), line)] } else { Vec::new() }
            }
            _ if key.values() == Values::Switch => return Err(at_line("it is true or false".into())),
            value => vec![(self.text(key, value).map_err(at_line)?, line)],
        };
        let word = |text: String| match key.values() {
            _ if key.arg.is_positional() => text,
            Values::Switch => format!("--{}", key.name),
            _ => format!("--{}={text}", key.name),
        };
        let words = values.into_iter().map(|(text, line)| (OsString::from(word(text)), line));
        self.said.push(Said { id: key.id().clone(), words: words.collect(), line });
        Ok(())
    }

    /// One value as the command line writes it.
    fn text(&self, key: &Key, value: &DeValue) -> Result<String, String> {
        let here = |file: &Path| self.folder.join(file).display().to_string();
        match (&*key.name, value) {
            ("light", DeValue::Table(light)) => light_words(light, self.folder),
            ("camera", DeValue::Table(camera)) => camera_words(camera, self.folder),
            ("layer", DeValue::Table(layer)) => layer::words(self.keys, layer, self.folder),
            ("light", DeValue::String(text)) => Ok(light_with_file(text, here)),
            ("camera", DeValue::String(text)) => Ok(camera::with_file(text, here)),
            (_, DeValue::Boolean(_)) => Err("it needs a value, such as in 'tyndall render --help'".into()),
            (_, DeValue::String(text)) if key.is_path() && !text.starts_with("synthetic:") => {
                Ok(here(Path::new(&**text)))
            }
            (_, value) => {
                let separator = if let Values::One(separator) = key.values() { separator } else { ',' };
                word(value, separator)
            }
        }
    }

    /// The number of the line at a byte.
    fn line(&self, byte: usize) -> usize {
        1 + self.text.bytes().take(byte).filter(|it| *it == b'\n').count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Result<Vec<String>, String> {
        let keys = Keys::new();
        let found = read(Path::new("a/s.toml"), text, Path::new("a"), &keys).map_err(|it| it.to_string())?;
        let mut said = found.said;
        said.sort_by_key(|said| said.line);
        let words = said.into_iter().flat_map(|said| said.words).map(|(word, _)| word);
        Ok(words.map(|word| word.into_string().unwrap()).collect())
    }

    #[test]
    fn tables_say_what_flags_say() {
        let text = "[camera]\neye = [1, 2.50, -3e0]\nlook_at = '0,0,0'\n[picture]\nalpha = true\nsize = [32, 0x18]\n\
                    output = 'o.png'\n[reading]\nstrict = false\ncolumns = ['id', 'x']\n[look]\nrange = [-1, 0.1]\n\
                    [selection]\nfilter = ['type=1,3', 'x=0:']\nselect = 'z > 2'\n[particles]\nfiles = ['b.xyz', 'synthetic:packed?n=5']\n";
        let expected = [
            "--eye=1,2.50,-3e0",
            "--look-at=0,0,0",
            "--alpha",
            "--size=32x24",
            "--output=a/o.png",
            "--columns=id,x",
            "--range=-1:0.1",
            "--filter=type=1,3",
            "--filter=x=0:",
            "--select=z > 2",
            "a/b.xyz",
            "synthetic:packed?n=5",
        ];
        assert_eq!(read_text(text).unwrap(), expected);
    }

    #[test]
    fn repeated_flags_are_tables_or_texts() {
        let tables = "[[light]]\nkind = 'sky'\nradiance = 2\n[[light]]\nkind = 'image'\nfile = 'x.hdr'\n\
                      [[camera]]\nat = 0\neye = [1, 2, 3]\n[[camera]]\nat = 5\n\
                      [[camera]]\nfile = 'b.usda'\nprim = '/cam'\n[[camera]]\nfile = 'b.usda'\n";
        let texts = "[medium]\nlight = ['sky:2', 'image:1:x.hdr']\n[camera]\ncamera = ['at=0 eye=1,2,3', { at = 5 }, 'b.usda:/cam', \
                     { file = 'b.usda' }]\n";
        let expected = [
            "--light=sky:2",
            "--light=image:1:a/x.hdr",
            "--camera=at=0 eye=1,2,3",
            "--camera=at=5",
            "--camera=a/b.usda:/cam",
            "--camera=a/b.usda",
        ];
        assert_eq!(read_text(tables).unwrap(), expected);
        assert_eq!(read_text(texts).unwrap(), expected);
    }

    #[test]
    fn what_is_wrong_has_a_line() {
        for (text, part) in [
            ("\n[camera]\n\neyes = 1", "[camera] has no key 'eyes', did you mean 'eye'? (a/s.toml: line 4)"),
            ("[camra]", "no table is called [camra], did you mean [camera]? (a/s.toml: line 1)"),
            ("eye = [1, 2, 3]", "'eye' stands outside of a table, it is one of [camera]"),
            ("[picture]\nalpha = 1", "[picture] alpha: it is true or false (a/s.toml: line 2)"),
            ("[picture]\nsize = true", "[picture] size: it needs a value"),
            ("[camera]\nlook-at = 'a'\nlook_at = 'b'", "says 'look-at' twice (a/s.toml: line 3)"),
            ("[grid]\nfile = 'a'\nsampel = 1", "unknown field `sampel`"),
            ("[grid]\nfile = 'a'\n[particles]\nfiles = 'b'", "exclude each other"),
            ("[selection]\nfilter = ['a=1',\n{}]", "(a/s.toml: line 3)"),
            ("[[light]]\nkind = 'moon'", "no light is called 'moon'"),
            ("[grid\n", "(a/s.toml: line 1)"),
        ] {
            let said = read_text(text).unwrap_err();
            assert!(said.contains(part), "{part}: {said}");
        }
    }
}
