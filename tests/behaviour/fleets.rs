//! One fleet of several processes before one master control, at the two nodes of a cluster of brokers.

use std::fs;
use std::time::Duration;

use serde_json::Value;

use crate::bench::{Bench, bundles};
use crate::cluster::Cluster;
use crate::sharing::read;
use crate::tool::{Ended, Running, tool};

/// What every part does with its own vehicles: the first tests are about one or two of them, the last about all.
const TESTS: [&str; 3] = ["dispatch/one-edge", "dispatch/two-in-a-row", "fleet/whole-fleet"];

/// A profile of the simulated master control, which nobody starts: its hooks are at this address.
fn profile(hooks: &str) -> String {
    let named = [
        ("dispatch", "vehicle from to loadType action"),
        ("cancel", "vehicle"),
        ("request-state", "vehicle"),
    ];
    let named = named.map(|(name, parameters)| {
        let body: Vec<String> = parameters
            .split(' ')
            .map(|parameter| format!("\"{parameter}\": \"{{{parameter}}}\""))
            .collect();
        let body = body.join(", ");
        format!("[hooks.{name}]\nhttp = {{ url = \"http://{hooks}/hooks/{name}\", body = '{{ {body} }}' }}\n")
    });
    let time = "connect = \"20 s\"\ndrive = \"20 s\"\nquiet = \"500 ms\"\nsettle = \"300 ms\"\nreconnect = \"1 s\"\nslow = \"20 s\"\n";
    format!(
        "[device]\nrole = \"master-control\"\nmanufacturer = \"vda5050-tck\"\nserial-number = \"reference\"\n\
         [bench]\ntap = false\n[time]\n{time}{}",
        named.concat()
    )
}

/// A master control before a fleet that several processes play.
struct Fleet {
    bench: Bench,
    cluster: Cluster,
    vehicles: usize,
    of: usize,
    _master_control: Running,
}

impl Fleet {
    fn before_a_master_control(cluster: Cluster, vehicles: usize, of: usize) -> Self {
        let bench = Bench::new();
        let (count, broker) = (vehicles.to_string(), cluster.url(0));
        let arguments = ["simulate", "master-control", "--vehicles", &count, "--broker", &broker];
        let mut master_control = Running::start(&mut tool(bench.path(), &arguments));
        let hooks = master_control.line("hooks are served at http://");
        fs::write(bench.path().join("device.toml"), profile(&hooks)).unwrap();
        Self {
            bench,
            cluster,
            vehicles,
            of,
            _master_control: master_control,
        }
    }

    /// Starts the process of a part. The first half is at one node, the rest at the other.
    fn start(&self, part: usize) -> Running {
        let node = usize::from(part > self.of / 2);
        let (own, other) = (self.cluster.url(node), self.cluster.url(1 - node));
        let (vehicles, shard) = (self.vehicles.to_string(), format!("{part}/{}", self.of));
        let (out, events) = (format!("parts/{part}"), events(part));
        let bench = [
            "run",
            "--profile",
            "device.toml",
            "--broker",
            &own,
            "--vehicles",
            &vehicles,
        ];
        let output = ["--shard", &shard, "--out", &out, "--events", &events, "--quiet"];
        let mut command = tool(self.bench.path(), &[&bench[..], &output, &TESTS].concat());
        Running::start(command.env("VDA5050_TCK_BENCH_CLUSTER", other))
    }

    fn result(&self, part: usize) -> Value {
        let all = bundles(&self.bench.path().join(format!("parts/{part}")));
        assert_eq!(all.len(), 1, "{all:?}");
        read(&all[0].join("result.json"))
    }

    fn merge(&self, parts: &[usize], out: &str) -> Ended {
        let parts: Vec<String> = parts.iter().map(|part| format!("parts/{part}")).collect();
        let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
        self.bench
            .run(&[&["report", "--merge"], &parts[..], &["--out", out]].concat())
    }

    /// Holds that in what was joined every vehicle has got an order, and nothing is missing.
    fn is_whole(&self, out: &str) {
        let whole = read(&self.bench.path().join(out).join("result.json"));
        assert_eq!(whole["merged"].get("troubles"), None);
        assert_eq!(whole["verdict"], "pass", "{:#}", whole["requirements"]);
        let fleet = &whole["fleet"];
        for count in ["vehicles", "commanded"] {
            assert_eq!(fleet[count], self.vehicles, "{fleet:#}");
        }
        for number in 1..=self.vehicles {
            let name = format!("mock-{number}");
            let mut each = fleet["each"].as_array().unwrap().iter();
            assert!(
                each.any(|one| one["serialNumber"] == name.as_str()),
                "{name} is judged by nobody"
            );
        }
    }
}

fn events(part: usize) -> String {
    format!("events-{part}.jsonl")
}

/// What a run against the reference AGV at the first node says of the broker. Nodes that have just become one may still end
/// connections.
fn limits(cluster: &Cluster) -> String {
    let broker = cluster.url(0);
    let run = |bench: &Bench| {
        let mut command = tool(
            bench.path(),
            &["run", "--reference", "--broker", &broker, "order-acceptance"],
        );
        Running::start(command.env("VDA5050_TCK_BENCH_CLUSTER", cluster.url(1))).end()
    };
    let mut bench = Bench::new();
    let mut ended = run(&bench);
    for _ in 0..4 {
        if !ended.stderr.contains("cannot be used: the connection ended") {
            break;
        }
        bench = Bench::new();
        ended = run(&bench);
    }
    ended.code(0);
    bench.is_whole();
    bench.result()["limits"].to_string()
}

#[test]
fn what_nodes_of_nats_do_otherwise_is_found() {
    let Some(cluster) = Cluster::nats() else { return };
    let said = limits(&cluster);
    for difference in [
        "whoever publishes with QoS 2",
        "whoever publishes on a topic with a `.`",
    ] {
        assert!(said.contains(difference), "{said}");
    }
    for rule in [
        "passes on with QoS 1",
        "nothing that is retained",
        "keeps what is retained",
    ] {
        assert!(!said.contains(rule), "{said}");
    }
}

#[test]
fn four_processes_at_two_nodes_of_rabbitmq_are_one_fleet_and_a_killed_one_is_missed_and_changes_no_other_verdict() {
    let Some(cluster) = Cluster::rabbitmq() else { return };
    let said = limits(&cluster);
    for difference in [
        "passes on with QoS 1 what is published with QoS 2",
        "changes topics with a `.` in them",
        "gives a subscription with a wildcard nothing that is retained",
        "keeps what is retained from subscribers at mqtt://127.0.0.1:",
    ] {
        assert!(said.contains(difference), "no `{difference}` in {said}");
    }
    // A vehicle whose topics it would change cannot be judged there.
    let bench = Bench::new();
    let broker = cluster.url(0);
    let device = ["--manufacturer", "ACME", "--serial", "agv.1", "--listen", "127.0.0.1:0"];
    bench
        .run(&[&["run", "--broker", &broker], &device[..], &["order-acceptance"]].concat())
        .code(5)
        .says("a device with a `.` in its names is not reached");

    let fleet = Fleet::before_a_master_control(cluster, 40, 4);
    let others = [1, 2, 4].map(|part| (part, fleet.start(part)));
    let mut killed = fleet.start(3);
    let path = fleet.bench.path().join(events(3));
    killed.until("a test of the third part", |_| {
        let text = fs::read_to_string(&path).unwrap_or_default();
        text.contains("\"event\":\"test-ended\"").then_some(())
    });
    killed.kill();
    for (part, running) in others {
        running.end().code(0);
        assert_eq!(fleet.result(part)["verdict"], "pass", "part {part}");
    }
    fleet
        .merge(&[1, 2, 3, 4], "broken-off")
        .code(3)
        .prints("part 3 of 4 ended before its plan did");
    fleet.merge(&[1, 2, 4], "open").code(3).prints("part 3 of 4 is missing");
    let open = read(&fleet.bench.path().join("open/result.json"));
    assert!(
        open["tests"]
            .as_array()
            .unwrap()
            .iter()
            .all(|test| test["verdict"] == "pass"),
        "{:#}",
        open["tests"]
    );
    assert_eq!(open["fleet"]["commanded"], 30);
    // Tried again, it touches what its own vehicles have left, and no other.
    fs::remove_dir_all(fleet.bench.path().join("parts/3")).unwrap();
    let again = fleet.start(3).end().code(0);
    for other in ["mock-1/", "mock-20/", "mock-31/"] {
        assert!(!again.stderr.contains(other), "{}", again.stderr);
    }
    fleet.merge(&[1, 2, 3, 4], "whole").code(0);
    fleet.is_whole("whole");
}

#[test]
#[ignore = "takes minutes and all of the machine; BENCHMARKS.md says how it is run"]
fn five_thousand_vehicles_of_four_processes_at_two_brokers_are_judged_each() {
    let Some(cluster) = Cluster::mosquitto() else { return };
    let fleet = Fleet::before_a_master_control(cluster, 5_000, 4);
    let parts = [1, 2, 3, 4].map(|part| (part, fleet.start(part)));
    for (part, running) in parts {
        running.end_within(Duration::from_secs(1_200)).code(0);
        assert_eq!(fleet.result(part)["verdict"], "pass", "part {part}");
    }
    fleet.merge(&[1, 2, 3, 4], "whole").code(0);
    fleet.is_whole("whole");
}
