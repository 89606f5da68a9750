//! `report --merge`: the parts of something that was divided, joined into one bundle, and what `report` does with such a bundle.
//!
//! The bundle holds the result of every part, so that it can be joined again, alone or with further parts. The journals stay
//! where they are, and are known by their hashes.

mod others;

use std::path::{Component, Path, PathBuf};

use super::args::{Format, Report};
use super::bundle_state::{self, PARTS};
use super::exit::Exit;
use super::explored;
use super::problem::Problem;
use super::qualified;
use tck_audit::saved::{self, Lies};
use tck_base::diagnostic::Diagnostic;
use tck_journal::file::{self, NAME, PACKED, Recording};
use tck_judge::{self as judge, Evidence, Library, RunPart};
use tck_report::manifest::{self, Manifest, digest};
use tck_report::{json as result_file, overview};
use tck_result::{MergedPart, MergedRun, Part as _, RunResult};
use tck_run::{Bundle, sources, write_joined, write_whole};

/// The result of a bundle.
const RESULT: &str = "result.json";
/// How deep below a folder bundles are looked for.
const DEEP: usize = 4;

/// What the bundles that are joined hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Run,
    Audit,
    Qualification,
    Exploration,
}

impl Kind {
    fn of(bundle: &Path) -> Self {
        if saved::is_audit(bundle) {
            Self::Audit
        } else if qualified::is_qualification(bundle) {
            Self::Qualification
        } else if explored::is_exploration(bundle) {
            Self::Exploration
        } else {
            Self::Run
        }
    }
}

/// Joins the parts below these folders into a new bundle.
pub(super) fn merge(arguments: &Report, folders: &[PathBuf], out: &Path) -> Result<Exit, Problem> {
    let is_there = std::fs::read_dir(out).is_ok_and(|mut entries| entries.next().is_some());
    if is_there {
        let title = format!("{} is there already, and nothing is written over it", out.display());
        return Err(wrong(title));
    }
    let bundles = without_rounds(bundles(folders)?);
    std::fs::create_dir_all(out).map_err(|error| unwritable(out, &error))?;
    let library = crate::assets::library(arguments.suites.own())?;
    let kinds: Vec<Kind> = bundles.iter().map(|bundle| Kind::of(bundle)).collect();
    if let Some(at) = kinds.iter().position(|kind| *kind != kinds[0]) {
        let title = format!(
            "{} and {} are not of one kind: runs, audits, qualifications and explorations are joined each by themselves",
            bundles[0].display(),
            bundles[at].display()
        );
        return Err(wrong(title));
    }
    match kinds.first() {
        Some(Kind::Audit) => return others::audits(&bundles, out, arguments.format, &library),
        Some(Kind::Qualification) => return others::qualifications(&bundles, out, &library),
        Some(Kind::Exploration) => return others::explorations(&bundles, out, arguments.format),
        _ => {}
    }
    let mut parts = Vec::new();
    for bundle in &bundles {
        parts.extend(parts_of(bundle, out, &library)?);
    }
    let result = joined(&library, &parts)?;
    for part in &parts {
        let text = text_of(&part.result)?;
        let path = place(out, part.index(), &part.evidence.sha256);
        write_whole(&path, text.as_bytes()).map_err(|error| Problem::Environment(error.to_string()))?;
    }
    written(&result, out, arguments, &library)
}

/// Whether a folder is the bundle of a run that was joined.
pub(super) fn is_merged(folder: &Path) -> bool {
    merged(folder).is_some()
}

fn merged(folder: &Path) -> Option<MergedRun> {
    result_file::read(&folder.join(RESULT)).ok()?.merged
}

/// How the journals of a joined bundle lie there, with their names, and whether none has changed; of another bundle nothing.
pub(super) fn journals(folder: &Path) -> (Vec<(String, Lies)>, bool) {
    let parts = merged(folder).map_or_else(Vec::new, |merged| merged.parts);
    let all = parts.iter().map(|part| {
        let path = folder.join(&part.bundle).join(&part.journal);
        let lies = match digest(&path) {
            Err(_) => Lies::Elsewhere,
            Ok((_, sha256)) if sha256 == part.journal_sha256 => Lies::Same,
            Ok(_) => Lies::Changed,
        };
        (format!("{}/{}", part.bundle, part.journal), lies)
    });
    let all: Vec<(String, Lies)> = all.collect();
    let holds = all.iter().all(|(_, lies)| *lies != Lies::Changed);
    (all, holds)
}

/// `report` and `report --rejudge` of a joined bundle.
pub(super) fn report(folder: &Path, arguments: &Report, library: &Library) -> Result<Exit, Problem> {
    if arguments.rejudge {
        return rejudge(folder, library, arguments.format);
    }
    bundle_state::unchanged(folder)?;
    let result = joined(library, &saved_parts(folder, folder)?)?;
    written(&result, folder, arguments, library)
}

/// The result of a joined bundle, when its parts give it again.
pub(super) fn as_saved(folder: &Path, library: &Library) -> Result<RunResult, Problem> {
    let result = joined(library, &saved_parts(folder, folder)?)?;
    let saved = read(&folder.join(RESULT))?;
    if saved == result {
        return Ok(result);
    }
    let title = format!(
        "the parts do not give the result that is in {}",
        folder.join(RESULT).display()
    );
    let hint = "`report --rejudge` shows what differs; another version of the tool may judge otherwise";
    Err(Diagnostic::whole("result", title).hint(hint).into())
}

/// Judges the journal of every part again, and joins what comes out.
fn rejudge(folder: &Path, library: &Library, format: Format) -> Result<Exit, Problem> {
    let mut differ = Vec::new();
    let mut absent = Vec::new();
    let mut again = Vec::new();
    for part in saved_parts(folder, folder)? {
        let path = folder.join(&part.evidence.bundle).join(&part.result.journal);
        let name = format!("part {} (run {})", part.index(), part.result.run);
        match digest(&path) {
            Err(_) => {
                absent.push(format!("the journal of {name} is not at {}", path.display()));
                again.push(part);
            }
            Ok((_, sha256)) if sha256 != part.evidence.sha256 => {
                differ.push(format!("the journal of {name} was changed"));
                again.push(part);
            }
            Ok(_) => {
                let result = judged(&path, library)?;
                if text_of(&result)? != text_of(&part.result)? {
                    differ.push(format!("the journal of {name} gives another result"));
                }
                let evidence = part.evidence;
                again.push(RunPart { result, evidence });
            }
        }
    }
    let saved = std::fs::read_to_string(folder.join(RESULT)).map_err(|error| unwritable(folder, &error))?;
    if text_of(&joined(library, &again)?)? != saved {
        differ.push("the parts give another whole".to_owned());
    }
    if format == Format::Json {
        let same = differ.is_empty() && absent.is_empty();
        let text = serde_json::json!({ "same": same, "differ": differ, "absent": absent });
        super::print(&format!("{text}\n"))?;
    } else if differ.is_empty() && absent.is_empty() {
        super::print("the journals of all parts give the same results, and the parts the same whole, byte for byte\n")?;
    } else {
        let lines = differ.iter().chain(&absent);
        super::print(&lines.fold(String::new(), |text, line| text + line + "\n"))?;
    }
    Ok(match (differ.is_empty(), absent.is_empty()) {
        (true, true) => Exit::Conforms,
        (false, _) => Exit::DoesNotConform,
        (true, false) => Exit::Undecided,
    })
}

/// Writes what was joined, and says the verdict.
fn written(result: &RunResult, out: &Path, arguments: &Report, library: &Library) -> Result<Exit, Problem> {
    let pack = super::pack(library, Some(&result.protocol))?;
    let quoted = sources(library, &pack);
    let root = write_joined(&Bundle::open(out), result, &quoted, arguments.inconclusive.into());
    let root = root.map_err(|error| Problem::Environment(error.to_string()))?;
    let shown = out.join("report.html").display().to_string();
    match arguments.format {
        Format::Json => super::print(&text_of(result)?)?,
        Format::Text => {
            let bundle = overview::Bundle {
                report: Some(&shown),
                root: Some(&root),
            };
            super::print(&overview::overview(result, &quoted, None, bundle, super::color()))?
        }
    };
    Ok(Exit::of(result.verdict))
}

fn joined(library: &Library, parts: &[RunPart]) -> Result<RunResult, Problem> {
    judge::join(&library.rules, parts).map_err(|error| wrong(error.to_string()))
}

/// The bundles in these folders and below them, each once.
fn bundles(folders: &[PathBuf]) -> Result<Vec<PathBuf>, Problem> {
    let mut all: Vec<PathBuf> = Vec::new();
    for folder in folders {
        let before = all.len();
        let path = folder
            .canonicalize()
            .map_err(|error| wrong(format!("cannot read {}: {error}", folder.display())))?;
        search(&path, DEEP, &mut all)?;
        if all.len() == before {
            return Err(wrong(format!("there is no bundle in {} or below it", folder.display())));
        }
    }
    all.sort();
    let found = all.len();
    all.dedup();
    if all.len() < found {
        super::tell("a part that is given twice counts once");
    }
    Ok(all)
}

/// Without the reports of conversations where results of explorations are joined, which rest on them.
fn without_rounds(all: Vec<PathBuf>) -> Vec<PathBuf> {
    if all.iter().all(|bundle| Kind::of(bundle) != Kind::Exploration) {
        return all;
    }
    let is_part = |bundle: &Path| result_file::read(&bundle.join(RESULT)).is_ok_and(|result| result.shard.is_some());
    let (kept, rounds): (Vec<PathBuf>, Vec<PathBuf>) = all
        .into_iter()
        .partition(|bundle| Kind::of(bundle) != Kind::Run || is_part(bundle));
    if !rounds.is_empty() {
        super::tell(&format!(
            "{} reports of conversations are evidence of the parts, and are not joined by themselves",
            rounds.len()
        ));
    }
    kept
}

fn search(folder: &Path, deep: usize, all: &mut Vec<PathBuf>) -> Result<(), Problem> {
    if [RESULT, NAME, PACKED].iter().any(|name| folder.join(name).is_file()) {
        all.push(folder.to_owned());
        return Ok(());
    }
    if deep == 0 {
        return Ok(());
    }
    let unreadable = |error: std::io::Error| wrong(format!("cannot read {}: {error}", folder.display()));
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let entry = entry.map_err(unreadable)?;
        // Links, such as `latest`, lead to what is found by itself.
        if entry.file_type().map_err(unreadable)?.is_dir() {
            search(&entry.path(), deep - 1, all)?;
        }
    }
    Ok(())
}

/// The parts that a bundle holds: itself, or those that were joined into it.
fn parts_of(bundle: &Path, out: &Path, library: &Library) -> Result<Vec<RunPart>, Problem> {
    let path = file::find(bundle);
    let root = match bundle.join(manifest::NAME).is_file() {
        true => Some(intact(bundle)?),
        false => None,
    };
    if is_merged(bundle) {
        return saved_parts(bundle, out);
    }
    // A run that was killed has no manifest, and its result may be behind its journal.
    let result = match root {
        Some(_) => read(&bundle.join(RESULT))?,
        None => judged(&path, library)?,
    };
    let (bytes, sha256) = digest(&path).map_err(|error| wrong(format!("cannot read {}: {error}", path.display())))?;
    let evidence = Evidence {
        bundle: relative(bundle, out),
        bytes,
        sha256,
        root,
    };
    Ok(vec![RunPart { result, evidence }])
}

/// The parts of a joined bundle, as they were saved in it; `out` is where their paths lead from.
fn saved_parts(folder: &Path, out: &Path) -> Result<Vec<RunPart>, Problem> {
    let parts = merged(folder).map_or_else(Vec::new, |merged| merged.parts);
    let read = |part: MergedPart| {
        let of_part = |result: &RunResult| {
            result.run == part.run && result.shard.as_ref().map_or(0, |own| own.index) == part.index
        };
        let path = place(folder, part.index, &part.journal_sha256);
        let result = read(&path)?;
        if !of_part(&result) {
            return Err(wrong(format!(
                "{} is not the result of part {}",
                path.display(),
                part.index
            )));
        }
        let bundle = match folder == out {
            true => part.bundle,
            false => relative(&folder.join(&part.bundle), out),
        };
        let evidence = Evidence {
            bundle,
            bytes: part.journal_bytes,
            sha256: part.journal_sha256,
            root: part.root,
        };
        Ok(RunPart { result, evidence })
    };
    parts.into_iter().map(read).collect()
}

/// Where a joined bundle holds the result of a part.
fn place(bundle: &Path, index: usize, sha256: &str) -> PathBuf {
    bundle
        .join(PARTS)
        .join(format!("{index}-{}", beginning(sha256)))
        .join(RESULT)
}

fn beginning(sha256: &str) -> &str {
    sha256.get(..16).unwrap_or(sha256)
}

fn judged(path: &Path, library: &Library) -> Result<RunResult, Problem> {
    let Recording { journal, .. } = file::read(path).map_err(|error| wrong(error.to_string()))?;
    let result = judge::judge(&library.rules, journal.entries());
    let mut result = result.map_err(|error| wrong(format!("{}: {error}", path.display())))?;
    if let Some(lost) = journal.lost() {
        return Err(wrong(lost.to_string()));
    }
    result.journal = file::name_of(path);
    Ok(result)
}

/// The root hash of a bundle that is what its manifest says.
fn intact(bundle: &Path) -> Result<String, Problem> {
    let found = Manifest::verify(bundle).map_err(|error| wrong(error.to_string()))?;
    if found.holds() {
        return Ok(found.root);
    }
    Err(wrong(format!(
        "{} is not what its manifest says, and is not joined\n{}",
        bundle.display(),
        found.text().trim_end()
    )))
}

/// The way from a folder to another one, where they have more in common than the root; else the way from the root.
fn relative(to: &Path, from: &Path) -> String {
    let absolute = |path: &Path| {
        path.canonicalize()
            .or_else(|_| std::path::absolute(path))
            .unwrap_or_else(|_| path.to_owned())
    };
    let (to, from) = (absolute(to), absolute(from));
    let named = |path: &Path| {
        path.components()
            .filter(|part| matches!(part, Component::Normal(_)))
            .count()
    };
    let common: PathBuf = to
        .components()
        .zip(from.components())
        .take_while(|(one, other)| one == other)
        .map(|(one, _)| one)
        .collect();
    if named(&common) == 0 {
        return to.display().to_string();
    }
    let up = named(&from) - named(&common);
    let mut way: PathBuf = std::iter::repeat_n("..", up).collect();
    way.extend(to.strip_prefix(&common));
    way.display().to_string()
}

fn read(path: &Path) -> Result<RunResult, Problem> {
    result_file::read(path).map_err(|error| Diagnostic::whole("result", error.to_string()).into())
}

fn text_of(result: &RunResult) -> Result<String, Problem> {
    result_file::to_string(result).map_err(|error| Problem::Environment(error.to_string()))
}

fn wrong(title: String) -> Problem {
    Diagnostic::whole("merge", title).into()
}

fn unwritable(path: &Path, error: &std::io::Error) -> Problem {
    Problem::Environment(format!("{}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bundle_is_found_from_where_it_is_joined() {
        let root = tempfile::tempdir().expect("folder");
        let folder = |name: &str| {
            let path = root.path().join(name);
            std::fs::create_dir_all(&path).expect("folder");
            path
        };
        let (bundle, out) = (folder("reports/a/1"), folder("joined/whole"));
        let way = relative(&bundle, &out);
        assert_eq!(way, "../../reports/a/1");
        assert_eq!(
            out.join(&way).canonicalize().expect("there"),
            bundle.canonicalize().expect("there")
        );
        assert_eq!(relative(&bundle, &folder("reports")), "a/1");
    }
}
