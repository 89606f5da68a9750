//! From "it holds or it does not" to a verdict.
//!
//! `shall` broken is a fail, `should` broken a warning; a ruling of the catalogue, or coming late, is a
//! warning; what could not be observed is inconclusive. A requirement the protocol version does not have
//! is not judged at all.

use crate::diagnostic::Diagnostic;
use crate::pack::{Catalogue, Mood, Pack, Requirement};
use crate::report::result::{Decision, Waited};
use crate::verdict::Verdict;

use super::step::{Clause, Holds};

/// The mood of a requirement in this version; `None` when the version does not have it.
pub(super) fn mood<'a>(catalogue: &'a Catalogue, pack: &Pack, id: &str) -> Option<(&'a Requirement, Mood)> {
    let requirement = catalogue.get(id)?;
    let note = requirement.in_version(pack)?;
    Some((requirement, note.mood))
}

/// Turns a clause into a decision; `None` when the version does not have the requirement.
pub(super) fn decide(
    clause: Clause,
    path: &str,
    waited: Option<Waited>,
    catalogue: &Catalogue,
    pack: &Pack,
) -> Option<Decision> {
    let (requirement, mood) = mood(catalogue, pack, clause.requirement.as_str())?;
    let verdict = match &clause.holds {
        Holds::Yes => Verdict::Pass,
        Holds::Late | Holds::Softly => Verdict::Warning,
        Holds::No => mood.broken(),
        Holds::Unseen(_) => Verdict::Inconclusive,
    };
    let broken = matches!(clause.holds, Holds::No | Holds::Softly | Holds::Late);
    let explanation = broken.then(|| explain(&clause, waited.as_ref()));
    Some(Decision {
        requirement: clause.requirement.as_str().to_owned(),
        verdict,
        clause: format!("{path}.{}", clause.word),
        place: clause.span.place(),
        witness: clause.witness,
        message: clause.message,
        expected: clause.expected,
        nearest: clause.nearest,
        waited: waited.filter(|_| broken),
        explanation,
        interpretation: if broken {
            requirement.interpretation.clone()
        } else {
            None
        },
    })
}

/// The clause with a caret, what was awaited, and the nearest miss.
fn explain(clause: &Clause, waited: Option<&Waited>) -> String {
    let caret = Diagnostic::new("", clause.span.clone(), "", clause.label.clone()).render_place();
    let mut text = caret;
    let mut note = |word: &str, what: String| text.push_str(&format!("\n    = {word:<8} {what}"));
    if let Some(expected) = &clause.expected {
        note("expected", expected.clone());
    }
    if let Some(waited) = waited {
        let messages = match waited.messages {
            1 => "1 message came".to_owned(),
            n => format!("{n} messages came"),
        };
        note(
            "waited",
            format!("{:.1} s since #{}; {messages}", waited.seconds, waited.since),
        );
    }
    if let Some(miss) = &clause.nearest {
        note(
            "closest",
            format!(
                "#{}: {} is {}, expected {}",
                miss.seq,
                super::step::shown_path(&miss.path),
                miss.found,
                miss.expected
            ),
        );
    } else {
        note("found", clause.message.clone());
    }
    note("see", format!("vda5050-tck explain {}", clause.requirement));
    text
}
