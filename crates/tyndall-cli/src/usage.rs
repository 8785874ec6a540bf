//! A command line that makes no sense, in one line; and what to do with a file but no verb.

use std::error::Error as _;
use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;

use clap::CommandFactory;
use clap::error::{ContextKind, Error, ErrorKind};

use crate::args::Cli;
use crate::report::{Failure, print};

/// Prints help and version as they are, everything else in one line.
pub(crate) fn explain(error: &Error) -> ExitCode {
    let wanted = matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion);
    if wanted || error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        let text = error.render();
        // Help is printed as the terminal allows; where it cannot be printed, there is nobody to tell.
        let _ = if wanted {
            print(text.to_string().as_bytes())
        } else {
            error.print().map_err(|_| Failure::Usage(String::new()))
        };
        return ExitCode::from(if wanted { 0 } else { 2 });
    }
    let ours = error.source().is_some_and(|source| source.is::<tyndall::Error>());
    let more = if ours { "" } else { " — see tyndall --help" };
    let failure = Failure::Usage(format!("{}{more}", reason(error)));
    eprintln!("{failure}");
    failure.exit_code()
}

/// Flags of other programs, and what is here for them.
const ELSEWHERE: [(&[&str], &str); 17] = [
    (
        &["--ao", "--ambient-occlusion", "--shadows"],
        "part of the default look; --look headlight and --look flat are without",
    ),
    (&["--bg", "--background-color"], "--background COLOR"),
    (&["--colormap", "--palette", "--lut"], "--cmap NAME"),
    (&["--component"], "--color v.x, or --color '|v|'"),
    (&["--cpu"], "--device cpu"),
    (&["--density", "--kappa"], "--extinction X, per length where the density is 1"),
    (&["--focal-point"], "--look-at X,Y,Z, or --center WHERE, which finds places, too"),
    (&["--gpu"], "--device gpu"),
    (
        &["--height", "--resolution", "--width"],
        "--size WIDTHxHEIGHT in pixels; how high what is shown is, --ortho HEIGHT",
    ),
    (&["--jobs", "--nthreads"], "--threads N"),
    (&["--min-pixel", "--radius-clamp"], "--radius 'max(radius, R)', with the attribute of the radii"),
    (&["--movie", "--mp4", "--gif", "--video"], "-o NAME.mp4, .gif or .webp, of all frames"),
    (&["--phase"], "--phase-g G"),
    (&["--transparent"], "--alpha"),
    (&["--turntable", "--rotate", "--spin"], "--orbit 360"),
    (&["--vmin", "--vmax", "--clim", "--limits"], "--range LOW:HIGH"),
    (&["--zoom"], "--fov DEGREES, the fewer the nearer; with parallel rays --ortho HEIGHT"),
];

/// What is meant by a flag of another program.
fn meant(error: &Error) -> Option<String> {
    let context = |kind| error.get(kind).map(ToString::to_string);
    let flag = context(ContextKind::InvalidArg)?;
    if error.kind() == ErrorKind::InvalidValue
        && flag.starts_with("--mode ")
        && context(ContextKind::InvalidValue)? == "emission"
    {
        return Some("--mode cannot be 'emission' — try: --mode medium --optics emission".into());
    }
    let is_flag = |(flags, _): &&(&[&str], &str)| flags.contains(&&*flag);
    let (_, instead) =
        ELSEWHERE.iter().find(is_flag).filter(|_| error.kind() == ErrorKind::UnknownArgument)?;
    Some(format!("there is no {flag}; here it is {instead}"))
}

/// The error in one line, without its layout. Where one of our own values was refused, its reason stands for itself.
pub(crate) fn reason(error: &Error) -> String {
    if let Some(reason) = error.source().and_then(|source| source.downcast_ref::<tyndall::Error>()) {
        let argument = error.get(ContextKind::InvalidArg).map(ToString::to_string).unwrap_or_default();
        let flag = argument.split(' ').next().unwrap_or_default();
        return match reason {
            tyndall::Error::Setting { value, allowed, .. } if flag.starts_with("--") => {
                format!("{flag} cannot be '{value}' — {allowed}")
            }
            _ => reason.to_string(),
        };
    }
    if let Some(meant) = meant(error) {
        return meant;
    }
    let text = error.render().to_string();
    let mut parts: Vec<String> = Vec::new();
    for line in text.lines().map(str::trim).filter(|line| !line.is_empty()) {
        if line.starts_with("Usage:") {
            break;
        }
        if !line.starts_with("For more information") && !line.starts_with("tip: to pass '-") {
            parts.push(line.trim_start_matches("error: ").to_string());
        }
    }
    let taken = match error.kind() {
        ErrorKind::MissingRequiredArgument => taken(std::env::args()).unwrap_or_default(),
        _ => String::new(),
    };
    format!("{}{taken}", parts.join(" — ").replace(": — ", ": "))
}

/// Says which file was taken for the value of a flag that takes any words or none, if one was.
fn taken(words: impl Iterator<Item = String>) -> Option<String> {
    let words: Vec<String> = words.collect();
    let found = words.windows(2).find(|pair| {
        matches!(pair[0].as_str(), "--bar" | "--time-label")
            && (Path::new(&pair[1]).exists() || pair[1].starts_with("synthetic:"))
    })?;
    Some(format!(" — '{}' was taken for the value of {}: name files before it", found[1], found[0]))
}

/// Words without a verb: a file that wants to be seen, or a verb that does not exist.
pub(crate) fn no_verb(words: &[OsString]) -> Failure {
    let word = words.first().map(|word| word.to_string_lossy().into_owned()).unwrap_or_default();
    if Path::new(&word).exists() || word.starts_with("synthetic:") {
        let quoted = if word.contains([' ', '?', '*', '&']) { format!("'{word}'") } else { word.clone() };
        return Failure::Usage(format!(
            "no verb for '{word}' — this version has no viewer yet; try: tyndall render {quoted} -o picture.png, or: tyndall \
             info {quoted}"
        ));
    }
    let command = Cli::command();
    let verbs: Vec<&str> = command.get_subcommands().map(clap::Command::get_name).collect();
    Failure::Usage(format!("'{word}' is neither a verb nor a file — verbs: {}", verbs.join(" ")))
}
