//! What became of each requirement of a side, how the messages of a device stand to it, and what decides it in the later version.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use super::super::result::{AuditResult, SideResult};
use super::model::{RequirementRow, Said};
use tck_base::verdict::Verdict;
use tck_judge::Library;
use tck_pack::{ChangeKind, Pack, Requirement, RequirementChange, Role, VersionNote};

/// How the messages of a side stand to requirements.
#[derive(Debug, Default)]
struct Standings<'r>(BTreeMap<&'r str, Standing<'r>>);

/// How messages stand to a requirement.
#[derive(Clone, Copy, Debug)]
struct Standing<'r> {
    verdict: Verdict,
    /// How often it is broken.
    count: u64,
    /// The worst that was found.
    found: Option<(Verdict, &'r str)>,
}

impl<'r> Standings<'r> {
    fn of(result: &'r AuditResult, role: Role) -> Self {
        let mut all: BTreeMap<&str, Standing<'_>> = BTreeMap::new();
        let sides = result.vehicles.iter().flat_map(|vehicle| &vehicle.sides);
        for side in sides.filter(|side| side.role == role.word()) {
            let SideResult {
                requirements, findings, ..
            } = side;
            for known in requirements {
                let standing = all.entry(known.id.as_str()).or_insert(Standing {
                    verdict: known.verdict,
                    count: 0,
                    found: None,
                });
                standing.verdict = standing.verdict.join(known.verdict);
            }
            for finding in findings {
                let standing = all.entry(finding.requirement.as_str()).or_insert(Standing {
                    verdict: finding.verdict,
                    count: 0,
                    found: None,
                });
                standing.count += finding.count;
                if standing.found.is_none_or(|(worst, _)| finding.verdict > worst) {
                    standing.found = Some((finding.verdict, finding.text.as_str()));
                }
            }
        }
        Self(all)
    }

    fn get(&self, id: &str) -> Option<Standing<'r>> {
        self.0.get(id).copied()
    }
}

/// Tests and monitors by the requirements that they decide.
#[derive(Debug, Default)]
struct Deciders {
    tests: BTreeMap<String, Vec<String>>,
    monitors: BTreeMap<String, Vec<String>>,
}

impl Deciders {
    fn of(library: &Library, role: Role, pack: &Pack) -> Self {
        let mut all = Self::default();
        for test in library.tests(role, &pack.id) {
            for id in test.requirements() {
                let named = all.tests.entry(id.to_string()).or_default();
                // The cases of a table are one test.
                if named.last().is_none_or(|last| last != test.table()) {
                    named.push(test.table().to_owned());
                }
            }
        }
        let monitors = library.rules.suites.monitors.iter();
        let monitors = monitors.filter(|monitor| monitor.spec.contains(pack.version));
        for monitor in monitors.filter(|monitor| monitor.device.is_none_or(|device| device == role)) {
            for binding in &monitor.checks {
                let named = all.monitors.entry(binding.requirement.to_string()).or_default();
                named.push(monitor.id.clone());
            }
        }
        all
    }
}

/// What became of each requirement of a side; `now` and `then` are what its messages came to in both versions. Of those that
/// are as before only what is broken is kept.
pub fn rows(
    library: &Library,
    (from, to): (&Pack, &Pack),
    role: Role,
    (now, then): (&AuditResult, &AuditResult),
) -> Vec<RequirementRow> {
    let rules = &library.rules;
    let (now, then) = (Standings::of(now, role), Standings::of(then, role));
    let deciders = Deciders::of(library, role, to);
    let changes = rules.catalogue.changes(&rules.packs, from, to);
    let of_side = |change: &&RequirementChange<'_>| {
        let requirement = change.requirement();
        requirement.is_some_and(|requirement| requirement.role.concerns(role))
    };
    let row = |change: &RequirementChange<'_>| {
        let id = change.requirement()?.id.as_str();
        let standing = then.get(id);
        let row = RequirementRow {
            id: id.to_owned(),
            change: change.kind,
            stricter: is_stricter(change),
            before: change.before.map(|said| said_by(said, from)),
            after: change.after.map(|said| said_by(said, to)),
            why: change.why.map(str::to_owned),
            now: now.get(id).map(|standing| standing.verdict),
            then: standing.map(|standing| standing.verdict),
            count: standing.map_or(0, |standing| standing.count),
            found: standing.and_then(|standing| Some(standing.found?.1.to_owned())),
            tests: deciders.tests.get(id).cloned().unwrap_or_default(),
            monitors: deciders.monitors.get(id).cloned().unwrap_or_default(),
        };
        (row.change != ChangeKind::Same || row.is_broken()).then_some(row)
    };
    let mut rows: Vec<RequirementRow> = changes.iter().filter(of_side).filter_map(row).collect();
    rows.sort_by_key(|row| {
        let broken = row.then.filter(|_| row.is_broken());
        (row.change, Reverse(broken), Reverse(row.stricter))
    });
    rows
}

fn said_by((requirement, note): (&Requirement, &VersionNote), pack: &Pack) -> Said {
    Said {
        text: requirement.text.clone(),
        mood: note.mood.word(),
        section: note.section.clone(),
        link: requirement.link_in(pack),
    }
}

/// Whether the mood of the later version is the stronger one.
fn is_stricter(change: &RequirementChange<'_>) -> bool {
    match (change.before, change.after) {
        (Some((_, before)), Some((_, after))) => after.mood.broken() > before.mood.broken(),
        _ => false,
    }
}
