//! The topics of one vehicle by their full names.

use std::collections::BTreeMap;

use tck_pack::{Pack, Role};

use crate::topic::Topic;

/// One topic of a vehicle.
#[derive(Clone, Debug)]
pub(crate) struct Named {
    /// The whole MQTT topic.
    full: String,
    /// The name of it in the pack.
    pub name: String,
    pub topic: Topic,
    /// The side that publishes it.
    pub publisher: Option<Role>,
}

/// The topics of one vehicle.
#[derive(Clone, Debug, Default)]
pub(crate) struct Topics(Vec<Named>);

impl Topics {
    /// Reads full topics by topic name.
    pub fn new(topics: &BTreeMap<String, String>, pack: &Pack) -> Self {
        let all = topics.iter().map(|(name, full)| Named {
            full: full.clone(),
            name: name.clone(),
            topic: Topic::of_name(name),
            publisher: pack.topic(name).map(|rule| rule.publisher),
        });
        Self(all.collect())
    }

    /// The topic with this full name.
    pub fn of(&self, full: &str) -> Option<&Named> {
        self.0.iter().find(|named| named.full == full)
    }
}
