//! Whether the vehicle is as a test may find it, and if not, what is in the way.
//!
//! This is the one judgement on which the preambles rely, the way back after a test, and the decision to restart a
//! vehicle. Lasting mistakes that are known are read over.

use std::sync::Arc;

use super::presence::says_online;
use tck_base::clock::Moment;
use tck_course::Layout;
use tck_judge::RunJudge;
use tck_pack::Pack;
use tck_view::{Member, Position, StateView, Text};
use tck_world::rest::{has_order, is_stopped, open_actions, place};

/// How far from its last node a vehicle may stand to be on it, in metres, unless the node allows more.
const ON_NODE: f64 = 0.5;
/// A place farther than this from the last node, in metres, is no place between two nodes; it is another measure.
const AN_EDGE: f64 = 100.0;
/// Words of the vocabulary for errors that only refuse something.
const REFUSALS: [&str; 4] = [
    "error.validation",
    "error.order",
    "error.outdatedUpdate",
    "error.noOrderToCancel",
];

/// What keeps a vehicle from the next test.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Obstacle {
    /// It does not say that it is online.
    NotOnline,
    /// It has sent no state in its present connection.
    NoState,
    /// It lists nodes or edges.
    Order,
    /// It says that it drives.
    Driving,
    /// An action is not over: its id.
    Action(String),
    /// It is paused.
    Paused,
    /// Another operating mode than the one it had.
    Mode(String),
    /// An emergency stop is active.
    EmergencyStop,
    /// A FATAL error that is no refusal.
    Fatal(String),
    /// It charges.
    Charging,
    /// It is on a map it was not on before, or does not know where it is.
    Map(String),
    /// It stands between two nodes.
    Place,
    /// It carries something it did not carry before.
    Load,
}

impl Obstacle {
    /// For people.
    pub(super) fn describe(&self) -> String {
        match self {
            Self::NotOnline => "it does not say that it is online".to_owned(),
            Self::NoState => "it has sent no state since it connected".to_owned(),
            Self::Order => "nodeStates or edgeStates are not empty".to_owned(),
            Self::Driving => "driving is true".to_owned(),
            Self::Action(id) => format!("action {id:?} is not over"),
            Self::Paused => "paused is true".to_owned(),
            Self::Mode(mode) => format!("operatingMode is {mode:?}"),
            Self::EmergencyStop => "an emergency stop is reported".to_owned(),
            Self::Fatal(kind) => format!("the FATAL error {kind:?} is reported"),
            Self::Charging => "it charges".to_owned(),
            Self::Map(map) => format!("it is on map {map:?}, or does not know where it is"),
            Self::Place => "it stands between two nodes".to_owned(),
            Self::Load => "it carries a load".to_owned(),
        }
    }

    /// Whether no test that moves the vehicle can be run in spite of it. The others are looked at by those tests that
    /// need them.
    pub(super) fn halts(&self) -> bool {
        matches!(self, Self::Order | Self::Driving | Self::NoState)
    }
}

/// What the vehicle was like when nothing had been asked of it.
#[derive(Clone, Debug, Default)]
pub(super) struct Home {
    /// Its first state.
    pub(super) first: Option<Arc<StateView>>,
    /// When the running test began.
    pub(super) since: Moment,
    /// Its state when the running test began.
    pub(super) before: Option<Arc<StateView>>,
}

impl Home {
    /// Everything that is in the way; empty for a vehicle at rest.
    pub(super) fn obstacles(&self, judge: &RunJudge, layout: Option<&Layout>) -> Vec<Obstacle> {
        let mut all = Vec::new();
        if !says_online(judge) {
            all.push(Obstacle::NotOnline);
        }
        let ever = judge.timeline().states_back().next().is_some();
        let Some(state) = judge.state() else {
            all.extend(ever.then_some(Obstacle::NoState));
            return all;
        };
        self.of_state(&state, &judge.ground().pack, layout, &mut all);
        all
    }

    fn of_state(&self, state: &StateView, pack: &Pack, layout: Option<&Layout>, all: &mut Vec<Obstacle>) {
        let short = |text: &Member<Text>| -> String { text.or_empty().chars().take(64).collect() };
        if has_order(state) {
            all.push(Obstacle::Order);
        }
        if state.driving.is(true) {
            all.push(Obstacle::Driving);
        }
        all.extend(open_actions(state).map(|action| Obstacle::Action(short(&action.action_id))));
        if state.paused.is(true) {
            all.push(Obstacle::Paused);
        }
        let usual = ["operatingMode.automatic", "operatingMode.semiautomatic"];
        if let Some(mode) = state.operating_mode.text()
            && !usual.iter().any(|word| pack.word(word) == Some(mode))
        {
            all.push(Obstacle::Mode(short(&state.operating_mode)));
        }
        if is_stopped(state) {
            all.push(Obstacle::EmergencyStop);
        }
        let fatal = state.errors.iter().filter(|error| error.error_level.is("FATAL"));
        let kinds = fatal.filter_map(|error| error.error_type.text());
        all.extend(
            kinds
                .filter(|kind| !REFUSALS.iter().any(|word| pack.word(word) == Some(kind)))
                .map(|kind| Obstacle::Fatal(kind.chars().take(64).collect())),
        );
        let was = |so: fn(&StateView) -> bool| self.before.as_ref().is_some_and(|before| so(before));
        let charges = |state: &StateView| state.charging() == Some(true);
        if charges(state) && !was(charges) {
            all.push(Obstacle::Charging);
        }
        let is_laden = |state: &StateView| !state.loads.is_empty();
        if is_laden(state) && !was(is_laden) {
            all.push(Obstacle::Load);
        }
        self.of_place(state, layout, all);
    }

    fn of_place(&self, state: &StateView, layout: Option<&Layout>, all: &mut Vec<Obstacle>) {
        let Some(layout) = layout else { return };
        let now = state.position.there();
        let before = self.before.as_ref().and_then(|before| before.position.there());
        let is = |position: Option<&Position>, known| position.is_some_and(|it| it.initialized.is(known));
        let map = |position: &Position| {
            let map = position.map_id.text()?;
            Some(map.chars().take(64).collect::<String>())
        };
        let lost = is(now, false) && is(before, true);
        let now = now.and_then(map);
        let strange = match (&now, before.and_then(map)) {
            (Some(now), Some(before)) => *now != before && !layout.nodes().any(|node| node.map_id == *now),
            _ => false,
        };
        if lost || strange {
            all.push(Obstacle::Map(now.unwrap_or_default()));
        } else if self.is_between_nodes(state, layout) {
            all.push(Obstacle::Place);
        }
    }

    /// Whether the vehicle stands off its last node. A vehicle whose position did not fit its node to begin with, or
    /// that always shows the same, is not measured by it.
    pub(super) fn is_between_nodes(&self, state: &StateView, layout: &Layout) -> bool {
        let away = |state: &StateView| {
            let node = layout.node(state.last_node_id.text()?)?;
            let spot = state.spot()?;
            let distance = node.distance(spot.x, spot.y);
            let is_off = distance > node.deviation_xy.unwrap_or(0.0).max(ON_NODE);
            (spot.map_id == node.map_id.as_str()).then_some((is_off, distance))
        };
        let first = self.first.as_deref();
        let fitted = first.and_then(away).is_some_and(|(away, _)| !away);
        let moved = first.and_then(place) != place(state);
        fitted && moved && away(state).is_some_and(|(away, distance)| away && distance < AN_EDGE)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};
    use tck_view::{MessageView, Names, Topic};

    use super::*;

    fn layout() -> Layout {
        Layout::built_in()
    }

    fn at(node: &str, x: f64, y: f64) -> Value {
        let map = layout().node(node).unwrap().map_id.clone();
        json!({ "lastNodeId": node, "agvPosition": { "x": x, "y": y, "mapId": map, "positionInitialized": true } })
    }

    fn on(node: &str) -> Value {
        let layout = layout();
        let found = layout.node(node).unwrap();
        at(node, found.x, found.y)
    }

    fn view(state: &Value) -> Arc<StateView> {
        let view = MessageView::of_value(Topic::State, state, &Names::default());
        Arc::clone(view.state().unwrap())
    }

    fn places(first: &Value, now: &Value) -> Vec<Obstacle> {
        let home = Home {
            before: Some(view(first)),
            first: Some(view(first)),
            ..Home::default()
        };
        let mut all = Vec::new();
        home.of_place(&view(now), Some(&layout()), &mut all);
        all
    }

    #[test]
    fn a_vehicle_off_its_last_node_stands_between_two() {
        let layout = layout();
        let node = layout.nodes().next().unwrap();
        let off = at(&node.id, node.x + 1.85, node.y);
        assert_eq!(places(&on(&node.id), &off), [Obstacle::Place]);
        assert_eq!(places(&on(&node.id), &at(&node.id, node.x + 0.1, node.y)), []);
    }

    #[test]
    fn a_position_that_never_fitted_says_nothing() {
        let layout = layout();
        let node = layout.nodes().next().unwrap();
        let odd = at(&node.id, node.x + 20.0, node.y);
        assert_eq!(places(&odd, &at(&node.id, node.x + 1.85, node.y)), []);
        let in_millimetres = at(&node.id, node.x + 2000.0, node.y);
        assert_eq!(places(&on(&node.id), &in_millimetres), []);
    }

    #[test]
    fn a_map_nobody_knows_is_in_the_way() {
        let layout = layout();
        let node = layout.nodes().next().unwrap();
        let mut lost = on(&node.id);
        lost["agvPosition"]["mapId"] = json!("no-such-map");
        assert_eq!(places(&on(&node.id), &lost), [Obstacle::Map("no-such-map".to_owned())]);
    }
}
