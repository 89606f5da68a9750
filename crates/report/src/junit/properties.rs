//! The properties of suites and cases, which `junit_report` cannot write.
//!
//! The names of cases' properties are those that Xray and `TestRail` read (`test_key`, `requirements`, `testrun_comment`; `test_id`),
//! and for all others some of our own, which both pass over. Xray takes `test_id` for a number of its own, so that a case has
//! one of the two and never both.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use askama::filters::Escaper as _;

use super::xml::{attribute, with_tags};
use crate::cases::{Case, Elsewhere};
use crate::html::Escape;
use crate::keys::{Key, Keys};
use tck_base::verdict::Verdict;
use tck_result::RunResult;

/// The suite of requirements that test management knows as tests.
pub(super) const REQUIREMENTS: &str = "requirements";

/// An element with these properties; what has no value is left out.
fn element<'v>(all: impl IntoIterator<Item = (&'static str, Option<&'v str>)>) -> String {
    let mut text = String::from("<properties>");
    for (name, value) in all.into_iter().filter_map(|(name, value)| Some((name, value?))) {
        let mut escaped = String::new();
        // Writing to a text does not fail.
        let _ = Escape.write_escaped_str(&mut escaped, &attribute(value));
        let _ = write!(text, "<property name=\"{name}\" value=\"{escaped}\"/>");
    }
    text + "</properties>"
}

/// Puts what is known of the run into the first suite, which is about the run. The writer escapes `>` in attributes, so
/// that the first one ends the tag.
pub(super) fn of_run(xml: &str, result: &RunResult, root: Option<&str>) -> String {
    let Some(begin) = xml.find("<testsuite ") else {
        return xml.to_owned();
    };
    let Some(end) = xml[begin..].find('>').map(|at| begin + at + 1) else {
        return xml.to_owned();
    };
    let device = &result.device;
    let root = root.map(|root| format!("sha256:{root}"));
    let shard = result.shard.as_ref();
    let origin = shard.map(|shard| shard.origin.as_str());
    let shard = shard.map(|shard| format!("{}/{}", shard.index, shard.of));
    let parts = result.merged.as_ref().map(|merged| {
        let own = merged.parts.iter().filter(|part| part.counts).count();
        format!("{own} of {}", merged.of)
    });
    let properties = element([
        ("tool", Some(result.tool.as_str())),
        ("run", Some(&result.run)),
        ("mode", result.mode.as_deref()),
        ("verdict", result.verdict.map(Verdict::word)),
        ("role", Some(&result.role)),
        ("protocol", Some(&result.protocol)),
        ("manufacturer", Some(&device.manufacturer)),
        ("serialNumber", Some(&device.serial_number)),
        ("firmwareVersion", result.setting("certificate.firmware-version")),
        ("counterpart", result.setting("counterpart")),
        ("suites", Some(&result.suites_sha256)),
        ("shard", shard.as_deref()),
        ("shardOrigin", origin),
        ("parts", parts.as_deref()),
        ("root", root.as_deref()),
    ]);
    format!("{}{properties}{}", &xml[..end], &xml[end..])
}

/// Puts its properties into each case. The cases stand in the text in this order.
pub(super) fn of_cases(xml: &str, all: &[Case<'_>], keys: &Keys) -> String {
    let worst = worst_of_each(all, keys);
    let mut numbered = all.iter().enumerate();
    with_tags(xml, |tag| {
        let opened = tag.strip_prefix("<testcase")?;
        let (at, case) = numbered.next()?;
        let own = match key_of(case, keys) {
            // Of several results of one test case TestRail shows the last, and not the worst.
            Some(Key::TestRail(key)) if worst.get(key.as_str()) != Some(&at) => None,
            own => own,
        };
        let properties = of_case(case, own, keys);
        Some(match opened.strip_suffix("/>") {
            Some(alone) => format!("<testcase{}>{properties}</testcase>", alone.trim_end()),
            None => format!("{tag}{properties}"),
        })
    })
}

/// A requirement that has a case of its own goes by its id, all else by its name.
fn key_of<'k>(case: &Case<'_>, keys: &'k Keys) -> Option<&'k Key> {
    keys.get(if case.suite == REQUIREMENTS {
        case.kind
    } else {
        &case.name
    })
}

/// Which of the cases with the same key of `TestRail` ended worst: the first of them.
fn worst_of_each<'k>(all: &[Case<'_>], keys: &'k Keys) -> BTreeMap<&'k str, usize> {
    let mut worst: BTreeMap<&str, usize> = BTreeMap::new();
    for (at, case) in all.iter().enumerate() {
        let Some(Key::TestRail(key)) = key_of(case, keys) else {
            continue;
        };
        let best = worst.entry(key).or_insert(at);
        if case.counted() > all[*best].counted() {
            *best = at;
        }
    }
    worst
}

fn of_case(case: &Case<'_>, own: Option<&Key>, keys: &Keys) -> String {
    let (xray, testrail) = match own {
        Some(Key::Jira(key)) => (Some(key.as_str()), None),
        Some(Key::TestRail(key)) => (None, Some(key.as_str())),
        None => (None, None),
    };
    let covered = case.requirements.iter().filter_map(|id| match keys.get(id)? {
        Key::Jira(key) => Some(key.as_str()),
        Key::TestRail(_) => None,
    });
    let covered = joined(covered);
    let about = joined(case.requirements.iter().copied());
    // JUnit has no word for it.
    let comment = format!("{}: {}", case.word(), case.message);
    let comment = (case.verdict == Some(Verdict::Warning)).then_some(comment.as_str());
    element([
        ("test_key", xray),
        ("requirements", covered.as_deref()),
        ("testrun_comment", comment.filter(|_| xray.is_some())),
        ("test_id", testrail),
        ("testrail_result_comment", comment.filter(|_| testrail.is_some())),
        ("vda5050.verdict", Some(case.word())),
        ("vda5050.counted-in", case.elsewhere.map(Elsewhere::word)),
        ("vda5050.title", Some(case.title).filter(|title| !title.is_empty())),
        ("vda5050.requirements", about.as_deref()),
    ])
}

fn joined<'t>(texts: impl Iterator<Item = &'t str>) -> Option<String> {
    let all: Vec<&str> = texts.collect();
    (!all.is_empty()).then(|| all.join(","))
}
