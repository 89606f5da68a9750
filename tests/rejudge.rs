//! Judging is a pure function of journal and suites: the same journal gives the same result, byte for byte.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a test may fail by panicking"
)]

use std::sync::Arc;

use vda5050_tck::journal::{Entry, Event, OwnLatency, Spread};
use vda5050_tck::judge::Library;
use vda5050_tck::judge::judge;
use vda5050_tck::pack::Role;
use vda5050_tck::report::json;
use vda5050_tck::run::{VirtualRun, run_silently};

/// The allocator of the program: a run is a million small trees.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn library() -> Library {
    vda5050_tck::library(None).unwrap_or_else(|all| panic!("{}", all[0]))
}

#[test]
fn a_saved_journal_gives_the_result_of_the_live_run_byte_for_byte() {
    let library = library();
    for pack in library.rules.packs.of_role(Role::Agv) {
        for faults in [
            vec![],
            vec!["outdated-update-taken-over"],
            vec!["never-reconnects"],
            vec!["cancel-never-finished"],
        ] {
            let mut request = VirtualRun::of(&library, pack);
            request.faults = faults.iter().map(ToString::to_string).collect();
            let live = run_silently(&library, pack, request).expect("a run");
            let folder = tempfile::tempdir().expect("a folder");
            let path = folder.path().join("journal.jsonl");
            let mut writer = vda5050_tck::journal::file::JournalWriter::create(&path).expect("a file");
            for entry in live.recorder.journal().entries() {
                writer.write(&entry.record).expect("written");
            }
            let saved = vda5050_tck::journal::file::read(&path).expect("read");
            let again = judge(&library.rules, saved.journal.entries()).expect("judged");
            assert_eq!(
                json::to_string(&live.result).expect("json"),
                json::to_string(&again).expect("json"),
                "VDA 5050 {} with {faults:?}",
                pack.version
            );
        }
    }
}

#[test]
fn a_journal_that_breaks_off_anywhere_gives_a_partial_result_that_accuses_nobody() {
    let library = library();
    let pack = library.rules.packs.latest();
    let mut request = VirtualRun::of(&library, pack);
    request
        .tests
        .retain(|test| test.id.starts_with("order-rejection/") || test.id.starts_with("connection/"));
    let live = run_silently(&library, pack, request).expect("a run");
    let entries = live.recorder.journal().entries();
    let mut at = 1;
    while at < entries.len() {
        let result = judge(&library.rules, entries.iter().take(at)).expect("judged");
        assert!(result.partial, "cut at {at}");
        let failed: Vec<_> = result
            .tests
            .iter()
            .filter(|test| test.verdict == Some(vda5050_tck::verdict::Verdict::Fail))
            .collect();
        assert!(failed.is_empty(), "cut at {at}: {failed:#?}");
        at += 97;
    }
}

#[test]
fn seeds_jitter_and_coalescing_do_not_change_a_verdict() {
    let library = Arc::new(library());
    let pack = library.rules.packs.latest().clone();
    let verdicts = |seed: u64| {
        let mut request = VirtualRun::of(&library, &pack);
        request.seed = seed;
        request.jitter = std::time::Duration::from_millis(seed % 20);
        request.coalesce = std::time::Duration::from_millis(if seed.is_multiple_of(3) { 15 } else { 0 });
        let result = run_silently(&library, &pack, request).expect("a run").result;
        let tests = result.tests.iter().map(|test| (test.id.clone(), test.verdict));
        let monitors = result
            .monitors
            .iter()
            .map(|monitor| (monitor.id.clone(), monitor.verdict));
        tests.chain(monitors).collect::<Vec<_>>()
    };
    let first = verdicts(1);
    for seed in 2..10 {
        assert_eq!(first, verdicts(seed), "seed {seed}");
    }
}

#[test]
fn nothing_that_comes_after_an_interruption_accuses_anybody() {
    use vda5050_tck::journal::{Event, Journal};
    use vda5050_tck::result::RunResult;
    use vda5050_tck::verdict::Verdict;

    let library = library();
    let pack = library.rules.packs.latest();
    let mut request = VirtualRun::of(&library, pack);
    // A test, a monitor and a connection find these.
    request.faults = ["outdated-update-taken-over", "factsheet-without-header", "will-qos-0"]
        .map(str::to_owned)
        .to_vec();
    let live = run_silently(&library, pack, request).expect("a run");
    let interrupted_at = |place: usize| {
        let mut journal = Journal::new();
        let mut opened = 0;
        for entry in live.recorder.journal().entries() {
            let mut record = entry.record.clone();
            if matches!(record.event, Event::Opened { .. }) {
                opened += 1;
                if opened == place {
                    // Nothing is judged by it, and so no number changes.
                    record.event = Event::Interrupted;
                }
            }
            journal.restore(record);
        }
        judge(&library.rules, journal.entries()).expect("judged")
    };
    let given = |result: &RunResult, wanted: Verdict| -> Vec<String> {
        let tests = result.tests.iter().map(|test| (&test.id, test.verdict));
        let monitors = result.monitors.iter().map(|monitor| (&monitor.id, monitor.verdict));
        let all = tests.chain(monitors).filter(|(_, verdict)| *verdict == Some(wanted));
        all.map(|(id, _)| id.clone()).collect()
    };
    let never = interrupted_at(0);
    assert_eq!(
        json::to_string(&never).expect("json"),
        json::to_string(&live.result).expect("json")
    );
    let at_once = interrupted_at(1);
    assert_eq!(given(&at_once, Verdict::Fail), Vec::<String>::new());
    assert_eq!(given(&at_once, Verdict::Warning), Vec::<String>::new());
    // What was found before stands.
    let (all, before) = (given(&never, Verdict::Fail), given(&interrupted_at(3), Verdict::Fail));
    assert!(!before.is_empty() && before.len() < all.len(), "{before:?} of {all:?}");
}

#[test]
fn a_harness_that_was_slower_than_its_shortest_time_limit_says_so_and_judges_nothing_else() {
    let library = library();
    let pack = library.rules.packs.latest();
    let mut request = VirtualRun::of(&library, pack);
    request
        .tests
        .retain(|test| test.id == "order-rejection/lower-update-id");
    let live = run_silently(&library, pack, request).expect("a run");
    assert_eq!(live.result.harness_latency, None, "nothing takes time in virtual time");
    let measured = |worst_micros| {
        let spread = |worst_micros| Spread {
            count: 9,
            median_micros: 20,
            p99_micros: 90,
            worst_micros,
        };
        let mut entries: Vec<_> = live.recorder.journal().entries().iter().collect();
        let mut last = entries.pop().expect("a record").record.clone();
        let Event::RunEnded { latency, .. } = &mut last.event else {
            panic!("{last:?}");
        };
        *latency = OwnLatency::of(Some(spread(100)), Some(spread(worst_micros)));
        entries.push(Entry::new(last));
        judge(&library.rules, &entries).expect("judged")
    };
    let in_time = measured(1_000);
    let worst = in_time
        .harness_latency
        .and_then(|latency| Some(latency.judged?.worst_micros));
    assert_eq!((worst, &in_time.limits), (Some(1_000), &live.result.limits));
    let late = measured(700_000_000);
    let said: Vec<&String> = late
        .limits
        .iter()
        .filter(|limit| !in_time.limits.contains(limit))
        .collect();
    assert!(
        said.len() == 1 && said[0].starts_with("The harness itself took up to 700.0 s"),
        "{said:?}"
    );
    assert_eq!((late.verdict, late.tests), (in_time.verdict, in_time.tests));
}
