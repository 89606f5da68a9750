//! What a test says of itself in its head: tags, and how far it is trusted.

use super::fields::{Fields, Problems, short, text_of};
use super::model::{Maturity, Test};
use tck_base::diagnostic::Diagnostic;

/// What a test is filed under.
pub(super) fn tags(fields: &Fields<'_>, problems: &mut Problems) -> Vec<String> {
    let mut tags = Vec::new();
    for node in fields.list("tags", problems) {
        let Some(tag) = text_of(node, problems) else { continue };
        let is_word = !tag.is_empty()
            && tag
                .chars()
                .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-');
        if !is_word {
            let title = format!("`{}` is no tag", short(tag));
            problems.at(
                "bad-tag",
                &node.span,
                title,
                "a tag is a word of small letters, digits and `-`",
            );
        } else if Test::OWN_TAGS.contains(&tag) {
            let title = format!("every test is given the tag `{tag}` by what it does");
            problems.at("bad-tag", &node.span, title, "leave it out");
        } else {
            tags.push(tag.to_owned());
        }
    }
    tags
}

/// Whether a second reader has held the test against the standard, or what is disputed of it.
pub(super) fn maturity(fields: &Fields<'_>, problems: &mut Problems) -> Maturity {
    let note = |key: &str, problems: &mut Problems| fields.text(key, problems).map(str::to_owned);
    if let Some(key) = fields.key("watchlist").filter(|_| fields.has("reviewed")) {
        let title = "`watchlist` beside `reviewed`";
        problems.at(
            "conflicting-keys",
            &key.span,
            title,
            "a review settles what is disputed",
        );
    }
    if let Some(why) = note("watchlist", problems) {
        return Maturity::Watchlist(why);
    }
    let Some(note) = note("reviewed", problems) else {
        return Maturity::Open;
    };
    let (date, looked_at) = note.split_once(',').unwrap_or((&note, ""));
    let is_date = date.parse::<jiff::civil::Date>().is_ok() && date.len() == 10;
    if let Some(node) = fields
        .get("reviewed", problems)
        .filter(|_| !is_date || looked_at.trim().is_empty())
    {
        problems.add(
            Diagnostic::new(
                "review-undated",
                node.span.clone(),
                "a review says when it was, and what was looked at",
                "needs a date, a comma and a few words",
            )
            .hint("such as `reviewed: \"2026-11-22, section 6.6.4 and both rulings\"`"),
        );
    }
    Maturity::Reviewed(note)
}
