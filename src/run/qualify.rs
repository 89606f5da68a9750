//! Proof of every check: it passes on the faultless reference device, and a named fault makes it fail.
//!
//! Qualification runs everything in virtual time without a fault, then with each fault the tests that decide what the
//! fault breaks, and draws up the kill matrix: which clause and which monitor is failed by which fault. What is still
//! unproven is tried with every fault. A clause no fault can fail is said so by name.

mod rest;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use super::library::Library;
use super::session::Finished;
use super::virtual_run::{VirtualRun, run_silently};
use crate::engine::EngineError;
use crate::pack::{Pack, Role};
use crate::reference::Fault;
use crate::result::RunResult;
use crate::simulate::BuiltIn;
use crate::suite::Unproven;
use crate::suite::model::Test;
use crate::verdict::Verdict;

/// A clause of a test, or a monitor, deciding one requirement.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Decider {
    /// Requirement id.
    pub requirement: String,
    /// Test id and clause, or monitor id.
    pub place: String,
}

/// What one fault did.
#[derive(Clone, Debug)]
pub struct Kill {
    /// The fault.
    pub fault: Fault,
    /// What failed or warned because of it.
    pub deciders: BTreeSet<Decider>,
    /// The requirements that failed or warned, in the order they were decided.
    pub requirements: Vec<String>,
    /// What the report names first: the first fail, or where nothing fails the first warning.
    pub first: Option<(Decider, Verdict)>,
    /// The verdict of the run.
    pub verdict: Option<Verdict>,
}

impl Kill {
    /// Whether what the report names first is a requirement the fault names.
    #[must_use]
    pub fn named_first(&self) -> bool {
        let first = self.first.as_ref();
        first.is_some_and(|(decider, _)| self.fault.breaks.contains(&decider.requirement.as_str()))
    }

    fn report(&mut self, decider: &Decider, verdict: Verdict) {
        if self.first.as_ref().is_none_or(|(_, before)| verdict > *before) {
            self.first = Some((decider.clone(), verdict));
        }
    }

    /// Whether a requirement the fault names was reported.
    #[must_use]
    pub fn named(&self) -> bool {
        self.requirements
            .iter()
            .any(|id| self.fault.breaks.contains(&id.as_str()))
    }
}

/// The outcome of a qualification.
#[derive(Clone, Debug)]
pub struct Qualification {
    /// The side whose reference device it is.
    pub role: Role,
    /// Faults of blind rounds were tried only on what the proven ones leave without proof.
    pub late: bool,
    /// What is not a pass on the faultless device: decider and verdict.
    pub blemishes: Vec<(Decider, Verdict)>,
    /// Everything that passes on the faultless device.
    pub deciders: BTreeSet<Decider>,
    /// One per fault.
    pub kills: Vec<Kill>,
    /// What no fault is known to fail, with the reasons the suites give.
    pub excused: Vec<Unproven>,
}

impl Qualification {
    /// Why a decider is not proven, where the suites say so.
    #[must_use]
    pub fn excuse(&self, decider: &Decider) -> Option<&str> {
        let excuse = self.excused.iter().find(|one| excuses(one, decider));
        excuse.map(|one| one.why.as_str())
    }

    /// Deciders that no fault can fail, and for which the suites give no reason.
    #[must_use]
    pub fn unexcused(&self) -> Vec<&Decider> {
        let unproven = self.unproven().into_iter();
        unproven.filter(|decider| self.excuse(decider).is_none()).collect()
    }

    /// Reasons that are needed no more: what they excuse is proven, or is not there.
    #[must_use]
    pub fn stale_excuses(&self) -> Vec<&Unproven> {
        let unproven = self.unproven();
        let stale = |one: &&Unproven| !unproven.iter().any(|decider| excuses(one, decider));
        self.excused.iter().filter(stale).collect()
    }

    /// Deciders no fault can fail.
    #[must_use]
    pub fn unproven(&self) -> Vec<&Decider> {
        let killed: BTreeSet<&Decider> = self.kills.iter().flat_map(|kill| &kill.deciders).collect();
        self.deciders
            .iter()
            .filter(|decider| !killed.contains(decider))
            .collect()
    }

    /// Whether a fault comes from a blind round and has not moved to the proven ones yet. What it fails is proven all the
    /// same, but it need not be found.
    #[must_use]
    pub fn is_of_blind_round(&self, fault: &Fault) -> bool {
        let mut all = BuiltIn::blind_faults(self.role).iter();
        all.any(|one| one.name == fault.name)
    }

    /// Faults that no requirement they name was reported for, but for those of blind rounds.
    #[must_use]
    pub fn missed(&self) -> Vec<&Kill> {
        let own = self.kills.iter().filter(|kill| !self.is_of_blind_round(&kill.fault));
        own.filter(|kill| !kill.named()).collect()
    }

    /// The matrix as text: per fault what it kills, then what is unproven.
    #[must_use]
    pub fn matrix(&self) -> String {
        use std::fmt::Write as _;
        let mut text = String::new();
        // Beside the proven faults, those of blind rounds were tried on what was left to prove only.
        let is_shown = |kill: &&Kill| !self.late || !self.is_of_blind_round(&kill.fault);
        for kill in self.kills.iter().filter(is_shown) {
            let verdict = kill.verdict.map_or("nothing", Verdict::word);
            let _ = writeln!(text, "{} ({verdict})", kill.fault.name);
            let mut by_requirement: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
            for decider in &kill.deciders {
                by_requirement
                    .entry(&decider.requirement)
                    .or_default()
                    .push(&decider.place);
            }
            for (requirement, places) in by_requirement {
                let mark = if kill.fault.breaks.contains(&requirement) {
                    '*'
                } else {
                    ' '
                };
                let _ = writeln!(text, "  {mark} {requirement:<14} {}", places.join(", "));
            }
        }
        let unproven = self.unproven();
        let _ = writeln!(
            text,
            "\n{} clauses and monitors, {} unproven",
            self.deciders.len(),
            unproven.len()
        );
        for decider in unproven {
            let _ = writeln!(text, "  {:<14} {}", decider.requirement, decider.place);
            let why = self.excuse(decider).unwrap_or("No reason is given.");
            let _ = writeln!(text, "  {:<14}   {why}", "");
        }
        text
    }
}

fn excuses(one: &Unproven, decider: &Decider) -> bool {
    one.requirement == decider.requirement && one.place == decider.place
}

/// What was decided in a result, with its verdict.
#[must_use]
pub fn decided(result: &RunResult) -> Vec<(Decider, Verdict)> {
    let mut all = Vec::new();
    for test in &result.tests {
        for decision in &test.decisions {
            let decider = Decider {
                requirement: decision.requirement.clone(),
                place: format!("{} {}", test.id, decision.clause),
            };
            all.push((decider, decision.verdict()));
        }
    }
    for requirement in &result.requirements {
        for id in &requirement.decided_by {
            let Some(monitor) = result.monitors.iter().find(|monitor| monitor.id == *id) else {
                continue;
            };
            let findings = monitor
                .findings
                .iter()
                .filter(|finding| finding.requirement == requirement.id);
            let verdict = findings
                .map(|finding| finding.verdict)
                .fold(Verdict::Pass, Verdict::join);
            let decider = Decider {
                requirement: requirement.id.clone(),
                place: id.clone(),
            };
            all.push((decider, verdict));
        }
    }
    all
}

/// What was decided, the cases of a table that is drawn from counting as one: which of them are drawn is chance.
fn decided_in(library: &Library, result: &RunResult) -> Vec<(Decider, Verdict)> {
    let tests = &library.rules.suites.tests;
    let fold = |mut decider: Decider| {
        let (id, clause) = decider.place.split_once(' ').unwrap_or((&decider.place, ""));
        let found = tests.binary_search_by(|test| test.id.as_str().cmp(id)).ok();
        if let Some(test) = found.map(|at| &tests[at]).filter(|test| test.drawn.is_some()) {
            decider.place = format!("{} {clause}", test.table());
        }
        decider
    };
    let all = decided(result).into_iter();
    all.map(|(decider, verdict)| (fold(decider), verdict)).collect()
}

/// Qualifies all tests and monitors of a protocol version and a role with these faults of its reference device.
///
/// # Errors
/// When a run cannot be carried out.
pub fn qualify(library: &Library, pack: &Pack, role: Role, faults: &[Fault]) -> Result<Qualification, EngineError> {
    let tests = library.tests(role, &pack.id);
    qualify_tests(library, pack, &tests, faults, &|_| {})
}

/// Qualifies some tests, all of one role. `told` hears the name of each fault as its turn comes.
///
/// # Errors
/// When a run cannot be carried out.
pub fn qualify_tests(
    library: &Library,
    pack: &Pack,
    tests: &[Arc<Test>],
    faults: &[Fault],
    told: &(dyn Fn(&str) + Sync),
) -> Result<Qualification, EngineError> {
    let role = tests.first().map_or(Role::Agv, |test| test.device);
    let requests: Vec<VirtualRun> = BuiltIn::variants(role, pack)
        .into_iter()
        .map(|device| VirtualRun {
            device,
            tests: tests.to_vec(),
            ..VirtualRun::of_role(role, library, pack)
        })
        .collect();
    let mut blemishes = Vec::new();
    let mut deciders = BTreeSet::new();
    let mut vehicles = Vec::new();
    for mut request in requests {
        let Finished { result, .. } = run_silently(library, pack, request.clone())?;
        blemishes.extend(blemishes_of(&result));
        let all = decided_in(library, &result).into_iter().map(|(decider, _)| decider);
        let own: BTreeSet<Decider> = all.filter(|decider| !deciders.contains(decider)).collect();
        if !vehicles.is_empty() {
            // What also runs on the usual vehicle is proven there.
            let is_own = |id: &str| own.iter().any(|decider| decider.place.split(' ').next() == Some(id));
            request.tests.retain(|test| is_own(test.table()));
            request.complete = false;
        }
        vehicles.push(Vehicle {
            request,
            requirements: own.iter().map(|decider| decider.requirement.clone()).collect(),
        });
        deciders.extend(own);
    }
    let whole = is_whole(role, faults);
    // What breaks only obligations that this version does not have cannot show; whoever asks for it gets it tried.
    let in_version = |id: &str| {
        let requirement = library.rules.catalogue.get(id);
        requirement.is_none_or(|requirement| requirement.in_version(pack).is_some())
    };
    let possible = |fault: &&Fault| faults.len() <= FEW || fault.breaks.iter().any(|id| in_version(id));
    let faults: Vec<Fault> = faults.iter().filter(possible).copied().collect();
    // Those of blind rounds need not be found here: they are tried on what the others leave unproven.
    let is_blind = |fault: &Fault| BuiltIn::blind_faults(role).iter().any(|one| one.name == fault.name);
    let (mut early, mut late): (Vec<Fault>, Vec<Fault>) = faults.iter().copied().partition(|fault| !is_blind(fault));
    if !whole {
        early.clone_from(&faults);
        late.clear();
    }
    // A few faults are tried on everything; all of them would take minutes.
    let selected = |fault: &Fault, test: &Test| faults.len() <= FEW || concerns(fault, test);
    let mut kills = each(&early, |fault| {
        told(fault.name);
        kill(library, pack, &vehicles, fault, DRAWN, &|test| selected(fault, test))
    })?;
    // What only some members show is tried on all that is drawn from.
    let missed = kills.iter().filter(|kill| !kill.named());
    let missed: Vec<Fault> = missed.map(|kill| kill.fault).collect();
    let drawn = |fault: &Fault, test: &Test| test.drawn.is_some() && concerns(fault, test);
    merge(
        &mut kills,
        each(&missed, |fault| {
            kill(library, pack, &vehicles, fault, None, &|test| drawn(fault, test))
        })?,
    );
    let excused: Vec<Unproven> = excused_of(library, pack, role);
    if faults.len() > FEW {
        // What no test it names has found is tried on everything.
        let missed = kills.iter().filter(|kill| !kill.named());
        let missed: Vec<Fault> = missed.map(|kill| kill.fault).collect();
        merge(
            &mut kills,
            each(&missed, |fault| kill(library, pack, &vehicles, fault, DRAWN, &|_| true))?,
        );
        let rest = rest::Rest {
            library,
            pack,
            vehicles: &vehicles,
            deciders: &deciders,
            excused: &excused,
        };
        rest.prove(&faults, &late, &mut kills)?;
    }
    Ok(Qualification {
        role,
        late: whole,
        blemishes,
        deciders,
        kills,
        excused,
    })
}

/// What is drawn of the cases that come from a schema.
const DRAWN: Option<u64> = Some(1);

/// So many faults are tried on every test.
const FEW: usize = 5;

/// What the suites say no fault of this side is known to fail in this version.
fn excused_of(library: &Library, pack: &Pack, role: Role) -> Vec<Unproven> {
    let all = library.rules.suites.unproven.iter().filter(|one| one.role == role);
    let of_version = |one: &&Unproven| one.spec.as_ref().is_none_or(|spec| spec.contains(pack.version));
    all.filter(of_version).cloned().collect()
}

/// Whether all proven faults are among these. Who asks for some by name has each of them tried.
fn is_whole(role: Role, faults: &[Fault]) -> bool {
    let mut proven = BuiltIn::faults(role).iter();
    proven.all(|fault| faults.iter().any(|one| one.name == fault.name))
}

/// Whether a test decides something the fault breaks.
fn concerns(fault: &Fault, test: &Test) -> bool {
    test.requirements().iter().any(|id| fault.breaks.contains(&id.as_str()))
}

/// Tries every fault, on all cores; in their order.
fn each(
    faults: &[Fault],
    attempt: impl Fn(&Fault) -> Result<Kill, EngineError> + Sync,
) -> Result<Vec<Kill>, EngineError> {
    let next = AtomicUsize::new(0);
    let kills: Mutex<Vec<(usize, Result<Kill, EngineError>)>> = Mutex::new(Vec::new());
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                loop {
                    let at = next.fetch_add(1, Ordering::Relaxed);
                    let Some(fault) = faults.get(at) else { break };
                    let kill = attempt(fault);
                    if let Ok(mut all) = kills.lock() {
                        all.push((at, kill));
                    }
                }
            });
        }
    });
    let mut kills = kills.into_inner().unwrap_or_default();
    kills.sort_by_key(|(at, _)| *at);
    kills.into_iter().map(|(_, kill)| kill).collect()
}

/// Adds what more was found with the same faults.
fn merge(kills: &mut [Kill], more: Vec<Kill>) {
    for other in more {
        let Some(kill) = kills.iter_mut().find(|kill| kill.fault == other.fault) else {
            continue;
        };
        kill.deciders.extend(other.deciders);
        for requirement in other.requirements {
            if !kill.requirements.contains(&requirement) {
                kill.requirements.push(requirement);
            }
        }
        if let (None, Some((decider, verdict))) = (&kill.first, &other.first) {
            kill.report(decider, *verdict);
        }
        kill.verdict = kill.verdict.max(other.verdict);
    }
}

/// What is not a pass.
fn blemishes_of(result: &RunResult) -> Vec<(Decider, Verdict)> {
    let mut all: Vec<_> = decided(result)
        .into_iter()
        .filter(|(_, verdict)| *verdict != Verdict::Pass)
        .collect();
    let unjudged = result.tests.iter().filter(|test| test.decisions.is_empty());
    for test in unjudged.filter(|test| test.verdict.is_some_and(|verdict| verdict != Verdict::Pass)) {
        let decider = Decider {
            requirement: String::new(),
            place: test.id.clone(),
        };
        all.push((decider, Verdict::Error));
    }
    all
}

/// A vehicle that faults are tried on.
struct Vehicle {
    /// Everything on the usual one; on another one only the tests that do not run on those before it.
    request: VirtualRun,
    /// What is decided on none before it.
    requirements: BTreeSet<String>,
}

/// Runs these tests with a fault: on the usual vehicle, and on the others where they alone decide what the fault
/// breaks.
fn kill(
    library: &Library,
    pack: &Pack,
    vehicles: &[Vehicle],
    fault: &Fault,
    draw: Option<u64>,
    selected: &dyn Fn(&Test) -> bool,
) -> Result<Kill, EngineError> {
    let mut kill = Kill {
        fault: *fault,
        deciders: BTreeSet::new(),
        requirements: Vec::new(),
        first: None,
        verdict: None,
    };
    for (at, vehicle) in vehicles.iter().enumerate() {
        let concerned = fault.breaks.iter().any(|id| vehicle.requirements.contains(*id));
        let mut request = vehicle.request.clone();
        request.tests.retain(|test| selected(test));
        if request.tests.is_empty() || (at > 0 && !concerned) {
            continue;
        }
        request.complete = false;
        request.draw = draw;
        request.faults = vec![fault.name.to_owned()];
        let finished = run_silently(library, pack, request)?;
        for (decider, verdict) in decided_in(library, &finished.result) {
            if matches!(verdict, Verdict::Fail | Verdict::Warning) {
                kill.report(&decider, verdict);
                if !kill.requirements.contains(&decider.requirement) {
                    kill.requirements.push(decider.requirement.clone());
                }
                kill.deciders.insert(decider);
            }
        }
        kill.verdict = kill.verdict.max(finished.result.verdict);
    }
    Ok(kill)
}
