//! What an exploration found, for people and for programs.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use serde_json::json;

use crate::cli::args::Format;
use crate::cli::problem::Problem;
use tck_base::verdict::Verdict;
use tck_explore::{Exploration, Explored, Grammar, Shown, Source, family};
use tck_pack::Catalogue;
use tck_result::RunResult;

/// Where an exploration has left what it wrote.
#[derive(Clone, Copy)]
pub(super) struct Place<'a> {
    /// The folder of the last report.
    pub(super) report: Option<&'a Path>,
    /// The folder of the conversations that show the findings.
    pub(super) conversations: &'a Path,
    /// The folder of the conversations of the remarks.
    pub(super) remarks: &'a Path,
}

/// What may be said in which situation.
pub(super) fn stimuli(grammar: &Grammar) -> String {
    let mut text = String::new();
    for (situation, title) in &grammar.situations {
        let _ = writeln!(text, "{situation}: {title}");
        let here = |name: &&String| {
            let stimulus = grammar.stimuli.get(*name)?;
            stimulus.situations.contains(situation).then_some(stimulus)
        };
        for (name, stimulus) in grammar.heads().filter_map(|name| Some((name, here(&name)?))) {
            let title = stimulus.title.split(": ").next().unwrap_or_default();
            let many = grammar.stimuli.keys().filter(|other| family(other) == family(name));
            let many = match many.count() {
                1 => String::new(),
                many if stimulus.each.is_empty() => format!(" ({many} breakages)"),
                many => format!(" ({many} mixtures)"),
            };
            let _ = writeln!(text, "  {:<24} {title}{many}", family(name));
        }
        text.push('\n');
    }
    text
}

/// The outcome.
pub(super) fn explored(
    explored: &Explored,
    exploration: &Exploration,
    catalogue: &Catalogue,
    place: Place<'_>,
    format: Format,
) -> Result<String, Problem> {
    let findings = explored.findings.iter();
    if format == Format::Json {
        let all: Vec<_> = findings.map(|shown| finding(shown, place)).collect();
        let remarks: Vec<_> = explored.remarks.iter().map(|shown| finding(shown, place)).collect();
        let left_out = explored
            .left_out
            .iter()
            .map(|(name, why)| json!({ "stimulus": name, "why": why }));
        let value = json!({
            "format": "vda5050-tck.exploration/1",
            "seed": exploration.seed,
            "conversations": explored.conversations,
            "stimuli": explored.stimuli,
            "undecided": explored.undecided.0,
            "why": explored.undecided.1,
            "pairs": { "tried": explored.pairs.0, "of": explored.pairs.1 },
            "coverage": explored.coverage.table(),
            "leftOut": left_out.collect::<Vec<_>>(),
            "interrupted": explored.interrupted,
            "report": place.report.map(|folder| folder.display().to_string()),
            "findings": all,
            "remarks": remarks,
        });
        let text = serde_json::to_string_pretty(&value).map_err(|error| Problem::Environment(error.to_string()))?;
        return Ok(format!("{text}\n"));
    }
    let mut text = String::new();
    for shown in findings {
        let word = match shown.finding.verdict {
            Verdict::Fail => "FAIL",
            _ => "WARNING",
        };
        described(word, shown, catalogue, place, &mut text);
    }
    for shown in &explored.remarks {
        described("REMARK", shown, catalogue, place, &mut text);
    }
    if !explored.left_out.is_empty() {
        let what = match explored.left_out.len() {
            1 => "1 stimulus does not apply".to_owned(),
            count => format!("{count} stimuli do not apply"),
        };
        let _ = writeln!(text, "{what} to the device:");
        let mut reasons: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        for (name, why) in &explored.left_out {
            reasons.entry(why).or_default().push(name);
        }
        for (why, names) in reasons {
            let _ = writeln!(text, "  {why}\n    {}", names.join(", "));
        }
        text.push('\n');
    }
    let (tried, of) = explored.pairs;
    let _ = writeln!(
        text,
        "{} conversations of {} stimuli, seed {}; {tried} of {of} pairs of situation and stimulus tried",
        explored.conversations, explored.stimuli, exploration.seed
    );
    if let (0, Some(why)) = (explored.conversations, &explored.undecided.1) {
        let _ = writeln!(text, "no conversation was held: {why}");
    }
    if explored.undecided.0 > 0 {
        let why = explored.undecided.1.as_deref().unwrap_or("no reason was given");
        let _ = writeln!(
            text,
            "{} of them could not be carried to their end: {why}",
            explored.undecided.0
        );
    }
    if explored.interrupted {
        text.push_str("It was interrupted; what was found until then stands above.\n");
    }
    if let Some(folder) = place.report {
        let _ = writeln!(text, "report: {}", folder.join("report.html").display());
    }
    let count = explored.findings.len();
    let _ = writeln!(
        text,
        "{}",
        if count == 0 {
            "no finding".to_owned()
        } else {
            format!("findings: {count}")
        }
    );
    Ok(text)
}

/// One finding, in the words for people.
fn described(word: &str, shown: &Shown, catalogue: &Catalogue, place: Place<'_>, text: &mut String) {
    let one = &shown.finding;
    let asks = catalogue
        .get(&one.requirement)
        .map_or("", |requirement| requirement.text.as_str());
    let _ = writeln!(text, "{word} {}  {asks}", one.requirement);
    let _ = writeln!(text, "  seen     {}", one.message);
    let times = if one.count == 1 {
        "conversation"
    } else {
        "conversations"
    };
    let _ = writeln!(text, "  by       {}, in {} {times}", one.source, one.count);
    if !shown.others.is_empty() {
        let others: Vec<String> = shown.others.iter().map(|other| other.source.to_string()).collect();
        let _ = writeln!(text, "  and by   {}", others.join(", "));
    }
    let _ = writeln!(text, "  shortest {}", one.chain.stimuli().join(", "));
    match shown.shows {
        (_, 0) => text.push_str("  shows    the time was up before it could be seen again\n"),
        (times, of) if times < of => {
            let _ = writeln!(text, "  shows    in {times} of {of} attempts");
        }
        _ => {}
    }
    let again = again(std::env::args().skip(1), &path(shown, place));
    let _ = writeln!(text, "  again    vda5050-tck {again}\n");
}

fn path(shown: &Shown, place: Place<'_>) -> String {
    let id = &shown.file.id;
    let name = id.rsplit('/').next().unwrap_or(id);
    let folder = if shown.is_certain() {
        place.conversations
    } else {
        place.remarks
    };
    folder.join(format!("{name}.yaml")).display().to_string()
}

fn finding(shown: &Shown, place: Place<'_>) -> serde_json::Value {
    let one = &shown.finding;
    let (kind, name) = match &one.source {
        Source::Stimulus(name) => ("stimulus", name),
        Source::Monitor(name) => ("monitor", name),
    };
    json!({
        "requirement": one.requirement,
        "verdict": one.verdict,
        kind: name,
        "message": one.message,
        "conversations": one.count,
        "shortest": one.chain.stimuli(),
        "others": shown.others.iter().map(|other| other.source.to_string()).collect::<Vec<_>>(),
        "shows": { "times": shown.shows.0, "of": shown.shows.1 },
        "file": path(shown, place),
    })
}

/// What says how long an exploration is and what it says, each with a value; a conversation that is carried out again has that.
const OF_EXPLORATION: [&str; 7] = [
    "--budget",
    "--conversations",
    "--focus",
    "--length",
    "--replay",
    "--shard",
    "--shrink-budget",
];

/// The arguments with which one conversation is carried out again: on the same device, with the same suites.
fn again(arguments: impl Iterator<Item = String>, file: &str) -> String {
    let mut kept = Vec::new();
    let mut is_value = false;
    for argument in arguments {
        if std::mem::take(&mut is_value) {
            continue;
        }
        let (name, value) = argument.split_once('=').unzip();
        if OF_EXPLORATION.contains(&name.unwrap_or(&argument)) {
            is_value = value.is_none();
            continue;
        }
        kept.push(quoted(&argument));
    }
    kept.push("--replay".to_owned());
    kept.push(quoted(file));
    kept.join(" ")
}

/// An argument as a shell takes it.
fn quoted(argument: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./:=,@%+".contains(c);
    if !argument.is_empty() && argument.chars().all(is_plain) {
        return argument.to_owned();
    }
    format!("'{}'", argument.replace('\'', "'\\''"))
}

/// What became of conversations that were carried out again.
pub(super) fn replayed(result: &RunResult) -> String {
    let mut text = String::new();
    for test in &result.tests {
        let verdict = test
            .verdict
            .map_or_else(|| "not applicable".to_owned(), |verdict| verdict.to_string());
        let _ = writeln!(text, "{}: {verdict}", test.id);
        if let Some(why) = test.not_applicable.as_ref().or(test.reason.as_ref()) {
            let _ = writeln!(text, "  {why}");
        }
        for decision in test.findings() {
            let _ = writeln!(
                text,
                "  {} {}: {}",
                decision.requirement,
                decision.verdict(),
                decision.message
            );
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_printed_can_be_pasted() {
        let given = [
            "explore",
            "--virtual",
            "--suites",
            "my own",
            "--conversations",
            "40",
            "--focus=blink",
            "--shard",
            "2/4",
            "--fault",
            "x",
        ];
        assert_eq!(
            again(given.map(str::to_owned).into_iter(), "reports/a/it's.yaml"),
            "explore --virtual --suites 'my own' --fault x --replay 'reports/a/it'\\''s.yaml'"
        );
    }
}
