//! A certificate: what a run shows, on two to four pages of A4, as a report after ISO/IEC 17025 names it.
//!
//! It is made from a result alone, names the root hash of the bundle the result came from, and leaves the evidence to
//! that bundle. Headers, footers and page numbers come from the style sheet, so that a browser can print it.

mod level;

use askama::Template;

use super::findings::{Finding, findings};
use super::html::view::{self, Badge};
use super::sources::Sources;
use super::statement::{self, Counts, many};
use level::Level;
use tck_base::verdict::Verdict;
use tck_result::{RequirementResult, RunResult};

/// What a profile has to say before a certificate is worth its name: the setting, and what it is.
pub const OWED: [(&str, &str); 5] = [
    ("certificate.laboratory", "the laboratory or company that tests"),
    ("certificate.tester", "the person who tests"),
    ("certificate.place", "where the test takes place"),
    ("certificate.hardware-version", "the version of the hardware"),
    ("certificate.firmware-version", "the version of the software"),
];

/// How many words of persons a certificate quotes; its annex has all.
const WORDS: usize = 40;

/// What a certificate says of who tested, in the order it is shown.
const ORDER: [(&str, &str); 8] = [
    ("Laboratory", "certificate.laboratory"),
    ("Address", "certificate.laboratory-address"),
    ("Report number", "certificate.number"),
    ("Customer", "certificate.customer"),
    ("Place of the test", "certificate.place"),
    ("Tested by", "certificate.tester"),
    ("Authorised by", "certificate.authorised-by"),
    ("Sample received", "certificate.sample-received"),
];

/// Why no certificate can be made.
#[derive(Debug, thiserror::Error)]
pub enum CertificateError {
    /// The run was another one than `certify`.
    #[error("this run was not made by `certify`: parts of it were left to choose")]
    OtherRun,
    /// The run ended early, or there was no time for all of its tests.
    #[error("this run ended before its plan did, and a part certifies nothing; `certify --resume` goes on with it")]
    Partial,
    /// It is one part of several.
    #[error("this is one part of a run, and a part certifies nothing; `report --merge` joins the parts")]
    Part,
    /// The suites are not the built-in ones.
    #[error("the suites of this run differ from the built-in ones")]
    Suites,
    /// Nothing was decided.
    #[error("this run decided nothing")]
    Nothing,
    /// The template cannot be written.
    #[error("cannot render the certificate: {0}")]
    Template(#[from] askama::Error),
}

/// Every reason why no certificate can be made of a run.
#[must_use]
pub fn refusals(result: &RunResult) -> Vec<CertificateError> {
    let all = [
        (!result.certifies(), CertificateError::OtherRun),
        (result.shard.is_some(), CertificateError::Part),
        (result.partial || result.ran_out_of_time(), CertificateError::Partial),
        (result.suites_modified, CertificateError::Suites),
        (result.verdict.is_none(), CertificateError::Nothing),
    ];
    all.into_iter()
        .filter_map(|(holds, why)| holds.then_some(why))
        .collect()
}

/// The certificate of a run as one page of HTML. `root` is the root hash of the bundle that holds the evidence.
///
/// # Errors
/// When the run can certify nothing.
pub fn render(result: &RunResult, sources: &Sources, root: &str) -> Result<String, CertificateError> {
    if let Some(first) = refusals(result).into_iter().next() {
        return Err(first);
    }
    let Some(verdict) = result.verdict else {
        return Err(CertificateError::Nothing);
    };
    let page = Certificate {
        title: title(verdict),
        device: statement::device(result),
        badge: Badge::of(result.verdict),
        statement: statement::statement(result),
        item: item(result),
        order: order(result),
        levels: level::levels(result, sources),
        limits: statement::limits(result),
        on_word: result
            .on_word
            .iter()
            .take(WORDS)
            .map(|one| (&one.test, one.to_string()))
            .collect(),
        findings: findings(result, sources),
        deviations: result.deviations.iter().collect(),
        chapters: chapters(result, sources),
        times: times(result),
        environment: environment(result),
        root: hexadecimal(root),
        root_name: super::clean::short(&hexadecimal(root), 16).into_owned(),
        tool: &result.tool,
        run: &result.run,
        legend: Verdict::ALL.map(|verdict| Badge::of(Some(verdict))),
    };
    Ok(page.render()?)
}

#[derive(Template)]
#[template(path = "report/certificate.html")]
struct Certificate<'a> {
    title: &'static str,
    device: String,
    badge: Badge,
    statement: String,
    item: Vec<(&'static str, String)>,
    order: Vec<(&'static str, String)>,
    levels: Vec<Level>,
    limits: Vec<String>,
    /// The tests that rest on a person's word, and on which.
    on_word: Vec<(&'a String, String)>,
    findings: Vec<Finding<'a>>,
    deviations: Vec<(&'a String, &'a String)>,
    chapters: Vec<Chapter<'a>>,
    times: String,
    environment: Vec<(&'static str, String)>,
    root: String,
    root_name: String,
    tool: &'a str,
    run: &'a str,
    legend: [Badge; 5],
}

/// One row of the matrix.
struct Chapter<'a> {
    title: String,
    cells: Vec<(Badge, &'a str)>,
    /// `12 of 14`.
    decided: String,
}

/// What the paper is: only a device that breaks nothing is certified.
fn title(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Pass | Verdict::Warning => "Certificate of conformance",
        Verdict::Fail => "Test report: the device does not conform",
        Verdict::Inconclusive | Verdict::Error => "Test report: conformance is not shown",
    }
}

/// The tested item.
fn item(result: &RunResult) -> Vec<(&'static str, String)> {
    let device = &result.device;
    let said = |name: &str| result.setting(name).unwrap_or("not stated").to_owned();
    let serial = format!("serial number {}", device.serial_number);
    let mut rows = vec![
        ("Manufacturer", device.manufacturer.clone()),
        ("Serial number", device.serial_number.clone()),
    ];
    rows.extend(device.series_name.clone().map(|name| ("Series", name)));
    rows.extend([
        ("Hardware version", said("certificate.hardware-version")),
        ("Software version", said("certificate.firmware-version")),
        (
            "Sample",
            result.setting("certificate.sample").map_or(serial, str::to_owned),
        ),
        ("Role", statement::role(result).to_owned()),
        ("Protocol", format!("VDA 5050 {}", result.protocol)),
    ]);
    rows
}

/// Who tested, for whom, where and when.
fn order(result: &RunResult) -> Vec<(&'static str, String)> {
    let said = ORDER.into_iter().filter_map(|(name, setting)| {
        let owed = OWED.iter().any(|(owed, _)| *owed == setting);
        match result.setting(setting) {
            Some(value) => Some((name, value.to_owned())),
            None => owed.then(|| (name, "not stated".to_owned())),
        }
    });
    let mut rows: Vec<(&'static str, String)> = said.collect();
    rows.extend([
        ("Date of the test", view::started(&result.started)),
        ("Length", statement::seconds(result.seconds)),
        (
            "Mode",
            "certify: all tests that apply, default time limits, suites as delivered".to_owned(),
        ),
    ]);
    rows
}

/// The matrix: a row for each chapter, a cell for each requirement.
fn chapters<'a>(result: &'a RunResult, sources: &Sources) -> Vec<Chapter<'a>> {
    let mut all: Vec<(String, Vec<&RequirementResult>)> = Vec::new();
    for requirement in &result.requirements {
        let known = sources.requirement(&requirement.id);
        let title = known.map_or("Other requirements", |known| known.chapter.as_str());
        match all.iter_mut().find(|(chapter, _)| chapter == title) {
            Some((_, rows)) => rows.push(requirement),
            None => all.push((title.to_owned(), vec![requirement])),
        }
    }
    let rows = all.into_iter().map(|(title, rows)| Chapter {
        title,
        decided: format!(
            "{} of {}",
            Counts::of(rows.iter().map(|one| one.verdict)).decided(),
            rows.len()
        ),
        cells: rows
            .into_iter()
            .map(|one| (Badge::of_requirement(one), one.id.as_str()))
            .collect(),
    });
    rows.collect()
}

/// The time limits it was judged by, in one line.
fn times(result: &RunResult) -> String {
    let limits = result.settings.iter().filter_map(|setting| {
        let name = setting.name.strip_prefix("time.")?;
        Some(format!("{name} {}", setting.value))
    });
    let limits: Vec<String> = limits.collect();
    if limits.is_empty() {
        return "the defaults of the tool".to_owned();
    }
    limits.join(", ")
}

/// With what it was tested.
fn environment(result: &RunResult) -> Vec<(&'static str, String)> {
    let vantage = match result.vantage.as_str() {
        "tap" => "at the MQTT packets of the device (proxy)",
        "subscriber" => "as a subscriber: what the broker delivered",
        other => other,
    };
    let setting = |name: &str| result.setting(name).map(str::to_owned);
    let broker = setting("bench.broker").unwrap_or_else(|| "built into the tool".to_owned());
    let motion = match setting("motion.max-speed") {
        _ if result.role == "master-control" => "of the mock vehicles only".to_owned(),
        Some(speed) => format!("allowed, not faster than {speed}"),
        None => "allowed".to_owned(),
    };
    vec![
        ("Tool", result.tool.clone()),
        ("Suites, SHA-256", result.suites_sha256.clone()),
        ("Observation", vantage.to_owned()),
        ("Broker", broker),
        ("Motion", motion),
        ("Tests", many(result.tests.len(), "test")),
        ("Run", result.run.clone()),
    ]
}

/// A root hash as it may stand in a style sheet: it is made of hexadecimal digits, whatever a file says.
fn hexadecimal(root: &str) -> String {
    root.chars().filter(char::is_ascii_hexdigit).take(64).collect()
}
