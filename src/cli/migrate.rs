//! `migrate`: what one device has to change to speak a later version.

use std::path::{Path, PathBuf};

use super::args::{Format, HistoryKind, Migrate as Arguments};
use super::exit::Exit;
use super::problem::Problem;
use super::recordings::broken;
use tck_audit::migrate::{MigrateError, MigrateOptions, Migrating, Migration, markdown, page, text};
use tck_audit::result::Recording;
use tck_base::diagnostic::Diagnostic;
use tck_capture::merge::Merged;
use tck_capture::{CaptureError, Item, Mapping, Recorded, Told};
use tck_journal::event::Event;
use tck_journal::file;
use tck_pack::Role;
use tck_run::write_whole;

/// `migrate`.
pub fn migrate(arguments: &Arguments) -> Result<Exit, Problem> {
    let library = crate::assets::library(arguments.suites.own())?;
    let opened = open(arguments)?;
    let of_run = opened.iter().find_map(|recording| recording.role);
    let options = MigrateOptions {
        to: arguments.to.clone(),
        protocol: arguments.protocol.clone(),
        role: arguments.role.or(of_run).unwrap_or(Role::Agv),
        vehicles: arguments.vehicle.clone(),
        topic_template: arguments.topic_template.clone(),
    };
    let mut migrating = Migrating::new(&library, options).map_err(problem)?;
    let units: Vec<&str> = opened.iter().map(|recording| recording.unit).collect();
    let all = opened.into_iter().map(|recording| (recording.name, recording.recorded));
    let mut merged = Merged::new(all.collect()).map_err(broken)?;
    while let Some(told) = merged.read().map_err(broken)? {
        if let Told::Message(message) = told {
            migrating.take(message);
        }
    }
    let counted = merged.counted().into_iter().zip(units);
    let recordings = counted.map(|((name, counted), unit)| Recording::new(name, unit, counted).hashed());
    let migration = migrating.finish(recordings.collect()).map_err(problem)?;
    show(&migration, arguments)?;
    Ok(Exit::Conforms)
}

/// A recording that is open.
struct Opened {
    name: String,
    unit: &'static str,
    /// Which side the device is, where it is the journal of a run.
    role: Option<Role>,
    recorded: Recorded,
}

fn open(arguments: &Arguments) -> Result<Vec<Opened>, Problem> {
    let mapping = Mapping {
        time: arguments.time.clone(),
        topic: arguments.topic.clone(),
        payload: arguments.payload.clone(),
    };
    let open = |(number, path): (usize, &PathBuf)| {
        let path = journal(path)?;
        let name = path.display().to_string();
        let mut recorded = Recorded::open(&path, number, mapping.clone()).map_err(broken)?;
        let unreadable = |source| {
            broken(CaptureError {
                name: name.clone(),
                source,
            })
        };
        let first = recorded.read().map_err(unreadable)?;
        Ok(Opened {
            unit: recorded.unit(),
            role: first.as_ref().and_then(role),
            recorded: recorded.again(first),
            name,
        })
    };
    arguments.recordings.iter().enumerate().map(open).collect()
}

/// The recording itself, or the journal in a bundle.
fn journal(path: &Path) -> Result<PathBuf, Problem> {
    if !path.is_dir() {
        return Ok(path.to_owned());
    }
    let journal = file::find(path);
    if journal.is_file() {
        return Ok(journal);
    }
    let title = format!("{} has no journal", path.display());
    let hint = "give the bundle of a run, or the recording that an audit was made of";
    Err(Diagnostic::whole("migrate", title).hint(hint).into())
}

/// Which side the device of a run is, by the first record of its journal.
fn role(first: &Item) -> Option<Role> {
    let Item::Record(record) = first else { return None };
    let Event::RunBegun { header } = &record.event else {
        return None;
    };
    let mut roles = [Role::Agv, Role::MasterControl].into_iter();
    roles.find(|role| role.word() == header.role)
}

/// Writes what is asked for.
fn show(migration: &Migration, arguments: &Arguments) -> Result<(), Problem> {
    for wanted in &arguments.renderings {
        let rendered = match wanted.kind {
            HistoryKind::Html => page::html(migration).map_err(|error| Problem::Environment(error.to_string()))?,
            HistoryKind::Markdown => markdown::markdown(migration),
            HistoryKind::Json => json(migration)?,
        };
        match &wanted.file {
            Some(path) => {
                write_whole(path, rendered.as_bytes()).map_err(|error| Problem::Environment(error.to_string()))?;
            }
            None => {
                super::print(&rendered)?;
            }
        }
    }
    // Standard output holds one of them.
    if arguments.renderings.iter().all(|wanted| wanted.file.is_some()) {
        super::print(&match arguments.format {
            Format::Text => text::text(migration),
            Format::Json => json(migration)?,
        })?;
    }
    Ok(())
}

fn json(migration: &Migration) -> Result<String, Problem> {
    let text = serde_json::to_string_pretty(migration).map_err(|error| Problem::Environment(error.to_string()))?;
    Ok(text + "\n")
}

fn problem(error: MigrateError) -> Problem {
    let said = error.to_string();
    let hint = match error {
        MigrateError::Version(none) => return super::missing(&none),
        MigrateError::Nothing(_) => return Problem::NothingToDo(said),
        MigrateError::Audit(_) => return Diagnostic::whole("migrate", said).into(),
        MigrateError::NotEarlier { .. } => "--to names the version that it does not speak yet",
        MigrateError::Several { .. } => "name one with --vehicle",
    };
    Diagnostic::whole("migrate", said).hint(hint).into()
}
