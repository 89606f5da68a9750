//! What a vehicle was told and where it was, collected message by message, in a bounded memory.

use std::collections::{BTreeMap, VecDeque};

use super::picture::{CoursePicture, Found, Stretch, name, round};
use super::route::{Places, Route, Spot};
use tck_base::nurbs::Path;
use tck_course::{GivesUp, Trail};
use tck_view::{MessageView, OrderView, Position, StateView};

/// How many maps a vehicle is followed on.
const MAPS: usize = 8;
/// How many findings are shown in one picture.
const FOUND: usize = 9;
/// From here on a vehicle has moved, in metres: what is less may be its localization.
const MOVED: f64 = 0.1;

/// How much is kept of a vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bounds {
    /// Places on each map.
    places: usize,
    /// Messages with orders.
    orders: usize,
}

impl Bounds {
    /// For a test, of which there is one at a time.
    pub const TEST: Self = Self {
        places: 400,
        orders: 32,
    };
    /// For a vehicle of a fleet, all of which are followed at the same time.
    pub const FLEET: Self = Self { places: 100, orders: 2 };
}

/// Something that was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// Number of the message that shows it, or of the last one before it was found.
    pub number: u64,
    /// What was found.
    pub what: String,
}

/// A place of the vehicle.
#[derive(Clone, Debug, PartialEq)]
struct Place {
    spot: Spot,
    theta: Option<f64>,
}

/// What was known of the vehicle at a message.
#[derive(Clone, Debug, Default, PartialEq)]
struct Moment {
    place: Option<Place>,
    /// The order that the vehicle names, by the number of its message.
    order: Option<u64>,
    node: String,
    driving: Option<bool>,
}

/// What a vehicle was told and where it was.
#[derive(Clone, Debug)]
pub struct Driven {
    bounds: Bounds,
    orders: VecDeque<Route>,
    /// The order that the vehicle names.
    order: String,
    nodes: Places,
    /// By map, with the number of the message and the heading.
    trails: BTreeMap<String, Trail<(u64, Option<f64>)>>,
    now: Moment,
    /// Whether it ever says where it is; one that never does is followed by its last nodes.
    has_position: bool,
    has_left: bool,
    watched: BTreeMap<u64, Option<Moment>>,
}

impl Driven {
    /// Nothing is known.
    #[must_use]
    pub fn new(bounds: Bounds) -> Self {
        Self {
            bounds,
            orders: VecDeque::new(),
            order: String::new(),
            nodes: Places::default(),
            trails: BTreeMap::new(),
            now: Moment::default(),
            has_position: false,
            has_left: false,
            watched: BTreeMap::new(),
        }
    }

    /// Keeps exactly what is known at these messages; without this, places are as near as the trail has them.
    #[must_use]
    pub fn watching(mut self, numbers: impl Iterator<Item = u64>) -> Self {
        self.watched = numbers.take(4 * FOUND).map(|number| (number, None)).collect();
        self
    }

    /// Takes in the message of this number, to or from the vehicle; numbers rise.
    pub fn note(&mut self, number: u64, message: &MessageView) {
        for (watched, moment) in &mut self.watched {
            if *watched < number && moment.is_none() {
                *moment = Some(self.now.clone());
            }
        }
        match message {
            MessageView::Order(order) => self.told(number, order),
            MessageView::State(state) => self.says(number, state),
            MessageView::Visualization(seen) => {
                if let Some(place) = seen.position.there().and_then(place) {
                    self.has_position = true;
                    self.is_at(number, place);
                }
            }
            _ => {}
        }
    }

    fn told(&mut self, number: u64, order: &OrderView) {
        let route = Route::after(number, order, self.orders.back(), &mut self.nodes);
        if self.orders.len() >= self.bounds.orders {
            self.orders.pop_front();
        }
        self.orders.push_back(route);
    }

    fn says(&mut self, number: u64, state: &StateView) {
        for (known, said) in [
            (&mut self.order, state.order_id.or_empty()),
            (&mut self.now.node, state.last_node_id.or_empty()),
        ] {
            if *known != said {
                *known = name(said);
            }
        }
        let update = state.order_update_id.whole();
        let mut newest = self.orders.iter_mut().rev();
        let named = newest.find(|route| route.order == self.order && route.update == update);
        self.now.order = named.map(|route| {
            route.named.get_or_insert(number);
            route.message
        });
        self.now.driving = state.driving.flag();
        self.has_left |= self.now.driving == Some(true);
        if let Some(place) = state.position.there().and_then(place) {
            self.has_position = true;
            self.is_at(number, place);
        } else if !self.has_position
            && let Some(spot) = self.nodes.of(&self.now.node)
        {
            let spot = spot.clone();
            self.is_at(number, Place { spot, theta: None });
        }
    }

    fn is_at(&mut self, number: u64, place: Place) {
        let Spot { x, y, map } = &place.spot;
        if let Some(trail) = self.trails.get_mut(map) {
            trail.goes_on(*x, *y, (number, place.theta));
        } else if self.trails.len() < MAPS {
            let mut trail = Trail::new(self.bounds.places, GivesUp::Detail);
            trail.goes_on(*x, *y, (number, place.theta));
            self.trails.insert(map.clone(), trail);
        }
        self.now.place = Some(place);
    }

    /// Whether the vehicle has moved, by its own account.
    #[must_use]
    pub fn has_moved(&self) -> bool {
        let went = |trail: &Trail<(u64, Option<f64>)>| {
            let first = trail.known().next();
            first.is_some_and(|(x, y, _)| trail.known().any(|(to_x, to_y, _)| (to_x - x).hypot(to_y - y) >= MOVED))
        };
        self.has_left || self.trails.len() > 1 || self.trails.values().any(went)
    }

    /// What was known at a message: exactly where it was watched, else as near as the trail has it.
    fn at(&self, number: u64) -> Moment {
        match self.watched.get(&number) {
            Some(Some(moment)) => moment.clone(),
            Some(None) => self.now.clone(),
            None => {
                let places = self.trails.iter().filter_map(|(map, trail)| {
                    let mut known = trail.known().rev();
                    known.find(|(.., (at, _))| *at <= number).map(|place| (map, place))
                });
                let last = places.max_by_key(|(_, (.., (at, _)))| *at);
                Moment {
                    place: last.map(|(map, (x, y, (_, theta)))| Place {
                        spot: Spot {
                            x: *x,
                            y: *y,
                            map: map.clone(),
                        },
                        theta: *theta,
                    }),
                    ..Moment::default()
                }
            }
        }
    }

    /// The order in hand at a message: the one that the vehicle names, or else the last one that was sent before.
    fn order_at(&self, number: u64, moment: &Moment) -> Option<&Route> {
        let mut all = self.orders.iter();
        let named = moment
            .order
            .and_then(|message| all.find(|route| route.message == message));
        let earlier = |at: Option<u64>| at.is_some_and(|at| at <= number);
        let named_before = || self.orders.iter().filter(|route| earlier(route.named));
        let sent_before = || self.orders.iter().rfind(|route| earlier(Some(route.message)));
        // Of many updates only the last are kept.
        named
            .or_else(|| named_before().max_by_key(|route| route.named))
            .or_else(sent_before)
            .or_else(|| self.orders.front())
    }

    /// The picture, with where the vehicle was at these findings, the worst first; its order and its map are those of the
    /// first. `None` where the vehicle did not move or nothing has a place.
    #[must_use]
    pub fn picture(&self, findings: &[Finding]) -> Option<CoursePicture> {
        if !self.has_moved() {
            return None;
        }
        let mut found: Vec<(u64, Vec<String>)> = Vec::new();
        let mut further = 0;
        for finding in findings {
            let known = found.iter().position(|(number, _)| *number == finding.number);
            match known {
                Some(at) => found[at].1.push(finding.what.clone()),
                None if found.len() < FOUND => found.push((finding.number, vec![finding.what.clone()])),
                None => further += 1,
            }
        }
        let first = found.first().map_or(u64::MAX, |(number, _)| *number);
        let moment = self.at(first);
        let route = self.order_at(first, &moment);
        let last = self.now.place.as_ref();
        let on = moment.place.as_ref().or(last).map(|place| place.spot.map.as_str());
        let map = on.or_else(|| route.and_then(Route::map))?.to_owned();
        let edges = route.map_or_else(Vec::new, |route| route.stretches(&map));
        let base: Vec<Path> = edges.iter().filter(|edge| edge.released).map(path).collect();
        let trail = self.trails.get(&map).map_or_else(Vec::new, Trail::places);
        let known = self.trails.get(&map).into_iter().flat_map(Trail::known);
        let until = known.take_while(|(.., (at, _))| *at <= first).count();
        let elsewhere = self.trails.iter().filter(|(on, _)| **on != map);
        Some(CoursePicture {
            order: route.map_or_else(String::new, |route| route.order.clone()),
            update: route.and_then(|route| route.update),
            message: route.map(|route| route.message),
            nodes: route.map_or_else(Vec::new, |route| route.stops(&map)),
            edges,
            until: Some(until).filter(|until| *until < trail.len()),
            trail,
            by_nodes: !self.has_position,
            elsewhere: elsewhere.map(|(_, trail)| trail.known().count()).sum(),
            found: found
                .into_iter()
                .map(|(number, what)| self.found(number, what, &map, &base))
                .collect(),
            further,
            map,
        })
    }

    fn found(&self, number: u64, what: Vec<String>, map: &str, base: &[Path]) -> Found {
        let Moment {
            place, node, driving, ..
        } = self.at(number);
        let here = place.filter(|place| place.spot.map == map);
        let beside = here.as_ref().and_then(|place| {
            let each = base.iter().filter_map(|path| path.beside(place.spot.x, place.spot.y));
            let nearest = each.map(|beside| beside.distance).min_by(f64::total_cmp);
            nearest.map(round)
        });
        Found {
            number,
            what,
            theta: here.as_ref().and_then(|place| place.theta),
            place: here.map(|place| (place.spot.x, place.spot.y)),
            beside,
            node,
            driving,
        }
    }
}

fn path(edge: &Stretch) -> Path {
    Path::through(edge.line.iter().copied())
}

/// Where a vehicle says it is, unless it says that it does not know.
fn place(position: &Position) -> Option<Place> {
    let spot = position.spot().filter(|_| !position.initialized.is(false))?;
    Some(Place {
        spot: Spot {
            x: round(spot.x),
            y: round(spot.y),
            map: name(spot.map_id.as_str()),
        },
        theta: position.theta.float().filter(|theta| theta.abs() < 1e3).map(round),
    })
}
