//! By how much the harness itself is late, for want of a processor or for whatever reason.

use std::time::Duration;

use tokio::time::{Instant, sleep_until};

use crate::bench::inbox::Reporter;
use tck_journal::event::{Event, Source};

/// A harness that is late by less is in time.
pub(super) const LAG: Duration = Duration::from_millis(100);
/// How often it looks whether it is late.
const LOOK: Duration = Duration::from_millis(20);

/// So late it was.
pub(super) fn lag_of(late: Duration) -> Event {
    Event::Lag {
        micros: u64::try_from(late.as_micros()).unwrap_or(u64::MAX),
        of: "timer".to_owned(),
    }
}

/// Measures by how much timers of the harness are late.
pub(super) async fn watch_lag(reporter: Reporter) {
    loop {
        let due = Instant::now() + LOOK;
        sleep_until(due).await;
        let late = due.elapsed();
        if late >= LAG {
            reporter.report(Source::Harness, None, lag_of(late)).await;
        }
    }
}
