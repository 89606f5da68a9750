//! `watch`: judge live traffic.

use std::io::IsTerminal as _;
use std::time::Duration;

use super::args::{Format, Watch as Arguments};
use super::exit::Exit;
use super::problem::Problem;
use super::watch_page::WatchPage;
use crate::ui::{FullScreen, LineOptions, Lines};
use tck_audit::result::AuditResult;
use tck_audit::{Options, page as audited};
use tck_base::diagnostic::Diagnostic;
use tck_base::verdict::Verdict;
use tck_judge::Rules;
use tck_watch::Rotation;
use tck_watch::session::{Settings, Viewer, WatchError, run};
use tokio::sync::watch;

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
            cut: None,
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
    let page = match &arguments.page.address {
        Some(address) => Some(runtime.block_on(WatchPage::start(address, &arguments.at.access.broker))?),
        None => None,
    };
    let json = arguments.format == Format::Json;
    // A full screen would hide the address of the page.
    let whole = !arguments.plain
        && !json
        && page.is_none()
        && std::io::stdin().is_terminal()
        && console::user_attended()
        && console::user_attended_stderr();
    let mut settings = settings;
    let outcome = if whole {
        settings.tick = Duration::from_millis(100);
        let mut screen = FullScreen::open(arguments.at.access.broker.clone())
            .map_err(|error| Problem::Environment(format!("cannot use the whole terminal: {error}; try --plain")))?;
        runtime.block_on(async {
            let interrupt = super::ending::interrupts()?;
            Ok::<_, Problem>(watched(&library.rules, settings, &mut screen, (interrupt, page.as_ref())).await)
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
            Ok::<_, Problem>(watched(&library.rules, settings, &mut lines, (interrupt, page.as_ref())).await)
        })
    };
    if let Some(page) = page {
        let result = outcome.as_ref().ok().and_then(|outcome| outcome.as_ref().ok());
        let verdict = result.map(|result| result.verdict.map_or("none", Verdict::word));
        runtime.block_on(page.finish(verdict));
    }
    runtime.shutdown_background();
    let result = outcome?.map_err(|error| problem(arguments, &error))?;
    if json {
        let mut value = serde_json::to_value(&result).map_err(|error| Problem::Environment(error.to_string()))?;
        value["kind"] = "result".into();
        super::print(&format!("{value}\n"))?;
    } else {
        super::print(&audited::page(&result))?;
    }
    Ok(match result.verdict {
        None if !result.vehicles.is_empty() => Exit::Undecided,
        verdict => Exit::of(verdict),
    })
}

/// Watches for a viewer, and for the page beside it where there is one.
async fn watched(
    rules: &Rules,
    settings: Settings,
    viewer: &mut impl Viewer,
    (interrupt, page): (watch::Receiver<bool>, Option<&WatchPage>),
) -> Result<AuditResult, WatchError> {
    match page {
        Some(page) => run(rules, settings, &mut page.beside(viewer), interrupt).await,
        None => run(rules, settings, viewer, interrupt).await,
    }
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
