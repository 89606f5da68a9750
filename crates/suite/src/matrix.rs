//! `cases: { matrix: … }`: the rows of a table, a cell for each situation and each thing that comes to it.
//!
//! An axis is a table of its own; a cell has the values of one row of each axis, and under the name of the axis the
//! name of that row. A run draws cells evenly over the rows of the first axis.

use std::collections::BTreeSet;

use super::fields::{Fields, Problems, short, text_of};
use super::model::{Drawn, Kind as Origin};
use tck_base::diagnostic::Span;
use tck_base::yaml::{Kind, Node};

/// What makes a table one of these.
pub(super) const MATRIX: &str = "matrix";

const KEYS: &[&str] = &[MATRIX, "without", "draw"];

/// How many cells a run takes unless said.
const USUAL_DRAW: u32 = 4;

/// The most cells a run can take.
const MOST: u32 = 1_000;

/// Rows of one table: name to values.
pub(super) type Rows<'a> = Vec<(&'a str, &'a [(Node, Node)])>;

/// One cell.
pub(super) struct Cell {
    /// Its name: those of its rows, with a dot between them.
    pub(super) name: String,
    /// Its values.
    pub(super) values: Vec<(Node, Node)>,
    /// What it is.
    pub(super) drawn: Drawn,
}

/// The cells of a matrix; none if something is wrong with it. `rows` reads a table.
pub(super) fn cells(
    cases: &Node,
    rows: impl for<'n> Fn(&'n Node, &mut Problems) -> Rows<'n>,
    problems: &mut Problems,
) -> Vec<Cell> {
    let before = problems.len();
    let Some(fields) = Fields::of(cases, problems) else {
        return Vec::new();
    };
    fields.only(&[KEYS], problems);
    let draw = fields.whole_number("draw", MOST, problems).unwrap_or(USUAL_DRAW).max(1) as usize;
    let Some(axes) = fields.get(MATRIX, problems).and_then(|node| Fields::of(node, problems)) else {
        return Vec::new();
    };
    let mut cells = vec![(Vec::new(), Vec::new())];
    for (axis, table) in axes.entries() {
        let table = rows(table, problems);
        cells = cells
            .into_iter()
            .flat_map(|(names, values)| {
                table
                    .iter()
                    .map(move |(name, row)| with_row(&names, &values, axis, name, row))
            })
            .collect();
    }
    if let Some(((names, values), true)) = cells.first().map(|first| (first, problems.len() == before)) {
        if names.is_empty() {
            problems.at(
                "empty-cases",
                &cases.span,
                "a table without rows",
                "no test comes out of it",
            );
        }
        twice(values, problems);
    }
    let mut without = left_out(&fields, problems);
    let mut found = Vec::new();
    for (names, values) in cells {
        let name = names.join(".");
        let known = without.len();
        without.retain(|(other, _)| *other != name);
        if without.len() == known {
            let column = names.first().cloned().unwrap_or_default();
            let drawn = Drawn {
                kind: Origin::Column(column),
                draw,
            };
            found.push(Cell { name, values, drawn });
        }
    }
    for (name, at) in &without {
        let title = format!("no cell is called `{}`", short(name));
        problems.at("unknown-case", at, title, "a row of each axis, with a dot between them");
    }
    if problems.len() > before { Vec::new() } else { found }
}

/// A cell that has one more row.
fn with_row(
    names: &[String],
    values: &[(Node, Node)],
    axis: &Node,
    name: &str,
    row: &[(Node, Node)],
) -> (Vec<String>, Vec<(Node, Node)>) {
    let named = Node {
        kind: Kind::Text {
            value: name.to_owned(),
            quoted: true,
        },
        span: axis.span.clone(),
    };
    let names = names.iter().cloned().chain([name.to_owned()]).collect();
    let own = row.iter().cloned().chain([(axis.clone(), named)]);
    (names, values.iter().cloned().chain(own).collect())
}

/// Two axes have a value of one name.
fn twice(values: &[(Node, Node)], problems: &mut Problems) {
    let mut seen = BTreeSet::new();
    for (key, _) in values {
        let name = key.text().unwrap_or_default();
        if !seen.insert(name) {
            let title = format!("the case value `{}` for a second time", short(name));
            problems.at("duplicate-key", &key.span, title, "another axis has it already");
        }
    }
}

/// The names of the cells that make no sense.
fn left_out<'a>(fields: &Fields<'a>, problems: &mut Problems) -> Vec<(&'a str, &'a Span)> {
    let nodes = fields.list("without", problems);
    let texts = nodes
        .iter()
        .filter_map(|node| Some((text_of(node, problems)?, &node.span)));
    texts.collect()
}
