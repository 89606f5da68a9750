//! What is expected of a foreign device: a list that is checked in, and how findings are compared with it.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use serde_json::Value;

use super::ALL;

/// How findings are looked for.
#[derive(Clone, Copy, PartialEq)]
pub enum Way {
    /// By the suites.
    Scripted,
    /// By conversations.
    Explored,
}

/// Verdict by requirement.
pub type Verdicts = BTreeMap<String, String>;

/// What a run found: the worst verdict by requirement, and what the harness says about it.
#[derive(Default)]
pub struct Found {
    pub verdicts: Verdicts,
    explanations: BTreeMap<String, Vec<String>>,
}

impl Found {
    pub fn add(&mut self, requirement: &Value, verdict: &Value, by: &Value, message: &Value) {
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
    pub fn read(&mut self, result: &Value, variant: &str, report: &mut String) {
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

pub fn list<'v>(value: &'v Value, name: &str) -> impl Iterator<Item = &'v Value> {
    value[name].as_array().into_iter().flatten()
}

/// The list that is checked in, as far as it is about this way of looking for findings.
pub fn expected(folder: &str, variant: &str, way: Way) -> Vec<toml::Table> {
    let text = std::fs::read_to_string(format!("{folder}/expected-findings.toml")).unwrap();
    let table: toml::Table = text.parse().unwrap();
    let all = table["finding"].as_array().unwrap().iter();
    let findings = all.map(|finding| finding.as_table().unwrap().clone());
    let about = |finding: &toml::Table| {
        let names = finding.get("variants").or_else(|| finding.get("vehicles"));
        let names = names.and_then(toml::Value::as_array).unwrap();
        names.iter().any(|name| name.as_str() == Some(variant))
    };
    findings
        .filter(about)
        .filter_map(|mut finding| {
            let by = finding.get("found-by").and_then(toml::Value::as_array).unwrap();
            let explored = by.iter().filter(|name| name.as_str() == Some("explore")).count();
            match way {
                // What only conversations find, the suites do not find.
                Way::Scripted if explored == by.len() => return None,
                // Conversations need not find what the suites find.
                Way::Explored if explored == 0 => drop(finding.insert("sometimes".to_owned(), true.into())),
                Way::Scripted | Way::Explored => {}
            }
            Some(finding)
        })
        .collect()
}

fn text<'t>(table: &'t toml::Table, name: &str) -> &'t str {
    table.get(name).and_then(toml::Value::as_str).unwrap_or_default()
}

/// Whether a finding depends on where the vehicle happens to drive: it may come or not.
fn is_sometimes(finding: &toml::Table) -> bool {
    finding.get("sometimes").and_then(toml::Value::as_bool) == Some(true)
}

/// What differs between the list and the run; empty when nothing does.
pub fn differences(expected: &[toml::Table], found: &Found) -> String {
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

#[test]
fn every_expected_finding_is_listed_once_and_says_why() {
    let variants = ALL
        .iter()
        .flat_map(|device| device.variants.iter().map(|variant| (device.folder, variant.name)));
    for (folder, variant) in variants {
        let mut seen = Verdicts::new();
        for finding in expected(folder, variant, Way::Explored) {
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
