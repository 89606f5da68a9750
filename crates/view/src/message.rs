//! The view of a message of any topic.

use std::sync::Arc;

use serde_json::Value;

use crate::read::{self, Reader};
use crate::{
    ConnectionView, FactsheetView, Header, InstantActionsView, Names, OrderView, Print, ResponsesView, StateView,
    Topic, VisualizationView, ZoneSetView,
};

view! {
    /// A message of a topic that has no view of its own.
    message OtherView as "other" {}
}

/// A message, read once. Whoever keeps it, or a part of it, shares it.
#[derive(Clone, Debug, PartialEq)]
pub enum MessageView {
    /// An order.
    Order(Arc<OrderView>),
    /// Instant actions.
    InstantActions(Arc<InstantActionsView>),
    /// A state.
    State(Arc<StateView>),
    /// A visualization message.
    Visualization(Arc<VisualizationView>),
    /// A connection message.
    Connection(Arc<ConnectionView>),
    /// A factsheet.
    Factsheet(Arc<FactsheetView>),
    /// Responses to requests.
    Responses(Arc<ResponsesView>),
    /// A zone set.
    ZoneSet(Arc<ZoneSetView>),
    /// A message of another topic: its header alone.
    Other(Arc<OtherView>),
}

/// One arm for each topic.
macro_rules! each {
    ($message:expr, $view:ident => $do:expr) => {
        match $message {
            MessageView::Order($view) => $do,
            MessageView::InstantActions($view) => $do,
            MessageView::State($view) => $do,
            MessageView::Visualization($view) => $do,
            MessageView::Connection($view) => $do,
            MessageView::Factsheet($view) => $do,
            MessageView::Responses($view) => $do,
            MessageView::ZoneSet($view) => $do,
            MessageView::Other($view) => $do,
        }
    };
}

/// The view of one topic, where the message is one.
macro_rules! accessor {
    ($(#[$doc:meta])* $name:ident: $topic:ident = $view:ty) => {
        $(#[$doc])*
        #[must_use]
        pub const fn $name(&self) -> Option<&Arc<$view>> {
            match self {
                Self::$topic(view) => Some(view),
                _ => None,
            }
        }
    };
}

impl MessageView {
    /// Reads a message from its parsed JSON.
    #[must_use]
    pub fn of_value(topic: Topic, message: &Value, names: &Names) -> Self {
        // A tree has no syntax that could be wrong.
        Self::read(topic, message, names).unwrap_or_else(|_| Self::empty(topic))
    }

    /// Reads a message from its bytes. Where a member stands twice, the last one counts, but not for fingerprints.
    ///
    /// # Errors
    /// The bytes are not JSON.
    pub fn of_slice(topic: Topic, bytes: &[u8], names: &Names) -> Result<Self, serde_json::Error> {
        let mut deserializer = serde_json::Deserializer::from_slice(bytes);
        let view = Self::read(topic, &mut deserializer, names)?;
        deserializer.end()?;
        Ok(view)
    }

    fn read<'de, D: serde::Deserializer<'de>>(topic: Topic, message: D, names: &Names) -> Result<Self, D::Error> {
        let reader = Reader::new(names);
        Ok(match topic {
            Topic::Order => Self::Order(Arc::new(read::message(message, &reader)?)),
            Topic::InstantActions => Self::InstantActions(Arc::new(read::message(message, &reader)?)),
            Topic::State => Self::State(Arc::new(read::message(message, &reader)?)),
            Topic::Visualization => Self::Visualization(Arc::new(read::message(message, &reader)?)),
            Topic::Connection => Self::Connection(Arc::new(read::message(message, &reader)?)),
            Topic::Factsheet => Self::Factsheet(Arc::new(read::message(message, &reader)?)),
            Topic::Responses => Self::Responses(Arc::new(read::message(message, &reader)?)),
            Topic::ZoneSet => Self::ZoneSet(Arc::new(read::message(message, &reader)?)),
            Topic::Other => Self::Other(Arc::new(read::message(message, &reader)?)),
        })
    }

    /// A message that says nothing.
    fn empty(topic: Topic) -> Self {
        match topic {
            Topic::Order => Self::Order(Arc::default()),
            Topic::InstantActions => Self::InstantActions(Arc::default()),
            Topic::State => Self::State(Arc::default()),
            Topic::Visualization => Self::Visualization(Arc::default()),
            Topic::Connection => Self::Connection(Arc::default()),
            Topic::Factsheet => Self::Factsheet(Arc::default()),
            Topic::Responses => Self::Responses(Arc::default()),
            Topic::ZoneSet => Self::ZoneSet(Arc::default()),
            Topic::Other => Self::Other(Arc::default()),
        }
    }

    /// Which topic it is of.
    #[must_use]
    pub const fn topic(&self) -> Topic {
        match self {
            Self::Order(_) => Topic::Order,
            Self::InstantActions(_) => Topic::InstantActions,
            Self::State(_) => Topic::State,
            Self::Visualization(_) => Topic::Visualization,
            Self::Connection(_) => Topic::Connection,
            Self::Factsheet(_) => Topic::Factsheet,
            Self::Responses(_) => Topic::Responses,
            Self::ZoneSet(_) => Topic::ZoneSet,
            Self::Other(_) => Topic::Other,
        }
    }

    /// Its header.
    #[must_use]
    pub fn header(&self) -> &Header {
        each!(self, view => &view.header)
    }

    /// The fingerprint of all of it.
    #[must_use]
    pub fn print(&self) -> Print {
        each!(self, view => view.print)
    }

    /// The fingerprint of all but headerId and timestamp: the same for a message that is sent again.
    #[must_use]
    pub fn content(&self) -> Print {
        each!(self, view => view.content)
    }

    /// The fingerprint without the header, and of a state without what changes all the time.
    #[must_use]
    pub fn essence(&self) -> Print {
        each!(self, view => view.essence)
    }

    /// Whether it is a JSON object. A view of anything else has no members.
    #[must_use]
    pub fn is_object(&self) -> bool {
        each!(self, view => view.odd.is_none())
    }

    accessor! {
        /// The order, if it is one.
        order: Order = OrderView
    }
    accessor! {
        /// The instant actions, if it is that.
        instant_actions: InstantActions = InstantActionsView
    }
    accessor! {
        /// The state, if it is one.
        state: State = StateView
    }
    accessor! {
        /// The visualization message, if it is one.
        visualization: Visualization = VisualizationView
    }
    accessor! {
        /// The connection message, if it is one.
        connection: Connection = ConnectionView
    }
    accessor! {
        /// The factsheet, if it is one.
        factsheet: Factsheet = FactsheetView
    }
    accessor! {
        /// The responses, if it is that.
        responses: Responses = ResponsesView
    }
    accessor! {
        /// The zone set, if it is one.
        zone_set: ZoneSet = ZoneSetView
    }
}
