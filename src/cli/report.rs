//! `report`: render a finished run again, verify it, judge it again, or compare two.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::args::{Format, Report};
use super::bundle_state;
use super::exit::Exit;
use super::merge;
use super::outputs::Outputs;
use super::problem::Problem;
use super::rejudged::judged;
use tck_audit::saved;
use tck_base::diagnostic::Diagnostic;
use tck_journal::file::{self, Recording};
use tck_report::{clean, compare, headline, json as result_file, manifest, overview, side_by_side};
use tck_result::RunResult;
use tck_run::{Bundle, sources, write_all};

/// `report`.
pub fn report(arguments: &Report, outputs: &Outputs<'_>) -> Result<Exit, Problem> {
    if let Some(folders) = &arguments.compare {
        if !arguments.page && folders.iter().any(|folder| saved::is_audit(folder)) {
            return super::audited::compare(folders, arguments.format);
        }
        return compare_runs(arguments, folders);
    }
    if let (Some(folders), Some(out)) = (&arguments.merge, &arguments.out) {
        return super::merge::merge(arguments, folders, out);
    }
    let Some(folder) = &arguments.directory else {
        return Err(Diagnostic::whole("usage", "the folder of a run is missing").into());
    };
    if arguments.verify {
        return verify(folder, arguments);
    }
    if arguments.profile {
        return super::export::profile(folder);
    }
    if saved::is_audit(folder) {
        return super::audited::report(folder, arguments, outputs);
    }
    if arguments.certificate {
        return super::export::certificate(folder);
    }
    if let Some(number) = arguments.message {
        return message(folder, number, arguments.format);
    }
    let mut library = crate::assets::library(arguments.suites.own())?;
    library.add(&own_tests(folder)?)?;
    if !arguments.renderings.is_empty() {
        return super::export::rendered(folder, &library, arguments, outputs);
    }
    if arguments.attestation {
        return super::export::attestation(folder, &library);
    }
    if let Some(file) = &arguments.package {
        return super::export::package(folder, &library, file, arguments.format);
    }
    if merge::is_merged(folder) {
        return merge::report(folder, arguments, &library);
    }
    let path = file::find(folder);
    let Recording { mut journal, torn } = journal_of(&path)?;
    if torn {
        eprintln!("the last line of the journal is cut off, as after a crash; everything before it is used");
    }
    let result = judged(&library, &journal, (folder, &path))?;
    if arguments.rejudge {
        return rejudge(folder, &result, arguments.format);
    }
    bundle_state::unchanged(folder)?;
    let pack = super::pack(&library, Some(&result.protocol))?;
    journal.set_names(pack.names());
    let quoted = sources(&library, &pack);
    let root = write_all(
        &Bundle::open(folder),
        &result,
        &quoted,
        &journal,
        arguments.inconclusive.into(),
    )
    .map_err(|error| Problem::Environment(error.to_string()))?;
    let shown = folder.join("report.html").display().to_string();
    match arguments.format {
        Format::Json => {
            super::print(&result_file::to_string(&result).map_err(|error| Problem::Environment(error.to_string()))?)?
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

fn journal_of(path: &Path) -> Result<Recording, Problem> {
    file::read(path).map_err(|error| {
        Problem::from(Diagnostic::whole("journal", error.to_string()).hint("give the folder of a finished run"))
    })
}

/// Prints one record: what it is, when and where it was seen, and the message as it was sent.
fn message(folder: &Path, number: u64, format: Format) -> Result<Exit, Problem> {
    let Recording { journal, .. } = journal_of(&file::find(folder))?;
    let Some(entry) = journal.get(number) else {
        let last = journal.last_seq();
        let title = format!("the journal has no record #{number}; its last one is #{last}");
        return Err(Diagnostic::whole("message", title).into());
    };
    let broken = |error: serde_json::Error| Problem::Environment(error.to_string());
    if let Format::Json = format {
        return super::print(&format!("{}\n", serde_json::to_string(&entry.record).map_err(broken)?));
    }
    let shown = match entry.json() {
        Some(message) => serde_json::to_string_pretty(message),
        None => serde_json::to_string_pretty(&entry.record),
    };
    super::print(&format!(
        "{}\n{:.3}\n{}\n",
        headline::reference(Some(&journal), number),
        entry.at().utc,
        clean::block(&shown.map_err(broken)?)
    ))
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
            .filter(|_| path.extension().is_some_and(|extension| extension == "yaml"))
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

fn rejudge(folder: &Path, result: &RunResult, format: Format) -> Result<Exit, Problem> {
    let path = folder.join("result.json");
    let saved = std::fs::read_to_string(&path).map_err(|error| {
        Problem::from(Diagnostic::whole(
            "result",
            format!("cannot read {}: {error}", path.display()),
        ))
    })?;
    let again = result_file::to_string(result).map_err(|error| Problem::Environment(error.to_string()))?;
    if format == Format::Json {
        super::print(&format!("{}\n", json!({ "same": saved == again })))?;
        return Ok(if saved == again {
            Exit::Conforms
        } else {
            Exit::DoesNotConform
        });
    }
    if saved == again {
        return super::print("the journal gives the same result, byte for byte\n");
    }
    let before = result_file::from_str(&saved, &path.display().to_string())
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

fn verify(folder: &Path, arguments: &Report) -> Result<Exit, Problem> {
    let found = manifest::Manifest::verify(folder)
        .map_err(|error| Problem::from(Diagnostic::whole("manifest", error.to_string())))?;
    let is_meant = arguments.root.as_ref().is_none_or(|root| *root == found.root);
    let (recordings, recordings_hold) = if saved::is_audit(folder) {
        super::audited::recordings(folder)?
    } else {
        merge::journals(folder)
    };
    let holds = found.holds() && is_meant && recordings_hold;
    let text = match arguments.format {
        Format::Json => format!(
            "{}\n",
            json!({ "intact": holds, "rootIsMeant": is_meant, "found": found, "recordings": recordings })
        ),
        Format::Text => {
            let mut text = format!("{}\n", found.text().trim_end());
            if !is_meant {
                text.push_str("the root hash is another one than --root says: this is not the bundle that was meant\n");
            }
            text.extend(recordings.iter().map(super::audited::told));
            text
        }
    };
    super::print(&text)?;
    Ok(if holds { Exit::Conforms } else { Exit::DoesNotConform })
}

/// Compares runs, each with the one before it.
fn compare_runs(arguments: &Report, folders: &[PathBuf]) -> Result<Exit, Problem> {
    let runs = folders.iter().map(|folder| {
        let path = if folder.is_dir() {
            folder.join("result.json")
        } else {
            folder.clone()
        };
        result_file::read(&path).map_err(|error| Problem::from(Diagnostic::whole("result", error.to_string())))
    });
    let runs: Vec<RunResult> = runs.collect::<Result<_, _>>()?;
    let names: Vec<String> = folders.iter().map(|folder| folder.display().to_string()).collect();
    if let Some(why) = runs
        .windows(2)
        .find_map(|pair| compare::parts_differ(&pair[0], &pair[1]))
    {
        let title = format!("these runs cannot be compared: {why}");
        let hint = "join the parts first (report --merge), or compare a part with the same part of another run";
        return Err(Diagnostic::whole("compare", title).hint(hint).into());
    }
    let steps = runs.windows(2).map(|pair| compare::compare(&pair[0], &pair[1]));
    let steps: Vec<compare::Comparison> = steps.collect();
    if arguments.page {
        let library = crate::assets::library(arguments.suites.own())?;
        let pack = super::pack(&library, runs.last().map(|run| run.protocol.as_str()))?;
        let quoted = sources(&library, &pack);
        let page = side_by_side::render(&runs, &names, &quoted);
        super::print(&page.map_err(|error| Problem::Environment(error.to_string()))?)?;
    } else if arguments.format == Format::Json {
        let steps = steps.iter().zip(names.windows(2));
        let steps = steps.map(|(step, names)| json!({ "before": names[0], "after": names[1], "changed": step }));
        let steps: Vec<Value> = steps.collect();
        super::print(&format!(
            "{:#}\n",
            json!({ "format": "vda5050-tck.comparison/1", "steps": steps })
        ))?;
    } else {
        for (step, names) in steps.iter().zip(names.windows(2)) {
            if steps.len() > 1 {
                super::print(&format!("{} -> {}\n", names[0], names[1]))?;
            }
            super::print(&step.text())?;
        }
    }
    Ok(match compare::outcome(&runs) {
        compare::Outcome::Holds => Exit::Conforms,
        compare::Outcome::Worse => Exit::DoesNotConform,
        compare::Outcome::Undecided => {
            super::tell(
                "nothing became worse, but a run is partial or undecided, or a failure cannot be seen any more: nobody can \
                 say that nothing did",
            );
            Exit::Undecided
        }
    })
}
