//! Messages of `validate`: one or many in a file, each judged by itself.

use std::io::BufRead;
use std::path::Path;

use bytes::Bytes;
use serde_json::{Value, json};

use super::args::{Format, Validate};
use super::message_stream::{Content, Form, Pieces};
use super::problem::Problem;
use tck_audit::{Flaw, Hint, Hints, single};
use tck_base::diagnostic::{Diagnostic, closest};
use tck_base::verdict::Verdict;
use tck_journal::event::PAYLOAD_LIMIT;
use tck_journal::json::{JsonProblem, Parsed};
use tck_journal::place;
use tck_judge::Library;
use tck_pack::{Pack, VersionClaim};
use tck_report::clean::{line, short};

/// What was counted in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counted {
    /// Messages in all.
    pub messages: usize,
    /// Those with at least one violation.
    pub wrong: usize,
    /// Those with nothing worse than a warning.
    pub warned: usize,
}

/// By what messages are judged.
pub struct Judging<'a> {
    /// What was asked for.
    pub arguments: &'a Validate,
    /// The rules.
    pub library: &'a Library,
    /// Names to compare those in messages with.
    pub hints: Hints,
}

/// How the messages of a file stand in it, as its beginning shows; `None` when it holds one message, or something else.
pub fn form(path: &Path, beginning: &[u8]) -> Option<Form> {
    let extension = path.extension().and_then(|extension| extension.to_str());
    if matches!(extension, Some("jsonl" | "ndjson")) {
        return Some(Form::Lines);
    }
    let text = beginning.trim_ascii_start();
    if let Some(rest) = text.strip_prefix(b"[") {
        // A table of TOML begins with a bracket, too.
        return rest.trim_ascii_start().starts_with(b"{").then_some(Form::Array);
    }
    // One message may stand on several lines, but then its first line is not whole.
    let mut lines = text
        .split(|byte| *byte == b'\n')
        .filter(|line| !line.trim_ascii().is_empty());
    let is_whole =
        |line: &[u8]| line.starts_with(b"{") && serde_json::from_slice::<serde::de::IgnoredAny>(line).is_ok();
    (lines.next().is_some_and(is_whole) && lines.next().is_some()).then_some(Form::Lines)
}

/// Checks every message of a file.
pub fn batch(name: &str, input: impl BufRead, form: Form, judging: &Judging<'_>) -> Result<Counted, Problem> {
    let format = judging.arguments.format;
    let mut counted = Counted::default();
    let mut pieces = Pieces::new(input, form);
    let unreadable = |error| Diagnostic::whole("unreadable", format!("cannot read {name}: {error}"));
    while let Some(piece) = pieces.next().map_err(unreadable)? {
        counted.messages += 1;
        let begin = Begin {
            line: piece.line,
            column: piece.column,
        };
        let found = match piece.content {
            Content::Message(bytes) => message(&bytes, begin, judging),
            Content::TooLarge(length) => too_large(length, begin),
            Content::Broken(why) => {
                counted.messages -= 1;
                let hint = "every element of the array before this place was judged";
                Checked::refused(begin, why.to_owned(), Some(hint.to_owned()))
            }
        };
        counted.add(&found.flaws);
        found.show(name, Some(counted.messages), format)?;
        if found.is_recorded {
            // What holds for one line of a recording holds for all of them.
            break;
        }
    }
    Ok(counted)
}

/// Checks a file that holds one message.
pub fn alone(name: &str, bytes: &[u8], judging: &Judging<'_>) -> Result<(Counted, String), Problem> {
    let mut counted = Counted {
        messages: 1,
        ..Counted::default()
    };
    let begin = Begin { line: 1, column: 1 };
    let found = if bytes.len() > PAYLOAD_LIMIT {
        too_large(bytes.len() as u64, begin)
    } else {
        message(bytes, begin, judging)
    };
    counted.add(&found.flaws);
    found.show(name, None, judging.arguments.format)?;
    Ok((counted, found.what))
}

impl Counted {
    fn add(&mut self, flaws: &[Placed]) {
        match flaws.iter().map(|placed| placed.flaw.verdict).max() {
            Some(Verdict::Fail) => self.wrong += 1,
            Some(_) => self.warned += 1,
            None => {}
        }
    }
}

/// A flaw, and where it stands.
struct Placed {
    flaw: Flaw,
    pointer: Option<String>,
    line: usize,
    column: usize,
    sentence: Option<String>,
    nearest: Option<String>,
}

/// A message that was checked.
#[derive(Default)]
struct Checked {
    what: String,
    flaws: Vec<Placed>,
    hints: Vec<Noted>,
    /// Whether it is a line of a recording.
    is_recorded: bool,
}

/// What is allowed and looks like a slip, and where it stands.
struct Noted {
    hint: Hint,
    line: usize,
    column: usize,
}

/// Where a message begins in its file, counted from 1.
#[derive(Clone, Copy)]
struct Begin {
    line: usize,
    column: usize,
}

impl Begin {
    /// Where that byte of the message stands.
    fn at(self, text: &[u8], byte: usize) -> Self {
        match place::line_and_column(text, byte) {
            (1, column) => Self {
                line: self.line,
                column: self.column + column - 1,
            },
            (line, column) => Self {
                line: self.line + line - 1,
                column,
            },
        }
    }
}

impl Checked {
    /// A message that could not be judged, and what to do about it.
    fn refused(begin: Begin, title: String, hint: Option<String>) -> Self {
        Self {
            what: String::new(),
            flaws: vec![Placed {
                flaw: Flaw {
                    requirements: Vec::new(),
                    verdict: Verdict::Fail,
                    monitor: "validate".to_owned(),
                    text: title,
                    interpretation: None,
                },
                pointer: None,
                line: begin.line,
                column: begin.column,
                sentence: None,
                nearest: hint,
            }],
            ..Self::default()
        }
    }

    /// Prints what is wrong, and what looks like a slip.
    fn show(&self, name: &str, number: Option<usize>, format: Format) -> Result<(), Problem> {
        for flaw in &self.flaws {
            show(name, number, flaw, format)?;
        }
        for Noted { hint, line: at, column } in &self.hints {
            let text = match format {
                Format::Text => format!("{name}:{at}:{column}: HINT {}\n", short(&line(&hint.text), 300)),
                Format::Json => format!(
                    "{}\n",
                    json!({ "file": name, "message": number, "ok": true, "verdict": null, "code": "hint",
                        "title": hint.text, "line": at, "column": column, "pointer": hint.pointer })
                ),
            };
            super::print(&text)?;
        }
        Ok(())
    }
}

/// A message that is not judged, because it is larger than a run would keep it.
fn too_large(length: u64, begin: Begin) -> Checked {
    let hint = "a file may hold any number of messages, one a line or as elements of one array";
    Checked::refused(
        begin,
        format!("not judged: the message has {length} bytes, and {PAYLOAD_LIMIT} are the most that are judged"),
        Some(hint.to_owned()),
    )
}

fn message(text: &[u8], begin: Begin, judging: &Judging<'_>) -> Checked {
    let Judging {
        arguments,
        library,
        hints,
    } = judging;
    // A line ends with a line feed that is none of the message.
    let text = text.strip_suffix(b"\n").unwrap_or(text);
    let parsed = Parsed::of_bytes(text);
    if parsed.problems().contains(&JsonProblem::TooDeep) {
        return Checked::refused(begin, format!("not judged: {}", JsonProblem::TooDeep), None);
    }
    let value = parsed.value();
    let own = |title: String, nearest: Option<String>| Checked::refused(begin, title, nearest);
    let packs = &library.rules.packs;
    let said = value.and_then(|value| value.get("version")?.as_str());
    let wanted = arguments.protocol.as_deref().or(said);
    let pack = match wanted.map(|version| (version, packs.said(version))) {
        Some((_, VersionClaim::Known(pack))) => pack,
        None => packs.latest(),
        // What is no version is a mistake like others: the rest is judged.
        Some((version, VersionClaim::NoVersion)) if arguments.protocol.is_none() => packs.nearest(version, None),
        Some((version, _)) => {
            let known: Vec<String> = packs.all().iter().map(|pack| pack.version.to_string()).collect();
            let at = value
                .filter(|_| arguments.protocol.is_none())
                .and_then(|_| place::of(text, "/version"));
            return Checked::refused(
                begin.at(text, at.map_or(0, |range| range.start)),
                format!("version {version} is not known to this program ({})", known.join(", ")),
                Some("say with --protocol by which of them it is to be judged".to_owned()),
            );
        }
    };
    let topic = arguments.topic.as_deref().or_else(|| value.and_then(topic_of));
    let topic = match topic {
        Some(topic) => topic,
        // What is not JSON is wrong on every topic.
        None if value.is_none() => "state",
        None if value.is_some_and(|value| value.get("topic").is_some() && value.get("payload").is_some()) => {
            let hint = "judge recordings with `vda5050-tck audit`".to_owned();
            let refused = own("a message with its topic, as recorders write it".to_owned(), Some(hint));
            return Checked {
                is_recorded: true,
                ..refused
            };
        }
        None => {
            let title = value.and_then(|value| wrapped(pack, value));
            let hint = match &title {
                Some(_) => "a message has its members at its top level, beside headerId",
                None => "say which with --topic",
            };
            let title = title.unwrap_or_else(|| "JSON, but not a message that can be told by its members".to_owned());
            return own(title, Some(hint.to_owned()));
        }
    };
    if pack.topic(topic).is_none() {
        let diagnostic = unknown_topic(topic, pack);
        return own(diagnostic.title, diagnostic.hint);
    }
    let flaws = single(&library.rules, pack, topic, &Bytes::copy_from_slice(text));
    let placed = flaws.into_iter().map(|flaw| {
        let (pointer, at) = whereabouts(&flaw, topic, text, value);
        let Begin { line, column } = begin.at(text, at);
        let sentences = flaw.requirements.iter().rev();
        let mut sentences = sentences.filter_map(|id| library.rules.catalogue.edition(id, pack));
        let nearest = pointer
            .as_deref()
            .and_then(|pointer| nearest(pack, topic, pointer, value));
        Placed {
            sentence: sentences.next().map(|requirement| requirement.text.clone()),
            flaw,
            pointer,
            line,
            column,
            nearest,
        }
    });
    let noted = value
        .map(|value| hints.of_message(pack, topic, value))
        .unwrap_or_default();
    let noted = noted.into_iter().map(|hint| {
        let at = place::of(text, &hint.pointer).map_or(0, |range| range.start);
        let Begin { line, column } = begin.at(text, at);
        Noted { hint, line, column }
    });
    Checked {
        flaws: placed.collect(),
        hints: noted.collect(),
        is_recorded: false,
        what: format!("a valid {topic} message of VDA 5050 {}", pack.version),
    }
}

/// Which member a flaw is about, and at which byte it stands.
fn whereabouts(flaw: &Flaw, topic: &str, text: &[u8], value: Option<&Value>) -> (Option<String>, usize) {
    let Some(value) = value else {
        return (None, broken_at(text));
    };
    let is_meant = |pointer: &str| {
        let name = pointer.rsplit('/').next().unwrap_or_default();
        let problem = JsonProblem::DuplicateMember(name.to_owned());
        flaw.text.contains(&Value::from(problem.to_string()).to_string())
    };
    let mut repeated = place::repeated(text).into_iter();
    if let Some((pointer, name)) = repeated.find(|(pointer, _)| is_meant(pointer)) {
        return (Some(pointer), name.start);
    }
    let pointer = place::named(&flaw.text, topic, value).into_iter().next();
    let range = pointer.as_deref().and_then(|pointer| place::of(text, pointer));
    (pointer, range.map_or(0, |range| range.start))
}

/// Where a text ceases to be JSON in UTF-8.
fn broken_at(text: &[u8]) -> usize {
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    match std::str::from_utf8(text) {
        Err(error) => error.valid_up_to(),
        Ok(whole) => {
            let Err(error) = serde_json::from_str::<serde::de::IgnoredAny>(whole) else {
                return 0;
            };
            let before: usize = whole
                .split_inclusive('\n')
                .take(error.line().saturating_sub(1))
                .map(str::len)
                .sum();
            (before + error.column().saturating_sub(1)).min(text.len())
        }
    }
}

/// The allowed word that is closest to what stands there.
fn nearest(pack: &Pack, topic: &str, pointer: &str, value: Option<&Value>) -> Option<String> {
    let path: Vec<&str> = pointer
        .split('/')
        .skip(1)
        .filter(|part| part.parse::<usize>().is_err())
        .collect();
    let found = value?.pointer(pointer)?.as_str()?;
    let literals = pack.schema(topic)?.shape(&path)?.literals?;
    if literals.iter().any(|word| word == found) {
        return None;
    }
    let closest = closest(found, literals.iter().map(String::as_str))?;
    Some(format!("did you mean `{closest}`?"))
}

fn show(name: &str, number: Option<usize>, placed: &Placed, format: Format) -> Result<(), Problem> {
    let flaw = &placed.flaw;
    let text = match format {
        Format::Text => {
            let tag = if flaw.verdict == Verdict::Fail { "FAIL" } else { "WARN" };
            let mut text = format!(
                "{name}:{}:{}: {tag} {}\n",
                placed.line,
                placed.column,
                short(&line(&flaw.text), 300)
            );
            let requirements = flaw.requirements.join(", ");
            match (&placed.sentence, requirements.is_empty()) {
                (Some(sentence), false) => text.push_str(&format!("    {requirements}: {}\n", short(sentence, 300))),
                (None, false) => text.push_str(&format!("    {requirements}\n")),
                _ => {}
            }
            if let Some(nearest) = &placed.nearest {
                text.push_str(&format!("    {}\n", line(nearest)));
            }
            text
        }
        Format::Json => {
            let object = json!({
                "file": name, "message": number, "ok": flaw.verdict != Verdict::Fail, "verdict": flaw.verdict,
                "code": flaw.monitor, "title": flaw.text, "line": placed.line, "column": placed.column,
                "pointer": placed.pointer, "requirements": flaw.requirements, "sentence": placed.sentence,
                "interpretation": flaw.interpretation, "hint": placed.nearest,
            });
            format!("{object}\n")
        }
    };
    super::print(&text).map(|_| ())
}

/// The topic a message belongs to, by a member only it has.
pub fn topic_of(value: &Value) -> Option<&'static str> {
    let has = |name: &str| value.get(name).is_some();
    [
        ("nodeStates", "state"),
        ("nodes", "order"),
        ("actions", "instantActions"),
        ("instantActions", "instantActions"),
        ("connectionState", "connection"),
        ("typeSpecification", "factsheet"),
        ("operatingMode", "state"),
        ("zoneSet", "zoneSet"),
        ("responses", "responses"),
        ("agvPosition", "visualization"),
        ("mobileRobotPosition", "visualization"),
        ("referenceStateHeaderId", "visualization"),
        ("velocity", "visualization"),
    ]
    .into_iter()
    .find(|(member, _)| has(member))
    .map(|(_, topic)| topic)
}

/// The member of something that is no message in which one lies, and which one.
fn wrapped(pack: &Pack, value: &Value) -> Option<String> {
    let inside = |value: &Value| -> Option<Value> {
        match value {
            Value::Object(_) => Some(value.clone()),
            Value::Array(all) => all.first().filter(|first| first.is_object()).cloned(),
            Value::String(text) => serde_json::from_str(text).ok().filter(Value::is_object),
            _ => None,
        }
    };
    value.as_object()?.iter().find_map(|(name, value)| {
        let inner = inside(value)?;
        let by_name = pack.topic(name).map(|rule| rule.name.as_str());
        let topic = topic_of(&inner).or(by_name)?;
        let how = if value.is_string() { ", as a text" } else { "" };
        Some(format!(
            "the members of the {topic} lie inside `{}`{how}",
            short(&line(name), 60)
        ))
    })
}

fn unknown_topic(topic: &str, pack: &Pack) -> Diagnostic {
    let names: Vec<&str> = pack.topics().iter().map(|rule| rule.name.as_str()).collect();
    let diagnostic = Diagnostic::whole("unknown-topic", format!("there is no topic `{topic}`"));
    diagnostic.hint(tck_base::diagnostic::did_you_mean(topic, names.iter().copied()))
}
