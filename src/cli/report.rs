//! `report`: render a finished run again, verify it, judge it again, or compare two.

use std::path::Path;

use super::args::{Format, Report};
use super::exit::Exit;
use super::problem::Problem;
use crate::diagnostic::Diagnostic;
use crate::journal::file::{self, Recording};
use crate::judge;
use crate::report::{compare, json, manifest, overview};
use crate::run::{Bundle, Library, sources, write_all};

/// `report`.
pub fn report(arguments: &Report) -> Result<Exit, Problem> {
    if let Some(both) = &arguments.compare {
        let [before, after] = both.as_slice() else {
            return Err(Diagnostic::whole("usage", "two runs are compared").into());
        };
        return compare_runs(before, after);
    }
    let Some(folder) = &arguments.directory else {
        return Err(Diagnostic::whole("usage", "the folder of a run is missing").into());
    };
    if arguments.verify {
        return verify(folder);
    }
    let mut library = Library::load(arguments.suites.suites.as_deref())?;
    library.add(&own_tests(folder)?)?;
    let Recording { journal, torn } = file::read(&folder.join("journal.jsonl")).map_err(|error| {
        Problem::from(Diagnostic::whole("journal", error.to_string()).hint("give the folder of a finished run"))
    })?;
    if torn {
        eprintln!("the last line of the journal is cut off, as after a crash; everything before it is used");
    }
    let result = judge::judge(&library.rules, journal.entries())
        .map_err(|error| Problem::from(Diagnostic::whole("journal", format!("{}: {error}", folder.display()))))?;
    if arguments.rejudge {
        return rejudge(folder, &result);
    }
    let pack = super::pack(&library, Some(&result.protocol))?;
    let quoted = sources(&library.rules.catalogue, &library.rules.suites, &pack);
    let root = write_all(&Bundle::open(folder), &result, &quoted, &journal)
        .map_err(|error| Problem::Environment(error.to_string()))?;
    let shown = folder.join("report.html").display().to_string();
    match arguments.format {
        Format::Json => {
            super::print(&json::to_string(&result).map_err(|error| Problem::Environment(error.to_string()))?)?
        }
        Format::Text => {
            let bundle = overview::Bundle {
                report: Some(&shown),
                root: Some(&root),
            };
            super::print(&overview::overview(
                &result,
                &quoted,
                Some(&journal),
                bundle,
                super::color(),
            ))?
        }
    };
    Ok(Exit::of(result.verdict))
}

/// The tests that lie in a bundle because no suite has them: conversations of an exploration.
fn own_tests(folder: &Path) -> Result<Vec<(String, String)>, Problem> {
    let folder = folder.join("tests");
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let unreadable = |error: std::io::Error| Problem::Environment(format!("{}: {error}", folder.display()));
    let mut all = Vec::new();
    for entry in std::fs::read_dir(&folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let Some(name) = path
            .file_name()
            .and_then(|name| name.to_str())
            .filter(|name| name.ends_with(".yaml"))
        else {
            continue;
        };
        let text = std::fs::read_to_string(&path).map_err(unreadable)?;
        let role = if text.lines().any(|line| line.trim_end() == "device: master-control") {
            "master-control"
        } else {
            "agv"
        };
        all.push((format!("suites/{role}/explore/{name}"), text));
    }
    Ok(all)
}

fn rejudge(folder: &Path, result: &crate::result::RunResult) -> Result<Exit, Problem> {
    let path = folder.join("result.json");
    let saved = std::fs::read_to_string(&path).map_err(|error| {
        Problem::from(Diagnostic::whole(
            "result",
            format!("cannot read {}: {error}", path.display()),
        ))
    })?;
    let again = json::to_string(result).map_err(|error| Problem::Environment(error.to_string()))?;
    if saved == again {
        return super::print("the journal gives the same result, byte for byte\n");
    }
    let before = json::from_str(&saved, &path.display().to_string())
        .map_err(|error| Problem::from(Diagnostic::whole("result", error.to_string())))?;
    let comparison = compare::compare(&before, result);
    let text = if comparison.is_empty() {
        "the journal gives the same verdicts, but not the same result; tool or suites differ\n".to_owned()
    } else {
        comparison.text()
    };
    super::print(&text)?;
    Ok(Exit::DoesNotConform)
}

fn verify(folder: &Path) -> Result<Exit, Problem> {
    let found = manifest::Manifest::verify(folder)
        .map_err(|error| Problem::from(Diagnostic::whole("manifest", error.to_string())))?;
    super::print(&format!("{}\n", found.text().trim_end()))?;
    Ok(if found.holds() {
        Exit::Conforms
    } else {
        Exit::DoesNotConform
    })
}

fn compare_runs(before: &Path, after: &Path) -> Result<Exit, Problem> {
    let read = |folder: &Path| {
        let path = if folder.is_dir() {
            folder.join("result.json")
        } else {
            folder.to_owned()
        };
        json::read(&path).map_err(|error| Problem::from(Diagnostic::whole("result", error.to_string())))
    };
    let comparison = compare::compare(&read(before)?, &read(after)?);
    super::print(&comparison.text())?;
    let worse = comparison
        .requirements
        .iter()
        .chain(&comparison.tests)
        .any(|change| change.trend() == compare::Trend::Worse);
    Ok(if worse { Exit::DoesNotConform } else { Exit::Conforms })
}
