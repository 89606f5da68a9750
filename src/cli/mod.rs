//! The command line: parse, call, map the outcome to an exit code. One file per command.

pub mod args;
mod audit;
mod audited;
mod baseline;
mod browser;
mod bundle_state;
mod campaign;
mod certify;
mod changes;
mod device;
mod discover;
mod ending;
mod events;
pub mod exit;
mod explained;
mod explore;
mod explored;
mod export;
mod follow;
mod gate;
mod history;
mod impaired;
mod language;
mod like;
mod list;
mod log;
mod merge;
mod message_stream;
mod messages;
mod migrate;
mod open_files;
mod outputs;
mod page;
mod pipeline;
mod plan;
mod problem;
mod qualified;
mod qualify;
mod recordings;
mod reference;
mod rejudged;
mod report;
mod result_bundle;
mod run;
mod screen;
mod shard;
mod shell;
mod signals;
mod simulate;
mod slice;
mod validate;
mod watch;
mod watch_page;
mod within;

use std::io::Write as _;
use std::process::ExitCode;
use std::sync::Arc;

use clap::Parser as _;

use args::{Cli, Command, Format};
use exit::Exit;
use list::print;
use problem::Problem;
use tck_base::diagnostic::Diagnostic;
use tck_judge::Library;
use tck_pack::{NoPack, Pack, Packs, Role};
use tck_report::text::Color;

/// The program.
#[must_use]
pub fn main() -> ExitCode {
    // A run calls this program in this way to keep hold of the device that it starts.
    if let Some(code) = tck_run::supervisor::called(std::env::args_os()) {
        return code;
    }
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version are no mistakes; a reader that has gone away is none either.
            if error.use_stderr() && wants_json() {
                eprintln!("{}", mistyped(&error).to_json());
            } else {
                let _ = error.print();
            }
            if error.use_stderr() {
                let words: Vec<String> = std::env::args().collect();
                outputs::Owed::by_words(&words).settle(&mistyped(&error));
            }
            return ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2));
        }
    };
    let owed = outputs::Owed::by(&cli.command);
    let outcome = match within::refuse(&cli) {
        Ok(()) => owed.around(|outputs| dispatch(&cli, outputs)),
        Err(problem) => {
            owed.settle(&problem);
            Err(problem)
        }
    };
    let exit = outcome.unwrap_or_else(|problem| {
        let color = console::colors_enabled_stderr();
        match cli.command.format() {
            Format::Json => eprintln!("{}", problem.to_json()),
            Format::Text => eprintln!("{}", problem.render(color)),
        }
        problem.exit()
    });
    ExitCode::from(exit.code())
}

/// Calls the command.
fn dispatch(cli: &Cli, outputs: &outputs::Outputs<'_>) -> Result<Exit, Problem> {
    log::begin(cli.log_file.as_deref(), cli.command.verbose())?;
    match &cli.command {
        Command::Run(arguments) => run::run_command(arguments, outputs),
        Command::Certify(arguments) => certify::certify(arguments, outputs),
        Command::List(arguments) => list::list(arguments),
        Command::Explain(arguments) => list::explain(arguments),
        Command::Audit(arguments) => audit::audit(arguments),
        Command::Watch(arguments) => watch::watch(arguments),
        Command::Migrate(arguments) => migrate::migrate(arguments),
        Command::Explore(arguments) => explore::explore(arguments),
        Command::Validate(arguments) => validate::validate(arguments),
        Command::Simulate(arguments) => simulate::simulate(arguments),
        Command::Report(arguments) => report::report(arguments, outputs),
        Command::Campaign(arguments) => campaign::campaign(arguments),
        Command::History(arguments) => history::history(arguments),
        Command::Qualify(arguments) => qualify::qualify(arguments),
        Command::Discover(arguments) => discover::discover(arguments),
        Command::Init(arguments) => discover::init(arguments),
        Command::Completions(arguments) => shell::completions(arguments),
        Command::Man(arguments) => shell::man(arguments),
    }
}

/// Says something on standard error. That nobody reads there is no failure.
fn tell(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// Whether a command line that cannot be read asks for JSON.
fn wants_json() -> bool {
    let words: Vec<String> = std::env::args().collect();
    let asked = words.windows(2).any(|pair| pair[0] == "--format" && pair[1] == "json");
    let by_variable = || std::env::var("VDA5050_TCK_FORMAT").is_ok_and(|format| format == "json");
    asked || words.iter().any(|word| word == "--format=json") || by_variable()
}

/// What is wrong with a command line, as any other mistake.
fn mistyped(error: &clap::Error) -> Problem {
    let text = error.render().to_string();
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    let title = lines.next().unwrap_or("the command line cannot be read");
    let rest: Vec<&str> = lines.collect();
    let title = title.strip_prefix("error: ").unwrap_or(title);
    Diagnostic::whole("usage", title).hint(rest.join("\n")).into()
}

/// Whether results on standard output are coloured.
fn color() -> Color {
    let no_color = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    if console::colors_enabled() && !no_color {
        Color::Always
    } else {
        Color::Never
    }
}

/// The pack of a version; the newest one unless said.
fn pack(library: &Library, protocol: Option<&str>) -> Result<Arc<Pack>, Problem> {
    let packs = &library.rules.packs;
    let found = protocol.map_or_else(|| Ok(packs.latest()), |wanted| packs.find(wanted));
    Ok(Arc::clone(found.map_err(|none| missing(&none))?))
}

/// The pack by which devices of one side of a version are judged and simulated, where suites and catalogue are not needed, which take a
/// while to be read; the newest one unless said.
fn pack_for_devices(packs: &Packs, protocol: Option<&str>, role: Role) -> Result<Arc<Pack>, Problem> {
    let found = protocol.map_or_else(|| Ok(packs.latest()), |wanted| packs.for_devices(wanted, role));
    Ok(Arc::clone(found.map_err(|none| missing(&none))?))
}

fn missing(none: &NoPack) -> Problem {
    Diagnostic::whole(none.code(), none.to_string())
        .hint(none.hint())
        .into()
}
