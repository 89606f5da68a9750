//! The suites on foreign devices, and the audit of each journal, which must find what the monitors of its run found.
//!
//! All variants of all devices are run at once, each on several benches (`--shard`), because most of the time is waiting.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use serde_json::Value;

use super::listed::{Found, Way, differences, expected, list};
use super::{ALL, Device, Variant};

/// One bench: a harness that starts its own broker and its own device.
struct Bench {
    name: String,
    out: PathBuf,
    process: Child,
}

impl Bench {
    fn start(device: &Device, variant: &Variant, shard: usize) -> Self {
        let (folder, of) = (device.folder, variant.benches);
        let name = format!("{folder}, {}, bench {shard} of {of}", variant.name);
        let short = Path::new(folder).file_name().unwrap().to_string_lossy();
        let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{short}-{}-{shard}", variant.name));
        let _ = std::fs::remove_dir_all(&out);
        let process = Command::new(env!("CARGO_BIN_EXE_vda5050-tck"))
            .args([
                "run",
                "--profile",
                &format!("{folder}/{}", variant.profile),
                "--shard",
                &format!("{shard}/{of}"),
            ])
            .args(device.left_out.iter().flat_map(|tests| ["--exclude", tests]))
            .arg("--out")
            .arg(&out)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        Self { name, out, process }
    }

    /// The result of a run that went to its end, or why there is none.
    fn result(&mut self) -> Result<Value, String> {
        let code = self
            .process
            .wait()
            .map_err(|error| format!("{}: {error}", self.name))?
            .code();
        let bytes = find(&self.out, "result.json").and_then(|path| std::fs::read(path).ok());
        let result: Value = bytes
            .and_then(|bytes| serde_json::from_slice(&bytes).ok())
            .unwrap_or_default();
        if !matches!(code, Some(0 | 1 | 3)) || result["partial"] != false {
            return Err(format!(
                "{}: ended with {code:?}: {}",
                self.name, result["partial_reason"]
            ));
        }
        Ok(result)
    }

    /// What the audit of its journal finds otherwise than the monitors of the run did; empty when nothing.
    fn audited(&self, result: &Value) -> String {
        let mut names = ["journal.jsonl", "journal.jsonl.gz"].into_iter();
        let Some(journal) = names.find_map(|name| find(&self.out, name)) else {
            return format!("{}: there is no journal\n", self.name);
        };
        let audit = Command::new(env!("CARGO_BIN_EXE_vda5050-tck"))
            .args(["audit", "--format", "json"])
            .arg(&journal)
            .stdin(Stdio::null())
            .output()
            .unwrap();
        let audited: Value = match serde_json::from_slice(&audit.stdout) {
            Ok(audited) => audited,
            Err(error) => {
                let words = String::from_utf8_lossy(&audit.stderr);
                return format!("{}: the audit gave nothing: {error}: {words}\n", self.name);
            }
        };
        let (run, audited) = (of_run(result), of_audit(&audited));
        let mut report = String::new();
        for [monitor, requirement, verdict, count] in audited.symmetric_difference(&run) {
            let by = if run.contains(&[monitor, requirement, verdict, count].map(Clone::clone)) {
                "the run alone"
            } else {
                "the audit alone"
            };
            let _ = writeln!(
                report,
                "{}: {monitor} {requirement} {verdict}, {count} times, by {by}",
                self.name
            );
        }
        report
    }
}

/// Monitor, requirement, verdict and count of what monitors found.
type ByMonitors = BTreeSet<[String; 4]>;

fn by_monitor(monitor: &Value, finding: &Value) -> [String; 4] {
    [monitor, &finding["requirement"], &finding["verdict"], &finding["count"]].map(ToString::to_string)
}

fn of_run(result: &Value) -> ByMonitors {
    let monitors = list(result, "monitors");
    let all = monitors.flat_map(|monitor| list(monitor, "findings").map(move |finding| (monitor, finding)));
    all.map(|(monitor, finding)| by_monitor(&monitor["id"], finding))
        .collect()
}

fn of_audit(audited: &Value) -> ByMonitors {
    let sides = list(audited, "vehicles").flat_map(|vehicle| list(vehicle, "sides"));
    let all = sides.flat_map(|side| list(side, "findings").chain(list(side, "information")));
    all.map(|finding| by_monitor(&finding["monitor"], finding)).collect()
}

fn find(folder: &Path, name: &str) -> Option<PathBuf> {
    for entry in std::fs::read_dir(folder).ok()?.flatten() {
        let path = entry.path();
        let found = if path.is_dir() {
            find(&path, name)
        } else {
            path.ends_with(name).then_some(path)
        };
        if found.is_some() {
            return found;
        }
    }
    None
}

/// The benches of all variants of a device, where it is installed.
fn start(device: &Device) -> Option<Vec<(&'static str, Vec<Bench>)>> {
    if !device.is_installed() {
        return None;
    }
    let benches = |variant: &Variant| -> Vec<Bench> {
        (1..=variant.benches)
            .map(|shard| Bench::start(device, variant, shard))
            .collect()
    };
    Some(
        device
            .variants
            .iter()
            .map(|variant| (variant.name, benches(variant)))
            .collect(),
    )
}

/// What differs from the list of a device; empty when nothing does.
fn read(device: &Device, variants: Vec<(&str, Vec<Bench>)>) -> String {
    let folder = device.folder;
    let mut report = String::new();
    for (variant, benches) in variants {
        let mut found = Found::default();
        for mut bench in benches {
            // Every bench is waited for, so that none is left behind.
            match bench.result() {
                Ok(result) => {
                    found.read(&result, variant, &mut report);
                    report += &bench.audited(&result);
                }
                Err(why) => drop(writeln!(report, "{why}")),
            }
        }
        let differences = differences(&expected(folder, variant, Way::Scripted), &found);
        if !differences.is_empty() {
            let _ = writeln!(
                report,
                "{variant}: the findings differ from {folder}/expected-findings.toml\n{differences}"
            );
        }
    }
    report
}

#[test]
fn the_harness_finds_in_foreign_devices_what_is_listed_and_nothing_else() {
    let started = ALL.map(|device| (start(&device), device));
    let reports = started.map(|(benches, device)| benches.map(|benches| read(&device, benches)));
    let report: String = reports.into_iter().flatten().collect();
    assert!(report.is_empty(), "{report}");
}

#[test]
fn what_only_the_run_or_only_the_audit_found_is_a_difference() {
    let finding = serde_json::json!({ "requirement": "A-1", "verdict": "fail", "count": 2 });
    let run = serde_json::json!({ "monitors": [{ "id": "a/b", "findings": [finding] }] });
    let mut found = finding.clone();
    found["monitor"] = "a/b".into();
    let audit = |findings: Value| serde_json::json!({ "vehicles": [{ "sides": [{ "findings": findings, "information": [] }] }] });
    assert_eq!(of_run(&run), of_audit(&audit(serde_json::json!([found]))));
    assert_eq!(of_run(&run).len(), 1);
    found["count"] = 3.into();
    assert_ne!(of_run(&run), of_audit(&audit(serde_json::json!([found]))));
}
