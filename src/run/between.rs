//! Between two tests: is the device there, is it idle, and how does it get back.

use serde_json::Map;

use super::admission::is_stale;
use super::session::Session;
use crate::bench::Vantage;
use crate::engine::vehicle::{has_any_open_connection, has_open_connection};
use crate::engine::{EngineError, HookOutcome, Operator, Recorder};
use crate::journal::event::{Event, LinkFault};
use crate::judge::RunJudge;
use crate::link::Link;
use crate::pack::Role;
use crate::profile::show_duration;

/// So often a device is switched on before it is given up.
const STARTS: usize = 2;

/// Whether the device is connected, as far as the harness can see.
pub(super) enum Presence {
    There,
    Away,
}

impl Presence {
    pub(super) fn of(judge: &RunJudge, vantage: Vantage) -> Self {
        let there = match vantage {
            Vantage::Tap if judge.role() == Role::MasterControl => has_any_open_connection(judge),
            // A master control says nothing by itself, so nobody can tell.
            Vantage::Subscriber if judge.role() == Role::MasterControl => true,
            Vantage::Tap => has_open_connection(judge),
            Vantage::Subscriber => {
                let said = judge.timeline().of("connection").last();
                let online = judge.ground().pack.word("connection.online");
                let state = said.and_then(|entry| entry.json()?.get("connectionState")?.as_str());
                let fresh = judge
                    .timeline()
                    .of("state")
                    .last()
                    .is_some_and(|entry| !is_stale(entry));
                if said.is_some() { state == online } else { fresh }
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
    let state = said.json().and_then(|message| message.get("connectionState")?.as_str());
    state == judge.ground().pack.word("connection.online")
}

/// Ends link faults that a test has left behind, and waits for the device to come back.
pub(super) async fn settle_link<L: Link, O: Operator>(session: &mut Session<'_, L, O>) -> Result<(), EngineError> {
    let entries = session.engine.recorder.journal().entries();
    let last = entries.iter().rev().find_map(|entry| match entry.event() {
        Event::Fault { fault } => Some(fault.clone()),
        _ => None,
    });
    if matches!(last, None | Some(LinkFault::Restore)) {
        return Ok(());
    }
    session.engine.note(Event::Fault {
        fault: LinkFault::Restore,
    })?;
    session.engine.link.fault(LinkFault::Restore).await?;
    Ok(())
}

/// Waits for a device that is gone, with the help of the `power-cycle` hook if there is one. Gives the
/// reason when it stays away.
pub(super) async fn revive<L: Link, O: Operator>(
    session: &mut Session<'_, L, O>,
) -> Result<Option<String>, EngineError> {
    let vantage = session.setup.capabilities.vantage;
    let there = move |recorder: &Recorder| Presence::of(recorder.judge(), vantage).is_there();
    let has_hook = session.engine.operator.hooks().iter().any(|hook| hook == "power-cycle");
    // A device that comes back by itself is given the chance before it is switched off and on.
    let first = if has_hook {
        session.time("settle")
    } else {
        session.time("reconnect")
    };
    let until = session.engine.link.now().moment + first;
    if session.engine.watch(until, there).await? {
        return Ok(None);
    }
    let why = format!(
        "the device is gone: it did not come back within {}",
        show_duration(session.time("reconnect"))
    );
    if !has_hook {
        return Ok(Some(why));
    }
    let sent = last_sent(&session.engine.recorder);
    let reason = format!("the device is gone and is restarted; the last message it was sent is {sent}");
    Ok(match power_cycle(session, reason).await? {
        Ok(()) => None,
        Err(failed) => Some(format!("{why}, and {failed}")),
    })
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
        if outcome.is_ok() || session.engine.interrupted() {
            break;
        }
    }
    Ok(outcome)
}

async fn off_and_on<L: Link, O: Operator>(session: &mut Session<'_, L, O>) -> Result<Result<(), String>, EngineError> {
    let vantage = session.setup.capabilities.vantage;
    let before = next_seq(&session.engine.recorder);
    match session.engine.hook("power-cycle", Map::new(), true).await? {
        HookOutcome::Done(_) => {}
        HookOutcome::Failed(failed) | HookOutcome::Refused(failed) => {
            return Ok(Err(format!("hook `power-cycle` failed: {failed}")));
        }
        HookOutcome::Missing => return Ok(Err("there is no hook `power-cycle`".to_owned())),
    }
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
    if session.engine.watch(begun + patience, back).await? {
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
    Ok(Err(format!(
        "{missing} within {} after hook `power-cycle`",
        show_duration(waited)
    )))
}

fn next_seq(recorder: &Recorder) -> u64 {
    recorder.journal().entries().last().map_or(0, |entry| entry.seq() + 1)
}

fn last_sent(recorder: &Recorder) -> String {
    let entries = recorder.journal().entries();
    let sent = entries
        .iter()
        .rev()
        .find(|entry| matches!(entry.event(), Event::Sent { .. }));
    sent.map_or_else(|| "none".to_owned(), |entry| format!("#{}", entry.seq()))
}
