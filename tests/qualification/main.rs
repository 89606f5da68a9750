//! What the suites find, on devices with known mistakes: our own with a share of their faults, and those of others.
//!
//! Both are in one program because the one needs the processor and the other mostly waits. What needs the processor
//! stands back (`stand_back`), so that the devices of others are not kept waiting.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a test may fail by panicking"
)]

mod foreign;
mod reference;
#[path = "../seed/mod.rs"]
mod seed;
mod share;

/// The allocator of the program: a qualification is a million small trees.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Everything else on this machine goes before this thread, and before those that it starts.
fn stand_back() {
    #[cfg(unix)]
    let _ = rustix::process::nice(19);
}
