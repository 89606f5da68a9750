//! `audit --baseline`: an audit held against an earlier one.

use std::path::Path;

use serde_json::Value;

use super::args::Format;
use super::exit::Exit;
use super::problem::Problem;
use tck_audit::baseline::{Against, hold};
use tck_audit::result::AuditResult;
use tck_audit::{page, saved};
use tck_base::diagnostic::Diagnostic;
use tck_report::manifest::{Manifest, NAME as MANIFEST};

/// The result of an earlier audit.
pub(super) struct Baseline {
    name: String,
    result: AuditResult,
    /// What there is to say about its bundle.
    note: Option<String>,
}

/// Reads the bundle of an audit, or its result. A bundle that was changed could hide what is new.
pub(super) fn read(path: &Path) -> Result<Baseline, Problem> {
    let name = path.display().to_string();
    let refuse = |title: String, hint: &str| Problem::from(Diagnostic::whole("baseline", title).hint(hint));
    let hint = "a baseline is what `audit --out DIR` has written, or the result.json in it";
    if !path.exists() {
        return Err(refuse(format!("the baseline {name} is not there"), hint));
    }
    let mut note = None;
    if path.is_dir() && path.join(MANIFEST).is_file() {
        let found = Manifest::verify(path).map_err(|error| refuse(error.to_string(), hint))?;
        if !found.holds() {
            let title = format!(
                "the baseline {name} is not what its manifest says\n{}",
                found.text().trim_end()
            );
            return Err(refuse(
                title,
                "a baseline that was changed could hide what is new: make it again",
            ));
        }
    } else {
        note = Some("nothing shows that the baseline is what it was: it has no manifest".to_owned());
    }
    if !saved::is_audit(path) {
        return Err(refuse(format!("{name} is no result of an audit"), hint));
    }
    let result = saved::read(path).map_err(|error| refuse(error.to_string(), hint))?;
    Ok(Baseline { name, result, note })
}

impl Baseline {
    /// Holds an audit against it.
    pub(super) fn hold(self, result: &AuditResult) -> Result<Against, Problem> {
        let mut against = hold(result, &self.result, &self.name).map_err(|error| {
            let hint = "give the baseline of these vehicles, or make one: `audit RECORDING --out DIR`";
            Problem::from(Diagnostic::whole("baseline", error.to_string()).hint(hint))
        })?;
        against.notes.extend(self.note);
        Ok(against)
    }
}

/// Prints the audit and what is new in it. The verdict stays as it is; only the exit code is about what is new.
pub(super) fn show(result: &AuditResult, against: &Against, format: Format) -> Result<Exit, Problem> {
    let broken = |error: serde_json::Error| Problem::Environment(error.to_string());
    match format {
        Format::Text => super::print(&format!("{}\n{}", page::page(result), against.text()))?,
        Format::Json => {
            let mut value = serde_json::to_value(result).map_err(broken)?;
            if let Value::Object(members) = &mut value {
                members.insert("against".to_owned(), serde_json::to_value(against).map_err(broken)?);
            }
            super::print(&format!("{value:#}\n"))?
        }
    };
    Ok(match against.rest {
        None if !result.vehicles.is_empty() => Exit::Undecided,
        rest => Exit::of(rest),
    })
}
