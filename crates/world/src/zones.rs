//! The zones that hold for a vehicle, and where it is in them.
//!
//! A zone holds between two states that both list its set as ENABLED, on the map of the vehicle. What the vehicle fetched, or
//! was sent in two ways under one id, is not known. A place is as exact as the vehicle says, and not more exact than
//! [`EXACT`]: what reaches less far into a zone than that is not said to be inside.

use std::collections::BTreeMap;

use tck_base::polygon::{Point, Polygon};
use tck_view::{MessageView, Pose, Position, StateView, Topic, Zone};

use crate::observation::Observation;
use crate::outline::outline;

/// Nothing is known more exactly than this, in metres.
pub const EXACT: f64 = 0.1;

/// How many sets, and zones of a set, are kept in mind.
const SETS: usize = 64;
const ZONES: usize = 256;

/// A zone as it was sent.
#[derive(Clone, Debug)]
pub struct KnownZone {
    /// zoneSetId.
    pub set: String,
    /// The zone.
    pub zone: Zone,
    /// Where it is.
    pub area: Polygon,
}

impl KnownZone {
    fn read(set: &str, zone: &Zone) -> Option<Self> {
        let corners = zone.vertices.iter();
        let corners = corners.map(|corner| Some(Point::new(corner.x.float()?, corner.y.float()?)));
        let area = Polygon::new(corners.collect::<Option<Vec<_>>>()?).ok()?;
        Some(Self {
            set: set.to_owned(),
            zone: zone.clone(),
            area,
        })
    }

    /// Whether it is of this type.
    #[must_use]
    pub fn is(&self, zone_type: &str) -> bool {
        self.zone.zone_type.is(zone_type)
    }

    /// Its id, for people.
    #[must_use]
    pub fn name(&self) -> &str {
        self.zone.zone_id.or_empty()
    }
}

#[derive(Clone, Debug)]
struct Known {
    map_id: String,
    zones: Vec<KnownZone>,
    /// It came twice, and not in the same way.
    doubtful: bool,
}

/// Where the vehicle is.
#[derive(Clone, Debug)]
pub struct Place {
    /// Its pose.
    pub pose: Pose,
    /// How far that may be off, in metres.
    pub off: f64,
}

/// The zones that hold, and where the vehicle is.
#[derive(Debug, Default)]
pub struct ZonesSeen {
    sets: BTreeMap<String, Known>,
    outline: Option<Polygon>,
    /// Sets that the last state lists as ENABLED.
    enabled: Vec<String>,
    /// Sets that the last two states list as ENABLED.
    stayed: Vec<String>,
    /// Places of the last two messages that said one, the present one last.
    places: (Option<Place>, Option<Place>),
}

fn enabled(state: &StateView) -> Vec<String> {
    let sets = state.zone_sets.iter().take(SETS);
    let enabled = sets.filter(|set| set.zone_set_status.is("ENABLED"));
    enabled.map(|set| set.zone_set_id.or_empty().to_owned()).collect()
}

impl ZonesSeen {
    /// The zones that hold since the state before, on a map.
    pub fn in_force<'a>(&'a self, map_id: &'a str) -> impl Iterator<Item = &'a KnownZone> + 'a {
        let sets = self.stayed.iter().filter_map(|id| self.sets.get(id));
        let here = sets.filter(move |set| !set.doubtful && set.map_id == map_id);
        here.flat_map(|set| &set.zones)
    }

    /// The zones of a set, in force or not, where it is known what is in it.
    #[must_use]
    pub fn of_set(&self, id: &str) -> Option<&[KnownZone]> {
        let set = self.sets.get(id).filter(|set| !set.doubtful)?;
        Some(&set.zones)
    }

    /// Where the vehicle is, and where it was in the message before.
    #[must_use]
    pub fn places(&self) -> (Option<&Place>, Option<&Place>) {
        (self.places.0.as_ref(), self.places.1.as_ref())
    }

    /// How far the outline of the vehicle reaches into a zone for certain, in metres; negative, how far it is away at least.
    /// `None` where it may be either. A vehicle without an outline is a point.
    #[must_use]
    pub fn reach(&self, zone: &KnownZone, place: &Place) -> Option<f64> {
        let centre = Point::new(place.pose.x, place.pose.y);
        let reach = match &self.outline {
            Some(outline) => outline.at(centre.x, centre.y, place.pose.theta).overlap(&zone.area),
            None => zone.area.depth(centre),
        };
        certain(reach, place)
    }

    /// How far its kinematic centre lies inside a zone for certain, in metres; negative, outside.
    #[must_use]
    pub fn centre(&self, zone: &KnownZone, place: &Place) -> Option<f64> {
        certain(zone.area.depth(Point::new(place.pose.x, place.pose.y)), place)
    }

    /// Whether the outline of the vehicle is known.
    #[must_use]
    pub fn knows_outline(&self) -> bool {
        self.outline.is_some()
    }
}

fn certain(reach: f64, place: &Place) -> Option<f64> {
    let sure = reach.abs() - place.off;
    (sure > 0.0).then(|| sure.copysign(reach))
}

fn place(position: &Position) -> Option<Place> {
    let off = position.deviation_range.float().unwrap_or_default();
    Some(Place {
        pose: position.pose()?,
        off: off.max(EXACT),
    })
}

impl ZonesSeen {
    fn keep(&mut self, view: &MessageView) {
        let MessageView::ZoneSet(message) = view else { return };
        let Some(set) = message.zone_set.there() else { return };
        let (Some(id), Some(map_id)) = (set.zone_set_id.text(), set.map_id.text()) else {
            return;
        };
        let zones: Option<Vec<KnownZone>> = set
            .zones
            .iter()
            .take(ZONES)
            .map(|zone| KnownZone::read(id, zone))
            .collect();
        let new = Known {
            map_id: map_id.to_owned(),
            doubtful: zones.is_none(),
            zones: zones.unwrap_or_default(),
        };
        if let Some(known) = self.sets.get_mut(id) {
            let same = known.map_id == new.map_id
                && known.zones.len() == new.zones.len()
                && known
                    .zones
                    .iter()
                    .zip(&new.zones)
                    .all(|(one, other)| one.zone == other.zone);
            known.doubtful |= !same;
            return;
        }
        if self.sets.len() < SETS {
            self.sets.insert(id.to_owned(), new);
        }
    }

    fn moves_to(&mut self, place: Option<Place>) {
        self.places.0 = std::mem::replace(&mut self.places.1, place);
    }

    /// Learns from the next record.
    pub(crate) fn learn(&mut self, record: &Observation<'_>) {
        if let Some(view) = record.to_vehicle(Topic::ZoneSet) {
            self.keep(view);
        }
        if let Some(sheet) = record.factsheet() {
            self.outline = outline(sheet);
        }
        if let Some(state) = record.state() {
            let now = enabled(state);
            self.stayed = now.iter().filter(|id| self.enabled.contains(id)).cloned().collect();
            self.enabled = now;
            self.moves_to(state.position.there().and_then(place));
        }
        if let Some(seen) = record.visualization() {
            self.moves_to(seen.position.there().and_then(place));
        }
        if record.outside_influence() || record.connects() {
            self.places = (None, None);
        }
    }
}

/// What a record says of the speed of the vehicle, in metres a second.
#[must_use]
pub fn speed(record: &Observation<'_>) -> Option<f64> {
    let velocity = match (record.state(), record.visualization()) {
        (Some(state), _) => state.velocity.there(),
        (None, Some(seen)) => seen.velocity.there(),
        _ => None,
    }?;
    let ahead = velocity.vx.float()?;
    let speed = ahead.hypot(velocity.vy.float().unwrap_or_default());
    (speed < 1e4).then_some(speed)
}

/// Whether a record says where the vehicle is.
#[must_use]
pub fn tells_place(record: &Observation<'_>) -> bool {
    record.state().is_some() || record.visualization().is_some()
}
