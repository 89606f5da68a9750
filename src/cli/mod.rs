//! The command line: [`args`] is what can be typed, [`exit`] what a script learns from it.

pub mod args;
pub mod exit;
