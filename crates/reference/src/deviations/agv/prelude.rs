//! What records of the vehicle are made of: the words of its hook points, and the shapes that most deviations have.

pub(super) use std::collections::{BTreeMap, BTreeSet, VecDeque};
pub(super) use std::time::Duration;

pub(super) use serde_json::{Value, json};

pub(super) use crate::agv::action_effect::{Outcome, Problem};
pub(super) use crate::agv::action_kinds::Effect;
pub(super) use crate::agv::actions::{Action, Origin, Status};
pub(super) use crate::agv::errors::{ActiveError, Life};
pub(super) use crate::agv::hooks::{
    Adoption, Cause, Course, Deviation, Event, Head, Hindrance, Hooks, Lack, Leg, Object, Objection, Outgoing, Part,
    Permission, Relation, Span,
};
pub(super) use crate::agv::order_message::{Edge, Order};
pub(super) use crate::agv::order_state::Stop;
pub(super) use crate::agv::rejection::{Refusal, Rule};
pub(super) use crate::agv::{Agv, AgvConfig};
pub(super) use crate::deviations::json_edit::JsonEdit;
pub(super) use crate::deviations::record::Record;
pub(super) use tck_base::clock::Moment;

use crate::ConnectOptions;
use crate::hooks::Memory;

/// One that remembers this.
pub(super) fn holding<M>(memory: M) -> Box<Hooks<M>> {
    Hooks::new(Memory::One(memory))
}

/// One that remembers something.
pub(super) fn keep<M: Default>() -> Box<Hooks<M>> {
    holding(M::default())
}

/// One that remembers nothing.
pub(super) fn plain() -> Box<Hooks<()>> {
    keep()
}

type Wording = fn(&Agv, &mut Object);

macro_rules! wordings {
    ($($(#[$doc:meta])* $name:ident $part:ident;)+) => {
        $($(#[$doc])* pub(super) fn $name(change: Wording) -> Box<Hooks<Wording>> {
            holding(change).says(|change, agv, part, words| {
                if let Part::$part = part {
                    change(agv, words);
                }
                true
            })
        })+
    };
}

wordings! {
    /// Words its state otherwise.
    state State;
    /// Words its position otherwise, in states and visualizations.
    position Position;
    /// Words its velocity otherwise, in states and visualizations.
    velocity Velocity;
    /// Words its visualization otherwise.
    visualization Visualization;
    /// Words its factsheet otherwise.
    factsheet Factsheet;
}

type Listing<T> = fn(&Agv, &T, &mut Object) -> bool;

macro_rules! listings {
    ($($(#[$doc:meta])* $name:ident $part:ident $type:ty;)+) => {
        $($(#[$doc])* pub(super) fn $name(change: Listing<$type>) -> Box<Hooks<Listing<$type>>> {
            holding(change).says(|change, agv, part, words| match part {
                Part::$part(one) => change(agv, one, words),
                _ => true,
            })
        })+
    };
}

listings! {
    /// Words a node state otherwise, or leaves it out.
    node Node Stop;
    /// Words an edge state otherwise, or leaves it out.
    edge Edge Edge;
    /// Words an action state otherwise, or leaves it out.
    action Action Action;
}

type Sequenced = fn(&Agv, u32, &mut Object) -> bool;

/// Words a node state or an edge state otherwise, told by its sequenceId, or leaves it out.
pub(super) fn route(change: Sequenced) -> Box<Hooks<Sequenced>> {
    holding(change).says(|change, agv, part, words| match part {
        Part::Node(stop) => change(agv, stop.node.sequence_id, words),
        Part::Edge(edge) => change(agv, edge.sequence_id, words),
        _ => true,
    })
}

type WordingError = fn(&Agv, &ActiveError, &mut Object);

/// Words an error otherwise.
pub(super) fn error(change: WordingError) -> Box<Hooks<WordingError>> {
    holding(change).says(|change, agv, part, words| {
        if let Part::Error(error) = part {
            change(agv, error, words);
        }
        true
    })
}

/// Words the header otherwise, of the message of a topic name.
pub(super) fn header(change: fn(&mut Agv, Head, &mut Object)) -> Box<Hooks<fn(&mut Agv, Head, &mut Object)>> {
    holding(change).heads(|change, agv, head, header| change(agv, head, header))
}

type Joining = fn(&Agv, &mut ConnectOptions);

/// Connects otherwise.
pub(super) fn joining(change: Joining) -> Box<Hooks<Joining>> {
    holding(change).connects(|change, agv, options| change(agv, options))
}

/// Words its last will otherwise.
pub(super) fn will(change: fn(&mut Object)) -> Box<Hooks<fn(&mut Object)>> {
    holding(change).connects(|change, _, options| {
        if let Some(will) = &mut options.will
            && let Ok(mut words) = serde_json::from_slice(&will.payload)
        {
            change(&mut words);
            will.payload = Value::Object(words).to_string().into();
        }
    })
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
pub(super) fn reading(change: Wording) -> Box<Hooks<Wording>> {
    holding(change).reads(|change, agv, message| {
        if let Value::Object(order) = message {
            change(agv, order);
        }
    })
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

type Instead = (Effect, fn(&mut Agv, &Action) -> Option<Outcome>);

/// Does something else than an action asks for.
pub(super) fn instead(effect: Effect, then: fn(&mut Agv, &Action) -> Option<Outcome>) -> Box<Hooks<Instead>> {
    holding((effect, then)).does(|(effect, then), agv, action| match is(action, *effect) {
        true => then(agv, action),
        false => None,
    })
}

type After = (Effect, fn(&mut Agv, &Action, Outcome) -> Outcome);

/// Makes something else of what came of an action.
pub(super) fn after(effect: Effect, then: fn(&mut Agv, &Action, Outcome) -> Outcome) -> Box<Hooks<After>> {
    holding((effect, then)).ends(|(effect, then), agv, action, outcome| match is(action, *effect) {
        true => then(agv, action, outcome),
        false => outcome,
    })
}

type Changing = (Effect, fn(&mut Agv, &Action));

/// Changes something when an action has succeeded.
pub(super) fn succeeded(effect: Effect, then: fn(&mut Agv, &Action)) -> Box<Hooks<Changing>> {
    holding((effect, then)).ends(|(effect, then), agv, action, outcome| {
        if is(action, *effect) && matches!(outcome, Outcome::Done(_)) {
            then(agv, action);
        }
        outcome
    })
}

/// Changes something when an action has failed.
pub(super) fn failed(effect: Effect, then: fn(&mut Agv, &Action)) -> Box<Hooks<Changing>> {
    holding((effect, then)).ends(|(effect, then), agv, action, outcome| {
        if is(action, *effect) && matches!(outcome, Outcome::Failed(_)) {
            then(agv, action);
        }
        outcome
    })
}

/// Says FINISHED of an action that has failed.
pub(super) fn fails_unseen(effect: Effect) -> Box<Hooks<After>> {
    after(effect, |_, _, outcome| match outcome {
        Outcome::Failed(_) => Outcome::Done(None),
        other => other,
    })
}

/// Whether the action is of that kind.
pub(super) fn is(action: &Action, effect: Effect) -> bool {
    action.kind.is_some_and(|kind| kind.effect == effect)
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
    agv.order.nodes.front().is_some_and(|next| next.node.released)
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
pub(super) fn silent(while_so: fn(&Agv) -> bool) -> Box<Hooks<fn(&Agv) -> bool>> {
    holding(while_so).lasts(
        |while_so, agv, what, usual| match matches!(what, Span::BetweenStates) && while_so(agv) {
            true => Duration::from_secs(45),
            false => usual,
        },
    )
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
    agv.order.nodes.is_empty() && !agv.actions.order_unfinished()
}
