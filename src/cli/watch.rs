//! `watch`: judge live traffic.

use std::io::IsTerminal as _;
use std::time::Duration;

use super::args::{Format, Watch as Arguments};
use super::exit::Exit;
use super::problem::Problem;
use crate::ui::{FullScreen, LineOptions, Lines};
use tck_audit::{Options, page};
use tck_base::diagnostic::Diagnostic;
use tck_watch::Rotation;
use tck_watch::session::{Settings, WatchError, run};

/// `watch`.
pub fn watch(arguments: &Arguments) -> Result<Exit, Problem> {
    let library = crate::assets::library(arguments.suites.own())?;
    let rotation = Rotation {
        size: arguments.rotate_size,
        every: arguments.rotate_every,
        keep: arguments.keep,
    };
    let settings = Settings {
        endpoint: super::discover::endpoint(&arguments.at.access)?,
        listen: arguments.listen.clone(),
        filters: arguments.at.filters(),
        options: Options {
            topic_template: arguments.topic_template.clone(),
            vehicles: arguments.vehicle.clone(),
            only: arguments.only.clone(),
            protocol: None,
            shard: None,
        },
        record: arguments.record.clone().map(|path| (path, rotation)),
        metrics: arguments.metrics.clone(),
        fail_fast: arguments.fail_fast,
        time: arguments.time,
        tick: Duration::from_millis(500),
    };
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .map_err(|error| Problem::Environment(format!("cannot start: {error}")))?;
    let json = arguments.format == Format::Json;
    let whole = !arguments.plain
        && !json
        && std::io::stdin().is_terminal()
        && console::user_attended()
        && console::user_attended_stderr();
    let mut settings = settings;
    let watched = if whole {
        settings.tick = Duration::from_millis(100);
        let mut screen = FullScreen::open(arguments.at.access.broker.clone())
            .map_err(|error| Problem::Environment(format!("cannot use the whole terminal: {error}; try --plain")))?;
        runtime.block_on(async {
            let interrupt = super::ending::interrupts()?;
            Ok::<_, Problem>(run(&library.rules, settings, &mut screen, interrupt).await)
        })
    } else {
        let mut lines = Lines::of_process(LineOptions {
            every: arguments.every,
            json,
            summary: arguments.summary,
            color: super::color() == tck_report::text::Color::Always,
        });
        runtime.block_on(async {
            let interrupt = super::ending::interrupts()?;
            Ok::<_, Problem>(run(&library.rules, settings, &mut lines, interrupt).await)
        })
    };
    runtime.shutdown_background();
    let result = watched?.map_err(|error| problem(arguments, &error))?;
    if json {
        let mut value = serde_json::to_value(&result).map_err(|error| Problem::Environment(error.to_string()))?;
        value["kind"] = "result".into();
        super::print(&format!("{value}\n"))?;
    } else {
        super::print(&page::page(&result))?;
    }
    Ok(match result.verdict {
        None if !result.vehicles.is_empty() => Exit::Undecided,
        verdict => Exit::of(verdict),
    })
}

fn problem(arguments: &Arguments, error: &WatchError) -> Problem {
    match error {
        WatchError::Audit(error) => Diagnostic::whole("watch", error.to_string()).into(),
        WatchError::NeverConnected(why) => Problem::Environment(format!(
            "cannot listen on {} to {}: {why}",
            arguments.at.access.broker,
            arguments.at.filters().join(", ")
        )),
        WatchError::Link(_) | WatchError::Record(_) => Problem::Environment(error.to_string()),
    }
}
