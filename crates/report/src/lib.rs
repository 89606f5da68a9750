//! The renderings of a result; pure functions, no clock, no network.
//!
//! Everything shown comes from a [`tck_result::RunResult`], the journal it was judged from, and the
//! [`sources::Sources`] it quotes: the same input gives the same bytes. Running tests and judging them is
//! left to others.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod advice;
pub mod allure;
pub mod attestation;
pub mod cases;
pub mod cause;
pub mod certificate;
pub mod clean;
pub mod compare;
pub mod course;
pub mod coverage;
pub mod ctrf;
pub mod cyclonedx;
pub mod findings;
pub mod fleet;
pub mod headline;
pub mod html;
pub mod issues;
pub mod json;
pub mod junit;
pub mod keys;
pub mod known;
pub mod latency;
pub mod manifest;
pub mod markdown;
pub mod markdown_table;
pub mod no_result;
pub mod overview;
pub mod package;
pub mod repeated;
pub mod sequence;
pub mod side_by_side;
pub mod sources;
pub mod statement;
pub mod text;
pub mod time;
pub mod undecided;
