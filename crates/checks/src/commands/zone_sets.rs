//! Sets of zones, each by itself and beside those that came before: their zones, their ids, and what vehicles can make of them.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use super::{ELEMENTS, Found, short};
use crate::finding::{quote, show};
use tck_base::polygon::{Flaw, Point, Polygon};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ArrayLimits, FactsheetView, Print, TypeSpecification, Zone, ZoneAction, ZoneSetView};
use tck_world::{Fact, Listen, Observation, Topic};

/// `commands/zone-set-zones`.
pub(crate) const ZONES: Check = Check {
    name: "commands/zone-set-zones",
    decides: &["ZSET-05", "ZSET-19", "ZSET-20", "ZSET-21", "ZSET-22", "ZSET-24"],
    doc: "The zones of a set have ids of their own, and each is a simple polygon whose corners go round counter-clockwise; two \
          zones that say where to drive have no area in common. A set names no mapVersion. A member that belongs to another type of \
          zone, an actionId of a zone action, and a last corner that repeats the first are warnings.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::ZoneSet)],
    reads: &[],
    needs: &[ZoneSetView::zone_set],
    start: |_| Box::new(Zones),
};

/// `commands/zone-set-ids`.
pub(crate) const IDS: Check = Check {
    name: "commands/zone-set-ids",
    decides: &["ZSET-06"],
    doc: "A zoneSetId stands for one content: what comes under it again, to this vehicle or another one, is the same, descriptions \
          for people left aside.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::ZoneSet)],
    reads: &[],
    needs: &[ZoneSetView::zone_set],
    start: |_| Box::new(Ids::default()),
};

/// `commands/zone-set-limits`.
pub(crate) const LIMITS: Check = Check {
    name: "commands/zone-set-limits",
    decides: &["ZSET-25", "ZSET-27"],
    doc: "A set holds no more zones than the factsheet of the vehicle takes, no zone of a type that it does not list under \
          supportedZones, and no zone action that it does not offer in the scope ZONE. A zone that only makes a way better or \
          worse is a warning.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::ZoneSet)],
    reads: &[Fact::Factsheets],
    needs: &[
        ZoneSetView::zone_set,
        ArrayLimits::zones,
        TypeSpecification::supported_zones,
        FactsheetView::protocol_features,
    ],
    start: |_| Box::new(Limits),
};

/// How far two polygons reach into each other that only touch, in metres.
const TOUCHING: f64 = 0.001;

/// The message of a record that brings a set of zones.
pub(super) fn zone_set<'e>(record: &Observation<'e>) -> Option<&'e ZoneSetView> {
    record.delivered_on(Topic::ZoneSet)?.zone_set().map(|set| &**set)
}

/// The corners of a zone, if all of them are points.
pub(super) fn corners(zone: &Zone) -> Option<Vec<Point>> {
    let all = zone.vertices.iter();
    let all = all.map(|corner| Some(Point::new(corner.x.float()?, corner.y.float()?)));
    all.collect()
}

/// A zone as an area, whichever way round it is drawn.
pub(super) fn area(zone: &Zone) -> Option<Polygon> {
    Polygon::new(corners(zone)?).ok()
}

struct Zones;

impl Running for Zones {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let Some(set) = zone_set(record).and_then(|message| message.zone_set.there()) else {
            return false;
        };
        let mut found = Found::new(record, findings);
        // Members that no version has stand in no view.
        let whole = record.json();
        if whole.is_some_and(|json| holds(json, "mapVersion", 2)) {
            found.broken(
                "ZSET-05",
                "the set names a mapVersion; it is for a map in every version",
            );
        }
        if whole.is_some_and(|json| holds(json, "actionId", 6)) {
            found.remark(
                "ZSET-21",
                "an action of a zone has an actionId, which the vehicle makes itself",
            );
        }
        let mut ids = BTreeSet::new();
        let mut ways: Vec<(String, Polygon)> = Vec::new();
        for zone in set.zones.iter().take(ELEMENTS) {
            let id = zone.zone_id.or_empty();
            if !id.is_empty() && !ids.insert(id) {
                found.broken("ZSET-19", format!("two zones of the set are called {}", quote(id)));
            }
            border(zone, &mut found);
            members(zone, &mut found);
            if matches!(zone.zone_type.or_empty(), "DIRECTED" | "BIDIRECTED")
                && let Some(area) = area(zone)
            {
                for (other, known) in &ways {
                    if known.overlap(&area) > TOUCHING {
                        let text = format!(
                            "zones {} and {} both say where to drive, and overlap",
                            quote(other),
                            quote(id)
                        );
                        found.broken("ZSET-24", text);
                    }
                }
                ways.push((id.to_owned(), area));
            }
        }
        true
    }
}

/// What is wrong with the border of a zone. Whether there are enough corners with numbers, the schema tells.
fn border(zone: &Zone, found: &mut Found<'_>) {
    let id = quote(zone.zone_id.or_empty());
    let Some(mut all) = corners(zone).filter(|all| all.len() >= 3) else {
        return;
    };
    if let [first, .., last] = all[..]
        && first.distance(last) < TOUCHING
    {
        let text = format!("zone {id} ends with the corner it begins with; it is closed anyway");
        found.remark("ZSET-22", text);
        all.pop();
    }
    match Polygon::new(all) {
        Ok(area) if !area.is_counter_clockwise() => {
            found.broken("ZSET-22", format!("the corners of zone {id} go round clockwise"));
        }
        Ok(_) | Err(Flaw::TooMany(_)) => {}
        Err(flaw) => found.broken("ZSET-22", format!("zone {id} is no simple polygon: {flaw}")),
    }
}

/// Members that say nothing of a zone of this type.
fn members(zone: &Zone, found: &mut Found<'_>) {
    let kind = zone.zone_type.or_empty();
    let id = quote(zone.zone_id.or_empty());
    let listed = |list: &tck_view::Member<tck_view::List<ZoneAction>>| !list.is_empty();
    let there = [
        ("maximumSpeed", !zone.maximum_speed.is_absent(), "SPEED_LIMIT"),
        ("entryActions", listed(&zone.entry_actions), "ACTION"),
        ("duringActions", listed(&zone.during_actions), "ACTION"),
        ("exitActions", listed(&zone.exit_actions), "ACTION"),
        (
            "releaseLossBehavior",
            !zone.release_loss_behavior.is_absent(),
            "RELEASE",
        ),
        ("priorityFactor", !zone.priority_factor.is_absent(), "PRIORITY"),
        ("penaltyFactor", !zone.penalty_factor.is_absent(), "PENALTY"),
        ("directedLimitation", !zone.directed_limitation.is_absent(), "DIRECTED"),
        (
            "bidirectedLimitation",
            !zone.bidirected_limitation.is_absent(),
            "BIDIRECTED",
        ),
    ];
    for (name, is_there, of) in there {
        if is_there && kind != of && !kind.is_empty() {
            let text = format!("zone {id} is a {} zone and has a {name}", show(&zone.zone_type));
            found.remark("ZSET-20", text);
        }
    }
}

/// Whether a value has a member of that name, so many levels deep.
fn holds(value: &Value, name: &str, levels: u32) -> bool {
    let Some(levels) = levels.checked_sub(1) else {
        return false;
    };
    match value {
        Value::Object(members) => {
            let mut members = members.iter();
            members.any(|(own, value)| own == name || holds(value, name, levels))
        }
        Value::Array(elements) => elements.iter().take(ELEMENTS).any(|value| holds(value, name, levels)),
        _ => false,
    }
}

/// The actions of a zone.
fn actions(zone: &Zone) -> impl Iterator<Item = &ZoneAction> {
    let lists = [&zone.entry_actions, &zone.during_actions, &zone.exit_actions];
    lists.into_iter().flat_map(|list| list.iter().take(ELEMENTS))
}

#[derive(Default)]
struct Ids {
    known: BTreeMap<String, Print>,
}

impl Running for Ids {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(set) = zone_set(record).and_then(|message| message.zone_set.there()) else {
            return false;
        };
        let Some(id) = short(&set.zone_set_id).filter(|id| !id.is_empty()) else {
            return false;
        };
        let print = set.essence;
        let first = context.world.fleet().borrow().zone_set(&id);
        let before = self.known.insert(id.clone(), print);
        if self.known.len() > ELEMENTS {
            self.known.pop_first();
        }
        if before.or(first).is_some_and(|before| before != print) {
            let text = format!("zone set {} comes with another content than before", quote(&id));
            Found::new(record, findings).broken("ZSET-06", text);
        }
        true
    }
}

struct Limits;

impl Running for Limits {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(set) = zone_set(record).and_then(|message| message.zone_set.there()) else {
            return false;
        };
        let sheets = context.world.factsheets().valid(record, context);
        if sheets.is_empty() {
            return false;
        }
        let mut found = Found::new(record, findings);
        let count = set.zones.total() as u64;
        let limits = sheets.iter().map(|sheet| sheet.array_limit(|limits| &limits.zones));
        if let Some(most) = limits.collect::<Option<Vec<_>>>().and_then(|all| all.into_iter().max())
            && count > most
        {
            let text = format!("the set has {count} zones, the vehicle takes {most}");
            found.broken("ZSET-27", text);
        }
        for zone in set.zones.iter().take(ELEMENTS) {
            let kind = zone.zone_type.or_empty();
            let id = quote(zone.zone_id.or_empty());
            let takes = |sheet: &tck_world::Factsheet| {
                let kinds = sheet.view.type_specification.there().map(|kind| &kind.supported_zones);
                kinds.is_some_and(|kinds| kinds.texts().any(|known| known == kind))
            };
            if !kind.is_empty() && !sheets.iter().any(|sheet| takes(sheet)) {
                let text = format!(
                    "zone {id} is of type {}, which the vehicle does not support",
                    quote(kind)
                );
                if matches!(kind, "PRIORITY" | "PENALTY") {
                    found.remark("ZSET-25", text);
                } else {
                    found.broken("ZSET-25", text);
                }
            }
            for action in actions(zone) {
                let name = action.action_type.or_empty();
                let offers = |sheet: &tck_world::Factsheet| {
                    let offered = sheet.actions.as_ref();
                    offered.is_none_or(|all| {
                        all.get(name)
                            .is_some_and(|one| one.scopes.iter().any(|scope| scope == "ZONE"))
                    })
                };
                if !name.is_empty() && !sheets.iter().any(|sheet| offers(sheet)) {
                    let text = format!(
                        "zone {id} has action {}, which the vehicle does not offer in zones",
                        quote(name)
                    );
                    found.broken("ZSET-25", text);
                }
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::trace::Trace;

    fn square(id: &str, kind: &str, x: f64, more: &Value) -> Value {
        let corners = [(x, 0.0), (x + 1.0, 0.0), (x + 1.0, 1.0), (x, 1.0)];
        let vertices: Vec<Value> = corners.iter().map(|(x, y)| json!({ "x": x, "y": y })).collect();
        let mut zone = json!({ "zoneId": id, "zoneType": kind, "vertices": vertices });
        json_patch::merge(&mut zone, more);
        zone
    }

    fn set(id: &str, zones: &[Value]) -> Value {
        json!({ "zoneSet": { "mapId": "hall", "zoneSetId": id, "zones": zones } })
    }

    fn zones(zones: &[Value]) -> Vec<String> {
        let mut trace = Trace::master_control_of("3.0");
        trace.commands("zoneSet", &set("z1", zones));
        trace.judge("commands/zone-set-zones").summary()
    }

    fn sheet(kinds: &[&str], limit: u64) -> Value {
        json!({
            "typeSpecification": { "supportedZones": kinds },
            "protocolLimits": { "maximumArrayLengths": { "zoneSet.zones": limit } },
            "protocolFeatures": { "mobileRobotActions": [
                { "actionType": "beep", "actionScopes": ["ZONE"] }, { "actionType": "pick", "actionScopes": ["NODE"] },
            ] },
        })
    }

    fn limits(sheet: &Value, zones: &[Value]) -> Vec<String> {
        let mut trace = Trace::master_control_of("3.0");
        trace.sent("factsheet", sheet).wait(10.0);
        trace.commands("zoneSet", &set("z1", zones));
        trace.judge("commands/zone-set-limits").summary()
    }

    #[test]
    fn good_zones_pass() {
        let directed = json!({ "direction": 0.0, "directedLimitation": "SOFT" });
        let good = [
            square("a", "RELEASE", 0.0, &json!({ "releaseLossBehavior": "STOP" })),
            square("b", "DIRECTED", 3.0, &directed),
            // They touch.
            square("c", "DIRECTED", 4.0, &directed),
            square("d", "BLOCKED", 3.5, &json!({})),
        ];
        assert!(zones(&good).is_empty(), "{:?}", zones(&good));
        assert!(zones(&[]).is_empty());
    }

    #[test]
    fn each_mistake_of_a_zone_is_found() {
        let twice = [
            square("a", "BLOCKED", 0.0, &json!({})),
            square("a", "BLOCKED", 4.0, &json!({})),
        ];
        assert_eq!(zones(&twice), ["ZSET-19"]);
        let mut back = square("a", "BLOCKED", 0.0, &json!({}));
        back["vertices"].as_array_mut().unwrap().reverse();
        assert_eq!(zones(&[back]), ["ZSET-22"]);
        let mut crossed = square("a", "BLOCKED", 0.0, &json!({}));
        crossed["vertices"].as_array_mut().unwrap().swap(1, 2);
        assert_eq!(zones(&[crossed]), ["ZSET-22"]);
        let mut closed = square("a", "BLOCKED", 0.0, &json!({}));
        let first = closed["vertices"][0].clone();
        closed["vertices"].as_array_mut().unwrap().push(first);
        assert_eq!(zones(&[closed]), ["ZSET-22 warning"]);
        let wrong = square("a", "BLOCKED", 0.0, &json!({ "maximumSpeed": 1.0 }));
        assert_eq!(zones(&[wrong]), ["ZSET-20 warning"]);
        let overlapping = [
            square("a", "DIRECTED", 0.0, &json!({})),
            square("b", "BIDIRECTED", 0.5, &json!({})),
        ];
        assert_eq!(zones(&overlapping), ["ZSET-24"]);
    }

    #[test]
    fn an_id_stands_for_one_content() {
        let (one, other) = (
            square("a", "BLOCKED", 0.0, &json!({})),
            square("a", "BLOCKED", 1.0, &json!({})),
        );
        let mut trace = Trace::master_control_of("3.0");
        trace
            .commands("zoneSet", &set("z1", std::slice::from_ref(&one)))
            .wait(1.0);
        trace
            .commands("zoneSet", &set("z1", std::slice::from_ref(&one)))
            .wait(1.0);
        let mut described = set("z1", &[one]);
        described["zoneSet"]["zoneSetDescriptor"] = json!("the hall");
        trace.commands("zoneSet", &described).wait(1.0);
        trace
            .commands("zoneSet", &set("z2", std::slice::from_ref(&other)))
            .wait(1.0);
        assert!(trace.judge("commands/zone-set-ids").summary().is_empty());
        trace.commands("zoneSet", &set("z1", &[other]));
        assert_eq!(trace.judge("commands/zone-set-ids").summary(), ["ZSET-06"]);
    }

    #[test]
    fn a_set_that_another_vehicle_got_is_the_same_set() {
        let (one, other) = (
            square("a", "BLOCKED", 0.0, &json!({})),
            square("a", "BLOCKED", 1.0, &json!({})),
        );
        let mut trace = Trace::master_control_of("3.0");
        trace.other_is_commanded("zoneSet", &set("z1", &[one])).wait(1.0);
        trace.commands("zoneSet", &set("z1", &[other]));
        assert_eq!(trace.judge("commands/zone-set-ids").summary(), ["ZSET-06"]);
    }

    #[test]
    fn what_the_factsheet_does_not_take_is_found() {
        let beep = json!({ "entryActions": [{ "actionType": "beep", "blockingType": "NONE" }] });
        let pick = json!({ "entryActions": [{ "actionType": "pick", "blockingType": "NONE" }] });
        let all = sheet(&["BLOCKED", "ACTION"], 2);
        let good = [
            square("a", "BLOCKED", 0.0, &json!({})),
            square("b", "ACTION", 2.0, &beep),
        ];
        assert!(limits(&all, &good).is_empty(), "{:?}", limits(&all, &good));
        assert_eq!(limits(&all, &[square("a", "ACTION", 0.0, &pick)]), ["ZSET-25"]);
        assert_eq!(limits(&all, &[square("a", "RELEASE", 0.0, &json!({}))]), ["ZSET-25"]);
        assert_eq!(
            limits(&all, &[square("a", "PENALTY", 0.0, &json!({}))]),
            ["ZSET-25 warning"]
        );
        assert_eq!(
            limits(&sheet(&[], 0), &[square("a", "BLOCKED", 0.0, &json!({}))]),
            ["ZSET-25"]
        );
        let three: Vec<Value> = (0..3)
            .map(|at| square(&at.to_string(), "BLOCKED", f64::from(at) * 2.0, &json!({})))
            .collect();
        assert_eq!(limits(&all, &three), ["ZSET-27"]);
        assert!(limits(&sheet(&["BLOCKED"], 0), &three).is_empty(), "0 is no limit");
    }
}
