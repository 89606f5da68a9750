//! Everything a bundle holds beside the journal, written from the result alone.

use super::bundle::{Bundle, BundleError};
use tck_journal::{Journal, LostRecord};
use tck_judge::Library;
use tck_pack::{Decided, Pack};
use tck_report::junit::Inconclusive;
use tck_report::sources::{HowDecided, MonitorSource, RequirementText, Sources, TestSource};
use tck_report::{html, json, junit, manifest};
use tck_result::RunResult;

/// Why the outputs could not be made.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// A file cannot be written.
    #[error(transparent)]
    Bundle(#[from] BundleError),
    /// `result.json` cannot be made.
    #[error(transparent)]
    Result(#[from] json::ResultError),
    /// `junit.xml` cannot be made.
    #[error(transparent)]
    Junit(#[from] junit::JunitError),
    /// `report.html` cannot be made.
    #[error("cannot render the report: {0}")]
    Html(String),
    /// The report lacks a record that is in the journal.
    #[error(transparent)]
    Lost(#[from] LostRecord),
    /// `manifest.json` cannot be made.
    #[error(transparent)]
    Manifest(#[from] manifest::ManifestError),
}

/// What catalogue and suites say, for a protocol version.
#[must_use]
pub fn sources(library: &Library, pack: &Pack) -> Sources {
    let suites = &library.rules.suites;
    let given = |path: &String| Some((path.clone(), library.assets.as_given(path)?));
    let requirements = library.rules.catalogue.all().filter_map(|requirement| {
        let note = requirement.in_version(pack)?;
        let requirement = requirement.edition(pack);
        Some(RequirementText {
            id: requirement.id.as_str().to_owned(),
            chapter: requirement.chapter.clone(),
            text: requirement.text.clone(),
            role: requirement.role.word().to_owned(),
            mood: note.mood.word().to_owned(),
            section: note.section.clone(),
            link: requirement.link_in(pack),
            interpretation: requirement.interpretation.clone(),
            action: requirement.needs.iter().find_map(|need| offered(need)),
            rests_on: requirement.rests_on.iter().map(ToString::to_string).collect(),
            decided: match &requirement.decided {
                Decided::Active => HowDecided::Active,
                Decided::Passive => HowDecided::Passive,
                Decided::Operator => HowDecided::Operator,
                Decided::NotTestable { reason } => HowDecided::NotTestable(reason.clone()),
            },
        })
    });
    let tests = suites.tests.iter().filter(|test| test.spec.contains(pack.version));
    let monitors = suites
        .monitors
        .iter()
        .filter(|monitor| monitor.spec.contains(pack.version));
    Sources {
        requirements: requirements.collect(),
        tests: tests.map(|test| TestSource::of(test)).collect(),
        monitors: monitors.map(|monitor| MonitorSource::of(monitor)).collect(),
        given: library.assets.own().iter().filter_map(given).collect(),
    }
}

/// The action of a need such as `factsheet_capability:agvActions.pick`.
fn offered(need: &str) -> Option<String> {
    let name = need.strip_prefix("factsheet_capability:agvActions.")?;
    Some(name.to_owned())
}

/// Writes `result.json`, as after every test.
///
/// # Errors
/// When it cannot be written.
pub fn write_result(bundle: &Bundle, result: &RunResult) -> Result<(), OutputError> {
    Ok(json::write(&bundle.folder().join("result.json"), result)?)
}

/// Writes everything but the journal, and returns the root hash of the bundle.
///
/// # Errors
/// When something cannot be made or written.
pub fn write_all(
    bundle: &Bundle,
    result: &RunResult,
    sources: &Sources,
    journal: &Journal,
    inconclusive: Inconclusive,
) -> Result<String, OutputError> {
    written(bundle, result, sources, Some(journal), inconclusive)
}

/// Writes the bundle of a run that was joined from parts, whose journals lie elsewhere, and returns its root hash.
///
/// # Errors
/// When something cannot be made or written.
pub fn write_joined(
    bundle: &Bundle,
    result: &RunResult,
    sources: &Sources,
    inconclusive: Inconclusive,
) -> Result<String, OutputError> {
    written(bundle, result, sources, None, inconclusive)
}

fn written(
    bundle: &Bundle,
    result: &RunResult,
    sources: &Sources,
    journal: Option<&Journal>,
    inconclusive: Inconclusive,
) -> Result<String, OutputError> {
    write_result(bundle, result)?;
    let flavour = junit::Flavour {
        inconclusive,
        root: None,
    };
    bundle.write("junit.xml", junit::render(result, flavour)?.as_bytes())?;
    let by_requirement = junit::by_requirement(result, sources, flavour)?;
    bundle.write("junit-requirements.xml", by_requirement.as_bytes())?;
    let page = html::render(result, sources, journal).map_err(|error| OutputError::Html(error.to_string()))?;
    if let Some(lost) = journal.and_then(Journal::lost) {
        return Err(lost.clone().into());
    }
    bundle.write("report.html", page.as_bytes())?;
    Ok(manifest::Manifest::write(bundle.folder())?.root)
}
