//! The renderings of a result, held against three sample runs: one that passes, one that fails with a nearest
//! miss, and a partial one in which every string is hostile.
#![allow(clippy::expect_used, clippy::panic, reason = "a test says what it expected")]

mod accessible;
mod certificate;
mod course;
mod foreign;
mod html;
mod json;
mod junit;
mod junit_schema;
mod narrow;
mod picture;
mod samples;
mod side_by_side;
mod text;
