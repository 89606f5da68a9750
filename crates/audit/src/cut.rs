//! A recording that is cut in time: each vehicle by itself, where it is known to be at rest.
//!
//! A stretch is judged as if it were a recording of its own, so that several processes can share the time of one vehicle. Where a
//! vehicle is cut depends on the recording and on the time asked for alone, and not on who judges which stretch.

use std::collections::BTreeMap;
use std::time::Duration;

use super::VEHICLES;
use super::arrived::{is_at_rest, version};
use super::time_stretch::TimeStretch;
use super::topics::Named;
use tck_capture::Message;
use tck_judge::Rules;
use tck_pack::VersionClaim;
use tck_view::{MessageView, Names, Topic};

/// Where a message is in the time of its vehicle.
pub(super) struct Place {
    /// Its stretch.
    pub stretch: TimeStretch,
    /// Whether it is the first one of a stretch that follows another one.
    pub begins: bool,
}

/// The time of one vehicle.
struct Course {
    number: u64,
    begun: Option<jiff::Timestamp>,
    /// The last message of each topic that a broker stores and that later messages rest on, with its number.
    stored: BTreeMap<String, (u64, Message)>,
}

impl Default for Course {
    fn default() -> Self {
        Self {
            number: 1,
            begun: None,
            stored: BTreeMap::new(),
        }
    }
}

/// Cuts the time of vehicles.
pub(super) struct Cutter {
    /// How long a stretch is at least.
    each: Duration,
    vehicles: BTreeMap<String, Course>,
}

impl Cutter {
    pub fn new(each: Duration) -> Self {
        Self {
            each,
            vehicles: BTreeMap::new(),
        }
    }

    /// Where the message of this number is. A stretch ends before the first live state that shows no order and no action under way,
    /// once it is long enough. A message without a time begins none.
    pub fn place(&mut self, named: &Named, number: u64, message: &Message, rules: &Rules) -> Place {
        let is_known = self.vehicles.contains_key(&named.key);
        if !is_known && self.vehicles.len() >= VEHICLES {
            let course = Course::default();
            return course.place(false);
        }
        let course = self.vehicles.entry(named.key.clone()).or_default();
        course.begun = course.begun.or(message.at);
        let is_long = message
            .at
            .zip(course.begun)
            .is_some_and(|(at, begun)| at > begun && at.duration_since(begun).unsigned_abs() >= self.each);
        let topic = Topic::of_name(&named.name);
        let begins = is_long && message.retain != Some(true) && topic == Topic::State && is_resting(message, rules);
        if begins {
            course.number += 1;
            course.begun = message.at;
        }
        if matches!(topic, Topic::Connection | Topic::Factsheet) {
            course.stored.insert(named.name.clone(), (number, message.clone()));
        }
        course.place(begins)
    }

    /// What a broker has stored of a vehicle, as whoever begins to listen at this moment gets it, with the number and the name of
    /// the topic of each.
    pub fn stored(&self, key: &str, now: Option<jiff::Timestamp>) -> Vec<(u64, String, Message)> {
        let stored = self.vehicles.get(key).into_iter().flat_map(|course| &course.stored);
        let all = stored.map(|(name, (number, message))| {
            let stored = Message {
                at: now,
                retain: Some(true),
                after_gap: false,
                ..message.clone()
            };
            (*number, name.clone(), stored)
        });
        let mut all: Vec<(u64, String, Message)> = all.collect();
        all.sort_by_key(|(number, ..)| *number);
        all
    }
}

impl Course {
    fn place(&self, begins: bool) -> Place {
        Place {
            stretch: TimeStretch {
                number: self.number,
                from: self.begun.map(|begun| format!("{begun:.3}")),
            },
            begins,
        }
    }
}

/// Whether a message is a state of a vehicle at rest, in a version that is known.
fn is_resting(message: &Message, rules: &Rules) -> bool {
    let Ok(header) = MessageView::of_slice(Topic::Other, &message.payload, &Names::default()) else {
        return false;
    };
    let Some(said) = version(&header) else { return false };
    let VersionClaim::Known(pack) = rules.packs.said(&said) else {
        return false;
    };
    let state = MessageView::of_slice(Topic::State, &message.payload, pack.names());
    state.is_ok_and(|message| {
        let state = message.state();
        // A state that lacks them shows nothing of what is under way.
        state.is_some_and(|state| state.driving.is(false) && !state.node_states.is_absent() && is_at_rest(state))
    })
}
