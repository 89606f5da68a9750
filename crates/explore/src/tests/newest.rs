//! What only the newest version of a side has is said in conversations, too.

use super::*;

#[test]
fn faults_of_the_newest_version_are_found_where_they_show() {
    for (role, fault, requirement, stimulus) in [
        (
            Role::MasterControl,
            "zone-requests-unanswered",
            "REQ-03",
            "zone-asked-for",
        ),
        (
            Role::MasterControl,
            "sleep-taken-for-a-fault",
            "HIB-13",
            "ordered-asleep",
        ),
        (
            Role::MasterControl,
            "retry-of-what-has-failed-for-good",
            "RETRY-08",
            "failed-for-good",
        ),
    ] {
        let pack = tck_testing::library().rules.packs.of_role(role).last();
        let all = found(pack.expect("a version"), role, &[fault], 1, 60);
        let source = Source::Stimulus(stimulus.to_owned());
        let shows = |one: &Finding| one.requirement == requirement && one.source == source;
        assert!(all.iter().any(shows), "{all:#?}");
    }
}
