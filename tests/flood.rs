//! A device that floods the harness ends the run, and what was found until then stands.

use vda5050_tck::pack::Role;
use vda5050_tck::run::{End, VirtualRun, run_silently};
use vda5050_tck::verdict::Verdict;

#[test]
fn a_master_control_that_floods_its_vehicle_ends_the_run_and_is_failed() {
    let library = vda5050_tck::library(None).unwrap();
    let pack = library.rules.packs.latest();
    let mut request = VirtualRun::of_role(Role::MasterControl, &library, pack);
    request.faults = vec!["order-repeated-for-ever".to_owned()];
    request
        .tests
        .retain(|test| test.id == "capabilities/time-between-orders" || test.id.starts_with("dispatch/"));
    let last = request.tests.last().unwrap().id.clone();
    let finished = run_silently(&library, pack, request).unwrap();
    let End::Flooded(why) = &finished.end else {
        panic!("{:?}", finished.end);
    };
    assert!(why.contains("floods the harness"), "{why}");
    let result = &finished.result;
    assert!(result.partial);
    assert_eq!(result.verdict, Some(Verdict::Fail), "what was found stands");
    let interval = result.requirements.iter().find(|one| one.id == "FACT-13").unwrap();
    assert_eq!(interval.verdict, Some(Verdict::Fail));
    let left = result.tests.iter().find(|test| test.id == last).unwrap();
    assert_eq!(left.verdict, Some(Verdict::Inconclusive), "{last} was not run any more");
    let kept = finished.recorder.journal().entries().len();
    assert!(kept < 50_000, "{kept} entries are kept");
}
