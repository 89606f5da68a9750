//! What came out of a connection, for the side of the vehicle that it belongs to.

use std::collections::{BTreeMap, BTreeSet};

use tck_journal::Entry;
use tck_judge::Observed;

/// How many findings wait until the connection is known to be of one vehicle.
const FOUND: usize = 256;

/// What came out of a connection, for the side of the vehicle that it belongs to.
#[derive(Default)]
pub(super) struct Outcome {
    /// What was found, and when.
    pub found: Vec<(Observed, jiff::Timestamp)>,
    /// How much each monitor has judged.
    pub judged: BTreeMap<String, u64>,
    /// Requirements with the monitor that decided them.
    pub decided: BTreeSet<(String, String)>,
}

impl Outcome {
    /// Keeps what was found at an entry.
    pub fn keep(&mut self, found: Vec<Observed>, entry: &Entry) {
        let room = FOUND.saturating_sub(self.found.len());
        let at = entry.at().utc;
        self.found
            .extend(found.into_iter().take(room).map(|observed| (observed, at)));
    }
}
