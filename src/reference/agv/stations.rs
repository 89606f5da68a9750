//! What is done at a station: picking, dropping, detecting, aligning, charging.

use std::time::Duration;

use serde_json::Value;

use super::action_kinds::{Deed, LOAD_POSITIONS};
use super::actions::{Action, Origin};
use super::deeds::{Area, Outcome, Problem};
use super::faults::FaultName as F;
use super::tolerances::ToleranceName as T;
use super::{Agv, Load};

impl Agv {
    /// The node where an action takes place: on an edge the one it leads to.
    fn site(&self, action: &Action) -> String {
        let ahead = self.book.nodes.front().map(|stop| &stop.node.id);
        let ahead = ahead.filter(|_| matches!(action.origin, Origin::Edge(_)));
        ahead.unwrap_or(&self.book.last_node).clone()
    }

    /// A load or a charger is an object (ACT-35).
    pub(crate) fn detect(&self, action: &Action) -> Outcome {
        let site = self.site(action);
        let there = self.stations.get(&site) == Some(&true) || self.config.chargers.contains(&site);
        let there = there && !self.faults.has(F::DetectionFails);
        if !there && !self.faults.has(F::DetectionFailureFinished) {
            return Outcome::Failed(Problem::new(Area::Load, action, "there is no object"));
        }
        let object = if action.text("objectType").is_empty() {
            "object"
        } else {
            action.text("objectType")
        };
        let result = format!("{object} detected");
        Outcome::Done(Some(result).filter(|_| !self.faults.has(F::DetectionUndescribed)))
    }

    /// A station or a charger is a target (ACT-36).
    pub(crate) fn align(&self, action: &Action) -> Result<(), Problem> {
        let site = self.site(action);
        let target = self.stations.contains_key(&site) || self.config.chargers.contains(&site);
        let target = target && !self.faults.has(F::PositioningFails);
        if target || self.faults.has(F::PositioningFailureFinished) {
            return Ok(());
        }
        Err(Problem::new(Area::Localization, action, "there is no target"))
    }

    /// pick or drop has failed.
    fn load_problem(&mut self, action: &Action, reason: &str) -> Result<(), Problem> {
        if self.faults.has(F::FailureChangesLoad) {
            self.change_load_anyway(action);
        }
        let mut problem = Problem::new(Area::Load, action, reason);
        if self.faults.has(F::FailureUnreferenced) {
            problem.references.clear();
        }
        Err(problem.silent_if(self.faults.has(F::FailureSilent)))
    }

    /// `failure-changes-load`: what would be there had it not failed.
    fn change_load_anyway(&mut self, action: &Action) {
        match action.kind.map(|kind| kind.deed) {
            Some(Deed::Pick) if self.loads.is_empty() => self.loads.push(Load {
                id: String::new(),
                kind: action.text("loadType").to_owned(),
                position: LOAD_POSITIONS[0].to_owned(),
            }),
            Some(Deed::Drop) => self.loads.clear(),
            _ => {}
        }
    }

    pub(crate) fn pick(&mut self, action: &Action) -> Result<(), Problem> {
        let site = self.site(action);
        let reason = match self.stations.get(&site) {
            _ if !self.loads.is_empty() => Some("the vehicle carries a load already"),
            Some(true) => None,
            _ => Some("there is no load"),
        };
        match reason {
            Some(_) if self.faults.has(F::PickFailureFinished) => return Ok(()),
            Some(reason) => return self.load_problem(action, reason),
            None => {}
        }
        if self.faults.has(F::PickWithoutLoad) {
            return Ok(());
        }
        let read = if self.takes(T::R3LoadsIdentified) {
            format!("RFID-{site}")
        } else {
            String::new()
        };
        self.stations.insert(site, false);
        if self.faults.has(F::R1PickReportedLate) {
            self.hidden_load = Some(self.moment() + Duration::from_secs(2));
        }
        let given = |key: &str, other: &str| match action.request.parameter(key).and_then(Value::as_str) {
            Some(text) => text.to_owned(),
            None => other.to_owned(),
        };
        self.loads.push(Load {
            id: given("loadId", &read),
            kind: given("loadType", "EPAL"),
            position: given("lhd", LOAD_POSITIONS[0]),
        });
        Ok(())
    }

    pub(crate) fn put_down(&mut self, action: &Action) -> Result<(), Problem> {
        let wanted = action.text("loadId");
        let found = self
            .loads
            .iter()
            .position(|load| wanted.is_empty() || load.id == wanted);
        let Some(found) = found else {
            if self.loads.is_empty() && self.faults.has(F::R3DropWithoutLoadFinished) {
                return Ok(());
            }
            return self.load_problem(action, "the vehicle does not carry that load");
        };
        let site = self.site(action);
        match self.stations.get_mut(&site) {
            Some(true) if self.faults.has(F::DropFailureFinished) => return Ok(()),
            Some(true) => return self.load_problem(action, "the place is taken"),
            Some(taken) => *taken = true,
            None => {}
        }
        let load = self.loads.remove(found);
        if self.faults.has(F::DropReportedLate) {
            self.shadow = Some((self.moment() + Duration::from_secs(1), load));
        } else if self.faults.has(F::R6DropFinishedBeforeLoadGone) {
            self.shadow = Some((self.moment() + self.brief(), load));
        }
        Ok(())
    }

    /// What does not charge has nothing to end (ACT-11); what cannot be ended has failed (ACT-20).
    pub(crate) fn stop_charging(&mut self, action: &Action) -> Result<(), Problem> {
        if self.charging && self.charger_locked {
            if self.faults.has(F::ChargingEndFailureFinished) {
                return Ok(());
            }
            self.charging = !self.faults.has(F::ChargingEndShownAnyway);
            let problem = Problem::new(Area::Charging, action, "the vehicle cannot leave the charger");
            return Err(problem.silent_if(self.faults.has(F::FailureSilent)));
        }
        let idle = !self.charging && self.third.charging_at.is_none();
        if idle && self.faults.has(F::R6SecondStopChargingFails) {
            return Err(Problem::new(Area::Charging, action, "the vehicle does not charge"));
        }
        if self.charging && self.faults.has(F::ChargingEndsEarly) {
            self.undocking = Some(self.moment() + Duration::from_secs(40));
        }
        self.third.charging_at = None;
        if self.shows_charging_longer() {
            return Ok(());
        }
        let toggled = !self.charging && self.faults.has(F::ChargingEndToggled);
        if action.of_order() && self.faults.has(F::R1NodeStopChargingUnreported) {
            return Ok(());
        }
        self.charging = toggled || self.charging && self.faults.has(F::ChargingEndUnreported);
        Ok(())
    }

    /// The charger is at a node: there is none where the vehicle drives (ACT-20).
    pub(crate) fn start_charging(&mut self, action: &Action) -> Result<(), Problem> {
        self.fourth.uncharged_at = None;
        if self.motion.is_moving() || !self.config.chargers.contains(&self.book.last_node) {
            if self.faults.has(F::ChargingFailureFinished) {
                return Ok(());
            }
            self.charging |= self.faults.has(F::ChargingShownAnyway);
            let problem = Problem::new(Area::Charging, action, "the vehicle is not at a charger");
            return Err(problem.silent_if(self.faults.has(F::FailureSilent)));
        }
        if self.charging && self.faults.has(F::ChargingTwiceFails) {
            return Err(Problem::new(Area::Charging, action, "the vehicle charges already"));
        }
        if !self.charging && self.faults.has(F::R3ChargingReportedLate) {
            self.third.charging_at = Some(self.moment() + Duration::from_secs(2));
            return Ok(());
        }
        if !self.charging && self.faults.has(F::R6ChargingFlagLags) {
            self.third.charging_at = Some(self.moment() + self.brief());
            return Ok(());
        }
        let toggled = self.charging && self.faults.has(F::ChargingToggled);
        self.charging = !toggled && !self.faults.has(F::ChargingUnreported);
        Ok(())
    }
}
