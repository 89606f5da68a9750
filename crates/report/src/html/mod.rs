//! `report.html`: one file without network and without scripts, for screen and paper.
//!
//! The templates under `templates/report/` hold the words and the layout, [`view`], [`matrix`], [`test_view`] and
//! [`messages`] prepare what they show. Every value passes [`Escape`]; nothing here marks a text as safe except
//! the diagrams and the pictures of courses, which are templates of their own and escape what they show.

mod courses;
mod escape;
mod evidence;
mod exploration_view;
mod matrix;
mod message_coverage_view;
mod messages;
mod overview_view;
mod pretty;
mod source_view;
mod test_view;
mod thinning;
mod timeline;
pub(super) mod view;

use std::collections::BTreeMap;

use askama::Template;

use courses::Courses;
pub use escape::Escape;
use exploration_view::Grid;

use super::fleet;
use super::latency;
use super::sources::Sources;
use super::statement;
use matrix::ChapterView;
use message_coverage_view::CoverageView;
use messages::{Gallery, MessageView};
use overview_view::{AdviceView, FindingView, advice_views, finding_views};
use tck_journal::event::Setting;
use tck_journal::{Event, Journal};
use tck_result::{Capability, RunResult};
use test_view::TestView;
use thinning::Thinning;
use view::{Badge, CountRow, MonitorView};

/// The result as one HTML page. Without a journal it has no messages and no sequence diagrams. A page that would be too
/// large is thinned until it is not, see [`thinning`], and says so.
///
/// # Errors
/// When the template cannot be written; it has no reason to.
pub fn render(result: &RunResult, sources: &Sources, journal: Option<&Journal>) -> Result<String, askama::Error> {
    let mut page = String::new();
    for thinning in Thinning::ALL {
        page = thinned(result, sources, journal, thinning)?;
        if page.len() <= thinning::LARGE {
            break;
        }
    }
    Ok(page)
}

/// The page with this left out.
fn thinned(
    result: &RunResult,
    sources: &Sources,
    journal: Option<&Journal>,
    thinning: Thinning,
) -> Result<String, askama::Error> {
    let anchors = Anchors::of(result);
    let mut gallery = Gallery::new(journal);
    let mut courses = Courses::default();
    let tests = test_view::views(
        result,
        sources,
        &anchors,
        &thinning.of(result),
        &mut gallery,
        &mut courses,
    )?;
    let monitors = view::monitors(result, sources, &anchors, &mut gallery);
    let monitor_messages = gallery.take();
    let monitor_courses = courses.of_monitors(result, &gallery)?;
    let findings = finding_views(result, sources, &anchors, |seq| gallery.shows(seq));
    let shown_tests = tests.iter().filter(|test| !test.not_applicable).count();
    Page {
        title: format!(
            "{}: {}{}",
            statement::device(result),
            if result.partial { "partial run, " } else { "" },
            view::verdict_title(result)
        ),
        badge: Badge::of(result.verdict),
        statement: statement::statement(result),
        partial: statement::partial(result),
        parts: view::parts(result),
        identity: view::identity(result),
        counts: view::counts(result),
        limits: statement::limits(result),
        findings,
        advice: advice_views(result),
        timeline: timeline::strip(result, &anchors, journal)?,
        fleet: result.fleet.as_ref().map(fleet::line).unwrap_or_default(),
        vehicles: result.fleet.as_ref().map_or_else(Vec::new, view::vehicles),
        reactions: match (&result.fleet, fleet::answers(result)) {
            (Some(fleet), _) => match &fleet.reaction {
                Some(reaction) => fleet::plot(reaction, fleet::ORDERS)?,
                None => String::new(),
            },
            (None, Some(answers)) => fleet::plot(&answers, fleet::ANSWERS)?,
            (None, None) => String::new(),
        },
        exploration: explored(result),
        coverage: result
            .message_coverage
            .as_ref()
            .map(|coverage| CoverageView::of(coverage, &anchors)),
        chapters: matrix::chapters(result, sources, &anchors),
        not_applicable: tests.iter().any(|test| test.not_applicable),
        tests,
        shown_tests,
        left_out: thinning.said(),
        monitors,
        monitor_messages,
        monitor_courses,
        capabilities: &result.capabilities,
        deviations: view::deviations(result, &anchors),
        settings: &result.settings,
        latency: result.harness_latency.map_or_else(Vec::new, latency::rows),
        command: journal.map(command).unwrap_or_default(),
        has_journal: journal.is_some(),
        journal: &result.journal,
        tool: &result.tool,
        format: &result.format,
        legend: view::legend(),
    }
    .render()
}

/// The tables of an exploration that have something in them.
fn explored(result: &RunResult) -> Vec<(&'static str, Grid)> {
    let Some(exploration) = &result.exploration else {
        return Vec::new();
    };
    let tables = [
        ("Situations and stimuli", exploration_view::situations(exploration)),
        ("Broken members", exploration_view::members(exploration)),
    ];
    tables.into_iter().filter(|(_, grid)| !grid.rows.is_empty()).collect()
}

/// The command line as recorded in the journal.
fn command(journal: &Journal) -> String {
    let first = journal.entries().first();
    match first.as_ref().map(|entry| entry.event()) {
        Some(Event::RunBegun { header }) => header.command.join(" "),
        _ => String::new(),
    }
}

#[derive(Template)]
#[template(path = "report/report.html")]
struct Page<'a> {
    title: String,
    badge: Badge,
    statement: String,
    partial: Option<String>,
    parts: Vec<view::PartRow>,
    identity: Vec<(&'static str, String)>,
    counts: Vec<CountRow>,
    limits: Vec<String>,
    findings: Vec<FindingView>,
    advice: Vec<AdviceView>,
    timeline: String,
    fleet: String,
    vehicles: Vec<view::VehicleRow>,
    reactions: String,
    exploration: Vec<(&'static str, Grid)>,
    coverage: Option<CoverageView<'a>>,
    chapters: Vec<ChapterView>,
    tests: Vec<TestView>,
    shown_tests: usize,
    /// What was left out of the tests.
    left_out: Option<&'static str>,
    not_applicable: bool,
    monitors: Vec<MonitorView>,
    monitor_messages: Vec<MessageView>,
    /// What was broken, by which monitor, and where the vehicle was.
    monitor_courses: Vec<(String, String, String)>,
    capabilities: &'a [Capability],
    deviations: Vec<view::Deviation>,
    settings: &'a [Setting],
    latency: Vec<latency::Row>,
    command: String,
    has_journal: bool,
    journal: &'a str,
    tool: &'a str,
    format: &'a str,
    legend: Vec<view::LegendRow>,
}

/// The ids things have inside the page. Ids of the result are not used as they are: whoever wrote the result
/// may have made two of them equal, or hostile.
pub(crate) struct Anchors {
    requirements: BTreeMap<String, String>,
    deciders: BTreeMap<String, String>,
}

impl Anchors {
    fn of(result: &RunResult) -> Self {
        let mut anchors = Self {
            requirements: BTreeMap::new(),
            deciders: BTreeMap::new(),
        };
        for (at, requirement) in result.requirements.iter().enumerate() {
            let id = &requirement.id;
            let plain = id.len() <= 40 && id.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'-');
            let anchor = if plain && !id.is_empty() {
                format!("r-{id}")
            } else {
                format!("r--{at}")
            };
            anchors.requirements.entry(id.clone()).or_insert(anchor);
        }
        for (at, test) in result.tests.iter().enumerate() {
            anchors
                .deciders
                .entry(test.id.clone())
                .or_insert(format!("t{}", at + 1));
        }
        for (at, monitor) in result.monitors.iter().enumerate() {
            anchors
                .deciders
                .entry(monitor.id.clone())
                .or_insert(format!("monitor-{}", at + 1));
        }
        anchors
    }

    fn requirement(&self, id: &str) -> Option<String> {
        self.requirements.get(id).cloned()
    }

    /// Of a test or a monitor.
    fn decider(&self, id: &str) -> Option<String> {
        self.deciders.get(id).cloned()
    }
}
