//! The mock AGVs of a run over real sockets, beside the hooks of the device under test.

use std::time::Duration;

use serde_json::{Map, Value};

use super::driver::RunningDevice;
use super::fleet::Fleet;
use tck_base::clock::WallClock;
use tck_engine::{Asks, HookOutcome, Operator};
use tck_net::bench::endpoint::Endpoint;
use tck_net::link::mqtt::Reporter;
use tck_reference::deviations::agv::mock;

/// How long a vehicle may take to sign off.
const GOODBYE_LIMIT: Duration = Duration::from_secs(2);

/// Hooks, and the mock AGVs of the harness; none when an AGV is tested.
pub struct WithFleet<O> {
    operator: O,
    vehicles: Vec<RunningDevice>,
}

impl<O> WithFleet<O> {
    /// Hooks alone, for an AGV under test.
    pub fn alone(operator: O) -> Self {
        Self {
            operator,
            vehicles: Vec::new(),
        }
    }

    /// Starts the vehicles at the broker itself, not at the tap. What they publish is reported as sent by the harness.
    pub fn start(operator: O, fleet: &Fleet, broker: &Endpoint, clock: WallClock, reporter: &Reporter) -> Self {
        let mut vehicles = Vec::with_capacity(fleet.vehicles.len());
        for vehicle in &fleet.vehicles {
            let agv = mock(vehicle.config.clone());
            vehicles.push(RunningDevice::start(agv, broker.clone(), clock, Some(reporter.clone())));
        }
        Self { operator, vehicles }
    }

    /// Signs the vehicles off, with the last word of a vehicle that goes; gives the hooks back.
    pub async fn stop(self) -> O {
        for vehicle in self.vehicles {
            let said = tokio::time::timeout(GOODBYE_LIMIT, vehicle.command("shutdown", Value::Null)).await;
            match said {
                Ok(_) => vehicle.stop().await,
                // Nobody takes what it reports any more.
                Err(_) => vehicle.kill().await,
            }
        }
        self.operator
    }
}

impl<O: Operator> Operator for WithFleet<O> {
    fn hooks(&self) -> Vec<String> {
        self.operator.hooks()
    }

    fn unattended(&self) -> Vec<String> {
        self.operator.unattended()
    }

    async fn run(&mut self, hook: &str, parameters: Map<String, Value>) -> HookOutcome {
        self.operator.run(hook, parameters).await
    }

    fn asks(&self, hook: &str, parameters: &Map<String, Value>) -> Option<Asks> {
        self.operator.asks(hook, parameters)
    }

    fn natural_traffic(&self, hook: &str) -> Option<Duration> {
        self.operator.natural_traffic(hook)
    }

    fn has_program(&self) -> bool {
        self.operator.has_program()
    }

    async fn start_program_again(&mut self) -> Result<(), String> {
        self.operator.start_program_again().await
    }

    async fn end(&mut self) {
        self.operator.end().await;
    }

    fn usual_time(&self) -> Duration {
        self.operator.usual_time()
    }

    async fn vehicle(&mut self, number: usize, what: &str, with: Value) -> bool {
        match self.vehicles.get(number) {
            Some(vehicle) => vehicle.command(what, with).await,
            None => false,
        }
    }

    fn runs_on_the_link(&self) -> bool {
        self.operator.runs_on_the_link()
    }
}
