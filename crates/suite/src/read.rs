//! One file into tests: header keys, which monitors have as well, and the rows of a table.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::CheckInfo;
use super::conversation::conversation;
use super::course::course_need;
use super::expand::Fill;
use super::fields::{Fields, Problems};
use super::grammar::need;
use super::lint::{self, HeaderPlaces, Vocabulary};
use super::matrix;
use super::metadata::{maturity, tags};
use super::model::{CourseNeed, Drawn, Need, Test};
use super::schema_cases;
use super::source::{States, parse};
use super::steps::{StepReader, version_range};
use tck_base::diagnostic::{Diagnostic, Source, Span};
use tck_base::yaml::{Kind, Node};
use tck_pack::{Role, VersionRange};

const TEST_KEYS: &[&str] = &[
    "test",
    "title",
    "device",
    "spec",
    "needs",
    "moves",
    "reviewed",
    "watchlist",
    "tags",
    "conversation",
    "begins",
    "why",
    "cases",
    "given",
    "steps",
    "finally",
];
const ROLES: [(&str, Role); 2] = [("agv", Role::Agv), ("master-control", Role::MasterControl)];

/// The first line of a file: where what is missing is shown.
pub(super) fn start(root: &Node) -> Span {
    match root.map().and_then(<[(Node, Node)]>::first) {
        Some((key, _)) => key.span.clone(),
        None => root.span.clone(),
    }
}

/// Checks the name of a file against its path.
pub(super) fn named(fields: &Fields<'_>, key: &str, name: &str, at: &Span, problems: &mut Problems) {
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
pub(super) struct Header {
    pub(super) title: String,
    pub(super) device: Option<Role>,
    pub(super) spec: Option<VersionRange>,
    pub(super) needs: Vec<(Need, Span)>,
    pub(super) why: String,
}

pub(super) fn header(fields: &Fields<'_>, at: &Span, problems: &mut Problems) -> Header {
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
pub(super) fn read_test(
    source: &Arc<Source>,
    place: Option<(&str, Option<Role>)>,
    states: &States,
    vocabulary: &dyn Vocabulary,
    known: &[CheckInfo],
    lint: bool,
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
        lint,
        before,
    };
    let nothing: &[(Node, Node)] = &[];
    let Some(cases) = fields.get("cases", problems) else {
        let root = Fill::new("case", nothing).apply_to(&root, problems);
        let root = Fill::new("with", nothing).apply_to(&root, problems);
        return reader.read(&root, Case::Whole, problems).into_iter().collect();
    };
    if cases.get(schema_cases::FROM_SCHEMA).is_some() {
        return reader.draw(&fields, &root, cases, problems);
    }
    let before_rows = problems.len();
    let cells = match cases.get(matrix::MATRIX) {
        Some(_) => matrix::cells(cases, rows, problems),
        None => Vec::new(),
    };
    let rows = match cases.get(matrix::MATRIX) {
        Some(_) => Vec::new(),
        None => rows(cases, problems),
    };
    if problems.len() > before_rows {
        return Vec::new();
    }
    let written = rows.iter().map(|(name, values)| (Case::Row(name), *values));
    let crossed = cells.iter().map(|cell| (Case::cell(cell), &cell.values[..]));
    let without_cases = without_cases(&fields, &root);
    let has_with = Fill::new("with", nothing).is_in(source);
    let mut used: BTreeMap<&str, (bool, &Span)> = BTreeMap::new();
    let mut tests = Vec::new();
    for (case, values) in written.chain(crossed) {
        let mut fill = Fill::new("case", values);
        let mut filled = fill.apply(&without_cases, problems);
        if has_with {
            filled = Fill::new("with", nothing).apply(&filled, problems);
        }
        for ((key, value), is_used) in values.iter().zip(&fill.used) {
            // The name of a row need not be used; it has the place of its axis.
            used.entry(key.text().unwrap_or_default())
                .or_insert((false, &key.span))
                .0 |= *is_used || key.span == value.span;
        }
        tests.extend(reader.read(&filled, case, problems));
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

/// A test without its table.
fn without_cases(fields: &Fields<'_>, root: &Node) -> Node {
    let others = fields.entries().iter().filter(|(key, _)| key.text() != Some("cases"));
    Node {
        kind: Kind::Map(others.cloned().collect()),
        span: root.span.clone(),
    }
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
    /// Whether the tests of this file are linted.
    lint: bool,
    /// How many problems there were before this file.
    before: usize,
}

/// Which test of a file is read.
enum Case<'a> {
    /// The only one.
    Whole,
    /// A row of its table.
    Row(&'a str),
    /// One of many of which a run takes some.
    Drawn {
        name: &'a str,
        /// The versions that have it; those of the test unless said.
        spec: Option<&'a VersionRange>,
        drawn: &'a Drawn,
        /// Whether it is linted.
        lint: bool,
    },
}

impl<'a> Case<'a> {
    fn cell(cell: &'a matrix::Cell) -> Self {
        Self::Drawn {
            name: &cell.name,
            spec: None,
            drawn: &cell.drawn,
            lint: true,
        }
    }
}

impl TestReader<'_> {
    /// The tests of a table that comes from a schema.
    fn draw(&self, fields: &Fields<'_>, root: &Node, cases: &Node, problems: &mut Problems) -> Vec<Test> {
        let spec = fields.get("spec", &mut Problems::default());
        let rows = schema_cases::rows(cases, spec, self.vocabulary, problems);
        if !fields
            .entries()
            .iter()
            .any(|(_, value)| value.span.text().contains("${case.patch}"))
            && !rows.is_empty()
        {
            problems.at(
                "unused-value",
                &cases.span,
                "the cases of the schema are not used",
                "no `${case.patch}` in this test",
            );
        }
        let without_cases = without_cases(fields, root);
        let has_with = Fill::new("with", &[]).is_in(self.source);
        let mut tests = Vec::new();
        let mut linted = BTreeSet::new();
        for row in &rows {
            let mut filled = Fill::new("case", &row.values).apply(&without_cases, problems);
            if has_with {
                filled = Fill::new("with", &[]).apply(&filled, problems);
            }
            // The rows differ in what they break, which only the first of each way and length can do wrong.
            let length = row
                .values
                .first()
                .and_then(|(_, patch)| patch.list())
                .map_or(0, <[Node]>::len);
            let lint = linted.insert((row.drawn.kind.clone(), length, row.spec.is_some()));
            let case = Case::Drawn {
                name: &row.name,
                spec: row.spec.as_ref(),
                drawn: &row.drawn,
                lint,
            };
            tests.extend(self.read(&filled, case, problems));
        }
        tests
    }

    fn read(&self, root: &Node, case: Case<'_>, problems: &mut Problems) -> Option<Test> {
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
        let maturity = maturity(&fields, problems);
        let tags = tags(&fields, problems);
        let moves = fields.flag("moves", problems);
        let mut reader = StepReader {
            states: self.states,
            inside: Vec::new(),
            purpose: None,
            is_plain: false,
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
        let conversation = conversation(&fields, steps.len(), problems);
        let begins = fields.text("begins", problems).map(str::to_owned);
        let id = fields.text("test", &mut Problems::default())?.to_owned();
        let group = id.split('/').next().unwrap_or_default().to_owned();
        let (needs, need_places): (Vec<_>, Vec<_>) = header.needs.into_iter().unzip();
        let (name, drawn, lint): (_, Option<Drawn>, _) = match case {
            Case::Whole => (None, None, true),
            Case::Row(name) => (Some(name), None, true),
            Case::Drawn { name, drawn, lint, .. } => (Some(name), Some(drawn.clone()), lint),
        };
        let mut test = Test {
            id: name.map_or_else(|| id.clone(), |name| format!("{id}[{name}]")),
            group,
            title: header.title,
            device: header.device.or(self.role)?,
            spec: match case {
                Case::Drawn { spec: Some(spec), .. } => spec.clone(),
                _ => header.spec?,
            },
            needs,
            moves,
            tags,
            conversation,
            begins,
            maturity,
            why: header.why,
            given,
            steps,
            finally,
            source: Arc::clone(self.source),
            course: CourseNeed::default(),
            drawn,
        };
        test.course = course_need(&test);
        if !lint || !self.lint {
            return Some(test);
        }
        let value_place = |key: &str| fields.get(key, &mut Problems::default()).map(|node| node.span.clone());
        let places = HeaderPlaces {
            hides: Vec::new(),
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
