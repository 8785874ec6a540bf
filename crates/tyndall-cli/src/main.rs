//! The command `tyndall`: parses the command line, calls the libraries, says in one line what came of it.
//!
//! `args` defines the language, `values` how its words are written, `scene` what files say in it; each verb has a file; `report` speaks to people.

mod ahead;
mod annotate;
mod args;
mod bench;
mod bench_bodies;
mod bench_culling;
mod bench_density;
#[cfg(feature = "gpu")]
mod bench_gpu;
mod bench_medium;
mod build;
mod camera;
mod convert;
mod culling;
mod cut;
mod device;
mod dry_run;
mod help;
mod illustrate;
mod info;
mod input;
mod json;
mod layers;
mod lights;
mod looks;
mod medium;
mod metadata;
mod names;
mod output;
mod plan;
mod progress;
mod project;
mod render;
mod report;
mod scene;
mod selection;
mod shapes;
mod shot;
mod sources;
mod structure;
mod survey;
mod usage;
mod values;
mod wanted;

use std::process::ExitCode;

use args::{Common, Verb};
use report::{Failure, Outcome, Report};
use scene::Refused;

fn main() -> ExitCode {
    #[cfg(feature = "gpu")]
    without_display();
    let mut cli = match scene::command_line(std::env::args_os().collect()) {
        Ok(cli) => cli,
        Err(Refused::Words(error)) => return usage::explain(&error),
        Err(Refused::Scene(failure)) => {
            eprintln!("{failure}");
            return failure.exit_code();
        }
    };
    progress::listen_to_signals();
    if let Some(Err(failure)) = cli.verb.input().map(names::expand) {
        eprintln!("{failure}");
        return failure.exit_code();
    }
    let done = match cli.verb {
        Verb::Render(args) => with(&args.common, |report| render::run(&args, report)),
        Verb::Info(args) => with(&args.common, |report| info::run(&args, report)),
        Verb::Build(args) => with(&args.common, |report| build::run(&args, report)),
        Verb::Convert(args) => with(&args.common, |report| convert::run(&args, report)),
        Verb::Schema => told(scene::print_schema()),
        Verb::Devices(args) => with(&args.common, device::list),
        Verb::Bench(args) => with(&args.common, |report| bench::run(&args, report)),
        Verb::Completions { shell } => told(help::completions(shell)),
        Verb::Man { verb } => told(help::man(verb.as_deref())),
        Verb::Other(words) => told(Err(usage::no_verb(&words))),
    };
    done.unwrap_or_else(|failure| failure.exit_code())
}

/// Keeps a layer of Mesa's drivers from asking for a display, which it misses loudly where there is none.
#[cfg(feature = "gpu")]
#[expect(unsafe_code, reason = "the environment is shared by all threads")]
fn without_display() {
    // SAFETY: it is the first thing that the process does; nothing else runs yet that could read the environment.
    unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
}

/// Runs a verb with the threads and the voice that it was given.
fn with(common: &Common, verb: impl FnOnce(&Report) -> Outcome<()>) -> Outcome<ExitCode> {
    if let Some(threads) = common.threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build_global();
        if let Err(error) = pool {
            return told(Err(Failure::Usage(format!("--threads cannot be '{threads}' — {error}"))));
        }
    }
    let report = Report::new(common);
    let done = verb(&report);
    if let Err(failure) = &done {
        report.error(failure);
    }
    done.map(|()| ExitCode::SUCCESS)
}

/// Says why a verb without a voice of its own failed.
fn told(done: Outcome<()>) -> Outcome<ExitCode> {
    if let Err(failure) = &done {
        eprintln!("{failure}");
    }
    done.map(|()| ExitCode::SUCCESS)
}
