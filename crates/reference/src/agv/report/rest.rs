//! A vehicle at rest: nothing can change before something comes in, so it says the same again under another header.
//!
//! Mock vehicles stand most of the time, and there are thousands of them. What they say then is worded once; what comes out is
//! the same, byte for byte. While somebody at a hook point may do anything otherwise there is no rest.

use bytes::Bytes;
use serde_json::Map;

use crate::agv::Agv;
use crate::{Output, Publication};

/// What a vehicle at rest repeats. The payloads are what stands behind headerId and timestamp.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rest {
    /// Nothing can change before something comes in.
    pub(crate) lasts: bool,
    state: Option<Publication>,
    visualization: Option<Publication>,
}

impl Rest {
    /// The vehicle has come to rest now, or not.
    pub(crate) fn begins(lasts: bool) -> Self {
        Self {
            lasts,
            ..Self::default()
        }
    }
}

impl Agv {
    /// Whether nothing can happen by itself but what is sent by the clock.
    pub(crate) fn comes_to_rest(&self) -> bool {
        let ends = [
            self.motion.end(),
            self.actions.next_end(),
            self.errors.next_end(),
            self.requests.next_end(self.moment()),
            self.lingers_until,
        ];
        self.connection.online
            && !self.motion.is_moving()
            && ends.iter().all(Option::is_none)
            && self.inbox.is_empty()
            && !self.sleep.asleep
            && self.report.is_complete()
            && self.is_left_alone()
    }

    /// Sends what is due by the clock at rest (STATE-02, VIS-02).
    pub(crate) fn repeat(&mut self) {
        let moment = self.moment();
        let interval = self.state_interval();
        if self
            .report
            .last
            .as_ref()
            .is_some_and(|(sent, _)| *sent + interval <= moment)
        {
            self.repeat_state();
        }
        if self.takes_visualization() {
            self.repeat_visualization();
        }
    }

    fn repeat_state(&mut self) {
        let moment = self.moment();
        if let Some(again) = self.rest.state.take() {
            self.publish_again("state", &again);
            self.rest.state = Some(again);
            self.states_sent += 1;
            if let Some((sent, _)) = &mut self.report.last {
                *sent = moment;
            }
            return;
        }
        let before = self.pending.len();
        let body = self.state_picture();
        self.send_state(body, true);
        self.rest.state = self.repeatable("state", before);
        if self.rest.state.is_some()
            && let Some((_, last)) = &mut self.report.last
        {
            // It is the larger part of a vehicle, and can be worded again as long as nothing changes.
            *last = Map::new();
        }
    }

    /// Ends the rest, since something comes in: what was said last is known again.
    pub(crate) fn wake(&mut self) {
        if self.rest.state.is_some() {
            let said = self.state_picture();
            if let Some((_, last)) = &mut self.report.last {
                *last = said;
            }
        }
        self.rest = Rest::default();
    }

    fn repeat_visualization(&mut self) {
        if let Some(again) = self.rest.visualization.take() {
            self.publish_again("visualization", &again);
            self.rest.visualization = Some(again);
            return;
        }
        let before = self.pending.len();
        self.publish_visualization();
        self.rest.visualization = self.repeatable("visualization", before);
    }

    /// The message of a topic name that alone was published since, so that it can be published again.
    fn repeatable(&self, name: &str, before: usize) -> Option<Publication> {
        let [Output::Publish(sent)] = self.pending.get(before..)? else {
            return None;
        };
        let id = self.connection.header_ids.get(name)?.wrapping_sub(1);
        let rest = sent.payload.strip_prefix(self.beginning(id).as_bytes())?;
        Some(Publication {
            payload: Bytes::copy_from_slice(rest),
            ..sent.clone()
        })
    }

    /// Publishes a message of a topic name again, counted and stamped anew.
    fn publish_again(&mut self, name: &'static str, again: &Publication) {
        let next = self.connection.header_ids.entry(name).or_insert(0);
        let id = *next;
        *next = next.wrapping_add(1);
        let mut payload = self.beginning(id).into_bytes();
        payload.extend_from_slice(&again.payload);
        self.pending.push(Output::Publish(Publication {
            payload: payload.into(),
            ..again.clone()
        }));
    }

    /// How a message begins: what differs in its header from that of the one before.
    fn beginning(&self, id: u32) -> String {
        format!("{{\"headerId\":{id},\"timestamp\":\"{:.2}\"", self.now.utc)
    }
}
