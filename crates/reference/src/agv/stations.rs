//! What is done at a station: picking, dropping, detecting, aligning, charging (the tables of section 6.8).
//!
//! stopCharging of a vehicle that does not charge is FINISHED (the ruling of ACT-11); a vehicle that aligns itself
//! leaves its node (that of ACT-36).

use serde_json::Value;

use super::action_effect::{Area, Outcome, Problem};
use super::actions::{Action, Origin};
use super::config::LOAD_POSITIONS;
use super::{Agv, Load};

impl Agv {
    /// The node where an action takes place: on an edge the one it leads to.
    pub(crate) fn site(&self, action: &Action) -> String {
        let ahead = self.order.nodes.front().map(|stop| &stop.node.id);
        let ahead = ahead.filter(|_| matches!(action.origin, Origin::Edge(_)));
        ahead.unwrap_or(&self.order.last_node).clone()
    }

    /// A load or a charger is an object (ACT-35).
    pub(crate) fn detect(&self, action: &Action) -> Outcome {
        let site = self.site(action);
        let there = self.stations.get(&site) == Some(&true) || self.config.chargers.contains(&site);
        if !there {
            return Outcome::Failed(Problem::new(Area::Load, action, "there is no object"));
        }
        let object = if action.text("objectType").is_empty() {
            "object"
        } else {
            action.text("objectType")
        };
        Outcome::Done(Some(format!("{object} detected")))
    }

    /// A station or a charger is a target (ACT-36).
    pub(crate) fn align(&self, action: &Action) -> Result<(), Problem> {
        let site = self.site(action);
        let target = self.stations.contains_key(&site) || self.config.chargers.contains(&site);
        if target {
            return Ok(());
        }
        Err(Problem::new(Area::Localization, action, "there is no target"))
    }

    pub(crate) fn pick(&mut self, action: &Action) -> Result<(), Problem> {
        let site = self.site(action);
        match self.stations.get(&site) {
            _ if !self.loads.is_empty() => return load_problem(action, "the vehicle carries a load already"),
            Some(true) => {}
            _ => return load_problem(action, "there is no load"),
        }
        self.stations.insert(site, false);
        let given = |key: &str, other: &str| match action.request.parameter(key).and_then(Value::as_str) {
            Some(text) => text.to_owned(),
            None => other.to_owned(),
        };
        self.loads.push(Load {
            id: given("loadId", ""),
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
            return load_problem(action, "the vehicle does not carry that load");
        };
        let site = self.site(action);
        match self.stations.get_mut(&site) {
            Some(true) => return load_problem(action, "the place is taken"),
            Some(taken) => *taken = true,
            None => {}
        }
        self.loads.remove(found);
        Ok(())
    }

    /// Ends charging. A vehicle that does not charge has nothing to end (ACT-11); what cannot be ended has failed (ACT-20).
    pub(crate) fn stop_charging(&mut self, action: &Action) -> Result<(), Problem> {
        if self.charging && self.charger_locked {
            return Err(Problem::new(
                Area::Charging,
                action,
                "the vehicle cannot leave the charger",
            ));
        }
        self.charging = false;
        Ok(())
    }

    /// The charger is at a node: there is none where the vehicle drives (ACT-20).
    pub(crate) fn start_charging(&mut self, action: &Action) -> Result<(), Problem> {
        if self.motion.is_moving() || !self.config.chargers.contains(&self.order.last_node) {
            return Err(Problem::new(Area::Charging, action, "the vehicle is not at a charger"));
        }
        self.charging = true;
        Ok(())
    }
}

/// pick or drop has failed.
fn load_problem(action: &Action, reason: &str) -> Result<(), Problem> {
    Err(Problem::new(Area::Load, action, reason))
}
