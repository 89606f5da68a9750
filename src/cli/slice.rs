//! `audit --slice`: the smallest journal that still shows a finding.

use std::collections::VecDeque;

use super::args::Audit as Arguments;
use super::exit::Exit;
use super::problem::Problem;
use super::recordings::{broken, in_time, open, redacted, redactor};
use tck_audit::result::AuditResult;
use tck_audit::slice::{Target, origin, records, smallest, written};
use tck_audit::{Audit, Options};
use tck_base::diagnostic::Diagnostic;
use tck_capture::merge::Merged;
use tck_capture::{Message, Told};
use tck_judge::Library;
use tck_report::statement::{many, verb};

/// How many messages of the vehicle before a finding are searched for its cause.
const BEFORE: usize = 20_000;
/// How many behind it may be needed to be sure that nothing is missing.
const BEHIND: usize = 64;

/// Writes the journal to standard output.
pub fn slice(
    arguments: &Arguments,
    library: &Library,
    options: &Options,
    result: &AuditResult,
    wanted: &str,
) -> Result<Exit, Problem> {
    let refuse = |text: String| Problem::from(Diagnostic::whole("slice", text));
    if arguments.captures.iter().any(|path| path.as_os_str() == "-") {
        return Err(refuse(
            "a slice needs to read the recording twice, which standard input cannot be".to_owned(),
        ));
    }
    let Some(target) = Target::find(result, wanted) else {
        return Err(refuse(format!(
            "no finding is of a requirement or a monitor called `{wanted}`"
        )));
    };
    let messages: Vec<Message> = of_vehicle(arguments, library, options, &target)?.into();
    let found = smallest(&library.rules, options, &target, &messages);
    let found = found.map_err(|error| refuse(error.to_string()))?;
    let Some(found) = found else {
        let title = format!(
            "{} of {} cannot be shown by messages of the vehicle alone",
            target.requirement,
            target.vehicle()
        );
        let hint = "what is found of a connection is shown by its packets: cut that connection out of the capture, and hand that on";
        return Err(Diagnostic::whole("slice", title).hint(hint).into());
    };
    eprintln!(
        "{} of {} {} {} ({})",
        many(found.len(), "message"),
        target.vehicle(),
        verb(found.len(), "shows", "show"),
        target.requirement,
        target.monitor
    );
    let origin = origin(&target, &found, &result.recordings);
    for record in records(found, origin) {
        let line = serde_json::to_string(&record).map_err(|error| Problem::Environment(error.to_string()))?;
        super::print(&format!("{line}\n"))?;
    }
    Ok(Exit::of(Some(target.verdict)))
}

/// The messages of the vehicle up to the finding, and some behind it.
fn of_vehicle(
    arguments: &Arguments,
    library: &Library,
    options: &Options,
    target: &Target,
) -> Result<VecDeque<Message>, Problem> {
    let mut redactor = redactor(arguments, library, options)?;
    let options = Options {
        vehicles: vec![target.vehicle()],
        ..options.clone()
    };
    let names = Audit::new(&library.rules, options).map_err(|error| Diagnostic::whole("slice", error.to_string()))?;
    let mut recordings = Vec::new();
    for (number, path) in arguments.captures.iter().enumerate() {
        recordings.push((path.display().to_string(), open(path, number, arguments)?));
    }
    let mut merged = Merged::new(recordings).map_err(broken)?;
    let mut kept = VecDeque::new();
    let (mut number, mut behind) = (0, 0);
    while let Some(told) = merged.read().map_err(broken)? {
        if !in_time(told.at(), arguments) {
            continue;
        }
        // The same names as before, since the same messages come in the same order.
        let Some(Told::Message(message)) = redacted(told, &mut redactor) else {
            continue;
        };
        number += 1;
        if !names.concerns(&message.topic) {
            continue;
        }
        if kept.len() == BEFORE {
            kept.pop_front();
        }
        kept.push_back(written(message));
        behind += usize::from(number > target.message);
        if behind >= BEHIND {
            break;
        }
    }
    Ok(kept)
}
