//! A migration in Markdown.

use super::model::{Migration, RequirementRow, Said};
use super::words;
use tck_pack::ChangeKind;
use tck_report::markdown_table::{Column, cell, table};

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
        [change.topic.clone(), said(change.before), said(change.after)]
    });
    below(&mut text, "Topics", ["Topic", "Now", "Then"], topics);
    let members = migration.members.iter().map(|member| {
        [
            member.kind.word().to_owned(),
            format!("{} {}", member.topic, member.before),
            words::becomes(member),
            member.messages.to_string(),
        ]
    });
    below(&mut text, "Members", ["", "Now", "Then", "Messages with it"], members);
    let all = migration.words.iter().map(|word| {
        [
            word.member.clone(),
            word.before.clone(),
            words::written(word).to_owned(),
            word.messages.to_string(),
        ]
    });
    below(&mut text, "Words", ["Where", "Now", "Then", "Messages with it"], all);
    let breaches = migration.breaches.iter().map(|breach| {
        [
            breach.requirement.clone().unwrap_or_default(),
            format!("{} {}", breach.topic, breach.member),
            breach.text.clone(),
            breach.messages.to_string(),
            breach.line.to_string(),
        ]
    });
    below(
        &mut text,
        "Wrong once members and words have their new names",
        ["Requirement", "Where", "What", "Messages", "First line"],
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
        below(&mut text, words::heading(change), columns, rows);
    }
    text
}

fn of_row(row: &RequirementRow) -> [String; 6] {
    let said = |said: Option<&Said>| {
        said.map_or_else(String::new, |said| {
            format!("{} (§{}): {}", said.mood, said.section, said.text)
        })
    };
    let decided = row.after.as_ref().map(|_| words::decided_by(row));
    [
        row.id.clone(),
        said(row.before.as_ref()),
        said(row.after.as_ref()),
        row.why.clone().unwrap_or_default(),
        words::standing(row).unwrap_or_default(),
        decided.unwrap_or_default(),
    ]
}

/// A table below a heading; nothing where it has no rows.
fn below<const N: usize>(
    text: &mut String,
    heading: &str,
    columns: [&str; N],
    rows: impl Iterator<Item = [String; N]>,
) {
    let mut rows = rows.map(|row| row.map(|one| cell(&one))).peekable();
    if rows.peek().is_some() {
        text.push_str(&format!(
            "\n### {heading}\n\n{}",
            table(columns.map(Column::Text), rows)
        ));
    }
}
