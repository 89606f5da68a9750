//! `zones/sets`: the zone sets of a vehicle change when fleet control says so, and one of them counts on each map.

use std::collections::{BTreeMap, BTreeSet};

use crate::finding::{broken, quote};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ActionView, Json, MessageView, StateView};
use tck_world::{Fact, Listen, Observation, Topic};

/// `zones/sets`.
pub(crate) const ZONE_SETS: Check = Check {
    name: "zones/sets",
    decides: &["ZSET-03", "ZSET-07", "ZSET-09"],
    doc: "No two entries of zoneSets with one mapId are ENABLED. From state to state an entry appears only after a zoneSet \
          message or a downloadZoneSet with its id, and as DISABLED unless it was to be enabled; it goes only after a \
          deleteZoneSet, and its status changes only after an enableZoneSet. A restart and what a person or a hook did are left \
          out, and so are entries without an id.",
    arguments: &[],
    listens: &[
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::ToVehicle(Topic::ZoneSet),
        Listen::ToVehicle(Topic::InstantActions),
        Listen::ToVehicle(Topic::Order),
        Listen::Delivered(Topic::State),
    ],
    reads: &[Fact::Restarts],
    needs: &[StateView::zone_sets],
    start: |_| Box::new(Sets::default()),
};

/// How many ids are kept in mind.
const LIMIT: usize = 1024;

/// What an entry says: mapId, and whether it is ENABLED.
type Entry = (String, bool);

#[derive(Default)]
struct Sets {
    /// The entries of the last state, by zoneSetId.
    listed: Option<BTreeMap<String, Entry>>,
    /// Ids that were sent or are to be downloaded, enabled or deleted, ever.
    sent: BTreeSet<String>,
    enables: BTreeSet<String>,
    deletes: BTreeSet<String>,
    /// Whether something was to be enabled since the last change of a status.
    enabling: bool,
    /// Maps with two ENABLED entries that were told.
    doubled: BTreeSet<String>,
}

fn named(action: &ActionView) -> String {
    let id = action.parameter("zoneSetId").and_then(Json::text);
    id.unwrap_or_default().chars().take(256).collect()
}

impl Sets {
    fn hear(&mut self, record: &Observation<'_>) {
        if let Some(MessageView::ZoneSet(message)) = record.to_vehicle(Topic::ZoneSet) {
            let set = message.zone_set.there();
            self.sent
                .extend(set.and_then(|set| set.zone_set_id.text()).map(str::to_owned));
        }
        let instant = record.instant_actions_to_vehicle().into_iter();
        let instant = instant.flat_map(|message| message.all_actions());
        let order = record.order_to_vehicle().into_iter();
        let order = order.flat_map(|order| order.actions()).map(|(_, action)| action);
        for action in instant.chain(order).take(LIMIT) {
            match action.action_type.or_empty() {
                "downloadZoneSet" => {
                    self.sent.insert(named(action));
                }
                "enableZoneSet" => {
                    self.enabling = true;
                    self.enables.insert(named(action));
                }
                "deleteZoneSet" => {
                    self.deletes.insert(named(action));
                }
                _ => {}
            }
        }
        if self.sent.len().max(self.enables.len()).max(self.deletes.len()) > LIMIT {
            *self = Self::default();
        }
    }

    /// What changed without a cause.
    fn changes(
        &mut self,
        now: &BTreeMap<String, Entry>,
        before: &BTreeMap<String, Entry>,
    ) -> Vec<(&'static str, String)> {
        let mut found = Vec::new();
        let mut switched = false;
        for (id, (_, enabled)) in now {
            let name = quote(id);
            match before.get(id) {
                None if !self.sent.contains(id) => {
                    found.push(("ZSET-03", format!("zone set {name} appears, and nobody sent it")));
                }
                None if *enabled && !self.enables.contains(id) => {
                    found.push((
                        "ZSET-07",
                        format!("zone set {name} appears as ENABLED, and was not to be enabled"),
                    ));
                }
                Some((_, was)) if was != enabled => {
                    switched = true;
                    let asked = self.enabling && (!enabled || self.enables.contains(id));
                    if !asked {
                        let status = if *enabled { "ENABLED" } else { "DISABLED" };
                        let text =
                            format!("zone set {name} becomes {status}, and no enableZoneSet was sent that does so");
                        found.push(("ZSET-03", text));
                    }
                }
                _ => {}
            }
        }
        for id in before
            .keys()
            .filter(|id| !now.contains_key(*id) && !self.deletes.contains(*id))
        {
            found.push((
                "ZSET-03",
                format!("zone set {} is gone, and was not to be deleted", quote(id)),
            ));
        }
        if switched && now.values().any(|(_, enabled)| *enabled) {
            self.enabling = false;
        }
        found
    }

    fn doubled(&mut self, now: &BTreeMap<String, Entry>) -> Vec<(&'static str, String)> {
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        for (map, _) in now.values().filter(|(_, enabled)| *enabled) {
            *counts.entry(map).or_default() += 1;
        }
        let twice = counts.into_iter().filter(|(_, count)| *count > 1);
        let told = twice.filter(|(map, _)| self.doubled.insert((*map).to_owned()));
        told.map(|(map, count)| {
            (
                "ZSET-09",
                format!("{count} zone sets of map {} are ENABLED", quote(map)),
            )
        })
        .collect()
    }
}

impl Running for Sets {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        self.hear(record);
        if record.outside_influence() || context.world.restarts().now(record) {
            self.listed = None;
        }
        let Some(state) = record.state().filter(|state| state.zone_sets.is_there()) else {
            return false;
        };
        let entries = state.zone_sets.iter().take(LIMIT).filter_map(|set| {
            let id = set.zone_set_id.text().filter(|id| !id.is_empty())?;
            let entry = (set.map_id.or_empty().to_owned(), set.zone_set_status.is("ENABLED"));
            Some((id.to_owned(), entry))
        });
        let now: BTreeMap<String, Entry> = entries.collect();
        let mut found = self.doubled(&now);
        let before = self.listed.take();
        if let Some(before) = &before {
            found.extend(self.changes(&now, before));
        }
        let judged = before.is_some() && !now.is_empty();
        self.listed = Some(now);
        findings.extend(found.into_iter().map(|(id, text)| broken(id, record.seq(), text)));
        judged
    }
}
