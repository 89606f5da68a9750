//! The result of an audit that was written before: read again, held against its recordings, and compared with another one.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::result::{AuditResult, RESULT_FORMAT};
use tck_base::verdict::Verdict;
use tck_report::clean::line;
use tck_report::compare::{Comparison, Outcome, Standing, Trend};
use tck_report::manifest::digest;

/// Name of the result inside its bundle.
pub const NAME: &str = "result.json";

/// Why a result cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum SavedError {
    /// The file.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        source: std::io::Error,
    },
    /// It is no result of an audit, or a damaged one.
    #[error("{} is no result of an audit of this tool: {source}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: serde_json::Error,
    },
}

/// Where the result of a bundle stands; a file stands for itself.
#[must_use]
pub fn path_of(bundle: &Path) -> PathBuf {
    if bundle.is_dir() {
        bundle.join(NAME)
    } else {
        bundle.to_owned()
    }
}

/// Whether a bundle, or a file, is the result of an audit.
#[must_use]
pub fn is_audit(bundle: &Path) -> bool {
    /// What every result begins with.
    #[derive(serde::Deserialize)]
    struct Head {
        format: String,
    }
    let text = std::fs::read(path_of(bundle)).unwrap_or_default();
    serde_json::from_slice(&text).is_ok_and(|head: Head| head.format == RESULT_FORMAT)
}

/// Reads the result of a bundle.
///
/// # Errors
/// See [`SavedError`].
pub fn read(bundle: &Path) -> Result<AuditResult, SavedError> {
    let path = path_of(bundle);
    let text = std::fs::read(&path).map_err(|source| SavedError::Io {
        path: path.clone(),
        source,
    })?;
    serde_json::from_slice(&text).map_err(|source| SavedError::Damaged { path, source })
}

/// How a recording lies there now.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Lies {
    /// As it was.
    Same,
    /// With other content.
    Changed,
    /// Not where it was.
    Elsewhere,
    /// It has no fingerprint: it came from standard input.
    Unknown,
}

/// Holds the recordings of an audit against their fingerprints, by name.
#[must_use]
pub fn recordings(result: &AuditResult) -> Vec<(&str, Lies)> {
    let all = result.recordings.iter().map(|recording| {
        let lies = match (&recording.sha256, digest(Path::new(&recording.name))) {
            (None, _) => Lies::Unknown,
            (Some(_), Err(_)) => Lies::Elsewhere,
            (Some(known), Ok((_, found))) if *known == found => Lies::Same,
            (Some(_), Ok(_)) => Lies::Changed,
        };
        (recording.name.as_str(), lies)
    });
    all.collect()
}

/// How every requirement of every vehicle stands, and of the master control that commands it.
fn standings(result: &AuditResult) -> Vec<(String, Standing)> {
    let mut all: BTreeMap<String, Standing> = BTreeMap::new();
    for vehicle in &result.vehicles {
        for side in &vehicle.sides {
            for known in &side.requirements {
                let id = format!(
                    "{} {}, {}: {}",
                    vehicle.manufacturer, vehicle.serial_number, side.role, known.id
                );
                let standing = Standing::Decided(known.verdict);
                let worst = all.get(&id).map_or(standing, |known| known.join(standing));
                all.insert(id, worst);
            }
        }
    }
    all.into_iter().collect()
}

/// What became of an earlier audit in a later one. Which vehicles came, and what they did, differs from one recording to the next.
#[must_use]
pub fn compare(before: &AuditResult, after: &AuditResult) -> Comparison {
    let mut comparison = Comparison::of_requirements(standings(before), standings(after));
    comparison.verdict = (before.verdict != after.verdict).then_some((before.verdict, after.verdict));
    if before.tool != after.tool {
        let (before, after) = (line(&before.tool), line(&after.tool));
        comparison.notes.push(format!("tool differs: {before} -> {after}"));
    }
    let prints = |result: &AuditResult| -> Vec<Option<String>> {
        result
            .recordings
            .iter()
            .map(|recording| recording.sha256.clone())
            .collect()
    };
    if prints(before) == prints(after) && prints(before).iter().all(Option::is_some) {
        comparison.notes.push("both are about the same recordings".to_owned());
    }
    comparison
}

/// Why two audits cannot be compared, where one of them is a part.
#[must_use]
pub fn parts_differ(before: &AuditResult, after: &AuditResult) -> Option<String> {
    let name = |audit: &AuditResult| match &audit.shard {
        Some(shard) => format!("part {} of {}", shard.index, shard.of),
        None => "all of an audit".to_owned(),
    };
    let (one, other) = (name(before), name(after));
    (one != other).then(|| format!("one is {one}, and the other {other}"))
}

/// What a pipeline may conclude from audits: what came in one recording and not in the other is no news, but for failures.
#[must_use]
pub fn outcome(audits: &[AuditResult]) -> Outcome {
    let [.., before, after] = audits else {
        return Outcome::Undecided;
    };
    let step = compare(before, after);
    if step.has(|trend| trend == Trend::Worse) {
        Outcome::Worse
    } else if step.has(|trend| trend == Trend::Unclear)
        || !matches!(after.verdict, Some(Verdict::Pass | Verdict::Warning | Verdict::Fail))
    {
        Outcome::Undecided
    } else {
        Outcome::Holds
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::traffic;
    use super::super::{Audit, Options};
    use super::*;
    use tck_pack::Role;

    fn audited(faults: &[&str]) -> AuditResult {
        let library = tck_testing::library();
        let pack = library.rules.packs.latest();
        let mut audit = Audit::new(&library.rules, Options::default()).expect("options");
        for message in traffic(library, pack, Role::Agv, "order-acceptance/base-and-horizon", faults) {
            audit.observe(message);
        }
        audit.finish(Vec::new())
    }

    #[test]
    fn a_result_that_is_read_again_is_the_same_and_what_became_worse_is_named() {
        let (good, bad) = (audited(&[]), audited(&["horizon-not-reported"]));
        let folder = tempfile::tempdir().expect("folder");
        for result in [&good, &bad] {
            let text = serde_json::to_string(result).expect("JSON");
            std::fs::write(folder.path().join(NAME), text).expect("written");
            assert!(is_audit(folder.path()));
            assert_eq!(read(folder.path()).expect("read"), *result);
        }
        assert!(compare(&good, &good).is_empty());
        assert_eq!(outcome(&[good.clone(), good.clone()]), Outcome::Holds);
        let worse = compare(&good, &bad);
        let is_worse = |change: &tck_report::compare::Change| {
            change.id.ends_with(", agv: STATE-12") && change.trend == Trend::Worse
        };
        assert!(worse.requirements.iter().any(is_worse), "{worse:?}");
        assert_eq!(outcome(&[good.clone(), bad.clone()]), Outcome::Worse);
        assert_eq!(outcome(&[bad.clone(), good]), Outcome::Holds);
        // A known failure is no news, and one that nobody saw again is not known to be mended.
        assert_eq!(outcome(&[bad.clone(), bad.clone()]), Outcome::Holds);
        let mut nothing = bad.clone();
        nothing.vehicles.clear();
        nothing.verdict = Some(Verdict::Pass);
        assert_eq!(outcome(&[bad, nothing]), Outcome::Undecided);
        std::fs::write(folder.path().join(NAME), "{\"format\": \"vda5050-tck.audit/1\"}").expect("written");
        assert!(matches!(read(folder.path()), Err(SavedError::Damaged { .. })));
        std::fs::write(folder.path().join(NAME), "{}").expect("written");
        assert!(!is_audit(folder.path()));
    }
}
