//! Completions and manual pages, from the definition in `args`.

use clap::CommandFactory;

use crate::args::Cli;
use crate::report::{Failure, Outcome, print};

/// Prints the completion script of a shell.
pub(crate) fn completions(shell: clap_complete::Shell) -> Outcome<()> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "tyndall", &mut script);
    print(&script)
}

/// Prints the manual page of the command or of one verb.
pub(crate) fn man(verb: Option<&str>) -> Outcome<()> {
    let mut command = Cli::command();
    command.build();
    let page = match verb {
        None => command,
        Some(name) => {
            let found = command.find_subcommand(name).cloned();
            let found =
                found.ok_or_else(|| Failure::Usage(format!("no verb '{name}' — see tyndall --help")))?;
            let full_name: &'static str = format!("tyndall-{name}").leak();
            found.name(full_name)
        }
    };
    let mut roff = Vec::new();
    let rendered = clap_mangen::Man::new(page).render(&mut roff);
    rendered.map_err(|error| Failure::Output(tyndall::Error::io("stdout", error)))?;
    print(&roff)
}
