//! `--layer`: more particles in the same picture, said in words of the command line.

use std::ffi::OsString;
use std::path::Path;

use clap::parser::ValueSource;
use clap::{ArgMatches, Command, CommandFactory, Parser};
use toml::de::{DeTable, DeValue};

use super::Origin;
use super::keys::{FILES, Key, Keys, Values};
use super::values::word;
use crate::args::{Cli, Render, Verb};
use crate::names;
use crate::report::{Failure, Outcome};
use crate::usage;

/// Tables whose flags a layer has of its own.
const TABLES: [&str; 5] = ["particles", "reading", "selection", "density", "medium"];
/// Other flags that it has of its own.
const FLAGS: [&str; 14] = [
    "mode",
    "look",
    "color",
    "cmap",
    "norm",
    "log",
    "range",
    "missing",
    "below",
    "above",
    "radius",
    "radius-scale",
    "bonds",
    "bond-radius",
];
/// Tables whose flags it has from the command line around it where it does not say otherwise.
const INHERITED: [&str; 8] =
    ["picture", "frames", "camera", "annotations", "method", "density", "medium", "options"];

/// Flags of these tables that it has not: what gives off light is one layer.
const OWN: [&str; 2] = ["emission", "emission-scale"];

/// Flags of these tables that are of the whole picture.
const OF_ALL: [&str; 3] = ["cut", "cap", "center"];

/// Whether a layer may have a flag of its own.
pub(super) fn may_have(key: &Key) -> bool {
    let is_of_table = TABLES.contains(&&*key.table) && !OF_ALL.contains(&&*key.name);
    is_of_table || FLAGS.contains(&&*key.name)
}

/// What the words of a layer say by themselves. Fails if they make no sense, or say what is of the whole picture.
pub(super) fn matches(keys: &Keys, text: &str) -> Outcome<ArgMatches> {
    let refused = |what: String| Failure::Usage(format!("--layer '{text}': {what}"));
    let words = shlex::split(text).ok_or_else(|| refused("a quotation mark has no other half".into()))?;
    let words = ["tyndall".to_string(), "render".to_string()].into_iter().chain(words);
    let parsed = without_output().try_get_matches_from(words);
    let mut parsed = parsed.map_err(|error| refused(usage::reason(&error)))?;
    let (_, matches) = parsed.remove_subcommand().ok_or_else(|| refused("it has no files".into()))?;
    let given = |key: &&Key| matches.value_source(key.id().as_str()) == Some(ValueSource::CommandLine);
    match keys.iter().filter(given).find(|key| !may_have(key)) {
        Some(key) => {
            Err(refused(format!("--{} is of the whole picture — give it outside of --layer", key.name)))
        }
        None => Ok(matches),
    }
}

/// The command line, of which a layer needs to say no output.
fn without_output() -> Command {
    Cli::command().mut_subcommand("render", |render| render.mut_arg("output", |arg| arg.required(false)))
}

/// The layer, with what is said around it.
pub(super) fn render(
    keys: &Keys,
    (layer, whole): (&ArgMatches, &ArgMatches),
    origin: &Origin,
) -> Outcome<Render> {
    let inherited =
        |key: &&Key| INHERITED.contains(&&*key.table) && ![&FLAGS[..], &OWN].concat().contains(&&*key.name);
    let mut words: Vec<OsString> = ["tyndall", "render"].map(OsString::from).to_vec();
    keys.iter().filter(inherited).for_each(|key| words.extend(words_of(key, whole)));
    let own = |key: &&Key| !key.arg.is_positional();
    keys.iter().filter(own).for_each(|key| words.extend(words_of(key, layer)));
    words.push("--".into());
    words.extend(keys.files().into_iter().flat_map(|key| words_of(key, layer)));
    let parsed = Cli::try_parse_from(words).map_err(|error| Failure::Usage(usage::reason(&error)))?;
    let Verb::Render(mut render) = parsed.verb else {
        return Err(Failure::Usage("--layer has no files".into()));
    };
    names::expand(&mut render.input)?;
    render.origin = Origin { grid: None, saved: None, warnings: Vec::new(), ..origin.clone() };
    Ok(*render)
}

/// The words by which a flag was given, each with its value; none if it was not.
fn words_of(key: &Key, given: &ArgMatches) -> Vec<OsString> {
    let id = key.id().as_str();
    if given.value_source(id) != Some(ValueSource::CommandLine) {
        return Vec::new();
    }
    let raw: Vec<OsString> = given.get_raw(id).into_iter().flatten().map(OsString::from).collect();
    let word = |value: OsString| {
        let mut word = OsString::from(format!("--{}=", key.name));
        word.push(value);
        word
    };
    match key.values() {
        _ if key.arg.is_positional() => raw,
        Values::Switch => vec![format!("--{}", key.name).into()],
        _ => raw.into_iter().map(word).collect(),
    }
}

/// What `--layer` says, from a table; files are relative to `folder`.
pub(super) fn words(keys: &Keys, layer: &DeTable, folder: &Path) -> Result<String, String> {
    let here = |file: &str| match file.starts_with("synthetic:") {
        true => file.to_string(),
        false => folder.join(file).display().to_string(),
    };
    let mut files: Vec<String> = Vec::new();
    let mut words: Vec<String> = Vec::new();
    for (name, value) in layer {
        let name = name.get_ref().replace('_', "-");
        let values: Vec<&DeValue> = match value.get_ref() {
            DeValue::Array(values) => values.iter().map(|it| it.get_ref()).collect(),
            value => vec![value],
        };
        if name == FILES[1] {
            let of_files = values.into_iter().map(|it| Ok(here(&word(it, ',')?)));
            files.extend(of_files.collect::<Result<Vec<_>, String>>()?);
            continue;
        }
        let key = keys.flag(&name).filter(|key| may_have(key)).ok_or_else(|| unknown(keys, &name))?;
        match (key.values(), value.get_ref()) {
            (Values::Switch, DeValue::Boolean(is_on)) => {
                words.extend(is_on.then(|| format!("--{name}")));
            }
            (Values::Switch, _) => return Err(format!("{name}: it is true or false")),
            (_, DeValue::Boolean(true)) if key.may_be_bare() => words.push(format!("--{name}")),
            (_, DeValue::Boolean(_)) => return Err(format!("{name}: it needs a value")),
            (Values::Several, _) => {
                for value in values {
                    words.push(format!("--{name}={}", word(value, ',')?));
                }
            }
            (Values::One(separator), value) => {
                let text = word(value, separator)?;
                let text = if key.is_path() { here(&text) } else { text };
                words.push(format!("--{name}={text}"));
            }
        }
    }
    if files.is_empty() {
        return Err("a layer needs files = [\"NAME\"]".into());
    }
    let all = files.iter().chain(&words).map(String::as_str);
    shlex::try_join(all).map_err(|_| "a text has a letter of code 0".into())
}

/// What is wrong with a key that a layer does not have.
fn unknown(keys: &Keys, name: &str) -> String {
    if keys.flag(name).is_some() {
        return format!("'{name}' is of the whole picture, not of a layer");
    }
    let known = keys.iter().filter(|key| may_have(key)).map(|key| key.name.as_str());
    let meant = tyndall::names::nearest(name, known).map(|meant| format!(", did you mean '{meant}'?"));
    format!("a layer has no key '{name}'{}", meant.unwrap_or_default())
}
