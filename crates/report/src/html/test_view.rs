//! One test of the page: what was decided, by which clause and which message, and what happened around it.

use super::Anchors;
use super::courses::Courses;
use super::evidence::{choose, marked};
use super::messages::{Gallery, MessageView};
use super::source_view::{SourceView, source_view};
use super::thinning::Thinned;
use super::view::Badge;
use crate::headline::reference;
use crate::repeated;
use crate::sources::Sources;
use crate::statement::{many, seconds, test_verdict};
use crate::{clean, sequence};
use tck_base::verdict::Verdict;
use tck_result::{Decision, RunResult, TestResult};

/// Most bytes of diagrams in a page. Where there are more, the journal has what they would show.
const DIAGRAMS: usize = 1_500_000;

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
    /// What rests on a person's word.
    pub on_word: Vec<String>,
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
    /// Where the vehicle was, with what it was told.
    pub course: Option<String>,
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
    /// Where the obligation can be read.
    pub text_link: Option<String>,
    pub text: String,
    pub clause: String,
    pub place: String,
    pub message: String,
    /// Whether the explanation says it too.
    pub said: bool,
    pub witness: Option<(u64, bool)>,
    pub sent: Option<SentView>,
    pub expected: Option<String>,
    pub nearest: Option<NearestView>,
    pub waited: Option<String>,
    pub explanation: Option<String>,
    pub interpretation: Option<String>,
    pub deviation: Option<String>,
}

/// What was sent before.
pub struct SentView {
    pub seq: u64,
    pub shown: bool,
    pub headline: String,
    /// Place and value.
    pub members: Vec<(String, String)>,
    pub more: usize,
    pub raw: Option<String>,
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
    thinned: &Thinned<'_>,
    gallery: &mut Gallery<'_>,
    courses: &mut Courses,
) -> Result<Vec<TestView>, askama::Error> {
    let mut order: Vec<(usize, &TestResult)> = result.tests.iter().enumerate().collect();
    // What is broken comes first, and takes its evidence first where there is a limit.
    order.sort_by_key(|(_, test)| std::cmp::Reverse(weight(test_verdict(test))));
    let mut drawn = 0;
    let mut all = Vec::with_capacity(order.len());
    for (at, test) in order {
        let evidence = if thinned.leaves_out(&test.id, test_verdict(test)) {
            Evidence::LeftOut
        } else if drawn < DIAGRAMS {
            Evidence::Whole
        } else {
            Evidence::NotDrawn
        };
        let mut view = view(at, test, evidence, result, sources, anchors, gallery)?;
        view.course = courses.of_test(at, test, gallery)?;
        drawn += view.diagram.as_ref().map_or(0, String::len);
        all.push(view);
    }
    link(&mut all);
    Ok(all)
}

/// How much the page shows of what happened in a test.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Evidence {
    Whole,
    /// All but the diagram, because there are too many.
    NotDrawn,
    /// Nothing.
    LeftOut,
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
    evidence: Evidence,
    result: &RunResult,
    sources: &Sources,
    anchors: &Anchors,
    gallery: &mut Gallery<'_>,
) -> Result<TestView, askama::Error> {
    let verdict = test_verdict(test);
    let finding = !matches!(verdict, None | Some(Verdict::Pass));
    let source = sources.test(&test.id);
    let shown = finding && evidence != Evidence::LeftOut;
    let mut left_out = if shown { choose(test, gallery) } else { None };
    let diagram = match (gallery.journal(), test.journal) {
        (Some(journal), Some(window)) if shown && evidence == Evidence::Whole => {
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
    let not_drawn = shown && evidence == Evidence::NotDrawn && gallery.journal().is_some();
    if not_drawn {
        let missing = "The diagram is left out, because the page has so many; the journal has what it would show.";
        left_out = Some(left_out.map_or_else(|| missing.to_owned(), |said| format!("{said} {missing}")));
    } else if evidence == Evidence::LeftOut {
        let missing = if finding { "Steps and messages" } else { "The steps" };
        left_out = Some(format!(
            "{missing} are left out to keep the page small; result and journal have them."
        ));
    }
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
        on_word: result
            .on_word
            .iter()
            .filter(|one| one.test == test.id)
            .map(ToString::to_string)
            .collect(),
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
            .filter(|_| evidence != Evidence::LeftOut)
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
        source: source.filter(|_| shown).map(|source| source_view(source, test)),
        course: None,
        diagram,
        messages: gallery.take(),
        left_out,
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
    let see = |seq: u64| reference(gallery.journal(), seq);
    DecisionView {
        badge: Badge::of(Some(decision.verdict())),
        full: decision.is_finding(),
        requirement: decision.requirement.clone(),
        link: anchors.requirement(&decision.requirement),
        origin: known
            .map(|known| format!("{}, §{}", known.mood, known.section))
            .unwrap_or_default(),
        text_link: known.and_then(|known| known.link.clone()),
        text: known.map(|known| known.text.clone()).unwrap_or_default(),
        clause: decision.clause.clone(),
        place: decision.place.clone(),
        message: decision.message.clone(),
        said: decision
            .explanation
            .as_ref()
            .is_some_and(|text| text.contains(&decision.message)),
        witness: decision.witness.map(|seq| (seq, gallery.shows(seq))),
        sent: decision.sent.as_ref().map(|sent| SentView {
            seq: sent.seq,
            shown: gallery.shows(sent.seq),
            headline: see(sent.seq),
            members: sent
                .members
                .iter()
                .map(|member| (member.path.clone(), clean::block(&member.value).into_owned()))
                .collect(),
            more: sent.more,
            raw: sent.raw.as_deref().map(|raw| clean::block(raw).into_owned()),
        }),
        expected: decision.expected.as_deref().map(|text| clean::block(text).into_owned()),
        nearest: decision.nearest.as_ref().map(|nearest| NearestView {
            seq: nearest.seq,
            shown: gallery.shows(nearest.seq),
            headline: see(nearest.seq),
            path: nearest.place().to_owned(),
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
