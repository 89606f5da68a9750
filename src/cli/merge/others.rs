//! Parts of audits, qualifications and explorations, which have no journals: what is joined are their results.

use std::path::{Path, PathBuf};

use super::{RESULT, digest, intact, place, relative, unwritable, wrong};
use crate::cli::args::Format;
use crate::cli::exit::Exit;
use crate::cli::explored;
use crate::cli::problem::Problem;
use crate::cli::qualified;
use crate::cli::recordings::show;
use tck_audit::join::AuditPart;
use tck_audit::{bundle, saved};
use tck_base::diagnostic::Diagnostic;
use tck_explore::saved::ExplorationPart;
use tck_judge::Library;
use tck_qualify::saved::QualificationPart;
use tck_result::{MergedBundle, MergedParts};

/// Joins parts of an audit into a new bundle.
pub(super) fn audits(bundles: &[PathBuf], out: &Path, format: Format, library: &Library) -> Result<Exit, Problem> {
    let read = |folder: &Path| {
        saved::read(folder).map_err(|error| Problem::from(Diagnostic::whole("result", error.to_string())))
    };
    let mut parts = Vec::new();
    for leaf in leaves(bundles, out, |folder| Ok(read(folder)?.merged))? {
        parts.push(AuditPart {
            result: read(&leaf.result)?,
            bundle: leaf.bundle,
            sha256: leaf.sha256,
        });
    }
    let joined = tck_audit::join::join(&parts).ok_or_else(no_part)?;
    let root = bundle::write(&joined, &library.rules, out).map_err(|error| Problem::Environment(error.to_string()))?;
    tell(out, &root);
    show(&joined, format)
}

/// Joins parts of a qualification into a new bundle.
pub(super) fn qualifications(bundles: &[PathBuf], out: &Path, library: &Library) -> Result<Exit, Problem> {
    let mut parts = Vec::new();
    for leaf in leaves(bundles, out, |folder| Ok(qualified::read(folder)?.merged))? {
        let folder = leaf.result.parent().unwrap_or(out);
        parts.push(QualificationPart {
            result: qualified::read(folder)?,
            bundle: leaf.bundle,
            sha256: leaf.sha256,
        });
    }
    let mut joined = tck_qualify::saved::join(&parts).ok_or_else(no_part)?;
    if joined.suites_sha256 != library.rules.sha256 {
        return Err(wrong("the parts were made with other suites than these".to_owned()));
    }
    qualified::finish(&mut joined, library)?;
    let root = qualified::write(&joined, out)?;
    tell(out, &root);
    qualified::show(&joined)
}

/// Joins parts of an exploration into a new bundle.
pub(super) fn explorations(bundles: &[PathBuf], out: &Path, format: Format) -> Result<Exit, Problem> {
    let mut parts = Vec::new();
    for leaf in leaves(bundles, out, |folder| Ok(explored::read(folder)?.merged))? {
        let folder = leaf.result.parent().unwrap_or(out);
        parts.push(ExplorationPart {
            result: explored::read(folder)?,
            bundle: leaf.bundle,
            sha256: leaf.sha256,
        });
    }
    let joined = tck_explore::saved::join(&parts).ok_or_else(no_part)?;
    let root = explored::write(&joined, out)?;
    tell(out, &root);
    explored::show(&joined, format)
}

/// A part that was not joined before, or that is kept in a bundle of joined ones.
struct Leaf {
    /// Its result.
    result: PathBuf,
    /// Where its bundle is, from the new one.
    bundle: String,
    /// The SHA-256 of its result.
    sha256: String,
}

/// Every part of these bundles; its result is kept in the new bundle.
fn leaves(
    bundles: &[PathBuf],
    out: &Path,
    merged: impl Fn(&Path) -> Result<Option<MergedParts>, Problem>,
) -> Result<Vec<Leaf>, Problem> {
    let mut all = Vec::new();
    for folder in bundles {
        intact(folder)?;
        match merged(folder)? {
            Some(parts) => {
                for part in parts.parts {
                    all.push(kept(folder, out, part)?);
                }
            }
            None => {
                let result = folder.join(RESULT);
                let (_, sha256) = digest(&result).map_err(|error| unwritable(&result, &error))?;
                let bundle = relative(folder, out);
                all.push(Leaf { result, bundle, sha256 });
            }
        }
    }
    for leaf in &mut all {
        let bytes = std::fs::read(&leaf.result).map_err(|error| unwritable(&leaf.result, &error))?;
        let copy = place(out, index(&bytes), &leaf.sha256);
        tck_run::write_whole(&copy, &bytes).map_err(|error| Problem::Environment(error.to_string()))?;
        leaf.result = copy;
    }
    Ok(all)
}

/// A part that a joined bundle keeps.
fn kept(folder: &Path, out: &Path, part: MergedBundle) -> Result<Leaf, Problem> {
    let result = place(folder, part.index, &part.sha256);
    let is_same = digest(&result).is_ok_and(|(_, sha256)| sha256 == part.sha256);
    if !is_same {
        return Err(wrong(format!(
            "{} is not the result of part {}",
            result.display(),
            part.index
        )));
    }
    Ok(Leaf {
        result,
        bundle: relative(&folder.join(&part.bundle), out),
        sha256: part.sha256,
    })
}

/// Which part a result is of; 0 of what is no part.
fn index(result: &[u8]) -> usize {
    let value: serde_json::Value = serde_json::from_slice(result).unwrap_or_default();
    let index = value["shard"]["index"].as_u64();
    index.and_then(|index| usize::try_from(index).ok()).unwrap_or(0)
}

fn tell(out: &Path, root: &str) {
    crate::cli::tell(&format!(
        "the bundle in {} has the root hash sha256:{root}",
        out.display()
    ));
}

fn no_part() -> Problem {
    wrong("none of these is a part: they were made without --shard".to_owned())
}
