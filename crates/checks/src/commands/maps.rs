//! Maps: only enabled ones are used, and they are brought to the vehicle in order.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use serde_json::Value;

use super::{Command, ELEMENTS, Each, Found, nodes_in_sequence, place_of, short};
use crate::finding::{missing_or, quote, show};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ActionView, Json, Print, Scope, StateView};
use tck_world::{Fact, Listen, Observation, Topic};

/// `commands/map-enabled`.
pub(crate) const ENABLED: Check = Check {
    name: "commands/map-enabled",
    decides: &["MAP-09"],
    doc: "The nodes of an order are on maps that the states of the vehicle list as ENABLED, that an enableMap which has \
          FINISHED has enabled, or that an order enables on its way; of an update it is a warning. Judged only for a vehicle \
          that lists maps, and not of the last order that is sent again as it was.",
    arguments: &[],
    listens: &[
        Listen::Vehicle,
        Listen::Fault,
        Listen::Hook,
        Listen::Sent(Topic::State),
        Listen::Delivered(Topic::Order),
        Listen::Delivered(Topic::InstantActions),
    ],
    reads: &[Fact::Mock],
    needs: &[StateView::maps, ActionView::action_parameters],
    start: |_| Box::new(Enabled::default()),
};

/// `commands/map-on-board`.
pub(crate) const ON_BOARD: Check = Check {
    name: "commands/map-on-board",
    decides: &["MAP-10"],
    doc: "The instant action enableMap names a map version that a state of the vehicle lists: it was brought on board \
          before. Judged only for a vehicle that lists maps; otherwise it is a warning.",
    arguments: &[],
    listens: &[
        Listen::Vehicle,
        Listen::Fault,
        Listen::Hook,
        Listen::Sent(Topic::State),
        Listen::Delivered(Topic::Order),
        Listen::Delivered(Topic::InstantActions),
    ],
    reads: &[Fact::Mock],
    needs: &[StateView::maps, ActionView::action_parameters],
    start: |_| Box::new(OnBoard::default()),
};

/// `commands/map-download`.
pub(crate) const DOWNLOADS: Check = Check {
    name: "commands/map-download",
    decides: &["MAP-16"],
    doc: "downloadMap names mapId and mapDownloadLink; without mapVersion it is a warning, and so is a link without a host.",
    arguments: &[],
    listens: &[
        Listen::Delivered(Topic::Order),
        Listen::Delivered(Topic::InstantActions),
    ],
    reads: &[],
    needs: &[ActionView::action_parameters],
    start: |_| Each::start(download),
};

/// `commands/map-duplicate`.
pub(crate) const DUPLICATES: Check = Check {
    name: "commands/map-duplicate",
    decides: &["MAP-28"],
    doc: "When a downloadMap has failed for a map version the vehicle already lists, deleteMap for it has to come, and not \
          to fail, before the next downloadMap for it. With `settled`, a download that follows the refusal at once is judged as well.",
    arguments: &["settled"],
    listens: &[
        Listen::Vehicle,
        Listen::Fault,
        Listen::Hook,
        Listen::Sent(Topic::State),
        Listen::Delivered(Topic::Order),
        Listen::Delivered(Topic::InstantActions),
    ],
    reads: &[Fact::Mock],
    needs: &[StateView::maps, ActionView::action_parameters],
    start: |context| {
        Box::new(Duplicates {
            settled: context.with.get("settled") == Some(&Value::Bool(true)),
            ..Duplicates::default()
        })
    },
};

/// How many maps or downloads are remembered.
const KEPT: usize = 256;

fn download(command: Command<'_>, _: &CheckContext<'_>, found: &mut Found<'_>) -> bool {
    let mut judged = false;
    for (_, action) in command.actions() {
        if action.action_type.or_empty() != "downloadMap" {
            continue;
        }
        judged = true;
        for key in ["mapId", "mapDownloadLink"] {
            let value = action.argument(key);
            if value.text().is_none_or(str::is_empty) {
                let shown = missing_or(value);
                found.broken("MAP-16", format!("{key} of downloadMap is {shown}"));
            }
        }
        if let Some(link) = action.argument("mapDownloadLink").text()
            && !link.is_empty()
            && !is_remote(link)
        {
            let text = format!(
                "mapDownloadLink {} names no host the vehicle could ask",
                show(&Json::Text(link.into()))
            );
            found.remark("MAP-16", text);
        }
        if action.argument("mapVersion").is_absent() {
            found.remark("MAP-16", "mapVersion of downloadMap is missing");
        }
    }
    judged
}

/// Whether a link leads to another machine: a scheme other than that of files, and a host.
fn is_remote(link: &str) -> bool {
    let Some((scheme, rest)) = link.split_once("://") else {
        return false;
    };
    let is_scheme = scheme
        .bytes()
        .all(|byte| byte.is_ascii_alphanumeric() || b"+-.".contains(&byte));
    !scheme.is_empty()
        && is_scheme
        && !scheme.eq_ignore_ascii_case("file")
        && !rest.starts_with('/')
        && !rest.is_empty()
}

/// mapId and mapVersion of an action on maps.
fn pair(action: &ActionView) -> Option<(String, String)> {
    let word = |key: &str| Some(action.argument(key).text()?.chars().take(256).collect());
    Some((word("mapId")?, word("mapVersion").unwrap_or_default()))
}

#[derive(Default)]
struct Enabled {
    /// Enabled maps of the last states; `None` for a state that lists no maps.
    reported: VecDeque<(Moment, Option<BTreeSet<String>>)>,
    /// Maps to be enabled, by the id of the action.
    asked: BTreeMap<String, String>,
    /// Maps that are enabled on the way, or were by an action that has ended well.
    usable: BTreeSet<String>,
    /// What the last order said: whoever sends it again because no state shows it uses no map that was not used before.
    sent: Option<Print>,
}

impl Running for Enabled {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if context.world.mock().is_lost(record) {
            self.reported.clear();
        }
        if let Some(state) = record.said_state() {
            let listed = state.maps.there().filter(|maps| !maps.is_empty());
            let enabled = listed.map(|maps| {
                let on = maps.iter().take(KEPT).filter(|map| map.map_status.is("ENABLED"));
                on.filter_map(|map| short(&map.map_id)).collect()
            });
            if self.reported.len() == 64 {
                self.reported.pop_front();
            }
            self.reported.push_back((record.at().moment, enabled));
            let all = state.all_action_states().take(ELEMENTS);
            for action in all.filter(|action| action.action_status.is("FINISHED")) {
                let map = self.asked.remove(action.action_id.or_empty());
                self.usable.extend(map.filter(|_| self.usable.len() < KEPT));
            }
        }
        let Some(command) = Command::read(record) else {
            return false;
        };
        for (scope, action) in command.actions() {
            let (Some((map, _)), "enableMap") = (pair(action), action.action_type.or_empty()) else {
                continue;
            };
            if scope != Scope::Instant && self.usable.len() < KEPT {
                self.usable.insert(map);
            } else if let Some(id) = short(&action.action_id).filter(|_| self.asked.len() < KEPT) {
                self.asked.insert(id, map);
            }
        }
        let Some(order) = command.order() else { return false };
        let before = std::mem::replace(&mut self.sent, record.content());
        if before == self.sent {
            return false;
        }
        let (now, grace) = (record.at().moment, context.time.notice);
        let newest = self.reported.iter().rev();
        let fresh = newest.clone().take_while(|(said, _)| now.since(*said) < grace).count();
        let recent: Vec<_> = newest.take(fresh + 1).map(|(_, enabled)| enabled.as_ref()).collect();
        if recent.is_empty() || recent.iter().any(Option::is_none) || context.world.mock().unsettled(record, context) {
            return false;
        }
        let mut found = Found::new(record, findings);
        let mut judged = false;
        let mut said = BTreeSet::new();
        let is_update = order.order_update_id.whole().is_some_and(|update| update > 0);
        for node in nodes_in_sequence(order) {
            let Some((_, _, map)) = place_of(node).filter(|(_, _, map)| !map.is_empty()) else {
                continue;
            };
            judged = true;
            let known = recent.iter().flatten().any(|enabled| enabled.contains(map)) || self.usable.contains(map);
            if !known && said.insert(map) {
                let text = format!("the order is on map {}, which is not enabled", quote(map));
                if is_update {
                    found.remark("MAP-09", text);
                } else {
                    found.broken("MAP-09", text);
                }
            }
        }
        judged
    }
}

#[derive(Default)]
struct OnBoard {
    /// Map versions of the last states.
    listed: VecDeque<(Moment, BTreeSet<(String, String)>)>,
}

impl Running for OnBoard {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if context.world.mock().is_lost(record) {
            self.listed.clear();
        }
        let now = record.at().moment;
        if let Some(state) = record.said_state() {
            let name = |member| short(member).unwrap_or_default();
            let maps = state.maps.iter().take(KEPT);
            let maps = maps.map(|map| (name(&map.map_id), name(&map.map_version))).collect();
            if self.listed.len() == 64 {
                self.listed.pop_front();
            }
            self.listed.push_back((now, maps));
        }
        let Some(command @ Command::Instant(_)) = Command::read(record) else {
            return false;
        };
        let newest = self.listed.iter().rev();
        let fresh = newest
            .clone()
            .take_while(|(said, _)| now.since(*said) < context.time.notice)
            .count();
        let recent: Vec<_> = newest.take(fresh + 1).map(|(_, maps)| maps).collect();
        if recent.is_empty()
            || recent.iter().any(|maps| maps.is_empty())
            || context.world.mock().unsettled(record, context)
        {
            return false;
        }
        let mut found = Found::new(record, findings);
        let mut judged = false;
        for (_, action) in command.actions() {
            let (Some((id, version)), "enableMap") = (pair(action), action.action_type.or_empty()) else {
                continue;
            };
            judged = true;
            let is_it = |map: &(String, String)| map.0 == id && (version.is_empty() || map.1 == version);
            if !recent.iter().any(|maps| maps.iter().any(is_it)) {
                let text = format!(
                    "enableMap names version {} of map {}, which is not on board",
                    quote(&version),
                    quote(&id)
                );
                found.remark("MAP-10", text);
            }
        }
        judged
    }
}

#[derive(Default)]
struct Duplicates {
    /// The one who asks knows that the master control has seen the refusal.
    settled: bool,
    /// Downloads by actionId.
    asked: BTreeMap<String, (String, String)>,
    /// Actions that were sent before: what comes again under the same id is no new download.
    sent: BTreeSet<String>,
    /// Pairs that were refused as duplicates, since when, and not deleted since.
    refused: BTreeMap<(String, String), Moment>,
    /// Deletions of such pairs by actionId: when one fails, the pair is as it was.
    deleted: BTreeMap<String, (String, String)>,
}

impl Duplicates {
    fn note_state(&mut self, state: &StateView, at: Moment) {
        let has = |pair: &(String, String)| {
            let mut maps = state.maps.iter().take(KEPT);
            maps.any(|map| map.map_id.or_empty() == pair.0 && map.map_version.or_empty() == pair.1)
        };
        for action in state.all_action_states().take(ELEMENTS) {
            if !action.is_failed() {
                continue;
            }
            // Each action is looked at once.
            let id = action.action_id.or_empty();
            if let Some(pair) = self.asked.remove(id).or_else(|| self.deleted.remove(id))
                && has(&pair)
            {
                self.refused.insert(pair, at);
            }
        }
    }
}

impl Running for Duplicates {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if context.world.mock().is_lost(record) {
            self.asked.clear();
            self.refused.clear();
            self.deleted.clear();
        }
        if let Some(state) = record.said_state() {
            self.note_state(state, record.at().moment);
        }
        let Some(command) = Command::read(record) else {
            return false;
        };
        let mut found = Found::new(record, findings);
        let mut judged = false;
        for (_, action) in command.actions() {
            let Some(pair) = pair(action) else { continue };
            match action.action_type.or_empty() {
                "deleteMap" => {
                    judged |= self.refused.remove(&pair).is_some();
                    if self.deleted.len() < KEPT {
                        let id = short(&action.action_id).unwrap_or_default();
                        self.deleted.insert(id, pair);
                    }
                }
                "downloadMap" => {
                    let id = short(&action.action_id).unwrap_or_default();
                    if self.sent.len() == KEPT {
                        self.sent.pop_first();
                    }
                    if !self.sent.insert(id.clone()) {
                        continue;
                    }
                    let late = |at: &Moment| self.settled || record.at().moment.since(*at) >= context.time.notice;
                    judged |= self.settled;
                    if self.refused.get(&pair).is_some_and(late) {
                        let text = format!("map {} is downloaded again, and was not deleted", quote(&pair.0));
                        found.broken("MAP-28", text);
                        self.refused.remove(&pair);
                        judged = true;
                    }
                    if self.asked.len() < KEPT {
                        self.asked.insert(id, pair);
                    }
                }
                _ => {}
            }
        }
        judged
    }
}
