//! The history as one page of HTML, without network and without scripts: what happened first, then every requirement in every run.

use std::collections::BTreeMap;

use askama::Template;

use crate::bundles::LeftOut;
use crate::course::{Course, State};
use crate::series::{History, Run, Series};
use crate::words;
use tck_base::verdict::Verdict;
use tck_report::compare::Standing;
use tck_report::sources::Sources;

#[derive(Template)]
#[template(path = "history/page.html")]
struct Page<'a> {
    title: String,
    summary: String,
    tool: &'a str,
    series: Vec<SeriesView<'a>>,
    left_out: &'a [LeftOut],
    legend: Vec<(&'static str, &'static str, &'static str)>,
}

struct SeriesView<'a> {
    anchor: String,
    title: String,
    extent: String,
    counts: String,
    news: Vec<CourseView<'a>>,
    others: Vec<CourseView<'a>>,
    runs: Vec<RunView<'a>>,
}

/// A requirement: a row.
struct CourseView<'a> {
    course: &'a Course,
    class: &'static str,
    /// What the catalogue says that it asks.
    asks: &'a str,
    origin: String,
    since: String,
    between: Option<String>,
    evidence: Vec<Link>,
    cells: Vec<Cell>,
}

struct Link {
    number: usize,
    href: Option<String>,
}

/// How a requirement stands in a run.
struct Cell {
    class: &'static str,
    sign: &'static str,
    word: &'static str,
    href: Option<String>,
}

/// A run: a row, and a column.
struct RunView<'a> {
    run: &'a Run,
    anchor: String,
    begun: String,
    class: &'static str,
    word: &'static str,
    marks: Vec<String>,
    changes: String,
    href: Option<String>,
}

/// The page. `base` leads from where it will lie to the folder that was read, such as `../`; `sources` are the catalogue by
/// protocol version, as far as it is known.
///
/// # Errors
/// When the template cannot be written; it has no reason to.
pub fn render(history: &History, sources: &BTreeMap<String, Sources>, base: &str) -> Result<String, askama::Error> {
    let series = history.series.iter().enumerate().map(|(at, series)| {
        let known = sources.get(&series.protocol);
        view(series, known, base, &format!("s{}", at + 1))
    });
    Page {
        title: format!("History of {}", history.folder),
        summary: words::summary(history),
        tool: &history.tool,
        series: series.collect(),
        left_out: &history.left_out,
        legend: LEGEND
            .map(|standing| {
                let (word, sign) = words::standing(standing);
                (class_of(standing), sign, word)
            })
            .to_vec(),
    }
    .render()
}

/// Every sign of the tables.
const LEGEND: [Standing; 7] = [
    Standing::Decided(Verdict::Pass),
    Standing::Decided(Verdict::Warning),
    Standing::Decided(Verdict::Inconclusive),
    Standing::Decided(Verdict::Error),
    Standing::Decided(Verdict::Fail),
    Standing::Undecided,
    Standing::NotApplicable,
];

fn view<'a>(series: &'a Series, sources: Option<&'a Sources>, base: &str, anchor: &str) -> SeriesView<'a> {
    let row = |course: &'a Course| row(course, series, sources, base);
    let others = series.requirements.iter().filter(|course| !course.state.is_news());
    let runs = series.runs.iter().map(|run| RunView {
        run,
        anchor: format!("{anchor}-{}", run.number),
        begun: words::begun(run),
        class: run
            .verdict
            .map_or("none", |verdict| class_of(Standing::Decided(verdict))),
        word: words::verdict(run.verdict),
        marks: words::marks(run),
        changes: words::changes(&run.changes),
        href: href(run, base, None),
    });
    SeriesView {
        anchor: anchor.to_owned(),
        title: words::title(series),
        extent: words::extent(series),
        counts: words::counts(series),
        news: series.news().into_iter().map(row).collect(),
        others: others.map(row).collect(),
        runs: runs.collect(),
    }
}

fn row<'a>(course: &'a Course, series: &'a Series, sources: Option<&'a Sources>, base: &str) -> CourseView<'a> {
    let known = sources.and_then(|sources| sources.requirement(&course.id));
    let cells = course.runs.iter().zip(&series.runs).map(|(standing, run)| {
        let (word, sign) = words::standing(*standing);
        let is_finding = matches!(standing, Standing::Decided(Verdict::Fail | Verdict::Warning));
        Cell {
            class: class_of(*standing),
            sign,
            word,
            href: is_finding.then(|| href(run, base, Some(&course.id))).flatten(),
        }
    });
    let evidence = words::evidence(course, series).into_iter().map(|run| Link {
        number: run.number,
        href: href(run, base, Some(&course.id)),
    });
    CourseView {
        course,
        class: match course.state {
            State::Fails => "fail",
            State::Unseen | State::Lost => "inconclusive",
            State::Flaky | State::Warns => "warning",
            State::Fixed | State::Keeps => "pass",
            State::Open => "none",
        },
        asks: known.map_or("", |known| known.text.as_str()),
        origin: known.map_or_else(String::new, |known| format!("{}, §{}", known.mood, known.section)),
        since: words::since(course, series),
        between: words::between(course),
        evidence: evidence.collect(),
        cells: cells.collect(),
    }
}

fn class_of(standing: Standing) -> &'static str {
    match standing {
        Standing::Decided(verdict) => verdict.word(),
        Standing::Undecided | Standing::NotApplicable | Standing::Absent => "none",
    }
}

/// Where the report of a run is, and in it the requirement.
fn href(run: &Run, base: &str, id: Option<&str>) -> Option<String> {
    let report = run.report.as_ref()?;
    let plain = |id: &&str| id.len() <= 40 && id.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'-');
    let place = match (id.filter(plain), run.run.is_some()) {
        (Some(id), true) => format!("#r-{id}"),
        (Some(id), false) => format!("#{id}"),
        (None, _) => String::new(),
    };
    Some(format!("{}{place}", encoded(&format!("{base}{report}"))))
}

/// A path as part of an address: whatever it holds, it leads to a file.
fn encoded(path: &str) -> String {
    let mut text = String::new();
    for byte in path.bytes() {
        if byte.is_ascii_alphanumeric() || b"-_./~".contains(&byte) {
            text.push(char::from(byte));
        } else {
            text.push_str(&format!("%{byte:02X}"));
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_of_any_name_is_no_address_elsewhere() {
        assert_eq!(encoded("../a-1/b c/report.html"), "../a-1/b%20c/report.html");
        assert_eq!(encoded("javascript:x#y?\"<"), "javascript%3Ax%23y%3F%22%3C");
    }
}
