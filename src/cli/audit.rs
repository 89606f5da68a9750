//! `audit`: judge what was recorded.

use indicatif::{ProgressBar, ProgressStyle};

use super::args::Audit as Arguments;
use super::exit::Exit;
use super::problem::Problem;
use super::recordings::{broken, in_time, open, redacted, redactor, show};
use tck_audit::export::Export;
use tck_audit::pool::{self, WorkerPool};
use tck_audit::result::{Recording, VehicleResult};
use tck_audit::{AuditError, Options, bundle, own_run};
use tck_base::diagnostic::Diagnostic;
use tck_base::shard::ChosenShard;
use tck_capture::merge::Merged;
use tck_capture::{CaptureError, Item, Message, Told};
use tck_journal::Record;
use tck_journal::event::{Event, ShardRecord};
use tck_judge::Library;
use tck_profile::Surroundings;

/// `audit`.
pub fn audit(arguments: &Arguments) -> Result<Exit, Problem> {
    // Each finding of a file that grows is told at once, by one process; and a slice is about one finding.
    let part = match arguments.follow || arguments.slice.is_some() {
        true => None,
        false => super::shard::chosen(arguments.shard, &Surroundings::of_process())?,
    };
    let library = crate::assets::library(arguments.suites.own())?;
    let options = Options {
        topic_template: arguments.topic_template.clone(),
        vehicles: arguments.vehicle.clone(),
        only: arguments.only.clone(),
        protocol: arguments.protocol.clone(),
        shard: part.as_ref().map(|part| part.shard),
        cut: arguments.cut,
    };
    if arguments.follow {
        return super::follow::follow(arguments, &library, options);
    }
    let baseline = arguments.baseline.as_deref().map(super::baseline::read).transpose()?;
    let not_written = |error: std::io::Error| Problem::Environment(format!("cannot write the tables: {error}"));
    let mut runs = Vec::new();
    let mut export = match &arguments.export {
        Some(folder) => Some(Export::begin(folder, &library.rules.packs).map_err(not_written)?),
        None => None,
    };
    let mut result = pool::judged::<Problem>(&library.rules, &options, |crew| {
        read(arguments, &library, &options, crew, &mut runs, |crew, message| {
            if let (Some(export), Some(address)) = (&mut export, crew.address(&message.topic)) {
                let written = export.message(crew.messages() + 1, message, &address);
                written.map_err(not_written)?;
            }
            Ok(())
        })
    })?;
    result.vehicles.extend(runs);
    result.shard = part.map(|part| shared(&part, arguments, &library));
    result.conclude();
    let against = baseline.map(|baseline| baseline.hold(&result)).transpose()?;
    if let Some(export) = export {
        export.finish(&result).map_err(not_written)?;
    }
    if let Some(folder) = &arguments.out {
        let written = bundle::write(&result, &library.rules, folder);
        let root = written.map_err(|error| Problem::Environment(error.to_string()))?;
        super::tell(&format!(
            "the bundle in {} has the root hash sha256:{root}",
            folder.display()
        ));
    }
    if let Some(wanted) = &arguments.slice {
        return super::slice::slice(arguments, &library, &options, &result, wanted);
    }
    match against {
        Some(against) => super::baseline::show(&result, &against, arguments.format),
        None => show(&result, arguments.format),
    }
}

/// Reads all recordings. The journals of runs are judged by themselves, the rest is shown to `passing` and handed out.
fn read(
    arguments: &Arguments,
    library: &Library,
    options: &Options,
    crew: &mut WorkerPool<'_>,
    runs: &mut Vec<VehicleResult>,
    mut passing: impl FnMut(&WorkerPool<'_>, &Message) -> Result<(), Problem>,
) -> Result<Vec<Recording>, Problem> {
    let mut names = Vec::new();
    let mut units = Vec::new();
    let mut recordings = Vec::new();
    let mut of_runs = Vec::new();
    for (number, path) in arguments.captures.iter().enumerate() {
        let name = path.display().to_string();
        names.push(name.clone());
        let mut recorded = open(path, number, arguments)?;
        units.push(recorded.unit());
        match recorded.read().map_err(|source| unreadable(&name, source))? {
            Some(Item::Record(first)) if is_run(&first) && arguments.redact => {
                let text = format!("{name} is the journal of a run, and only recordings are redacted");
                return Err(usage(text));
            }
            Some(Item::Record(first)) if is_of_another_part(&first, options) => {
                while recorded.read().map_err(|source| unreadable(&name, source))?.is_some() {}
                of_runs.push((number, recorded.counted()));
            }
            Some(Item::Record(first)) if is_run(&first) => {
                let found = own_run(&library.rules, options, number, *first, &mut recorded)
                    .map_err(|error| usage(format!("{name}: {error}")))?;
                runs.push(found);
                of_runs.push((number, recorded.counted()));
            }
            first => recordings.push((number, name, recorded.again(first))),
        }
    }
    let numbers: Vec<usize> = recordings.iter().map(|(number, ..)| *number).collect();
    let all = recordings.into_iter().map(|(_, name, recorded)| (name, recorded));
    let mut merged = Merged::new(all.collect()).map_err(broken)?;
    let bounded = arguments.from.is_some() || arguments.to.is_some();
    let progress = Counting::begin();
    let mut redactor = redactor(arguments, library, options)?;
    while let Some(told) = merged.read().map_err(broken)? {
        if let (true, None, Told::Message(message)) = (bounded, told.at(), &told) {
            let place = format!("{}:{}", names[message.place.file], message.place.line);
            let text = format!("{place} does not say when the message came: it can be neither before nor after");
            return Err(usage(text));
        }
        if in_time(told.at(), arguments) {
            let Some(told) = redacted(told, &mut redactor) else {
                continue;
            };
            if let Told::Message(message) = &told {
                passing(crew, message)?;
            }
            crew.take(told);
        }
        progress.one();
    }
    let counted = numbers
        .into_iter()
        .zip(merged.counted().into_iter().map(|(_, counted)| counted));
    let mut counted: Vec<_> = counted.chain(of_runs).collect();
    counted.sort_by_key(|(number, _)| *number);
    let counted = counted
        .into_iter()
        .map(|(number, counted)| Recording::new(names[number].clone(), units[number], counted).hashed());
    Ok(counted.collect())
}

/// How far the reader is, for a person who waits.
struct Counting(ProgressBar);

impl Counting {
    fn begin() -> Self {
        let bar = if console::user_attended_stderr() {
            ProgressBar::new_spinner()
        } else {
            ProgressBar::hidden()
        };
        let style = ProgressStyle::with_template("{human_pos} messages, {per_sec}");
        Self(bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner())))
    }

    fn one(&self) {
        self.0.inc(1);
    }
}

impl Drop for Counting {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

fn usage(text: String) -> Problem {
    Diagnostic::whole("audit", text).into()
}

impl From<AuditError> for Problem {
    fn from(error: AuditError) -> Self {
        usage(error.to_string())
    }
}

/// Whether it is the first record of one of our own runs.
fn is_run(record: &Record) -> bool {
    matches!(&record.event, Event::RunBegun { header } if !header.role.is_empty())
}

/// Whether it is the first record of a run with a device that another part judges.
fn is_of_another_part(record: &Record, options: &Options) -> bool {
    match &record.event {
        Event::RunBegun { header } if is_run(record) => !options.does(&header.manufacturer, &header.serial_number),
        _ => false,
    }
}

/// What all parts of an audit share: the suites, and what is asked for. The recordings themselves are held against each other
/// by their hashes.
fn shared(part: &ChosenShard, arguments: &Arguments, library: &Library) -> ShardRecord {
    let asked = format!(
        "{:?}",
        (
            (&arguments.time, &arguments.topic, &arguments.payload),
            (arguments.from, arguments.to, arguments.redact),
            (&arguments.vehicle, &arguments.only),
            (&arguments.topic_template, &arguments.protocol, arguments.cut),
        )
    );
    let record = ShardRecord::of(part, part.shard.of, &[library.rules.sha256.as_str(), asked.as_str()]);
    // Which vehicles there are is known when everything was read.
    ShardRecord { whole: 0, ..record }
}

fn unreadable(name: &str, source: std::io::Error) -> Problem {
    broken(CaptureError {
        name: name.to_owned(),
        source,
    })
}
