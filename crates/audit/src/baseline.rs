//! An audit held against an earlier one: what was there before is no news.
//!
//! A finding is known when the baseline has one of the same vehicle and side, of the same requirement and monitor, that is at
//! least as bad, and about the same: where its sentence begins with a place in a message, such as `state/nodeStates/3/nodeId`, that
//! is the place, whatever its numbers and the words behind it; elsewhere it is the sentence, whatever names and numbers, and how many
//! of them, stand in it. How often it came does not matter.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use serde::Serialize;

use super::finding_group;
use super::result::{AuditResult, FindingResult, SideResult, VehicleResult};
use tck_base::verdict::Verdict;
use tck_report::cause;
use tck_report::clean::{line, short};

/// How many findings of a kind are listed for people.
const SHOWN: usize = 50;

/// What an audit has found that an earlier one had not, and the other way round.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Against {
    /// Where the baseline is.
    pub baseline: String,
    /// What there is to say about the baseline, one sentence each.
    pub notes: Vec<String>,
    /// What the baseline has not, or not so bad.
    pub new: Vec<Told>,
    /// How many findings the baseline has, too.
    pub known: usize,
    /// What the baseline has, and was not found any more.
    pub gone: Vec<Gone>,
    /// The verdict without what is known; absent when nothing was judged.
    pub rest: Option<Verdict>,
}

/// A finding of somebody.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Told {
    /// Manufacturer of the vehicle.
    pub manufacturer: String,
    /// Its serial number.
    pub serial_number: String,
    /// Which side is meant.
    pub role: String,
    /// The requirement.
    pub requirement: String,
    /// The monitor.
    pub monitor: String,
    /// The verdict.
    pub verdict: Verdict,
    /// The verdict it has in the baseline, which is better.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub before: Option<Verdict>,
    /// What is wrong.
    pub text: String,
}

/// A finding that was not made again.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Gone {
    /// The finding, as the baseline has it.
    #[serde(flatten)]
    pub finding: Told,
    /// Whether something came by which the same monitor decided the requirement. Otherwise nobody knows whether it is mended.
    pub judged: bool,
}

/// Why a baseline is none for an audit.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BaselineError {
    /// It is about others.
    #[error("the baseline is about {baseline}, and nothing of that is in the recording, which is about {found}")]
    AboutOthers {
        /// Whom the baseline judges.
        baseline: String,
        /// Whom the audit judges.
        found: String,
    },
}

/// What makes two findings the same.
type Key<'r> = (&'r str, &'r str, &'r str, &'r str, &'r str, String);

/// Holds an audit against an earlier one; `name` says where that is.
///
/// # Errors
/// When the earlier one judges no side of a vehicle that this one judges.
pub fn hold(result: &AuditResult, baseline: &AuditResult, name: &str) -> Result<Against, BaselineError> {
    let (now, before) = (sides(result), sides(baseline));
    let who = |sides: &BTreeSet<Side<'_>>| sides.iter().map(called).collect::<Vec<_>>().join("; ");
    if !now.is_empty() && now.is_disjoint(&before) {
        let bounded = |text: String| short(&text, 400).into_owned();
        return Err(BaselineError::AboutOthers {
            baseline: match before.is_empty() {
                true => "nobody".to_owned(),
                false => bounded(who(&before)),
            },
            found: bounded(who(&now)),
        });
    }
    let known: BTreeMap<Key<'_>, &FindingResult> = worst(baseline);
    let found = worst(result);
    let mut against = Against {
        baseline: name.to_owned(),
        notes: notes(result, baseline, &now, &before),
        new: Vec::new(),
        known: 0,
        gone: Vec::new(),
        rest: result.verdict.map(|_| Verdict::Pass),
    };
    for (key, finding) in &found {
        let before = known.get(key).map(|known| known.verdict);
        if before.is_some_and(|before| before >= finding.verdict) {
            against.known += 1;
            continue;
        }
        against.rest = against.rest.map(|rest| rest.join(finding.verdict));
        against.new.push(told(key, finding, before));
    }
    against.new.sort_by_key(|told| std::cmp::Reverse(told.verdict));
    let decided = decided(result);
    for (key, finding) in known.iter().filter(|(key, _)| !found.contains_key(*key)) {
        against.gone.push(Gone {
            finding: told(key, finding, None),
            judged: decided.contains(&(key.0, key.1, key.2, key.3, key.4)),
        });
    }
    Ok(against)
}

/// Manufacturer, serial number and role of somebody who was judged.
type Side<'r> = (&'r str, &'r str, &'r str);

fn called(side: &Side<'_>) -> String {
    let name = format!("{} {}", side.0, side.1);
    format!("{}, {}", line(name.trim()), line(side.2))
}

fn each(result: &AuditResult) -> impl Iterator<Item = (&VehicleResult, &SideResult)> {
    let vehicles = result.vehicles.iter();
    vehicles.flat_map(|vehicle| vehicle.sides.iter().map(move |side| (vehicle, side)))
}

/// The sides of which something was decided.
fn sides(result: &AuditResult) -> BTreeSet<Side<'_>> {
    let judged = each(result).filter(|(_, side)| !side.requirements.is_empty());
    judged
        .map(|(vehicle, side)| {
            (
                vehicle.manufacturer.as_str(),
                vehicle.serial_number.as_str(),
                side.role.as_str(),
            )
        })
        .collect()
}

/// The findings, and of those that are the same the worst.
fn worst(result: &AuditResult) -> BTreeMap<Key<'_>, &FindingResult> {
    let mut all: BTreeMap<Key<'_>, &FindingResult> = BTreeMap::new();
    for (vehicle, side) in each(result) {
        for finding in &side.findings {
            let key = (
                vehicle.manufacturer.as_str(),
                vehicle.serial_number.as_str(),
                side.role.as_str(),
                finding.requirement.as_str(),
                finding.monitor.as_str(),
                about(&finding.text),
            );
            let known = all.entry(key).or_insert(finding);
            if finding.verdict > known.verdict {
                *known = finding;
            }
        }
    }
    all
}

/// What a finding is about. A list is one thing, however long it is.
fn about(text: &str) -> String {
    let mut about = finding_group::of(cause::place(text));
    for (several, one) in [("\"\", \"\"", "\"\""), ("#, #", "#")] {
        while about.contains(several) {
            about = about.replace(several, one);
        }
    }
    about
}

/// Which monitor decided which requirement of whom.
fn decided(result: &AuditResult) -> BTreeSet<(&str, &str, &str, &str, &str)> {
    let mut all = BTreeSet::new();
    for (vehicle, side) in each(result) {
        for known in &side.requirements {
            all.extend(known.decided_by.iter().map(|monitor| {
                let (manufacturer, serial) = (vehicle.manufacturer.as_str(), vehicle.serial_number.as_str());
                (
                    manufacturer,
                    serial,
                    side.role.as_str(),
                    known.id.as_str(),
                    monitor.as_str(),
                )
            }));
        }
    }
    all
}

fn told(key: &Key<'_>, finding: &FindingResult, before: Option<Verdict>) -> Told {
    Told {
        manufacturer: key.0.to_owned(),
        serial_number: key.1.to_owned(),
        role: key.2.to_owned(),
        requirement: key.3.to_owned(),
        monitor: key.4.to_owned(),
        verdict: finding.verdict,
        before,
        text: finding.text.clone(),
    }
}

/// What makes the two audits different in kind.
fn notes(
    result: &AuditResult,
    baseline: &AuditResult,
    now: &BTreeSet<Side<'_>>,
    before: &BTreeSet<Side<'_>>,
) -> Vec<String> {
    let mut notes = Vec::new();
    let strangers = now.difference(before).map(called);
    notes.extend(strangers.map(|who| format!("the baseline does not judge {who}: all that is found there is new")));
    let missing = before.difference(now).map(called);
    notes.extend(missing.map(|who| format!("the baseline judges {who}, and the recording does not show it")));
    if baseline.tool != result.tool {
        notes.push(format!(
            "the baseline was made by {}, and this by {}: what is told in other words is new",
            line(&baseline.tool),
            line(&result.tool)
        ));
    }
    let version = |result: &AuditResult, vehicle: &VehicleResult| {
        let mut all = result.vehicles.iter();
        let is_same = |one: &&VehicleResult| {
            (&one.manufacturer, &one.serial_number) == (&vehicle.manufacturer, &vehicle.serial_number)
        };
        all.find(is_same).and_then(|vehicle| vehicle.protocol.clone())
    };
    for vehicle in &result.vehicles {
        let before = version(baseline, vehicle);
        if let (Some(before), Some(after)) = (&before, &vehicle.protocol)
            && before != after
        {
            let name = format!("{} {}", vehicle.manufacturer, vehicle.serial_number);
            let (before, after) = (line(before), line(after));
            notes.push(format!(
                "{} is judged by VDA 5050 {after}, and by {before} in the baseline",
                line(&name)
            ));
        }
    }
    notes
}

impl Against {
    /// What is new and what is gone, for people.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = format!(
            "against the baseline {}: {} new, {} known, {} gone\n",
            line(&self.baseline),
            self.new.len(),
            self.known,
            self.gone.len()
        );
        for note in &self.notes {
            let _ = writeln!(text, "  note: {note}");
        }
        for one in self.new.iter().take(SHOWN) {
            let before = one
                .before
                .map_or_else(String::new, |before| format!(", {} before", before.word()));
            let _ = writeln!(text, "  NEW   {}{before}: {}", one.verdict.word(), one.text());
        }
        more(self.new.len(), &mut text);
        for one in self.gone.iter().take(SHOWN) {
            let how = if one.judged {
                "not found any more"
            } else {
                "nothing came that could show it"
            };
            let _ = writeln!(text, "  gone  {how}: {}", one.finding.text());
        }
        more(self.gone.len(), &mut text);
        text
    }
}

fn more(all: usize, text: &mut String) {
    if all > SHOWN {
        let _ = writeln!(text, "        and {} more; --format json lists them", all - SHOWN);
    }
}

impl Told {
    fn text(&self) -> String {
        let who = called(&(
            self.manufacturer.as_str(),
            self.serial_number.as_str(),
            self.role.as_str(),
        ));
        let seen = short(&line(&self.text), 300).into_owned();
        format!("{who}: {} {}: {seen}", line(&self.requirement), line(&self.monitor))
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::traffic;
    use super::super::{Audit, Options};
    use super::*;
    use tck_pack::Role;

    fn audited(faults: &[&str]) -> AuditResult {
        let library = tck_testing::library();
        let pack = library.rules.packs.latest();
        let mut audit = Audit::new(&library.rules, Options::default()).expect("options");
        for message in traffic(library, pack, Role::Agv, "order-acceptance/base-and-horizon", faults) {
            audit.observe(message);
        }
        audit.finish(Vec::new())
    }

    #[test]
    fn what_was_there_before_is_no_news_and_what_is_gone_is_said() {
        let (good, bad) = (audited(&[]), audited(&["horizon-not-reported"]));
        let again = hold(&bad, &bad, "b").expect("a baseline");
        assert!(
            again.new.is_empty() && again.known > 0 && again.gone.is_empty(),
            "{again:?}"
        );
        assert_eq!(again.rest, Some(Verdict::Pass));
        let worse = hold(&bad, &good, "b").expect("a baseline");
        assert!(worse.new.iter().any(|told| told.requirement == "STATE-12"), "{worse:?}");
        assert_eq!((worse.rest, worse.known), (Some(Verdict::Fail), 0));
        let better = hold(&good, &bad, "b").expect("a baseline");
        assert_eq!(better.rest, Some(Verdict::Pass));
        assert!(
            better
                .gone
                .iter()
                .any(|gone| gone.finding.requirement == "STATE-12" && gone.judged),
            "{better:?}"
        );
        assert!(better.text().contains("gone  not found any more"));
    }

    #[test]
    fn another_place_and_a_worse_verdict_are_news() {
        let before = audited(&["horizon-not-reported"]);
        let change = |edit: &dyn Fn(&mut FindingResult)| {
            let mut after = before.clone();
            let side = after.vehicles[0]
                .sides
                .iter_mut()
                .find(|side| !side.findings.is_empty());
            edit(&mut side.expect("a side").findings[0]);
            hold(&after, &before, "b").expect("a baseline")
        };
        let placed = change(&|finding| finding.text = "state/orderId: 7 is not of type string".to_owned());
        assert_eq!(placed.new.len(), 1);
        let mut remark = before.clone();
        for side in &mut remark.vehicles[0].sides {
            side.findings
                .iter_mut()
                .for_each(|finding| finding.verdict = Verdict::Warning);
        }
        let worse = hold(&before, &remark, "b").expect("a baseline");
        assert!(worse.new.iter().all(|told| told.before == Some(Verdict::Warning)) && !worse.new.is_empty());
    }

    #[test]
    fn another_mistake_of_the_same_requirement_is_new_and_other_names_and_numbers_are_none() {
        let told = |text: &str| {
            let mut audit = audited(&["horizon-not-reported"]);
            let mut sides = audit.vehicles[0].sides.iter_mut();
            let side = sides.find(|side| !side.findings.is_empty()).expect("a side");
            side.findings.truncate(1);
            side.findings[0].text = text.to_owned();
            audit.vehicles.truncate(1);
            audit
        };
        let news = |before: &str, after: &str| {
            let against = hold(&told(after), &told(before), "b").expect("a baseline");
            (against.new.len(), against.gone.len())
        };
        let before = "nodes \"a\", \"b\" at 2, 4 are missing";
        assert_eq!(news(before, "nodes \"d\" at 7 are missing"), (0, 0));
        assert_eq!(news(before, "node \"a\" at 2 comes twice"), (1, 1));
        let placed = "state/nodeStates/3/nodeId: 7 is not of type string";
        assert_eq!(news(placed, "state/nodeStates/4/nodeId: null is none"), (0, 0));
        assert_eq!(news(placed, "state/nodeStates/4/sequenceId: null is none"), (1, 1));
    }

    #[test]
    fn a_baseline_of_others_is_refused_and_a_stranger_is_named() {
        let one = audited(&["horizon-not-reported"]);
        let mut other = one.clone();
        other.vehicles[0].serial_number = "other".to_owned();
        let refused = hold(&one, &other, "b");
        assert!(matches!(refused, Err(BaselineError::AboutOthers { .. })), "{refused:?}");
        let mut both = one.clone();
        both.vehicles.push(other.vehicles[0].clone());
        let against = hold(&both, &one, "b").expect("a baseline");
        assert!(!against.new.is_empty() && against.new.iter().all(|told| told.serial_number == "other"));
        assert!(
            against.notes.iter().any(|note| note.contains("does not judge")),
            "{:?}",
            against.notes
        );
        let against = hold(&one, &both, "b").expect("a baseline");
        assert!(against.gone.iter().all(|gone| !gone.judged) && !against.gone.is_empty());
        assert!(
            against.notes.iter().any(|note| note.contains("does not show it")),
            "{:?}",
            against.notes
        );
    }
}
