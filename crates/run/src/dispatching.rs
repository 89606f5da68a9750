//! A master control under test: what happens before the first test and between two of them.
//!
//! The mock AGVs are the harness's own, so they can be put back by hand. What the master control still wants of them
//! is called off first, if it has a hook for that.

use std::sync::Arc;

use serde_json::Map;

use super::session::Session;
use tck_course::{Node, Standing};
use tck_engine::vehicle::is_idle;
use tck_engine::{EngineError, Operator, Recorder};
use tck_journal::event::Event;
use tck_net::link::Link;
use tck_pack::HookEffect;
use tck_simulate::Fleet;
use tck_suite::model::Test;
use tck_view::StateView;
use tck_world::rest::{has_order, place};

/// A vehicle that is no farther from its node, in metres, stands on it.
const ON_NODE: f64 = 0.05;

/// How many transports left over from a test are let pass before the next one.
const LEFTOVERS: usize = 3;

/// A master control that acts on a state does so within this part of `time.settle`.
const AT_ONCE: u32 = 10;

impl<L: Link, O: Operator> Session<'_, L, O> {
    /// Waits for the subscriptions of a master control that has connected, and for the first state of the vehicle.
    pub(super) async fn settle_in(&mut self) -> Result<Result<(), String>, EngineError> {
        let until = self.engine.link.now().moment + self.time("settle");
        let subscribed = |recorder: &Recorder| {
            let timeline = recorder.judge().timeline();
            !timeline.of("mqtt/subscribe").is_empty() && !timeline.of("state").is_empty()
        };
        // Whether it subscribes is for the tests to find.
        self.engine.watch(until, subscribed).await?;
        Ok(Ok(()))
    }

    /// Puts the mock AGVs back: no order, no persona, everything as it was, where they stand.
    pub(super) async fn tidy_fleet(&mut self, test: &Test) -> Result<(), EngineError> {
        let idle = |recorder: &Recorder| is_idle(recorder.judge());
        let calls_off = self.engine.hook_that(HookEffect::CallsOff);
        if let Some(hook) = calls_off
            && !idle(&self.engine.recorder)
            && !self.engine.interrupted()
        {
            let text = format!(
                "after test {} the vehicle still has an order; it is called off",
                test.id
            );
            self.engine.note(Event::Note { text })?;
            // A vehicle that is told to be awkward cannot be called back.
            for vehicle in 0..self.setup.vehicles {
                self.engine
                    .set_vehicle(vehicle, "well-behaved", Map::new().into())
                    .await?;
            }
            self.engine.hook(&hook, self.first_vehicle(), true).await?;
            let until = self.engine.link.now().moment + self.time("slow") + self.time("drive");
            self.engine.watch(until, idle).await?;
        }
        for vehicle in 0..self.setup.vehicles.min(2) {
            if self.is_as_it_was(vehicle) {
                continue;
            }
            let node = self.last_node(vehicle).map(|node| node.id.clone());
            let reset = Fleet::reset(node.as_deref());
            self.engine.set_vehicle(vehicle, "reset", reset).await?;
        }
        // The preambles of the tests give the master control the time to see it (state `vehicle-ready`).
        self.engine.drain().await
    }

    /// Brings the first vehicle back to where it started: from where it stands there is no way as the next test needs
    /// one.
    pub(super) async fn bring_back(&mut self) -> Result<(), EngineError> {
        self.engine.set_vehicle(0, "reset", Fleet::reset(None)).await?;
        self.be_seen().await
    }

    /// Puts the first vehicle on a node from where a test fits, if there is one.
    pub(super) async fn put_to_fit(&mut self, test: &Test) -> Result<(), EngineError> {
        let nodes = self.setup.layout.iter().flat_map(|layout| {
            let all = layout.nodes().filter(|node| !node.station);
            all.filter(move |node| layout.outward(&test.course, &Standing::Node(node.id.clone())).is_ok())
        });
        let Some(node) = nodes.map(|node| node.id.clone()).next() else {
            return Ok(());
        };
        self.engine.set_vehicle(0, "reset", Fleet::reset(Some(&node))).await?;
        self.be_seen().await
    }

    /// What a master control still has for a vehicle, it sends as soon as it sees it free. That is carried out first,
    /// so that no test begins where the vehicle will not be. One that takes longer is noticed in the preambles (state
    /// `vehicle-ready`).
    pub(super) async fn let_it_finish(&mut self) -> Result<(), EngineError> {
        // Left to its natural traffic, it may never be without an order.
        let dispatch = self.engine.hook_that(HookEffect::OrdersTransport);
        if dispatch.is_some_and(|hook| self.engine.operator.natural_traffic(&hook).is_some()) {
            return Ok(());
        }
        for _ in 0..LEFTOVERS {
            let until = self.engine.link.now().moment + self.time("settle") / AT_ONCE;
            if !self.engine.watch(until, |recorder| !is_idle(recorder.judge())).await? {
                break;
            }
            let until = self.engine.link.now().moment + self.time("drive");
            self.engine.watch(until, |recorder| is_idle(recorder.judge())).await?;
        }
        Ok(())
    }

    /// The master control has to see a vehicle that was put somewhere before it is asked for the next transport.
    async fn be_seen(&mut self) -> Result<(), EngineError> {
        let until = self.engine.link.now().moment + self.time("settle");
        self.engine.watch(until, |_| false).await?;
        Ok(())
    }

    /// Whether a mock AGV stands on a node with nothing to do, and nothing was done to it in this test.
    fn is_as_it_was(&self, vehicle: usize) -> bool {
        let entries = self.engine.recorder.journal().beside_messages().rev();
        let mut own = entries.take_while(|entry| !matches!(entry.event(), Event::TestBegun { .. }));
        let touched =
            own.any(|entry| matches!(entry.event(), Event::Vehicle { vehicle: other, .. } if *other == vehicle));
        let on_its_node = || {
            let state = self.last_state(vehicle)?;
            let node = self.last_node(vehicle)?;
            let (x, y) = place(state)?;
            Some(!has_order(state) && state.errors.is_empty() && node.distance(x, y) < ON_NODE)
        };
        !touched && on_its_node().unwrap_or(false)
    }

    /// The parameter that names the first vehicle to a hook.
    fn first_vehicle(&self) -> Map<String, serde_json::Value> {
        let ground = self.engine.recorder.judge().ground();
        Map::from_iter([("vehicle".to_owned(), ground.identity.1.clone().into())])
    }

    /// What a mock AGV has said last.
    fn last_state(&self, vehicle: usize) -> Option<&Arc<StateView>> {
        let subject = if vehicle == 0 { "state" } else { "state@second" };
        let timeline = self.engine.recorder.judge().timeline();
        timeline.state(timeline.of(subject).last()?)
    }

    /// The node a mock AGV was on last, if the layout knows it.
    fn last_node(&self, vehicle: usize) -> Option<&Node> {
        let node = self.last_state(vehicle)?.last_node_id.text()?;
        self.setup.layout.as_ref()?.node(node)
    }
}
