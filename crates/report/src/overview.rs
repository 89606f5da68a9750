//! The end of a run on the terminal: headline, findings, what to do to decide more, numbers, and where the report is.

use std::fmt::Write as _;

use super::clean::{line, short};
use super::findings::{Finding, findings};
use super::headline::reference;
use super::repeated;
use super::sources::Sources;
use super::statement::{self, Counts, many, seconds};
use super::text::{Color, tag};
use super::undecided;
use tck_base::verdict::Verdict;
use tck_journal::Journal;
use tck_result::{RunResult, TestResult};

/// How many tests of a finding are named.
const NAMED: usize = 3;

/// Where the bundle of a run is.
#[derive(Clone, Copy, Debug, Default)]
pub struct Bundle<'a> {
    /// Path of `report.html`, as the user would type it.
    pub report: Option<&'a str>,
    /// Root hash of the manifest.
    pub root: Option<&'a str>,
}

/// The end of a run: the statement, a row per broken requirement, what to do to decide more, counts per verdict, where the
/// report is, the root hash.
#[must_use]
pub fn overview(
    result: &RunResult,
    sources: &Sources,
    journal: Option<&Journal>,
    bundle: Bundle<'_>,
    color: Color,
) -> String {
    let mut text = String::new();
    let style = color.verdict(result.verdict);
    let word = result
        .verdict
        .map_or("NOTHING DECIDED".to_owned(), |verdict| verdict.word().to_uppercase());
    let _ = writeln!(text, "{}  {}", style.apply_to(word), statement::statement(result));
    if result.partial {
        let reason = result
            .partial_reason
            .as_deref()
            .unwrap_or("the run ended before its plan did");
        let style = color.verdict(Some(Verdict::Error));
        let _ = writeln!(text, "{}  {}", style.apply_to("PARTIAL"), line(reason));
    }
    let found = findings(result, sources);
    if !found.is_empty() {
        text.push_str("\nFindings:\n");
        for finding in &found {
            row(finding, journal, color, &mut text);
        }
    }
    let flaky = repeated::flaky(result);
    if !flaky.is_empty() {
        text.push_str("\nFlaky:\n");
        for line in flaky {
            let _ = writeln!(text, "      {line}");
        }
    }
    to_decide_more(result, color, &mut text);
    text.push('\n');
    counts(result, color, &mut text);
    if let Some(report) = bundle.report {
        let _ = writeln!(text, "\nreport  {}", line(report));
    }
    if let Some(root) = bundle.root {
        let _ = writeln!(text, "root    sha256:{}", line(root));
    }
    text
}

fn row(finding: &Finding<'_>, journal: Option<&Journal>, color: Color, text: &mut String) {
    let verdict = Some(finding.verdict);
    let id = color.verdict(verdict).apply_to(line(finding.requirement).into_owned());
    let origin = finding
        .origin
        .as_deref()
        .map_or(String::new(), |origin| format!("   {}", line(origin)));
    let times = many(usize::try_from(finding.count).unwrap_or(usize::MAX), "time");
    let first = finding.first.map_or(String::new(), |seq| {
        format!(", first at {}", short(&line(&reference(journal, seq)), 120))
    });
    let origin = color.dim().apply_to(origin);
    let _ = writeln!(
        text,
        "{}{id}{origin}   {times}{first}",
        color.verdict(verdict).apply_to(tag(verdict))
    );
    if let Some(asks) = finding.asks {
        let _ = writeln!(text, "      asked  {}", short(&line(asks), 300));
    }
    if let Some(sent) = finding.sent {
        let _ = writeln!(text, "      sent   {}", short(&line(&sent.to_string()), 300));
    }
    let _ = writeln!(text, "      seen   {}", short(&line(&finding.seen), 300));
    let monitors = finding.monitors.iter().map(|id| format!("monitor {id}"));
    let by: Vec<String> = finding
        .tests
        .iter()
        .map(|id| (*id).to_owned())
        .chain(monitors)
        .collect();
    let more = match by.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    if by.is_empty() {
        return;
    }
    let named = by.iter().take(NAMED).map(String::as_str).collect::<Vec<_>>().join(", ");
    let _ = writeln!(
        text,
        "      by     {}",
        color.dim().apply_to(format!("{}{more}", line(&named)))
    );
}

/// The causes for which tests decided nothing, and what to do about each; the one that stops most tests comes first.
fn to_decide_more(result: &RunResult, color: Color, text: &mut String) {
    let groups = undecided::groups(result);
    if groups.is_empty() {
        return;
    }
    text.push_str("\nTo decide more:\n");
    for group in groups {
        let count = format!("{:>11}", group.count());
        let count = color.verdict(Some(Verdict::Inconclusive)).apply_to(count);
        let _ = writeln!(text, "{count}  {}", short(&line(&group.advice()), 240));
        let _ = writeln!(text, "             {}", color.dim().apply_to(group.named()));
    }
}

fn counts(result: &RunResult, color: Color, text: &mut String) {
    let gaps = statement::gaps(result);
    let rows = [
        (
            "tests",
            statement::tests(result),
            vec![(statement::tests(result).none, "not applicable")],
        ),
        (
            "monitors",
            statement::monitors(result),
            vec![(statement::monitors(result).none, "nothing to judge")],
        ),
        (
            "requirements",
            statement::requirements(result),
            vec![
                (gaps.not_decided, "not decided"),
                (gaps.not_testable, "not testable"),
                (gaps.not_applicable, "not applicable"),
            ],
        ),
    ];
    for (name, counts, without) in rows.into_iter().filter(|(_, counts, _)| counts.total() > 0) {
        let _ = writeln!(text, "{name:<13} {}", numbers(counts, &without, color));
    }
    if let Some(fleet) = &result.fleet {
        let _ = writeln!(text, "{:<13} {}", "fleet", super::fleet::line(fleet));
    }
    if let Some(latency) = result.harness_latency {
        let _ = writeln!(text, "{:<13} {}", "harness", super::latency::line(latency));
    }
}

/// `12 pass, 1 warning, 1 fail, 2 not applicable`, worst last; noughts left out.
fn numbers(counts: Counts, without: &[(usize, &'static str)], color: Color) -> String {
    let with = Verdict::ALL.map(|verdict| (counts.get(Some(verdict)), Some(verdict), verdict.word()));
    let without = without.iter().map(|(count, word)| (*count, None, *word));
    with.into_iter()
        .chain(without)
        .filter(|(count, ..)| *count > 0)
        .map(|(count, verdict, word)| color.verdict(verdict).apply_to(format!("{count} {word}")).to_string())
        .collect::<Vec<_>>()
        .join(", ")
}

/// The tests that took longest, the slowest first.
#[must_use]
pub fn slowest(result: &RunResult, count: usize, color: Color) -> String {
    let mut ran: Vec<&TestResult> = result.tests.iter().filter(|test| test.verdict.is_some()).collect();
    ran.sort_by(|one, other| other.seconds.total_cmp(&one.seconds));
    let mut text = String::from("Slowest tests:\n");
    for test in ran.iter().take(count) {
        let time = color.dim().apply_to(format!("{:>11}", seconds(test.seconds)));
        let _ = writeln!(text, "{time}  {}", line(&test.id));
    }
    text
}
