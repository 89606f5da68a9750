//! What came to all vehicles of a fleet, for checks that otherwise see one vehicle only.

use std::collections::BTreeMap;
use std::time::Duration;

use tck_base::clock::Moment;
use tck_journal::Entry;
use tck_journal::event::{Direction, Event, Packet};
use tck_view::{MessageView, Names, OrderView, Print, Topic};

/// How many orders are remembered.
const ORDERS: usize = 4096;
/// How many connections are remembered, and how many filters of each.
const LINKS: usize = 64;
const FILTERS: usize = 8192;

/// What came to all vehicles of a fleet. Shown every entry before the checks of any vehicle are.
#[derive(Debug, Default)]
pub struct FleetSeen {
    /// Packets are seen, so that these count and not what is delivered.
    tap: bool,
    /// The last headerId on the topics of a name, with the number of its entry.
    ids: BTreeMap<String, (u64, u32)>,
    /// The headerId before the last entry, whatever vehicle it was for.
    before: Option<(u64, u32)>,
    /// The vehicle that was given an order first.
    owners: BTreeMap<String, usize>,
    /// The zones that came first under the id of a set.
    zone_sets: BTreeMap<String, Print>,
    /// The connections of the device that are open.
    links: BTreeMap<u64, Link>,
}

/// A connection of the device.
#[derive(Debug)]
struct Link {
    /// Nothing was subscribed before it was opened.
    clean: bool,
    filters: Vec<String>,
    /// When something was subscribed last.
    since: Moment,
}

impl FleetSeen {
    /// Learns from an entry that belongs to the topic of that name of a vehicle; `names` are those of its version.
    pub fn note(&mut self, entry: &Entry, vehicle: usize, name: &str, names: &Names) {
        let published = is_published(entry);
        self.tap |= published;
        let delivered = matches!(entry.event(), Event::Message { retain: false, .. });
        if published || (delivered && !self.tap) {
            let message = entry.view(Topic::of_name(name), names);
            let id = message.and_then(|message| message.header().header_id.whole());
            if let Some(id) = id.and_then(|id| u32::try_from(id).ok()) {
                let before = self.ids.insert(name.to_owned(), (entry.seq(), id));
                self.before = before.map(|(_, before)| (entry.seq(), before));
            }
        }
        if delivered
            && name == Topic::Order.as_str()
            && let Some(order) = entry.view(Topic::Order, names).and_then(MessageView::order)
        {
            self.order(order, vehicle);
        }
        if delivered
            && name == Topic::ZoneSet.as_str()
            && let Some(set) = entry.view(Topic::ZoneSet, names).and_then(MessageView::zone_set)
            && let Some(set) = set.zone_set.there()
            && self.zone_sets.len() < ORDERS
        {
            let id = set.zone_set_id.or_empty().to_owned();
            self.zone_sets.entry(id).or_insert(set.essence);
        }
    }

    /// Learns from an entry that belongs to no vehicle.
    pub fn link(&mut self, entry: &Entry) {
        let now = entry.at().moment;
        match entry.event() {
            Event::Packet {
                connection,
                packet: Packet::Connect { clean_session, .. },
            } if self.links.len() < LINKS => {
                let link = Link {
                    clean: *clean_session,
                    filters: Vec::new(),
                    since: now,
                };
                self.links.insert(*connection, link);
            }
            Event::Packet {
                connection,
                packet: Packet::Subscribe { filters, .. },
            } => {
                if let Some(link) = self.links.get_mut(connection) {
                    let room = FILTERS.saturating_sub(link.filters.len());
                    let all = filters.iter().take(room).map(|filter| filter.filter.clone());
                    link.filters.extend(all);
                    link.since = now;
                }
            }
            Event::Closed { connection, .. } => {
                self.links.remove(connection);
            }
            _ => {}
        }
    }

    /// Whether the device hears a topic; `None` where that cannot be known, or may change any moment.
    pub fn hears(&self, topic: &str, now: Moment, settled: Duration) -> Option<bool> {
        let mut links = self.links.values();
        let known = links.all(|link| {
            let room = link.filters.len() < FILTERS;
            link.clean && room && now.since(link.since) >= settled
        });
        let mut filters = self.links.values().flat_map(|link| &link.filters);
        (known && !self.links.is_empty() && self.links.len() < LINKS)
            .then(|| filters.any(|filter| takes(filter, topic)))
    }

    fn order(&mut self, order: &OrderView, vehicle: usize) {
        let Some(id) = order.order_id.text() else { return };
        if self.owners.len() < ORDERS && begins(order) {
            self.owners.entry(id.to_owned()).or_insert(vehicle);
        }
    }

    /// The headerId that came before that of this entry on the topics of the same name of all vehicles.
    pub fn before(&self, seq: u64) -> Option<u32> {
        self.before.filter(|(of, _)| *of == seq).map(|(_, id)| id)
    }

    /// A fingerprint of the zones that came first under the id of a set.
    pub fn zone_set(&self, id: &str) -> Option<Print> {
        self.zone_sets.get(id).copied()
    }

    /// The vehicle that was given an order, by its place in the fleet.
    pub fn owner(&self, order: &str) -> Option<usize> {
        self.owners.get(order).copied()
    }
}

/// Whether an order message begins where orders begin.
fn begins(order: &OrderView) -> bool {
    order.nodes.iter().any(|node| node.sequence_id.whole() == Some(0))
}

/// Whether an entry is a PUBLISH packet of the device.
fn is_published(entry: &Entry) -> bool {
    let publish = matches!(
        entry.event(),
        Event::Packet {
            packet: Packet::Publish { .. },
            ..
        }
    );
    publish && entry.record.direction != Some(Direction::ToDevice)
}

/// Whether a topic filter takes a topic.
#[must_use]
pub fn takes(filter: &str, topic: &str) -> bool {
    // The name of a group comes before the filter of a shared subscription.
    let filter = match filter.strip_prefix("$share/") {
        Some(rest) => rest.split_once('/').map_or(rest, |(_, filter)| filter),
        None => filter,
    };
    let mut levels = topic.split('/');
    for wanted in filter.split('/') {
        match (wanted, levels.next()) {
            ("#", _) => return true,
            ("+", Some(_)) => {}
            (wanted, Some(level)) if wanted == level => {}
            _ => return false,
        }
    }
    levels.next().is_none()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filters_take_what_mqtt_says() {
        for filter in ["#", "a/#", "a/+/c", "a/b/c", "a/b/c/#", "$share/g/a/+/c"] {
            assert!(takes(filter, "a/b/c"), "{filter}");
        }
        for filter in ["a/b", "a/b/c/d", "+", "a/+", "b/#"] {
            assert!(!takes(filter, "a/b/c"), "{filter}");
        }
    }
}
