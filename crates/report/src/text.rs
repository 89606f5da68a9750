//! What the terminal says about a result, as plain strings.
//!
//! One line per test, and a block per finding laid out as rustc would lay it out. The overview of a run is in `overview`.
//! When and where to print is left to the command line. Device strings are cleaned before they get here or
//! here; colour is added last and only on request.

use std::fmt::Write as _;

use console::{Style, measure_text_width};

use super::clean::{block, line, short};
use super::headline::reference;
use super::sources::Sources;
use super::statement::{self, many, seconds};
use tck_base::verdict::Verdict;
use tck_journal::Journal;
use tck_result::{Decision, MonitorResult, TestResult, Waited};

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

    pub(super) fn verdict(self, verdict: Option<Verdict>) -> Style {
        let style = Style::new().bold();
        self.style(match verdict {
            Some(Verdict::Pass) => style.green(),
            Some(Verdict::Warning) => style.yellow(),
            Some(Verdict::Inconclusive) => style.magenta(),
            Some(Verdict::Error | Verdict::Fail) => style.red(),
            None => Style::new().dim(),
        })
    }

    pub(super) fn dim(self) -> Style {
        self.style(Style::new().dim())
    }

    fn gutter(self) -> Style {
        self.style(Style::new().blue().bold())
    }
}

/// What stands in front of a line: `PASS`, `WARN`, `INCONCLUSIVE`, `ERROR`, `FAIL`, `n/a`, with the gap.
pub(super) fn tag(verdict: Option<Verdict>) -> &'static str {
    match verdict {
        Some(Verdict::Pass) => "PASS  ",
        Some(Verdict::Warning) => "WARN  ",
        Some(Verdict::Inconclusive) => "INCONCLUSIVE ",
        Some(Verdict::Error) => "ERROR ",
        Some(Verdict::Fail) => "FAIL  ",
        None => "n/a   ",
    }
}

/// The one line of a test.
#[must_use]
pub fn test_line(test: &TestResult, color: Color) -> String {
    let verdict = statement::test_verdict(test);
    let word = tag(verdict);
    let tag = color.verdict(verdict).apply_to(word);
    let id = line(&test.id);
    if let Some(why) = test.not_applicable.as_ref().filter(|_| verdict.is_none()) {
        return format!("{tag}{id}  {}\n", color.dim().apply_to(short(&line(why), 120)));
    }
    let time = seconds(test.seconds);
    let used = word.len() + measure_text_width(&id) + time.len();
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
    let find = |seq| journal.and_then(|journal| journal.get(seq));
    if let Some(sent) = &decision.sent {
        let message = match find(sent.seq) {
            Some(_) => reference(journal, sent.seq),
            None => format!("#{} {}", sent.seq, line(&sent.topic)),
        };
        let about = match sent.about() {
            about if about.is_empty() => String::new(),
            about => format!(": {}", short(&line(&about), 400)),
        };
        note("sent", format!("{message}{about}"));
    }
    if let Some(expected) = &decision.expected {
        note("expected", short(&line(expected), 400).into_owned());
    }
    if let Some(Waited {
        seconds: time,
        since,
        messages,
    }) = decision.waited
    {
        let came = many(usize::try_from(messages).unwrap_or(usize::MAX), "message");
        note(
            "waited",
            format!("{} after {}; {came} came", seconds(time), reference(journal, since)),
        );
    }
    // Where the message that decided is the nearest miss, the line below says more about it.
    let is_nearest = |seq| decision.nearest.as_ref().is_some_and(|nearest| nearest.seq == seq);
    if let Some(witness) = decision.witness.filter(|witness| !is_nearest(*witness)) {
        note("decided", format!("by {}", reference(journal, witness)));
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
        let kind = find(nearest.seq).map_or(String::new(), |entry| format!(" {}", super::headline::kind(&entry)));
        note(
            "closest",
            format!(
                "#{}{kind}{after}:  {} is {}, expected {}",
                nearest.seq,
                line(nearest.place()),
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
