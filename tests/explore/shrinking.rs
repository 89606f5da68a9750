//! A conversation that fails is made nearly as short as the shortest one that is known to show the fault.

use std::convert::Infallible;
use std::fmt::Write as _;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use vda5050_tck::explore::shrink::shrink;
use vda5050_tck::explore::{Chain, Coverage, Exploration, Finding};
use vda5050_tck::judge::Library;
use vda5050_tck::pack::Role;

use crate::{found, grammar};

/// How many stimuli more than the shortest conversation known a shrunk one may have.
const ROOM: usize = 2;

/// How many trials shorten one.
const TRIALS: usize = 60;

/// How many conversations are drawn for each fault.
const DRAWN: usize = 300;
/// How many of those that hold the shortest conversation are carried out.
const CARRIED_OUT: usize = 8;

/// How much more often the stimuli of the shortest conversation are drawn.
const FOCUS: u32 = 40;

/// A fault, and the shortest conversation known that shows it.
struct Known {
    role: Role,
    fault: &'static str,
    stimuli: Vec<String>,
}

fn role(word: &str) -> Role {
    let roles = [Role::Agv, Role::MasterControl];
    roles.into_iter().find(|role| role.word() == word).unwrap()
}

fn known() -> Vec<Known> {
    let table = include_str!("shortest.tsv");
    let rows = table.lines().filter(|line| !line.starts_with('#'));
    rows.map(|line| {
        let columns: Vec<&str> = line.split('\t').collect();
        Known {
            role: role(columns[0]),
            fault: columns[1],
            stimuli: columns[2].split(' ').map(str::to_owned).collect(),
        }
    })
    .collect()
}

/// Whether a conversation has all stimuli of another one, in their order.
fn holds(long: &[String], short: &[String]) -> bool {
    let mut rest = long.iter();
    short.iter().all(|wanted| rest.any(|stimulus| stimulus == wanted))
}

/// A conversation that shows the fault, shrunk.
fn shrunk(known: &Known, library: &mut Library) -> Result<Chain, String> {
    let whole = grammar(library, known.role);
    Chain::of(&whole, &known.stimuli).ok_or("the grammar does not allow the shortest conversation")?;
    let mut focused = whole.clone();
    for name in &known.stimuli {
        focused.stimuli.get_mut(name).unwrap().weight *= FOCUS;
    }
    let exploration = Exploration {
        grammar: whole.clone(),
        seed: 1,
        conversations: DRAWN,
        at_once: DRAWN,
        length: 10,
        trials: TRIALS,
        budget: None,
        part: None,
    };
    let mut drawn = exploration.drawn(&focused, &mut Coverage::default());
    drawn.retain(|(chain, _)| holds(chain.stimuli(), &known.stimuli));
    drawn.truncate(CARRIED_OUT);
    for (number, (chain, file)) in drawn.iter_mut().enumerate() {
        *file = chain.file(&whole, &format!("explore/{}-{number}", known.fault), "Drawn.");
    }
    let faults = [known.fault.to_owned()];
    let all = found(library, known.role, &drawn, |run| run.faults = faults.to_vec());
    // Without the fault nothing is found: whatever is found shows it.
    let finding = all.into_iter().next();
    let finding = finding.ok_or_else(|| format!("{} conversations do not find the fault", drawn.len()))?;
    let mut trial = 0;
    let fails = |chain: &Chain| -> Result<bool, Infallible> {
        trial += 1;
        let file = chain.file(&whole, &format!("explore/{}-trial-{trial}", known.fault), "A trial.");
        let again = found(library, known.role, &[(chain.clone(), file)], |run| {
            run.faults = faults.to_vec();
        });
        let same = |one: &Finding| one.requirement == finding.requirement && one.source == finding.source;
        Ok(again.iter().any(same))
    };
    let Ok(chain) = shrink(&whole, &finding.chain, TRIALS, fails);
    Ok(chain)
}

#[test]
fn a_shrunk_conversation_is_nearly_as_short_as_the_shortest_one_known() {
    let all = known();
    assert!(all.len() >= 20, "there are {} faults in the table", all.len());
    let next = AtomicUsize::new(0);
    let complaints = Mutex::new(String::new());
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                let mut library = vda5050_tck::library(None).unwrap();
                while let Some(known) = all.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let complaint = match shrunk(known, &mut library) {
                        Err(why) => why,
                        Ok(chain) if chain.stimuli().len() <= known.stimuli.len() + ROOM => continue,
                        Ok(chain) => format!("{} stimuli: {}", chain.stimuli().len(), chain.stimuli().join(", ")),
                    };
                    let _ = writeln!(complaints.lock().unwrap(), "{}: {complaint}", known.fault);
                }
            });
        }
    });
    let complaints = complaints.into_inner().unwrap();
    assert!(complaints.is_empty(), "{complaints}");
}
