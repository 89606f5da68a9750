//! Between two tests: is the device there, is it idle, and how does it get back.

use serde_json::Map;

use super::presence::{Presence, gone, is_stale, says_online};
use super::session::Session;
use tck_engine::{EngineError, HookOutcome, Operator, Recorder};
use tck_journal::Vantage;
use tck_journal::event::{Event, LinkFault};
use tck_net::link::Link;
use tck_pack::{HookEffect, HookInfo};
use tck_profile::show_duration;

/// How often a device is switched on before it is given up.
const STARTS: usize = 2;

impl<L: Link, O: Operator> Session<'_, L, O> {
    /// Ends link faults that a test has left behind, and waits for the device to come back.
    pub(super) async fn settle_link(&mut self) -> Result<(), EngineError> {
        let entries = self.engine.recorder.journal().beside_messages();
        let last = entries.rev().find_map(|entry| match entry.event() {
            Event::Fault { fault } => Some(fault.clone()),
            _ => None,
        });
        if matches!(last, None | Some(LinkFault::Restore)) {
            return Ok(());
        }
        self.engine.note(Event::Fault {
            fault: LinkFault::Restore,
        })?;
        self.engine.link.fault(LinkFault::Restore).await?;
        Ok(())
    }

    /// Waits for a device that is gone, and starts it again if that is possible. Gives the reason when it stays away.
    pub(super) async fn revive(&mut self) -> Result<Option<String>, EngineError> {
        let vantage = self.setup.capabilities.vantage;
        let there = move |recorder: &Recorder| Presence::of(recorder.judge(), vantage).is_there();
        let can_restart = self.can_restart();
        // A device that comes back by itself is given the chance before it is switched off and on.
        let first = if can_restart {
            self.time("settle")
        } else {
            self.time("reconnect")
        };
        // A program that has ended does not come back by itself.
        let down = self.program_is_down();
        let left = gone(self.engine.recorder.judge());
        let until = self.engine.link.now().moment + first;
        if down.is_none() && self.engine.watch(until, there).await? {
            return Ok(None);
        }
        let why = match self.program_is_down() {
            Some(why) => format!("the device is gone: {why}"),
            None => format!(
                "the device is gone: it did not come back within {}{}",
                show_duration(self.time("reconnect")),
                left.map_or_else(String::new, |left| format!("; {left}"))
            ),
        };
        if !can_restart {
            return Ok(Some(why));
        }
        let sent = last_sent(&self.engine.recorder);
        let reason = format!("the device is gone and is restarted; the last message it was sent is {sent}");
        Ok(match power_cycle(self, reason).await? {
            Ok(()) => None,
            Err(failed) => Some(format!("{why}, and {failed}")),
        })
    }
}

impl<L: Link, O: Operator> Session<'_, L, O> {
    /// Lets the device have what it needs after a start. `Err` says what did not work.
    pub(super) async fn after_start(&mut self) -> Result<Result<(), String>, EngineError> {
        self.ready_since = next_seq(&self.engine.recorder);
        let Some(hook) = self.engine.hook_that(HookEffect::PreparesAfterStart) else {
            return Ok(Ok(()));
        };
        Ok(match self.engine.hook(&hook, Map::new(), true).await? {
            HookOutcome::Done(_) | HookOutcome::Missing => Ok(()),
            HookOutcome::Failed(why)
            | HookOutcome::Refused(why)
            | HookOutcome::Skipped(why)
            | HookOutcome::Unanswered(why) => Err(format!("hook `{hook}` failed: {why}")),
        })
    }

    /// Whether a test has started the device since it was last given what it needs after a start.
    pub(super) fn was_started(&self) -> bool {
        let ground = self.engine.recorder.judge().ground();
        let starts = |hook: &str| ground.hooks.find(hook, ground.role).is_some_and(HookInfo::starts);
        let entries = self.engine.recorder.journal().beside_messages().rev();
        let mut since = entries.take_while(|entry| entry.seq() >= self.ready_since);
        since.any(|entry| matches!(entry.event(), Event::Hook { hook, ok: true, .. } if starts(hook)))
    }
}

/// Switches the device off and on by its hook, and waits for the first state of the new connection. A start that takes
/// long is waited for as long as it gets on; one that does not is tried once more. `Err` says what did not work.
pub(super) async fn power_cycle<L: Link, O: Operator>(
    session: &mut Session<'_, L, O>,
    reason: String,
) -> Result<Result<(), String>, EngineError> {
    session.progress.note(&reason);
    session.engine.note(Event::Note { text: reason })?;
    let mut outcome = Err(String::new());
    for attempt in 0..STARTS {
        if attempt > 0 {
            let text = "it is switched off and on once more".to_owned();
            session.progress.note(&text);
            session.engine.note(Event::Note { text })?;
        }
        outcome = off_and_on(session).await?;
        if outcome.is_ok() {
            outcome = session.after_start().await?;
        }
        if outcome.is_ok() || session.engine.interrupted() {
            break;
        }
    }
    Ok(outcome)
}

async fn off_and_on<L: Link, O: Operator>(session: &mut Session<'_, L, O>) -> Result<Result<(), String>, EngineError> {
    let vantage = session.setup.capabilities.vantage;
    let before = next_seq(&session.engine.recorder);
    let by = match session.engine.hook_that(HookEffect::PowerCycles) {
        Some(hook) => match session.engine.hook(&hook, Map::new(), true).await? {
            HookOutcome::Done(_) => format!("hook `{hook}`"),
            HookOutcome::Failed(failed)
            | HookOutcome::Refused(failed)
            | HookOutcome::Skipped(failed)
            | HookOutcome::Unanswered(failed) => {
                return Ok(Err(format!("hook `{hook}` failed: {failed}")));
            }
            HookOutcome::Missing => return Ok(Err(format!("there is no hook `{hook}`"))),
        },
        None => match session.engine.operator.start_program_again().await {
            Ok(()) => "`device.command`".to_owned(),
            Err(failed) => return Ok(Err(failed)),
        },
    };
    // What came until then counts no more: a device that floods the harness may be another one now.
    session.engine.recorder.begin_count_anew();
    let after = next_seq(&session.engine.recorder);
    let on_again = move |recorder: &Recorder| match vantage {
        // What the device still said before it was switched off is not what it says now that it is on again.
        Vantage::Tap => recorder
            .judge()
            .timeline()
            .since("mqtt/connect", before)
            .first()
            .map(|entry| entry.seq()),
        Vantage::Subscriber => Some(after),
    };
    let back = move |recorder: &Recorder| {
        let timeline = recorder.judge().timeline();
        let said = |since| timeline.since("state", since).iter().any(|entry| !is_stale(entry));
        on_again(recorder).is_some_and(said)
            && Presence::of(recorder.judge(), vantage).is_there()
            && says_online(recorder.judge())
    };
    let begun = session.engine.link.now().moment;
    let patience = session.time("connect");
    // A program that has ended again is not waited for.
    let is_down = |recorder: &Recorder| recorder.judge().program_is_down().is_some();
    let is_over = |recorder: &Recorder| is_down(recorder) || back(recorder);
    let came = session.engine.watch(begun + patience, is_over).await?;
    if let Some(why) = session.program_is_down() {
        return Ok(Err(format!("after {by} {why}")));
    }
    if came {
        return Ok(Ok(()));
    }
    // It has connected meanwhile, so it is on its way.
    let is_coming = on_again(&session.engine.recorder).is_some() && vantage == Vantage::Tap;
    if is_coming && !session.engine.interrupted() {
        let text = "it has connected, and is given more time".to_owned();
        session.engine.note(Event::Note { text })?;
        if session.engine.watch(begun + patience * 2, back).await? {
            return Ok(Ok(()));
        }
    }
    let waited = session.engine.link.now().moment.since(begun);
    let missing = if is_coming {
        "it connected but sent no state, or does not say that it is online,"
    } else {
        "it did not come back"
    };
    Ok(Err(format!("{missing} within {} after {by}", show_duration(waited))))
}

fn next_seq(recorder: &Recorder) -> u64 {
    match recorder.journal().last_seq() {
        0 => 0,
        last => last + 1,
    }
}

fn last_sent(recorder: &Recorder) -> String {
    let entries = recorder.journal().entries();
    let sent = entries
        .iter()
        .rev()
        .find(|entry| matches!(entry.event(), Event::Sent { .. }));
    sent.map_or_else(|| "none".to_owned(), |entry| format!("#{}", entry.seq()))
}
