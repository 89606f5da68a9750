//! What the terminal says about a result, as plain strings.
//!
//! One line per test, a block per finding laid out as rustc would lay it out, and the summary at the end.
//! When and where to print is left to the command line. Device strings are cleaned before they get here or
//! here; colour is added last and only on request.

use std::fmt::Write as _;

use console::{Style, measure_text_width};

use super::clean::{block, line, short};
use super::headline::reference;
use super::sources::Sources;
use super::statement::{self, Counts, many, seconds};
use super::undecided;
use crate::journal::Journal;
use crate::result::{Decision, MonitorResult, RunResult, TestResult, Waited};
use crate::verdict::Verdict;

/// Width the times at the end of a line are aligned to, in columns.
const WIDTH: usize = 84;

/// Whether to colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Color {
    /// Plain text.
    Never,
    /// ANSI colours, whatever the terminal can do: the caller has decided.
    Always,
}

impl Color {
    fn style(self, style: Style) -> Style {
        style.force_styling(self == Self::Always)
    }

    fn verdict(self, verdict: Option<Verdict>) -> Style {
        let style = Style::new().bold();
        self.style(match verdict {
            Some(Verdict::Pass) => style.green(),
            Some(Verdict::Warning) => style.yellow(),
            Some(Verdict::Inconclusive) => style.magenta(),
            Some(Verdict::Error | Verdict::Fail) => style.red(),
            None => Style::new().dim(),
        })
    }

    fn dim(self) -> Style {
        self.style(Style::new().dim())
    }

    fn gutter(self) -> Style {
        self.style(Style::new().blue().bold())
    }
}

/// What stands in front of a line: `PASS`, `WARN`, `????`, `ERR`, `FAIL`, `n/a`; six columns with the gap.
fn tag(verdict: Option<Verdict>) -> &'static str {
    match verdict {
        Some(Verdict::Pass) => "PASS  ",
        Some(Verdict::Warning) => "WARN  ",
        Some(Verdict::Inconclusive) => "OPEN  ",
        Some(Verdict::Error) => "ERROR ",
        Some(Verdict::Fail) => "FAIL  ",
        None => "n/a   ",
    }
}

/// The one line of a test.
#[must_use]
pub fn test_line(test: &TestResult, color: Color) -> String {
    let verdict = statement::test_verdict(test);
    let tag = color.verdict(verdict).apply_to(tag(verdict));
    let id = line(&test.id);
    if let Some(why) = test.not_applicable.as_ref().filter(|_| verdict.is_none()) {
        return format!("{tag}{id}  {}\n", color.dim().apply_to(short(&line(why), 120)));
    }
    let time = seconds(test.seconds);
    let used = 6 + measure_text_width(&id) + time.len();
    let gap = " ".repeat(WIDTH.saturating_sub(used).max(1));
    format!("{tag}{id}{gap}{}\n", color.dim().apply_to(time))
}

/// The line of a test, and a block for everything it found; what merely could not be decided is listed.
#[must_use]
pub fn test(test: &TestResult, sources: &Sources, journal: Option<&Journal>, color: Color) -> String {
    let mut whole = test_line(test, color);
    let verdict = statement::test_verdict(test);
    let (blocks, undecided): (Vec<&Decision>, Vec<&Decision>) = test
        .decisions
        .iter()
        .filter(|decision| decision.verdict() != Verdict::Pass)
        .partition(|decision| decision.is_finding());
    let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
    if blocks.is_empty() && !matches!(verdict, Some(Verdict::Pass) | None) {
        let reason = test.reason.as_deref();
        reasons.extend(reason.map(|reason| (reason, Vec::new())));
        if reason.is_none() && undecided.is_empty() {
            reasons.push(("the test decided nothing", Vec::new()));
        }
    }
    for decision in undecided {
        match reasons.iter_mut().find(|(reason, _)| *reason == decision.message) {
            Some((_, ids)) => ids.push(&decision.requirement),
            None => reasons.push((&decision.message, vec![&decision.requirement])),
        }
    }
    for finding in blocks {
        whole.push_str(&decision(finding, sources, journal, color));
    }
    for (reason, ids) in reasons {
        let _ = writeln!(whole, "      {}", short(&line(reason), 400));
        if !ids.is_empty() {
            let ids = color.dim().apply_to(line(&ids.join(", ")).into_owned());
            let _ = writeln!(whole, "      undecided: {ids}");
        }
    }
    whole
}

/// The block of one decision, below the line of its test: requirement, clause with caret, what was awaited,
/// the nearest miss, and the next command to type.
#[must_use]
pub fn decision(decision: &Decision, sources: &Sources, journal: Option<&Journal>, color: Color) -> String {
    let id = line(&decision.requirement);
    let known = sources.requirement(&decision.requirement);
    let origin = known.map_or(String::new(), |known| {
        format!("   {}, §{}", line(&known.mood), line(&known.section))
    });
    let styled = color.verdict(Some(decision.verdict())).apply_to(&id);
    let origin = color.dim().apply_to(format!("{}{origin}", decision.verdict()));
    let mut text = format!("      {styled}   {origin}\n\n");
    let gutter = if let Some(explanation) = &decision.explanation {
        explained(explanation, decision.verdict(), color, &mut text)
    } else {
        let _ = writeln!(text, "   --> {}\n    |", line(&decision.place));
        let _ = writeln!(text, "    | {}\n    |", line(&decision.message));
        4
    };
    let mut note = |name: &str, value: String| {
        let lead = format!("{}=", " ".repeat(gutter));
        let lead = color.gutter().apply_to(lead);
        let _ = writeln!(text, "{lead} {name:<8} {value}");
    };
    if let Some(expected) = &decision.expected {
        note("expected", short(&line(expected), 400).into_owned());
    }
    let find = |seq| journal.and_then(|journal| journal.get(seq)).map(AsRef::as_ref);
    if let Some(Waited {
        seconds: time,
        since,
        messages,
    }) = decision.waited
    {
        let came = many(usize::try_from(messages).unwrap_or(usize::MAX), "message");
        note(
            "waited",
            format!("{} after {}; {came} came", seconds(time), reference(find(since), since)),
        );
    }
    // Where the message that decided is the nearest miss, the line below says more about it.
    let is_nearest = |seq| decision.nearest.as_ref().is_some_and(|nearest| nearest.seq == seq);
    if let Some(witness) = decision.witness.filter(|witness| !is_nearest(*witness)) {
        note("decided", format!("by {}", reference(find(witness), witness)));
    }
    if decision.nearest.is_none() && decision.explanation.is_some() {
        note("found", short(&line(&decision.message), 400).into_owned());
    }
    if let Some(nearest) = &decision.nearest {
        let since = decision.waited.as_ref().and_then(|waited| find(waited.since));
        let after = match (since, find(nearest.seq)) {
            (Some(since), Some(near)) => {
                format!(", +{}", seconds((near.at().moment - since.at().moment).as_secs_f64()))
            }
            _ => String::new(),
        };
        let kind = find(nearest.seq).map_or(String::new(), |entry| format!(" {}", super::headline::kind(entry)));
        note(
            "closest",
            format!(
                "#{}{kind}{after}:  {} is {}, not {}",
                nearest.seq,
                line(&nearest.path),
                short(&line(&nearest.found), 160),
                short(&line(&nearest.expected), 160)
            ),
        );
    }
    if let Some(ruling) = &decision.interpretation {
        note("ruling", short(&line(ruling), 400).into_owned());
    }
    note("see", format!("vda5050-tck explain {id}"));
    text.push('\n');
    text
}

/// Appends the caret block; gives back the column of its gutter.
fn explained(explanation: &str, verdict: Verdict, color: Color, text: &mut String) -> usize {
    let explanation = block(explanation);
    let lines: Vec<&str> = explanation.trim_end().lines().collect();
    let gutter = lines
        .iter()
        .find(|text| text.trim_start().starts_with('|'))
        .map_or(4, |text| text.len() - text.trim_start().len());
    for raw in &lines {
        let styled = match raw.split_once('|') {
            Some((before, after)) if before.trim().chars().all(|c| c.is_ascii_digit()) => {
                let lead = format!("{before}|");
                let lead = color.gutter().apply_to(lead);
                let is_caret = after.trim_start().starts_with('^');
                if is_caret {
                    format!("{lead}{}", color.verdict(Some(verdict)).apply_to(after))
                } else {
                    format!("{lead}{after}")
                }
            }
            _ if raw.trim_start().starts_with("-->") => color.gutter().apply_to(*raw).to_string(),
            _ => (*raw).to_owned(),
        };
        text.push_str(styled.trim_end());
        text.push('\n');
    }
    gutter
}

/// The line of a monitor, and a line for each of its findings.
#[must_use]
pub fn monitor(monitor: &MonitorResult, color: Color) -> String {
    let tag = color.verdict(monitor.verdict).apply_to(tag(monitor.verdict));
    let judged = many(usize::try_from(monitor.judged).unwrap_or(usize::MAX), "message");
    let judged = color.dim().apply_to(format!("{judged} judged"));
    let mut text = format!("{tag}monitor {}  {judged}\n", line(&monitor.id));
    for finding in &monitor.findings {
        let first: Vec<String> = finding.first.iter().take(5).map(|seq| format!("#{seq}")).collect();
        let times = many(usize::try_from(finding.count).unwrap_or(usize::MAX), "time");
        let id = color
            .verdict(Some(finding.verdict))
            .apply_to(line(&finding.requirement));
        let _ = writeln!(text, "      {id}  {times}, first at {}", first.join(", "));
        let _ = writeln!(text, "      {}", short(&line(&finding.message), 400));
    }
    text
}

/// Where the bundle of a run is.
#[derive(Clone, Copy, Debug, Default)]
pub struct Bundle<'a> {
    /// Path of `report.html`, as the user would type it.
    pub report: Option<&'a str>,
    /// Root hash of the manifest.
    pub root: Option<&'a str>,
}

/// The end of a run: counts per verdict, the statement, where the report is, the root hash.
#[must_use]
pub fn summary(result: &RunResult, bundle: Bundle<'_>, color: Color) -> String {
    let mut text = String::new();
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
    causes(result, color, &mut text);
    let style = color.verdict(result.verdict);
    let word = result
        .verdict
        .map_or("NOTHING DECIDED".to_owned(), |verdict| verdict.word().to_uppercase());
    let _ = writeln!(text, "\n{}  {}", style.apply_to(word), statement::statement(result));
    if result.partial {
        let reason = result
            .partial_reason
            .as_deref()
            .unwrap_or("the run ended before its plan did");
        let style = color.verdict(Some(Verdict::Error));
        let _ = writeln!(text, "{}  {}", style.apply_to("PARTIAL"), line(reason));
    }
    if let Some(report) = bundle.report {
        let _ = writeln!(text, "\nreport  {}", line(report));
    }
    if let Some(root) = bundle.root {
        let _ = writeln!(text, "root    sha256:{}", line(root));
    }
    text
}

/// Why tests decided nothing, where several have one cause.
fn causes(result: &RunResult, color: Color, text: &mut String) {
    let groups = undecided::groups(result);
    if groups.iter().all(|group| group.tests.len() < 2) {
        return;
    }
    let _ = writeln!(text, "\nWhy nothing was decided:");
    for group in groups {
        let count = color.verdict(Some(Verdict::Inconclusive)).apply_to(group.count());
        let _ = writeln!(text, "  {count}: {}", group.cause());
        let _ = writeln!(text, "      {}", color.dim().apply_to(group.named()));
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
