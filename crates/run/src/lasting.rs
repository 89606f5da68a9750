//! Lasting mistakes of a vehicle: what it shows although it stands idle.
//!
//! Nothing that could be true is taken for a mistake: a vehicle that lists nodes to come has an order until it has
//! answered a cancelOrder, and a mode or an emergency stop is believed as long as it is a word of the standard.

use std::collections::BTreeSet;
use std::time::Duration;

use serde_json::{Value, json};

use super::rest::{Obstacle, is_over};
use tck_base::clock::Moment;
use tck_base::pattern::whole;
use tck_journal::event::{Event, Reading, Waiver};
use tck_judge::RunJudge;

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

fn waiver(member: &str, reading: Reading, about: &[&str], why: impl Into<String>) -> Waiver {
    Waiver {
        member: member.to_owned(),
        reading,
        about: about.iter().map(|id| (*id).to_owned()).collect(),
        why: why.into(),
    }
}

/// Members that break the schema in a vehicle of which nothing was asked: what they mean is clear.
fn broken_words(judge: &RunJudge) -> Vec<Waiver> {
    let Some(state) = judge.timeline().present("state").and_then(|entry| entry.json()) else {
        return Vec::new();
    };
    let Some(schema) = judge.ground().pack.schema("state") else {
        return Vec::new();
    };
    let findings = schema.findings(state);
    let broken = |member: &str| {
        findings.iter().any(|finding| {
            let rest = finding
                .path
                .strip_prefix('/')
                .and_then(|path| path.strip_prefix(member));
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
        })
    };
    let mut all = Vec::new();
    let mut read_as = |member: &str, meant: Value, about: &[&str]| {
        let shown = state.get(member).cloned();
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
    let mode = state.get("operatingMode").and_then(Value::as_str);
    let unsaid = mode.is_none_or(|mode| mode.eq_ignore_ascii_case(automatic));
    if broken("operatingMode") && unsaid {
        let about = ["MODE-01", "STATE-01", "STATE-MSG-01", "JSON-01", "JSON-02"];
        read_as("operatingMode", json!(automatic), &about);
    }
    let stop = state.pointer("/safetyState/eStop").and_then(Value::as_str);
    let stopped = ["AUTOACK", "MANUAL", "REMOTE"];
    let is_stopped = stop.is_some_and(|stop| stopped.iter().any(|word| stop.eq_ignore_ascii_case(word)));
    if broken("safetyState") && !is_stopped {
        let mut meant = state.get("safetyState").filter(|state| state.is_object()).cloned();
        let meant_state = meant.get_or_insert_with(|| json!({ "fieldViolation": false }));
        meant_state["eStop"] = json!("NONE");
        let about = ["STATE-MSG-17", "STATE-01", "STATE-MSG-01", "JSON-02"];
        read_as("safetyState", meant_state.clone(), &about);
    }
    for member in ["errors", "nodeStates", "edgeStates", "actionStates"] {
        if broken(member) && state.get(member).is_none_or(Value::is_null) {
            read_as(member, json!([]), &["STATE-01", "STATE-MSG-01", "ERR-01", "JSON-10"]);
        }
    }
    let about = ["STATE-MSG-08", "STATE-08", "STATE-01"];
    match state.get("driving") {
        Some(Value::String(word)) if word.eq_ignore_ascii_case("false") => {
            read_as("driving", json!(false), &about);
            let shown = Some(json!(if word == "false" { "true" } else { "True" }));
            let why = "`driving` is a text in its states";
            all.push(waiver(
                "driving",
                Reading::As {
                    shown,
                    meant: json!(true),
                },
                &about,
                why,
            ));
        }
        Some(Value::Bool(_)) => {}
        _ if broken("driving") => read_as("driving", json!(false), &about),
        _ => {}
    }
    all
}

/// What a monitor has found to be forgotten.
fn forgotten(judge: &RunJudge) -> Vec<Waiver> {
    let mut all = Vec::new();
    for (member, requirement) in judge.accused() {
        if matches!(member.as_str(), "orderId" | "orderUpdateId") {
            let why = format!("it forgets its `{member}`, which breaks {requirement}");
            let about = [requirement.as_str(), "ORD-CANCEL-08"];
            all.push(waiver(&member, Reading::Kept, &about, why));
        }
    }
    all
}

/// What is left of orders and actions that are over.
fn left_over(judge: &RunJudge, obstacles: &[Obstacle], idle: &Idle) -> Vec<Waiver> {
    let Some(state) = judge.state() else { return Vec::new() };
    let mut all = Vec::new();
    if obstacles.contains(&Obstacle::Order) {
        let answered = idle.answered;
        all.extend(passed(
            &state,
            answered,
            "nodeStates",
            &["STATE-12", "STATE-13", "NODE-03", "ORD-CANCEL-09", "ORD-CANCEL-11"],
        ));
        all.extend(passed(
            &state,
            answered,
            "edgeStates",
            &["STATE-12", "STATE-13", "NODE-05", "ORD-CANCEL-09", "ORD-CANCEL-11"],
        ));
    }
    if (obstacles.contains(&Obstacle::Driving) && stays(judge, idle)) || stood_driving(judge, idle.test) {
        let about = ["STATE-MSG-08", "STATE-08", "ORD-UPD-01"];
        let why = "it says that it drives while it stands";
        all.push(waiver("driving", Reading::Standing, &about, why));
    }
    let actions = state
        .get("actionStates")
        .and_then(Value::as_array)
        .into_iter()
        .flatten();
    let open: Vec<&Value> = actions.filter(|action| !is_over(action)).collect();
    let is_own = |action: &&Value| {
        let id = action.get("actionId").and_then(Value::as_str);
        !has_known_status(action) || id.is_some_and(|id| instant(judge, id).is_some())
    };
    // What an order began may really be under way, as long as cancelOrder waits for it.
    if idle.answered || open.iter().all(is_own) {
        all.extend(open.into_iter().flat_map(|action| unfinished(judge, action)));
    }
    if !obstacles
        .iter()
        .any(|obstacle| matches!(obstacle, Obstacle::Mode(_) | Obstacle::EmergencyStop))
    {
        let errors = state.get("errors").and_then(Value::as_array).into_iter().flatten();
        for obstacle in obstacles {
            let Obstacle::Fatal(kind) = obstacle else { continue };
            let shown = errors
                .clone()
                .any(|error| error.get("errorType").and_then(Value::as_str) == Some(kind));
            if shown && accepts_orders(judge, kind) {
                let like = json!({ "errorLevel": "FATAL", "errorType": kind });
                let why = format!("it keeps the FATAL error {kind:?}, and takes orders all the same");
                all.push(waiver("errors", Reading::Without { like }, &["ERR-01", "ERR-04"], why));
            }
        }
    }
    all
}

/// Nodes or edges that are listed after they were left; of an order that is over, those that were still to come.
fn passed(state: &Value, answered: bool, member: &str, about: &[&str]) -> Vec<Waiver> {
    let last = state.get("lastNodeSequenceId").and_then(whole);
    let elements = state.get(member).and_then(Value::as_array).into_iter().flatten();
    let (behind, ahead): (Vec<&Value>, Vec<&Value>) = elements.partition(|element| {
        let at = element.get("sequenceId").and_then(whole);
        at.zip(last).is_some_and(|(at, last)| at <= last)
    });
    let mut all = Vec::new();
    if !behind.is_empty() {
        let why = format!("it keeps in its `{member}` what lies behind it");
        all.push(waiver(member, Reading::Passed, about, why));
    }
    // Nodes to come are an order, unless the vehicle says that there is none.
    for element in ahead.into_iter().filter(|_| answered).take(16) {
        let why = format!("it keeps in its `{member}` what was left of an order that is cancelled");
        let like = element.clone();
        all.push(waiver(member, Reading::Without { like }, about, why));
    }
    all
}

/// An action that does not end although nothing goes on: an instant action of ours by its type, any other by its id.
fn unfinished(judge: &RunJudge, action: &Value) -> Vec<Waiver> {
    let text = |name: &str| action.get(name).and_then(Value::as_str);
    let Some(id) = text("actionId") else { return Vec::new() };
    let status: String = text("actionStatus").unwrap_or("nothing").chars().take(40).collect();
    let about = ["IACT-04", "ORD-CANCEL-07", "ORD-CANCEL-13", "STATE-MSG-14", "ASTATE-05"];
    if !has_known_status(action) {
        return strange_status(text("actionStatus").unwrap_or_default());
    }
    if let Some(kind) = instant(judge, id) {
        let like = json!({ "actionType": kind, "actionStatus": status });
        let why = format!("it leaves {kind} {status}");
        let named = text("actionType") == Some(kind.as_str());
        let like = if named { like } else { json!({ "actionId": id }) };
        return vec![waiver("actionStates", Reading::Without { like }, &about, why)];
    }
    let why = format!("it leaves action {id:?} of an order that is over {status}");
    let like = json!({ "actionId": id });
    vec![waiver("actionStates", Reading::Without { like }, &about, why)]
}

/// A word for a status that is none: of an action that is over, it means that it is finished. Known words in another
/// spelling mean what they say.
fn strange_status(shown: &str) -> Vec<Waiver> {
    let known = ["WAITING", "INITIALIZING", "RUNNING", "PAUSED", "FINISHED", "FAILED"];
    let about = ["STATE-MSG-14", "ASTATE-05", "JSON-02"];
    let one = |shown: String, meant: &str, why: String| {
        let meant = meant.to_owned();
        waiver("actionStates", Reading::Status { shown, meant }, &about, why)
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

fn has_known_status(action: &Value) -> bool {
    let status = action.get("actionStatus").and_then(Value::as_str);
    status.is_some_and(|status| ["WAITING", "INITIALIZING", "RUNNING", "PAUSED"].contains(&status))
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
    let states = judge.timeline().of("state").iter().rev();
    let since: Vec<_> = states.take_while(|entry| entry.at().moment >= idle.since).collect();
    let long = match (since.first(), since.last()) {
        (Some(last), Some(first)) => last.at().moment.since(first.at().moment) * 2 >= idle.patience,
        _ => false,
    };
    let place = |entry: &tck_journal::Entry| entry.json().and_then(super::rest::place_of);
    let mut places = since.iter().map(|entry| place(entry));
    let first = places.next().flatten();
    long && since.len() > 1 && first.is_some() && places.all(|place| place == first)
}

/// Whether the vehicle has said that it drives while it waited, in two states apart: it stands where it stood, no node to
/// come is released, and no action is under way.
fn stood_driving(judge: &RunJudge, since: Moment) -> bool {
    let states = judge.timeline().of("state").iter().rev();
    let mut later: Option<&tck_journal::Entry> = None;
    for entry in states.take_while(|entry| entry.at().moment >= since) {
        let Some(state) = entry.json() else { continue };
        let list = |name: &str| state.get(name).and_then(Value::as_array).into_iter().flatten();
        let ahead = list("nodeStates").any(|node| node.get("released") == Some(&Value::Bool(true)));
        let waits = list("nodeStates").next().is_some() && !ahead && list("actionStates").all(is_over_or_waits);
        if state.get("driving") != Some(&Value::Bool(true)) || !waits {
            later = None;
            continue;
        }
        let stood = later.is_some_and(|later| {
            let apart = later.at().moment.since(entry.at().moment);
            let same = later.json().and_then(super::rest::place_of) == super::rest::place_of(state);
            apart >= APART && same && super::rest::place_of(state).is_some()
        });
        if stood {
            return true;
        }
        later.get_or_insert(entry);
    }
    false
}

/// Whether the vehicle has said for so long that it drives a released way, and has not moved, although nothing in its
/// states holds it: something in it has died, and it will not move in the next test either.
pub(super) fn is_stalled(judge: &RunJudge, since: Moment, patience: Duration) -> bool {
    let states = judge.timeline().of("state").iter().rev();
    let mut later: Option<&tck_journal::Entry> = None;
    for entry in states.take_while(|entry| entry.at().moment >= since) {
        let Some(state) = entry.json() else { continue };
        let list = |name: &str| state.get(name).and_then(Value::as_array).into_iter().flatten();
        let is = |path: &str| state.pointer(path) == Some(&Value::Bool(true));
        let stopped = state.pointer("/safetyState/eStop").is_some_and(|stop| stop != "NONE");
        let held = is("/paused") || is("/safetyState/fieldViolation") || stopped;
        let ahead = list("nodeStates").any(|node| node.get("released") == Some(&Value::Bool(true)));
        if !is("/driving") || held || !ahead || !list("actionStates").all(is_over_or_waits) {
            later = None;
            continue;
        }
        let place = super::rest::place_of(state);
        match later {
            Some(later) if place.is_some() && later.json().and_then(super::rest::place_of) == place => {
                if later.at().moment.since(entry.at().moment) >= patience {
                    return true;
                }
            }
            _ => later = Some(entry),
        }
    }
    false
}

fn is_over_or_waits(action: &Value) -> bool {
    is_over(action) || action.get("actionStatus").and_then(Value::as_str) == Some("WAITING")
}

/// Whether the vehicle has taken over an order while it showed this error.
fn accepts_orders(judge: &RunJudge, kind: &str) -> bool {
    let states = judge.timeline().of("state");
    let mut orders = BTreeSet::new();
    for state in states.iter().rev().filter_map(|entry| entry.json()).take(500) {
        let errors = state.get("errors").and_then(Value::as_array).into_iter().flatten();
        let mut kinds = errors.filter_map(|error| error.get("errorType").and_then(Value::as_str));
        if !kinds.any(|one| one == kind) {
            break;
        }
        orders.extend(state.get("orderId").and_then(Value::as_str));
    }
    orders.len() > 1
}

/// Whether the vehicle has ended the action of this id.
pub(super) fn has_ended(judge: &RunJudge, id: &str) -> bool {
    let states = judge
        .timeline()
        .of("state")
        .iter()
        .rev()
        .filter_map(|entry| entry.json());
    let status = states.take(20).find_map(|state| {
        let mut all = state.get("actionStates")?.as_array()?.iter();
        let one = all.find(|one| one.get("actionId").and_then(Value::as_str) == Some(id))?;
        one.get("actionStatus")?.as_str().map(str::to_owned)
    });
    status.is_some_and(|status| !["WAITING", "INITIALIZING", "RUNNING", "PAUSED"].contains(&status.as_str()))
}

/// What the journal says about a waiver.
pub(super) fn event(waiver: Waiver) -> Event {
    Event::Waived { waiver }
}
