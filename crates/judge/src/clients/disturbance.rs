//! For how long what somebody did on the link may show in what is found: the harness, a hook, or a stranger.

use std::collections::VecDeque;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::sync::Arc;
use std::time::Duration;

use tck_base::clock::Moment;
use tck_journal::event::{LinkFault, Payload};

/// For how long what the harness did to the link excuses a device that comes back in another shape.
const AFTER_FAULT: Duration = Duration::from_secs(60);
/// For how long what a hook did excuses a device that comes back in another shape.
const AFTER_HOOK: Duration = Duration::from_secs(150);
/// For how long a message that somebody else has sent in the name of the device may show in what is found.
pub(super) const AFTER_FORGERY: Duration = Duration::from_secs(5);
/// For how long the doing of somebody who took the client id of the device, and threw it out, may show in what is found.
pub(super) const AFTER_TAKEOVER: Duration = Duration::from_secs(60);
/// For how long the doing of somebody who commanded the device may show in what is found.
pub(super) const AFTER_COMMAND: Duration = Duration::from_secs(120);
/// How many messages of strangers are awaited from the broker.
const AWAITED: usize = 20_000;

/// What excuses a device that comes back in another shape, or while its former connection seems open.
#[derive(Debug, Default)]
pub(super) struct ReconnectExcuse {
    until: Option<Moment>,
    /// The harness plays with the link.
    disturbed: bool,
}

impl ReconnectExcuse {
    /// The harness did this to the link.
    pub(super) fn fault(&mut self, fault: &LinkFault, now: Moment) {
        self.disturbed = *fault != LinkFault::Restore;
        self.until = self.until.max(Some(now + AFTER_FAULT));
    }

    /// A hook was run.
    pub(super) fn hook(&mut self, now: Moment) {
        self.until = self.until.max(Some(now + AFTER_HOOK));
    }

    /// Whether the device is excused.
    pub(super) fn holds(&self, now: Moment) -> bool {
        self.disturbed || self.until.is_some_and(|until| now <= until)
    }
}

/// What strangers do to the device and to what is seen of it.
#[derive(Debug, Default)]
pub(super) struct DisturbanceWindow {
    /// What strangers have published and the broker has not delivered yet.
    forged: VecDeque<u64>,
    /// Until when findings may stem from somebody else, and from whom.
    until: Option<(Moment, Arc<str>)>,
}

impl DisturbanceWindow {
    /// Why what is found now may stem from somebody else.
    pub(super) fn at(&self, now: Moment) -> Option<&Arc<str>> {
        let lasting = self.until.as_ref().filter(|(until, _)| now <= *until);
        lasting.map(|(_, why)| why)
    }

    /// Somebody has done something that may show until then.
    pub(super) fn lasts(&mut self, until: Moment, why: String) {
        let until = self.until.as_ref().map_or(until, |(known, _)| until.max(*known));
        self.until = Some((until, why.into()));
    }

    /// A stranger has published something, which the broker will deliver.
    pub(super) fn await_delivery(&mut self, topic: &str, payload: &Payload) {
        if self.forged.len() >= AWAITED {
            self.forged.pop_front();
        }
        self.forged.push_back(trace(topic, payload));
    }

    /// Whether the broker delivers what a stranger has published.
    pub(super) fn is_delivery(&mut self, topic: &str, payload: &Payload) -> bool {
        if self.forged.is_empty() {
            return false;
        }
        let trace = trace(topic, payload);
        let known = self.forged.iter().position(|known| *known == trace);
        known.and_then(|at| self.forged.remove(at)).is_some()
    }
}

/// What tells messages apart.
fn trace(topic: &str, payload: &Payload) -> u64 {
    let mut hasher = DefaultHasher::new();
    topic.hash(&mut hasher);
    payload.bytes().hash(&mut hasher);
    hasher.finish()
}
