//! What the picture of a course shows, as data.

use serde::{Deserialize, Serialize};

use crate::clean::{line, short};

/// How long a name may be.
const NAME: usize = 48;

/// What the picture of a course shows, in metres.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct CoursePicture {
    /// The order in hand; empty where none came.
    pub order: String,
    /// Which update of it is drawn.
    pub update: Option<u64>,
    /// Number of the message that it was sent with.
    pub message: Option<u64>,
    /// The map; empty where no message names one.
    pub map: String,
    /// The nodes of the order.
    pub nodes: Vec<Stop>,
    /// The edges of the order that are on this map.
    pub edges: Vec<Stretch>,
    /// Where the vehicle was on this map, the oldest place first.
    pub trail: Vec<(f64, f64)>,
    /// How many places of it come before the worst finding, or are that of it; absent where nothing comes after it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until: Option<usize>,
    /// Whether the vehicle never says where it is, and is drawn at its last nodes.
    pub by_nodes: bool,
    /// At how many places it was on other maps.
    pub elsewhere: usize,
    /// Where it was when something was found, the worst first.
    pub found: Vec<Found>,
    /// How many more findings there are.
    pub further: usize,
}

/// A node of an order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stop {
    /// Its id.
    pub id: String,
    /// Whether it belongs to the base.
    pub released: bool,
    /// Where it is; absent where no order says so, or where it is on another map.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<(f64, f64)>,
}

/// An edge of an order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stretch {
    /// Its id.
    pub id: String,
    /// Whether it belongs to the base.
    pub released: bool,
    /// The way along it; empty where it is not known.
    pub line: Vec<(f64, f64)>,
}

/// Where the vehicle was when something was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// Number of the message that shows it.
    pub number: u64,
    /// What was found there.
    pub what: Vec<String>,
    /// Where the vehicle was; absent where nobody knows, or where it was on another map.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<(f64, f64)>,
    /// Its heading, in radians.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub theta: Option<f64>,
    /// How far it was from the nearest edge of the base.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beside: Option<f64>,
    /// The node it was at last.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub node: String,
    /// Whether it drove.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub driving: Option<bool>,
}

/// A name of a message as it is kept: one line, bounded.
pub(super) fn name(text: &str) -> String {
    short(&line(text), NAME).into_owned()
}

/// A length or an angle to a thousandth, and no zero below zero.
pub(super) fn round(value: f64) -> f64 {
    (value * 1e3).round() / 1e3 + 0.0
}
