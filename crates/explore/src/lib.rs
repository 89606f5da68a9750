//! Conversations that nobody wrote down: drawn from a grammar, carried out as tests, shrunk to the shortest that still fails.
//!
//! A [`Grammar`] is data (`suites/explore/`): stimuli, the situations in which they may come, and what must be heard
//! afterwards. A [`Chain`] is a list of stimuli that a grammar allows, [`draw`](draw::draw) makes one, [`Chain::file`] writes it as an
//! ordinary test, and [`shrink`](shrink::shrink) makes a failing one shorter. Running and judging tests is left to `run` and `judge`.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod broken;
mod chain;
mod coverage;
pub mod draw;
mod exploration;
mod findings;
mod grammar;
mod model;
pub mod saved;
pub mod shrink;
#[cfg(test)]
mod tests;
mod unfold;
mod writing;

pub use broken::family;
pub use chain::Chain;
pub use coverage::Coverage;
pub use exploration::{Exploration, Explored, Purpose, Round, Shown, Stage};
pub use findings::{Finding, Source, by_cause, findings};
pub use grammar::{Grammar, GrammarError, Stimulus};
pub use model::Model;
pub use writing::ConversationFile;
