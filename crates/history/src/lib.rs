//! What became of every requirement over many runs: which fails since when, which is flaky or fixed, and what changed between.
//!
//! [`gather`] reads a folder of bundles, of runs and of audits, and puts those of one device, role and protocol version into
//! a [`Series`], the earliest first. What cannot be taken for evidence stands in [`History::left_out`] with the reason.
//! A failure is fixed only when what found it has decided again, and found nothing: a run that tests less never looks better.
//! [`text`], [`markdown`] and [`page`] are renderings, pure functions of the history.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod bundles;
mod conditions;
mod course;
mod flaky;
mod header;
pub mod markdown;
pub mod page;
mod seen;
mod series;
pub mod text;
mod words;

pub use bundles::{LeftOut, Why};
pub use conditions::{Change, What};
pub use course::{Course, State};
pub use flaky::Flaky;
pub use seen::Kind;
pub use series::{FORMAT, GatherError, History, Run, Series, gather};
