//! What is to be rendered, from wherever it is said: the command line, scene files, the texts of a picture that was made before.
//!
//! A scene file says in TOML what the flags of `tyndall render` say, with the same names: a flag's long name without dashes is a key, its
//! heading in the help text a table, as `keys` finds in the definition of the command line. What it says becomes words of a command line,
//! which is parsed and checked like any other. `--save-scene` goes the other way. Later scenes count more than earlier ones, the command line
//! most: what it says replaces what a scene says by the same flag, or by one that cannot stand beside it.

mod again;
mod document;
mod grid;
mod keys;
mod layer;
mod save;
mod schema;
mod values;

use std::ffi::OsString;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use clap::error::ContextKind;
use clap::parser::ValueSource;
use clap::{ArgMatches, Command, CommandFactory, FromArgMatches, Parser};
use tyndall::Error;
use tyndall_io::write;

pub(crate) use self::again::Again;
use self::again::Memory;
use self::document::{Document, Said};
pub(crate) use self::grid::Grid;
use self::keys::Keys;
pub(crate) use self::schema::print as print_schema;
use crate::args::{Cli, Verb};
use crate::report::{Failure, Outcome, Report};
use crate::usage;

/// What a command line of `tyndall render` has beside its flags.
#[derive(Clone, Debug, Default)]
pub(crate) struct Origin {
    /// The density that takes the place of particles.
    pub(crate) grid: Option<Grid>,
    /// What was asked for, as a scene file; names of files are relative to the working folder, as they were given.
    pub(crate) text: String,
    /// The picture that is made anew.
    pub(crate) again: Option<Again>,
    /// Where there are layers, the files of all of them.
    pub(crate) files: Vec<PathBuf>,
    /// The scene file to write, and what to write.
    saved: Option<(PathBuf, String)>,
    warnings: Vec<String>,
}

impl Origin {
    /// Says what is odd, and writes the scene file that is asked for.
    pub(crate) fn begin(&self, report: &Report) -> Outcome<()> {
        self.warnings.iter().for_each(|warning| report.warn(warning));
        let Some((path, text)) = &self.saved else { return Ok(()) };
        write::atomically(path, |file| file.write_all(text.as_bytes())).map_err(Failure::Output)?;
        report.note(format_args!("{}  scene", path.display()));
        Ok(())
    }
}

/// Why a command line is none.
pub(crate) enum Refused {
    /// By its words, or only help is asked for.
    Words(clap::Error),
    /// By a scene file or picture.
    Scene(Failure),
}

impl From<clap::Error> for Refused {
    fn from(error: clap::Error) -> Self {
        Self::Words(error)
    }
}

impl From<Failure> for Refused {
    fn from(failure: Failure) -> Self {
        Self::Scene(failure)
    }
}

/// Reads the words of a command line, the program's name first, with the scene files among them.
pub(crate) fn command_line(words: Vec<OsString>) -> Result<Cli, Refused> {
    let relaxed = |name: &str, command: Command| {
        command.mut_subcommand("render", |render| render.mut_arg(name, |arg| arg.required(false)))
    };
    let without_files = relaxed("files", Cli::command());
    let given = match words.get(1) {
        Some(verb) if verb == "render" => {
            relaxed("output", without_files.clone()).try_get_matches_from(&words).ok()
        }
        _ => None,
    };
    // What is wrong is said by the whole definition.
    let Some(given) = given.as_ref().and_then(ArgMatches::subcommand).map(|(_, render)| render) else {
        return Ok(Cli::try_parse_from(words)?);
    };
    let keys = Keys::new();
    let files: Vec<PathBuf> = given.get_many("files").into_iter().flatten().cloned().collect();
    let (scenes, files): (Vec<PathBuf>, Vec<PathBuf>) = files.into_iter().partition(|file| is_scene(file));
    let picture = given.get_one::<PathBuf>("again");
    let memory = picture.map(|picture| Memory::of(picture)).transpose()?;

    let mut asked = Asked::default();
    if let (Some(picture), Some(memory)) = (picture, &memory) {
        asked.add(&keys, picture, document::read(picture, &memory.scene, Path::new(""), &keys)?);
    }
    for scene in &scenes {
        let text = fs::read_to_string(scene).map_err(|error| Failure::from(Error::io(scene, error)))?;
        let folder = scene.parent().unwrap_or(Path::new(""));
        asked.add(&keys, scene, document::read(scene, &text, folder, &keys)?);
    }
    let had_files = asked.has_files(&keys);
    asked.override_by(&keys, given, !files.is_empty(), picture.is_some());

    let is_alone = scenes.is_empty() && picture.is_none();
    let command = if is_alone { Cli::command() } else { without_files };
    let all_words = asked.words(&keys, words);
    let matches = command.try_get_matches_from(all_words).map_err(|error| asked.explained(&keys, error))?;
    let mut cli = Cli::from_arg_matches(&matches)?;
    let (Verb::Render(args), Some(given)) = (&mut cli.verb, matches.subcommand_matches("render")) else {
        return Ok(cli);
    };
    args.input.files.retain(|file| !scenes.contains(file));
    if let Some(grid) = &asked.grid {
        args.input.files = vec![grid.file().to_path_buf()];
    } else if args.input.files.is_empty() {
        let scene = scenes.last().or(picture).map_or(Path::new(""), PathBuf::as_path);
        return Err(document::error(scene, 0, "it has neither [grid] nor [particles]".into()).into());
    }
    let files: Vec<&Path> = args.input.files.iter().map(PathBuf::as_path).collect();
    let layers = args.layers.texts.iter().map(|text| layer::matches(&keys, text));
    let layers = layers.collect::<Outcome<Vec<ArgMatches>>>()?;
    let more = (asked.grid.as_ref(), &layers[..]);
    let text = |place: &dyn Fn(&Path) -> String| save::text(&keys, given, &files, more, place);
    args.origin = Origin {
        text: text(&|file| file.display().to_string()),
        saved: match &args.picture.save_scene {
            Some(path) if !is_scene(path) => {
                let allowed = "the extension of a scene file is .toml";
                return Err(Failure::from(Error::setting("--save-scene", path.display(), allowed)).into());
            }
            path => path.as_ref().map(|path| (path.clone(), text(&beside(path)))),
        },
        warnings: memory
            .as_ref()
            .map_or(Vec::new(), |memory| memory.warnings(had_files && asked.has_files(&keys))),
        again: picture.zip(memory).map(|(picture, memory)| Again {
            name: memory.name,
            to: asked.output.clone().unwrap_or_else(|| picture.clone()),
        }),
        grid: asked.grid.clone(),
        files: Vec::new(),
    };
    let sources = layers.iter().map(|layer| layer::render(&keys, (layer, given), &args.origin));
    args.layers.sources = sources.collect::<Outcome<Vec<_>>>()?;
    if !args.layers.sources.is_empty() {
        let of_layers = args.layers.sources.iter().flat_map(|layer| layer.input.files.clone());
        let files: Vec<PathBuf> = args.input.files.iter().cloned().chain(of_layers).collect();
        args.layers.sources.iter_mut().for_each(|layer| layer.origin.files.clone_from(&files));
        args.origin.files = files;
    }
    Ok(cli)
}

/// Whether a file is a scene file, by its extension.
fn is_scene(file: &Path) -> bool {
    file.extension().is_some_and(|it| it.eq_ignore_ascii_case("toml"))
}

/// Names of files relative to the folder of a scene file, where they lie in it, else in full.
fn beside(scene: &Path) -> impl Fn(&Path) -> String {
    let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    let folder = absolute(scene).parent().map(Path::to_path_buf);
    move |file: &Path| {
        let file = absolute(file);
        let inside = folder.as_ref().and_then(|folder| file.strip_prefix(folder).ok());
        inside.unwrap_or(&file).display().to_string()
    }
}

/// What scenes say, as far as nothing later says otherwise.
#[derive(Default)]
struct Asked {
    /// Each with the scene that says it.
    said: Vec<(PathBuf, Said)>,
    grid: Option<Grid>,
    /// Where a picture goes that is made anew, if that is said.
    output: Option<PathBuf>,
}

impl Asked {
    /// Adds what a scene says, in place of what it contradicts.
    fn add(&mut self, keys: &Keys, path: &Path, document: Document) {
        let files = keys.files().map(keys::Key::id);
        for said in &document.said {
            self.said.retain(|(_, old)| old.id != said.id && !keys.exclude(&old.id, &said.id));
            if Some(&said.id) == files {
                self.grid = None;
            }
        }
        if document.grid.is_some() {
            self.said.retain(|(_, old)| Some(&old.id) != files);
            self.grid = document.grid;
        }
        self.said.extend(document.said.into_iter().map(|said| (path.to_path_buf(), said)));
    }

    /// Leaves out what the command line says otherwise. The name of the picture that is made anew belongs to the pictures beside it.
    fn override_by(&mut self, keys: &Keys, given: &ArgMatches, has_files: bool, is_again: bool) {
        for key in keys.iter().filter(|key| !key.arg.is_positional()) {
            let id = key.id().as_str();
            if given.value_source(id) != Some(ValueSource::CommandLine) {
                continue;
            }
            if is_again && id == "output" {
                self.output = given.get_one::<PathBuf>(id).cloned();
                continue;
            }
            self.said.retain(|(_, said)| said.id != *key.id() && !keys.exclude(&said.id, key.id()));
        }
        if has_files {
            self.said.retain(|(_, said)| Some(&said.id) != keys.files().map(keys::Key::id));
            self.grid = None;
        }
    }

    /// Whether scenes say what is read.
    fn has_files(&self, keys: &Keys) -> bool {
        let files = keys.files().map(keys::Key::id);
        self.grid.is_some() || self.said.iter().any(|(_, said)| Some(&said.id) == files)
    }

    /// The words of the command line with what the scenes say: files first, flags last, of which each says its value in the same word, so
    /// that none takes a word that is not its own.
    fn words(&self, keys: &Keys, mut words: Vec<OsString>) -> Vec<OsString> {
        let files = keys.files().map(keys::Key::id);
        let is_files = |said: &Said| Some(&said.id) == files;
        let of = |wanted: bool| {
            let said = self.said.iter().filter(move |(_, said)| is_files(said) == wanted);
            said.flat_map(|(_, said)| said.words.iter().map(|(word, _)| word.clone()))
        };
        let end = words.iter().position(|word| word == "--").unwrap_or(words.len());
        words.splice(end..end, of(false));
        words.splice(2..2, of(true));
        words
    }

    /// Why the words were refused: by the line of a scene that says one of them, if one does.
    fn explained(&self, keys: &Keys, error: clap::Error) -> Refused {
        let named =
            [ContextKind::InvalidArg, ContextKind::PriorArg].into_iter().filter_map(|kind| error.get(kind));
        let names =
            named.flat_map(|value| value.to_string().split(", ").map(String::from).collect::<Vec<_>>());
        let found = names.into_iter().find_map(|name| {
            let name = name.trim_start_matches('-').split([' ', '=', '[', '<']).next()?.to_string();
            let id = keys.flag(&name)?.id();
            self.said.iter().find(|(_, said)| said.id == *id)
        });
        match found {
            Some((path, said)) => {
                let reason = usage::reason(&error);
                let reason = reason.strip_prefix("--").map(String::from).unwrap_or(reason);
                // Of a flag that is repeated the one that is wrong.
                let value = error.get(ContextKind::InvalidValue).map(|value| format!("={value}"));
                let is_wrong = |word: &OsString| {
                    value.as_ref().is_some_and(|value| word.to_string_lossy().ends_with(&**value))
                };
                let line =
                    said.words.iter().find(|(word, _)| is_wrong(word)).map_or(said.line, |(_, line)| *line);
                document::error(path, line, reason).into()
            }
            None => error.into(),
        }
    }
}
