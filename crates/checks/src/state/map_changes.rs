//! `state/map-changes`: every change of `maps` from one state to the next has the cause that the protocol knows for it.
//!
//! What a single state has to hold is left to `state/maps`, how map actions end to the tests.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use crate::finding::{broken, quote};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ActionView, Json, MapState, StateView};
use tck_world::{Fact, Listen, Observation, Topic, sets_position};

/// How many maps and map actions are kept in mind.
const LIMIT: usize = 1024;

/// Every change of `maps` from one state to the next has the cause that the protocol knows for it.
pub(crate) const MAP_CHANGES: Check = Check {
    name: "state/map-changes",
    decides: &["MAP-06", "MAP-20", "MAP-22", "MAP-24", "MAP-32"],
    doc: "An entry of maps appears only after a downloadMap of its mapId, and not as ENABLED unless it was asked for. Its \
          status changes only when a version of its mapId is enabled, and when that is done, one of them is ENABLED. While a download is under way or has ended, the entries of other versions stay as they are. No \
          entry goes that the route in the same state still needs. A restart, an initPosition, and what a person or a hook \
          did are left out.",
    arguments: &[],
    listens: &[
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::ToVehicle(Topic::InstantActions),
        Listen::ToVehicle(Topic::Order),
        Listen::Delivered(Topic::State),
    ],
    reads: &[Fact::Restarts],
    needs: &[StateView::maps],
    start: |_| Box::new(MapChanges::default()),
};

/// What is not listed for so long was not taken over.
const REFUSED: Duration = Duration::from_secs(60);

/// mapId and mapVersion.
type Pair = (String, String);

#[derive(Default)]
struct MapChanges {
    /// Whether each entry of the last state was ENABLED.
    listed: Option<BTreeMap<Pair, bool>>,
    /// What was ever asked for: mapIds to download, pairs to enable.
    downloads: BTreeSet<String>,
    enables: BTreeSet<Pair>,
    /// The mapIds of enableMap actions since the last state that showed nothing of the kind under way, and whether a
    /// downloadMap, or something that leaves open what it does to maps, was sent since.
    enabling: BTreeSet<String>,
    downloading: bool,
    open: bool,
    /// actionIds of map actions, and when they were sent.
    ours: BTreeMap<String, Moment>,
    /// Entries that are gone already, so that one mistake is told once.
    told: BTreeSet<Pair>,
}

fn short(text: &str) -> String {
    text.chars().take(256).collect()
}

fn parameter(action: &ActionView, key: &str) -> String {
    short(action.parameter(key).and_then(Json::text).unwrap_or_default())
}

fn label(pair: &Pair) -> String {
    format!("map {} version {}", quote(&pair.0), quote(&pair.1))
}

impl MapChanges {
    fn learn(&mut self, record: &Observation<'_>) {
        let instant = record.instant_actions_to_vehicle().into_iter();
        let instant = instant.flat_map(|message| message.all_actions());
        let order = record.order_to_vehicle().into_iter();
        let order = order.flat_map(|order| order.actions()).map(|(_, action)| action);
        let all = instant.chain(order);
        for action in all.take(LIMIT) {
            let pair = (parameter(action, "mapId"), parameter(action, "mapVersion"));
            match action.action_type.or_empty() {
                "downloadMap" => {
                    self.downloading = true;
                    self.downloads.insert(pair.0);
                }
                "enableMap" => {
                    self.enabling.insert(pair.0.clone());
                    self.enables.insert(pair);
                }
                // It may enable a map as well.
                kind if sets_position(kind) => self.open = true,
                _ => continue,
            }
            self.ours.insert(short(action.action_id.or_empty()), record.at().moment);
        }
        if self.downloads.len().max(self.enables.len()).max(self.ours.len()) > LIMIT {
            *self = Self {
                open: true,
                ..Self::default()
            };
        }
    }

    fn compare(
        &mut self,
        now: &BTreeMap<Pair, bool>,
        before: &BTreeMap<Pair, bool>,
        settled: bool,
        found: &mut Vec<(&'static str, String)>,
    ) {
        for (pair, enabled) in now {
            match before.get(pair) {
                None if !self.downloads.contains(&pair.0) => {
                    found.push((
                        "MAP-06",
                        format!("{} appears, and no downloadMap was sent for it", label(pair)),
                    ));
                }
                None if *enabled && !self.enables.contains(pair) => {
                    let text = format!("{} appears as ENABLED, and no enableMap was sent for it", label(pair));
                    found.push(("MAP-20", text));
                }
                Some(was) if was != enabled && !self.enabling.contains(&pair.0) => {
                    let requirement = match () {
                        () if !self.enabling.is_empty() => "MAP-24",
                        () if self.downloading => "MAP-22",
                        () => continue,
                    };
                    let status = if *enabled { "ENABLED" } else { "DISABLED" };
                    let text = format!(
                        "{} becomes {status}, and no enableMap was sent for this map",
                        label(pair)
                    );
                    found.push((requirement, text));
                }
                _ => {}
            }
        }
        let enabled = |maps: &BTreeMap<Pair, bool>, map: &str| maps.iter().any(|(pair, on)| *on && pair.0 == map);
        // While it is enabling, the old version may be off already and the new one not on yet.
        for map in self.enabling.iter().filter(|_| settled) {
            let versions = now.keys().filter(|pair| pair.0 == *map);
            let still = versions.filter(|pair| before.contains_key(*pair)).count();
            if enabled(before, map) && !enabled(now, map) && still > 1 {
                let text = format!(
                    "no version of map {} is ENABLED while another one is being enabled",
                    quote(map)
                );
                found.push(("MAP-24", text));
            }
        }
    }

    /// Entries that are gone though the route needs their map.
    fn needed(
        &mut self,
        state: &StateView,
        now: &BTreeMap<Pair, bool>,
        before: &BTreeMap<Pair, bool>,
        found: &mut Vec<(&'static str, String)>,
    ) {
        for (pair, enabled) in before.iter().filter(|(pair, _)| !now.contains_key(*pair)) {
            let others = now.keys().any(|other| other.0 == pair.0);
            let route = state.node_states.iter().any(|node| {
                let map = node.node_position.there().and_then(|position| position.map_id.text());
                map == Some(pair.0.as_str())
            });
            if *enabled && !others && route && self.told.len() < LIMIT && self.told.insert(pair.clone()) {
                let text = format!("{} is gone, and nodeStates still lead over this map", label(pair));
                found.push(("MAP-32", text));
            }
        }
    }
}

impl Running for MapChanges {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        self.learn(record);
        if context.world.restarts().now(record) || record.outside_influence() {
            self.listed = None;
        }
        let Some(state) = record.state() else {
            return false;
        };
        let Some(maps) = state.maps.there() else {
            self.listed = None;
            return false;
        };
        let read = |map: &MapState| {
            let pair = (short(map.map_id.or_empty()), short(map.map_version.or_empty()));
            (pair, map.map_status.is("ENABLED"))
        };
        let now: BTreeMap<Pair, bool> = maps.iter().take(LIMIT).map(read).collect();
        let before = self.listed.replace(now.clone());
        // What was asked for may still be about to be done until every map action that was seen has ended.
        let ended = |(id, since): (&String, &Moment)| {
            let action = state
                .all_action_states()
                .find(|action| action.action_id.or_empty() == id);
            match action.map(|action| action.action_status.or_empty()) {
                Some(status) => matches!(status, "FINISHED" | "FAILED"),
                // What was refused with its order is never listed.
                None => record.at().moment.since(*since) > REFUSED,
            }
        };
        let settled = self.ours.iter().all(ended);
        let judged = before.is_some() && !self.open && maps.total() <= LIMIT;
        if let Some(before) = before.filter(|_| judged) {
            let mut found = Vec::new();
            self.compare(&now, &before, settled, &mut found);
            self.needed(state, &now, &before, &mut found);
            for (requirement, text) in found {
                findings.push(broken(requirement, record.seq(), text));
            }
        }
        if settled {
            self.ours.clear();
            self.enabling.clear();
            self.downloading = false;
            self.open = false;
        }
        judged
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::trace::Trace;

    fn maps(all: &[(&str, &str, bool)], ended: &[&str]) -> Value {
        let maps: Vec<Value> = all
            .iter()
            .map(|(map, version, on)| {
                let status = if *on { "ENABLED" } else { "DISABLED" };
                json!({ "mapId": map, "mapVersion": version, "mapStatus": status })
            })
            .collect();
        let ended: Vec<Value> = ended
            .iter()
            .map(|id| json!({ "actionId": id, "actionStatus": "FINISHED" }))
            .collect();
        json!({ "maps": maps, "actionStates": ended })
    }

    fn named(map: &str, version: &str) -> Value {
        json!([{ "key": "mapId", "value": map }, { "key": "mapVersion", "value": version }])
    }

    /// What is found when an action is sent between two pictures of maps, and the second one shows it ended.
    fn changed(action: &str, of: (&str, &str), from: &[(&str, &str, bool)], to: &[(&str, &str, bool)]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        trace.state(&maps(from, &[]));
        trace.instant(action, "x", &named(of.0, of.1));
        trace.state(&maps(to, &["x"])).state(&maps(to, &["x"]));
        trace.judge("state/map-changes").summary()
    }

    const OLD: (&str, &str, bool) = ("hall", "1", true);
    const OLD_OFF: (&str, &str, bool) = ("hall", "1", false);

    #[test]
    fn changes_that_were_asked_for_are_right() {
        assert!(changed("downloadMap", ("hall", "2"), &[OLD], &[OLD, ("hall", "2", false)]).is_empty());
        let both = [OLD, ("hall", "2", false)];
        assert!(changed("enableMap", ("hall", "2"), &both, &[OLD_OFF, ("hall", "2", true)]).is_empty());
        assert!(changed("initPosition", ("hall", ""), &both, &[OLD_OFF, ("hall", "2", true)]).is_empty());
        assert!(changed("deleteMap", ("hall", "2"), &both, &[OLD]).is_empty());
    }

    #[test]
    fn a_download_that_touches_other_maps_or_enables_its_own_is_found() {
        let two = ("hall", "2", true);
        assert_eq!(changed("downloadMap", ("hall", "2"), &[OLD], &[OLD, two]), ["MAP-20"]);
        assert_eq!(changed("downloadMap", ("hall", "2"), &[OLD], &[OLD_OFF]), ["MAP-22"]);
        assert_eq!(
            changed("stateRequest", ("", ""), &[OLD], &[OLD, ("yard", "1", false)]),
            ["MAP-06"]
        );
    }

    #[test]
    fn enabling_one_version_changes_its_map_alone_and_at_once() {
        let all = [OLD, ("hall", "2", false), ("yard", "1", true)];
        let yard_off = [OLD_OFF, ("hall", "2", true), ("yard", "1", false)];
        assert_eq!(changed("enableMap", ("hall", "2"), &all, &yard_off), ["MAP-24"]);
        let none = [OLD_OFF, ("hall", "2", false), ("yard", "1", true)];
        assert_eq!(changed("enableMap", ("hall", "2"), &all, &none), ["MAP-24"]);
    }

    #[test]
    fn a_map_that_the_route_needs_stays() {
        let mut trace = Trace::subscriber();
        let route = json!([{ "nodeId": "n", "sequenceId": 2, "released": true, "nodePosition": { "mapId": "yard" } }]);
        let mut first = maps(&[OLD, ("yard", "1", true)], &[]);
        first["nodeStates"] = route.clone();
        let mut then = maps(&[OLD], &[]);
        then["nodeStates"] = route;
        trace
            .state(&first)
            .instant("deleteMap", "x", &named("yard", "1"))
            .state(&then);
        assert_eq!(trace.judge("state/map-changes").summary(), ["MAP-32"]);
    }

    #[test]
    fn what_a_person_did_at_the_vehicle_is_nobodys_fault() {
        let mut trace = Trace::subscriber();
        trace.state(&maps(&[OLD], &[])).hook().state(&maps(&[OLD_OFF], &[]));
        assert!(trace.judge("state/map-changes").findings.is_empty());
    }
}
