//! A migration as one page of HTML, without network and without scripts.

use askama::Template;

use super::model::{Migration, RequirementRow};
use super::words;
use tck_base::verdict::Verdict;
use tck_pack::ChangeKind;

#[derive(Template)]
#[template(path = "audit/migrate.html")]
struct Page<'a> {
    migration: &'a Migration,
    title: String,
    counts: String,
    extent: String,
    limits: &'static str,
    members: Vec<(String, String, String, String)>,
    words: Vec<(String, String, String, String)>,
    parts: Vec<Part<'a>>,
}

/// The requirements of one kind.
struct Part<'a> {
    word: &'static str,
    heading: &'static str,
    rows: Vec<Row<'a>>,
}

struct Row<'a> {
    requirement: &'a RequirementRow,
    class: &'static str,
    standing: String,
    decided: String,
}

/// The page.
///
/// # Errors
/// The template cannot be filled in; it has no reason to.
pub fn html(migration: &Migration) -> Result<String, askama::Error> {
    let part = |change: ChangeKind| Part {
        word: change.word(),
        heading: words::heading(change),
        rows: migration.of(change).map(row).collect(),
    };
    let parts = ChangeKind::ALL.into_iter().map(part);
    let members = migration.members.iter().map(|member| {
        (
            member.kind.word().to_owned(),
            format!("{} {}", member.topic, member.before),
            words::becomes(member),
            member.messages.to_string(),
        )
    });
    let written = migration.words.iter().map(|word| {
        (
            word.member.clone(),
            word.before.clone(),
            words::written(word).to_owned(),
            word.messages.to_string(),
        )
    });
    let page = Page {
        migration,
        title: words::title(migration),
        counts: words::counts(migration),
        extent: migration.extent(),
        limits: words::LIMITS,
        members: members.collect(),
        words: written.collect(),
        parts: parts.filter(|part| !part.rows.is_empty()).collect(),
    };
    page.render()
}

fn row(row: &RequirementRow) -> Row<'_> {
    let broken = row.then.filter(|_| row.is_broken());
    let decided = row.after.as_ref().map(|_| words::decided_by(row));
    Row {
        requirement: row,
        class: broken.map_or("", Verdict::word),
        standing: words::standing(row).unwrap_or_default(),
        decided: decided.unwrap_or_default(),
    }
}
