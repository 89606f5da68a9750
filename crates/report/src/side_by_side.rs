//! Several runs side by side: a row for each requirement, a column for each run, and what became better or worse.
//!
//! Whether the runs may be compared at all is for the reader to say; what makes them different in kind stands first.

use askama::Template;

use super::compare::{Standing, Trend, compare};
use super::html::view::{self, Badge};
use super::sources::Sources;
use super::statement;
use tck_result::{RequirementResult, RunResult};

/// One run: a column.
struct Column {
    name: String,
    device: String,
    firmware: String,
    started: String,
    badge: Badge,
    /// `263 of 268`.
    decided: String,
    /// What changed since the column before it.
    better: usize,
    worse: usize,
}

/// One requirement: a row.
struct Row {
    id: String,
    section: String,
    text: String,
    cells: Vec<Cell>,
    /// Whether all runs say the same.
    same: bool,
    /// What became of it from one run to the next that is to be looked at first: it became worse, or is lost.
    worst: Option<Trend>,
}

struct Cell {
    badge: Badge,
    /// `worse`, `better` or nothing.
    trend: &'static str,
}

#[derive(Template)]
#[template(path = "report/compare.html")]
struct Page<'a> {
    title: String,
    tool: &'a str,
    notes: Vec<String>,
    columns: Vec<Column>,
    changed: Vec<Row>,
    same: Vec<Row>,
}

/// The runs as one page of HTML, the earliest first. `names` are what the columns are called.
///
/// # Errors
/// When the template cannot be written; it has no reason to.
pub fn render(runs: &[RunResult], names: &[String], sources: &Sources) -> Result<String, askama::Error> {
    let mut rows: Vec<Row> = Vec::new();
    let mut ids: Vec<&str> = Vec::new();
    for requirement in runs.iter().flat_map(|run| &run.requirements) {
        if !ids.contains(&requirement.id.as_str()) {
            ids.push(&requirement.id);
        }
    }
    for id in ids {
        rows.push(row(id, runs, sources));
    }
    rows.sort_by_key(|row| match row.worst {
        Some(Trend::Worse) => 0,
        Some(_) => 1,
        None => 2,
    });
    let (same, changed) = rows.into_iter().partition(|row| row.same);
    let tool = runs.last().map_or("", |run| run.tool.as_str());
    Page {
        title: format!("{} side by side", statement::many(runs.len(), "run")),
        tool,
        notes: notes(runs, names),
        columns: columns(runs, names),
        changed,
        same,
    }
    .render()
}

fn columns(runs: &[RunResult], names: &[String]) -> Vec<Column> {
    let all = runs.iter().enumerate().map(|(at, run)| {
        let changes = at.checked_sub(1).map(|before| compare(&runs[before], run).requirements);
        let count = |wanted: &[Trend]| {
            let changes = changes.iter().flatten();
            changes.filter(|change| wanted.contains(&change.trend)).count()
        };
        let counts = statement::requirements(run);
        let applicable = counts.total() - statement::gaps(run).not_applicable;
        Column {
            name: names.get(at).cloned().unwrap_or_default(),
            device: statement::device(run),
            firmware: run
                .setting("certificate.firmware-version")
                .unwrap_or_default()
                .to_owned(),
            started: view::started(&run.started),
            badge: Badge::of(run.verdict),
            decided: format!("{} of {applicable}", counts.decided()),
            better: count(&[Trend::Better]),
            worse: count(&[Trend::Worse, Trend::Lost]),
        }
    });
    all.collect()
}

fn row(id: &str, runs: &[RunResult], sources: &Sources) -> Row {
    let found: Vec<Option<&RequirementResult>> = runs
        .iter()
        .map(|run| run.requirements.iter().find(|requirement| requirement.id == id))
        .collect();
    let standings: Vec<Standing> = found.iter().map(|one| Standing::of_requirement(*one)).collect();
    let steps = standings.windows(2).map(|pair| Trend::of(pair[0], pair[1]));
    let trends: Vec<Trend> = steps.collect();
    let cells: Vec<Cell> = found
        .iter()
        .enumerate()
        .map(|(at, requirement)| Cell {
            badge: requirement.map_or(ABSENT, Badge::of_requirement),
            trend: match at.checked_sub(1).map(|before| trends[before]) {
                Some(trend) if trend.is_bad() => "worse",
                Some(Trend::Better) => "better",
                _ => "",
            },
        })
        .collect();
    let known = sources.requirement(id);
    Row {
        id: id.to_owned(),
        section: known.map_or_else(String::new, |known| format!("{}, §{}", known.mood, known.section)),
        text: known.map(|known| known.text.clone()).unwrap_or_default(),
        same: cells.windows(2).all(|pair| pair[0].badge == pair[1].badge),
        worst: [Trend::Worse, Trend::Lost]
            .into_iter()
            .find(|trend| trends.contains(trend)),
        cells,
    }
}

/// A requirement that a run knows nothing of.
const ABSENT: Badge = Badge {
    class: "none",
    sign: " ",
    word: "not part of the run",
};

/// What makes runs different in kind, compared with the first one.
fn notes(runs: &[RunResult], names: &[String]) -> Vec<String> {
    let Some((first, others)) = runs.split_first() else {
        return Vec::new();
    };
    let mut all = Vec::new();
    for (at, run) in others.iter().enumerate() {
        let name = names.get(at + 1).map_or("", String::as_str);
        all.extend(
            compare(first, run)
                .notes
                .into_iter()
                .map(|note| format!("{name}: {note}")),
        );
    }
    all
}
