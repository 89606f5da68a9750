//! From "it holds or it does not" to a verdict.
//!
//! `shall` broken is a fail, `should` broken a warning; a ruling of the catalogue, or coming late, is a
//! warning; what could not be observed is inconclusive. A requirement the protocol version does not have
//! is not judged at all.

use tck_base::diagnostic::Diagnostic;
use tck_base::verdict::Verdict;
use tck_pack::{Catalogue, Mood, Pack, Requirement};
use tck_result::Decision;

use super::hidden::Open;
use super::step::{Clause, ClauseOutcome};

/// The mood of a requirement in this version; `None` when the version does not have it.
pub(super) fn mood<'a>(catalogue: &'a Catalogue, pack: &Pack, id: &str) -> Option<(&'a Requirement, Mood)> {
    let requirement = catalogue.get(id)?;
    let note = requirement.in_version(pack)?;
    Some((requirement.edition(pack), note.mood))
}

/// Turns a clause into a decision; `None` when the version does not have the requirement.
pub(super) fn decide(open: Open, catalogue: &Catalogue, pack: &Pack) -> Option<Decision> {
    let Open {
        clause,
        path,
        waited,
        sent,
        ..
    } = open;
    let (requirement, mood) = mood(catalogue, pack, clause.requirement.as_str())?;
    let verdict = match &clause.holds {
        ClauseOutcome::Held => Verdict::Pass,
        ClauseOutcome::HeldLate | ClauseOutcome::Warning => Verdict::Warning,
        ClauseOutcome::Violated => mood.broken(),
        ClauseOutcome::Unobservable(_) => Verdict::Inconclusive,
    };
    let broken = matches!(
        clause.holds,
        ClauseOutcome::Violated | ClauseOutcome::Warning | ClauseOutcome::HeldLate
    );
    let explanation = broken.then(|| explain(&clause));
    let (word, place) = (format!("{path}.{}", clause.word), clause.span.place());
    let mut decision = Decision::new(clause.requirement.as_str(), verdict, word, place, clause.message);
    decision.witness = clause.witness;
    decision.sent = sent.filter(|_| broken);
    decision.expected = clause.expected;
    decision.nearest = clause.nearest;
    decision.waited = waited.filter(|_| broken);
    decision.explanation = explanation;
    decision.interpretation = requirement.interpretation.clone().filter(|_| broken);
    Some(decision)
}

/// The clause with a caret. What was awaited, the nearest miss and the next command stand in the decision itself;
/// the renderings put them below.
fn explain(clause: &Clause) -> String {
    Diagnostic::new("", clause.span.clone(), "", clause.label.clone()).render_place()
}
