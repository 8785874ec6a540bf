//! The keys of scene files: the flags of `tyndall render`, as the command line's definition has them.
//!
//! A flag's long name without dashes is its key, the heading under which help lists it, in small letters, its table. So a new flag is a
//! new key, with its help text, and nothing is written down twice.

use std::any::TypeId;
use std::path::PathBuf;

use clap::{Arg, ArgAction, Command, CommandFactory, Id};
use tyndall::names::nearest;

use crate::args::Cli;

/// Flags that say what to do with a scene, not what it is.
const NO_KEYS: [&str; 4] = ["help", "version", "save-scene", "again"];
/// Flags that are about one run alone: a scene may say them, but they are not saved with what was asked for.
const OF_A_RUN: [&str; 6] = ["dry-run", "skip-existing", "no-index", "quiet", "verbose", "threads"];
/// The table of flags without a heading, which help calls so.
const OPTIONS: &str = "options";
/// The table and key of the files.
pub(super) const FILES: [&str; 2] = ["particles", "files"];

/// What a key's value may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Values {
    /// True or false.
    Switch,
    /// One value; where it has parts, a list of them is joined by this letter.
    One(char),
    /// A value, or several of them.
    Several,
}

/// A key of a scene file: a flag.
pub(super) struct Key {
    pub(super) arg: Arg,
    pub(super) table: String,
    pub(super) name: String,
}

impl Key {
    fn of(arg: &Arg) -> Option<Self> {
        if arg.is_positional() {
            let [table, name] = FILES.map(String::from);
            return Some(Self { arg: arg.clone(), table, name });
        }
        let name = arg.get_long().filter(|name| !NO_KEYS.contains(name))?.to_string();
        let table = arg.get_help_heading().map_or(OPTIONS.into(), table);
        Some(Self { arg: arg.clone(), table, name })
    }

    pub(super) fn id(&self) -> &Id {
        self.arg.get_id()
    }

    /// Whether it belongs to what was asked for.
    pub(super) fn is_saved(&self) -> bool {
        !OF_A_RUN.contains(&&*self.name)
    }

    /// Whether its values are paths.
    pub(super) fn is_path(&self) -> bool {
        self.has_type::<PathBuf>()
    }

    fn has_type<T: 'static>(&self) -> bool {
        self.arg.get_value_parser().type_id() == TypeId::of::<T>()
    }

    pub(super) fn is_number(&self) -> bool {
        self.has_type::<f32>() || self.has_type::<f64>()
    }

    pub(super) fn is_integer(&self) -> bool {
        self.has_type::<u8>()
            || self.has_type::<u16>()
            || self.has_type::<u32>()
            || self.has_type::<u64>()
            || self.has_type::<i64>()
    }

    pub(super) fn values(&self) -> Values {
        match self.arg.get_action() {
            ArgAction::Append if self.arg.get_value_delimiter().is_none() => Values::Several,
            ArgAction::Append | ArgAction::Set => Values::One(self.separator()),
            _ => Values::Switch,
        }
    }

    /// Whether the flag may stand without a value, which means `auto`.
    pub(super) fn may_be_bare(&self) -> bool {
        self.values() != Values::Switch
            && self.arg.get_num_args().is_some_and(|count| count.min_values() == 0)
    }

    /// What stands between the parts of a value, as the name of the value has it: `X,Y,Z`, `WxH`, `LOW:HIGH`.
    fn separator(&self) -> char {
        let name =
            self.arg.get_value_names().and_then(|names| names.first()).map_or("", |name| name.as_str());
        let between = |letter: &char| *letter == 'x' || ",:@".contains(*letter);
        name.chars().find(between).unwrap_or(',')
    }

    fn is_called(&self, name: &str) -> bool {
        self.name == name || self.arg.get_all_aliases().is_some_and(|aliases| aliases.contains(&name))
    }
}

/// `With --culling confidence (in brackets ...)` as `culling-confidence`.
fn table(heading: &str) -> String {
    let words = heading.split('(').next().unwrap_or_default().to_lowercase();
    let words: Vec<&str> =
        words.split(|letter: char| !letter.is_alphanumeric()).filter(|it| !it.is_empty()).collect();
    words.strip_prefix(&["with"]).unwrap_or(&words).join("-")
}

/// All keys, in the order of the help text.
pub(super) struct Keys {
    command: Command,
    all: Vec<Key>,
}

impl Keys {
    pub(super) fn new() -> Self {
        let mut command = Cli::command();
        command.build();
        let render = command.find_subcommand("render").cloned().unwrap_or(command);
        let all = render.get_arguments().filter_map(Key::of).collect();
        Self { command: render, all }
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &Key> {
        self.all.iter()
    }

    /// The tables, each once, in the order of the help text.
    pub(super) fn tables(&self) -> Vec<&str> {
        let mut tables: Vec<&str> = Vec::new();
        for key in &self.all {
            if !tables.contains(&&*key.table) {
                tables.push(&key.table);
            }
        }
        tables
    }

    /// The key of a flag by its long name.
    pub(super) fn flag(&self, name: &str) -> Option<&Key> {
        self.all.iter().find(|key| !key.arg.is_positional() && key.is_called(name))
    }

    /// The files.
    pub(super) fn files(&self) -> Option<&Key> {
        self.all.iter().find(|key| key.arg.is_positional())
    }

    /// The key of that name in that table, where `_` is as good as `-`; else what is wrong with it.
    pub(super) fn find(&self, table: &str, name: &str) -> Result<&Key, String> {
        let name = name.replace('_', "-");
        let called = |key: &&Key| key.is_called(&name);
        if let Some(key) = self.all.iter().filter(|key| key.table == table).find(called) {
            return Ok(key);
        }
        if let Some(other) = self.all.iter().find(called) {
            return Err(format!("[{table}] has no key '{name}', it is one of [{}]", other.table));
        }
        let of = |wanted: &dyn Fn(&Key) -> bool| {
            nearest(&name, self.all.iter().filter(|key| wanted(key)).map(|key| key.name.as_str()))
        };
        let here = of(&|key| key.table == table).map(|meant| format!(", did you mean '{meant}'?"));
        let meant = here.or_else(|| {
            let meant = of(&|_| true)?;
            let table = &self.all.iter().find(|key| key.name == meant)?.table;
            Some(format!(", did you mean '{meant}' of [{table}]?"))
        });
        Err(format!("[{table}] has no key '{name}'{}", meant.unwrap_or_default()))
    }

    /// Whether two flags cannot be given together.
    pub(super) fn exclude(&self, one: &Id, other: &Id) -> bool {
        let names = |from: &Id, to: &Id| {
            let arg = self.all.iter().find(|key| key.id() == from);
            let conflicts = arg.map(|key| self.command.get_arg_conflicts_with(&key.arg));
            conflicts.is_some_and(|conflicts| conflicts.iter().any(|arg| arg.get_id() == to))
        };
        names(one, other) || names(other, one)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flag_has_one_key() {
        let keys = Keys::new();
        for key in keys.iter() {
            let same = keys.iter().filter(|other| other.name == key.name).count();
            assert_eq!(same, 1, "{}", key.name);
            let letters = |text: &str| {
                !text.is_empty() && text.chars().all(|it| it.is_ascii_alphanumeric() || it == '-')
            };
            assert!(letters(&key.table) && letters(&key.name), "[{}] {}", key.table, key.name);
            assert!(keys.find(&key.table, &key.name.replace('-', "_")).is_ok(), "{}", key.name);
        }
        let table = |name: &str| keys.flag(name).unwrap().table.as_str();
        assert_eq!(
            ["eye", "extinction", "voxel", "filter", "device", "voxel-count", "threads"].map(table),
            ["camera", "medium", "density", "selection", "method", "culling-confidence", "options"]
        );
        let values = |name: &str| keys.flag(name).unwrap().values();
        assert_eq!(
            ["size", "range", "eye", "alpha", "filter", "columns"].map(values),
            [
                Values::One('x'),
                Values::One(':'),
                Values::One(','),
                Values::Switch,
                Values::Several,
                Values::One(',')
            ]
        );
    }

    #[test]
    fn the_meant_key_is_told() {
        let keys = Keys::new();
        let wrong = |table: &str, name: &str| keys.find(table, name).map(|_| ()).unwrap_err();
        assert_eq!(wrong("medium", "albdeo"), "[medium] has no key 'albdeo', did you mean 'albedo'?");
        assert_eq!(wrong("picture", "eye"), "[picture] has no key 'eye', it is one of [camera]");
        assert!(keys.find("medium", "g").is_ok() && keys.find("selection", "slice").is_ok());
    }

    #[test]
    fn flags_that_cannot_be_together_are_known_both_ways() {
        let keys = Keys::new();
        let exclude = |one: &str, other: &str| {
            let [one, other] = [one, other].map(|name| keys.flag(name).unwrap().id().clone());
            keys.exclude(&one, &other)
        };
        assert!(exclude("view", "eye") && exclude("eye", "view") && exclude("log", "norm"));
        assert!(!exclude("view", "up"));
    }
}
