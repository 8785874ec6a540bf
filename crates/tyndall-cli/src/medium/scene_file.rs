//! Scene files: what the command line says, in TOML, with the same names; and a density grid in place of particles.
//!
//! Every table but `grid`, `particles` and `light` holds flags by their long names without dashes, such as `eye = [1, 2, 3]` for
//! `--eye 1,2,3` (the tables' own names are for people). Each `[[light]]` has a kind, `sun`, `point`, `spot`, `sky` or `image`, and what the flag
//! `--light` says. `[grid]` names a file of samples, raw or one that says where they lie (OpenDX, OpenVDB, VTK), `[particles]` files of particles. What the command line says beside the
//! scene's name counts before the scene. Each `[[camera]]` is a key of a camera that moves, and says what the flag `--camera` says; of a camera that stands, `[camera]` has the flags. Paths are relative to the scene file.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use clap::Parser;
use serde::Deserialize;
use toml::{Table, Value};
use tyndall::{Error, Vec3};
use tyndall_io::read::{self, Described, RawGrid, Sample};

use crate::args::{self, Cli, Verb};
use crate::names;
use crate::report::{Failure, Outcome, Report};

/// A scene, read.
pub(super) struct SceneFile {
    path: PathBuf,
    /// The command line that says the same.
    pub(super) args: args::Render,
    /// The grid that takes the place of particles.
    grid: Option<GridFile>,
}

/// The table `[grid]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GridFile {
    file: PathBuf,
    #[serde(default = "one")]
    scale: f64,
    /// Of a file that says itself where its samples lie: which array.
    array: Option<String>,
    /// Of a raw file.
    size: Option<[u32; 3]>,
    sample: Option<String>,
    spacing: Option<f32>,
    origin: Option<[f32; 3]>,
}

fn one() -> f64 {
    1.0
}

impl SceneFile {
    /// Reads a scene and joins it with the command line `words`, those of the whole process.
    pub(super) fn read(path: &Path, words: impl Iterator<Item = OsString>) -> Outcome<Self> {
        let bad = |what: String| {
            let hint = "see examples/smoke.toml; flags have their long names without dashes";
            Failure::from(Error::format(path, "", what, hint))
        };
        let text = fs::read_to_string(path).map_err(|error| Error::io(path, error))?;
        let malformed = |error: toml::de::Error| {
            let line = text[..error.span().map_or(0, |span| span.start)].lines().count().max(1);
            bad(format!("line {line}: {}", error.message().lines().next().unwrap_or_default()))
        };
        let mut tables: Table = text.parse().map_err(malformed)?;
        let grid = tables.remove("grid").map(Value::try_into::<GridFile>).transpose();
        let grid = grid.map_err(|error| bad(format!("[grid]: {}", error.message())))?;
        let particles = tables.remove("particles").map(|table| files(&table)).transpose().map_err(bad)?;
        let folder = path.parent().unwrap_or(Path::new("."));
        let mut flags: Vec<OsString> = Vec::new();
        for light in tables.remove("light").as_ref().and_then(Value::as_array).into_iter().flatten() {
            flags.extend(["--light".into(), light_words(light, folder).map_err(bad)?.into()]);
        }
        if let Some(keys) = tables.get("camera").and_then(Value::as_array) {
            for key in keys {
                flags.extend(["--camera".into(), camera_words(key).map_err(bad)?.into()]);
            }
            tables.remove("camera");
        }
        for (name, table) in &tables {
            let table = table.as_table().ok_or_else(|| bad(format!("'{name}' is no table")))?;
            for (key, value) in table {
                flags.extend(flag(key, value).map_err(bad)?.into_iter().map(OsString::from));
            }
        }
        if grid.is_some() && particles.is_some() {
            return Err(bad("[grid] and [particles] exclude each other".into()));
        }
        // The scene's flags come first: of two the last counts.
        let mut words: Vec<OsString> = words.collect();
        let verb = words.iter().position(|word| word == "render").map_or(words.len(), |place| place + 1);
        if let Some(files) = particles {
            words.retain(|word| Path::new(word) != path);
            let found = |file: String| {
                if file.starts_with("synthetic:") { file.into() } else { folder.join(file).into() }
            };
            words.extend(files.into_iter().map(found));
        } else if grid.is_none() {
            return Err(bad("it has neither [grid] nor [particles]".into()));
        }
        words.splice(verb..verb, flags);
        let cli = Cli::try_parse_from(words).map_err(|error| {
            let text = error.to_string();
            let line = text.lines().next().unwrap_or_default().trim_start_matches("error: ").to_string();
            bad(line)
        })?;
        let Verb::Render(mut args) = cli.verb else { return Err(bad("only render takes a scene".into())) };
        names::expand(&mut args.input)?;
        Ok(Self { path: path.to_path_buf(), args: *args, grid })
    }

    /// What reads the density of `[grid]`; `None` if the scene has particles instead.
    pub(super) fn density(&self) -> Option<impl Fn(&Report) -> Outcome<Described>> {
        self.grid.as_ref().map(|grid| |report: &Report| self.read_grid(grid, report))
    }

    fn read_grid(&self, grid: &GridFile, report: &Report) -> Outcome<Described> {
        let file = self.path.parent().unwrap_or(Path::new(".")).join(&grid.file);
        let (size, spacing) = match (grid.size, grid.spacing) {
            (Some(size), Some(spacing)) if grid.array.is_none() => (size, spacing),
            (None, None) if grid.sample.is_none() && grid.origin.is_none() => {
                let array = grid.array.as_deref();
                return Ok(read::described_density(&file, array, grid.scale, report.progress())?);
            }
            _ => {
                let what = "[grid] is neither that of a raw file nor that of an OpenDX, OpenVDB or VTK file";
                let hint = "a raw file needs size and spacing and has no array; others say size, sample, spacing and origin themselves";
                return Err(Error::format(&self.path, "", what, hint).into());
            }
        };
        let raw = RawGrid {
            size,
            sample: Sample::named(grid.sample.as_deref().unwrap_or("u16"))?,
            scale: grid.scale,
            origin: Vec3::from(grid.origin.unwrap_or_default()),
            spacing,
        };
        let grid = read::density(&file, &raw, report.progress())?;
        Ok(Described { grid, conventions: Vec::new() })
    }
}

/// The files of `[particles]`.
fn files(table: &Value) -> Result<Vec<String>, String> {
    let list = table.get("files").and_then(Value::as_array).ok_or("[particles] needs files = [\"NAME\"]")?;
    let name = |value: &Value| value.as_str().map(String::from).ok_or("a file's name is a text");
    Ok(list.iter().map(name).collect::<Result<_, _>>()?)
}

/// What `--light` says, from a table; files are relative to `folder`.
fn light_words(light: &Value, folder: &Path) -> Result<String, String> {
    let kind = light
        .get("kind")
        .and_then(Value::as_str)
        .ok_or("[[light]] needs kind = \"sun\", \"point\", \"spot\", \"sky\" or \"image\"")?;
    let keys: &[&str] = match kind {
        "sun" => &["along", "irradiance"],
        "point" => &["position", "intensity"],
        "spot" => &["position", "along", "angle", "intensity"],
        "sky" => &["radiance"],
        "image" => &["factor", "file"],
        _ => return Err(format!("no light is called '{kind}': sun, point, spot, sky or image")),
    };
    let mut words = kind.to_string();
    for &key in keys {
        words += &match (key, light.get(key)) {
            ("factor", None) => ":1".into(),
            ("file", Some(Value::String(file))) => format!(":{}", folder.join(file).display()),
            (_, Some(value)) => format!(":{}", word(value)?),
            (_, None) => return Err(format!("a light of kind {kind} needs '{key}'")),
        };
    }
    let unknown =
        light.as_table().and_then(|it| it.keys().find(|key| *key != "kind" && !keys.contains(&key.as_str())));
    unknown.map_or(Ok(words), |key| Err(format!("a light of kind {kind} has no '{key}'")))
}

/// What `--camera` says, from a table.
fn camera_words(key: &Value) -> Result<String, String> {
    let key = key.as_table().ok_or("a [[camera]] is a table: at, eye, look-at, up, fov or ortho, move")?;
    let words = key.iter().map(|(name, value)| Ok(format!("{}={}", name.replace('_', "-"), word(value)?)));
    Ok(words.collect::<Result<Vec<_>, String>>()?.join(" "))
}

/// A flag with its value; a switch has none.
fn flag(key: &str, value: &Value) -> Result<Vec<String>, String> {
    let name = format!("--{}", key.replace('_', "-"));
    Ok(match value {
        Value::Boolean(true) => vec![name],
        Value::Boolean(false) => Vec::new(),
        value => vec![format!("{name}={}", word(value)?)],
    })
}

/// A value as the command line writes it.
fn word(value: &Value) -> Result<String, String> {
    match value {
        Value::String(text) => Ok(text.clone()),
        Value::Integer(number) => Ok(number.to_string()),
        Value::Float(number) => Ok(number.to_string()),
        Value::Array(values) => Ok(values.iter().map(word).collect::<Result<Vec<_>, _>>()?.join(",")),
        other => Err(format!("a {} is no value of a flag", other.type_str())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_say_what_flags_say() {
        let table: Table = "eye = [1, 2.5, -3]\nalpha = true\nlook_at = 'x'\nstrict = false".parse().unwrap();
        let words: Vec<String> = table.iter().flat_map(|(key, value)| flag(key, value).unwrap()).collect();
        // Tables are sorted by key.
        assert_eq!(words, ["--alpha", "--eye=1,2.5,-3", "--look-at=x"]);
        assert!(flag("eye", &Value::Table(Table::new())).is_err());
    }

    #[test]
    fn cameras_are_written_like_the_flag() {
        let camera = |text: &str| camera_words(&Value::Table(text.parse().unwrap()));
        let words = camera("at = 12\neye = [1, 2.5, 3]\nlook_at = [0, 0, 0]\nmove = 'straight'").unwrap();
        assert_eq!(words, "at=12 eye=1,2.5,3 look-at=0,0,0 move=straight");
        assert!(camera("eye = { x = 1 }").is_err());
    }

    #[test]
    fn lights_are_written_like_the_flag() {
        let light = |text: &str| light_words(&Value::Table(text.parse().unwrap()), Path::new("a/b"));
        assert_eq!(light("kind = 'sun'\nalong = [0, -1, 0]\nirradiance = 3.5").unwrap(), "sun:0,-1,0:3.5");
        assert_eq!(light("kind = 'sky'\nradiance = [1, 2, 3]").unwrap(), "sky:1,2,3");
        let image = "kind = 'image'\nfile = 'x.hdr'\nfactor = 2";
        assert_eq!(light(image).unwrap(), "image:2:a/b/x.hdr");
        for bad in
            ["", "kind = 'image'", "kind = 'moon'", "kind = 'sky'", "kind = 'sky'\nradiance = 1\ncolor = 2"]
        {
            assert!(light(bad).is_err(), "{bad}");
        }
    }
}
