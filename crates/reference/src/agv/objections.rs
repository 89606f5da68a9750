//! What can be wrong with an order, and what it is about (figure 8 and section 6.6.4).

use serde_json::Value;

use super::action_kinds::ActionKind;
use super::order_message::{ActionRequest, Node, Order};
use super::read::Defect;

/// Objection against an order.
#[derive(Clone, Copy)]
pub(crate) enum Objection<'a> {
    /// Nodes and edges do not make a graph (ORD-11).
    Graph(&'a Order, &'a Defect),
    /// A new order does not begin with sequenceId 0.
    Begin,
    /// The ids are those of the order there is, and the content is another one.
    OtherContent,
    /// A new order does not begin with orderUpdateId 0.
    UpdateId,
    /// The orderUpdateId is lower than the current one (ORD-REJ-10).
    Outdated,
    /// The vehicle is in no automatic mode (MODE-02).
    Mode,
    /// Another order is under way (ORD-FLOW-01).
    Busy,
    /// The first node is too far away (ORD-FLOW-04).
    Far,
    /// The order to be updated was cancelled.
    Cancelled,
    /// The update does not begin where the order ends (ORD-FLOW-08, ORD-FLOW-10).
    Joint(&'a Node),
    /// There are too many nodes (ORD-REJ-15).
    Nodes,
    /// A node or an edge has too many actions (ORD-REJ-15).
    Actions,
    /// A field the vehicle has no use for, of an order or of an update (OPT-02).
    Unused(&'a str, bool),
    /// The vehicle does not have the zone set.
    ZoneSet,
    /// The map of a node is not on board; the node's place in the message, and whether it is an update (MAP-08).
    Map(&'a Node, usize, bool),
    /// The map of a node is not enabled; the same (MAP-13).
    DisabledMap(&'a Node, usize, bool),
    /// A node lies far off the floor (ORD-REJ-22).
    Unreachable,
    /// An edge is too low (ORD-MSG-21).
    Height,
    /// An edge cannot be driven with that orientation (ORD-REJ-16).
    Orientation,
    /// One of these actions cannot be performed (ORD-REJ-04).
    Action(Asked<'a>, Lack<'a>),
}

/// An action of an order.
#[derive(Clone, Copy)]
pub(crate) struct Asked<'a> {
    /// The action.
    pub(crate) request: &'a ActionRequest,
    /// Its node or edge is released.
    pub(crate) released: bool,
    /// It belongs to an edge.
    pub(crate) of_edge: bool,
    /// The message is an update.
    pub(crate) update: bool,
}

/// Why an action cannot be performed.
#[derive(Clone, Copy)]
pub(crate) enum Lack<'a> {
    /// Its actionId is in use.
    Id,
    /// The vehicle does not know it.
    Kind,
    /// It is not possible at such a place (ACT-10).
    Scope(&'a ActionKind),
    /// A parameter is wrong.
    Parameter(&'a str),
}

/// Relation of an order to the one the vehicle has, by the rows of figure 8.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Relation {
    /// It was received before.
    Known,
    /// It is a new order.
    New,
    /// It updates the order there is.
    Update,
}

/// An order that is taken over.
pub(crate) struct Adoption<'a> {
    /// The order that is taken over.
    pub(crate) order: &'a mut Order,
    /// As it came.
    pub(crate) message: &'a Value,
    /// It is an update.
    pub(crate) update: bool,
}
