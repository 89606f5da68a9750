//! Why a command could not do what it was asked, and which exit code that is.

use serde_json::{Value, json};

use tck_base::diagnostic::{Diagnostic, Span};

use super::exit::Exit;
use tck_journal::tool;
use tck_report::no_result::{NoResult, Obstacle};
use tck_run::SelectionError;

/// What went wrong, by who can put it right.
#[derive(Debug)]
pub enum Problem {
    /// The user: flags, profile, suite, capture.
    Usage(Vec<Diagnostic>),
    /// The selection: nothing is left to do.
    NothingToDo(String),
    /// The world: ports, broker, disk, device.
    Environment(String),
    /// The world, as a setting of the profile describes it: the port, the broker, the program of the device.
    Bench(Box<Diagnostic>),
}

impl Problem {
    /// The exit code.
    #[must_use]
    pub fn exit(&self) -> Exit {
        match self {
            Self::Usage(_) => Exit::Usage,
            Self::NothingToDo(_) => Exit::NothingToDo,
            Self::Environment(_) | Self::Bench(_) => Exit::Broken,
        }
    }

    /// The message for programs, in one line.
    #[must_use]
    pub fn to_json(&self) -> String {
        let (kind, problems) = match self {
            Self::Usage(all) => ("usage", all.iter().map(shown).collect()),
            Self::NothingToDo(why) => ("nothing-to-do", vec![json!({ "title": why })]),
            Self::Environment(why) => ("environment", vec![json!({ "title": why })]),
            Self::Bench(one) => ("environment", vec![shown(one)]),
        };
        let problems: Vec<Value> = problems;
        json!({ "error": { "kind": kind, "exit": self.exit().code(), "problems": problems } }).to_string()
    }

    /// What a pipeline is told, when nothing came of the command.
    #[must_use]
    pub fn no_result(&self, profile: Option<String>) -> NoResult {
        let of = |one: &Diagnostic| Obstacle {
            title: one.title.clone(),
            text: one.render(false),
            place: one.span.as_ref().map(|span| (span.source.name.clone(), span.line())),
        };
        let said = |why: &str| Obstacle {
            title: why.to_owned(),
            text: why.to_owned(),
            place: None,
        };
        NoResult {
            tool: tool(),
            exit: self.exit().code(),
            meaning: self.exit().meaning().to_owned(),
            profile,
            problems: match self {
                Self::Usage(all) => all.iter().map(of).collect(),
                Self::NothingToDo(why) | Self::Environment(why) => vec![said(why)],
                Self::Bench(one) => vec![of(one)],
            },
        }
    }

    /// The message for standard error.
    #[must_use]
    pub fn render(&self, color: bool) -> String {
        match self {
            Self::Usage(all) => {
                let shown: Vec<String> = all.iter().take(20).map(|one| one.render(color)).collect();
                let mut text = shown.join("\n\n");
                if all.len() > 20 {
                    text.push_str(&format!("\n\n… and {} more", all.len() - 20));
                }
                text
            }
            Self::Bench(one) => one.render(color),
            Self::NothingToDo(text) | Self::Environment(text) => format!("error: {}", crate::ui::escaped(text)),
        }
    }
}

/// A diagnostic for programs.
fn shown(one: &Diagnostic) -> Value {
    json!({ "code": one.code, "title": one.title, "label": one.label, "hint": one.hint,
        "place": one.span.as_ref().map(Span::place) })
}

impl From<Vec<Diagnostic>> for Problem {
    fn from(all: Vec<Diagnostic>) -> Self {
        Self::Usage(all)
    }
}

impl From<SelectionError> for Problem {
    fn from(error: SelectionError) -> Self {
        match error {
            SelectionError::Wrong(wrong) => (*wrong).into(),
            SelectionError::Nothing(why) => Self::NothingToDo(why),
        }
    }
}

impl From<Diagnostic> for Problem {
    fn from(one: Diagnostic) -> Self {
        Self::Usage(vec![one])
    }
}
