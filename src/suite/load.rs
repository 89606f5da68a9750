//! Files into tests and monitors: header keys, tables of cases, states, and the linter over all of it.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::course::course_need;
use super::expand::Fill;
use super::fields::{Fields, Problems, text_of};
use super::grammar::need;
use super::lint::{self, HeaderPlaces, Vocabulary};
use super::model::{Maturity, Monitor, Need, Rule, Test};
use super::steps::{StepReader, check_use, checks, version_range};
use super::terms::pattern;
use super::{CheckInfo, Suites};
use crate::diagnostic::{Diagnostic, Source, Span};
use crate::pack::{Role, VersionRange};
use crate::yaml::{self, Kind, Node};

const TEST_KEYS: &[&str] = &[
    "test", "title", "device", "spec", "needs", "moves", "maturity", "why", "cases", "given", "steps", "finally",
];
const MONITOR_KEYS: &[&str] = &[
    "monitor", "title", "device", "spec", "needs", "why", "checks", "check", "with", "topic", "always", "when", "never",
];
const STATE_KEYS: &[&str] = &["state", "title", "steps"];
const ROLES: [(&str, Role); 2] = [("agv", Role::Agv), ("master-control", Role::MasterControl)];

/// The states of `suites/states/`, by name. A state whose file is broken is known without its steps.
#[derive(Default)]
pub(super) struct States(BTreeMap<String, Option<Node>>);

impl States {
    pub(super) fn steps_of(&self, name: &str) -> Option<&Node> {
        self.0.get(name)?.as_ref()
    }

    pub(super) fn is_known(&self, name: &str) -> bool {
        self.0.contains_key(name)
    }

    pub(super) fn names(&self) -> Vec<&str> {
        self.0.keys().map(String::as_str).collect()
    }

    /// Reads one file and remembers its steps.
    fn read(&mut self, name: &str, source: &Arc<Source>, problems: &mut Problems) {
        self.0.insert(name.to_owned(), None);
        let Some(root) = parse(source, problems) else { return };
        let Some(fields) = Fields::of(&root, problems) else {
            return;
        };
        fields.only(&[STATE_KEYS], problems);
        let at = start(&root);
        named(&fields, "state", name, &at, problems);
        fields.need_text("title", &at, problems);
        let Some(steps) = fields.need("steps", &at, problems) else {
            return;
        };
        if steps.list().is_some_and(<[Node]>::is_empty) {
            problems.at("empty-steps", &steps.span, "a state without steps", "nothing to do");
        }
        self.0.insert(name.to_owned(), Some(steps.clone()));
    }
}

/// Loads every file below `suites/`, given by path and text.
pub(super) fn load<'a>(
    files: impl Iterator<Item = (&'a str, &'a str)>,
    vocabulary: &dyn Vocabulary,
    known: &[CheckInfo],
) -> Result<Suites, Vec<Diagnostic>> {
    let mut problems = Problems::default();
    let mut states = States::default();
    let mut tests = Vec::new();
    let mut monitors = Vec::new();
    for (path, text) in files {
        let inner = path.strip_prefix("suites/").unwrap_or(path);
        let Some((folder, rest)) = inner.split_once('/') else {
            stray(path, &mut problems);
            continue;
        };
        if folder == "requirements" || hidden_or_note(rest) {
            continue;
        }
        let source = Source::new(path, text);
        match (folder, rest.strip_suffix(".yaml")) {
            ("states", Some(name)) => states.read(name, &source, &mut problems),
            ("agv", Some(name)) => tests.push((source, Some(Role::Agv), name.to_owned())),
            ("master-control", Some(name)) => tests.push((source, Some(Role::MasterControl), name.to_owned())),
            ("monitors", Some(name)) => monitors.push((source, name.to_owned())),
            _ => stray(path, &mut problems),
        }
    }
    let mut suites = Suites::default();
    for (source, role, name) in &tests {
        let read = read_test(source, Some((name, *role)), &states, vocabulary, known, &mut problems);
        suites.tests.extend(read.into_iter().map(Arc::new));
    }
    for (source, name) in &monitors {
        let read = read_monitor(source, Some(name), vocabulary, known, &mut problems);
        suites.monitors.extend(read.map(Arc::new));
    }
    suites.tests.sort_by(|left, right| left.id.cmp(&right.id));
    suites.monitors.sort_by(|left, right| left.id.cmp(&right.id));
    for pair in suites.tests.windows(2) {
        if pair[0].id == pair[1].id {
            duplicate(&pair[1].id, &pair[1].source, &pair[0].source, &mut problems);
        }
    }
    let problems = problems.into_sorted();
    if problems.is_empty() { Ok(suites) } else { Err(problems) }
}

fn duplicate(id: &str, second: &Arc<Source>, first: &Arc<Source>, problems: &mut Problems) {
    problems.at(
        "duplicate-test",
        &Span::new(second, 0, second.text.find('\n').unwrap_or(0)),
        format!("the test `{id}` for a second time"),
        format!("{} has it already", first.name),
    );
}

fn stray(path: &str, problems: &mut Problems) {
    problems.add(
        Diagnostic::whole("stray-file", format!("`{path}` is not a suite"))
            .hint("suites are .yaml files below agv/, master-control/, states/, monitors/ or requirements/"),
    );
}

fn hidden_or_note(path: &str) -> bool {
    let name = path.rsplit('/').next().unwrap_or(path);
    name.starts_with('.')
        || std::path::Path::new(name)
            .extension()
            .is_some_and(|extension| extension == "md")
}

/// Loads the text of one test, state or monitor that need not lie where its name says.
pub(super) fn load_text<'a>(
    name: &str,
    text: &str,
    files: impl Iterator<Item = (&'a str, &'a str)>,
    vocabulary: &dyn Vocabulary,
    known: &[CheckInfo],
) -> Result<Suites, Vec<Diagnostic>> {
    let mut problems = Problems::default();
    let mut states = States::default();
    for (path, text) in files {
        let inner = path.strip_prefix("suites/").unwrap_or(path);
        if let Some(name) = inner
            .strip_prefix("states/")
            .and_then(|rest| rest.strip_suffix(".yaml"))
        {
            // The mistakes of other files are not those of this one.
            states.read(name, &Source::new(path, text), &mut Problems::default());
        }
    }
    let source = Source::new(name, text);
    let mut suites = Suites::default();
    let first = parse(&source, &mut Problems::default());
    let is = |key: &str| first.as_ref().is_some_and(|root| root.get(key).is_some());
    if is("monitor") {
        let read = read_monitor(&source, None, vocabulary, known, &mut problems);
        suites.monitors.extend(read.map(Arc::new));
    } else if is("state") {
        let own = first
            .as_ref()
            .and_then(|root| root.get("state")?.text())
            .unwrap_or_default()
            .to_owned();
        states.read(&own, &source, &mut problems);
        lint_state(&own, &source, &states, vocabulary, known, &mut problems);
    } else {
        let read = read_test(&source, None, &states, vocabulary, known, &mut problems);
        suites.tests.extend(read.into_iter().map(Arc::new));
    }
    let problems = problems.into_sorted();
    if problems.is_empty() { Ok(suites) } else { Err(problems) }
}

/// Lints a state as the preamble of a test of all versions. One that waits for values of its user cannot be linted
/// without them.
fn lint_state(
    name: &str,
    source: &Arc<Source>,
    states: &States,
    vocabulary: &dyn Vocabulary,
    known: &[CheckInfo],
    problems: &mut Problems,
) {
    let Some(steps) = states.steps_of(name) else { return };
    if source.text.contains("${with.") {
        return;
    }
    let Some(spec) = vocabulary
        .versions()
        .first()
        .and_then(|version| format!(">={version}").parse().ok())
    else {
        return;
    };
    let before = problems.len();
    let mut reader = StepReader {
        states,
        inside: vec![name.to_owned()],
        problems: &mut *problems,
    };
    let given = reader.steps(steps, "steps", None);
    let places = HeaderPlaces {
        start: steps.span.clone(),
        spec: None,
        moves: None,
        needs: Vec::new(),
        complete: false,
    };
    let test = Test {
        id: name.to_owned(),
        group: String::new(),
        title: String::new(),
        device: Role::Agv,
        spec,
        needs: Vec::new(),
        moves: true,
        maturity: Maturity::Watchlist,
        why: String::new(),
        given,
        steps: Vec::new(),
        finally: Vec::new(),
        source: Arc::clone(source),
        course: super::model::CourseNeed::default(),
    };
    if problems.len() == before {
        lint::test(&test, &places, vocabulary, known, problems);
    }
}

fn parse(source: &Arc<Source>, problems: &mut Problems) -> Option<Node> {
    match yaml::tree(source) {
        Ok(root) => Some(root),
        Err(found) => {
            for diagnostic in found {
                problems.add(unquoted_variable(&diagnostic).unwrap_or(diagnostic));
            }
            None
        }
    }
}

/// A syntax error that comes from `${…}` without quotes inside `{ }` or `[ ]`.
fn unquoted_variable(diagnostic: &Diagnostic) -> Option<Diagnostic> {
    let span = diagnostic.span.as_ref().filter(|_| diagnostic.code == "yaml-syntax")?;
    let text = &span.source.text;
    let line_start = text[..span.start].rfind('\n').map_or(0, |at| at + 1);
    let line_end = text[span.start..].find('\n').map_or(text.len(), |at| span.start + at);
    // The reader may notice only on the next line.
    let from = text[..line_start.saturating_sub(1)].rfind('\n').map_or(0, |at| at + 1);
    let mut quote = None;
    let mut found = None;
    for (at, c) in text[from..line_end].char_indices() {
        match (quote, c) {
            (None, '"' | '\'') => quote = Some(c),
            (Some(open), c) if open == c => quote = None,
            (None, '$') if text[from + at..].starts_with("${") => found = Some(from + at),
            (_, '\n') => quote = None,
            _ => {}
        }
    }
    let start = found?;
    let end = text[start..line_end].find('}').map_or(line_end, |at| start + at + 1);
    let span = Span::new(&span.source, start, end);
    Some(
        Diagnostic::new(
            "unquoted-variable",
            span.clone(),
            "a variable without quotes inside `{ }` or `[ ]`",
            "YAML reads these braces as its own",
        )
        .hint(format!("write \"{}\"", span.text())),
    )
}

/// The first line of a file: where what is missing is shown.
fn start(root: &Node) -> Span {
    match root.map().and_then(<[(Node, Node)]>::first) {
        Some((key, _)) => key.span.clone(),
        None => root.span.clone(),
    }
}

fn named(fields: &Fields<'_>, key: &str, name: &str, at: &Span, problems: &mut Problems) {
    let Some(text) = fields.need_text(key, at, problems) else {
        return;
    };
    if text != name
        && let Some(node) = fields.get(key, problems)
    {
        problems.add(
            Diagnostic::new(
                "wrong-name",
                node.span.clone(),
                format!("`{key}` is not the path of the file"),
                "named otherwise than its file",
            )
            .hint(format!("write `{key}: {name}`")),
        );
    }
}

/// What tests and monitors have in common.
struct Header {
    title: String,
    device: Option<Role>,
    spec: Option<VersionRange>,
    needs: Vec<(Need, Span)>,
    why: String,
}

fn header(fields: &Fields<'_>, at: &Span, problems: &mut Problems) -> Header {
    let owned = |text: Option<&str>| text.map(|text| text.trim().to_owned()).unwrap_or_default();
    Header {
        title: owned(fields.need_text("title", at, problems)),
        device: fields.word("device", "unknown-device", &ROLES, problems),
        spec: fields
            .need("spec", at, problems)
            .and_then(|node| version_range(node, problems)),
        needs: fields
            .list("needs", problems)
            .iter()
            .filter_map(|node| Some((need(node, problems)?, node.span.clone())))
            .collect(),
        why: owned(fields.need_text("why", at, problems)),
    }
}

/// The tests of one file: one, or one per row of its table. `place` is the name and role that its path asks for.
fn read_test(
    source: &Arc<Source>,
    place: Option<(&str, Option<Role>)>,
    states: &States,
    vocabulary: &dyn Vocabulary,
    known: &[CheckInfo],
    problems: &mut Problems,
) -> Vec<Test> {
    let before = problems.len();
    let Some(root) = parse(source, problems) else {
        return Vec::new();
    };
    let Some(fields) = Fields::of(&root, problems) else {
        return Vec::new();
    };
    fields.only(&[TEST_KEYS], problems);
    let at = start(&root);
    if let Some((name, _)) = place {
        named(&fields, "test", name, &at, problems);
    } else {
        fields.need_text("test", &at, problems);
    }
    let role = place.and_then(|(_, role)| role);
    let reader = TestReader {
        source,
        states,
        vocabulary,
        known,
        role,
        before,
    };
    let nothing: &[(Node, Node)] = &[];
    let Some(cases) = fields.get("cases", problems) else {
        let root = Fill::new("case", nothing).apply_to(&root, problems);
        let root = Fill::new("with", nothing).apply_to(&root, problems);
        return reader.read(&root, None, problems).into_iter().collect();
    };
    let before_rows = problems.len();
    let rows = rows(cases, problems);
    if problems.len() > before_rows {
        return Vec::new();
    }
    let without_cases = Node {
        kind: Kind::Map(
            fields
                .entries()
                .iter()
                .filter(|(key, _)| key.text() != Some("cases"))
                .cloned()
                .collect(),
        ),
        span: root.span.clone(),
    };
    let mut used: BTreeMap<&str, (bool, &Span)> = BTreeMap::new();
    let mut tests = Vec::new();
    for (name, values) in &rows {
        let mut fill = Fill::new("case", values);
        let filled = fill.apply(&without_cases, problems);
        let filled = Fill::new("with", nothing).apply_to(&filled, problems);
        for ((key, _), is_used) in values.iter().zip(&fill.used) {
            used.entry(key.text().unwrap_or_default())
                .or_insert((false, &key.span))
                .0 |= is_used;
        }
        tests.extend(reader.read(&filled, Some(name), problems));
    }
    for (name, (is_used, span)) in used {
        if !is_used {
            problems.at(
                "unused-value",
                span,
                format!("the case value `{name}` is not used"),
                format!("no `${{case.{name}}}` in this test"),
            );
        }
    }
    tests
}

/// The rows of a table of cases, each with the same names.
fn rows<'a>(cases: &'a Node, problems: &mut Problems) -> Vec<(&'a str, &'a [(Node, Node)])> {
    let Some(fields) = Fields::of(cases, problems) else {
        return Vec::new();
    };
    if fields.entries().is_empty() {
        problems.at(
            "empty-cases",
            &cases.span,
            "a table without rows",
            "no test comes out of it",
        );
    }
    let mut rows: Vec<(&str, &[(Node, Node)])> = Vec::new();
    for (key, row) in fields.entries() {
        let name = key.text().unwrap_or_default();
        if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c)) {
            problems.at(
                "bad-name",
                &key.span,
                format!("`{}` cannot be the name of a case", super::fields::short(name)),
                "letters, digits, `-`, `_` and `.`",
            );
        }
        let Some(values) = row.map() else {
            problems.wrong_type(row, "a mapping of values");
            continue;
        };
        rows.push((name, values));
    }
    let names: Vec<&str> = {
        let mut names = Vec::new();
        for (key, _) in rows.iter().flat_map(|(_, values)| *values) {
            let name = key.text().unwrap_or_default();
            if !names.contains(&name) {
                names.push(name);
            }
        }
        names
    };
    for (key, row) in fields.entries() {
        for name in &names {
            if row.map().is_some() && row.get(name).is_none() {
                problems.at(
                    "missing-case-value",
                    &key.span,
                    format!("this row has no value for `{name}`"),
                    "every row has the same names",
                );
            }
        }
    }
    rows
}

struct TestReader<'a> {
    source: &'a Arc<Source>,
    states: &'a States,
    vocabulary: &'a dyn Vocabulary,
    known: &'a [CheckInfo],
    role: Option<Role>,
    /// How many problems there were before this file.
    before: usize,
}

impl TestReader<'_> {
    fn read(&self, root: &Node, case: Option<&str>, problems: &mut Problems) -> Option<Test> {
        let fields = Fields::of(root, problems)?;
        let at = start(root);
        let header = header(&fields, &at, problems);
        fields.need("device", &at, problems);
        if let (Some(device), Some(role), Some(node)) = (header.device, self.role, fields.get("device", problems))
            && device != role
        {
            problems.at(
                "wrong-name",
                &node.span,
                format!("a test for `{device}` among those for `{role}`"),
                format!("the folder says `{role}`"),
            );
        }
        let maturities = [("watchlist", Maturity::Watchlist), ("reviewed", Maturity::Reviewed)];
        let maturity = fields
            .word("maturity", "unknown-word", &maturities, problems)
            .unwrap_or(Maturity::Watchlist);
        let moves = fields.flag("moves", problems);
        let mut reader = StepReader {
            states: self.states,
            inside: Vec::new(),
            problems: &mut *problems,
        };
        let mut section = |key: &str| match fields.get(key, reader.problems) {
            Some(node) => reader.steps(node, key, None),
            None => Vec::new(),
        };
        let (given, steps, finally) = (section("given"), section("steps"), section("finally"));
        if let Some(node) = fields.need("steps", &at, problems)
            && node.list().is_some_and(<[Node]>::is_empty)
        {
            problems.at("empty-steps", &node.span, "a test without steps", "decides nothing");
        }
        let id = fields.text("test", &mut Problems::default())?.to_owned();
        let group = id.split('/').next().unwrap_or_default().to_owned();
        let (needs, need_places): (Vec<_>, Vec<_>) = header.needs.into_iter().unzip();
        let mut test = Test {
            id: case.map_or_else(|| id.clone(), |case| format!("{id}[{case}]")),
            group,
            title: header.title,
            device: header.device.or(self.role)?,
            spec: header.spec?,
            needs,
            moves,
            maturity,
            why: header.why,
            given,
            steps,
            finally,
            source: Arc::clone(self.source),
            course: super::model::CourseNeed::default(),
        };
        test.course = course_need(&test);
        let value_place = |key: &str| fields.get(key, &mut Problems::default()).map(|node| node.span.clone());
        let places = HeaderPlaces {
            start: at,
            spec: value_place("spec"),
            moves: value_place("moves"),
            needs: need_places,
            complete: problems.len() == self.before,
        };
        lint::test(&test, &places, self.vocabulary, self.known, problems);
        Some(test)
    }
}

fn read_monitor(
    source: &Arc<Source>,
    name: Option<&str>,
    vocabulary: &dyn Vocabulary,
    known: &[CheckInfo],
    problems: &mut Problems,
) -> Option<Monitor> {
    let root = parse(source, problems)?;
    let fields = Fields::of(&root, problems)?;
    fields.only(&[MONITOR_KEYS], problems);
    let at = start(&root);
    if let Some(name) = name {
        named(&fields, "monitor", name, &at, problems);
    }
    let id = fields.need_text("monitor", &at, problems).map(str::to_owned);
    let header = header(&fields, &at, problems);
    let bindings = checks(&fields, problems);
    if fields.need("checks", &at, problems).is_some() && bindings.is_empty() {
        problems.at(
            "decides-nothing",
            &at,
            "a monitor that decides nothing",
            "`checks` is empty",
        );
    }
    let rule = rule(&fields, &at, problems);
    let (needs, need_places): (Vec<_>, Vec<_>) = header.needs.into_iter().unzip();
    let monitor = Monitor {
        id: id?,
        title: header.title,
        device: header.device,
        spec: header.spec?,
        needs,
        checks: bindings,
        why: header.why,
        rule: rule?,
        source: Arc::clone(source),
    };
    let places = HeaderPlaces {
        spec: fields
            .get("spec", &mut Problems::default())
            .map(|node| node.span.clone()),
        start: at,
        moves: None,
        needs: need_places,
        complete: true,
    };
    let topic_place = fields
        .get("topic", &mut Problems::default())
        .map(|node| node.span.clone());
    lint::monitor(&monitor, &places, topic_place.as_ref(), vocabulary, known, problems);
    Some(monitor)
}

fn rule(fields: &Fields<'_>, at: &Span, problems: &mut Problems) -> Option<Rule> {
    let written: Vec<&str> = ["check", "always", "never"]
        .into_iter()
        .filter(|key| fields.has(key))
        .collect();
    if written.len() != 1 {
        problems.at(
            "monitor-rule",
            at,
            "a monitor has one rule",
            "needs one of `check:`, `always:` and `never:`",
        );
        return None;
    }
    let unneeded: &[&str] = match written[0] {
        "check" => &["topic", "when"],
        "always" => &["with"],
        _ => &["with", "when"],
    };
    for key in unneeded {
        if let Some(name) = fields.key(key) {
            problems.at(
                "conflicting-keys",
                &name.span,
                format!("`{key}` beside `{}`", written[0]),
                "has no meaning here",
            );
        }
    }
    if written[0] == "check" {
        return check_use(fields, problems).map(Rule::Check);
    }
    let topic = text_of(fields.need("topic", at, problems)?, problems)?.to_owned();
    let picture = pattern(fields.get(written[0], problems)?, problems);
    if written[0] == "never" {
        return Some(Rule::Never {
            topic,
            pattern: picture?,
        });
    }
    let when = match fields.get("when", problems) {
        Some(node) => Some(pattern(node, problems)?),
        None => None,
    };
    Some(Rule::Always {
        topic,
        when,
        pattern: picture?,
    })
}
