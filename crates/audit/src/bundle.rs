//! The bundle of an audit: the result for programs, JUnit for build servers, and a page with a time line for each vehicle.

use std::io;
use std::path::Path;

use askama::Template;

use super::result::{AuditResult, FindingResult, SideResult, VehicleResult};
use super::time_line::Span;
use tck_base::verdict::Verdict;
use tck_report::junit::{self, JunitError, Plain};
use tck_report::statement::many;

/// How many vehicles have a time line on the page; the result holds all.
const DRAWN: usize = 500;
/// How wide a time line is.
const WIDTH: f64 = 1000.0;
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
    /// The page or the result.
    #[error("cannot render the result: {0}")]
    Render(String),
}

/// Writes `result.json`, `junit.xml` and `report.html` into the folder.
///
/// # Errors
/// See [`BundleError`].
pub fn write(result: &AuditResult, folder: &Path) -> Result<(), BundleError> {
    let render = |error: &dyn std::fmt::Display| BundleError::Render(error.to_string());
    let json = serde_json::to_string_pretty(result).map_err(|error| render(&error))? + "\n";
    let html = html(result).map_err(|error| render(&error))?;
    let xml = junit::plain(&cases(result))?;
    let failed = |path: &Path, source| BundleError::Write {
        path: path.display().to_string(),
        source,
    };
    std::fs::create_dir_all(folder).map_err(|source| failed(folder, source))?;
    for (name, text) in [("result.json", json), ("junit.xml", xml), ("report.html", html)] {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|source| failed(&path, source))?;
    }
    Ok(())
}

fn named(vehicle: &VehicleResult, side: &SideResult) -> String {
    let VehicleResult {
        manufacturer,
        serial_number,
        protocol,
        ..
    } = vehicle;
    let version = protocol.as_deref().unwrap_or("unknown");
    format!("{manufacturer} {serial_number}, {} ({version})", side.role)
}

/// A case for each requirement that was decided, by vehicle and side.
fn cases(result: &AuditResult) -> Vec<Plain> {
    let mut all = Vec::new();
    for vehicle in &result.vehicles {
        for side in &vehicle.sides {
            let suite = named(vehicle, side);
            all.extend(side.requirements.iter().map(|decided| {
                let findings = side.findings.iter().filter(|finding| finding.requirement == decided.id);
                let texts: Vec<String> = findings.map(|finding| sentence(finding, result)).collect();
                Plain {
                    suite: suite.clone(),
                    name: decided.id.clone(),
                    verdict: Some(decided.verdict),
                    text: texts.join("\n"),
                }
            }));
        }
    }
    if result.verdict.is_none() {
        all.push(Plain {
            suite: "audit".to_owned(),
            name: "something was judged".to_owned(),
            verdict: Some(Verdict::Error),
            text: "nothing was judged".to_owned(),
        });
    }
    all
}

fn sentence(finding: &FindingResult, result: &AuditResult) -> String {
    let place = finding
        .recording
        .and_then(|file| result.recordings.get(file))
        .zip(finding.line);
    let place = place
        .map(|(recording, line)| format!(" at {}:{line}", recording.name))
        .unwrap_or_default();
    format!(
        "{} times{place}, first {}, last {}: {}",
        finding.count, finding.first, finding.last, finding.text
    )
}

#[derive(Template)]
#[template(path = "audit/page.html")]
struct Page<'a> {
    result: &'a AuditResult,
    title: String,
    vehicles: Vec<Shown<'a>>,
    left_out: usize,
}

struct Shown<'a> {
    vehicle: &'a VehicleResult,
    seen: String,
    tracks: Vec<Track>,
    height: usize,
    sides: Vec<(String, &'a SideResult)>,
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

fn html(result: &AuditResult) -> askama::Result<String> {
    let kinds = |verdict: Verdict| {
        let sides = result.vehicles.iter().flat_map(|vehicle| &vehicle.sides);
        sides
            .flat_map(|side| &side.findings)
            .filter(|finding| finding.verdict == verdict)
            .count()
    };
    let title = format!(
        "{}: {}, {}",
        many(result.vehicles.len(), "vehicle"),
        many(kinds(Verdict::Fail), "violation"),
        many(kinds(Verdict::Warning), "warning")
    );
    let page = Page {
        title,
        vehicles: result
            .vehicles
            .iter()
            .take(DRAWN)
            .map(|vehicle| shown(vehicle, result))
            .collect(),
        left_out: result.vehicles.len().saturating_sub(DRAWN),
        result,
    };
    page.render()
}

fn shown<'a>(vehicle: &'a VehicleResult, result: &AuditResult) -> Shown<'a> {
    let time = |text: &Option<String>| text.as_ref().and_then(|text| text.parse::<jiff::Timestamp>().ok());
    let (first, last) = (
        time(&result.first).unwrap_or_default(),
        time(&result.last).unwrap_or_default(),
    );
    let length = (last.as_millisecond() - first.as_millisecond()).max(1) as f64;
    let place =
        |at: jiff::Timestamp| ((at.as_millisecond() - first.as_millisecond()) as f64 / length).clamp(0.0, 1.0) * WIDTH;
    let bar = |from: jiff::Timestamp, to: jiff::Timestamp, class: String, what: String| Bar {
        x: format!("{:.1}", place(from)),
        width: format!("{:.1}", (place(to) - place(from)).max(2.0)),
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
    Shown {
        vehicle,
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
        sides: vehicle.sides.iter().map(|side| (named(vehicle, side), side)).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::traffic;
    use super::super::{Audit, Options};
    use super::*;
    use tck_pack::Role;

    #[test]
    fn the_page_shows_each_vehicle_over_time_and_what_a_vehicle_says_is_only_text() {
        let library = tck_testing::library();
        let pack = library.rules.packs.latest();
        let mut messages = traffic(library, pack, Role::Agv, "order-acceptance/", &["horizon-not-reported"]);
        for message in &mut messages {
            let text = String::from_utf8_lossy(&message.payload).replace("\"AUTOMATIC\"", "\"<script>AUTO\"");
            message.payload = text.into_bytes().into();
        }
        let mut audit = Audit::new(&library.rules, Options::default()).expect("options");
        for message in messages {
            audit.observe(message);
        }
        let result = audit.finish(Vec::new());
        let folder = tempfile::tempdir().expect("folder");
        let into = folder.path().join("audits/monday");
        write(&result, &into).expect("written");
        let read = |name: &str| std::fs::read_to_string(into.join(name)).expect("file");
        let page = read("report.html");
        assert!(
            !page.contains("<script") && (page.contains("&#60;script") || page.contains("&lt;script")),
            "{page}"
        );
        assert!(
            page.contains("STATE-12") && page.contains("<svg") && page.contains("class=\"connection"),
            "{page}"
        );
        let junit = read("junit.xml");
        let document = roxmltree::Document::parse(&junit).expect("XML");
        let failures = document.descendants().filter(|node| node.has_tag_name("failure"));
        let types: Vec<&str> = failures.filter_map(|node| node.attribute("type")).collect();
        assert!(types.contains(&"STATE-12") && types.contains(&"MODE-01"), "{types:?}");
        let value: serde_json::Value = serde_json::from_str(&read("result.json")).expect("JSON");
        assert!(
            value["vehicles"][0]["timeLine"]["order"]
                .as_array()
                .is_some_and(|spans| !spans.is_empty())
        );
    }
}
