//! A run against a device of its own: profile, folder, and the process that is judged.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::tool::{Ended, Running, run_in, tool};

pub const MANUFACTURER: &str = "ACME";
pub const SERIAL: &str = "0001";

/// A test that needs no course and is over in a moment.
pub const QUICK: &str = "instant-actions/factsheet-request";
/// A test that sends an order, is over in a moment, and does not move the vehicle.
pub const REFUSAL: &str = "order-rejection/unreadable[truncated]";

/// A profile that knows four nodes of the reference floor, and is patient enough for a busy machine.
pub struct Profile {
    pub device: String,
    pub bench: String,
    pub motion: bool,
    /// No edge leads back.
    pub one_way: bool,
    pub time: Vec<(&'static str, &'static str)>,
    pub more: String,
}

impl Default for Profile {
    fn default() -> Self {
        Self {
            device: String::new(),
            bench: String::new(),
            motion: false,
            one_way: false,
            time: vec![
                ("connect", "20 s"),
                ("drive", "20 s"),
                ("event", "4 s"),
                ("quiet", "200 ms"),
                ("settle", "300 ms"),
                ("reconnect", "1 s"),
            ],
            more: String::new(),
        }
    }
}

impl Profile {
    /// For devices that do not answer: nothing is waited for long.
    pub fn impatient() -> Self {
        Self::default().with(&[("react", "500 ms"), ("slow", "400 ms")])
    }

    pub fn with(mut self, time: &[(&'static str, &'static str)]) -> Self {
        self.time
            .retain(|(name, _)| time.iter().all(|(other, _)| other != name));
        self.time.extend(time);
        self
    }

    pub fn text(&self) -> String {
        let time: Vec<String> = self
            .time
            .iter()
            .map(|(name, limit)| format!("{name} = \"{limit}\""))
            .collect();
        let time = time.join("\n");
        let mut ways = vec![("A1", "A2"), ("A2", "A3"), ("A3", "A4")];
        if !self.one_way {
            ways.extend(ways.clone().iter().map(|(from, to)| (*to, *from)));
        }
        let edge =
            |(from, to): &(&str, &str)| format!("  {{ id = \"{from}-{to}\", from = \"{from}\", to = \"{to}\" }},");
        let edges: Vec<String> = ways.iter().map(edge).collect();
        let edges = edges.join("\n");
        format!(
            r#"
[device]
manufacturer = "{MANUFACTURER}"
serial-number = "{SERIAL}"
{}
[bench]
listen = "127.0.0.1:0"
{}
[motion]
allowed = {}
[layout]
nodes = [
  {{ id = "A1", x = 0.0, y = 0.0, map = "reference-floor" }}, {{ id = "A2", x = 0.0, y = 2.0, map = "reference-floor" }},
  {{ id = "A3", x = 0.0, y = 4.0, map = "reference-floor" }}, {{ id = "A4", x = 0.0, y = 6.0, map = "reference-floor" }},
]
edges = [
{edges}
]
[time]
{time}
{}
"#,
            self.device, self.bench, self.motion, self.more
        )
    }
}

/// A folder for one run.
pub struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    pub fn new() -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
        }
    }

    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Runs the program in this folder.
    pub fn run(&self, arguments: &[&str]) -> Ended {
        run_in(self.path(), arguments)
    }

    /// Starts `run` for the device of a profile; gives where the device is expected.
    pub fn start(&self, profile: &Profile, arguments: &[&str]) -> (Running, u16) {
        std::fs::write(self.path().join("device.toml"), profile.text()).unwrap();
        let all = [&["run", "--profile", "device.toml"], arguments].concat();
        let mut running = Running::start(&mut tool(self.path(), &all));
        let address = running.line("the device is expected at mqtt://");
        let port = address.rsplit(':').next().and_then(|port| port.parse().ok());
        (running, port.unwrap_or_else(|| panic!("no port in {address}")))
    }

    /// A reference AGV in a process of its own, under the name of the profile.
    pub fn agv(&self, port: u16, faults: &[&str]) -> Running {
        let faults: Vec<&str> = faults.iter().flat_map(|fault| ["--fault", fault]).collect();
        self.agv_with(port, &faults)
    }

    /// A reference AGV in a process of its own, with these arguments.
    pub fn agv_with(&self, port: u16, more: &[&str]) -> Running {
        let broker = format!("mqtt://127.0.0.1:{port}");
        let mut arguments = vec![
            "simulate",
            "agv",
            "--broker",
            &broker,
            "--manufacturer",
            MANUFACTURER,
            "--serial",
            SERIAL,
        ];
        arguments.extend(more);
        Running::start(&mut tool(self.path(), &arguments))
    }

    /// The folder of the only run there was.
    pub fn bundle(&self) -> PathBuf {
        let runs = bundles(&self.path().join("reports"));
        assert_eq!(runs.len(), 1, "{runs:?}");
        runs[0].clone()
    }

    /// `result.json` of the only run there was.
    pub fn result(&self) -> Value {
        let text = std::fs::read(self.bundle().join("result.json")).unwrap();
        serde_json::from_slice(&text).unwrap()
    }

    /// The journal of the only run there was, packed or not.
    pub fn journal(&self) -> String {
        let bundle = self.bundle();
        std::fs::read_to_string(bundle.join("journal.jsonl")).unwrap_or_else(|_| {
            let packed = std::fs::File::open(bundle.join("journal.jsonl.gz")).unwrap();
            let mut text = String::new();
            let mut unpacked = flate2::read::MultiGzDecoder::new(packed);
            std::io::Read::read_to_string(&mut unpacked, &mut text).unwrap();
            text
        })
    }

    /// Holds that the run left a whole report that says it is partial, and a journal that is closed.
    #[track_caller]
    pub fn is_partial(&self) {
        let bundle = self.bundle();
        assert_eq!(self.result()["partial"], true);
        let journal = self.journal();
        let last: Value = serde_json::from_str(journal.lines().last().unwrap()).unwrap();
        assert_eq!(last["event"]["kind"], "run-ended", "{last}");
        assert_eq!(last["event"]["partial"], true, "{last}");
        let page = std::fs::read_to_string(bundle.join("report.html")).unwrap();
        assert!(
            page.to_lowercase().contains("partial"),
            "the report does not say that it is partial"
        );
        self.is_whole();
    }

    /// Holds that everything a bundle has is there, can be read, and is what the journal gives.
    #[track_caller]
    pub fn is_whole(&self) {
        let bundle = self.bundle();
        let junit = std::fs::read_to_string(bundle.join("junit.xml")).unwrap();
        roxmltree::Document::parse(&junit).unwrap_or_else(|error| panic!("{error}\n{junit}"));
        let shown = bundle.display().to_string();
        self.run(&["report", &shown, "--verify"]).code(0);
        self.run(&["report", &shown, "--rejudge"])
            .code(0)
            .prints("byte for byte");
        self.is_audited_like_its_run();
    }

    /// Holds that the audit finds in the journal what the monitors of the run found. Gives monitor, requirement and count.
    #[track_caller]
    pub fn is_audited_like_its_run(&self) -> BTreeSet<(String, String, String)> {
        let journal = self.path().join("audited.jsonl");
        std::fs::write(&journal, self.journal()).unwrap();
        let audited = self.run(&["audit", &journal.display().to_string(), "--format", "json"]);
        let audited: Value =
            serde_json::from_str(&audited.stdout).unwrap_or_else(|error| panic!("{error}\n{}", audited.stderr));
        let list = |holder: &Value, member: &str| holder[member].as_array().cloned().unwrap_or_default();
        let found = |monitor: &Value, finding: &Value| {
            [monitor, &finding["requirement"], &finding["count"]]
                .map(ToString::to_string)
                .into()
        };
        let side = &audited["vehicles"][0]["sides"][0];
        let all = [list(side, "findings"), list(side, "information")].concat();
        let of_audit: BTreeSet<_> = all.iter().map(|finding| found(&finding["monitor"], finding)).collect();
        let monitors = list(&self.result(), "monitors");
        let of_run = monitors.iter().flat_map(|monitor| {
            let findings = list(monitor, "findings").into_iter();
            findings.map(|finding| found(&monitor["id"], &finding))
        });
        assert_eq!(of_audit, of_run.collect());
        of_audit
    }
}

/// The folders of all runs below `reports`.
pub fn bundles(reports: &Path) -> Vec<PathBuf> {
    let list = |folder: &Path| -> Vec<PathBuf> {
        let entries = std::fs::read_dir(folder).into_iter().flatten();
        let paths = entries.map(|entry| entry.unwrap().path());
        // The link to the latest run is no run of its own.
        paths.filter(|path| !path.is_symlink()).collect()
    };
    list(reports).iter().flat_map(|device| list(device)).collect()
}
