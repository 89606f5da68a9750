//! A chain as the text of an ordinary test, which `validate` accepts and `run` carries out.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use super::broken::family;
use super::grammar::{Grammar, Stimulus};
use super::model::Model;

/// A conversation as an ordinary test.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConversationFile {
    /// The id of the test.
    pub id: String,
    /// The text of the file.
    pub text: String,
    /// The last line of each stimulus, counted from one.
    ends: Vec<u32>,
    /// Where the body begins.
    first: u32,
}

impl ConversationFile {
    fn new(id: String, text: String, first: u32, ends: Vec<u32>) -> Self {
        Self { id, text, ends, first }
    }

    /// A conversation that was written before; `None` when the text does not begin with the id of a test.
    #[must_use]
    pub fn read(text: String) -> Option<Self> {
        let id = text
            .lines()
            .find_map(|line| line.strip_prefix("test:"))?
            .trim()
            .to_owned();
        Some(Self::new(id, text, 0, Vec::new()))
    }

    /// Has the conversation begin on this node.
    #[must_use]
    pub fn beginning_on(mut self, node: &str) -> Self {
        const HEAD: &str = "\ngiven:\n";
        // What the device says of itself goes into no test as it is.
        let is_plain = |one: char| !one.is_control() && one != '"' && one != '\\';
        if let Some(at) = self.text.find(HEAD).filter(|_| node.chars().all(is_plain)) {
            self.text.insert_str(at, &format!("begins: \"{node}\"\n"));
            self.first += 1;
            for end in &mut self.ends {
                *end += 1;
            }
        }
        self
    }

    /// Where it stands as a test of a side.
    #[must_use]
    pub fn place(&self, side: &str) -> String {
        format!("suites/{side}/{}.yaml", self.id)
    }

    /// Which stimulus a line belongs to, counted from zero.
    #[must_use]
    pub fn stimulus_at(&self, line: u32) -> Option<usize> {
        if line < self.first {
            return None;
        }
        // What is judged of a conversation as a whole is known at its last stimulus.
        let last = self.ends.len().checked_sub(1);
        self.ends.iter().position(|end| line <= *end).or(last)
    }
}

/// The text, and which line belongs to which stimulus.
pub(super) fn file(stimuli: &[String], grammar: &Grammar, id: &str, why: &str) -> ConversationFile {
    let mut model = Model::begin(grammar);
    let mut needs: BTreeSet<&str> = BTreeSet::new();
    let mut specs: BTreeSet<&str> = BTreeSet::from([grammar.spec.as_str()]);
    let mut moves = false;
    let mut body = String::new();
    let mut said = String::new();
    let mut lengths = Vec::new();
    for name in stimuli {
        let Some(stimulus) = grammar.stimuli.get(name) else {
            continue;
        };
        needs.extend(stimulus.needs.iter().map(String::as_str));
        specs.extend(stimulus.spec.as_deref());
        let sent = filled(&stimulus.sends, grammar, &model, stimulus);
        let answer = answer(grammar, &model, stimulus);
        let heard = filled(&[stimulus.hears.as_str(), answer].concat(), grammar, &model, stimulus);
        moves |= sent.lines().chain(heard.lines()).any(drives);
        let _ = writeln!(body, "  # {}. {}: {}", model.number, name, stimulus.title);
        indented(&sent, &mut body);
        indented(&heard, &mut body);
        lengths.push(body.lines().count());
        let broken = stimulus.broken.as_ref().map_or_else(String::new, |broken| {
            format!(", member: \"{}\", way: \"{}\"", broken.member, broken.way)
        });
        let before = model.clone();
        let steps = steps(&sent) + steps(&heard);
        model.hear(stimulus, sent);
        let stays = if before.is_as(&model) { ", stays: true" } else { "" };
        let _ = writeln!(
            said,
            "  - {{ in: {}, say: {}{broken}, steps: {steps}{stays} }}",
            before.situation,
            family(name),
        );
    }
    let mut text = String::new();
    let _ = writeln!(text, "test: {id}");
    let _ = writeln!(text, "title: \"A conversation: {}\"", stimuli.join(", "));
    let _ = writeln!(text, "device: {}", grammar.side());
    let specs: Vec<&str> = specs.into_iter().collect();
    let _ = writeln!(text, "spec: \"{}\"", specs.join(", "));
    if !needs.is_empty() {
        let needs: Vec<String> = needs.iter().map(|need| format!("\"{need}\"")).collect();
        let _ = writeln!(text, "needs: [{}]", needs.join(", "));
    }
    if moves {
        text.push_str("moves: true\n");
    }
    let why: String = why
        .chars()
        .map(|one| if one.is_control() { ' ' } else { one })
        .collect();
    let _ = writeln!(text, "why: \"{}\"", why.replace(['"', '\\'], "'"));
    if !said.is_empty() {
        let _ = write!(text, "conversation:\n{said}");
    }
    text.push_str("\ngiven:\n");
    indented(&grammar.given, &mut text);
    text.push_str("\nsteps:\n");
    let first = lines(&text) + 1;
    let ends = lengths
        .iter()
        .map(|length| first - 1 + u32::try_from(*length).unwrap_or(u32::MAX - first))
        .collect();
    text.push_str(&body);
    indented(&grammar.closing, &mut text);
    text.push_str("\nfinally:\n");
    for ending in grammar
        .endings
        .iter()
        .filter(|ending| ending.with.is_subset(&model.facts))
    {
        indented(&ending.steps, &mut text);
    }
    ConversationFile::new(id.to_owned(), text, first, ends)
}

/// Whether a line of an order releases a way.
fn drives(line: &str) -> bool {
    let base = line.split_once("base: [").and_then(|(_, rest)| rest.split_once(']'));
    base.is_some_and(|(base, _)| base.contains(',') || base == "far")
}

/// How many steps a text has; a step begins where a line does.
fn steps(text: &str) -> usize {
    text.lines().filter(|line| line.starts_with("- ")).count()
}

fn lines(text: &str) -> u32 {
    u32::try_from(text.lines().count()).unwrap_or(u32::MAX)
}

/// The shared answer. Beside an older one that looks the same it is another one.
fn answer<'a>(grammar: &'a Grammar, model: &Model, stimulus: &'a Stimulus) -> &'a str {
    let beside = stimulus.sole.as_ref().is_some_and(|fact| model.facts.contains(fact));
    let name = if beside { stimulus.again.as_ref() } else { None };
    let name = name.or(stimulus.answer.as_ref());
    name.and_then(|name| grammar.answers.get(name))
        .map_or("", String::as_str)
}

/// Fills in what the stimulus gives, and then what the conversation has come to.
fn filled(text: &str, grammar: &Grammar, model: &Model, stimulus: &Stimulus) -> String {
    let given = replaced(text, "${with.", |name| stimulus.gives.get(name).cloned());
    replaced(&given, "${now.", |name| {
        let (name, by) = name.split_once('+').unwrap_or((name, "0"));
        model.value(grammar, name, by.parse().ok()?)
    })
}

/// Replaces what stands between `open` and the next brace. What is not known stays, and the test is refused.
fn replaced(text: &str, open: &str, value: impl Fn(&str) -> Option<String>) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find(open) {
        let (before, from) = rest.split_at(at);
        out.push_str(before);
        let inner = &from[open.len()..];
        match inner
            .split_once('}')
            .and_then(|(name, after)| Some((value(name)?, after)))
        {
            Some((value, after)) => {
                out.push_str(&value);
                rest = after;
            }
            None => {
                out.push_str(open);
                rest = inner;
            }
        }
    }
    out.push_str(rest);
    out
}

fn indented(text: &str, out: &mut String) {
    for line in text.lines().filter(|line| !line.trim().is_empty()) {
        let _ = writeln!(out, "  {line}");
    }
}
