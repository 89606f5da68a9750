//! What a monitor says of recorded traffic: whether and how it is judged by it.

use super::fields::{Fields, Problems, text_of, word_of};
use super::model::{Recordings, Rule};
use tck_base::diagnostic::Diagnostic;

/// How a word becomes what it says.
type Meaning = fn() -> Recordings;

/// The words that stand without a reason.
const WORDS: [(&str, Meaning); 6] = [
    ("message", || Recordings::Message),
    ("message-on-topic", || Recordings::MessageOnTopic),
    ("message-and-factsheet", || Recordings::MessageAndFactsheet),
    ("unbroken", || Recordings::Unbroken),
    ("unbroken-in-time", || Recordings::UnbrokenInTime),
    ("packets", || Recordings::Packets),
];

/// Whether and how a recording is judged by a monitor with this rule.
pub(super) fn recordings(fields: &Fields<'_>, rule: Option<&Rule>, problems: &mut Problems) -> Option<Recordings> {
    if !fields.has("recordings") {
        return rule.map(Recordings::of_rule);
    }
    let node = fields.get("recordings", problems)?;
    if node.map().is_some() {
        let inner = Fields::of(node, problems)?;
        inner.only(&[&["never"]], problems);
        let why = inner.need_text("never", &node.span, problems)?;
        return Some(Recordings::Never(why.to_owned()));
    }
    let word = text_of(node, problems)?;
    if word == "never" {
        problems.add(
            Diagnostic::new(
                "recordings-without-reason",
                node.span.clone(),
                "recordings are never judged by it, and nobody is told why",
                "needs a reason",
            )
            .hint("such as `recordings: { never: \"only all packets from the beginning show it\" }`"),
        );
        return None;
    }
    let code = "unknown-recordings";
    let how = word_of(word, &node.span, "way to judge recordings", code, &WORDS, problems)?;
    Some(how())
}
