//! A migration in Markdown.

use std::fmt::Write as _;

use super::model::{Migration, RequirementRow, Said};
use super::words;
use tck_pack::ChangeKind;
use tck_report::clean::{line, short};

/// How long a cell is.
const LENGTH: usize = 600;

/// The page.
#[must_use]
pub fn markdown(migration: &Migration) -> String {
    let mut text = format!(
        "## {}\n\n{}. {}.\n\n{}\n",
        cell(&words::title(migration)),
        cell(&migration.extent()),
        words::counts(migration),
        words::LIMITS
    );
    let topics = migration.topics.iter().map(|change| {
        let said = |terms: Option<super::TopicTerms>| terms.map_or_else(String::new, |terms| terms.to_string());
        vec![change.topic.clone(), said(change.before), said(change.after)]
    });
    table(&mut text, "Topics", &["Topic", "Now", "Then"], topics);
    let members = migration.members.iter().map(|member| {
        vec![
            member.kind.word().to_owned(),
            format!("{} {}", member.topic, member.before),
            words::becomes(member),
            member.messages.to_string(),
        ]
    });
    table(&mut text, "Members", &["", "Now", "Then", "Messages with it"], members);
    let all = migration.words.iter().map(|word| {
        vec![
            word.member.clone(),
            word.before.clone(),
            words::written(word).to_owned(),
            word.messages.to_string(),
        ]
    });
    table(&mut text, "Words", &["Where", "Now", "Then", "Messages with it"], all);
    let breaches = migration.breaches.iter().map(|breach| {
        vec![
            breach.requirement.clone().unwrap_or_default(),
            format!("{} {}", breach.topic, breach.member),
            breach.text.clone(),
            breach.messages.to_string(),
            breach.line.to_string(),
        ]
    });
    table(
        &mut text,
        "Wrong once members and words have their new names",
        &["Requirement", "Where", "What", "Messages", "First line"],
        breaches,
    );
    for change in ChangeKind::ALL {
        let rows = migration.of(change).map(of_row);
        let columns = [
            "Requirement",
            "Now",
            "Then",
            "What is different",
            "Its messages",
            "Decided by",
        ];
        table(&mut text, words::heading(change), &columns, rows);
    }
    text
}

fn of_row(row: &RequirementRow) -> Vec<String> {
    let said = |said: Option<&Said>| {
        said.map_or_else(String::new, |said| {
            format!("{} (§{}): {}", said.mood, said.section, said.text)
        })
    };
    let decided = row.after.as_ref().map(|_| words::decided_by(row));
    vec![
        row.id.clone(),
        said(row.before.as_ref()),
        said(row.after.as_ref()),
        row.why.clone().unwrap_or_default(),
        words::standing(row).unwrap_or_default(),
        decided.unwrap_or_default(),
    ]
}

/// A table below a heading; nothing where it has no rows.
fn table(text: &mut String, heading: &str, columns: &[&str], rows: impl Iterator<Item = Vec<String>>) {
    let mut head = format!(
        "\n### {heading}\n\n| {} |\n|{}\n",
        columns.join(" | "),
        "---|".repeat(columns.len())
    );
    for row in rows {
        text.push_str(&std::mem::take(&mut head));
        let cells: Vec<String> = row.iter().map(|one| cell(one)).collect();
        let _ = writeln!(text, "| {} |", cells.join(" | "));
    }
}

/// A text in which nothing is markup.
fn cell(text: &str) -> String {
    let text = short(&line(text), LENGTH).into_owned();
    let mut safe = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '\\' | '`' | '*' | '_' | '[' | ']' | '|' | '#' | '!' | '~' | '@' => {
                safe.push('\\');
                safe.push(character);
            }
            _ => safe.push(character),
        }
    }
    safe
}
