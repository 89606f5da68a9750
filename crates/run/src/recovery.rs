//! The way back to rest after a test: each rung is tried only when the one before did not help, and each is recorded.

use serde_json::{Value, json};

use super::bindings::way_to_fit;
use super::idle::Obstacle;
use super::lasting::{self, Idle, has_ended, is_stalled, lasting};
use super::reset::power_cycle;
use super::session::Session;
use tck_base::clock::Moment;
use tck_course::{Edge, Layout, demanded_in_order, told_in_order};
use tck_engine::{EngineError, Operator};
use tck_journal::event::Event;
use tck_judge::RunJudge;
use tck_net::link::Link;
use tck_pack::HookEffect;
use tck_suite::model::Test;
use tck_world::rest::has_order;

/// Whether no state has named the last order that was sent since then, although states came.
fn last_order_never_showed(judge: &RunJudge, since: Moment) -> bool {
    let Some((sent, order)) = judge.last_order().filter(|(sent, _)| *sent >= since) else {
        return false;
    };
    let timeline = judge.timeline();
    let states = timeline.of("state").iter().rev();
    let mut later = states.take_while(|entry| entry.at().moment >= *sent).peekable();
    later.peek().is_some()
        && later.all(|entry| {
            let shown = timeline.state(entry);
            shown.is_none_or(|state| !state.order_id.is(order))
        })
}

/// The nodes and edges of an order over this way, with fresh actionIds for what the layout demands; `None` where a node of it is
/// not in the layout.
fn order_over(layout: &Layout, way: &[Edge], mut fresh: impl FnMut() -> String) -> Option<(Value, Value)> {
    let ids = way.first().map(|edge| &edge.start).into_iter();
    let ids = ids.chain(way.iter().map(|edge| &edge.end)).enumerate();
    let nodes = ids.map(|(at, id)| {
        let node = layout.node(id)?;
        Some(json!({
            "nodeId": id, "sequenceId": 2 * at, "released": true,
            "actions": demanded_in_order(&node.value(), &mut fresh),
            "nodePosition": { "x": node.x, "y": node.y, "mapId": node.map_id },
        }))
    });
    let nodes = nodes.collect::<Option<Vec<_>>>()?;
    let edges = way.iter().enumerate().map(|(at, edge)| {
        let known = edge.value();
        let mut sent = json!({
            "edgeId": edge.id, "sequenceId": 2 * at + 1, "released": true,
            "actions": demanded_in_order(&known, &mut fresh),
            "startNodeId": edge.start, "endNodeId": edge.end,
        });
        if let Value::Object(members) = &mut sent {
            members.extend(told_in_order(&known));
        }
        sent
    });
    Some((nodes.into(), edges.collect::<Vec<_>>().into()))
}

/// How often a device is restarted that floods the harness.
const MOST_FLOODS: u32 = 3;

/// So many instant actions that have ended are a long list.
const LONG_LIST: usize = 40;

/// How often in a row the whole ladder is tried before only a moment is given.
const WHOLE_LADDERS: u32 = 3;

impl<L: Link, O: Operator> Session<'_, L, O> {
    /// What keeps the vehicle from the next test.
    pub(super) fn obstacles(&self) -> Vec<Obstacle> {
        self.home
            .obstacles(self.engine.recorder.judge(), self.setup.layout.as_ref())
    }

    /// Waits until the vehicle is at rest, at most so long.
    async fn rests_within(&mut self, patience: std::time::Duration) -> Result<bool, EngineError> {
        let until = self.engine.link.now().moment + patience;
        let (home, layout) = (&self.home, self.setup.layout.as_ref());
        let rests = |recorder: &tck_engine::Recorder| home.obstacles(recorder.judge(), layout).is_empty();
        self.engine.watch(until, rests).await
    }

    fn rung(&mut self, what: &str) -> Result<(), EngineError> {
        let all: Vec<String> = self.obstacles().iter().map(Obstacle::describe).collect();
        let text = match all.is_empty() {
            true => format!("whether the vehicle still takes orders is seen by {what}"),
            false => format!("the vehicle is not at rest ({}): {what}", all.join("; ")),
        };
        self.engine.note(Event::Note { text })?;
        Ok(())
    }

    /// Whether the device can be switched off and on, or the program be started again that it is.
    pub(super) fn can_restart(&self) -> bool {
        self.engine.hook_that(HookEffect::PowerCycles).is_some() || self.engine.operator.has_program()
    }

    /// Starts a device again that floods the harness, where that is possible: it has ended the test, and need not end the
    /// run.
    pub(super) async fn outlast_flood(&mut self, test: &Test) -> Result<(), EngineError> {
        let Some(why) = self.engine.recorder.flood().map(str::to_owned) else {
            return Ok(());
        };
        if self.floods >= MOST_FLOODS || !self.can_restart() {
            return Ok(());
        }
        self.floods += 1;
        for _ in 0..2 {
            // Else nothing more would be sent, and nothing waited for.
            if !self.engine.recorder.begin_count_anew() {
                break;
            }
            let restarted = power_cycle(self, format!("{why}; it is restarted")).await?;
            if restarted.is_ok() {
                let limit = format!("In test {} {why}. It was restarted, and the run went on.", test.id);
                self.setup.limits.push(limit);
                break;
            }
        }
        Ok(())
    }

    /// Notices a vehicle that a message of this test has struck dumb, though its connection stands, and starts it again where that
    /// is possible: the silence is the mistake of this test, and no later one is to be blamed for it.
    pub(super) async fn outlast_silence(&mut self, test: &Test) -> Result<(), EngineError> {
        let Some(((sent, _), until)) = self.engine.recorder.judge().timeline().unanswered() else {
            return Ok(());
        };
        let speaks = |recorder: &tck_engine::Recorder| {
            let unanswered = recorder.judge().timeline().unanswered();
            unanswered.is_none_or(|((seq, _), _)| seq != sent)
        };
        if self.engine.interrupted() || self.engine.watch(until, speaks).await? {
            return Ok(());
        }
        let why = format!("the vehicle has said nothing since it was sent #{sent}");
        let mut limit = format!("In test {} {why}.", test.id);
        if self.can_restart() && power_cycle(self, format!("{why}; it is restarted")).await?.is_ok() {
            limit.push_str(" It was restarted, and the run went on.");
        } else {
            self.progress.note(&why);
        }
        self.setup.limits.push(limit);
        Ok(())
    }

    /// Brings the vehicle to rest, and gives what is still in the way.
    pub(super) async fn bring_to_rest(&mut self) -> Result<Vec<Obstacle>, EngineError> {
        if self.rests_within(self.time("settle")).await? {
            self.ladders = 0;
            return Ok(Vec::new());
        }
        if self.ladders >= WHOLE_LADDERS || self.engine.interrupted() {
            return Ok(self.obstacles());
        }
        self.ladders += 1;
        self.by_hand().await?;
        self.by_message().await?;
        self.read_over(self.engine.link.now().moment).await?;
        if !self.obstacles().is_empty() && self.can_restart() && !self.engine.interrupted() {
            self.restart().await?;
        }
        let left = self.obstacles();
        if left.is_empty() {
            self.ladders = 0;
        }
        Ok(left)
    }

    /// Has a long list of instant actions emptied, as a fleet control does (IACT-STATE-07): each state would be longer than the
    /// one before, until the vehicle has no room for the next action.
    pub(super) async fn empty_list(&mut self) -> Result<(), EngineError> {
        let ended = |recorder: &tck_engine::Recorder| {
            let state = recorder.judge().state();
            let list = state.iter().flat_map(|state| state.instant_action_states.iter());
            list.filter(|action| action.is_over()).count()
        };
        if !self.empties_lists || ended(&self.engine.recorder) < LONG_LIST || self.engine.interrupted() {
            return Ok(());
        }
        let text = "the list of instant actions has become long: clearInstantActions".to_owned();
        self.engine.note(Event::Note { text })?;
        self.instant_action("clearInstantActions", json!([])).await?;
        let until = self.engine.link.now().moment + self.time("react");
        let is_short = |recorder: &tck_engine::Recorder| ended(recorder) < LONG_LIST;
        // A vehicle that does not do it is not asked again.
        self.empties_lists = self.engine.watch(until, is_short).await?;
        Ok(())
    }

    /// Has the hook with this effect done, with the value of its parameter, if it takes one. `false` without such a hook.
    async fn have_done(&mut self, effect: HookEffect, value: Value) -> Result<bool, EngineError> {
        let Some(hook) = self.engine.hook_that(effect) else {
            return Ok(false);
        };
        self.rung(&format!("hook `{hook}`"))?;
        let with = effect.parameter().map(|name| (name.to_owned(), value));
        self.engine.hook(&hook, with.into_iter().collect(), true).await?;
        Ok(true)
    }

    /// What was done to the vehicle by hand is undone by hand.
    async fn by_hand(&mut self) -> Result<(), EngineError> {
        for obstacle in self.obstacles() {
            let automatic = self
                .engine
                .recorder
                .judge()
                .ground()
                .pack
                .word("operatingMode.automatic");
            let automatic = automatic.unwrap_or("AUTOMATIC").to_owned();
            let (effect, value) = match obstacle {
                Obstacle::EmergencyStop => (HookEffect::ReleasesEmergencyStop, Value::Null),
                Obstacle::Mode(_) => (HookEffect::SetsMode, automatic.into()),
                Obstacle::Paused => (HookEffect::ReleasesPause, Value::Null),
                Obstacle::Fatal(_) => (HookEffect::ClearsErrors, Value::Null),
                _ => continue,
            };
            let is_done = !self.engine.interrupted() && self.have_done(effect, value).await?;
            if is_done && self.rests_within(self.time("settle")).await? {
                return Ok(());
            }
        }
        Ok(())
    }

    /// What a message can undo is undone by messages.
    async fn by_message(&mut self) -> Result<(), EngineError> {
        let is_busy = |all: &[Obstacle]| {
            let busy = |one: &Obstacle| matches!(one, Obstacle::Order | Obstacle::Driving | Obstacle::Action(_));
            all.iter().any(busy)
        };
        self.cancelled = None;
        self.give_up_retries().await?;
        if is_busy(&self.obstacles()) && self.engine.cancels {
            self.rung("cancelOrder")?;
            let since = self.engine.link.now().moment;
            let id = self.instant_action("cancelOrder", json!([])).await?;
            let until = since + self.time("react") + self.time("slow");
            let (home, layout) = (&self.home, self.setup.layout.as_ref());
            let free = |recorder: &tck_engine::Recorder| !is_busy(&home.obstacles(recorder.judge(), layout));
            let cancelled = self.engine.watch(until, free).await?;
            self.cancelled = Some(id);
            self.read_over(since).await?;
            // With another way at hand, a device that does not obey is not asked again after every test. One that says
            // nothing at all any more has not disobeyed.
            let states = self.engine.recorder.judge().timeline().of("state");
            let silent = states.last().is_none_or(|entry| entry.at().moment < since);
            self.engine.cancels = cancelled || silent || !is_busy(&self.obstacles()) || !self.can_restart();
        }
        for (obstacle, action) in [(Obstacle::Paused, "stopPause"), (Obstacle::Charging, "stopCharging")] {
            if self.obstacles().contains(&obstacle) {
                self.rung(action)?;
                self.instant_action(action, json!([])).await?;
                self.rests_within(self.time("react")).await?;
            }
        }
        if self.obstacles().iter().any(|one| matches!(one, Obstacle::Map(_))) {
            self.set_back().await?;
        }
        if self.setup.capabilities.motion.is_ok() && self.obstacles().contains(&Obstacle::Place) {
            self.drive_to_a_node().await?;
        }
        let only_errors = |all: &[Obstacle]| all.iter().all(|one| matches!(one, Obstacle::Fatal(_) | Obstacle::Load));
        if !self.obstacles().is_empty() && only_errors(&self.obstacles()) {
            self.order_where_it_stands().await?;
        }
        if self.obstacles().contains(&Obstacle::Load) && self.have_done(HookEffect::RemovesLoads, Value::Null).await? {
            self.rests_within(self.time("settle")).await?;
        }
        Ok(())
    }

    /// Of a vehicle without an order, lets what waits for a retry fail: nothing else ends an instant action that does.
    async fn give_up_retries(&mut self) -> Result<(), EngineError> {
        let Some(state) = self.engine.recorder.judge().state().filter(|state| !has_order(state)) else {
            return Ok(());
        };
        let waiting = state
            .all_action_states()
            .filter(|action| action.action_status.is("RETRIABLE"));
        let waiting: Vec<String> = waiting
            .filter_map(|action| Some(action.action_id.text()?.to_owned()))
            .collect();
        for id in &waiting {
            self.rung("skipRetry")?;
            let named = json!([{ "key": "actionId", "value": id }]);
            self.instant_action("skipRetry", named).await?;
        }
        if !waiting.is_empty() {
            self.rests_within(self.time("react")).await?;
        }
        Ok(())
    }

    /// initPosition to where the vehicle was before the test.
    async fn set_back(&mut self) -> Result<(), EngineError> {
        let Some(before) = self.home.before.clone() else {
            return Ok(());
        };
        let mut parameters = Vec::new();
        let mut parameter = |key: &str, value: Value| parameters.push(json!({ "key": key, "value": value }));
        if let Some(position) = before.position.there() {
            for (key, member) in [("x", &position.x), ("y", &position.y), ("theta", &position.theta)] {
                if let Some(value) = member.float() {
                    parameter(key, value.into());
                }
            }
            if let Some(map) = position.map_id.text() {
                parameter("mapId", map.into());
            }
        }
        parameter("lastNodeId", before.last_node_id.text().into());
        self.rung("initPosition to where it was before the test")?;
        self.instant_action("initPosition", Value::Array(parameters)).await?;
        self.rests_within(self.time("react")).await?;
        Ok(())
    }

    /// An order of one node, where the vehicle stands: a new order clears what refusals have left.
    async fn order_where_it_stands(&mut self) -> Result<(), EngineError> {
        let state = self.engine.recorder.judge().state();
        let node = state.as_ref().and_then(|state| state.last_node_id.text());
        let node = node.and_then(|id| self.setup.layout.as_ref()?.node(id)).cloned();
        let Some(node) = node else { return Ok(()) };
        self.rung("an order of one node, where it stands")?;
        let position = json!({ "x": node.x, "y": node.y, "mapId": node.map_id });
        let actions = demanded_in_order(&node.value(), || self.engine.composer.action_id());
        let nodes = json!([{
            "nodeId": node.id, "sequenceId": 0, "released": true, "nodePosition": position, "actions": actions,
        }]);
        self.order(nodes, json!([])).await?;
        self.shows_own_order().await?;
        self.rests_within(self.time("settle")).await?;
        // Where lists are read over, nothing shows that the vehicle is done with clearing them.
        if !self.engine.recorder.judge().ground().waivers.is_empty() {
            let settled = self.engine.link.now().moment + self.time("settle");
            self.engine.watch(settled, |_| false).await?;
        }
        Ok(())
    }

    /// An order from a temporary node where the vehicle stands to the nearest node, or the hook that does the same.
    async fn drive_to_a_node(&mut self) -> Result<(), EngineError> {
        let state = self.engine.recorder.judge().state();
        let (Some(state), Some(layout)) = (state, self.setup.layout.as_ref()) else {
            return Ok(());
        };
        let Some(spot) = state.spot() else { return Ok(()) };
        let (x, y) = (spot.x, spot.y);
        let on_map = layout
            .nodes()
            .filter(|node| spot.map_id == node.map_id.as_str() && !node.station);
        let nearest = on_map.min_by(|one, other| one.distance(x, y).total_cmp(&other.distance(x, y)));
        let Some(nearest) = nearest.cloned() else { return Ok(()) };
        self.rung(&format!("an order from where it stands to node {:?}", nearest.id))?;
        let here = format!("{}-here-{}", self.setup.run, self.orders + 1);
        let end = json!({ "x": nearest.x, "y": nearest.y, "mapId": nearest.map_id });
        let nodes = json!([
            { "nodeId": here, "sequenceId": 0, "released": true, "actions": [],
              "nodePosition": { "x": x, "y": y, "mapId": nearest.map_id } },
            { "nodeId": nearest.id, "sequenceId": 2, "released": true, "actions": [], "nodePosition": end },
        ]);
        let edges = json!([{
            "edgeId": format!("{here}-edge"), "sequenceId": 1, "released": true, "actions": [],
            "startNodeId": here, "endNodeId": nearest.id,
        }]);
        self.order(nodes, edges).await?;
        if self.rests_within(self.time("drive")).await? {
            return Ok(());
        }
        if self.have_done(HookEffect::MovesToNode, nearest.id.into()).await? {
            self.rests_within(self.time("settle")).await?;
        }
        Ok(())
    }

    /// Has a vehicle at rest driven to where a test fits, if the test does not fit where it stands.
    pub(super) async fn drive_to_fit(&mut self, test: &Test) -> Result<(), EngineError> {
        let may = self.setup.capabilities.motion.is_ok() && self.halted.is_none() && !self.engine.interrupted();
        let Some(layout) = self.setup.layout.as_ref().filter(|_| may) else {
            return Ok(());
        };
        let Some(way) = way_to_fit(test, layout, self.engine.recorder.judge(), &self.home) else {
            return Ok(());
        };
        let Some(end) = way.last().map(|edge| edge.end.clone()) else {
            return Ok(());
        };
        let composer = &mut self.engine.composer;
        let Some((nodes, edges)) = order_over(layout, &way, || composer.action_id()) else {
            return Ok(());
        };
        let text = format!("the vehicle is driven to node {end:?}, from where {} fits", test.id);
        self.progress.note(&text);
        self.engine.note(Event::Note { text })?;
        self.order(nodes, edges).await?;
        let edges = u32::try_from(way.len()).unwrap_or(u32::MAX);
        let until = self.engine.link.now().moment + self.time("drive") * edges;
        let (home, layout) = (&self.home, self.setup.layout.as_ref());
        let is_there = |recorder: &tck_engine::Recorder| {
            let state = recorder.judge().state();
            state.is_some_and(|state| state.last_node_id.is(&end))
                && home.obstacles(recorder.judge(), layout).is_empty()
        };
        if !self.engine.watch(until, is_there).await? {
            self.bring_to_rest().await?;
        }
        Ok(())
    }

    /// A vehicle that looks idle and refuses everything is of no use to the next test. It is asked when the last order
    /// of a test never showed, and from the first time it was found so after every test.
    pub(super) async fn still_takes_orders(&mut self) -> Result<(), EngineError> {
        let may = self.setup.capabilities.motion.is_ok() && self.can_restart() && self.unhelped < 2;
        let judge = self.engine.recorder.judge();
        if may && !self.engine.interrupted() && is_stalled(judge, self.home.since, self.time("drive") / 2) {
            self.unhelped += 1;
            let text = "the vehicle says that it drives, and does not move".to_owned();
            self.engine.note(Event::Note { text })?;
            self.restart().await?;
            return Ok(());
        }
        let judge = self.engine.recorder.judge();
        let asked = self.refuses || last_order_never_showed(judge, self.home.since);
        if !may || !asked || self.engine.interrupted() {
            return Ok(());
        }
        let before = self.orders;
        self.order_where_it_stands().await?;
        if self.orders == before || self.shows_own_order().await? {
            return Ok(());
        }
        self.refuses = true;
        self.unhelped += 1;
        if self.restart().await? {
            let before = self.orders;
            self.order_where_it_stands().await?;
            if self.orders == before || self.shows_own_order().await? {
                self.unhelped = 0;
            }
        }
        Ok(())
    }

    /// Whether the order sent last on the way to rest shows in the states.
    async fn shows_own_order(&mut self) -> Result<bool, EngineError> {
        let id = format!("{}-rest-{}", self.setup.run, self.orders);
        let until = self.engine.link.now().moment + self.time("slow");
        let shows = |recorder: &tck_engine::Recorder| {
            let mut states = recorder.judge().timeline().states_back().take(20);
            states.any(|(_, state)| state.order_id.is(&id))
        };
        self.engine.watch(until, shows).await
    }

    async fn order(&mut self, nodes: Value, edges: Value) -> Result<(), EngineError> {
        self.orders += 1;
        let id = format!("{}-rest-{}", self.setup.run, self.orders);
        let members = json!({ "orderId": id, "orderUpdateId": 0, "nodes": nodes, "edges": edges });
        let now = self.engine.link.now();
        let ground = self.engine.recorder.judge().ground();
        match self.engine.composer.plain("order", members, ground, now) {
            Ok(message) => self.engine.publish(message).await,
            Err(error) => {
                let text = error.to_string();
                self.engine.note(Event::Trouble { text })?;
                Ok(())
            }
        }
    }

    /// What the vehicle shows although it stands idle is a lasting mistake, and is read over from here on.
    pub(super) async fn read_over(&mut self, since: tck_base::clock::Moment) -> Result<bool, EngineError> {
        // What is listed a moment longer is no lasting mistake: a vehicle may set out late, or tidy up late.
        if self.obstacles().contains(&Obstacle::Order) && self.rests_within(self.time("slow")).await? {
            return Ok(false);
        }
        let judge = self.engine.recorder.judge();
        let idle = Idle {
            answered: self.cancelled.as_deref().is_some_and(|id| has_ended(judge, id)),
            since,
            patience: self.time("settle"),
            test: self.home.since,
        };
        let found = lasting(judge, &self.obstacles(), &idle);
        let any = !found.is_empty();
        for waiver in found {
            let text = format!("from here on it is read over that {}", waiver.why);
            self.progress.note(&text);
            self.engine.note(lasting::event(waiver))?;
        }
        Ok(any)
    }

    /// Off and on again, and whatever it shows then although it stands idle is read over.
    pub(super) async fn restart(&mut self) -> Result<bool, EngineError> {
        self.rung("a restart")?;
        let all: Vec<String> = self.obstacles().iter().map(Obstacle::describe).collect();
        let why = match all.is_empty() {
            true => "the device is restarted".to_owned(),
            false => format!(
                "the vehicle does not come to rest ({}); it is restarted",
                all.join("; ")
            ),
        };
        if let Err(failed) = power_cycle(self, why).await? {
            self.progress.note(&failed);
            return Ok(false);
        }
        self.rests_within(self.time("settle")).await?;
        self.read_over(self.engine.link.now().moment).await?;
        Ok(true)
    }
}
