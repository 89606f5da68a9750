//! One test of the page: what was decided, by which clause and which message, and what happened around it.

use std::collections::{BTreeMap, BTreeSet};

use super::Anchors;
use super::messages::{Gallery, MessageView};
use super::source_view::{SourceView, source_view};
use super::view::Badge;
use crate::journal::Event;
use crate::report::headline::reference;
use crate::report::repeated;
use crate::report::sources::Sources;
use crate::report::statement::{many, seconds, test_verdict};
use crate::report::{clean, sequence};
use crate::result::{Decision, RunResult, TestResult};
use crate::verdict::Verdict;

/// Most messages shown of one test.
const MESSAGES: usize = 24;
/// Most bytes of diagrams in a page. Where there are more, the journal has what they would show.
const DIAGRAMS: usize = 1_500_000;
/// Stimuli shown before and after each deciding message.
const STIMULI: usize = 3;

/// One test.
pub struct TestView {
    pub anchor: String,
    pub badge: Badge,
    pub id: String,
    pub title: String,
    pub why: String,
    pub reason: Option<String>,
    /// How often it was run and what came out, where it was run several times.
    pub repeated: Option<String>,
    pub flaky: bool,
    /// What was read over, and what else was done to get here.
    pub allowances: Vec<String>,
    pub not_applicable: bool,
    pub watchlist: bool,
    pub maturity_note: Option<String>,
    pub reviewed: bool,
    pub seconds: String,
    /// Whether there is something to look at.
    pub finding: bool,
    /// Whether it is unfolded: something was seen that should not be.
    pub open: bool,
    /// The findings before and after it, by their places.
    pub neighbours: (Option<String>, Option<String>),
    pub decisions: Vec<DecisionView>,
    pub steps: Vec<StepView>,
    pub source: Option<SourceView>,
    pub diagram: Option<String>,
    pub messages: Vec<MessageView>,
    /// What was left out of the messages.
    pub left_out: Option<String>,
}

/// One decision.
pub struct DecisionView {
    pub badge: Badge,
    /// Whether it is shown in full, and not only in the list.
    pub full: bool,
    pub requirement: String,
    pub link: Option<String>,
    pub origin: String,
    pub text: String,
    pub clause: String,
    pub place: String,
    pub message: String,
    /// Whether the explanation says it too.
    pub said: bool,
    pub witness: Option<(u64, bool)>,
    pub expected: Option<String>,
    pub nearest: Option<NearestView>,
    pub waited: Option<String>,
    pub explanation: Option<String>,
    pub interpretation: Option<String>,
    pub deviation: Option<String>,
}

/// The nearest miss.
pub struct NearestView {
    pub seq: u64,
    pub shown: bool,
    pub headline: String,
    pub path: String,
    pub found: String,
    pub expected: String,
}

/// One step.
pub struct StepView {
    pub path: String,
    pub verb: String,
    pub title: String,
    pub place: String,
    pub outcome: String,
    pub class: &'static str,
    pub took: Option<(u64, bool)>,
    pub seconds: String,
}

pub fn views(
    result: &RunResult,
    sources: &Sources,
    anchors: &Anchors,
    gallery: &mut Gallery<'_>,
) -> Result<Vec<TestView>, askama::Error> {
    let mut order: Vec<(usize, &TestResult)> = result.tests.iter().enumerate().collect();
    // What is broken comes first, and takes its evidence first where there is a limit.
    order.sort_by_key(|(_, test)| std::cmp::Reverse(weight(test_verdict(test))));
    let mut drawn = 0;
    let mut all = Vec::with_capacity(order.len());
    for (at, test) in order {
        let view = view(at, test, drawn < DIAGRAMS, result, sources, anchors, gallery)?;
        drawn += view.diagram.as_ref().map_or(0, String::len);
        all.push(view);
    }
    link(&mut all);
    Ok(all)
}

/// What a reader looks at first: what is broken, then remarks, then what broke the harness, then what stayed open.
fn weight(verdict: Option<Verdict>) -> u8 {
    match verdict {
        Some(Verdict::Fail) => 5,
        Some(Verdict::Warning) => 4,
        Some(Verdict::Error) => 3,
        Some(Verdict::Inconclusive) => 2,
        Some(Verdict::Pass) => 1,
        None => 0,
    }
}

/// Lets each finding lead to the one before and the one after it.
fn link(all: &mut [TestView]) {
    let places: Vec<usize> = (0..all.len()).filter(|at| all[*at].open).collect();
    let anchor = |at: Option<&usize>| at.map(|at| all[*at].anchor.clone());
    let neighbours: Vec<_> = (0..places.len())
        .map(|at| {
            (
                anchor(at.checked_sub(1).and_then(|at| places.get(at))),
                anchor(places.get(at + 1)),
            )
        })
        .collect();
    for (place, found) in places.into_iter().zip(neighbours) {
        all[place].neighbours = found;
    }
}

fn view(
    at: usize,
    test: &TestResult,
    draws: bool,
    result: &RunResult,
    sources: &Sources,
    anchors: &Anchors,
    gallery: &mut Gallery<'_>,
) -> Result<TestView, askama::Error> {
    let verdict = test_verdict(test);
    let finding = !matches!(verdict, None | Some(Verdict::Pass));
    let source = sources.test(&test.id);
    let left_out = if finding { choose(test, gallery) } else { None };
    let diagram = match (gallery.journal(), test.journal) {
        (Some(journal), Some(window)) if finding && draws => {
            let marked = marked(test);
            let steps = test
                .steps
                .iter()
                .map(|step| {
                    (
                        step.path.clone(),
                        step.title.clone().unwrap_or_else(|| step.verb.clone()),
                    )
                })
                .collect();
            let options = sequence::Options {
                id: &format!("seq{}", at + 1),
                title: &format!("What happened during {}", clean::line(&test.id)),
                linked: gallery.shown(),
                marked: &marked,
                steps: &steps,
                limit: sequence::ROW_LIMIT,
            };
            Some(sequence::render(journal, window, &options)?)
        }
        _ => None,
    };
    let decisions = test
        .decisions
        .iter()
        .map(|decision| decision_view(decision, result, sources, anchors, gallery))
        .collect();
    Ok(TestView {
        anchor: format!("t{}", at + 1),
        badge: verdict.map_or(Badge::NOT_APPLICABLE, |verdict| Badge::of(Some(verdict))),
        id: test.id.clone(),
        title: test.title.clone(),
        why: source.map(|source| source.why.clone()).unwrap_or_default(),
        reason: test.not_applicable.clone().or_else(|| test.reason.clone()).or_else(|| {
            finding
                .then(|| "the test decided nothing".to_owned())
                .filter(|_| test.decisions.is_empty())
        }),
        repeated: repeated::summary(test),
        flaky: test.is_flaky(),
        allowances: test.allowances.clone(),
        not_applicable: verdict.is_none(),
        watchlist: test.maturity == "watchlist",
        maturity_note: test.maturity_note.clone(),
        reviewed: test.maturity == "reviewed",
        seconds: seconds(test.seconds),
        finding,
        open: matches!(verdict, Some(Verdict::Fail | Verdict::Warning | Verdict::Error)),
        neighbours: (None, None),
        decisions,
        steps: test
            .steps
            .iter()
            .map(|step| StepView {
                path: step.path.clone(),
                verb: step.verb.clone(),
                title: step.title.clone().unwrap_or_default(),
                place: step.place.clone(),
                class: match step.outcome.as_str() {
                    "done" => "done",
                    "not run" => "notrun",
                    _ => "bad",
                },
                outcome: step.outcome.clone(),
                took: step.took.map(|seq| (seq, gallery.shows(seq))),
                seconds: seconds(step.seconds),
            })
            .collect(),
        source: source.filter(|_| finding).map(|source| source_view(source, test)),
        diagram,
        messages: gallery.take(),
        left_out,
    })
}

/// The records a diagram points out.
fn marked(test: &TestResult) -> BTreeMap<u64, String> {
    let mut worst: BTreeMap<u64, Verdict> = BTreeMap::new();
    let mut marked = BTreeMap::new();
    for decision in test.findings() {
        if let Some(nearest) = &decision.nearest {
            marked.insert(nearest.seq, "nearest miss".to_owned());
        }
        if let Some(witness) = decision.witness {
            let entry = worst.entry(witness).or_insert(decision.verdict());
            *entry = entry.join(decision.verdict());
        }
    }
    marked.extend(worst.into_iter().map(|(seq, verdict)| (seq, verdict.word().to_owned())));
    marked
}

/// Asks for the messages of a test: those that decided, the nearest misses, the stimuli around them. Says what
/// was left out.
fn choose(test: &TestResult, gallery: &mut Gallery<'_>) -> Option<String> {
    let journal = gallery.journal()?;
    // The most important first, because there is a limit.
    let pointed_out = marked(test);
    let mut places: BTreeMap<u64, Vec<&str>> = BTreeMap::new();
    for decision in test.findings() {
        if let Some(witness) = decision.witness {
            places.entry(witness).or_default();
        }
        if let Some(nearest) = &decision.nearest {
            places.entry(nearest.seq).or_default().push(&nearest.path);
        }
    }
    for of_one in places.values_mut().filter(|places| places.is_empty()) {
        // Nothing to mark, but the message is shown unfolded.
        of_one.push("");
    }
    let mut wanted: Vec<(u64, &str)> = pointed_out.iter().map(|(seq, role)| (*seq, role.as_str())).collect();
    let mut centres: BTreeSet<u64> = pointed_out.keys().copied().collect();
    wanted.extend(
        test.findings()
            .filter_map(|finding| finding.waited.as_ref())
            .map(|w| (w.since, "stimulus")),
    );
    let (first, last) = test.journal?;
    let all: Vec<_> = journal
        .entries()
        .iter()
        .filter(|entry| (first..=last).contains(&entry.seq()))
        .collect();
    let sent: Vec<u64> = all
        .iter()
        .filter(|entry| matches!(entry.event(), Event::Sent { .. } | Event::Fault { .. }))
        .map(|entry| entry.seq())
        .collect();
    if centres.is_empty() {
        centres.insert(last);
    }
    for centre in &centres {
        let split = sent.partition_point(|seq| seq < centre);
        wanted.extend(sent[..split].iter().rev().take(STIMULI).map(|seq| (*seq, "stimulus")));
        wanted.extend(sent[split..].iter().take(1).map(|seq| (*seq, "stimulus")));
    }
    wanted.extend(
        test.steps
            .iter()
            .filter_map(|step| step.took)
            .map(|seq| (seq, "taken by a step")),
    );
    let mut asked = BTreeSet::new();
    for (seq, role) in wanted {
        if asked.len() >= MESSAGES && !asked.contains(&seq) {
            continue;
        }
        if gallery.show(seq, role, places.get(&seq).map_or(&[], Vec::as_slice)) {
            asked.insert(seq);
        }
    }
    // What the tap saw of them is the same messages once more.
    let seen_once = |event: &Event| {
        matches!(
            event,
            Event::Message { .. } | Event::Sent { .. } | Event::Retained { .. }
        )
    };
    let recorded = || all.iter().filter(|entry| seen_once(entry.event()));
    let messages = recorded().count();
    let shown = recorded().filter(|entry| gallery.shows(entry.seq())).count();
    (shown < messages).then(|| {
        format!(
            "{shown} of the {} recorded during this test; the journal has all of them.",
            many(messages, "message")
        )
    })
}

fn decision_view(
    decision: &Decision,
    result: &RunResult,
    sources: &Sources,
    anchors: &Anchors,
    gallery: &Gallery<'_>,
) -> DecisionView {
    let known = sources.requirement(&decision.requirement);
    let see = |seq: u64| reference(gallery.entry(seq), seq);
    DecisionView {
        badge: Badge::of(Some(decision.verdict())),
        full: decision.is_finding(),
        requirement: decision.requirement.clone(),
        link: anchors.requirement(&decision.requirement),
        origin: known
            .map(|known| format!("{}, §{}", known.mood, known.section))
            .unwrap_or_default(),
        text: known.map(|known| known.text.clone()).unwrap_or_default(),
        clause: decision.clause.clone(),
        place: decision.place.clone(),
        message: decision.message.clone(),
        said: decision
            .explanation
            .as_ref()
            .is_some_and(|text| text.contains(&decision.message)),
        witness: decision.witness.map(|seq| (seq, gallery.shows(seq))),
        expected: decision.expected.as_deref().map(|text| clean::block(text).into_owned()),
        nearest: decision.nearest.as_ref().map(|nearest| NearestView {
            seq: nearest.seq,
            shown: gallery.shows(nearest.seq),
            headline: see(nearest.seq),
            path: nearest.path.clone(),
            found: clean::block(&nearest.found).into_owned(),
            expected: clean::block(&nearest.expected).into_owned(),
        }),
        waited: decision.waited.as_ref().map(|waited| {
            let came = many(usize::try_from(waited.messages).unwrap_or(usize::MAX), "message");
            format!(
                "{} after {}; {came} came meanwhile",
                seconds(waited.seconds),
                see(waited.since)
            )
        }),
        explanation: decision
            .explanation
            .as_deref()
            .map(|text| clean::block(text).into_owned()),
        interpretation: decision.interpretation.clone(),
        deviation: result.deviations.get(&decision.requirement).cloned(),
    }
}
