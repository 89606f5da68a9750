//! Devices nobody of this project wrote: the AGV and the master control of the npm package vda-5050-lib, each as it is
//! shipped and with one obstacle removed. The harness must find exactly what stands in their lists of expected findings,
//! each traced to a place in the library, and must accuse them of nothing else. The audit of each journal must find what the
//! monitors of its run found.
//!
//! Both variants of both devices are run at once, each on several benches (`--shard`), because most of the time is waiting.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use serde_json::Value;

/// A foreign device.
struct Device {
    /// Where it is, with its profiles and its list of expected findings.
    folder: &'static str,
    /// Name in the list, profile, and number of benches.
    variants: [(&'static str, &'static str, usize); 2],
}

const AGV: Device = Device {
    folder: "fixtures/devices/vda-5050-lib-agv",
    variants: [
        ("as-shipped", "device.toml", 10),
        ("translated", "device-translated.toml", 6),
    ],
};

const MASTER_CONTROL: Device = Device {
    folder: "fixtures/devices/vda-5050-lib-master",
    variants: [
        ("as-shipped", "device.toml", 6),
        ("translated", "device-translated.toml", 6),
    ],
};

/// Verdict by requirement.
type Verdicts = BTreeMap<String, String>;

/// What a run found: the worst verdict by requirement, and what the harness says about it.
#[derive(Default)]
struct Found {
    verdicts: Verdicts,
    explanations: BTreeMap<String, Vec<String>>,
}

impl Found {
    fn add(&mut self, requirement: &Value, verdict: &Value, by: &Value, message: &Value) {
        let (Some(requirement), Some(verdict)) = (requirement.as_str(), verdict.as_str()) else {
            return;
        };
        if verdict != "fail" && verdict != "warning" {
            return;
        }
        let worst = self
            .verdicts
            .entry(requirement.to_owned())
            .or_insert_with(|| verdict.to_owned());
        if verdict == "fail" {
            "fail".clone_into(worst);
        }
        let line = format!(
            "{verdict} by {}: {}",
            by.as_str().unwrap_or("?"),
            message.as_str().unwrap_or("?")
        );
        self.explanations.entry(requirement.to_owned()).or_default().push(line);
    }

    /// Adds what a result has; a test that is an error is reported.
    fn read(&mut self, result: &Value, variant: &str, report: &mut String) {
        for test in list(result, "tests") {
            if test["verdict"] == "error" {
                let _ = writeln!(report, "{variant}: {} is an error: {}", test["id"], test["reason"]);
            }
            for decision in list(test, "decisions") {
                let (requirement, verdict) = (&decision["requirement"], &decision["verdict"]);
                self.add(requirement, verdict, &test["id"], &decision["message"]);
            }
        }
        for monitor in list(result, "monitors") {
            for finding in list(monitor, "findings") {
                let (requirement, verdict) = (&finding["requirement"], &finding["verdict"]);
                self.add(requirement, verdict, &monitor["id"], &finding["message"]);
            }
        }
    }
}

/// One bench: a harness that starts its own broker and its own device.
struct Bench {
    name: String,
    out: PathBuf,
    process: Child,
}

impl Bench {
    fn start(folder: &str, variant: &str, profile: &str, shard: usize, of: usize) -> Self {
        let name = format!("{variant}, bench {shard} of {of}");
        let device = Path::new(folder).file_name().unwrap().to_string_lossy();
        let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{device}-{variant}-{shard}"));
        let _ = std::fs::remove_dir_all(&out);
        let process = Command::new(env!("CARGO_BIN_EXE_vda5050-tck"))
            .args([
                "run",
                "--profile",
                &format!("{folder}/{profile}"),
                "--shard",
                &format!("{shard}/{of}"),
            ])
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

fn list<'v>(value: &'v Value, name: &str) -> impl Iterator<Item = &'v Value> {
    value[name].as_array().into_iter().flatten()
}

/// The list that is checked in.
fn expected(folder: &str, variant: &str) -> Vec<toml::Table> {
    let text = std::fs::read_to_string(format!("{folder}/expected-findings.toml")).unwrap();
    let table: toml::Table = text.parse().unwrap();
    let all = table["finding"].as_array().unwrap().iter();
    let findings = all.map(|finding| finding.as_table().unwrap().clone());
    let about = |finding: &toml::Table| {
        let names = finding.get("variants").or_else(|| finding.get("vehicles"));
        let names = names.and_then(toml::Value::as_array).unwrap();
        names.iter().any(|name| name.as_str() == Some(variant))
    };
    findings.filter(about).collect()
}

fn text<'t>(table: &'t toml::Table, name: &str) -> &'t str {
    table.get(name).and_then(toml::Value::as_str).unwrap_or_default()
}

/// Whether a finding depends on where the vehicle happens to drive: it may come or not.
fn is_sometimes(finding: &toml::Table) -> bool {
    finding.get("sometimes").and_then(toml::Value::as_bool) == Some(true)
}

/// What differs between the list and the run; empty when nothing does.
fn differences(expected: &[toml::Table], found: &Found) -> String {
    let mut report = String::new();
    let listed: Verdicts = expected
        .iter()
        .map(|finding| {
            (
                text(finding, "requirement").to_owned(),
                text(finding, "verdict").to_owned(),
            )
        })
        .collect();
    // What may not come at all may also come in its weaker form.
    let weaker = |requirement: &str, verdict: &str| {
        let mut fails = expected.iter().filter(|finding| is_sometimes(finding));
        verdict == "warning" && fails.any(|finding| text(finding, "requirement") == requirement)
    };
    for (requirement, verdict) in &found.verdicts {
        if listed.get(requirement) != Some(verdict) && !weaker(requirement, verdict) {
            let _ = writeln!(report, "  new: {requirement} {verdict}");
            for line in &found.explanations[requirement] {
                let _ = writeln!(report, "       {line}");
            }
        }
    }
    for finding in expected.iter().filter(|finding| !is_sometimes(finding)) {
        let requirement = text(finding, "requirement");
        if found.verdicts.get(requirement).map(String::as_str) != Some(text(finding, "verdict")) {
            let (verdict, because) = (text(finding, "verdict"), text(finding, "because"));
            let _ = writeln!(report, "  gone: {requirement} {verdict}, although {because}");
        }
    }
    report
}

/// The benches of both variants of a device, where it is installed.
fn start(device: &Device) -> Option<[(&'static str, Vec<Bench>); 2]> {
    let folder = device.folder;
    if !Path::new(folder)
        .join("node_modules/vda-5050-lib/package.json")
        .exists()
    {
        let missing = format!("the foreign device is not installed: run `npm ci` in {folder}");
        assert!(std::env::var_os("CI").is_none(), "{missing}");
        eprintln!("skipped: {missing}");
        return None;
    }
    Some(device.variants.map(|(variant, profile, of)| {
        let benches = (1..=of).map(|shard| Bench::start(folder, variant, profile, shard, of));
        (variant, benches.collect())
    }))
}

/// What differs from the list of a device; empty when nothing does.
fn read(device: &Device, variants: [(&str, Vec<Bench>); 2]) -> String {
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
        let differences = differences(&expected(folder, variant), &found);
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
    let started = [AGV, MASTER_CONTROL].map(|device| (start(&device), device));
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

#[test]
fn every_expected_finding_is_listed_once_and_says_why() {
    let both = [AGV, MASTER_CONTROL];
    let variants = both
        .iter()
        .flat_map(|device| device.variants.map(|(variant, ..)| (device.folder, variant)));
    for (folder, variant) in variants {
        let mut seen = Verdicts::new();
        for finding in expected(folder, variant) {
            let requirement = text(&finding, "requirement").to_owned();
            assert!(
                !text(&finding, "because").trim().is_empty(),
                "{requirement} does not say why"
            );
            assert!(
                !text(&finding, "when").trim().is_empty(),
                "{requirement} does not say when"
            );
            let kind = text(&finding, "kind");
            assert!(
                ["true finding", "integration", "interpretation", "consequence"].contains(&kind),
                "{requirement}: {kind}"
            );
            let verdict = text(&finding, "verdict").to_owned();
            assert!(
                ["fail", "warning"].contains(&verdict.as_str()),
                "{requirement}: {verdict}"
            );
            assert_eq!(
                seen.insert(requirement.clone(), verdict),
                None,
                "{requirement} is listed twice for {variant}"
            );
        }
        assert!(!seen.is_empty(), "nothing is expected of {variant} in {folder}");
    }
}

#[test]
fn a_finding_that_is_new_gone_or_changed_is_a_difference() {
    let finding = |requirement: &str, verdict: &str| -> toml::Table {
        format!("requirement = \"{requirement}\"\nverdict = \"{verdict}\"\nbecause = \"x.js\"")
            .parse()
            .unwrap()
    };
    let mut found = Found::default();
    let value = |text: &str| Value::String(text.to_owned());
    found.add(&value("A-1"), &value("warning"), &value("t"), &value("odd"));
    found.add(&value("A-1"), &value("pass"), &value("t"), &value("fine"));
    assert_eq!(differences(&[finding("A-1", "warning")], &found), "");
    assert!(differences(&[], &found).contains("new: A-1 warning"));
    assert!(differences(&[finding("A-1", "warning"), finding("A-2", "fail")], &found).contains("gone: A-2 fail"));
    found.add(&value("A-1"), &value("fail"), &value("t"), &value("worse"));
    assert!(differences(&[finding("A-1", "warning")], &found).contains("new: A-1 fail"));
}

#[test]
fn a_finding_that_may_stay_out_may_also_come_as_a_warning_only() {
    let finding = "requirement = \"A-1\"\nverdict = \"fail\"\nsometimes = true\nbecause = \"x.js\"";
    let listed: toml::Table = finding.parse().unwrap();
    let mut found = Found::default();
    assert_eq!(differences(std::slice::from_ref(&listed), &found), "");
    let value = |text: &str| Value::String(text.to_owned());
    found.add(&value("A-1"), &value("warning"), &value("t"), &value("odd"));
    assert_eq!(differences(std::slice::from_ref(&listed), &found), "");
    found.add(&value("A-2"), &value("warning"), &value("t"), &value("odd"));
    assert!(differences(&[listed], &found).contains("new: A-2 warning"));
}
