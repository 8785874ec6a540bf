//! What is written into a picture so that it can be made again: version, command line, inputs, settings, guesses.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use tyndall::render::Settings;
use tyndall_io::Sequence;

use crate::args::Render;
use crate::culling;
use crate::medium::values::LightSpec;
use crate::plan::Picture;

/// Keys and texts of the pictures of a frame.
pub(crate) fn of_frame(
    args: &Render,
    sequence: &Sequence,
    frame: usize,
    time: Option<f64>,
    settings: &Settings,
    guesses: &[String],
) -> Vec<(String, String)> {
    let paths: Vec<&Path> = sequence.paths().iter().map(|path| path.as_ref()).collect();
    let mut entries = common(args, &paths, settings, guesses);
    entries.push(("Frame".into(), format!("{frame} of {} ({})", sequence.len(), sequence.name(frame))));
    if let Some(time) = time {
        entries.push(("Time".into(), time.to_string()));
    }
    entries
}

/// Keys and texts of the pictures of a density from a file.
pub(crate) fn of_grid(
    args: &Render,
    path: &Path,
    settings: &Settings,
    guesses: &[String],
) -> Vec<(String, String)> {
    common(args, &[path], settings, guesses)
}

/// Those of one picture of a frame: with its name among all that were asked for.
pub(crate) fn of_picture(mut of_frame: Vec<(String, String)>, picture: &Picture) -> Vec<(String, String)> {
    of_frame.push(("Picture".into(), picture.name.display().to_string()));
    of_frame
}

/// What makes pictures.
pub(crate) fn software() -> String {
    format!("Tyndall {}", env!("CARGO_PKG_VERSION"))
}

fn common(args: &Render, paths: &[&Path], settings: &Settings, guesses: &[String]) -> Vec<(String, String)> {
    let others = beside(args).filter(|path| !paths.contains(path));
    let inputs: Vec<String> = paths.iter().copied().chain(others).map(input).collect();
    let Settings { width, height, samples, seed, culling } = settings;
    let culling = culling::description(culling);
    let entries = [
        ("Software", software()),
        ("Command", command_line()),
        ("Scene", args.origin.text.clone()),
        ("Inputs", inputs.join("\n")),
        ("Seed", seed.to_string()),
        ("Settings", format!("{width}x{height} pixels, {samples} samples, seed {seed}, {culling}")),
        ("Guesses", guesses.join("\n")),
    ];
    entries.into_iter().map(|(key, text)| (key.to_string(), text)).collect()
}

/// Files that a picture reads beside its particles or grids: of scene files and layers, of the camera, lights and meshes.
fn beside(args: &Render) -> impl Iterator<Item = &Path> {
    let stage = args.camera.stage().ok().flatten().map(|stage| &stage.file);
    let images = args.medium.lights.iter().filter_map(|light| match light {
        LightSpec::Image(_, file) => Some(file),
        _ => None,
    });
    let all = args.origin.files.iter().chain(stage).chain(images).chain(args.shapes.files());
    all.map(PathBuf::as_path)
}

/// The command line, quoted so that a shell reads it as it was.
fn command_line() -> String {
    let quoted = std::env::args_os().enumerate().map(|(place, word)| {
        let word = if place == 0 { "tyndall".into() } else { word.to_string_lossy().into_owned() };
        let plain = |letter: char| letter.is_alphanumeric() || "_-+=:,./%@".contains(letter);
        if !word.is_empty() && word.chars().all(plain) {
            word
        } else {
            format!("'{}'", word.replace('\'', r"'\''"))
        }
    });
    quoted.collect::<Vec<_>>().join(" ")
}

/// A file's name, size and time of change.
pub(crate) fn input(path: &Path) -> String {
    let Ok(found) = fs::metadata(path) else { return path.display().to_string() };
    let changed = found.modified().ok().map_or(String::new(), |time| format!(", changed {}", utc(time)));
    format!("{} ({} bytes{changed})", path.display(), found.len())
}

/// A time as `2026-11-23T08:27:45Z`. Source of the calendar: Howard Hinnant, chrono-compatible low-level date algorithms, 2013.
fn utc(time: SystemTime) -> String {
    let secs = time.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let (days, secs) = (secs / 86_400 + 719_468, secs % 86_400);
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * shifted_month + 2) / 5 + 1;
    let month = if shifted_month < 10 { shifted_month + 3 } else { shifted_month - 9 };
    let year = 400 * era + year_of_era + u64::from(month <= 2);
    format!("{year:04}-{month:02}-{day:02}T{:02}:{:02}:{:02}Z", secs / 3600, secs / 60 % 60, secs % 60)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn times_are_those_of_the_calendar() {
        for (secs, text) in [
            (0, "1970-01-01T00:00:00Z"),
            (951_782_399, "2000-02-28T23:59:59Z"),
            (951_782_400, "2000-02-29T00:00:00Z"),
            (1_709_251_200, "2024-03-01T00:00:00Z"),
            (4_102_444_799, "2099-12-31T23:59:59Z"),
        ] {
            assert_eq!(utc(UNIX_EPOCH + Duration::from_secs(secs)), text);
        }
    }
}
