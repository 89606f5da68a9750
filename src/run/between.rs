//! Between two tests: is the device there, is it idle, and how does it get back.

use serde_json::{Map, Value};

use super::admission::is_stale;
use super::session::Session;
use crate::engine::{EngineError, HookOutcome, Operator, Recorder};
use crate::journal::event::{Event, LinkFault};
use crate::judge::RunJudge;
use crate::link::{Link, Vantage};
use crate::profile::show_duration;

/// Whether the device is connected, as far as the harness can see.
pub(super) enum Presence {
    There,
    Away,
}

impl Presence {
    pub(super) fn of(judge: &RunJudge, vantage: Vantage) -> Self {
        let there = match vantage {
            Vantage::Tap => {
                let connection = |entry: &crate::journal::Entry| match entry.event() {
                    Event::Packet { connection, .. } | Event::Closed { connection, .. } => Some(*connection),
                    _ => None,
                };
                let last = judge
                    .timeline()
                    .of("mqtt/connect")
                    .last()
                    .and_then(|entry| connection(entry));
                let closed = |number: u64| {
                    judge
                        .timeline()
                        .of("mqtt/closed")
                        .iter()
                        .any(|entry| connection(entry) == Some(number))
                };
                last.is_some_and(|number| !closed(number))
            }
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

/// Whether the last state shows no order and no motion.
pub(super) fn is_idle(judge: &RunJudge) -> bool {
    let Some(state) = judge.timeline().of("state").last().and_then(|entry| entry.json()) else {
        return true;
    };
    let empty = |name: &str| state.get(name).and_then(Value::as_array).is_none_or(Vec::is_empty);
    let driving = state.get("driving").and_then(Value::as_bool).unwrap_or(false);
    empty("nodeStates") && empty("edgeStates") && !driving
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
    let mut why = format!(
        "the device is gone: it did not come back within {}",
        show_duration(session.time("reconnect"))
    );
    if has_hook {
        let sent = last_sent(session.engine.recorder.judge(), &session.engine.recorder);
        session.engine.note(Event::Note {
            text: format!("the device is gone and is restarted; the last message it was sent is {sent}"),
        })?;
        match session.engine.hook("power-cycle", Map::new()).await? {
            HookOutcome::Done(_) => {
                let until = session.engine.link.now().moment + session.time("connect");
                if session.engine.watch(until, there).await? {
                    session.progress.note("the device was restarted and is back");
                    return Ok(None);
                }
            }
            HookOutcome::Failed(failed) => why = format!("{why}, and hook `power-cycle` failed: {failed}"),
            HookOutcome::Missing => {}
        }
    }
    Ok(Some(why))
}

fn last_sent(_judge: &RunJudge, recorder: &Recorder) -> String {
    let sent = recorder
        .journal()
        .entries()
        .iter()
        .rev()
        .find(|entry| matches!(entry.event(), Event::Sent { .. }));
    sent.map_or_else(|| "none".to_owned(), |entry| format!("#{}", entry.seq()))
}

/// Brings a vehicle that was left with an order back to idle by cancelOrder. Gives whether that worked.
pub(super) async fn recover<L: Link, O: Operator>(session: &mut Session<'_, L, O>) -> Result<bool, EngineError> {
    let idle = |recorder: &Recorder| is_idle(recorder.judge());
    let until = session.engine.link.now().moment + session.time("settle");
    if session.engine.watch(until, idle).await? {
        return Ok(true);
    }
    session.engine.note(Event::Note {
        text: "the test has left the vehicle with an order; the harness cancels it".to_owned(),
    })?;
    session.instant_action("cancelOrder").await?;
    let until = session.engine.link.now().moment + session.time("react") + session.time("slow");
    session.engine.watch(until, idle).await
}
