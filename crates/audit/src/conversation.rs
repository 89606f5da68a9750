//! What a vehicle and its master control say to each other, in order: shown to the judge of each side, and where something
//! is missing between two messages, so that nobody is blamed for a hole in the recording.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::sync::Arc;

use super::AuditContext;
use super::arrived::{Arrived, is_at_rest, timestamp};
use super::continuity::{Continuity, Missing, Step};
use super::result::SideResult;
use super::side::{Apart, Side};
use super::span::Span;
use tck_base::clock::Moment;
use tck_pack::{Pack, Role};
use tck_view::MessageView;

/// What a vehicle and its master control say to each other, in order: shown to the judge of each side, and where
/// something is missing between two messages, so that nobody is blamed for a hole in the recording.
#[derive(Default)]
pub(super) struct Conversation {
    /// The rules, once the version is known.
    pack: Option<Arc<Pack>>,
    sides: Vec<Side>,
    continuity: Continuity,
    /// Whether messages were held against each other before.
    began: bool,
    /// By role: how far the clock of the sender is from that of the recorder.
    clocks: BTreeMap<&'static str, i64>,
}

/// What came out of it.
pub(super) struct Concluded {
    /// The version it was judged by.
    pub protocol: Option<String>,
    pub sides: Vec<SideResult>,
    pub holes: u64,
}

impl Conversation {
    /// The version is known: from here on it is judged.
    pub fn begin(&mut self, pack: Arc<Pack>, sides: Vec<Side>) {
        self.pack = Some(pack);
        self.sides = sides;
    }

    /// The rules it is judged by; `None` before it is.
    pub fn pack(&self) -> Option<&Pack> {
        self.pack.as_deref()
    }

    /// Whether something was found at one of these messages.
    pub fn found_in(&self, messages: &RangeInclusive<u64>) -> bool {
        let mut all = self.sides.iter().flat_map(|side| side.kept.values());
        all.any(|known| messages.contains(&known.message))
    }

    pub fn sides_mut(&mut self) -> impl Iterator<Item = &mut Side> {
        self.sides.iter_mut()
    }

    /// Nothing was seen for a while.
    pub fn interrupted(&mut self, since: Moment, scene: AuditContext<'_>) {
        self.continuity.interrupted();
        for side in &mut self.sides {
            side.broken(since, Missing::Anything, Apart::Missing);
            side.mended(scene, |span| span == Span::Factsheet);
        }
    }

    /// Whether a message follows the last one of its topic by its count.
    pub fn goes_on(&self, name: &str, message: &MessageView) -> bool {
        self.continuity.goes_on(name, message)
    }

    /// Shows a message to both sides.
    pub fn show(&mut self, arrived: &Arrived, scene: AuditContext<'_>) {
        let Some(pack) = self.pack.clone() else { return };
        let Some(rule) = pack.topic(&arrived.name) else { return };
        let publisher = rule.publisher;
        let message = arrived.message(pack.names());
        if !arrived.stale {
            let moment = arrived.at.moment;
            if let Some(since) = self.continuity.crossed(message, moment) {
                let commanding = self.sides.iter_mut().filter(|side| side.role == Role::MasterControl);
                commanding.for_each(|side| side.broken(since, Missing::Knowledge, Apart::Crossed));
            }
            let step = self.continuity.note(&arrived.name, message, moment);
            let begins_anew = arrived.name == "connection";
            for side in &mut self.sides {
                match step {
                    Step::Hole(hole) => side.broken(hole.since, hole.missing, Apart::Missing),
                    // Nobody knows what becomes of a vehicle while it is away.
                    Step::Begins if begins_anew && side.role == Role::MasterControl => {
                        side.broken(arrived.at.moment, Missing::Knowledge, Apart::Connection);
                    }
                    Step::Follows if arrived.name == "state" => side.confirmed(&arrived.name, scene),
                    _ => {}
                }
            }
            // Nothing that was told is taken back.
            if let Some(since) = self
                .continuity
                .restarted_unseen()
                .filter(|since| scene.live && *since == moment)
            {
                for side in &mut self.sides {
                    side.broken(since, Missing::Anything, Apart::Missing);
                }
            }
            // What was sent of an order before is not known: judging begins where none is under way.
            let is_first = step == Step::Begins && !self.began && self.continuity.holes == 0;
            let may_begin = step == Step::Follows || is_first;
            let state = message.and_then(MessageView::state);
            let state = state.filter(|state| may_begin && is_at_rest(state));
            if let Some(state) = state.filter(|_| self.sides.iter().any(|side| !side.is_complete())) {
                self.began = true;
                self.continuity.forget();
                self.continuity.learn(message);
                if is_first {
                    self.continuity.begins_early(state, moment);
                }
                // What one side has forgotten the other one cannot be held to.
                for side in &mut self.sides {
                    side.end(Span::begins_at_rest);
                    side.mended(scene, Span::begins_at_rest);
                }
            }
            for side in &mut self.sides {
                side.mended(scene, |span| span == Span::Factsheet);
            }
        }
        // How far the clocks are apart is not known to be the mistake of the device.
        let word = publisher.word();
        let said = message.and_then(timestamp).filter(|_| !arrived.stale);
        if let Some(said) = said.filter(|_| !self.clocks.contains_key(word)) {
            let apart = said.as_microsecond().saturating_sub(arrived.at.utc.as_microsecond());
            self.clocks.insert(word, apart);
        }
        for side in &mut self.sides {
            let own = side.role == publisher;
            side.messages += u64::from(own);
            let apart = self.clocks.get(word).copied().unwrap_or_default();
            side.observe(arrived, own, apart, scene);
            if own {
                side.note(arrived, scene);
            }
            if own && publisher == Role::Agv && !self.continuity.is_early() {
                side.confirmed(&arrived.name, scene);
            }
        }
    }

    /// What came out. Another conversation may begin.
    pub fn conclude(&mut self, scene: AuditContext<'_>) -> Concluded {
        let Self {
            pack,
            mut sides,
            continuity,
            ..
        } = std::mem::take(self);
        if let Some(since) = continuity.restarted_unseen() {
            for side in &mut sides {
                side.broken(since, Missing::Anything, Apart::Missing);
            }
        }
        let sides = sides.into_iter().filter(|side| side.messages > 0);
        Concluded {
            protocol: pack.map(|pack| pack.version.to_string()),
            sides: sides.map(|side| side.finish(scene)).collect(),
            holes: continuity.holes,
        }
    }
}
