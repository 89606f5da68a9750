//! The terminal: one line per test on standard output, what is awaited on standard error.
//!
//! [`Progress`] is what a run tells; [`Terminal`] shows it, and a [`Prompter`] is where a person is asked. Texts of the device are shown
//! escaped, because they may hold anything. What is told is decided elsewhere.

mod full_screen;
mod heartbeat;
mod hook;
mod keyboard;
mod listing;
mod output;
mod progress;
mod prompt;
mod terminal;
mod watching;

pub use full_screen::FullScreen;
pub use heartbeat::Heartbeat;
pub use hook::hook;
pub use listing::{counterparts, faults, hooks, tolerances, vehicle_words};
pub use output::{Output, escaped};
pub use progress::{Progress, RunTitle, TestLine};
pub use prompt::{Follower, Prompter, put_terminal_back};
pub use terminal::{Terminal, TerminalOptions};
pub use watching::{LineOptions, Lines};
