#![allow(
    clippy::expect_used,
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test may fail by panicking"
)]

use std::convert::Infallible;

use super::{Chain, ConversationFile, Coverage, Exploration, Grammar, Source, findings, shrink};
use tck_judge::Library;
use tck_pack::{Pack, Role};
use tck_result::{Answers, ExplorationResult, SaidResult};
use tck_run::{Selection, VirtualRun, run_silently};

const ROLES: [Role; 2] = [Role::Agv, Role::MasterControl];

fn grammar(library: &Library, pack: &Pack, role: Role) -> Grammar {
    Grammar::load(&library.assets, role)
        .expect("the grammar of the suites")
        .only(pack, |_, _| true)
}

fn places(grammar: &Grammar, files: &[ConversationFile]) -> Vec<(String, String)> {
    let places = files.iter().map(|file| (file.place(grammar.side()), file.text.clone()));
    places.collect()
}

fn exploration(grammar: Grammar, seed: u64, conversations: usize) -> Exploration {
    Exploration {
        grammar,
        seed,
        conversations,
        length: 12,
        trials: 60,
    }
}

#[test]
fn every_stimulus_can_be_reached_and_makes_a_test_without_a_complaint() {
    let packs = &tck_testing::library().rules.packs;
    for (pack, role) in packs.all().iter().flat_map(|pack| ROLES.map(|role| (pack, role))) {
        let mut library = tck_testing::library().clone();
        let grammar = grammar(&library, pack, role);
        let reach =
            |name: &String| Chain::shortest_to(&grammar, name).unwrap_or_else(|| panic!("nothing leads to {name}"));
        let probes = grammar
            .stimuli
            .keys()
            .map(|name| reach(name).file(&grammar, &format!("explore/{name}"), "Why."));
        let files: Vec<ConversationFile> = probes.collect();
        let tests = library
            .add(&places(&grammar, &files))
            .unwrap_or_else(|all| panic!("{}", all[0].render(false)));
        assert_eq!(tests.len(), grammar.stimuli.len());
    }
}

#[test]
fn the_same_seed_draws_the_same_conversations_and_they_are_tests_without_a_complaint() {
    let mut library = tck_testing::library().clone();
    let grammar = grammar(&library, library.rules.packs.latest(), Role::Agv);
    let drawn = |seed| exploration(grammar.clone(), seed, 20).drawn(&grammar, &mut Coverage::default());
    assert_eq!(drawn(1), drawn(1));
    assert_ne!(drawn(1), drawn(2));
    let files: Vec<ConversationFile> = drawn(3).into_iter().map(|(_, file)| file).collect();
    library
        .add(&places(&grammar, &files))
        .unwrap_or_else(|all| panic!("{}", all[0].render(false)));
}

/// Otherwise the next update would join the order where it does not end, and the vehicle be accused of refusing it.
#[test]
fn an_order_ends_where_the_grammar_says() {
    let library = tck_testing::library();
    let route = regex::Regex::new(r"base: \[([^\]]*)\]").expect("a pattern");
    let mut seen = 0;
    for pack in library.rules.packs.all() {
        for (name, stimulus) in grammar(library, pack, Role::Agv).stimuli {
            let then = &stimulus.then;
            let taken = usize::from(then.order) + usize::try_from(then.update).expect("a few updates");
            // A cancelled order is not updated any more.
            if taken == 0 || then.situation.as_deref() == Some("cancelled") {
                continue;
            }
            let steps = format!("{}{}", stimulus.sends, stimulus.hears);
            let routes: Vec<usize> = route
                .captures_iter(&steps)
                .map(|found| found[1].split(',').count() - 1)
                .collect();
            let edges: usize = routes.iter().rev().take(taken).sum();
            assert_eq!(
                edges, then.forward,
                "{name}: so many edges are released by the last orders"
            );
            seen += 1;
        }
    }
    assert!(seen > 60, "{seen} stimuli");
}

#[test]
fn what_was_not_tried_yet_is_drawn_first() {
    let library = tck_testing::library();
    let grammar = grammar(library, library.rules.packs.latest(), Role::Agv);
    let mut coverage = Coverage::default();
    let drawn = exploration(grammar.clone(), 1, 300).drawn(&grammar, &mut coverage);
    let (tried, of) = coverage.pairs(&grammar);
    let stimuli: usize = drawn.iter().map(|(chain, _)| chain.stimuli().len()).sum();
    assert!(tried * 4 >= of * 3, "{tried} of {of} pairs in {stimuli} stimuli");
}

#[test]
fn a_stimulus_with_words_to_choose_from_becomes_one_for_every_mixture() {
    let text = "explore: agv\nspec: \">=2.0\"\nbegins: rest\nnodes: [a, b]\ngiven: \"\"\nsituations: { rest: It rests }\nanswers: {}\n\
                stimuli: { one: { title: One, in: [rest], weight: 3, each: { first: [x, y], second: [u, v] }, hears: \"${each.first} ${each.second}\" }, \
                two: { title: Two, in: [rest] } }\nendings: []\n";
    let library = tck_testing::library();
    let grammar = Grammar::read("suites/explore/agv.yaml", text).expect("a grammar");
    let grammar = grammar.only(library.rules.packs.latest(), |_, _| true);
    let heard: Vec<_> = grammar
        .stimuli
        .iter()
        .map(|(name, one)| (name.as_str(), one.hears.as_str()))
        .collect();
    let mixtures = [
        ("one.x-u", "x u"),
        ("one.x-v", "x v"),
        ("one.y-u", "y u"),
        ("one.y-v", "y v"),
        ("two", ""),
    ];
    assert_eq!(heard, mixtures);
    let weight = |name: &str| grammar.stimuli[name].weight;
    assert_eq!(
        4 * weight("one.x-u"),
        3 * weight("two"),
        "together they are drawn as often as the one they came from"
    );
}

#[test]
fn what_failed_when_it_was_tried_is_drawn_less() {
    let library = tck_testing::library();
    let grammar = grammar(library, library.rules.packs.latest(), Role::Agv);
    let times = |coverage: &mut Coverage| {
        let drawn = exploration(grammar.clone(), 1, 40).drawn(&grammar, coverage);
        let said = drawn.iter().flat_map(|(chain, _)| chain.stimuli());
        said.filter(|name| *name == "order-open").count()
    };
    let said = ["rest", "cancelled", "open"].map(|situation| SaidResult {
        situation: situation.to_owned(),
        stimulus: "order-open".to_owned(),
        answers: Answers {
            broken: 1,
            ..Answers::default()
        },
    });
    let mut coverage = Coverage::default();
    coverage.learn(&ExplorationResult {
        said: said.to_vec(),
        members: Vec::new(),
    });
    let (less, usual) = (times(&mut coverage), times(&mut Coverage::default()));
    assert!(
        less * 3 < usual,
        "{less} times, and {usual} times of a device of which nothing is known"
    );
}

/// What is found in conversations with the reference device of a side.
fn found(role: Role, faults: &[&str], seed: u64, conversations: usize) -> Vec<super::Finding> {
    let mut library = tck_testing::library().clone();
    let grammar = grammar(&library, library.rules.packs.latest(), role);
    let exploration = exploration(grammar.clone(), seed, conversations);
    let drawn = exploration.drawn(&grammar, &mut Coverage::default());
    let files: Vec<ConversationFile> = drawn.iter().map(|(_, file)| file.clone()).collect();
    let tests = library.add(&places(&grammar, &files)).expect("tests");
    let pack = library.rules.packs.latest().clone();
    let mut run = VirtualRun::of_role(role, &library, &pack);
    run.tests = Selection::some(tests);
    run.draw = None;
    run.faults = faults.iter().map(|&fault| fault.to_owned()).collect();
    let finished = run_silently(&library, &pack, run).expect("a run");
    for test in &finished.result.tests {
        assert!(test.journal.is_some(), "{} never begins", test.id);
        let well = test.came_to_its_end() || !faults.is_empty();
        assert!(well, "{}: {:?}", test.id, test.reason);
    }
    findings(&finished.result, &drawn)
}

#[test]
fn a_faultless_device_is_accused_of_nothing_and_every_conversation_comes_to_its_end() {
    for (role, seed) in ROLES.into_iter().flat_map(|role| (1..=3).map(move |seed| (role, seed))) {
        let all = found(role, &[], seed, 20);
        assert!(all.is_empty(), "{role}, seed {seed}: {all:#?}");
    }
}

#[test]
fn a_fault_is_found_where_it_shows() {
    for (role, fault, requirement, stimulus) in [
        (Role::Agv, "outdated-update-taken-over", "ORD-REJ-10", "outdated"),
        (Role::MasterControl, "orders-in-manual", "MODE-04", "ordered-by-hand"),
    ] {
        let all = found(role, &[fault], 1, 60);
        let source = Source::Stimulus(stimulus.to_owned());
        let shows = |one: &super::Finding| one.requirement == requirement && one.source == source;
        assert!(all.iter().any(shows), "{all:#?}");
    }
}

#[test]
fn shrinking_keeps_what_a_failure_needs_and_nothing_else() {
    let library = tck_testing::library();
    let grammar = grammar(library, library.rules.packs.latest(), Role::Agv);
    let names = |all: &[&str]| all.iter().map(|&name| name.to_owned()).collect::<Vec<String>>();
    let long = names(&[
        "ask-state",
        "order-open",
        "ask-unknown",
        "release-one",
        "release-one",
        "cancel",
        "order-next",
        "download",
        "ask-state",
        "order-open",
        "link-lost",
        "release-one",
        "outdated",
    ]);
    let chain = Chain::of(&grammar, &long).expect("the grammar allows it");
    let fails = |chain: &Chain| -> Result<bool, Infallible> {
        let lost = chain.stimuli().iter().position(|name| name == "link-lost");
        let late = chain.stimuli().iter().rposition(|name| name == "outdated");
        Ok(matches!((lost, late), (Some(lost), Some(late)) if lost < late))
    };
    let Ok(short) = shrink::shrink(&grammar, &chain, 200, fails);
    assert_eq!(short.stimuli().len(), 4, "{short:?}");
    assert_eq!(short.stimuli().last().map(String::as_str), Some("outdated"));
}

#[test]
fn a_grammar_that_names_what_is_not_there_is_refused_with_a_reason() {
    let text = "explore: agv\nspec: \">=2.0\"\nbegins: rest\nnodes: [a, b]\ngiven: \"\"\nsituations: { rest: It rests }\nanswers: {}\n\
                stimuli: { one: { title: One, in: [lost] } }\nendings: []\n";
    let error = Grammar::read("suites/explore/agv.yaml", text).expect_err("a situation is missing");
    assert_eq!(
        error.to_string(),
        "suites/explore/agv.yaml: the stimulus `one` names the situation `lost`, which there is not"
    );
}
