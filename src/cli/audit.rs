//! `audit`: judge what was recorded.

use std::path::Path;

use super::args::{Audit as Arguments, Format};
use super::exit::Exit;
use super::problem::Problem;
use crate::audit::result::{Recording, verdict_of};
use crate::audit::{Audit, Options, own_run, page};
use crate::capture::merge::Merged;
use crate::capture::{CaptureError, Item, Lines, Mapping, input};
use crate::diagnostic::Diagnostic;
use crate::journal::Record;
use crate::journal::event::Event;
use crate::run::Library;

/// `audit`.
pub fn audit(arguments: &Arguments) -> Result<Exit, Problem> {
    let library = Library::load(arguments.suites.own())?;
    let options = Options {
        topic_template: arguments.topic_template.clone(),
        vehicles: arguments.vehicle.clone(),
        only: arguments.only.clone(),
    };
    let usage = |text: String| Problem::from(Diagnostic::whole("audit", text));
    let mut audit = Audit::new(&library.rules, options.clone()).map_err(|error| usage(error.to_string()))?;
    let mut runs = Vec::new();
    let mut names = Vec::new();
    let mut recordings = Vec::new();
    let mut of_runs = Vec::new();
    for (number, path) in arguments.captures.iter().enumerate() {
        let name = path.display().to_string();
        names.push(name.clone());
        let mut lines = open(path, number, arguments)?;
        match lines.read().map_err(|source| unreadable(&name, source))? {
            Some(Item::Record(first)) if is_run(&first) => {
                let found = own_run(&library.rules, &options, number, *first, &mut lines)
                    .map_err(|error| usage(format!("{name}: {error}")))?;
                runs.push(found);
                of_runs.push((number, lines.counted()));
            }
            first => recordings.push((number, name, lines.again(first))),
        }
    }
    let numbers: Vec<usize> = recordings.iter().map(|(number, ..)| *number).collect();
    let all = recordings.into_iter().map(|(_, name, lines)| (name, lines));
    let mut merged = Merged::new(all.collect()).map_err(broken)?;
    let bounded = arguments.from.is_some() || arguments.to.is_some();
    while let Some(message) = merged.read().map_err(broken)? {
        let Some(at) = message.at else {
            if bounded {
                let place = format!("{}:{}", names[message.place.file], message.place.line);
                let text = format!("{place} does not say when the message came: it can be neither before nor after");
                return Err(usage(text));
            }
            audit.observe(message);
            continue;
        };
        if arguments.from.is_none_or(|from| at >= from) && arguments.to.is_none_or(|to| at <= to) {
            audit.observe(message);
        }
    }
    let counted = numbers
        .into_iter()
        .zip(merged.counted().into_iter().map(|(_, counted)| counted));
    let mut counted: Vec<_> = counted.chain(of_runs).collect();
    counted.sort_by_key(|(number, _)| *number);
    let counted = counted.into_iter().map(|(number, counted)| Recording {
        name: names[number].clone(),
        lines: counted.lines,
        skipped: counted.skipped,
    });
    let mut result = audit.finish(counted.collect());
    result.vehicles.extend(runs);
    result.verdict = verdict_of(&result.vehicles);
    match arguments.format {
        Format::Text => super::print(&page::page(&result))?,
        Format::Json => {
            let text =
                serde_json::to_string_pretty(&result).map_err(|error| Problem::Environment(error.to_string()))?;
            super::print(&format!("{text}\n"))?
        }
    };
    Ok(match result.verdict {
        None if !result.vehicles.is_empty() => Exit::Undecided,
        verdict => Exit::of(verdict),
    })
}

fn open(path: &Path, number: usize, arguments: &Arguments) -> Result<Lines, Problem> {
    let mapping = Mapping {
        time: arguments.time.clone(),
        topic: arguments.topic.clone(),
        payload: arguments.payload.clone(),
    };
    Ok(Lines::new(input::open(path).map_err(broken)?, number, mapping))
}

/// Whether it is the first record of one of our own runs.
fn is_run(record: &Record) -> bool {
    matches!(&record.event, Event::RunBegun { header } if !header.role.is_empty())
}

fn unreadable(name: &str, source: std::io::Error) -> Problem {
    broken(CaptureError {
        name: name.to_owned(),
        source,
    })
}

fn broken(error: CaptureError) -> Problem {
    Diagnostic::whole("unreadable", error.to_string()).into()
}
