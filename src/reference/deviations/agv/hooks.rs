//! What records are made of: a memory, and what is done at some points of the seam.

use std::collections::VecDeque;
use std::time::Duration;

use serde_json::{Map, Value, json};

use crate::clock::Moment;
use crate::reference::ConnectOptions;
use crate::reference::agv::Agv;
use crate::reference::agv::action_kinds::Deed;
use crate::reference::agv::actions::{Action, Origin, Status};
use crate::reference::agv::book::Stop;
use crate::reference::agv::deeds::Outcome;
use crate::reference::agv::errors::ActiveError;
use crate::reference::agv::order_message::{Edge, Order};
use crate::reference::agv::rejection::{Refusal, Rule};
use crate::reference::agv::report::{Changes, Telling};
use crate::reference::agv::seam::{
    Adoption, Cause, Course, Deviation, Event, Head, Hindrance, Leg, Objection, Outgoing, Part, Permission, Relation,
    Span,
};
use crate::reference::deviations::words::Words;

/// A part of a message.
pub(super) type Object = Map<String, Value>;

/// A deviation with a memory of its own.
pub(super) struct Hooks<M> {
    memory: M,
    joins: Option<fn(&Agv, &mut ConnectOptions)>,
    heads: Option<fn(&mut M, &mut Agv, Head, &mut Object)>,
    sends: Option<fn(&mut M, &mut Agv, &mut Outgoing) -> bool>,
    writes: Option<fn(&Agv, &Outgoing, &mut Vec<u8>)>,
    allows: Option<fn(&M, &Agv, Permission<'_>, bool) -> bool>,
    lasts: Option<fn(&Agv, Span<'_>, Duration) -> Duration>,
    happens: Option<fn(&mut M, &mut Agv, Event)>,
    words: Option<Worded>,
    refuses: Option<fn(&mut M, &mut Agv, &Value, Rule)>,
    raises: Option<fn(&mut M, &mut Agv, Cause<'_>, &mut ActiveError) -> bool>,
    does: Option<fn(&mut M, &mut Agv, &Action) -> Option<Outcome>>,
    ends: Option<fn(&mut M, &mut Agv, &Action, Outcome) -> Outcome>,
    says: Option<fn(&M, &Agv, Part<'_>, &mut Object) -> bool>,
    hears: Option<fn(&mut M, &mut Agv, &str, &[u8]) -> bool>,
    objects: Option<fn(&M, &Agv, &Order, Relation) -> Option<Refusal>>,
    adopts: Option<fn(&mut M, &mut Agv, &mut Adoption<'_>) -> bool>,
    steers: Option<fn(&M, &Agv, &mut Course<'_>)>,
    plans: Option<fn(&M, &Agv, &mut Leg<'_>)>,
    faces: Option<fn(&M, &Agv, &Stop, Option<f64>) -> Option<f64>>,
    queues: Option<fn(&M, &Agv, Origin, &mut VecDeque<Vec<String>>)>,
    breaks: Option<fn(&M, &Agv, &Action, Option<Status>) -> Option<Status>>,
    due: Option<fn(&M) -> Option<Moment>>,
    tells: Option<fn(&mut M, &mut Agv, Changes, bool) -> Telling>,
}

/// The part of a message that is worded otherwise.
#[derive(Clone, Copy)]
enum Worded {
    State(fn(&Agv, &mut Object)),
    Position(fn(&Agv, &mut Object)),
    Velocity(fn(&Agv, &mut Object)),
    Visualization(fn(&Agv, &mut Object)),
    Factsheet(fn(&Agv, &mut Object)),
    Node(fn(&Agv, &Stop, &mut Object) -> bool),
    Edge(fn(&Agv, &Edge, &mut Object) -> bool),
    Route(fn(&Agv, u32, &mut Object) -> bool),
    Action(fn(&Agv, &Action, &mut Object) -> bool),
    Error(fn(&Agv, &ActiveError, &mut Object)),
}

/// One that remembers something.
pub(super) fn keep<M: Default>() -> Box<Hooks<M>> {
    holding(M::default())
}

/// One that remembers nothing.
pub(super) fn plain() -> Box<Hooks<()>> {
    keep()
}

fn worded(words: Worded) -> Box<Hooks<()>> {
    let mut hooks = plain();
    hooks.words = Some(words);
    hooks
}

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
    let mut hooks = plain();
    hooks.joins = Some(change);
    hooks
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

pub(super) fn holding<M>(memory: M) -> Box<Hooks<M>> {
    Box::new(Hooks {
        memory,
        joins: None,
        heads: None,
        sends: None,
        writes: None,
        allows: None,
        lasts: None,
        happens: None,
        words: None,
        refuses: None,
        raises: None,
        does: None,
        ends: None,
        says: None,
        hears: None,
        objects: None,
        adopts: None,
        steers: None,
        plans: None,
        faces: None,
        queues: None,
        breaks: None,
        due: None,
        tells: None,
    })
}

macro_rules! setters {
    ($($name:ident: $type:ty,)+) => {
        $(pub(super) fn $name(mut self: Box<Self>, hook: $type) -> Box<Self> {
            self.$name = Some(hook);
            self
        })+
    };
}

impl<M> Hooks<M> {
    setters! {
        heads: fn(&mut M, &mut Agv, Head, &mut Object),
        sends: fn(&mut M, &mut Agv, &mut Outgoing) -> bool,
        writes: fn(&Agv, &Outgoing, &mut Vec<u8>),
        allows: fn(&M, &Agv, Permission<'_>, bool) -> bool,
        lasts: fn(&Agv, Span<'_>, Duration) -> Duration,
        happens: fn(&mut M, &mut Agv, Event),
        refuses: fn(&mut M, &mut Agv, &Value, Rule),
        raises: fn(&mut M, &mut Agv, Cause<'_>, &mut ActiveError) -> bool,
        does: fn(&mut M, &mut Agv, &Action) -> Option<Outcome>,
        ends: fn(&mut M, &mut Agv, &Action, Outcome) -> Outcome,
        says: fn(&M, &Agv, Part<'_>, &mut Object) -> bool,
        hears: fn(&mut M, &mut Agv, &str, &[u8]) -> bool,
        objects: fn(&M, &Agv, &Order, Relation) -> Option<Refusal>,
        adopts: fn(&mut M, &mut Agv, &mut Adoption<'_>) -> bool,
        steers: fn(&M, &Agv, &mut Course<'_>),
        plans: fn(&M, &Agv, &mut Leg<'_>),
        faces: fn(&M, &Agv, &Stop, Option<f64>) -> Option<f64>,
        queues: fn(&M, &Agv, Origin, &mut VecDeque<Vec<String>>),
        breaks: fn(&M, &Agv, &Action, Option<Status>) -> Option<Status>,
        due: fn(&M) -> Option<Moment>,
        tells: fn(&mut M, &mut Agv, Changes, bool) -> Telling,
    }
}

impl<M: Send> Deviation for Hooks<M> {
    fn joins(&mut self, agv: &Agv, options: &mut ConnectOptions) {
        if let Some(join) = self.joins {
            join(agv, options);
        }
    }

    fn says(&self, agv: &Agv, part: Part<'_>, words: &mut Object) -> bool {
        match (self.words, part) {
            (Some(Worded::State(change)), Part::State)
            | (Some(Worded::Position(change)), Part::Position)
            | (Some(Worded::Velocity(change)), Part::Velocity)
            | (Some(Worded::Visualization(change)), Part::Visualization)
            | (Some(Worded::Factsheet(change)), Part::Factsheet) => change(agv, words),
            (Some(Worded::Node(change)), Part::Node(stop)) => return change(agv, stop, words),
            (Some(Worded::Edge(change)), Part::Edge(edge)) => return change(agv, edge, words),
            (Some(Worded::Route(change)), Part::Node(stop)) => return change(agv, stop.node.sequence_id, words),
            (Some(Worded::Route(change)), Part::Edge(edge)) => return change(agv, edge.sequence_id, words),
            (Some(Worded::Action(change)), Part::Action(action)) => return change(agv, action, words),
            (Some(Worded::Error(change)), Part::Error(error)) => change(agv, error, words),
            _ => {}
        }
        self.says.is_none_or(|say| say(&self.memory, agv, part, words))
    }

    fn heads(&mut self, agv: &mut Agv, head: Head, header: &mut Object) {
        if let Some(change) = self.heads {
            change(&mut self.memory, agv, head, header);
        }
    }

    fn publishes(&mut self, agv: &mut Agv, outgoing: &mut Outgoing) -> bool {
        self.sends.is_none_or(|send| send(&mut self.memory, agv, outgoing))
    }

    fn writes(&self, agv: &Agv, outgoing: &Outgoing, text: &mut Vec<u8>) {
        if let Some(write) = self.writes {
            write(agv, outgoing, text);
        }
    }

    fn allows(&self, agv: &Agv, what: Permission<'_>, usual: bool) -> bool {
        self.allows.map_or(usual, |allow| allow(&self.memory, agv, what, usual))
    }

    fn lasts(&self, agv: &Agv, what: Span<'_>, usual: Duration) -> Duration {
        self.lasts.map_or(usual, |last| last(agv, what, usual))
    }

    fn hears(&mut self, agv: &mut Agv, name: &str, payload: &[u8]) -> bool {
        self.hears.is_none_or(|hear| hear(&mut self.memory, agv, name, payload))
    }

    fn objects(&self, agv: &Agv, order: &Order, relation: Relation) -> Option<Refusal> {
        self.objects
            .and_then(|object| object(&self.memory, agv, order, relation))
    }

    fn adopts(&mut self, agv: &mut Agv, adoption: &mut Adoption<'_>) -> bool {
        self.adopts.is_none_or(|adopt| adopt(&mut self.memory, agv, adoption))
    }

    fn steers(&self, agv: &Agv, course: &mut Course<'_>) {
        if let Some(steer) = self.steers {
            steer(&self.memory, agv, course);
        }
    }

    fn plans(&self, agv: &Agv, leg: &mut Leg<'_>) {
        if let Some(plan) = self.plans {
            plan(&self.memory, agv, leg);
        }
    }

    fn faces(&self, agv: &Agv, stop: &Stop, wanted: Option<f64>) -> Option<f64> {
        match self.faces {
            Some(face) => face(&self.memory, agv, stop, wanted),
            None => wanted,
        }
    }

    fn queues(&self, agv: &Agv, origin: Origin, phases: &mut VecDeque<Vec<String>>) {
        if let Some(queue) = self.queues {
            queue(&self.memory, agv, origin, phases);
        }
    }

    fn breaks(&self, agv: &Agv, action: &Action, usual: Option<Status>) -> Option<Status> {
        match self.breaks {
            Some(end) => end(&self.memory, agv, action, usual),
            None => usual,
        }
    }

    fn tells(&mut self, agv: &mut Agv, changes: Changes, requested: bool) -> Telling {
        match self.tells {
            Some(tell) => tell(&mut self.memory, agv, changes, requested),
            None => Telling::Now,
        }
    }

    fn due(&self) -> Option<Moment> {
        self.due.and_then(|due| due(&self.memory))
    }

    fn refuses(&mut self, agv: &mut Agv, message: &Value, rule: Rule) {
        if let Some(refuse) = self.refuses {
            refuse(&mut self.memory, agv, message, rule);
        }
    }

    fn raises(&mut self, agv: &mut Agv, cause: Cause<'_>, error: &mut ActiveError) -> bool {
        self.raises
            .is_none_or(|raise| raise(&mut self.memory, agv, cause, error))
    }

    fn does(&mut self, agv: &mut Agv, action: &Action) -> Option<Outcome> {
        self.does.and_then(|does| does(&mut self.memory, agv, action))
    }

    fn ends(&mut self, agv: &mut Agv, action: &Action, outcome: Outcome) -> Outcome {
        match self.ends {
            Some(end) => end(&mut self.memory, agv, action, outcome),
            None => outcome,
        }
    }

    fn happens(&mut self, agv: &mut Agv, event: Event) {
        if let Some(happen) = self.happens {
            happen(&mut self.memory, agv, event);
        }
    }
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
