//! The program `remesh`: parses the command line, connects, runs one command, tells the result.

mod args;
mod charts;
mod context;
mod failure;
mod files;
mod history;
mod inspect;
mod json;
mod operations;
mod patches;
mod render;
mod run;
mod specs;
mod stages;
mod steps;
mod summary;
mod ui;

use args::{ChartVerb, Cli, Command, GlobalArgs, SessionVerb};
use clap::{CommandFactory, Parser};
use context::Context;
use failure::{Failure, Outcome, exit};
use std::error::Error;
use std::ffi::OsString;
use std::future::Future;
use std::process::ExitCode;
use std::time::Duration;
use tonic::transport::Channel;
use ui::{Report, Ui};

/// What the in-process server is started with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LocalOptions {
    /// Threads that compute; `None`: all cores.
    pub threads: Option<u32>,
}

/// Error of starting the in-process server.
pub type StartError = Box<dyn Error + Send + Sync>;

/// Environment variable with the endpoint.
const ENDPOINT_VARIABLE: &str = "REMESH_ENDPOINT";

/// How long a broken-off command may take to tell the daemon so.
const FAREWELL: Duration = Duration::from_secs(2);

/// Runs the program with the arguments of the process. `start` makes a server inside the process and gives a channel to it; it is
/// called only if no endpoint is given.
pub fn main<S, F>(start: S) -> ExitCode
where
    S: FnOnce(LocalOptions) -> F,
    F: Future<Output = Result<Channel, StartError>>,
{
    ExitCode::from(main_from(std::env::args_os(), std::env::var(ENDPOINT_VARIABLE).ok(), start))
}

/// The same with given arguments and environment; the exit code.
fn main_from<S, F>(arguments: impl IntoIterator<Item = OsString>, variable: Option<String>, start: S) -> u8
where
    S: FnOnce(LocalOptions) -> F,
    F: Future<Output = Result<Channel, StartError>>,
{
    let Cli { mut global, command } = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version are errors to clap as well, with exit code 0.
            let _ = error.print();
            return error.exit_code().try_into().unwrap_or(exit::USAGE);
        }
    };
    let ui = Ui::new(global.json, global.quiet);
    let runtime = match tokio::runtime::Builder::new_multi_thread().enable_all().build() {
        Ok(runtime) => runtime,
        Err(error) => return tell_failure(ui, &global, &Failure::Other(format!("cannot start: {error}"))),
    };
    // The option wins over the environment, and so does --threads, which only makes sense without a daemon.
    if global.endpoint.is_none() && global.threads.is_none() {
        global.endpoint = variable.filter(|value| !value.is_empty());
    }
    let outcome = runtime.block_on(conduct(&global, ui, &command, start));
    // Threads of a cancelled computation need not be waited for.
    runtime.shutdown_background();
    match outcome {
        Ok(code) => code,
        Err(failure) => tell_failure(ui, &global, &failure),
    }
}

/// Connects and runs a command until it is done or interrupted; in any case cleans up.
async fn conduct<S, F>(global: &GlobalArgs, ui: Ui, command: &Command, start: S) -> Outcome<u8>
where
    S: FnOnce(LocalOptions) -> F,
    F: Future<Output = Result<Channel, StartError>>,
{
    if global.endpoint.is_none() && needs_daemon(command) {
        return Err(Failure::Usage(format!(
            "this command works on a session, which lives in a daemon: start `remeshd` and give --endpoint URL or set {ENDPOINT_VARIABLE}"
        )));
    }
    let context = tokio::select! {
        context = Context::open(global, ui, start) => context?,
        _ = tokio::signal::ctrl_c() => return Err(Failure::Interrupted),
    };
    let outcome = tokio::select! {
        outcome = execute(&context, command) => outcome,
        _ = tokio::signal::ctrl_c() => Err(Failure::Interrupted),
    };
    // Dropping the call has cancelled it; the reset goes out with the deletion of the session.
    let _ = tokio::time::timeout(FAREWELL, context.close()).await;
    outcome
}

/// Verbs that only make sense on a session that outlives the process.
fn needs_daemon(command: &Command) -> bool {
    match command {
        Command::Session(_) | Command::Import(_) | Command::Set(_) | Command::Partition(_) | Command::Patch(_) => true,
        Command::Chart(args) => args.verb.is_some() || args.all.target.as_deref().is_some_and(args::names_session),
        Command::Remesh(_) | Command::Plan(_) | Command::Export(_) | Command::Rollback(_) => true,
        Command::History(_) | Command::Operations(_) => true,
        Command::Quality(args) => args.session.is_some(),
        Command::Diagnose(args) => args.session.is_some(),
        Command::Render(args) => args.session.is_some(),
        Command::Run(_) | Command::Sample(_) | Command::Status => false,
    }
}

async fn execute(context: &Context, command: &Command) -> Outcome<u8> {
    let answer = |report: Report| {
        context.ui.report(&report, true);
        Ok(0)
    };
    let done = |report: Report| {
        context.ui.report(&report, false);
        Ok(0)
    };
    match command {
        Command::Run(args) => done(run::run(context, args).await?),
        Command::Sample(args) => done(inspect::sample(context, args).await?),
        Command::Render(args) => done(render::render(context, args).await?),
        Command::Quality(args) => answer(inspect::quality(context, args).await?),
        Command::Diagnose(args) => {
            let (report, remeshable) = inspect::diagnose(context, args).await?;
            context.ui.report(&report, true);
            Ok(if remeshable { 0 } else { exit::REFUSED })
        }
        Command::Status => answer(inspect::status(context).await?),
        Command::Session(args) => {
            let report = steps::session(context, &args.verb).await?;
            context.ui.report(&report, !matches!(args.verb, SessionVerb::Delete(_) | SessionVerb::SetTtl { .. }));
            Ok(0)
        }
        Command::Import(args) => done(steps::import(context, args).await?),
        Command::Set(args) => done(steps::set(context, args).await?),
        Command::Partition(args) => answer(patches::partition(context, args).await?),
        Command::Patch(args) => done(patches::verb(context, &args.verb).await?),
        Command::Chart(args) => {
            let (report, code) = match &args.verb {
                Some(verb) => charts::verb(context, verb).await?,
                None => charts::all(context, &args.all).await?,
            };
            let is_answer = !matches!(args.verb, Some(ChartVerb::Set(_) | ChartVerb::Reset(_)));
            context.ui.report(&report, is_answer);
            Ok(code)
        }
        Command::Remesh(args) => answer(steps::remesh(context, args).await?),
        Command::Plan(name) => answer(steps::plan(context, &name.session).await?),
        Command::Export(args) => done(steps::export(context, args).await?),
        Command::History(verb) => done(history::verb(context, verb).await?),
        Command::Operations(verb) => {
            let (report, code) = operations::verb(context, verb).await?;
            context.ui.report(&report, true);
            Ok(code)
        }
        Command::Rollback(args) => done(steps::rollback(context, args).await?),
    }
}

/// Tells a failure on standard error, with `--json` as an object on standard output, and gives its exit code.
fn tell_failure(ui: Ui, global: &GlobalArgs, failure: &Failure) -> u8 {
    if global.json {
        ui.report(&Report { text: String::new(), json: json::failure(failure) }, true);
    }
    match failure {
        Failure::Usage(message) => eprintln!("error: {message}\n\n{}\nFor more, try --help.", Cli::command().render_usage()),
        other => eprintln!("error: {other}"),
    }
    failure.exit_code()
}

#[cfg(test)]
mod tests;
