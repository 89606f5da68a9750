//! A deviation with a memory of its own: functions for the points of the seam where it takes hold.

use std::collections::VecDeque;
use std::time::Duration;

use serde_json::{Map, Value};

use crate::ConnectOptions;
use crate::agv::Agv;
use crate::agv::actions::{Action, Origin, Status};
use crate::agv::book::Stop;
use crate::agv::deeds::Outcome;
use crate::agv::errors::ActiveError;
use crate::agv::order_message::{Edge, Order};
use crate::agv::rejection::{Refusal, Rule};
use crate::agv::report::{Changes, Telling};
use crate::agv::seam::{
    Adoption, Cause, Course, Deviation, Event, Head, Leg, Outgoing, Part, Permission, Relation, Span,
};
use tck_base::clock::Moment;

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
pub(super) enum Worded {
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

/// One that words a part of a message otherwise.
pub(super) fn worded(words: Worded) -> Box<Hooks<()>> {
    let mut hooks = plain();
    hooks.words = Some(words);
    hooks
}

/// One that remembers this.
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
        joins: fn(&Agv, &mut ConnectOptions),
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
