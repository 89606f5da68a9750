//! Kinds of topics.

use std::fmt;

use crate::Object;

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
        let named = |topic: &Self| topic.as_str() == name;
        Self::KNOWN.into_iter().find(named).unwrap_or(Self::Other)
    }

    /// The kind of object that its messages are.
    #[must_use]
    pub const fn object(self) -> Object {
        match self {
            Self::Order => Object::OrderView,
            Self::InstantActions => Object::InstantActionsView,
            Self::State => Object::StateView,
            Self::Visualization => Object::VisualizationView,
            Self::Connection => Object::ConnectionView,
            Self::Factsheet => Object::FactsheetView,
            Self::Responses => Object::ResponsesView,
            Self::ZoneSet => Object::ZoneSetView,
            Self::Other => Object::OtherView,
        }
    }

    /// The last level of the topic; empty for [`Topic::Other`].
    #[must_use]
    pub const fn as_str(self) -> &'static str {
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
        f.pad(self.as_str())
    }
}
