use std::collections::BTreeMap;

use super::page::page;
use super::result::{AuditResult, FindingResult, SideResult, VehicleResult, whole};
use super::time_line::TimeLine;
use super::{Audit, Options};
use tck_base::verdict::Verdict;
use tck_pack::Role;

fn finding(requirement: &str, verdict: Verdict, message: u64, text: &str) -> FindingResult {
    FindingResult {
        monitor: "a/b".to_owned(),
        requirement: requirement.to_owned(),
        verdict,
        count: message,
        message,
        recording: None,
        line: None,
        first: String::new(),
        last: String::new(),
        text: text.to_owned(),
        shown: None,
        interpretation: None,
    }
}

fn commanding(serial: &str, found: Vec<FindingResult>) -> VehicleResult {
    let passed = [("X-9".to_owned(), "a/b".to_owned())].into();
    let side = SideResult::new(Role::MasterControl, 5, 1, found, passed, Vec::new());
    VehicleResult {
        manufacturer: "m".to_owned(),
        serial_number: serial.to_owned(),
        topics: String::new(),
        protocol: None,
        stretch: None,
        not_judged: None,
        messages: BTreeMap::new(),
        holes: 0,
        twice: 0,
        retained: 0,
        vantage: String::new(),
        hints: Vec::new(),
        time_line: TimeLine::default(),
        courses: Vec::new(),
        message_coverage: None,
        sides: vec![side],
    }
}

#[test]
fn what_is_found_at_one_place_of_one_message_is_one_mistake() {
    let found = vec![
        finding("X-1", Verdict::Fail, 3, "state/orderId: 7 is no text"),
        finding("X-2", Verdict::Fail, 3, "state/orderId: 7 is no text, and odd"),
        finding("X-3", Verdict::Warning, 3, "state/orderId: 7 is seldom"),
        finding("X-1", Verdict::Fail, 4, "state/orderId: 8 is no text"),
        finding("X-1", Verdict::Fail, 3, "another sentence"),
    ];
    let side = SideResult::new(Role::Agv, 9, 1, found, [].into(), Vec::new());
    let mistakes = side.mistakes();
    let shown: Vec<(String, &str, u64)> = mistakes
        .iter()
        .map(|mistake| {
            (
                mistake.requirements.join(" "),
                mistake.worst.text.as_str(),
                mistake.count,
            )
        })
        .collect();
    let wanted = [
        ("X-1 X-2 X-3".to_owned(), "state/orderId: 7 is no text, and odd", 3),
        ("X-1".to_owned(), "another sentence", 3),
        ("X-1".to_owned(), "state/orderId: 8 is no text", 4),
    ];
    assert_eq!(shown, wanted);
}

/// An audit of one vehicle of which this was found, at its end.
fn over(found: Vec<FindingResult>) -> AuditResult {
    let rules = &tck_testing::library().rules;
    let audit = Audit::new(rules, Options::default()).expect("options");
    let mut result = audit.finish(Vec::new());
    let mut vehicle = commanding("1", Vec::new());
    vehicle.sides = vec![SideResult::new(Role::Agv, 9, 1, found, [].into(), Vec::new())];
    result.vehicles = vec![vehicle];
    result.trace(&rules.catalogue);
    result.conclude();
    result
}

#[test]
fn what_is_found_beside_an_audit_is_a_mistake_of_its_own() {
    let mut result = over(vec![
        finding("X-1", Verdict::Fail, 3, "state/orderId: 7 is no text"),
        finding("X-2", Verdict::Fail, 3, "state/orderId: 7 is no text, and odd"),
        finding("X-4", Verdict::Warning, 9, "odd"),
    ]);
    let side = &mut result.vehicles[0].sides[0];
    side.add_apart(finding("X-3", Verdict::Fail, 5, "a topic of no name"));
    let named = |side: &SideResult| -> Vec<String> {
        let all = side.mistakes();
        all.iter().map(|mistake| mistake.requirements.join(" ")).collect()
    };
    assert_eq!(named(side), ["X-1 X-2", "X-3", "X-4"]);
    // A result of an earlier version says nothing of causes.
    side.causes.clear();
    assert_eq!(named(side), ["X-1 X-2", "X-3", "X-4"]);
}

#[test]
fn what_rests_on_a_broken_requirement_is_told_below_it() {
    let result = over(vec![
        finding("CONN-11", Verdict::Fail, 3, "no ONLINE"),
        finding("CONN-05", Verdict::Fail, 3, "no ONLINE before the first state"),
    ]);
    let mistakes = result.vehicles[0].sides[0].mistakes();
    let shown: Vec<(&str, Vec<&str>)> = mistakes
        .iter()
        .map(|mistake| {
            let follows = mistake.follows.iter().map(|one| one.requirement.as_str());
            (mistake.requirements[0], follows.collect())
        })
        .collect();
    assert_eq!(shown, [("CONN-11", vec!["CONN-05"])]);
    let page = page(&result);
    assert!(page.contains("follows from it: CONN-05"), "{page}");
    assert!(page.contains("1 violation"), "{page}");
}

#[test]
fn the_master_control_of_several_vehicles_is_judged_as_one() {
    let wrong = || vec![finding("X-1", Verdict::Fail, 3, "a")];
    let one = commanding("1", wrong());
    assert_eq!(whole(std::slice::from_ref(&one)), None);
    // The same vehicle after an update is no second one.
    assert_eq!(whole(&[one.clone(), one.clone()]), None);
    let all = [one, commanding("2", Vec::new()), commanding("3", wrong())];
    let whole = whole(&all).expect("several");
    assert_eq!(
        (whole.verdict, whole.vehicles, whole.messages),
        (Some(Verdict::Fail), 3, 15)
    );
    let decided: Vec<(&str, Verdict, usize)> = whole
        .requirements
        .iter()
        .map(|known| (known.id.as_str(), known.verdict, known.vehicles))
        .collect();
    assert_eq!(decided, [("X-1", Verdict::Fail, 2), ("X-9", Verdict::Pass, 3)]);
}
