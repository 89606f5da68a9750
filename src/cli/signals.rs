//! What asks the program to end: Ctrl-C, SIGTERM (as pipelines and containers send it) and SIGHUP (a terminal that is gone).

#[cfg(unix)]
use tokio::signal::unix::{Signal, SignalKind, signal};

use super::problem::Problem;

/// The signals that ask the program to end. From when this exists none of them ends it by itself.
pub(super) struct Signals {
    #[cfg(unix)]
    all: [Signal; 3],
}

impl Signals {
    /// Begins to listen.
    pub(super) fn listen() -> Result<Self, Problem> {
        #[cfg(unix)]
        {
            let on = |kind| {
                signal(kind).map_err(|error| Problem::Environment(format!("cannot listen for signals: {error}")))
            };
            Ok(Self {
                all: [
                    on(SignalKind::interrupt())?,
                    on(SignalKind::terminate())?,
                    on(SignalKind::hangup())?,
                ],
            })
        }
        #[cfg(not(unix))]
        {
            Ok(Self {})
        }
    }

    /// Waits for the next one.
    pub(super) async fn next(&mut self) {
        #[cfg(unix)]
        {
            let [interrupt, terminate, hangup] = &mut self.all;
            tokio::select! {
                _ = interrupt.recv() => {}
                _ = terminate.recv() => {}
                _ = hangup.recv() => {}
            }
        }
        #[cfg(not(unix))]
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
    }
}
