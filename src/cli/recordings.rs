//! What the commands about recordings share: opening them, the time that is asked for, what is left out of them, and the result.

use std::path::Path;

use super::args::{Audit as Arguments, Format};
use super::exit::Exit;
use super::problem::Problem;
use tck_audit::page;
use tck_audit::result::AuditResult;
use tck_audit::{Options, Redactor};
use tck_base::diagnostic::Diagnostic;
use tck_capture::{CaptureError, Mapping, Message, Recorded, Told};
use tck_judge::Library;

/// Prints the result.
pub(super) fn show(result: &AuditResult, format: Format) -> Result<Exit, Problem> {
    match format {
        Format::Text => super::print(&page::page(result))?,
        Format::Json => {
            let text = serde_json::to_string_pretty(result).map_err(|error| Problem::Environment(error.to_string()))?;
            super::print(&format!("{text}\n"))?
        }
    };
    Ok(match result.verdict {
        None if !result.vehicles.is_empty() => Exit::Undecided,
        verdict => Exit::of(verdict),
    })
}

/// Opens the recording of that number.
pub(super) fn open(path: &Path, number: usize, arguments: &Arguments) -> Result<Recorded, Problem> {
    Recorded::open(path, number, mapping(arguments)).map_err(broken)
}

/// Which members hold what.
pub(super) fn mapping(arguments: &Arguments) -> Mapping {
    Mapping {
        time: arguments.time.clone(),
        topic: arguments.topic.clone(),
        payload: arguments.payload.clone(),
    }
}

/// Whether a message came in the time that is asked for.
pub(super) fn in_time(at: Option<jiff::Timestamp>, arguments: &Arguments) -> bool {
    at.is_none_or(|at| arguments.from.is_none_or(|from| at >= from) && arguments.to.is_none_or(|to| at <= to))
}

/// What leaves out names and places, where that is asked for.
pub(super) fn redactor(
    arguments: &Arguments,
    library: &Library,
    options: &Options,
) -> Result<Option<Redactor>, Problem> {
    let redactor = arguments.redact.then(|| Redactor::new(&library.rules, options));
    Ok(redactor.transpose()?)
}

/// What is left of what is told: of a connection nothing, where names are left out.
pub(super) fn redacted(told: Told, redactor: &mut Option<Redactor>) -> Option<Told> {
    match (told, redactor) {
        (told, None) => Some(told),
        (Told::Message(message), Some(redactor)) => {
            let message = redactor.message(Message {
                carried: None,
                ..message
            });
            Some(Told::Message(message))
        }
        (Told::Wire(_), Some(_)) => None,
    }
}

/// A recording cannot be read.
pub(super) fn broken(error: CaptureError) -> Problem {
    Diagnostic::whole("unreadable", error.to_string()).into()
}
