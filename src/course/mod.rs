//! Layouts and courses: the nodes and edges a test may use, mapped onto the real floor.
//!
//! A [`Layout`] is what may be driven; it comes from a LIF file, from a short list in the profile, or is the
//! floor of the reference AGV. [`Layout::assign`] gives the names a test speaks of (a, b, c …) to nodes of it,
//! beginning where the vehicle stands. Building orders from a [`Course`] is left to the engine.

use serde_json::{Map, Value, json};

/// What a test asks of the course.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CourseNeed {
    /// Names of nodes, in order of first use. `a` is where the vehicle stands.
    pub nodes: Vec<String>,
    /// Pairs of names that must be joined by an edge.
    pub edges: Vec<(String, String)>,
}
