//! What renderings of a migration say alike.

use super::model::{MemberChange, Migration, RequirementRow, WordChange};
use tck_base::verdict::Verdict;
use tck_pack::ChangeKind;

/// How many tests or monitors are named of one requirement.
const NAMED: usize = 4;

/// The limits of what is said.
pub const LIMITS: &str = "Each message was judged by itself, once as it is, and once with the members and words of the later version. \
                          What shows only in a conversation is decided by the tests that are named.";

/// In one line.
pub fn title(migration: &Migration) -> String {
    let Migration { device, from, to, .. } = migration;
    format!("{device}: from VDA 5050 {from} to {to}")
}

/// How many requirements became what.
pub fn counts(migration: &Migration) -> String {
    let count = |change: ChangeKind| migration.of(change).count();
    format!(
        "Of its requirements {} are gone, {} changed, {} reworded and {} new; its messages break {} of the later version",
        count(ChangeKind::Gone),
        count(ChangeKind::Changed),
        count(ChangeKind::Reworded),
        count(ChangeKind::New),
        migration.broken()
    )
}

/// The heading of the requirements of one kind.
pub fn heading(change: ChangeKind) -> &'static str {
    match change {
        ChangeKind::Gone => "Gone",
        ChangeKind::Changed => "Changed",
        ChangeKind::Reworded => "Reworded, such as by other names",
        ChangeKind::New => "New",
        ChangeKind::Same => "As before, and broken by its messages",
    }
}

/// What becomes of a member, behind its name.
pub fn becomes(member: &MemberChange) -> String {
    match (&member.types, &member.after) {
        (Some([before, after]), Some(place)) if *place == member.before => format!("{before}, then {after}"),
        (Some([before, after]), Some(place)) => format!("{place} ({before}, then {after})"),
        (_, Some(place)) => place.clone(),
        (_, None) => "nothing".to_owned(),
    }
}

/// What becomes of a word.
pub fn written(word: &WordChange) -> &str {
    word.after.as_deref().unwrap_or("nothing")
}

/// In how many messages something came.
pub fn seen(messages: u64) -> String {
    match messages {
        0 => "not in its messages".to_owned(),
        1 => "in 1 message".to_owned(),
        many => format!("in {many} messages"),
    }
}

/// How the messages stand to a requirement; nothing where they decide nothing.
pub fn standing(row: &RequirementRow) -> Option<String> {
    let found = row.found.as_deref().unwrap_or_default();
    let times = seen(row.count);
    match (row.then?, row.now) {
        (then @ (Verdict::Fail | Verdict::Warning), Some(Verdict::Fail | Verdict::Warning)) => {
            Some(format!("{then} {times}, today, too: {found}"))
        }
        (then @ (Verdict::Fail | Verdict::Warning), _) => Some(format!("{then} {times}: {found}")),
        (Verdict::Pass, _) => Some("kept by its messages".to_owned()),
        _ => None,
    }
}

/// What decides a requirement in the later version: tests, then monitors.
pub fn decided_by(row: &RequirementRow) -> String {
    let named = |all: &[String], one: &str| {
        let more = all.len().saturating_sub(NAMED);
        let names = all[..all.len() - more].join(", ");
        match (all.len(), more) {
            (0, _) => None,
            (1, _) => Some(format!("{one} {names}")),
            (_, 0) => Some(format!("{one}s {names}")),
            _ => Some(format!("{one}s {names} and {more} more")),
        }
    };
    let all = [named(&row.tests, "test"), named(&row.monitors, "monitor")];
    let all: Vec<String> = all.into_iter().flatten().collect();
    if all.is_empty() {
        "nothing yet".to_owned()
    } else {
        all.join("; ")
    }
}
