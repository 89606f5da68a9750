//! Which requirements of a version some test or monitor decides, and which none does.
//!
//! About the suites, not about a run: `list coverage` prints it. What a run decided stands in its result.

use std::fmt::Write as _;

use super::clean::line;
use super::sources::{HowDecided, RequirementText, Sources};
use tck_pack::Role;

/// Coverage of the requirements of one role.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Coverage {
    /// Chapters in catalogue order.
    pub chapters: Vec<Chapter>,
    /// Requirements nothing decides although something could, in catalogue order.
    pub uncovered: Vec<Uncovered>,
}

/// One chapter of the catalogue.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Chapter {
    /// Title.
    pub title: String,
    /// Decided by a test or monitor without help.
    pub decided: usize,
    /// Decided with the help of a person or a hook.
    pub operator: usize,
    /// Not testable, by the catalogue, and decided by nothing.
    pub not_testable: usize,
    /// Decided by nothing.
    pub uncovered: usize,
}

impl Chapter {
    /// Requirements of the chapter.
    #[must_use]
    pub fn total(&self) -> usize {
        self.decided + self.operator + self.not_testable + self.uncovered
    }
}

/// A requirement nothing decides.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Uncovered {
    /// Id.
    pub id: String,
    /// `shall`, `should` or `may`.
    pub mood: String,
    /// Our sentence.
    pub text: String,
}

/// How one requirement is covered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Covered {
    /// By a test or monitor without help.
    Decided,
    /// With the help of a person or a hook.
    Operator,
    /// Not testable.
    NotTestable,
    /// By nothing.
    Nothing,
}

/// How a requirement is covered by the tests and monitors of a role.
#[must_use]
pub fn covered(requirement: &RequirementText, sources: &Sources, role: Role) -> Covered {
    let by_monitor = sources
        .monitors
        .iter()
        .filter(|monitor| monitor.role.is_none_or(|other| other == role))
        .any(|monitor| monitor.requirements.contains(&requirement.id));
    let mut tests = sources
        .tests
        .iter()
        .filter(|test| test.role == role)
        .filter(|test| test.clauses.iter().any(|clause| clause.requirement == requirement.id))
        .peekable();
    if by_monitor {
        Covered::Decided
    } else if tests.peek().is_some() {
        if tests.all(|test| test.operator) {
            Covered::Operator
        } else {
            Covered::Decided
        }
    } else if matches!(requirement.decided, HowDecided::NotTestable(_)) {
        Covered::NotTestable
    } else {
        Covered::Nothing
    }
}

/// Whether a requirement concerns a role.
fn concerns(requirement: &RequirementText, role: Role) -> bool {
    requirement.role == role.word() || requirement.role == "both"
}

/// Coverage of the requirements of `role`.
#[must_use]
pub fn coverage(sources: &Sources, role: Role) -> Coverage {
    let mut all = Coverage::default();
    for requirement in sources
        .requirements
        .iter()
        .filter(|requirement| concerns(requirement, role))
    {
        let at = all
            .chapters
            .iter()
            .position(|chapter| chapter.title == requirement.chapter);
        let at = at.unwrap_or_else(|| {
            all.chapters.push(Chapter {
                title: requirement.chapter.clone(),
                ..Chapter::default()
            });
            all.chapters.len() - 1
        });
        let chapter = &mut all.chapters[at];
        match covered(requirement, sources, role) {
            Covered::Decided => chapter.decided += 1,
            Covered::Operator => chapter.operator += 1,
            Covered::NotTestable => chapter.not_testable += 1,
            Covered::Nothing => {
                chapter.uncovered += 1;
                all.uncovered.push(Uncovered {
                    id: requirement.id.clone(),
                    mood: requirement.mood.clone(),
                    text: requirement.text.clone(),
                });
            }
        }
    }
    all
}

impl Coverage {
    /// All chapters together.
    #[must_use]
    pub fn total(&self) -> Chapter {
        let mut total = Chapter {
            title: "total".to_owned(),
            ..Chapter::default()
        };
        for chapter in &self.chapters {
            total.decided += chapter.decided;
            total.operator += chapter.operator;
            total.not_testable += chapter.not_testable;
            total.uncovered += chapter.uncovered;
        }
        total
    }

    /// The table, and the list of what is not covered.
    #[must_use]
    pub fn text(&self) -> String {
        let total = self.total();
        let rows = self.chapters.iter().chain([&total]);
        let width = rows
            .clone()
            .map(|row| line(&row.title).chars().count())
            .max()
            .unwrap_or(0)
            .max(7);
        let mut text = format!(
            "{:<width$}  total  decided  operator  not testable  uncovered\n",
            "chapter"
        );
        let rule = "-".repeat(width + 50) + "\n";
        text.push_str(&rule);
        for (at, row) in rows.enumerate() {
            if at == self.chapters.len() {
                text.push_str(&rule);
            }
            let _ = writeln!(
                text,
                "{:<width$}  {:>5}  {:>7}  {:>8}  {:>12}  {:>9}",
                line(&row.title),
                row.total(),
                dot(row.decided),
                dot(row.operator),
                dot(row.not_testable),
                dot(row.uncovered),
            );
        }
        if self.uncovered.is_empty() {
            text.push_str("\nEvery testable requirement is decided by a test or a monitor.\n");
            return text;
        }
        text.push_str("\nDecided by nothing\n");
        text + &self.uncovered_text()
    }

    /// What nothing decides, one line each; nothing when there is nothing.
    #[must_use]
    pub fn uncovered_text(&self) -> String {
        let mut text = String::new();
        let width = self
            .uncovered
            .iter()
            .map(|entry| line(&entry.id).chars().count())
            .max()
            .unwrap_or(0);
        for Uncovered {
            id,
            mood,
            text: sentence,
        } in &self.uncovered
        {
            let _ = writeln!(text, "  {:<width$}  {:<6}  {}", line(id), line(mood), line(sentence));
        }
        text
    }
}

/// A nought as a dot, so that gaps are what one sees.
fn dot(count: usize) -> String {
    if count == 0 { "·".to_owned() } else { count.to_string() }
}
