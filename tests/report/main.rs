//! The renderings of a result, held against three sample runs: one that passes, one that fails with a nearest
//! miss, and a partial one in which every string is hostile.

mod html;
mod json;
mod junit;
mod picture;
mod samples;
mod text;
