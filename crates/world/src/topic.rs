//! Kinds of topics.

use std::fmt;

/// Which kind of message a topic carries, as a number rather than a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Topic {
    /// Orders, to the vehicle.
    Order,
    /// Instant actions, to the vehicle.
    InstantActions,
    /// States, from the vehicle.
    State,
    /// Visualization, from the vehicle.
    Visualization,
    /// Connection, from the vehicle or as its last will.
    Connection,
    /// Factsheet, from the vehicle.
    Factsheet,
    /// Responses to requests of a vehicle, to the vehicle; from 3.0 on.
    Responses,
    /// Zone sets, to the vehicle; from 3.0 on.
    ZoneSet,
    /// Whatever else stands in a pack or is said beside the protocol.
    Other,
}

impl Topic {
    /// All kinds but [`Topic::Other`].
    pub const KNOWN: [Self; 8] = [
        Self::Order,
        Self::InstantActions,
        Self::State,
        Self::Visualization,
        Self::Connection,
        Self::Factsheet,
        Self::Responses,
        Self::ZoneSet,
    ];

    /// The kind of a topic by its last level.
    #[must_use]
    pub fn of_name(name: &str) -> Self {
        let named = |topic: &Self| topic.name() == name;
        Self::KNOWN.into_iter().find(named).unwrap_or(Self::Other)
    }

    /// The last level of the topic; empty for [`Topic::Other`].
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Order => "order",
            Self::InstantActions => "instantActions",
            Self::State => "state",
            Self::Visualization => "visualization",
            Self::Connection => "connection",
            Self::Factsheet => "factsheet",
            Self::Responses => "responses",
            Self::ZoneSet => "zoneSet",
            Self::Other => "",
        }
    }

    /// Whether the vehicle publishes it.
    #[must_use]
    pub const fn is_from_vehicle(self) -> bool {
        matches!(
            self,
            Self::State | Self::Visualization | Self::Connection | Self::Factsheet
        )
    }

    /// Whether it is published to the vehicle.
    #[must_use]
    pub const fn is_to_vehicle(self) -> bool {
        matches!(
            self,
            Self::Order | Self::InstantActions | Self::Responses | Self::ZoneSet
        )
    }
}

impl fmt::Display for Topic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
