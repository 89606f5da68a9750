//! No false accusation in conversations: with whatever liberty a good device is explored, nothing is found that the liberty
//! does not excuse.

use std::fmt::Write as _;
use std::hash::{DefaultHasher, Hash, Hasher};

use vda5050_tck::explore::{Coverage, Exploration, Finding};
use vda5050_tck::pack::Role;
use vda5050_tck::qualify::on_all_cores;
use vda5050_tck::simulate::BuiltIn;

use crate::{grammar, seed};

/// What is found with a liberty and is right: liberty, requirement, and why.
fn excused() -> Vec<(&'static str, &'static str)> {
    let table = include_str!("excused.tsv");
    let rows = table.lines().filter(|line| !line.starts_with('#'));
    rows.map(|line| {
        let columns: Vec<&str> = line.split('\t').collect();
        assert!(columns.len() == 3 && columns[2].len() > 15, "no reason: {line}");
        (columns[0], columns[1])
    })
    .collect()
}

/// A device with some liberties, and the seed of its conversations.
struct Explored {
    role: Role,
    liberties: Vec<&'static str>,
    seed: u64,
}

fn names(role: Role) -> Vec<&'static str> {
    BuiltIn::tolerances(role).iter().map(|liberty| liberty.name).collect()
}

/// What conversations find.
fn found(one: &Explored, conversations: usize) -> Vec<Finding> {
    let mut library = vda5050_tck::library(None).unwrap();
    let exploration = Exploration {
        grammar: grammar(&library, one.role),
        seed: one.seed,
        conversations,
        length: 12,
        at_once: 4,
        trials: 0,
        budget: None,
        part: None,
    };
    let drawn = exploration.drawn(&exploration.grammar, &mut Coverage::default());
    crate::found(&mut library, one.role, &drawn, |run| {
        for name in &one.liberties {
            run.device.tolerate(name).unwrap();
        }
    })
}

/// What is found that no liberty excuses: a line for each.
fn accusations(all: &[Explored], conversations: usize) -> String {
    let excused = excused();
    let of = |one: &Explored| {
        let mut accusations = String::new();
        let found = found(one, conversations);
        let known = |finding: &Finding| {
            let of = |(liberty, requirement): &(&str, &str)| {
                one.liberties.contains(liberty) && *requirement == finding.requirement
            };
            excused.iter().any(of)
        };
        for finding in found.iter().filter(|finding| !known(finding)) {
            let _ = writeln!(
                accusations,
                "{} {} with {}, seed {}: {} by {:?}: {} ({})",
                finding.verdict.word(),
                one.role,
                one.liberties.join(" + "),
                one.seed,
                finding.requirement,
                finding.source,
                finding.message,
                finding.chain.stimuli().join(", "),
            );
        }
        accusations
    };
    on_all_cores(all, of).concat()
}

/// Explores with all of these; nothing may be found.
fn nothing_is_found(all: &[Explored], conversations: usize) {
    let accusations = accusations(all, conversations);
    assert!(
        accusations.is_empty(),
        "a device is accused that does nothing wrong\n{accusations}"
    );
}

/// Whoever excuses everything finds nothing: what is excused belongs to a liberty, and comes where it is looked for.
#[test]
fn what_is_excused_is_seen() {
    for (liberty, requirement) in excused() {
        let is_one = [Role::Agv, Role::MasterControl].map(names).concat().contains(&liberty);
        assert!(is_one, "no liberty is called {liberty}");
        assert!(!requirement.is_empty(), "{liberty}: which requirement?");
    }
    let whole_seconds = Explored {
        role: Role::Agv,
        liberties: vec!["seconds-whole"],
        seed: 1,
    };
    let found = found(&whole_seconds, 1);
    assert!(
        found.iter().any(|finding| finding.requirement == "HDR-03"),
        "time stamps without a fraction are not seen"
    );
}

/// A share of the liberties, each by itself.
#[test]
fn conversations_with_a_liberty_accuse_nobody() {
    const SHARE: u64 = 24;
    let number = seed::share() % SHARE;
    let draw = |name: &str| {
        let mut hasher = DefaultHasher::new();
        name.hash(&mut hasher);
        hasher.finish()
    };
    let share = |role| {
        let names = names(role).into_iter().filter(|name| draw(name) % SHARE == number);
        names.map(move |name| Explored {
            role,
            liberties: vec![name],
            seed: draw(name),
        })
    };
    let all: Vec<Explored> = share(Role::Agv).chain(share(Role::MasterControl)).collect();
    println!("{} liberties, share {number} of {SHARE}", all.len());
    nothing_is_found(&all, 8);
}

/// A number that somebody has set for this run.
fn said(name: &str, usual: u64) -> u64 {
    let said = std::env::var(name).ok().and_then(|number| number.parse().ok());
    said.unwrap_or(usual)
}

/// Every liberty by itself, with as many seeds as `EXPLORE_SEEDS` says and as many conversations as
/// `EXPLORE_CONVERSATIONS` says. It is run by hand, after a change of checks or of `suites/explore`.
#[test]
#[ignore = "takes minutes; run by hand"]
fn conversations_with_every_liberty_accuse_nobody() {
    let seeds = said("EXPLORE_SEEDS", 1);
    let conversations = usize::try_from(said("EXPLORE_CONVERSATIONS", 42)).unwrap();
    let each = [Role::Agv, Role::MasterControl].into_iter().flat_map(|role| {
        let names = names(role).into_iter();
        names.flat_map(move |name| {
            (1..=seeds).map(move |seed| Explored {
                role,
                liberties: vec![name],
                seed,
            })
        })
    });
    nothing_is_found(&each.collect::<Vec<_>>(), conversations);
}

/// Three liberties at a time, drawn by the seed: as many seeds as `EXPLORE_SEEDS` says, with 500 stimuli each. It is run by
/// hand, too.
#[test]
#[ignore = "takes minutes; run by hand"]
fn conversations_with_three_liberties_accuse_nobody() {
    const TOGETHER: usize = 3;
    let all = [Role::Agv, Role::MasterControl].into_iter().flat_map(|role| {
        (1..=said("EXPLORE_SEEDS", 200)).map(move |seed| {
            let mut drawn = names(role);
            drawn.sort_by_key(|name| {
                let mut hasher = DefaultHasher::new();
                (seed, name).hash(&mut hasher);
                hasher.finish()
            });
            drawn.truncate(TOGETHER);
            Explored {
                role,
                liberties: drawn,
                seed,
            }
        })
    });
    nothing_is_found(&all.collect::<Vec<_>>(), 42);
}
