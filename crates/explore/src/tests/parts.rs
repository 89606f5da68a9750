//! Parts of an exploration say together what the whole says.

use super::*;
use tck_base::shard::Shard;

fn part(grammar: &Grammar, shard: (usize, usize), conversations: usize) -> Exploration {
    Exploration {
        part: Shard::new(shard.0, shard.1),
        trials: 0,
        ..exploration(grammar.clone(), 7, conversations)
    }
}

#[test]
fn the_conversations_of_all_parts_are_those_of_the_whole_each_once() {
    let library = tck_testing::library();
    let grammar = grammar(library, library.rules.packs.latest(), Role::Agv);
    let drawn = |shard: (usize, usize)| -> Vec<(String, Vec<String>)> {
        let all = part(&grammar, shard, 23).drawn(&grammar, &mut Coverage::default());
        all.into_iter()
            .map(|(chain, file)| (file.id, chain.stimuli().to_vec()))
            .collect()
    };
    let whole = drawn((1, 1));
    let different: BTreeSet<&Vec<String>> = whole.iter().map(|(_, said)| said).collect();
    assert!(whole.len() == 23 && different.len() > 20, "{whole:?}");
    for of in 2..=16 {
        let parts: Vec<(String, Vec<String>)> = (1..=of).flat_map(|index| drawn((index, of))).collect();
        assert!(parts == whole, "{of} parts");
    }
}

#[test]
fn parts_try_and_say_what_the_whole_does_and_find_what_it_finds() {
    let library = tck_testing::library();
    let grammar = grammar(library, library.rules.packs.latest(), Role::Agv);
    let explored = |shard: (usize, usize)| {
        let mut stage = OnTheMinute::new(|run| run.faults = vec!["outdated-update-taken-over".to_owned()]);
        let explored = part(&grammar, shard, 6)
            .carry_out(&mut stage, &mut |_| {})
            .expect("an exploration");
        let told = |purpose| -> Vec<String> { stage.told(purpose).iter().map(|file| file.id.clone()).collect() };
        let broken = explored.findings.iter().map(|shown| shown.finding.requirement.clone());
        (
            told(Purpose::Probe),
            told(Purpose::Conversations),
            broken.collect::<BTreeSet<String>>(),
        )
    };
    let (mut tried, said, broken) = explored((1, 1));
    let (one, other) = (explored((1, 2)), explored((2, 2)));
    let mut tried_in_parts = [one.0, other.0].concat();
    tried.sort();
    tried_in_parts.sort();
    assert_eq!(tried_in_parts, tried);
    assert_eq!([one.1, other.1].concat(), said);
    let requirement = "ORD-REJ-10";
    assert!(broken.contains(requirement), "{broken:?}");
    assert!(one.2.contains(requirement) || other.2.contains(requirement));
}
