//! A migration for people at a terminal.

use std::fmt::Write as _;

use super::model::{Migration, RequirementRow, Said};
use super::words;
use tck_pack::ChangeKind;
use tck_report::clean::{line, short};

/// How long a line of what was found is.
const LENGTH: usize = 300;

/// The text.
#[must_use]
pub fn text(migration: &Migration) -> String {
    let mut text = format!(
        "{}\n{}. {}.\n{}\n",
        line(&words::title(migration)),
        line(&migration.extent()),
        words::counts(migration),
        words::LIMITS
    );
    if !migration.topics.is_empty() {
        text.push_str("\nTopics\n");
        for change in &migration.topics {
            let said = |terms: Option<super::TopicTerms>| {
                terms.map_or_else(|| "nothing".to_owned(), |terms| terms.to_string())
            };
            let _ = writeln!(
                text,
                "  {:<16} {} -> {}",
                change.topic,
                said(change.before),
                said(change.after)
            );
        }
    }
    if !migration.members.is_empty() {
        text.push_str("\nMembers\n");
        for member in &migration.members {
            let _ = writeln!(
                text,
                "  {:<8} {} {} -> {}, {}",
                member.kind.word(),
                member.topic,
                member.before,
                words::becomes(member),
                words::seen(member.messages)
            );
        }
    }
    if !migration.words.is_empty() {
        text.push_str("\nWords\n");
        for word in &migration.words {
            let _ = writeln!(
                text,
                "  {} {} -> {}, {}",
                word.member,
                word.before,
                words::written(word),
                words::seen(word.messages)
            );
        }
    }
    if !migration.breaches.is_empty() {
        text.push_str("\nWrong once members and words have their new names\n");
        for breach in &migration.breaches {
            let id = breach.requirement.as_deref().unwrap_or_default();
            let _ = writeln!(
                text,
                "  {:<14} {} {}: {}, {}, first in line {}",
                id,
                breach.topic,
                line(&breach.member),
                short(&line(&breach.text), LENGTH),
                words::seen(breach.messages),
                breach.line
            );
        }
    }
    for change in ChangeKind::ALL {
        let mut heading = format!("\n{}\n", words::heading(change));
        for row in migration.of(change) {
            text.push_str(&std::mem::take(&mut heading));
            of_row(row, &mut text);
        }
    }
    text
}

fn of_row(row: &RequirementRow, text: &mut String) {
    let mut said = |name: &str, said: &Said| {
        let _ = writeln!(text, "  {name:<14} {:<6} {} (§{})", said.mood, said.text, said.section);
    };
    match (&row.before, &row.after) {
        (Some(before), Some(after)) => {
            said(&row.id, after);
            if before.text != after.text || before.mood != after.mood {
                said("  was", before);
            }
        }
        (Some(one), None) | (None, Some(one)) => said(&row.id, one),
        (None, None) => {}
    }
    let mut aside = |name: &str, what: &str| {
        let _ = writeln!(text, "    {name:<12} {:<6} {what}", "");
    };
    if let Some(why) = &row.why {
        aside("why", why);
    }
    if let Some(standing) = words::standing(row) {
        aside("messages", &short(&line(&standing), LENGTH));
    }
    if row.after.is_some() {
        aside("decided by", &words::decided_by(row));
    }
}
