//! The faults that `cargo test` tries: one share of eight, and all that the change is about.
//!
//! `QUALIFY_SHARE` is the number of the share (0 unless set), `QUALIFY_ROTATION` a number that is another one each day, of
//! which the share is taken instead, `QUALIFY_BASE` what
//! the change is held against (unless set, where the branch leaves `main`).

use std::collections::BTreeSet;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::process::Command;

use vda5050_tck::judge::Library;
use vda5050_tck::pack::Role;
use vda5050_tck::reference::Fault;
use vda5050_tck::simulate::BuiltIn;

use crate::seed::share;

/// One in so many is tried.
const SHARE: u64 = 8;

/// The share of a side.
pub fn faults(library: &Library, role: Role) -> Vec<Fault> {
    let rotation = std::env::var("QUALIFY_ROTATION").ok();
    let rotation = rotation.and_then(|day| day.trim().parse::<u64>().ok());
    let number = rotation.unwrap_or_else(share) % SHARE;
    let base = std::env::var("QUALIFY_BASE")
        .ok()
        .or_else(|| git(&["merge-base", "main", "HEAD"]));
    let change = base.and_then(|base| git(&["diff", "--unified=0", base.trim(), "--", "src", "crates", "suites"]));
    let change = change.unwrap_or_default();
    let touched = touched(library, role, &change);
    let is_drawn = |fault: &Fault| {
        let mut hasher = DefaultHasher::new();
        fault.name.hash(&mut hasher);
        hasher.finish() % SHARE == number
    };
    let all = BuiltIn::faults(role).iter();
    let tried: Vec<Fault> = all
        .filter(|fault| is_drawn(fault) || touched.contains(fault.name))
        .copied()
        .collect();
    println!(
        "{role}: {} faults, share {number} of {SHARE}, {} for the change",
        tried.len(),
        touched.len()
    );
    tried
}

/// What git answers in this folder; `None` where there is no git, or where git refuses.
fn git(arguments: &[&str]) -> Option<String> {
    let folder = env!("CARGO_MANIFEST_DIR");
    let output = Command::new("git")
        .arg("-C")
        .arg(folder)
        .args(arguments)
        .output()
        .ok()?;
    output
        .status
        .success()
        .then(|| String::from_utf8_lossy(&output.stdout).into_owned())
}

/// The faults that a change names, and those that are about a requirement of a test or monitor whose file is in it.
fn touched(library: &Library, role: Role, change: &str) -> BTreeSet<&'static str> {
    let lines = change.lines().filter(|line| line.starts_with(['+', '-']));
    let words: BTreeSet<&str> = lines
        .flat_map(|line| line.split(|letter: char| !(letter.is_ascii_alphanumeric() || letter == '-')))
        .collect();
    let paths: BTreeSet<&str> = change.lines().filter_map(|line| line.strip_prefix("+++ b/")).collect();
    let suites = &library.rules.suites;
    let mut about: BTreeSet<String> = BTreeSet::new();
    for test in suites.tests.iter().filter(|test| test.device == role) {
        if paths.contains(test.source.name.as_str()) {
            about.extend(test.requirements().iter().map(ToString::to_string));
        }
    }
    let is_touched =
        |fault: &&Fault| words.contains(fault.name) || fault.breaks.first().is_some_and(|id| about.contains(*id));
    BuiltIn::faults(role)
        .iter()
        .filter(is_touched)
        .map(|fault| fault.name)
        .collect()
}

#[test]
fn a_change_draws_the_faults_it_names_and_those_of_the_tests_it_is_in() {
    let library = vda5050_tck::library(None).unwrap_or_else(|_| panic!("the suites load"));
    let named = touched(
        &library,
        Role::Agv,
        "+++ b/src/x.rs\n+    StateQosOne \"state-qos-1\" [\"MQTT-07\"]\n",
    );
    assert_eq!(named.into_iter().collect::<Vec<_>>(), ["state-qos-1"]);
    let test = "+++ b/suites/agv/order-rejection/lower-update-id.yaml\n+title: another\n";
    assert!(touched(&library, Role::Agv, test).contains("outdated-update-taken-over"));
    assert!(touched(&library, Role::MasterControl, test).is_empty());
}
