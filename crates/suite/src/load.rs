//! Files into tests and monitors: which file is what, the states they share, and all mistakes in order.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::fields::{Fields, Problems};
use super::lint::{self, HeaderPlaces, Vocabulary};
use super::model::{CourseNeed, Maturity, Purpose, Test};
use super::read::{named, read_test, start};
use super::read_monitor::read_monitor;
use super::source::{State, States, parse};
use super::steps::StepReader;
use super::{CheckInfo, Suites, exceptions};
use tck_base::diagnostic::{Diagnostic, Source, Span};
use tck_base::yaml::Node;
use tck_pack::Role;

const STATE_KEYS: &[&str] = &["state", "title", "purpose", "steps"];

/// Reads one file and remembers its steps.
fn read_state(states: &mut States, name: &str, source: &Arc<Source>, problems: &mut Problems) {
    states.insert(name, None);
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
    let purpose = fields.word("purpose", "unknown-purpose", &Purpose::WORDS, problems);
    let steps = steps.clone();
    states.insert(name, Some(State { purpose, steps }));
}

/// Loads every file below `suites/`, given by path and text. What the linter says of a file that is checked is known:
/// nothing, so it is not asked.
pub(super) fn load<'a>(
    files: impl Iterator<Item = (&'a str, &'a str)>,
    vocabulary: &dyn Vocabulary,
    known: &[CheckInfo],
    is_checked: &dyn Fn(&str) -> bool,
) -> Result<Suites, Vec<Diagnostic>> {
    let mut problems = Problems::default();
    let mut states = States::default();
    let mut tests = Vec::new();
    let mut monitors = Vec::new();
    let mut exceptions = Vec::new();
    for (path, text) in files {
        let inner = path.strip_prefix("suites/").unwrap_or(path);
        let Some((folder, rest)) = inner.split_once('/') else {
            stray(path, &mut problems);
            continue;
        };
        if matches!(folder, "requirements" | "explore" | "hooks") || hidden_or_note(rest) {
            continue;
        }
        let source = Source::new(path, text);
        match (folder, rest.strip_suffix(".yaml")) {
            ("states", Some(name)) => read_state(&mut states, name, &source, &mut problems),
            ("agv", Some(name)) => tests.push((source, Some(Role::Agv), name.to_owned())),
            ("master-control", Some(name)) => tests.push((source, Some(Role::MasterControl), name.to_owned())),
            ("monitors", Some(name)) => monitors.push((source, name.to_owned())),
            ("qualification", Some("agv")) => exceptions.push((source, Role::Agv)),
            ("qualification", Some("master-control")) => exceptions.push((source, Role::MasterControl)),
            _ => stray(path, &mut problems),
        }
    }
    let mut suites = Suites::default();
    for (source, role, name) in &tests {
        let lint = !is_checked(&source.name);
        let read = read_test(
            source,
            Some((name, *role)),
            &states,
            vocabulary,
            known,
            lint,
            &mut problems,
        );
        suites.tests.extend(read.into_iter().map(Arc::new));
    }
    for (source, name) in &monitors {
        let lint = !is_checked(&source.name);
        let read = read_monitor(source, Some(name), vocabulary, known, lint, &mut problems);
        suites.monitors.extend(read.map(Arc::new));
    }
    for (source, role) in &exceptions {
        let read = exceptions::read(source, *role, vocabulary, &mut problems);
        suites.exceptions.unproven.extend(read.unproven);
        suites.exceptions.unfound.extend(read.unfound);
        suites.exceptions.forbidden.extend(read.forbidden);
    }
    suites.tests.sort_by(|left, right| left.id.cmp(&right.id));
    suites.monitors.sort_by(|left, right| left.id.cmp(&right.id));
    unique_names(&suites, &mut problems);
    let problems = problems.into_sorted();
    if problems.is_empty() { Ok(suites) } else { Err(problems) }
}

/// No name means two things. The rows of one table differ by their rows only, so a table is one of the things.
fn unique_names(suites: &Suites, problems: &mut Problems) {
    let mut taken: BTreeMap<&str, &Arc<Source>> = BTreeMap::new();
    let mut tables: BTreeMap<&str, &Arc<Source>> = BTreeMap::new();
    for test in &suites.tests {
        if let Some(first) = taken.insert(&test.id, &test.source) {
            taken_twice(
                "duplicate-test",
                format!("the test `{}` for a second time", test.id),
                &test.source,
                first,
                problems,
            );
        }
        let table = test.id.split_once('[').map_or(test.id.as_str(), |(table, _)| table);
        tables.insert(table, &test.source);
    }
    for pair in suites.monitors.windows(2).filter(|pair| pair[0].id == pair[1].id) {
        let title = format!("the monitor `{}` for a second time", pair[1].id);
        taken_twice("duplicate-monitor", title, &pair[1].source, &pair[0].source, problems);
    }
    for monitor in &suites.monitors {
        if let Some(test) = tables.get(monitor.id.as_str()) {
            let title = format!("the monitor `{}` is named as a test", monitor.id);
            taken_twice("monitor-named-as-test", title, &monitor.source, test, problems);
        }
    }
}

fn taken_twice(code: &'static str, title: String, second: &Arc<Source>, first: &Arc<Source>, problems: &mut Problems) {
    let line = Span::new(second, 0, second.text.find('\n').unwrap_or(second.text.len()));
    let label = format!("{} has the name already", first.name);
    problems.add(
        Diagnostic::new(code, line, title, label)
            .hint("give one of the two files another name; in reports it is all they are known by"),
    );
}

fn stray(path: &str, problems: &mut Problems) {
    problems.add(
        Diagnostic::whole("stray-file", format!("`{path}` is not a suite")).hint(
            "suites are .yaml files below agv/, master-control/, states/, monitors/, qualification/, requirements/, hooks/ or explore/",
        ),
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
            read_state(&mut states, name, &Source::new(path, text), &mut Problems::default());
        }
    }
    let source = Source::new(name, text);
    let mut suites = Suites::default();
    let first = parse(&source, &mut Problems::default());
    let is = |key: &str| first.as_ref().is_some_and(|root| root.get(key).is_some());
    if is("monitor") {
        let read = read_monitor(&source, None, vocabulary, known, true, &mut problems);
        suites.monitors.extend(read.map(Arc::new));
    } else if is("state") {
        let own = first
            .as_ref()
            .and_then(|root| root.get("state")?.text())
            .unwrap_or_default()
            .to_owned();
        read_state(&mut states, &own, &source, &mut problems);
        lint_state(&own, &source, &states, vocabulary, known, &mut problems);
    } else {
        let read = read_test(&source, None, &states, vocabulary, known, true, &mut problems);
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
    let Some(State { purpose, steps }) = states.get(name) else {
        return;
    };
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
        purpose: *purpose,
        is_plain: false,
        problems: &mut *problems,
    };
    let given = reader.steps(steps, "steps", None);
    let places = HeaderPlaces {
        hides: Vec::new(),
        start: steps.span.clone(),
        spec: None,
        moves: None,
        needs: Vec::new(),
        complete: false,
    };
    let mut test = Test {
        id: name.to_owned(),
        group: String::new(),
        title: String::new(),
        device: Role::MasterControl,
        spec,
        needs: Vec::new(),
        moves: true,
        tags: Vec::new(),
        conversation: Vec::new(),
        begins: None,
        maturity: Maturity::Open,
        why: String::new(),
        given,
        steps: Vec::new(),
        finally: Vec::new(),
        source: Arc::clone(source),
        course: CourseNeed::default(),
        drawn: None,
    };
    if problems.len() == before {
        // A state is meant for one side or for both.
        let mut for_master_control = Problems::default();
        lint::test(&test, &places, vocabulary, known, &mut for_master_control);
        if for_master_control.len() != 0 {
            test.device = Role::Agv;
            lint::test(&test, &places, vocabulary, known, problems);
        }
    }
}
