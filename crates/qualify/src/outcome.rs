//! The outcome of a qualification, held against the exceptions of the suites.

use std::collections::BTreeSet;

use super::decider::Decider;
use super::find::is_found;
use super::kill::Kill;
use tck_base::verdict::Verdict;
use tck_pack::Role;
use tck_simulate::BuiltIn;
use tck_suite::{Exceptions, Unproven};

/// The outcome of a qualification.
#[derive(Clone, Debug)]
pub struct Qualification {
    /// The side whose reference device it is.
    pub role: Role,
    /// Whether each fault has to be found in this version.
    pub owes_faults: bool,
    /// The requirements that an earlier version has in which each fault has to be found. What is a lapse there may be a
    /// fault in this one, which demands more.
    pub earlier: BTreeSet<String>,
    /// What is not a pass on the faultless device: decider and verdict.
    pub blemishes: Vec<(Decider, Verdict)>,
    /// Everything that passes on the faultless device.
    pub deciders: BTreeSet<Decider>,
    /// One per fault.
    pub kills: Vec<Kill>,
    /// What no fault is known to fail and which fault nothing finds, with the reasons the suites give.
    pub exceptions: Exceptions,
}

impl Qualification {
    /// Deciders no fault can fail.
    #[must_use]
    pub fn unproven(&self) -> Vec<&Decider> {
        let killed: BTreeSet<&Decider> = self.kills.iter().flat_map(|kill| kill.deciders.keys()).collect();
        let all = self.deciders.iter();
        all.filter(|decider| !killed.contains(decider)).collect()
    }

    /// Why a decider is not proven, where the suites say so.
    #[must_use]
    pub fn excuse(&self, decider: &Decider) -> Option<&str> {
        let mut all = self.exceptions.unproven.iter();
        all.find(|one| decider.is(one)).map(|one| one.why.as_str())
    }

    /// Reasons that are needed no more: what they excuse is proven, or is not there.
    fn stale_excuses(&self) -> impl Iterator<Item = &Unproven> {
        let unproven = self.unproven();
        let all = self.exceptions.unproven.iter();
        all.filter(move |one| !unproven.iter().any(|decider| decider.is(one)))
    }

    /// Faults that are not found as they should be, and for which the suites give no reason. They have to be found where
    /// the version says so; otherwise each clause has to be proven.
    #[must_use]
    pub fn missed(&self) -> Vec<&Kill> {
        let owed = self.kills.iter().filter(|_| self.owes_faults);
        owed.filter(|kill| !is_found(self.role, kill) && !self.exceptions.is_unfound(kill.fault.name))
            .collect()
    }

    /// Everything that is wrong, a line each; empty when the proof is complete. `clauses` says whether all clauses were
    /// to be proven.
    #[must_use]
    pub fn complaints(&self, clauses: bool) -> Vec<String> {
        let mut all = Vec::new();
        for (decider, verdict) in &self.blemishes {
            all.push(format!("{decider} is {verdict} without a fault"));
        }
        for kill in self.missed() {
            let breaks = kill.fault.breaks.join(", ");
            let seen = match kill.named() {
                Some(_) => "is no more than a warning, and it is no lapse",
                None => "is not found by a requirement it names",
            };
            all.push(format!("fault {} ({breaks}) {seen}", kill.fault.name));
        }
        let found = self.kills.iter().filter(|kill| is_found(self.role, kill));
        for kill in found.filter(|kill| self.exceptions.is_unfound(kill.fault.name)) {
            all.push(format!("fault {} is found, and needs no reason", kill.fault.name));
        }
        for kill in &self.kills {
            let is_earlier = kill.fault.breaks.iter().any(|id| self.earlier.contains(*id));
            let is_lapse = !is_earlier && BuiltIn::lapse(self.role, kill.fault.name).is_some();
            if self.owes_faults && is_lapse && kill.named() == Some(Verdict::Fail) {
                all.push(format!("lapse {} fails, so that it is a fault", kill.fault.name));
            }
        }
        if clauses {
            let open = self
                .unproven()
                .into_iter()
                .filter(|decider| self.excuse(decider).is_none());
            all.extend(open.map(|decider| format!("no fault fails {decider}")));
            let stale = self.stale_excuses();
            all.extend(stale.map(|one| format!("{} {} is proven, and needs no reason", one.requirement, one.place)));
        }
        all
    }

    /// One line with the numbers.
    #[must_use]
    pub fn summary(&self) -> String {
        let found = self.kills.iter().filter(|kill| is_found(self.role, kill)).count();
        format!(
            "{} clauses and monitors, {} unproven; {} faults, {found} found",
            self.deciders.len(),
            self.unproven().len(),
            self.kills.len()
        )
    }
}
