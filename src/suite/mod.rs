//! YAML into typed tests, with a source span on everything, linted against the packs.
//!
//! [`model`] is what the rest of the program sees. `syntax` turns text into a spanned tree (the only place
//! that knows the YAML crate), `read` turns the tree into the model, `lint` checks every path, literal,
//! requirement, variable, state and check name. Running a test is left to the engine, judging it to the judge.

pub mod model;

/// All tests and monitors.
#[derive(Debug, Default)]
pub struct Suites {
    /// Tests, by id.
    pub tests: Vec<std::sync::Arc<model::Test>>,
    /// Monitors, by id.
    pub monitors: Vec<std::sync::Arc<model::Monitor>>,
}
