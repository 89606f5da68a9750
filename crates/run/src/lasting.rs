//! Lasting mistakes of a vehicle: what it shows although it stands idle.
//!
//! Nothing that could be true is taken for a mistake: a vehicle that lists nodes to come has an order until it has
//! answered a cancelOrder, and a mode or an emergency stop is believed as long as it is a word of the standard.

use std::collections::BTreeSet;
use std::time::Duration;

use serde_json::{Value, json};

use super::idle::Obstacle;
use tck_base::clock::Moment;
use tck_base::pattern::whole;
use tck_journal::event::{Event, Reading, Waiver};
use tck_judge::RunJudge;
use tck_view::{ActionState, EdgeState, ErrorView, Field, Json, Names, NodeState, SafetyState, StateView};
use tck_world::rest::{is_stopped, may_drive, open_actions, place};

/// Two states of a vehicle that stands are at least so far apart.
const APART: Duration = Duration::from_secs(1);

/// What is known besides the states.
pub(super) struct Idle {
    /// The vehicle has ended a cancelOrder, one way or the other: it has no order.
    pub(super) answered: bool,
    /// Since when it was left alone.
    pub(super) since: Moment,
    /// How long something that is about to end may take.
    pub(super) patience: Duration,
    /// When the last test began.
    pub(super) test: Moment,
}

/// The mistakes that show in the last state, and are not known yet.
pub(super) fn lasting(judge: &RunJudge, obstacles: &[Obstacle], idle: &Idle) -> Vec<Waiver> {
    let mut all = broken_words(judge);
    all.extend(forgotten(judge));
    all.extend(left_over(judge, obstacles, idle));
    let known = &judge.ground().waivers;
    let mut told = BTreeSet::new();
    all.retain(|waiver| !known.contains(waiver) && told.insert(format!("{waiver:?}")));
    all
}

fn waiver(member: impl Into<String>, reading: Reading, about: &[&str], why: impl Into<String>) -> Waiver {
    Waiver {
        member: member.into(),
        reading,
        about: about.iter().map(|id| (*id).to_owned()).collect(),
        why: why.into(),
    }
}

/// What the version of the run calls a member.
fn called(names: &Names, member: Field) -> String {
    names.name(member).unwrap_or_else(|| member.usual_name()).to_owned()
}

/// An object with these members.
fn object<const N: usize>(names: &Names, members: [(Field, Value); N]) -> Value {
    let named = members
        .into_iter()
        .map(|(member, value)| (called(names, member), value));
    Value::Object(named.collect())
}

/// Members that break the schema in a vehicle of which nothing was asked: what they mean is clear.
fn broken_words(judge: &RunJudge) -> Vec<Waiver> {
    let timeline = judge.timeline();
    let names = timeline.names();
    let present = timeline.present("state");
    let both = present.and_then(|entry| Some((entry.json()?, timeline.state(entry)?)));
    let Some((message, state)) = both else {
        return Vec::new();
    };
    let Some(schema) = judge.ground().pack.schema("state") else {
        return Vec::new();
    };
    let findings = schema.findings(message);
    let broken = |member: Field| {
        let member = called(names, member);
        findings.iter().any(|finding| {
            let rest = finding
                .path
                .strip_prefix('/')
                .and_then(|path| path.strip_prefix(&*member));
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
        })
    };
    let mut all = Vec::new();
    let mut read_as = |member: Field, meant: Value, about: &[&str]| {
        let shown = names.raw(message, &[member]).cloned();
        let member = called(names, member);
        let why = match &shown {
            None => format!("`{member}` is missing in its states"),
            Some(shown) => {
                let shown: String = shown.to_string().chars().take(80).collect();
                format!("`{member}` is {shown} in its states, which breaks the schema")
            }
        };
        all.push(waiver(member, Reading::As { shown, meant }, about, why));
    };
    let automatic = judge
        .ground()
        .pack
        .word("operatingMode.automatic")
        .unwrap_or("AUTOMATIC");
    let mode = state.operating_mode.text();
    let unsaid = mode.is_none_or(|mode| mode.eq_ignore_ascii_case(automatic));
    if broken(StateView::operating_mode) && unsaid {
        let about = ["MODE-01", "STATE-01", "STATE-MSG-01", "JSON-01", "JSON-02"];
        read_as(StateView::operating_mode, json!(automatic), &about);
    }
    let stop = state.emergency_stop();
    let stopped = ["AUTOACK", "MANUAL", "REMOTE"];
    let is_stopped = stop.is_some_and(|stop| stopped.iter().any(|word| stop.eq_ignore_ascii_case(word)));
    if broken(StateView::safety_state) && !is_stopped {
        let shown = names.raw(message, &[StateView::safety_state]);
        let mut meant = shown.filter(|shown| shown.is_object()).cloned();
        let meant_state = meant.get_or_insert_with(|| object(names, [(SafetyState::field_violation, json!(false))]));
        meant_state[called(names, SafetyState::emergency_stop)] = json!("NONE");
        let about = ["STATE-MSG-17", "STATE-01", "STATE-MSG-01", "JSON-02"];
        read_as(StateView::safety_state, meant_state.clone(), &about);
    }
    for member in [
        StateView::errors,
        StateView::node_states,
        StateView::edge_states,
        StateView::action_states,
    ] {
        if broken(member) && !state.presence(member).is_something() {
            read_as(member, json!([]), &["STATE-01", "STATE-MSG-01", "ERR-01", "JSON-10"]);
        }
    }
    let about = ["STATE-MSG-08", "STATE-08", "STATE-01"];
    match state.driving.other().and_then(Json::text) {
        Some(word) if word.eq_ignore_ascii_case("false") => {
            read_as(StateView::driving, json!(false), &about);
            let shown = Some(json!(if word == "false" { "true" } else { "True" }));
            let driving = called(names, StateView::driving);
            let why = format!("`{driving}` is a text in its states");
            all.push(waiver(
                driving,
                Reading::As {
                    shown,
                    meant: json!(true),
                },
                &about,
                why,
            ));
        }
        _ if !state.driving.is_there() && broken(StateView::driving) => {
            read_as(StateView::driving, json!(false), &about);
        }
        _ => {}
    }
    all
}

/// What a monitor has found to be forgotten.
fn forgotten(judge: &RunJudge) -> Vec<Waiver> {
    let mut all = Vec::new();
    for (member, requirement) in judge.accused() {
        let names = judge.timeline().names();
        let is = |field: Field| names.name(field) == Some(&*member);
        if is(StateView::order_id) || is(StateView::order_update_id) {
            let why = format!("it forgets its `{member}`, which breaks {requirement}");
            let about = [requirement.as_str(), "ORD-CANCEL-08"];
            all.push(waiver(member, Reading::Kept, &about, why));
        }
    }
    all
}

/// What is left of orders and actions that are over.
fn left_over(judge: &RunJudge, obstacles: &[Obstacle], idle: &Idle) -> Vec<Waiver> {
    let Some(state) = judge.state() else { return Vec::new() };
    let names = judge.timeline().names();
    let mut all = Vec::new();
    if obstacles.contains(&Obstacle::Order) {
        for (list, sequence, about) in [
            (StateView::node_states, NodeState::sequence_id, "NODE-03"),
            (StateView::edge_states, EdgeState::sequence_id, "NODE-05"),
        ] {
            let about = ["STATE-12", "STATE-13", about, "ORD-CANCEL-09", "ORD-CANCEL-11"];
            all.extend(passed(judge, idle.answered, list, sequence, &about));
        }
    }
    if (obstacles.contains(&Obstacle::Driving) && stays(judge, idle)) || stood_driving(judge, idle.test) {
        let about = ["STATE-MSG-08", "STATE-08", "ORD-UPD-01"];
        let why = "it says that it drives while it stands";
        all.push(waiver(
            called(names, StateView::driving),
            Reading::Standing,
            &about,
            why,
        ));
    }
    let open: Vec<&ActionState> = open_actions(&state).collect();
    let is_own = |action: &&ActionState| {
        let id = action.action_id.text();
        !is_known_to_go_on(judge, action) || id.is_some_and(|id| instant(judge, id).is_some())
    };
    // What an order began may really be under way, as long as cancelOrder waits for it.
    if idle.answered || open.iter().all(is_own) {
        all.extend(open.into_iter().flat_map(|action| unfinished(judge, action)));
    }
    if !obstacles
        .iter()
        .any(|obstacle| matches!(obstacle, Obstacle::Mode(_) | Obstacle::EmergencyStop))
    {
        for obstacle in obstacles {
            let Obstacle::Fatal(kind) = obstacle else { continue };
            if shows_error(&state, kind) && accepts_orders(judge, kind) {
                let members = [
                    (ErrorView::error_level, json!("FATAL")),
                    (ErrorView::error_type, json!(kind)),
                ];
                let reading = Reading::Without {
                    like: object(names, members),
                };
                let why = format!("it keeps the FATAL error {kind:?}, and takes orders all the same");
                let member = called(names, StateView::errors);
                all.push(waiver(member, reading, &["ERR-01", "ERR-04"], why));
            }
        }
    }
    all
}

/// Nodes or edges that are listed after they were left; of an order that is over, those that were still to come.
fn passed(judge: &RunJudge, answered: bool, list: Field, sequence: Field, about: &[&str]) -> Vec<Waiver> {
    let names = judge.timeline().names();
    let Some(state) = judge.state_json() else {
        return Vec::new();
    };
    let last = names.raw(&state, &[StateView::last_node_sequence_id]).and_then(whole);
    let elements = names.raw_elements(&state, list).iter();
    let (behind, ahead): (Vec<&Value>, Vec<&Value>) = elements.partition(|element| {
        let at = names.raw(element, &[sequence]).and_then(whole);
        at.zip(last).is_some_and(|(at, last)| at <= last)
    });
    let member = called(names, list);
    let mut all = Vec::new();
    if !behind.is_empty() {
        let why = format!("it keeps in its `{member}` what lies behind it");
        all.push(waiver(&*member, Reading::Passed, about, why));
    }
    // Nodes to come are an order, unless the vehicle says that there is none.
    for element in ahead.into_iter().filter(|_| answered).take(16) {
        let why = format!("it keeps in its `{member}` what was left of an order that is cancelled");
        let like = element.clone();
        all.push(waiver(&*member, Reading::Without { like }, about, why));
    }
    all
}

/// An action that does not end although nothing goes on: an instant action of ours by its type, any other by its id.
fn unfinished(judge: &RunJudge, action: &ActionState) -> Vec<Waiver> {
    let names = judge.timeline().names();
    let Some(id) = action.action_id.text() else {
        return Vec::new();
    };
    let status = action.action_status.text();
    let shown: String = status.unwrap_or("nothing").chars().take(40).collect();
    let about = ["IACT-04", "ORD-CANCEL-07", "ORD-CANCEL-13", "STATE-MSG-14", "ASTATE-05"];
    if !is_known_to_go_on(judge, action) {
        return strange_status(names, status.unwrap_or_default());
    }
    let by_id = || object(names, [(ActionState::action_id, json!(id))]);
    let (like, why) = match instant(judge, id) {
        Some(kind) => {
            let why = format!("it leaves {kind} {shown}");
            let like = match action.action_type.is(&kind) {
                true => object(
                    names,
                    [
                        (ActionState::action_type, json!(kind)),
                        (ActionState::action_status, json!(shown)),
                    ],
                ),
                false => by_id(),
            };
            (like, why)
        }
        None => {
            let why = format!("it leaves action {id:?} of an order that is over {shown}");
            (by_id(), why)
        }
    };
    let member = called(names, StateView::action_states);
    vec![waiver(member, Reading::Without { like }, &about, why)]
}

/// A word for a status that is none: of an action that is over, it means that it is finished. Known words in another
/// spelling mean what they say.
fn strange_status(names: &Names, shown: &str) -> Vec<Waiver> {
    let known = ["WAITING", "INITIALIZING", "RUNNING", "PAUSED", "FINISHED", "FAILED"];
    let about = ["STATE-MSG-14", "ASTATE-05", "JSON-02"];
    let one = |shown: String, meant: &str, why: String| {
        let meant = meant.to_owned();
        let member = called(names, StateView::action_states);
        waiver(member, Reading::Status { shown, meant }, &about, why)
    };
    let Some(meant) = known.iter().find(|word| word.eq_ignore_ascii_case(shown)) else {
        let word: String = shown.chars().take(40).collect();
        let why = format!("it says {word:?} of actions that are over, which is no status");
        return vec![one(shown.to_owned(), "FINISHED", why)];
    };
    let lower = shown == meant.to_ascii_lowercase();
    let spelled = |word: &str| {
        let (first, rest) = word.split_at(1);
        if lower {
            word.to_ascii_lowercase()
        } else {
            format!("{first}{}", rest.to_ascii_lowercase())
        }
    };
    let why = format!("it spells the status of actions {shown:?}");
    let all = known.iter();
    all.map(|word| one(spelled(word), word, why.clone())).collect()
}

/// Whether an action is said, in a word of the version, not to be over.
fn is_known_to_go_on(judge: &RunJudge, action: &ActionState) -> bool {
    match action.action_status.text() {
        Some("WAITING" | "INITIALIZING" | "RUNNING" | "PAUSED") => true,
        Some("RETRIABLE") => judge.ground().pack.has("retry"),
        _ => false,
    }
}

/// The type of an instant action the harness has sent, if it is one that needs nothing of the vehicle.
fn instant(judge: &RunJudge, id: &str) -> Option<String> {
    let sent = judge.sent_instant(id)?;
    let harmless = [
        "cancelOrder",
        "stateRequest",
        "factsheetRequest",
        "logReport",
        "startPause",
        "stopPause",
    ];
    harmless.contains(&sent.as_str()).then_some(sent)
}

/// Whether the states since then show the vehicle at one place.
fn stays(judge: &RunJudge, idle: &Idle) -> bool {
    let timeline = judge.timeline();
    let states = timeline.of("state").iter().rev();
    let since: Vec<_> = states.take_while(|entry| entry.at().moment >= idle.since).collect();
    let long = match (since.first(), since.last()) {
        (Some(last), Some(first)) => last.at().moment.since(first.at().moment) * 2 >= idle.patience,
        _ => false,
    };
    let mut places = since.iter().map(|entry| place(timeline.state(entry)?));
    let first = places.next().flatten();
    long && since.len() > 1 && first.is_some() && places.all(|place| place == first)
}

/// Whether the vehicle has said that it drives while it waited, in two states apart: it stands where it stood, no node to
/// come is released, and no action is under way.
fn stood_driving(judge: &RunJudge, since: Moment) -> bool {
    let states = judge.timeline().states_back();
    let mut later = None;
    for (entry, state) in states.take_while(|(entry, _)| entry.at().moment >= since) {
        let waits = !state.node_states.is_empty() && !may_drive(state) && nothing_is_done(state);
        if !state.driving.is(true) || !waits {
            later = None;
            continue;
        }
        let (at, here) = (entry.at().moment, place(state));
        let stood = later.is_some_and(|(later, there): (Moment, _)| later.since(at) >= APART && there == here);
        if stood && here.is_some() {
            return true;
        }
        later.get_or_insert((at, here));
    }
    false
}

/// Whether the vehicle has said for so long that it drives a released way, and has not moved, although nothing in its
/// states holds it: something in it has died, and it will not move in the next test either.
pub(super) fn is_stalled(judge: &RunJudge, since: Moment, patience: Duration) -> bool {
    let states = judge.timeline().states_back();
    let mut later: Option<(Moment, Option<(f64, f64)>)> = None;
    for (entry, state) in states.take_while(|(entry, _)| entry.at().moment >= since) {
        let held = state.paused.is(true) || state.field_violation() == Some(true) || is_stopped(state);
        if !state.driving.is(true) || held || !may_drive(state) || !nothing_is_done(state) {
            later = None;
            continue;
        }
        let (at, here) = (entry.at().moment, place(state));
        match later {
            Some((later, there)) if here.is_some() && there == here => {
                if later.since(at) >= patience {
                    return true;
                }
            }
            _ => later = Some((at, here)),
        }
    }
    false
}

/// Whether every action is over, or has not begun.
fn nothing_is_done(state: &StateView) -> bool {
    open_actions(state).all(|action| action.action_status.is("WAITING"))
}

fn shows_error(state: &StateView, kind: &str) -> bool {
    state.errors.iter().any(|error| error.error_type.is(kind))
}

/// Whether the vehicle has taken over an order while it showed this error.
fn accepts_orders(judge: &RunJudge, kind: &str) -> bool {
    let mut orders = BTreeSet::new();
    let states = judge.timeline().states_back().take(500);
    for (_, state) in states.take_while(|(_, state)| shows_error(state, kind)) {
        orders.extend(state.order_id.text());
    }
    orders.len() > 1
}

/// Whether the vehicle has ended the action of this id.
pub(super) fn has_ended(judge: &RunJudge, id: &str) -> bool {
    let mut states = judge.timeline().states_back().take(20);
    let known = states.find_map(|(_, state)| state.action(id).filter(|action| action.action_status.is_there()));
    known.is_some_and(|action| !is_known_to_go_on(judge, action))
}

/// What the journal says about a waiver.
pub(super) fn event(waiver: Waiver) -> Event {
    Event::Waived { waiver }
}
