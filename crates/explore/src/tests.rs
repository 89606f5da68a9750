#![allow(
    clippy::expect_used,
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test may fail by panicking"
)]

mod parts;

use std::collections::{BTreeMap, BTreeSet};
use std::convert::Infallible;
use std::time::Duration;

use super::{
    Chain, ConversationFile, Coverage, Exploration, Finding, Grammar, Model, Purpose, Round, Source, Stage, by_cause,
    family, findings, shrink,
};
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

/// The versions that conversations are held in, with each side that there are some for.
fn spoken() -> Vec<(&'static Pack, Role)> {
    let library = tck_testing::library();
    let of_role = |role: Role| {
        let grammar = Grammar::load(&library.assets, role).expect("the grammar of the suites");
        let packs = library
            .rules
            .packs
            .of_role(role)
            .filter(move |pack| grammar.speaks(pack));
        packs.map(move |pack| (pack.as_ref(), role))
    };
    ROLES.into_iter().flat_map(of_role).collect()
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
        at_once: 4,
        length: 12,
        trials: 60,
        budget: None,
        part: None,
    }
}

#[test]
fn every_stimulus_can_be_reached_and_makes_a_test_without_a_complaint() {
    for (pack, role) in spoken() {
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
        let ways = Chain::to_every_kind(&grammar);
        assert_eq!(ways.len(), grammar.kinds().len());
        for (name, chain) in ways {
            assert_eq!(chain.stimuli().len(), reach(&name.to_owned()).stimuli().len(), "{name}");
        }
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
    for (pack, _) in spoken().into_iter().filter(|(_, role)| *role == Role::Agv) {
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
    assert_eq!(tried, 0, "what was drawn was not said yet");
    let mut pairs = BTreeSet::new();
    let mut stimuli = 0;
    for (chain, _) in &drawn {
        let mut model = Model::begin(&grammar);
        for name in chain.stimuli() {
            pairs.insert((model.situation.clone(), family(name).to_owned()));
            model.hear(&grammar.stimuli[name], String::new());
            stimuli += 1;
        }
    }
    let drawn = pairs.len();
    assert!(drawn * 4 >= of * 3, "{drawn} of {of} pairs in {stimuli} stimuli");
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
        ("one.x-u", "x u\n"),
        ("one.x-v", "x v\n"),
        ("one.y-u", "y u\n"),
        ("one.y-v", "y v\n"),
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

/// The dimensions in which devices were found to be odd, and the stimuli that go along each of them.
const DIMENSIONS: [(&str, &[&str]); 9] = [
    (
        "quantity",
        &[
            "order-long-horizon",
            "order-with-many-actions",
            "plan-shorter-and-longer",
            "ask-many",
        ],
    ),
    (
        "after a cut",
        &["link-lost", "link-lost-in-pause", "link-lost-at-work", "state-lost"],
    ),
    (
        "beside an older one",
        &[
            "ask-factsheet-at-once",
            "ask-state-at-once",
            "malformed",
            "unknown-action",
        ],
    ),
    (
        "the scope of an action",
        &[
            "forbidden-scope",
            "request-on-edge",
            "charging-on-edge",
            "trigger-on-edge",
            "wrong-scope",
        ],
    ),
    (
        "the end of a special order",
        &["order-here", "loop", "back-to-a-node", "plan-nothing"],
    ),
    (
        "declared and refused",
        &["bad-parameter", "unknown-direction", "unknown-trajectory"],
    ),
    (
        "a course that is cut short",
        &["failing-pick", "failing-charge", "warning-lasts"],
    ),
    (
        "extremes of text",
        &[
            "long-name",
            "order-foreign-letters",
            "order-with-empty-texts",
            "order-with-long-texts",
        ],
    ),
    (
        "order and sequence",
        &["last-again", "outdated", "told-at-once", "release-after-gap"],
    ),
];

/// Ways in which a master control meets the unusual, and stimuli that bring them about.
const DIMENSIONS_OF_COMMANDS: [(&str, &[&str]); 4] = [
    (
        "limits alone and in pairs",
        &["vehicle-few-nodes", "vehicle-short-names", "vehicle-two-limits"],
    ),
    (
        "limits with the farthest destination",
        &["vehicle-few-nodes-elsewhere", "vehicle-interval-elsewhere"],
    ),
    (
        "beside an older one",
        &["second-transport", "second-paused", "reroute-twice"],
    ),
    ("after a cut", &["cut-twice", "back-with-order", "own-while-away"]),
];

#[test]
fn every_dimension_of_oddness_is_drawn() {
    let library = tck_testing::library();
    for role in [Role::Agv, Role::MasterControl] {
        let dimensions = match role {
            Role::Agv => &DIMENSIONS[..],
            Role::MasterControl => &DIMENSIONS_OF_COMMANDS[..],
        };
        let grammar = grammar(library, library.rules.packs.latest(), role);
        let exploration = exploration(grammar.clone(), 1, 400);
        let drawn = exploration.drawn(&grammar, &mut Coverage::default());
        let said: BTreeSet<&str> = drawn
            .iter()
            .flat_map(|(chain, _)| chain.stimuli())
            .map(|name| family(name))
            .collect();
        for (dimension, stimuli) in dimensions {
            for name in *stimuli {
                assert!(said.contains(name), "{dimension}: {name} is never drawn");
            }
        }
    }
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

/// What is found in conversations with the reference device of a version and side.
fn found(pack: &Pack, role: Role, faults: &[&str], seed: u64, conversations: usize) -> Vec<Finding> {
    let mut library = tck_testing::library().clone();
    let grammar = grammar(&library, pack, role);
    let exploration = exploration(grammar.clone(), seed, conversations);
    let drawn = exploration.drawn(&grammar, &mut Coverage::default());
    let files: Vec<ConversationFile> = drawn.iter().map(|(_, file)| file.clone()).collect();
    let tests = library.add(&places(&grammar, &files)).expect("tests");
    let mut run = VirtualRun::of_role(role, &library, pack);
    run.tests = Selection::some(tests);
    run.draw = None;
    run.faults = faults.iter().map(|&fault| fault.to_owned()).collect();
    let finished = run_silently(&library, pack, run).expect("a run");
    for test in &finished.result.tests {
        assert!(test.journal.is_some(), "{} never begins", test.id);
        let well = test.came_to_its_end() || !faults.is_empty();
        assert!(well, "{}, {role}, {}: {:?}", pack.id, test.id, test.reason);
    }
    findings(&finished.result, &drawn)
}

#[test]
fn a_faultless_device_is_accused_of_nothing_and_every_conversation_comes_to_its_end() {
    for ((pack, role), seed) in spoken()
        .into_iter()
        .flat_map(|one| (1..=3).map(move |seed| (one, seed)))
    {
        let all = found(pack, role, &[], seed, 20);
        assert!(all.is_empty(), "{role} {}, seed {seed}: {all:#?}", pack.id);
    }
}

#[test]
fn a_fault_is_found_where_it_shows() {
    for (role, fault, requirement, stimulus) in [
        (Role::Agv, "outdated-update-taken-over", "ORD-REJ-10", "outdated"),
        (Role::MasterControl, "orders-in-manual", "MODE-04", "ordered-by-hand"),
    ] {
        let pack = tck_testing::library().rules.packs.latest();
        let all = found(pack, role, &[fault], 1, 60);
        let source = Source::Stimulus(stimulus.to_owned());
        let shows = |one: &Finding| one.requirement == requirement && one.source == source;
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

/// The built-in vehicle in virtual time, of whose conversations every one takes a minute.
struct OnTheMinute {
    library: Library,
    change: Box<dyn Fn(&mut VirtualRun)>,
    spent: Duration,
    rounds: Vec<(Purpose, Vec<ConversationFile>)>,
}

impl OnTheMinute {
    fn new(change: impl Fn(&mut VirtualRun) + 'static) -> Self {
        Self {
            library: tck_testing::library().clone(),
            change: Box::new(change),
            spent: Duration::ZERO,
            rounds: Vec::new(),
        }
    }

    fn told(&self, purpose: Purpose) -> Vec<&ConversationFile> {
        let rounds = self.rounds.iter().filter(|(of, _)| *of == purpose);
        rounds.flat_map(|(_, files)| files).collect()
    }
}

impl Stage for OnTheMinute {
    type Error = String;

    fn carry_out(
        &mut self,
        files: &[ConversationFile],
        purpose: Purpose,
        within: Option<Duration>,
    ) -> Result<Round, String> {
        const EACH: Duration = Duration::from_secs(60);
        let mut library = self.library.clone();
        let places = files.iter().map(|file| (file.place("agv"), file.text.clone()));
        let tests = library
            .add(&places.collect::<Vec<_>>())
            .map_err(|all| all[0].render(false))?;
        let room = within.map_or(files.len(), |within| {
            usize::try_from(within.as_secs().div_ceil(EACH.as_secs())).expect("a few")
        });
        let pack = library.rules.packs.latest().clone();
        let mut run = VirtualRun::of_role(Role::Agv, &library, &pack);
        run.tests = Selection::some(tests);
        run.draw = None;
        run.budget = (purpose == Purpose::Gates).then_some(Duration::ZERO);
        (self.change)(&mut run);
        if purpose != Purpose::Gates {
            let told: BTreeSet<&str> = files.iter().take(room).map(|file| file.id.as_str()).collect();
            run.tests.retain(|test| told.contains(test.id.as_str()));
            self.spent += EACH * u32::try_from(told.len()).expect("a few");
        }
        let told: Vec<ConversationFile> = files.iter().take(room).cloned().collect();
        self.rounds.push((purpose, told));
        let finished = run_silently(&library, &pack, run).map_err(|error| error.to_string())?;
        Ok(Round {
            result: finished.result,
            began: BTreeMap::new(),
        })
    }

    fn spent(&self) -> Duration {
        self.spent
    }
}

#[test]
fn what_the_device_has_not_is_never_drawn_and_never_said() {
    let library = tck_testing::library();
    let grammar = grammar(library, library.rules.packs.latest(), Role::Agv);
    let mut stage = OnTheMinute::new(|run| run.motion = Err(tck_journal::Reason::MotionRuledOut));
    let explored = exploration(grammar, 1, 8)
        .carry_out(&mut stage, &mut |_| {})
        .expect("an exploration");
    let names: BTreeSet<&str> = explored.left_out.iter().map(|(name, _)| name.as_str()).collect();
    assert!(
        names.contains("order-next") && names.contains("order-open"),
        "{names:?}"
    );
    assert_eq!((explored.conversations, explored.undecided.0), (8, 0), "{explored:?}");
    assert!(explored.findings.is_empty() && explored.remarks.is_empty());
    for file in [stage.told(Purpose::Probe), stage.told(Purpose::Conversations)].concat() {
        assert!(!file.text.contains("moves: true"), "{}", file.text);
    }
    let said = stage.told(Purpose::Conversations).len();
    assert_eq!(said, 8, "every conversation that was drawn was held");
}

#[test]
fn the_budget_covers_all_and_what_it_leaves_out_differs_by_the_seed() {
    let library = tck_testing::library();
    let grammar = grammar(library, library.rules.packs.latest(), Role::Agv);
    let budget = Duration::from_secs(60 * 60);
    let probed = |seed| {
        let mut stage = OnTheMinute::new(|run| run.faults = vec!["outdated-update-taken-over".to_owned()]);
        let exploration = Exploration {
            budget: Some(budget),
            ..exploration(grammar.clone(), seed, 400)
        };
        let explored = exploration.carry_out(&mut stage, &mut |_| {}).expect("an exploration");
        assert!(stage.spent <= budget + Duration::from_secs(60), "{:?}", stage.spent);
        assert!(explored.conversations >= 20, "{}", explored.conversations);
        let told = stage.told(Purpose::Probe);
        assert!((5..=15).contains(&told.len()), "{}", told.len());
        told.iter().map(|file| file.id.clone()).collect::<BTreeSet<_>>()
    };
    assert_ne!(probed(1), probed(2));
}

#[test]
fn a_slow_device_comes_to_conversations_before_all_is_tried_one_by_one() {
    let library = tck_testing::library();
    let grammar = grammar(library, library.rules.packs.latest(), Role::Agv);
    // As one on which each of them takes ten seconds, in ten minutes.
    let mut stage = OnTheMinute::new(|_| {});
    let exploration = Exploration {
        budget: Some(Duration::from_secs(60 * 60)),
        ..exploration(grammar, 3, 20)
    };
    let explored = exploration.carry_out(&mut stage, &mut |_| {}).expect("an exploration");
    assert_eq!(explored.conversations, 20);
    let purposes: Vec<Purpose> = stage.rounds.iter().map(|(purpose, _)| *purpose).collect();
    let last = purposes.iter().rposition(|purpose| *purpose == Purpose::Conversations);
    // The time that is left behind them goes to what was not tried alone.
    let behind = &stage.rounds[last.expect("conversations")..];
    assert!(
        behind
            .iter()
            .any(|(purpose, files)| *purpose == Purpose::Probe && files.len() > 5)
    );
    let probes = stage.told(Purpose::Probe);
    let names: BTreeSet<&str> = probes.iter().map(|file| file.id.as_str()).collect();
    assert_eq!(names.len(), probes.len(), "none is tried twice");
}

#[test]
fn what_does_not_show_again_is_a_remark_and_fails_nothing() {
    let chain = Chain::of(
        &grammar(
            tck_testing::library(),
            tck_testing::library().rules.packs.latest(),
            Role::Agv,
        ),
        &["order-open".to_owned()],
    )
    .expect("the grammar allows it");
    let finding = |requirement: &str, stimulus: &str, count| Finding {
        requirement: requirement.to_owned(),
        verdict: tck_base::verdict::Verdict::Fail,
        source: Source::Stimulus(stimulus.to_owned()),
        message: String::new(),
        chain: chain.clone(),
        test: "explore/seed-1-1".to_owned(),
        began: None,
        count,
    };
    let grammar = grammar(
        tck_testing::library(),
        tck_testing::library().rules.packs.latest(),
        Role::Agv,
    );
    let shown = |count, shows| super::Shown {
        finding: finding("ORD-04", "order-open", count),
        others: Vec::new(),
        file: chain.file(&grammar, "explore/one", "Why."),
        shows,
    };
    for (count, shows, fails) in [
        (1, (0, 3), false),
        (5, (0, 3), false),
        (1, (1, 3), true),
        (1, (0, 0), false),
        (2, (0, 0), true),
    ] {
        assert_eq!(shown(count, shows).fails(), fails, "{count} {shows:?}");
    }
    let causes = by_cause(vec![
        finding("ORD-04", "order-open", 1),
        finding("ORD-06", "order-next", 1),
        finding("ORD-04", "order-next", 1),
    ]);
    assert_eq!(causes.iter().map(Vec::len).collect::<Vec<_>>(), [2, 1]);
}

#[test]
fn a_conversation_that_begins_elsewhere_is_the_same_test_a_line_further_down() {
    let library = tck_testing::library();
    let grammar = grammar(library, library.rules.packs.latest(), Role::Agv);
    let chain = Chain::of(&grammar, &["order-open".to_owned()]).expect("the grammar allows it");
    let file = chain.file(&grammar, "explore/here", "Why.");
    let there = chain.file(&grammar, "explore/here", "Why.").beginning_on("n3");
    let first = |file: &ConversationFile| (1..500).find(|line| file.stimulus_at(*line).is_some());
    assert_eq!(first(&there), first(&file).map(|line| line + 1));
    let mut library = library.clone();
    let tests = library
        .add(&places(&grammar, &[there]))
        .unwrap_or_else(|all| panic!("{}", all[0].render(false)));
    assert_eq!(tests[0].begins.as_deref(), Some("n3"));
}
