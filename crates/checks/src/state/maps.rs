//! `state/maps`: what must hold for `maps` in every state. `state/maps-stay`: what must hold from one state to the next.
//!
//! What map actions do is left to the tests.

use std::collections::{BTreeMap, BTreeSet};

use crate::finding::{broken, quote};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ActionView, Json, List, MapState, StateView};
use tck_world::{Listen, Observation, Topic};

/// How many maps and how many deleteMap actions are kept in mind.
const LIMIT: usize = 1024;

/// `state/maps`.
pub(crate) const MAPS: Check = Check {
    name: "state/maps",
    decides: &["MAP-07", "MAP-11", "MAP-14", "MAP-15"],
    doc: "No pair of mapId and mapVersion is listed twice, at most one version of a mapId is ENABLED, agvPosition.mapId \
          is an ENABLED map, and maps is empty only without an active map.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[],
    needs: &[StateView::maps],
    start: |_| Box::new(Maps),
};

/// `state/maps-stay`.
pub(crate) const MAPS_STAY: Check = Check {
    name: "state/maps-stay",
    decides: &["MAP-31"],
    doc: "No entry of maps disappears from one state to the next unless deleteMap was sent for it.",
    arguments: &[],
    listens: &[
        Listen::Hook,
        Listen::Answer,
        Listen::ToVehicle(Topic::InstantActions),
        Listen::Delivered(Topic::State),
    ],
    reads: &[],
    needs: &[StateView::maps],
    start: |_| Box::new(MapsStay::default()),
};

type Pair = (String, String);

struct Maps;

#[derive(Default)]
struct MapsStay {
    /// What the last state listed; nothing is known of it before the first, and after somebody had to do with the vehicle.
    listed: Option<BTreeSet<Pair>>,
    deleted: BTreeSet<Pair>,
}

/// The entries of a state, each once, and the entries that stand there again.
fn entries(maps: &List<MapState>) -> (BTreeSet<Pair>, Vec<Pair>) {
    let mut listed = BTreeSet::new();
    let mut again = Vec::new();
    for map in maps.iter().take(LIMIT) {
        let pair = (short(map.map_id.or_empty()), short(map.map_version.or_empty()));
        if !listed.insert(pair.clone()) {
            again.push(pair);
        }
    }
    (listed, again)
}

impl Running for Maps {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let Some(state) = record.state() else {
            return false;
        };
        let Some(maps) = state.maps.there() else {
            return false;
        };
        let seq = record.seq();
        for pair in entries(maps).1 {
            findings.push(broken("MAP-07", seq, format!("maps lists {} twice", label(&pair))));
        }
        let mut enabled: BTreeMap<&str, u32> = BTreeMap::new();
        for map in maps.iter().take(LIMIT).filter(|map| map.map_status.is("ENABLED")) {
            *enabled.entry(map.map_id.or_empty()).or_default() += 1;
        }
        for (map, _) in enabled.iter().filter(|(_, count)| **count > 1) {
            let text = format!("more than one version of map {} is ENABLED", quote(map));
            findings.push(broken("MAP-14", seq, text));
        }
        let position = state.position.there();
        let localized = position.is_some_and(|position| position.initialized.is(true));
        let active = position.map_or("", |position| position.map_id.or_empty());
        if localized && !active.is_empty() {
            if maps.total() == 0 {
                let text = format!("maps is empty although map {} is active", quote(active));
                findings.push(broken("MAP-15", seq, text));
            } else if !enabled.contains_key(active) && maps.total() <= LIMIT {
                let text = format!("agvPosition.mapId {} is no ENABLED map", quote(active));
                findings.push(broken("MAP-11", seq, text));
            }
        }
        maps.total() > 0 || localized
    }
}

impl Running for MapsStay {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        if record.outside_influence() {
            self.listed = None;
        }
        if let Some(message) = record.instant_actions_to_vehicle() {
            for action in message
                .all_actions()
                .filter(|action| action.action_type.is("deleteMap"))
            {
                if self.deleted.len() < LIMIT {
                    self.deleted
                        .insert((parameter(action, "mapId"), parameter(action, "mapVersion")));
                }
            }
        }
        let Some(maps) = record.state().and_then(|state| state.maps.there()) else {
            return false;
        };
        let (now, _) = entries(maps);
        let known = self.listed.as_ref();
        for pair in known.into_iter().flat_map(|listed| listed.difference(&now)) {
            if !self.deleted.contains(pair) {
                let text = format!("{} is gone, although no deleteMap was sent for it", label(pair));
                findings.push(broken("MAP-31", record.seq(), text));
            }
        }
        // A map that comes back is a new one: the old deleteMap does not cover its next disappearance. It may
        // still be about to be executed while the entry stands, so only entries that reappear count.
        let back = known.into_iter().flat_map(|listed| now.difference(listed));
        for pair in back.cloned().collect::<Vec<Pair>>() {
            self.deleted.remove(&pair);
        }
        let has_before = self.listed.replace(now).is_some();
        has_before && maps.total() > 0
    }
}

fn short(text: &str) -> String {
    text.chars().take(256).collect()
}

fn label(pair: &Pair) -> String {
    format!("map {} version {}", quote(&pair.0), quote(&pair.1))
}

/// The value of an action parameter as text.
fn parameter(action: &ActionView, key: &str) -> String {
    short(action.parameter(key).and_then(Json::text).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::trace::Trace;

    fn maps(all: &[(&str, &str, &str)]) -> Value {
        let maps: Vec<Value> = all
            .iter()
            .map(|(id, version, status)| json!({ "mapId": id, "mapVersion": version, "mapStatus": status }))
            .collect();
        json!({ "maps": maps })
    }

    fn judged(all: &[(&str, &str, &str)]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        trace.state(&maps(all));
        trace.judge("state/maps").summary()
    }

    #[test]
    fn one_enabled_version_per_map_is_right() {
        assert!(
            judged(&[
                ("hall", "1", "ENABLED"),
                ("hall", "2", "DISABLED"),
                ("yard", "1", "ENABLED")
            ])
            .is_empty()
        );
    }

    #[test]
    fn twins_two_enabled_versions_and_an_active_map_that_is_not_enabled_are_found() {
        assert_eq!(
            judged(&[("hall", "1", "ENABLED"), ("hall", "1", "DISABLED")]),
            ["MAP-07"]
        );
        assert_eq!(
            judged(&[("hall", "1", "ENABLED"), ("hall", "2", "ENABLED")]),
            ["MAP-14"]
        );
        assert_eq!(judged(&[("hall", "1", "DISABLED")]), ["MAP-11"]);
        assert_eq!(judged(&[]), ["MAP-15"]);
    }

    #[test]
    fn a_map_that_disappears_is_found_unless_it_was_to_be_deleted() {
        let both = maps(&[("hall", "1", "ENABLED"), ("hall", "2", "DISABLED")]);
        let one = maps(&[("hall", "1", "ENABLED")]);
        let mut trace = Trace::subscriber();
        trace.state(&both);
        trace.instant(
            "deleteMap",
            "x",
            &json!([{ "key": "mapId", "value": "hall" }, { "key": "mapVersion", "value": "2" }]),
        );
        trace.state(&both).state(&one);
        assert!(trace.judge("state/maps-stay").findings.is_empty());
        trace.state(&both).state(&one);
        assert_eq!(trace.judge("state/maps-stay").summary(), ["MAP-31"]);
    }

    #[test]
    fn what_a_person_does_to_the_maps_is_not_held_against_the_vehicle() {
        let mut trace = Trace::subscriber();
        trace.state(&maps(&[("hall", "1", "ENABLED"), ("yard", "1", "DISABLED")]));
        trace.hook().state(&maps(&[("hall", "1", "ENABLED")]));
        assert!(trace.judge("state/maps-stay").findings.is_empty());
    }

    #[test]
    fn a_map_is_deleted_as_asked_though_somebody_has_just_had_to_do_with_the_vehicle() {
        let both = maps(&[("hall", "1", "ENABLED"), ("hall", "2", "DISABLED")]);
        let mut trace = Trace::subscriber();
        trace.state(&both).hook();
        trace.instant(
            "deleteMap",
            "x",
            &json!([{ "key": "mapId", "value": "hall" }, { "key": "mapVersion", "value": "2" }]),
        );
        trace.state(&both).state(&maps(&[("hall", "1", "ENABLED")]));
        assert!(trace.judge("state/maps-stay").findings.is_empty());
    }
}
