//! `campaign`: each device with each suite, every one a run of this program in a process of its own.

mod beforehand;
mod crew;

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

use clap::Parser as _;

use super::args::{Campaign as Arguments, Cli, Format};
use super::exit::Exit;
use super::problem::Problem;
use super::within;
use crew::{Crew, Job};
use tck_base::diagnostic::{Diagnostic, Source};
use tck_campaign::{Entry, Line, Place, PlaceError, Plan, Settled, Stand, Summary};
use tck_run::write_whole;

/// `campaign`.
pub fn campaign(arguments: &Arguments) -> Result<Exit, Problem> {
    let plan = read(&arguments.file)?;
    let root = folder(arguments, &plan);
    within::refuse_folder("out", &root)?;
    // What the events of a run name is found from everywhere.
    let root = std::path::absolute(&root).map_err(|error| unwritable(&root, &error))?;
    let begins_anew = |entry: &&Entry| match Place::of(&root, entry).stand() {
        Stand::New => true,
        // It goes on with what was begun.
        Stand::BrokenOff(_) => false,
        Stand::Settled(settled) => arguments.retry && is_tried_again(&settled),
    };
    let wrong = beforehand::mistakes(plan.entries.iter().filter(begins_anew), &root);
    if !wrong.is_empty() {
        return Err(wrong.into());
    }
    std::fs::create_dir_all(&root).map_err(|error| unwritable(&root, &error))?;
    // As long as this lives, no other campaign works in the folder.
    let _alone = alone(&root)?;
    let mut entries = Vec::new();
    for entry in plan.entries {
        let place = Place::of(&root, &entry);
        place.begin(&entry).map_err(|error| refused(&entry.name(), &error))?;
        if arguments.retry
            && let Stand::Settled(settled) = place.stand()
            && is_tried_again(&settled)
        {
            place.again().map_err(|error| refused(&entry.name(), &error))?;
        }
        entries.push(Job::new(entry, place));
    }
    let shown = Shown {
        name: arguments.file.display().to_string(),
        root,
    };
    shown.write(&entries)?;
    let mut crew = Crew::new(entries, plan.parallel)?;
    let interrupted = crew.work(|entries| shown.write(entries).map(drop))?;
    let summary = shown.write(crew.jobs())?;
    super::print(&match arguments.format {
        Format::Text => summary.text(),
        Format::Json => format!("{}\n", json(&summary)?),
    })?;
    if interrupted {
        super::tell("interrupted; the same call goes on where it was");
        return Ok(Exit::Interrupted);
    }
    Ok(exit_of(summary.exit))
}

/// Whether `--retry` runs an entry once more: nothing was judged.
fn is_tried_again(settled: &Settled) -> bool {
    [Exit::Usage, Exit::NothingToDo, Exit::Broken]
        .map(Exit::code)
        .contains(&settled.exit)
}

/// Reads the file, and holds each call that comes of it against the command line.
fn read(file: &Path) -> Result<Plan, Problem> {
    let name = file.display().to_string();
    let text = std::fs::read_to_string(file).map_err(|error| {
        let title = format!("the campaign {name} cannot be read: {error}");
        Problem::from(Diagnostic::whole("campaign", title).hint("docs/campaign.md shows how one is written"))
    })?;
    let source = Source::new(name, text);
    let plan = Plan::read(&source, file.parent().unwrap_or(Path::new("")))?;
    let mut wrong = Vec::new();
    for entry in &plan.entries {
        let words = std::iter::once("vda5050-tck".to_owned()).chain(entry.words());
        if let Err(error) = Cli::try_parse_from(words) {
            let text = error.render().to_string();
            let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
            let first = lines.next().unwrap_or("the call cannot be read");
            let first = first.strip_prefix("error: ").unwrap_or(first);
            let title = format!("{} cannot be called: {first}", entry.name());
            let hint = format!("the call is `vda5050-tck {}`", entry.words().join(" "));
            wrong.push(Diagnostic::new("campaign", entry.span.clone(), title, "of this suite").hint(hint));
        }
    }
    if wrong.is_empty() { Ok(plan) } else { Err(wrong.into()) }
}

/// The folder of the results: as the command line says, as the file says, or beside the file under its name.
fn folder(arguments: &Arguments, plan: &Plan) -> PathBuf {
    let said = arguments.out.clone().or_else(|| plan.out.clone());
    said.unwrap_or_else(|| {
        let beside = arguments.file.with_extension("");
        if beside == arguments.file {
            arguments.file.with_extension("campaign")
        } else {
            beside
        }
    })
}

/// Holds the folder for as long as the campaign works in it.
fn alone(root: &Path) -> Result<File, Problem> {
    let path = root.join("campaign.lock");
    let file = File::options()
        .read(true)
        .write(true)
        .create(true)
        .truncate(false)
        .open(&path);
    let file = file.map_err(|error| unwritable(&path, &error))?;
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => {
            let text = format!("another campaign is going on in {}", root.display());
            Err(Problem::Environment(text))
        }
        // Where there are no locks, each takes itself for alone.
        _ => Ok(file),
    }
}

fn unwritable(path: &Path, error: &std::io::Error) -> Problem {
    Problem::Environment(format!("cannot write {}: {error}", path.display()))
}

fn refused(name: &str, error: &PlaceError) -> Problem {
    match error {
        PlaceError::Io(..) => Problem::Environment(error.to_string()),
        PlaceError::Other(..) => {
            let hint = "its results would be of two kinds: put it back, or give the campaign another folder (--out)";
            Diagnostic::whole("campaign", format!("{name}: {error}"))
                .hint(hint)
                .into()
        }
    }
}

/// The exit of a code that a run has ended with.
fn exit_of(code: u8) -> Exit {
    Exit::ALL
        .into_iter()
        .find(|exit| exit.code() == code)
        .unwrap_or(Exit::Broken)
}

fn json(summary: &Summary) -> Result<String, Problem> {
    serde_json::to_string_pretty(summary).map_err(|error| Problem::Environment(error.to_string()))
}

/// Where the summary is written, again and again: what is not carried out stands in it, and is no pass.
struct Shown {
    name: String,
    root: PathBuf,
}

impl Shown {
    fn write(&self, jobs: &[Job]) -> Result<Summary, Problem> {
        let of = |job: &Job| {
            let settled: Option<Settled> = job.settled().cloned();
            let meaning = settled
                .as_ref()
                .map_or("not carried out", |settled| exit_of(settled.exit).meaning());
            Line::of(&job.entry.device, &job.entry.suite, settled, meaning)
        };
        let summary = Summary::of(self.name.clone(), jobs.iter().map(of).collect());
        let junit = summary
            .junit()
            .map_err(|error| Problem::Environment(error.to_string()))?;
        let json = json(&summary)? + "\n";
        for (name, text) in [
            ("campaign.json", json),
            ("summary.md", summary.markdown()),
            ("junit.xml", junit),
        ] {
            write_whole(&self.root.join(name), text.as_bytes())
                .map_err(|error| Problem::Environment(error.to_string()))?;
        }
        Ok(summary)
    }
}
