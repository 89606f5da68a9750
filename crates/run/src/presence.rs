//! Whether the device is there, as far as the harness can see.

use std::time::Duration;

use tck_engine::vehicle::{has_any_open_connection, has_open_connection};
use tck_journal::Entry;
use tck_journal::Vantage;
use tck_journal::event::Event;
use tck_judge::{RunJudge, Sign};
use tck_pack::Role;
use tck_view::{MessageView, Topic};

/// Whether the device is connected, as far as the harness can see.
pub(super) enum Presence {
    There,
    Away,
}

impl Presence {
    pub(super) fn of(judge: &RunJudge, vantage: Vantage) -> Self {
        if judge.program_is_down().is_some() {
            return Self::Away;
        }
        let there = match vantage {
            Vantage::Tap if judge.role() == Role::MasterControl => has_any_open_connection(judge),
            // A master control says nothing by itself, so nobody can tell.
            Vantage::Subscriber if judge.role() == Role::MasterControl => true,
            Vantage::Tap => has_open_connection(judge),
            Vantage::Subscriber => {
                let said = judge.timeline().of("connection").last();
                let fresh = judge
                    .timeline()
                    .of("state")
                    .last()
                    .is_some_and(|entry| !is_stale(entry));
                let there = said.map_or(fresh, |said| is_online(judge, said));
                there && !is_silent(judge)
            }
        };
        if there { Self::There } else { Self::Away }
    }

    pub(super) fn is_there(&self) -> bool {
        matches!(self, Self::There)
    }
}

/// Whether the device says on its own connection topic that it is online. A device that never said anything
/// there is not held to it here: that is for the tests to find.
pub(super) fn says_online(judge: &RunJudge) -> bool {
    let Some(said) = judge.timeline().of("connection").last() else {
        return true;
    };
    is_online(judge, said)
}

/// Whether a connection message says that the device is online.
fn is_online(judge: &RunJudge, said: &Entry) -> bool {
    let message = judge.timeline().view(said, Topic::Connection);
    let message = message.and_then(MessageView::connection);
    message.is_some_and(|message| message.is_online())
}

/// How the device shows without a tap that it is gone.
pub(super) fn gone(judge: &RunJudge) -> Option<String> {
    let timeline = judge.timeline();
    Some(timeline.gone(timeline.last()?.moment)?.to_string())
}

/// Whether the device has said nothing for longer than any may, and than it ever did.
fn is_silent(judge: &RunJudge) -> bool {
    let timeline = judge.timeline();
    let gone = timeline.last().and_then(|last| timeline.gone(last.moment));
    gone.is_some_and(|gone| matches!(gone.sign, Sign::Silent(long, _) if long > SILENT))
}

/// For so long no device may be silent.
const SILENT: Duration = Duration::from_secs(31);

/// Stored by the broker before the run began.
pub(super) fn is_stale(entry: &Entry) -> bool {
    matches!(entry.event(), Event::Message { retain: true, .. })
}
