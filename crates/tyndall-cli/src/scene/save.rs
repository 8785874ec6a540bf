//! What was asked for, as the text of a scene file: what nobody said is left out, so that it is guessed again.

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::path::Path;

use clap::ArgMatches;
use clap::parser::ValueSource;
use toml::Value;
use toml::de::{DeTable, DeValue};

use super::grid::Grid;
use super::keys::{FILES, Key, Keys, Values};
use super::values::light_with_file;
use crate::camera;

/// What the flags in `given` and the grid say; names of files are written as `place` puts them. Of the files `files` stay.
pub(super) fn text(
    keys: &Keys,
    given: &ArgMatches,
    files: &[&Path],
    (grid, layers): (Option<&Grid>, &[ArgMatches]),
    place: &dyn Fn(&Path) -> String,
) -> String {
    let mut text =
        format!("# Written by Tyndall {}; what is not here is guessed.\n", env!("CARGO_PKG_VERSION"));
    let here = |file: &Path| if is_made_up(file) { file.display().to_string() } else { place(file) };
    if let Some(grid) = grid {
        let mut grid = grid.clone();
        grid.file = here(&grid.file).into();
        if let Ok(Value::Table(table)) = Value::try_from(grid) {
            text += "\n[grid]\n";
            table.iter().for_each(|(name, value)| line(&mut text, name, value));
        }
    } else {
        let files = files.iter().map(|file| Value::String(here(file))).collect();
        text += &format!("\n[{}]\n", FILES[0]);
        line(&mut text, FILES[1], &Value::Array(files));
    }
    for table in keys.tables() {
        let mut is_empty = true;
        let of_table = |key: &&Key| key.table == table && !key.arg.is_positional() && key.is_saved();
        for key in keys.iter().filter(of_table).filter(|key| key.name != "layer" && is_given(key, given)) {
            if std::mem::take(&mut is_empty) {
                text += &format!("\n[{table}]\n");
            }
            line(&mut text, &key.name, &value(key, given, &here));
        }
    }
    for layer in layers {
        text += "\n[[layer]]\n";
        for key in keys.iter().filter(|key| key.is_saved() && is_given(key, layer)) {
            match key.arg.is_positional() {
                true => {
                    let files = layer.get_raw(key.id().as_str()).into_iter().flatten();
                    let files = files.map(|file| Value::String(here(Path::new(file)))).collect();
                    line(&mut text, &key.name, &Value::Array(files));
                }
                false => line(&mut text, &key.name, &value(key, layer, &here)),
            }
        }
    }
    text
}

fn is_given(key: &Key, given: &ArgMatches) -> bool {
    given.value_source(key.id().as_str()) == Some(ValueSource::CommandLine)
}

/// Whether it is no file, but the name of synthetic particles.
fn is_made_up(file: &Path) -> bool {
    file.to_string_lossy().starts_with("synthetic:")
}

fn line(text: &mut String, name: &str, value: &Value) {
    // A text takes all that is written to it.
    let _ = writeln!(text, "{name} = {value}");
}

/// The value of a flag.
fn value(key: &Key, given: &ArgMatches, place: &dyn Fn(&Path) -> String) -> Value {
    let words = given.get_raw(key.id().as_str()).into_iter().flatten();
    let texts = words.map(|word: &OsStr| match &*key.name {
        _ if key.is_path() => place(Path::new(word)),
        "light" => light_with_file(&word.to_string_lossy(), place),
        "camera" => camera::with_file(&word.to_string_lossy(), place),
        _ => word.to_string_lossy().into_owned(),
    });
    match key.values() {
        Values::Switch => Value::Boolean(true),
        Values::Several => Value::Array(texts.map(Value::String).collect()),
        Values::One(separator) => {
            let text = texts.collect::<Vec<_>>().join(",");
            let parts: Option<Vec<Value>> = text.split(separator).map(number).collect();
            match parts {
                Some(parts) if parts.len() > 1 => Value::Array(parts),
                _ => number(&text).unwrap_or(Value::String(text)),
            }
        }
    }
}

/// A number that TOML writes with the same digits, so that reading it gives the same text.
fn number(text: &str) -> Option<Value> {
    let line = format!("n = {text}");
    let table = DeTable::parse(&line).ok()?;
    let value = match table.get_ref().get("n").map(|value| value.get_ref()) {
        Some(DeValue::Integer(_)) => Value::Integer(text.parse().ok()?),
        Some(DeValue::Float(_)) => Value::Float(text.parse().ok()?),
        _ => return None,
    };
    (value.to_string() == text).then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_if_they_come_back_as_they_were() {
        for text in ["0", "-7", "1.5", "0.1", "-2.0"] {
            assert_eq!(number(text).map(|it| it.to_string()).as_deref(), Some(text), "{text}");
        }
        for text in
            ["1e6", "007", ".5", "0.10", "0x10", "1_000", "1 # x", "1\nb = 2", "auto", "true", "", "nan"]
        {
            assert!(number(text).is_none() || text == "nan", "{text}");
        }
    }
}
