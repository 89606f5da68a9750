//! What is typed on the terminal, without ever waiting for one that is gone.

use std::io::{self, IsTerminal as _};
use std::time::Duration;

use crossterm::event::{self, Event};

/// What was typed within a time; `None` when it was nothing.
///
/// # Errors
/// The terminal is gone or no terminal. A terminal that is gone has no end of events, so nothing is read from it.
pub(super) fn typed(within: Duration) -> io::Result<Option<Event>> {
    is_ready(Duration::ZERO)?;
    // Several keys may have been read at once: those that are left are no longer waiting at the terminal.
    if event::poll(Duration::ZERO)? || (!within.is_zero() && is_ready(within)? && event::poll(Duration::ZERO)?) {
        return event::read().map(Some);
    }
    Ok(None)
}

/// Whether something can be read.
#[cfg(unix)]
fn is_ready(within: Duration) -> io::Result<bool> {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    let input = io::stdin();
    if !input.is_terminal() {
        return Err(gone());
    }
    let mut ready = [PollFd::new(&input, PollFlags::IN)];
    let within = Timespec::try_from(within).map_err(io::Error::other)?;
    match poll(&mut ready, Some(&within)) {
        // A signal came; whoever waits looks again.
        Err(rustix::io::Errno::INTR) => return Ok(false),
        other => other?,
    };
    let what = ready[0].revents();
    if what.intersects(PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL) {
        return Err(gone());
    }
    Ok(what.contains(PollFlags::IN))
}

/// Whether something can be read.
#[cfg(not(unix))]
fn is_ready(within: Duration) -> io::Result<bool> {
    if !io::stdin().is_terminal() {
        return Err(gone());
    }
    event::poll(within)
}

fn gone() -> io::Error {
    io::Error::new(io::ErrorKind::NotConnected, "standard input is no terminal any more")
}
