//! The bundle of an audit: the result for programs, JUnit for build servers, a page, and the manifest with their hashes.

use std::collections::BTreeMap;
use std::io;
use std::path::Path;

use askama::Template;

use super::cases::{cases, named, place};
use super::join::restricted;
use super::mistakes::Mistake;
use super::result::{AuditResult, FindingResult, SideResult, VehicleResult};
use super::time_line::Span;
use tck_base::verdict::{Accumulated, Verdict};
use tck_judge::Rules;
use tck_pack::Pack;
use tck_report::issues::{self, Issue};
use tck_report::junit::{self, JunitError};
use tck_report::manifest::{Manifest, ManifestError};
use tck_report::markdown_table::{Column, table};
use tck_report::sources::Sources;
use tck_report::statement::many;

/// How many vehicles have a time line on the page; the result holds all.
const DRAWN: usize = 500;
/// How wide a time line is.
const WIDTH: f64 = 1000.0;
/// How many pictures of courses the page has; the result holds all.
const COURSES: usize = 60;
/// How many columns the overview has; what is found more seldom stands with the vehicles.
const COLUMNS: usize = 20;
/// How high each of its tracks is.
const TRACK: usize = 22;

/// Why no bundle could be written.
#[derive(Debug, thiserror::Error)]
pub enum BundleError {
    /// The folder.
    #[error("cannot write {path}: {source}")]
    Write {
        /// The file.
        path: String,
        /// What the operating system says.
        source: io::Error,
    },
    /// JUnit.
    #[error(transparent)]
    Junit(#[from] JunitError),
    /// The manifest.
    #[error(transparent)]
    Manifest(#[from] ManifestError),
    /// The page or the result.
    #[error("cannot render the result: {0}")]
    Render(String),
}

/// Writes `result.json`, `junit.xml`, `report.html` and `manifest.json` into the folder, and gives the root hash.
///
/// # Errors
/// See [`BundleError`].
pub fn write(result: &AuditResult, rules: &Rules, folder: &Path) -> Result<String, BundleError> {
    let render = |error: &dyn std::fmt::Display| BundleError::Render(error.to_string());
    let json = serde_json::to_string_pretty(result).map_err(|error| render(&error))? + "\n";
    let html = html(result, rules).map_err(|error| render(&error))?;
    let xml = junit(result)?;
    let failed = |path: &Path, source| BundleError::Write {
        path: path.display().to_string(),
        source,
    };
    std::fs::create_dir_all(folder).map_err(|source| failed(folder, source))?;
    for (name, text) in [("result.json", json), ("junit.xml", xml), ("report.html", html)] {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|source| failed(&path, source))?;
    }
    Ok(Manifest::write(folder)?.root)
}

/// The result as JUnit XML: a case for each requirement that was decided, by vehicle and side.
///
/// # Errors
/// When the XML writer refuses; it has no reason to.
pub fn junit(result: &AuditResult) -> Result<String, JunitError> {
    junit::plain(&cases(result))
}

/// The result as Markdown, for the summary of a pipeline.
#[must_use]
pub fn markdown(result: &AuditResult) -> String {
    let mut text = format!("## Audit: {}\n\n", title(result));
    let plain = |text: &str| {
        text.replace(['|', '\n', '\r'], " ")
            .replace(['<', '>', '`', '[', ']', '*'], "")
    };
    if result.verdict.is_none() {
        text.push_str("Nothing could be judged.\n");
    }
    for (_, _, sentence) in restricted(result) {
        text.push_str(&format!("{}\n\n", plain(&sentence)));
    }
    let rows = rows(result);
    if rows.is_empty() {
        return text;
    }
    let rows = rows.into_iter().flat_map(|(vehicle, side)| {
        side.mistakes().into_iter().map(move |mistake| {
            let cells = [
                mistake.worst.verdict.word().to_owned(),
                named(vehicle, side),
                mistake.requirements.join(", "),
                with_what_follows(&mistake),
                mistake.count.to_string(),
                place(mistake.worst, result),
            ];
            cells.map(|cell| plain(&cell))
        })
    });
    let columns = ["Verdict", "Who", "Requirement", "What", "Times", "Where"];
    text.push_str(&table(columns.map(Column::Text), rows));
    text
}

/// A mistake in a few words, and the requirements of what follows from it.
fn with_what_follows(mistake: &Mistake<'_>) -> String {
    let text: String = mistake.worst.text.chars().take(300).collect();
    let mut follows: Vec<&str> = mistake.follows.iter().map(|one| one.requirement.as_str()).collect();
    follows.dedup();
    match follows.as_slice() {
        [] => text,
        all => format!("{text} (from it follow: {})", all.join(", ")),
    }
}

/// What is broken, as issues in the recordings.
fn all_issues(result: &AuditResult) -> Vec<Issue<'_>> {
    let findings = rows(result)
        .into_iter()
        .flat_map(|(vehicle, side)| side.findings.iter().map(move |finding| (vehicle, side, finding)));
    let place = |finding: &FindingResult| {
        let recording = finding.recording.and_then(|file| result.recordings.get(file));
        let line = finding.line.and_then(|line| usize::try_from(line).ok());
        (
            recording.map_or_else(|| "result.json".to_owned(), |known| known.name.clone()),
            line.unwrap_or(1),
        )
    };
    let mut all: Vec<Issue<'_>> = findings
        .map(|(vehicle, side, finding)| Issue {
            requirement: &finding.requirement,
            verdict: finding.verdict,
            message: format!("{}: {} ({} ×)", named(vehicle, side), finding.text, finding.count),
            place: place(finding),
            by: &finding.monitor,
            of_run: false,
        })
        .collect();
    if result.verdict.is_none() {
        all.push(Issue {
            requirement: issues::INCOMPLETE,
            verdict: Verdict::Fail,
            message: "nothing was judged".to_owned(),
            place: ("result.json".to_owned(), 1),
            by: "audit",
            of_run: true,
        });
    }
    all
}

/// The result as GitLab's code quality report.
#[must_use]
pub fn code_quality(result: &AuditResult) -> String {
    issues::code_quality_of_issues(&all_issues(result))
}

/// The result as SARIF.
#[must_use]
pub fn sarif(result: &AuditResult, sources: &Sources) -> String {
    issues::sarif_of_issues(&result.tool, &all_issues(result), sources)
}

/// Vehicles with a side of which something was found, the worst first.
fn rows(result: &AuditResult) -> Vec<(&VehicleResult, &SideResult)> {
    let sides = result
        .vehicles
        .iter()
        .flat_map(|vehicle| vehicle.sides.iter().map(move |side| (vehicle, side)));
    let mut all: Vec<(&VehicleResult, &SideResult)> = sides.filter(|(_, side)| !side.findings.is_empty()).collect();
    all.sort_by_key(|(_, side)| {
        let mistakes = side.mistakes();
        let fails = mistakes.iter().filter(|mistake| mistake.worst.verdict == Verdict::Fail);
        std::cmp::Reverse((side.verdict, fails.count(), mistakes.len()))
    });
    all
}

#[derive(Template)]
#[template(path = "audit/page.html")]
struct Page<'a> {
    result: &'a AuditResult,
    title: String,
    restricted: Vec<String>,
    columns: Vec<&'a str>,
    overview: Vec<Row>,
    broken: Vec<Broken<'a>>,
    vehicles: Vec<Shown<'a>>,
    quiet: Vec<String>,
    left_out: usize,
}

/// A side of a vehicle in the overview.
struct Row {
    link: String,
    name: String,
    verdict: &'static str,
    messages: u64,
    cells: Vec<Cell>,
    further: usize,
}

/// How often a requirement is broken by somebody.
#[derive(Default)]
struct Cell {
    class: &'static str,
    times: String,
}

/// A requirement that is broken.
struct Broken<'a> {
    id: &'a str,
    verdict: &'static str,
    told: Told<'a>,
    who: String,
}

/// What the catalogue says of a requirement.
#[derive(Default)]
struct Told<'a> {
    sentence: &'a str,
    section: &'a str,
    mood: &'static str,
    interpretation: Option<&'a str>,
}

struct Shown<'a> {
    vehicle: &'a VehicleResult,
    link: String,
    seen: String,
    tracks: Vec<Track>,
    height: usize,
    /// Where it was in an order, by the order.
    courses: Vec<(&'a str, String)>,
    sides: Vec<(String, &'a SideResult, Vec<Found<'a>>)>,
}

/// A mistake on the page.
struct Found<'a> {
    mistake: Mistake<'a>,
    verdict: &'static str,
    place: String,
}

struct Track {
    name: &'static str,
    y: usize,
    bars: Vec<Bar>,
}

struct Bar {
    x: String,
    width: String,
    class: String,
    title: String,
}

fn title(result: &AuditResult) -> String {
    let kinds = |verdict: Verdict| {
        let sides = result.vehicles.iter().flat_map(|vehicle| &vehicle.sides);
        let all = sides.flat_map(SideResult::mistakes);
        all.filter(|mistake| mistake.worst.verdict == verdict).count()
    };
    format!(
        "{}: {}, {}",
        many(result.vehicles.len(), "vehicle"),
        many(kinds(Verdict::Fail), "violation"),
        many(kinds(Verdict::Warning), "warning")
    )
}

/// What the catalogue says of a requirement, in the version of somebody who breaks it.
fn told<'a>(rules: &'a Rules, id: &str, pack: Option<&Pack>) -> Told<'a> {
    let Some(requirement) = rules.catalogue.get(id) else {
        return Told::default();
    };
    let note = pack.and_then(|pack| requirement.in_version(pack));
    let requirement = pack.map_or(requirement, |pack| requirement.edition(pack));
    Told {
        sentence: &requirement.text,
        section: note.map_or("", |note| note.section.as_str()),
        mood: note.map_or("", |note| note.mood.word()),
        interpretation: requirement.interpretation.as_deref(),
    }
}

/// The requirements that are broken, the worst and most frequent first.
fn broken<'a>(rows: &[(&'a VehicleResult, &'a SideResult)], rules: &'a Rules) -> Vec<Broken<'a>> {
    let mut by: BTreeMap<&str, Vec<(&VehicleResult, &FindingResult)>> = BTreeMap::new();
    for (vehicle, side) in rows {
        for finding in &side.findings {
            by.entry(&finding.requirement).or_default().push((vehicle, finding));
        }
    }
    let mut all: Vec<(Option<Verdict>, usize, Broken<'_>)> = Vec::new();
    for (id, found) in by {
        let worst = found
            .iter()
            .map(|(_, finding)| finding.verdict)
            .collect::<Accumulated>()
            .get();
        let mut vehicles: Vec<(&str, &str)> = found
            .iter()
            .map(|(vehicle, _)| (vehicle.manufacturer.as_str(), vehicle.serial_number.as_str()))
            .collect();
        vehicles.sort_unstable();
        vehicles.dedup();
        let mut makers: Vec<&str> = vehicles.iter().map(|(maker, _)| *maker).collect();
        makers.dedup();
        let version = found.first().and_then(|(vehicle, _)| vehicle.protocol.as_deref());
        let pack = version.and_then(|version| rules.packs.get(version));
        let one = Broken {
            id,
            verdict: worst.map_or("", Verdict::word),
            told: told(rules, id, pack.map(AsRef::as_ref)),
            who: format!(
                "{}, {}",
                many(vehicles.len(), "vehicle"),
                many(makers.len(), "manufacturer")
            ),
        };
        all.push((worst, vehicles.len(), one));
    }
    all.sort_by_key(|(worst, count, _)| std::cmp::Reverse((*worst, *count)));
    all.into_iter().map(|(.., one)| one).collect()
}

fn html(result: &AuditResult, rules: &Rules) -> askama::Result<String> {
    let rows = rows(result);
    let broken = broken(&rows, rules);
    let columns: Vec<&str> = broken.iter().take(COLUMNS).map(|known| known.id).collect();
    let link = |vehicle: &VehicleResult| {
        let at = result.vehicles.iter().position(|known| std::ptr::eq(known, vehicle));
        format!("v{}", at.unwrap_or_default())
    };
    let overview = rows.iter().map(|(vehicle, side)| {
        let cell = |id: &&str| {
            let found: Vec<&FindingResult> = side.findings.iter().filter(|known| known.requirement == **id).collect();
            let worst = found
                .iter()
                .map(|finding| finding.verdict)
                .collect::<Accumulated>()
                .get();
            worst.map_or_else(Cell::default, |worst| Cell {
                class: worst.word(),
                times: found.iter().map(|finding| finding.count).sum::<u64>().to_string(),
            })
        };
        let seldom = side.requirements.iter().filter(|known| {
            matches!(known.verdict, Verdict::Fail | Verdict::Warning) && !columns.contains(&known.id.as_str())
        });
        Row {
            link: link(vehicle),
            name: named(vehicle, side),
            verdict: side.verdict.map_or("", Verdict::word),
            messages: side.messages,
            cells: columns.iter().map(cell).collect(),
            further: seldom.count(),
        }
    });
    // The worst vehicle first; one stands once, with both sides.
    let mut told: Vec<&VehicleResult> = Vec::new();
    for (vehicle, _) in &rows {
        if !told.iter().any(|known| std::ptr::eq(*known, *vehicle)) {
            told.push(vehicle);
        }
    }
    let quiet = result
        .vehicles
        .iter()
        .filter(|vehicle| !told.iter().any(|known| std::ptr::eq(*known, *vehicle)))
        .map(|vehicle| {
            let why = vehicle.sides.iter().find_map(|side| side.not_judged.as_ref());
            let why = vehicle.not_judged.as_ref().or(why);
            let why = why.map(|why| format!(" (not judged: {why})")).unwrap_or_default();
            format!("{} {}{why}", vehicle.manufacturer, vehicle.called())
        });
    let mut vehicles = Vec::new();
    let mut drawn = 0;
    for vehicle in told.iter().take(DRAWN) {
        let mut shown = shown(vehicle, link(vehicle), result);
        shown.courses = courses(vehicle, &shown.link, COURSES.saturating_sub(drawn))?;
        drawn += shown.courses.len();
        vehicles.push(shown);
    }
    let page = Page {
        title: title(result),
        overview: overview.collect(),
        columns: columns.clone(),
        quiet: quiet.collect(),
        vehicles,
        left_out: told.len().saturating_sub(DRAWN),
        restricted: restricted(result)
            .into_iter()
            .map(|(_, _, sentence)| sentence)
            .collect(),
        broken,
        result,
    };
    page.render()
}

/// Where a vehicle was in orders during which something was found, at most so many.
fn courses<'a>(vehicle: &'a VehicleResult, link: &str, most: usize) -> askama::Result<Vec<(&'a str, String)>> {
    let all = vehicle.courses.iter().take(most).enumerate();
    all.map(|(at, course)| {
        let id = format!("{link}-course{}", at + 1);
        let figure = course.figure(&id, "Where the vehicle was, and what it was told", |_| false)?;
        Ok((course.order.as_str(), figure))
    })
    .collect()
}

fn shown<'a>(vehicle: &'a VehicleResult, link: String, result: &AuditResult) -> Shown<'a> {
    let time = |text: &Option<String>| text.as_ref().and_then(|text| text.parse::<jiff::Timestamp>().ok());
    let (first, last) = (
        time(&result.first).unwrap_or_default(),
        time(&result.last).unwrap_or_default(),
    );
    let length = (last.as_millisecond() - first.as_millisecond()).max(1) as f64;
    let across =
        |at: jiff::Timestamp| ((at.as_millisecond() - first.as_millisecond()) as f64 / length).clamp(0.0, 1.0) * WIDTH;
    let bar = |from: jiff::Timestamp, to: jiff::Timestamp, class: String, what: String| Bar {
        x: format!("{:.1}", across(from)),
        width: format!("{:.1}", (across(to) - across(from)).max(2.0)),
        class,
        title: format!("{what}: {from:.3} to {to:.3}"),
    };
    let mut tracks = Vec::new();
    for name in ["connection", "mode", "order"] {
        let spans = vehicle.time_line.0.get(name).map(Vec::as_slice).unwrap_or_default();
        let bars = spans.iter().enumerate().map(|(number, span): (usize, &Span)| {
            let class = format!(
                "{name} shade-{}{}",
                number % 2,
                if span.what == "ONLINE" { " online" } else { "" }
            );
            bar(span.from, span.to, class, span.what.clone())
        });
        tracks.push((name, bars.collect()));
    }
    let findings = vehicle.sides.iter().flat_map(|side| &side.findings);
    let bars = findings.filter_map(|finding| {
        let (from, to) = (finding.first.parse().ok()?, finding.last.parse().ok()?);
        Some(bar(
            from,
            to,
            finding.verdict.word().to_owned(),
            finding.requirement.clone(),
        ))
    });
    tracks.push(("findings", bars.collect()));
    let seen: Vec<String> = vehicle
        .messages
        .iter()
        .map(|(name, count)| format!("{count} {name}"))
        .collect();
    let sides = vehicle.sides.iter().map(|side| {
        let found = side.mistakes().into_iter().map(|mistake| Found {
            verdict: mistake.worst.verdict.word(),
            place: place(mistake.worst, result),
            mistake,
        });
        (named(vehicle, side), side, found.collect())
    });
    Shown {
        vehicle,
        link,
        seen: seen.join(", "),
        height: tracks.len() * TRACK,
        tracks: tracks
            .into_iter()
            .enumerate()
            .map(|(number, (name, bars))| Track {
                name,
                y: number * TRACK,
                bars,
            })
            .collect(),
        courses: Vec::new(),
        sides: sides.collect(),
    }
}

#[cfg(test)]
mod tests;
