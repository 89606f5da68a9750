//! What was said in conversations: a matrix of situations and stimuli, and a table of the members that were broken.

use std::collections::{BTreeMap, BTreeSet};

use tck_result::{Answers, ExplorationResult};

/// A matrix or table whose cells are counts of answers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Grid {
    /// The heads of the columns.
    pub columns: Vec<String>,
    /// The rows.
    pub rows: Vec<GridRow>,
}

/// One row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GridRow {
    /// Its head.
    pub head: String,
    /// One cell for each column.
    pub cells: Vec<Cell>,
}

/// What came of one pair.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cell {
    /// CSS class.
    pub class: &'static str,
    /// What is shown.
    pub text: String,
}

impl Cell {
    fn of(answers: Option<Answers>) -> Self {
        let Some(answers) = answers else {
            return Self {
                class: "none",
                text: String::new(),
            };
        };
        let tried = answers.tried();
        let (class, text) = match answers {
            Answers { broken: 1.., .. } => ("fail", format!("✕ {} of {tried}", answers.broken)),
            Answers { undecided: 1.., .. } => ("inconclusive", format!("? {} of {tried}", answers.undecided)),
            _ => ("pass", format!("✓ {tried}")),
        };
        Self { class, text }
    }
}

/// Stimuli by situations.
pub fn situations(result: &ExplorationResult) -> Grid {
    let cells = result.said.iter().map(|one| {
        let row = one.stimulus.as_str();
        ((row, one.situation.as_str()), one.answers)
    });
    grid(cells.collect(), str::to_owned)
}

/// Broken members by the way in which they were broken.
pub fn members(result: &ExplorationResult) -> Grid {
    let cells = result.members.iter().map(|one| {
        let row = (one.stimulus.as_str(), one.member.as_str());
        ((row, one.way.as_str()), one.answers)
    });
    grid(cells.collect(), |(stimulus, member)| format!("{member} ({stimulus})"))
}

fn grid<R: Ord + Copy>(cells: BTreeMap<(R, &str), Answers>, head: impl Fn(R) -> String) -> Grid {
    let columns: BTreeSet<&str> = cells.keys().map(|(_, column)| *column).collect();
    let rows: BTreeSet<R> = cells.keys().map(|(row, _)| *row).collect();
    let rows = rows.into_iter().map(|row| GridRow {
        head: head(row),
        cells: columns
            .iter()
            .map(|column| Cell::of(cells.get(&(row, *column)).copied()))
            .collect(),
    });
    Grid {
        rows: rows.collect(),
        columns: columns.into_iter().map(str::to_owned).collect(),
    }
}
