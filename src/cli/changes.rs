//! `list requirements --changes`: what became of the requirements from one version to a later one.

use std::fmt::Write as _;
use std::sync::Arc;

use serde_json::{Value, json};

use super::args::Format;
use super::exit::Exit;
use super::problem::Problem;
use tck_base::diagnostic::Diagnostic;
use tck_judge::Library;
use tck_pack::{ChangeKind, Pack, Requirement, RequirementChange, Role, VersionNote};

/// Prints what is gone, changed, reworded and new.
pub fn changes(range: &str, library: &Library, roles: &[Role], format: Format) -> Result<Exit, Problem> {
    let (from, to) = versions(range, library)?;
    let mut all = library.rules.catalogue.changes(&library.rules.packs, &from, &to);
    all.retain(|change| {
        let requirement = change.requirement();
        requirement.is_some_and(|requirement| roles.iter().any(|role| requirement.role.concerns(*role)))
    });
    match format {
        Format::Text => super::print(&text(&all, &from, &to)),
        Format::Json => super::print(&all.iter().fold(String::new(), |mut lines, change| {
            let _ = writeln!(lines, "{}", object(change));
            lines
        })),
    }
}

/// The two versions of a range such as `1.0..1.1`.
fn versions(range: &str, library: &Library) -> Result<(Arc<Pack>, Arc<Pack>), Problem> {
    let wrong = |title: String| {
        let hint = "two versions with two dots between, the earlier one first";
        Problem::from(Diagnostic::whole("usage", title).hint(hint))
    };
    let (from, to) = range
        .split_once("..")
        .ok_or_else(|| wrong(format!("`{range}` is no range of versions")))?;
    let (from, to) = (super::pack(library, Some(from))?, super::pack(library, Some(to))?);
    let order = |pack: &Pack| (pack.version.major, pack.version.minor);
    if order(&from) >= order(&to) {
        return Err(wrong(format!("{} is not later than {}", to.version, from.version)));
    }
    Ok((from, to))
}

fn text(all: &[RequirementChange<'_>], from: &Pack, to: &Pack) -> String {
    let of = |kind: ChangeKind| all.iter().filter(move |change| change.kind == kind);
    let counts = ChangeKind::ALL.map(|kind| format!("{} {}", of(kind).count(), kind.word()));
    let mut text = format!("VDA 5050 {} to {}: {}\n", from.version, to.version, counts.join(", "));
    for kind in ChangeKind::ALL.into_iter().filter(|kind| *kind != ChangeKind::Same) {
        let mut heading = format!("\n{}\n", kind.word());
        for change in of(kind) {
            text.push_str(&std::mem::take(&mut heading));
            one(change, &mut text);
        }
    }
    text
}

fn one(change: &RequirementChange<'_>, text: &mut String) {
    let mut row = |name: &str, (requirement, note): (&Requirement, &VersionNote)| {
        let _ = writeln!(text, "  {name:<14} {:<6} {}", note.mood.word(), requirement.text);
    };
    let id = change.requirement().map_or("", |requirement| requirement.id.as_str());
    if let Some(now) = change.after.or(change.before) {
        row(id, now);
    }
    if let (Some(before), Some(after)) = (change.before, change.after)
        && (before.0.text != after.0.text || before.1.mood != after.1.mood)
    {
        row("  was", before);
    }
    if let Some(why) = change.why {
        let _ = writeln!(text, "  {:<14} {:<6} {why}", "  why", "");
    }
}

fn object(change: &RequirementChange<'_>) -> Value {
    let said = |side: Option<(&Requirement, &VersionNote)>| {
        side.map(|(requirement, note)| json!({ "text": requirement.text, "mood": note.mood.word(), "section": note.section }))
    };
    let requirement = change.requirement();
    json!({ "id": requirement.map(|requirement| &requirement.id), "change": change.kind,
        "role": requirement.map(|requirement| requirement.role.word()),
        "before": said(change.before), "after": said(change.after), "why": change.why })
}
