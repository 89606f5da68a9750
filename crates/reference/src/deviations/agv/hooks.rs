//! What records are made of: shapes that most deviations have. The others say what they do at each point of the seam
//! ([`Hooks`]).

use std::time::Duration;

use serde_json::{Value, json};

pub(super) use super::memory::{Hooks, Object, holding, keep, plain};
use super::memory::{Worded, worded};

use crate::ConnectOptions;
use crate::agv::Agv;
use crate::agv::action_kinds::Deed;
use crate::agv::actions::{Action, Status};
use crate::agv::book::Stop;
use crate::agv::deeds::Outcome;
use crate::agv::errors::ActiveError;
use crate::agv::order_message::{Edge, Order};
use crate::agv::rejection::{Refusal, Rule};
use crate::agv::seam::{
    Cause, Course, Deviation, Event, Head, Hindrance, Leg, Objection, Outgoing, Permission, Relation, Span,
};
use crate::deviations::words::Words;

macro_rules! parts {
    ($($name:ident $part:ident: $type:ty, $what:literal;)+) => {
        $(#[doc = $what] pub(super) fn $name(change: $type) -> Box<Hooks<()>> {
            worded(Worded::$part(change))
        })+
    };
}

parts! {
    state State: fn(&Agv, &mut Object), "Words its state otherwise.";
    position Position: fn(&Agv, &mut Object), "Words its position otherwise, in states and visualizations.";
    velocity Velocity: fn(&Agv, &mut Object), "Words its velocity otherwise, in states and visualizations.";
    visualization Visualization: fn(&Agv, &mut Object), "Words its visualization otherwise.";
    factsheet Factsheet: fn(&Agv, &mut Object), "Words its factsheet otherwise.";
    node Node: fn(&Agv, &Stop, &mut Object) -> bool, "Words a node state otherwise, or leaves it out.";
    edge Edge: fn(&Agv, &Edge, &mut Object) -> bool, "Words an edge state otherwise, or leaves it out.";
    route Route: fn(&Agv, u32, &mut Object) -> bool, "The same for nodes and edges, told by their sequenceId.";
    action Action: fn(&Agv, &Action, &mut Object) -> bool, "Words an action state otherwise, or leaves it out.";
    error Error: fn(&Agv, &ActiveError, &mut Object), "Words an error otherwise.";
}

/// Words the header otherwise, of the message of a topic name.
pub(super) fn header(change: fn(&mut Agv, Head, &mut Object)) -> Box<Hooks<fn(&mut Agv, Head, &mut Object)>> {
    holding(change).heads(|change, agv, head, header| change(agv, head, header))
}

/// Connects otherwise.
pub(super) fn joining(change: fn(&Agv, &mut ConnectOptions)) -> Box<Hooks<()>> {
    plain().joins(change)
}

/// Words its last will otherwise.
pub(super) fn will(change: fn(&mut Object)) -> Box<dyn Deviation> {
    struct Will(fn(&mut Object));
    impl Deviation for Will {
        fn joins(&mut self, _: &Agv, options: &mut ConnectOptions) {
            if let Some(will) = &mut options.will
                && let Ok(mut words) = serde_json::from_slice(&will.payload)
            {
                (self.0)(&mut words);
                will.payload = Value::Object(words).to_string().into_bytes();
            }
        }
    }
    Box::new(Will(change))
}

/// Sends the messages of a topic otherwise.
pub(super) fn sending(change: fn(&mut Agv, &mut Outgoing)) -> Box<Hooks<fn(&mut Agv, &mut Outgoing)>> {
    holding(change).sends(|change, agv, outgoing| {
        change(agv, outgoing);
        true
    })
}

/// Holds back some messages, told by their topic name and content.
pub(super) fn unsaid(which: fn(&Agv, &str, &Object) -> bool) -> Box<Hooks<fn(&Agv, &str, &Object) -> bool>> {
    holding(which).allows(|which, agv, what, usual| match what {
        Permission::Say(name, body) => usual && !which(agv, name, body),
        _ => usual,
    })
}

/// Reads an order otherwise.
pub(super) fn reading(change: fn(&Agv, &mut Object)) -> Box<dyn Deviation> {
    struct Reading(fn(&Agv, &mut Object));
    impl Deviation for Reading {
        fn reads(&self, agv: &Agv, message: &mut Value) {
            if let Value::Object(order) = message {
                (self.0)(agv, order);
            }
        }
    }
    Box::new(Reading(change))
}

type Refused = fn(&mut Agv, &Value, Rule);

/// Changes something beside refusing an order.
pub(super) fn refusing(then: Refused) -> Box<Hooks<Refused>> {
    holding(then).refuses(|then, agv, message, rule| then(agv, message, rule))
}

type WordingRefusal = fn(&mut Agv, Rule, &Value, &mut ActiveError) -> bool;

/// Words the error of a refused order otherwise, or keeps it to itself.
pub(super) fn refusal(change: WordingRefusal) -> Box<Hooks<WordingRefusal>> {
    holding(change).raises(|change, agv, cause, error| match cause {
        Cause::Refusal(rule, message) => change(agv, rule, message, error),
        _ => true,
    })
}

type Idle = fn(&mut Agv, &mut ActiveError) -> bool;

/// Words the error of a cancelOrder without an order otherwise, or keeps it to itself.
pub(super) fn nothing_to_cancel(change: Idle) -> Box<Hooks<Idle>> {
    holding(change).raises(|change, agv, cause, error| match cause {
        Cause::NothingToCancel => change(agv, error),
        _ => true,
    })
}

type Failure = fn(&mut Agv, &Action, &mut ActiveError) -> bool;

/// Words the error of a failed action otherwise, or keeps it to itself.
pub(super) fn failure(change: Failure) -> Box<Hooks<Failure>> {
    holding(change).raises(|change, agv, cause, error| match cause {
        Cause::Failure(Some(action)) => change(agv, action, error),
        _ => true,
    })
}

type Instead = (Deed, fn(&mut Agv, &Action) -> Option<Outcome>);

/// Does something else than an action asks for.
pub(super) fn instead(deed: Deed, then: fn(&mut Agv, &Action) -> Option<Outcome>) -> Box<Hooks<Instead>> {
    holding((deed, then)).does(|(deed, then), agv, action| match is(action, *deed) {
        true => then(agv, action),
        false => None,
    })
}

type After = (Deed, fn(&mut Agv, &Action, Outcome) -> Outcome);

/// Makes something else of what came of an action.
pub(super) fn after(deed: Deed, then: fn(&mut Agv, &Action, Outcome) -> Outcome) -> Box<Hooks<After>> {
    holding((deed, then)).ends(|(deed, then), agv, action, outcome| match is(action, *deed) {
        true => then(agv, action, outcome),
        false => outcome,
    })
}

type Changing = (Deed, fn(&mut Agv, &Action));

/// Changes something when an action has succeeded.
pub(super) fn succeeded(deed: Deed, then: fn(&mut Agv, &Action)) -> Box<Hooks<Changing>> {
    holding((deed, then)).ends(|(deed, then), agv, action, outcome| {
        if is(action, *deed) && matches!(outcome, Outcome::Done(_)) {
            then(agv, action);
        }
        outcome
    })
}

/// Changes something when an action has failed.
pub(super) fn failed(deed: Deed, then: fn(&mut Agv, &Action)) -> Box<Hooks<Changing>> {
    holding((deed, then)).ends(|(deed, then), agv, action, outcome| {
        if is(action, *deed) && matches!(outcome, Outcome::Failed(_)) {
            then(agv, action);
        }
        outcome
    })
}

/// Says FINISHED of an action that has failed.
pub(super) fn fails_unseen(deed: Deed) -> Box<Hooks<After>> {
    after(deed, |_, _, outcome| match outcome {
        Outcome::Failed(_) => Outcome::Done(None),
        other => other,
    })
}

/// Whether the action is of that kind.
pub(super) fn is(action: &Action, deed: Deed) -> bool {
    action.kind.is_some_and(|kind| kind.deed == deed)
}

/// Does something when something happens.
pub(super) fn when(event: Event, then: fn(&mut Agv)) -> Box<Hooks<(Event, fn(&mut Agv))>> {
    holding((event, then)).happens(|(wanted, then), agv, event| {
        if event == *wanted {
            then(agv);
        }
    })
}

type Allowing = fn(&Agv, Permission<'_>, bool) -> bool;

/// Allows something else.
pub(super) fn allowing(change: Allowing) -> Box<Hooks<Allowing>> {
    holding(change).allows(|change, agv, what, usual| change(agv, what, usual))
}

type Letting = fn(&Agv, Permission<'_>) -> bool;

/// Allows what is not allowed.
pub(super) fn letting(which: Letting) -> Box<Hooks<Letting>> {
    holding(which).allows(|which, agv, what, usual| usual || which(agv, what))
}

/// Does not allow what is allowed.
pub(super) fn forbidding(which: Letting) -> Box<Hooks<Letting>> {
    holding(which).allows(|which, agv, what, usual| usual && !which(agv, what))
}

type Hindered = (Hindrance, fn(&Agv) -> bool);

/// Drives although something forbids that, while something is so.
pub(super) fn drives(against: Hindrance, while_so: fn(&Agv) -> bool) -> Box<Hooks<Hindered>> {
    holding((against, while_so)).allows(|(against, while_so), agv, what, usual| {
        usual || matches!(what, Permission::DriveAgainst(there) if there == *against) && while_so(agv)
    })
}

type Seen = fn(&Agv, Objection<'_>) -> bool;

/// Overlooks something that is wrong with an order.
pub(super) fn overlooking(which: Seen) -> Box<Hooks<Seen>> {
    holding(which).allows(|which, agv, what, usual| match what {
        Permission::Overlook(objection) => usual || which(agv, objection),
        _ => usual,
    })
}

type Objecting = fn(&Agv, &Order, Relation) -> Option<Refusal>;

/// Has an objection that nobody else has.
pub(super) fn objecting(other: Objecting) -> Box<Hooks<Objecting>> {
    holding(other).objects(|other, agv, order, relation| other(agv, order, relation))
}

type Adopting = fn(&mut Agv, &mut Order);

/// Takes an order or an update over otherwise.
pub(super) fn adopting(change: Adopting) -> Box<Hooks<Adopting>> {
    holding(change).adopts(|change, agv, adoption| {
        change(agv, adoption.order);
        true
    })
}

/// Takes an update over otherwise.
pub(super) fn updating(change: Adopting) -> Box<Hooks<Adopting>> {
    holding(change).adopts(|change, agv, adoption| {
        if adoption.update {
            change(agv, adoption.order);
        }
        true
    })
}

type Planning = fn(&Agv, &mut Leg<'_>);

/// Drives a leg otherwise.
pub(super) fn planning(change: Planning) -> Box<Hooks<Planning>> {
    holding(change).plans(|change, agv, leg| change(agv, leg))
}

type Steering = fn(&Agv, &mut Course<'_>);

/// Takes another course.
pub(super) fn steering(change: Steering) -> Box<Hooks<Steering>> {
    holding(change).steers(|change, agv, course| change(agv, course))
}

type Facing = fn(&Agv, &Stop, f64) -> Option<f64>;

/// Takes another orientation on a node than it should.
pub(super) fn facing(change: Facing) -> Box<Hooks<Facing>> {
    holding(change).faces(|change, agv, stop, wanted| wanted.and_then(|theta| change(agv, stop, theta)))
}

type Breaking = fn(&Agv, &Action, Option<Status>) -> Option<Status>;

/// Ends actions otherwise because their order is cancelled.
pub(super) fn breaking(change: Breaking) -> Box<Hooks<Breaking>> {
    holding(change).breaks(|change, agv, action, usual| change(agv, action, usual))
}

type Raising = fn(&mut Agv, Cause<'_>, &mut ActiveError) -> bool;

/// Words errors of all kinds otherwise, or keeps them to itself.
pub(super) fn raising(change: Raising) -> Box<Hooks<Raising>> {
    holding(change).raises(|change, agv, cause, error| change(agv, cause, error))
}

/// Stands still as long as it remembers that.
pub(super) fn parked() -> Box<Hooks<bool>> {
    keep::<bool>().allows(|parked, _, what, usual| usual && !(*parked && matches!(what, Permission::Drive)))
}

/// Drives into the horizon as long as it remembers that.
pub(super) fn unbound() -> Box<Hooks<bool>> {
    keep::<bool>().allows(|unbound, _, what, usual| usual || *unbound && matches!(what, Permission::Enter))
}

/// Drives although it is paused as long as it remembers that.
pub(super) fn heedless() -> Box<Hooks<bool>> {
    keep::<bool>().allows(|heedless, agv, what, usual| {
        usual || *heedless && agv.holds.pause && matches!(what, Permission::DriveAgainst(Hindrance::Hold))
    })
}

/// Knows whether its order was updated.
pub(super) fn since_update() -> Box<Hooks<bool>> {
    keep::<bool>().happens(|updated, _, event| {
        *updated = match event {
            Event::Updated => true,
            Event::Begun => false,
            _ => *updated,
        }
    })
}

/// How long it takes to do what it should not.
pub(super) const MOMENT: Duration = Duration::from_millis(50);

/// As short as something can be that has to be in a state.
pub(super) fn brief(agv: &Agv) -> Duration {
    MOMENT.max(agv.min_state_interval() * 2)
}

/// Stands still for so many milliseconds.
pub(super) fn linger(agv: &mut Agv, millis: u64) {
    agv.lingers_until = Some(agv.moment() + Duration::from_millis(millis));
}

/// Whether its base leads on to another node.
pub(super) fn goes_on(agv: &Agv) -> bool {
    agv.book.nodes.front().is_some_and(|next| next.node.released)
}

/// Whether an action of the order is under way.
pub(super) fn is_acting(agv: &Agv) -> bool {
    agv.actions.iter().any(Action::occupies)
}

/// Whether nothing but a message holds it, so that a message lifts its pause.
pub(super) fn lifts_pause(agv: &Agv) -> bool {
    !agv.pause_blocked && !agv.holds.button && !agv.holds.emergency
}

/// Takes as long as no good vehicle does from one state to the next, while something is so.
pub(super) fn silent(while_so: fn(&Agv) -> bool) -> Box<dyn Deviation> {
    struct Silent(fn(&Agv) -> bool);
    impl Deviation for Silent {
        fn lasts(&self, agv: &Agv, what: Span<'_>, usual: Duration) -> Duration {
            match matches!(what, Span::BetweenStates) && (self.0)(agv) {
                true => Duration::from_secs(45),
                false => usual,
            }
        }
    }
    Box::new(Silent(while_so))
}

/// Changes a number that is there.
pub(super) fn number(words: &mut Object, key: &str, change: fn(f64) -> f64) {
    if let Some(value) = words.get(key).and_then(Value::as_f64) {
        words.set(key, change(value));
    }
}

/// Changes a text that is there.
pub(super) fn text(words: &mut Object, key: &str, change: impl FnOnce(&str) -> String) {
    words.change(key, |value| {
        if let Value::String(text) = value {
            *value = json!(change(text));
        }
    });
}

/// Puts bytes in place of the first occurrence of others.
pub(super) fn replace(text: &mut Vec<u8>, from: &[u8], to: &[u8]) {
    if let Some(at) = text.windows(from.len().max(1)).position(|window| window == from) {
        text.splice(at..at + from.len(), to.iter().copied());
    }
}

/// Whether nothing of the order is left to be driven or done.
pub(super) fn is_done(agv: &Agv) -> bool {
    agv.book.nodes.is_empty() && !agv.actions.order_unfinished()
}
