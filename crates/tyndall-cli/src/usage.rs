//! A command line that makes no sense, in one line; and what to do with a file but no verb.

use std::error::Error as _;
use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;

use clap::CommandFactory;
use clap::error::{Error, ErrorKind};

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

/// The error in one line, without its layout. Where one of our own values was refused, its reason stands for itself.
pub(crate) fn reason(error: &Error) -> String {
    if let Some(reason) = error.source().and_then(|source| source.downcast_ref::<tyndall::Error>()) {
        let argument =
            error.get(clap::error::ContextKind::InvalidArg).map(ToString::to_string).unwrap_or_default();
        let flag = argument.split(' ').next().unwrap_or_default();
        return match reason {
            tyndall::Error::Setting { value, allowed, .. } if flag.starts_with("--") => {
                format!("{flag} cannot be '{value}' — {allowed}")
            }
            _ => reason.to_string(),
        };
    }
    let text = error.render().to_string();
    let mut parts: Vec<String> = Vec::new();
    for line in text.lines().map(str::trim).filter(|line| !line.is_empty()) {
        if line.starts_with("Usage:") {
            break;
        }
        if !line.starts_with("For more information") {
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
