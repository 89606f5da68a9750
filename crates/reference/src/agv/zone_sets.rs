//! The zone sets on board: received, fetched, enabled, deleted (section 6.4.2).
//!
//! A set comes in disabled, and to enable one disables the others of its map. What the text leaves open is done so: a set for
//! a map that is not on board is refused, and so is a set with a zone that cannot be used (the ruling of ZSET-23), with a kind
//! of zone that is not declared (ZSET-26) or with too many zones; an enabled set is in use while an order leads over its map
//! (the ruling of ZSET-16).

use serde_json::{Value, json};

use super::Agv;
use super::action_effect::{Outcome, Problem};
use super::action_kinds::{self, Scope};
use super::actions::Action;
use super::errors::{ActiveError, Life};
use super::hook_points::{Cause, Event, Permission};
use super::read::{Defect, Fields};
use super::zones::{Zone, ZoneKind};

/// At most so many sets are kept.
const MOST_SETS: usize = 50;

/// At most so many zones are in a set (`zoneSet.zones` of the factsheet).
pub(crate) const MOST_ZONES: usize = 100;

/// A zone set on board.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ZoneSet {
    pub(crate) id: String,
    pub(crate) map_id: String,
    pub(crate) enabled: bool,
    pub(crate) zones: Vec<Zone>,
}

impl ZoneSet {
    /// Reads a set, as a message or a file has it.
    pub(crate) fn read(message: &Value) -> Result<Self, Defect> {
        let within = message.get("zoneSet").unwrap_or(message);
        let fields = Fields::open(within, "zoneSet")?;
        let zones = fields.objects("zones")?;
        Ok(Self {
            id: fields.id("zoneSetId")?,
            map_id: fields.id("mapId")?,
            enabled: false,
            zones: zones.iter().map(Zone::read).collect::<Result<_, _>>()?,
        })
    }
}

/// All zone sets on board.
#[derive(Clone, Debug, Default)]
pub(crate) struct ZoneSets {
    pub(crate) all: Vec<ZoneSet>,
}

impl ZoneSets {
    /// The set of that id.
    pub(crate) fn get(&self, id: &str) -> Option<&ZoneSet> {
        self.all.iter().find(|set| set.id == id)
    }

    /// Enables a set, and disables the others of its map (ZSET-10).
    pub(crate) fn enable(&mut self, id: &str) -> bool {
        let Some(map_id) = self.get(id).map(|set| set.map_id.clone()) else {
            return false;
        };
        for set in self.all.iter_mut().filter(|set| set.map_id == map_id) {
            set.enabled = set.id == id;
        }
        true
    }

    /// The array of the state (ZSET-14).
    pub(crate) fn picture(&self) -> Value {
        let all = self.all.iter();
        all.map(|set| {
            let status = if set.enabled { "ENABLED" } else { "DISABLED" };
            json!({ "zoneSetId": set.id, "mapId": set.map_id, "zoneSetStatus": status })
        })
        .collect()
    }
}

/// Why a zone set is not taken over.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Unfit {
    /// It is on board already.
    Duplicate,
    /// It is wrong in itself, or the vehicle cannot keep or use it.
    Unusable(String),
}

impl Agv {
    /// Takes a zoneSet message (ZSET-01).
    pub(crate) fn zone_set_received(&mut self, payload: &[u8]) {
        let too_long = payload.len() > self.config.max_message;
        let message = (!too_long)
            .then(|| serde_json::from_slice::<Value>(payload).ok())
            .flatten();
        let message = message.map(|message| self.understood("zoneSet", message));
        let Some(message) = message else {
            self.zone_set_refused("", &Unfit::Unusable("the message is not JSON or too long".into()));
            return;
        };
        if let Err(unfit) = self.take_zone_set(&message, None) {
            let id = message.pointer("/zoneSet/zoneSetId").and_then(Value::as_str);
            self.zone_set_refused(id.unwrap_or_default(), &unfit);
        }
    }

    /// Stores a zone set, disabled (ZSET-07), if it can be used; of a file that was fetched it has to be the one that was
    /// asked for.
    fn take_zone_set(&mut self, message: &Value, wanted: Option<&str>) -> Result<(), Unfit> {
        let unusable = |reason: &str| Err(Unfit::Unusable(reason.to_owned()));
        let set = ZoneSet::read(message);
        let set = set.map_err(|defect| Unfit::Unusable(format!("{} {}", defect.path, defect.reason)))?;
        if wanted.is_some_and(|wanted| wanted != set.id) {
            return unusable("the file is another zone set");
        }
        let known = self.zone_sets.get(&set.id).is_some();
        if known && !self.allows(Permission::TakeZoneSetAgain, false) {
            return Err(Unfit::Duplicate);
        }
        if !self.maps.on_board(&set.map_id) {
            return unusable("the map of the zone set is not on board");
        }
        if set.zones.len() > MOST_ZONES || self.zone_sets.all.len() >= MOST_SETS {
            return unusable("there is no room for the zone set");
        }
        self.check_zones(&set)?;
        self.zone_sets.all.retain(|other| other.id != set.id);
        self.zone_sets.all.push(set);
        self.happens(Event::ZoneSetStored);
        Ok(())
    }

    /// Whether the vehicle can use every zone of a set.
    fn check_zones(&self, set: &ZoneSet) -> Result<(), Unfit> {
        for (index, zone) in set.zones.iter().enumerate() {
            let unusable = |reason: &str| Err(Unfit::Unusable(format!("zone {}: {reason}", zone.id)));
            if set.zones[..index].iter().any(|other| other.id == zone.id) {
                return unusable("another zone of the set has this id");
            }
            let heeded = self.config.zone_types.contains(zone.kind.literal());
            if !heeded && !self.allows(Permission::TakeZoneUnheeded, false) {
                return unusable("the vehicle does not heed zones of this kind");
            }
            if zone.kind == ZoneKind::Release(None) && !self.allows(Permission::TakeReleaseUnsaid, true) {
                return unusable("it does not say what follows when its release is lost");
            }
            if let ZoneKind::Action { entry, during, exit } = &zone.kind {
                for request in entry.iter().chain(during).chain(exit) {
                    let kind = action_kinds::find(&self.config, &request.action_type);
                    let Some(kind) = kind.filter(|kind| kind.scopes.contains(&Scope::Zone)) else {
                        return unusable("the vehicle does not offer one of its actions in zones");
                    };
                    if action_kinds::refusal(kind, request, &self.config, true).is_some() {
                        return unusable("a parameter of one of its actions is wrong");
                    }
                }
            }
        }
        Ok(())
    }

    /// Says that a zone set was not taken over (ZSET-13, ZSET-23, ZSET-26).
    fn zone_set_refused(&mut self, id: &str, unfit: &Unfit) {
        let names = &self.config.errors;
        let (name, reason) = match unfit {
            Unfit::Duplicate => (&names.duplicate_zone_set, "the zone set is on board already"),
            Unfit::Unusable(reason) => (&names.zone_set, reason.as_str()),
        };
        let references = if id.is_empty() {
            vec![("topic".into(), "zoneSet".into())]
        } else {
            vec![("zoneSetId".into(), id.to_owned())]
        };
        let error = ActiveError {
            error_type: name.clone(),
            fatal: false,
            references,
            description: reason.to_owned(),
            life: Life::Until(self.moment() + self.time_to_notice()),
        };
        self.raise(Cause::ZoneSet, error);
    }

    /// Long enough for several states.
    pub(crate) fn time_to_notice(&self) -> std::time::Duration {
        self.config.error_duration.max(self.config.state_interval * 3)
    }

    /// enableZoneSet (ZSET-10, ZSET-11).
    pub(crate) fn enable_zone_set(&mut self, action: &Action) -> Result<(), Problem> {
        if self.zone_sets.enable(action.text("zoneSetId")) {
            return Ok(());
        }
        Err(Problem::zone_set(action, "the zone set is not on board"))
    }

    /// deleteZoneSet (ZSET-15, ZSET-16).
    pub(crate) fn delete_zone_set(&mut self, action: &Action) -> Result<(), Problem> {
        let id = action.text("zoneSetId");
        let Some(set) = self.zone_sets.get(id) else {
            return Err(Problem::zone_set(action, "the zone set is not on board"));
        };
        let here = self.motion.pose(self.moment()).map_id == set.map_id;
        let ahead = self.order.nodes.iter().any(|stop| stop.place.map_id == set.map_id);
        let used = set.enabled && self.is_occupied() && (here || ahead);
        if self.allows(Permission::KeepZoneSet, used) {
            return Err(Problem::zone_set(action, "the zone set is in use"));
        }
        self.zone_sets.all.retain(|set| set.id != id);
        Ok(())
    }

    /// downloadZoneSet begins (ZSET-17).
    pub(crate) fn begin_zone_set_download(&mut self, action: &Action) -> Outcome {
        let (id, url) = (action.text("zoneSetId"), action.text("zoneSetDownloadLink"));
        let known = self.zone_sets.get(id).is_some();
        if known && !self.allows(Permission::TakeZoneSetAgain, false) {
            return Outcome::Failed(Problem::duplicate_zone_set(action, "the zone set is on board already"));
        }
        let twice = self.is_downloading(|other| other.request.id != action.request.id && other.text("zoneSetId") == id);
        let hindrances = [
            (twice, "the zone set is being downloaded already"),
            (id.is_empty(), "zoneSetId is empty"),
            (
                !(url.starts_with("http://") || url.starts_with("https://")),
                "the link is not HTTP",
            ),
        ];
        match hindrances.iter().find(|(hinders, _)| *hinders) {
            Some((_, reason)) => Outcome::Failed(Problem::zone_set(action, reason)),
            None => self.fetch(&action.request.id, url),
        }
    }

    /// The file of a zone set is there.
    pub(crate) fn zone_set_downloaded(&mut self, action: &Action, file: &[u8]) -> Result<(), Problem> {
        let message = serde_json::from_slice::<Value>(file);
        let Ok(message) = message else {
            return Err(Problem::zone_set(action, "the file is not JSON"));
        };
        let message = self.understood("zoneSet", message);
        let taken = self.take_zone_set(&message, Some(action.text("zoneSetId")));
        taken.map_err(|unfit| match unfit {
            Unfit::Duplicate => Problem::duplicate_zone_set(action, "the zone set is on board already"),
            Unfit::Unusable(reason) => Problem::zone_set(action, &reason),
        })
    }
}
