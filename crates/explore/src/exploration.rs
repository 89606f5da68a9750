//! An exploration from its first conversation to its last finding: try every stimulus, draw conversations, shrink what fails.

use std::collections::BTreeSet;

use super::broken::family;
use super::chain::Chain;
use super::coverage::Coverage;
use super::draw::{Random, draw};
use super::findings::{Finding, findings};
use super::grammar::Grammar;
use super::shrink::shrink;
use super::writing::ConversationFile;
use tck_result::RunResult;

/// What a round of conversations is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Every stimulus by the shortest way, to see which of them the device is made for.
    Probe,
    /// The conversations that were drawn.
    Conversations,
    /// A shorter conversation, to see whether it still fails.
    Trial,
    /// The shortest conversations that fail, as evidence.
    Evidence,
}

/// What conversations are carried out on.
pub trait Stage {
    /// Why they could not be.
    type Error;

    /// Carries them out, one after the other.
    ///
    /// # Errors
    /// When they cannot be.
    fn carry_out(&mut self, files: &[ConversationFile], purpose: Purpose) -> Result<RunResult, Self::Error>;

    /// Whether somebody wants it to end.
    fn interrupted(&self) -> bool {
        false
    }
}

/// How much is explored.
#[derive(Clone, Debug)]
pub struct Exploration {
    /// What may be said.
    pub grammar: Grammar,
    /// Where the random choice begins.
    pub seed: u64,
    /// How many conversations are drawn.
    pub conversations: usize,
    /// How many stimuli one of them has at most.
    pub length: usize,
    /// How many trials the shrinking of one finding may take.
    pub trials: usize,
}

/// What came of it.
#[derive(Clone, Debug)]
pub struct Explored {
    /// What is broken, with the shortest conversation that shows it.
    pub findings: Vec<Shown>,
    /// What was tried in which situation.
    pub coverage: Coverage,
    /// How many pairs of situation and stimulus were tried, out of how many there are for this device.
    pub pairs: (usize, usize),
    /// How many conversations were drawn and carried out.
    pub conversations: usize,
    /// How many stimuli they had.
    pub stimuli: usize,
    /// How many of them could not be carried to their end, and the first reason.
    pub undecided: (usize, Option<String>),
    /// The stimuli that the device is not made for, and why.
    pub left_out: Vec<(String, String)>,
    /// Whether it was ended before its time.
    pub interrupted: bool,
}

/// A finding, and the conversation that shows it.
#[derive(Clone, Debug)]
pub struct Shown {
    /// What is broken.
    pub finding: Finding,
    /// The shortest conversation that was found to show it.
    pub file: ConversationFile,
    /// Out of how many attempts it showed in how many.
    pub shows: (usize, usize),
}

/// How often a shrunk conversation is carried out, to see whether it always fails.
const ATTEMPTS: usize = 3;

impl Exploration {
    /// The conversations that this seed draws.
    #[must_use]
    pub fn drawn(&self, grammar: &Grammar, coverage: &mut Coverage) -> Vec<(Chain, ConversationFile)> {
        let mut random = Random::new(self.seed);
        let conversations = (1..=self.conversations).map(|number| {
            let chain = draw(grammar, &mut random, self.length, coverage);
            let why = format!("Drawn by explore from the seed {}.", self.seed);
            let file = chain.file(grammar, &format!("explore/seed-{}-{number}", self.seed), &why);
            (chain, file)
        });
        conversations.collect()
    }

    /// Carries it out. `note` is told how it goes on.
    ///
    /// # Errors
    /// When conversations cannot be carried out.
    pub fn carry_out<S: Stage>(&self, stage: &mut S, note: &mut dyn FnMut(&str)) -> Result<Explored, S::Error> {
        let mut coverage = Coverage::default();
        let probes = self.probes();
        note(&format!("trying {} stimuli one by one", probes.len()));
        let files: Vec<ConversationFile> = probes.iter().map(|(_, file)| file.clone()).collect();
        let probed = stage.carry_out(&files, Purpose::Probe)?;
        if probed.partial && !stage.interrupted() {
            let tried = probed.tests.iter().filter(|test| test.journal.is_some()).count();
            note(&format!("half of the time is up after {tried} of them"));
        }
        let left_out = left_out(&probes, &probed);
        let unfit: BTreeSet<&str> = left_out.iter().map(|(name, _)| name.as_str()).collect();
        let mut grammar = self.grammar.clone();
        grammar.stimuli.retain(|name, _| !unfit.contains(family(name)));
        let mut found = findings(&probed, &probes);
        learn(&mut coverage, &probed);

        let mut undecided = (0, None);
        let (mut conversations, mut stimuli) = (0, 0);
        if !stage.interrupted() {
            let drawn = self.drawn(&grammar, &mut coverage);
            let planned: usize = drawn.iter().map(|(chain, _)| chain.stimuli().len()).sum();
            note(&format!("{} conversations of {planned} stimuli", drawn.len()));
            let files: Vec<ConversationFile> = drawn.iter().map(|(_, file)| file.clone()).collect();
            let result = stage.carry_out(&files, Purpose::Conversations)?;
            // Those whose time did not come were neither said nor left unfinished.
            let begun = || result.tests.iter().filter(|test| test.journal.is_some());
            conversations = begun().count();
            let ids: BTreeSet<&str> = begun().map(|test| test.id.as_str()).collect();
            let said = drawn.iter().filter(|(_, file)| ids.contains(file.id.as_str()));
            stimuli = said.map(|(chain, _)| chain.stimuli().len()).sum();
            let applicable = begun().filter(|test| test.not_applicable.is_none());
            let short: Vec<_> = applicable.filter(|test| !test.came_to_its_end()).collect();
            undecided = (short.len(), short.first().and_then(|test| test.reason.clone()));
            merge(&mut found, findings(&result, &drawn));
            learn(&mut coverage, &result);
        }
        let mut shown = Vec::new();
        for (number, finding) in found.into_iter().enumerate() {
            note(&format!(
                "shrinking {} ({} stimuli)",
                finding.requirement,
                finding.chain.stimuli().len()
            ));
            shown.push(self.shrunk(&grammar, finding, number + 1, stage)?);
        }
        if !shown.is_empty() && !stage.interrupted() {
            let files: Vec<ConversationFile> = shown.iter().map(|one| one.file.clone()).collect();
            stage.carry_out(&files, Purpose::Evidence)?;
        }
        Ok(Explored {
            findings: shown,
            pairs: coverage.pairs(&grammar),
            coverage,
            conversations,
            stimuli,
            undecided,
            left_out,
            interrupted: stage.interrupted(),
        })
    }

    /// Every stimulus, of those that break a message one, by the shortest way to it.
    fn probes(&self) -> Vec<(Chain, ConversationFile)> {
        let names = self.grammar.heads();
        let chains = names.filter_map(|name| Some((name, Chain::shortest_to(&self.grammar, name)?)));
        let probes = chains.map(|(name, chain)| {
            let file = chain.file(
                &self.grammar,
                &format!("explore/probe-{}", family(name)),
                "Every stimulus is tried once.",
            );
            (chain, file)
        });
        probes.collect()
    }

    /// Makes the conversation of a finding as short as it goes, and sees how often it shows.
    fn shrunk<S: Stage>(
        &self,
        grammar: &Grammar,
        finding: Finding,
        number: usize,
        stage: &mut S,
    ) -> Result<Shown, S::Error> {
        let mut trial = 0;
        let mut shows = |chain: &Chain, stage: &mut S| -> Result<bool, S::Error> {
            if stage.interrupted() {
                return Ok(false);
            }
            trial += 1;
            let file = chain.file(grammar, &format!("explore/trial-{number}-{trial}"), "A trial.");
            let conversations = [(chain.clone(), file.clone())];
            let result = stage.carry_out(&[file], Purpose::Trial)?;
            let again = findings(&result, &conversations);
            Ok(again.iter().any(|one| one.is_of(&finding)))
        };
        let chain = shrink(grammar, &finding.chain, self.trials, |chain| shows(chain, stage))?;
        let mut times = 0;
        for _ in 0..ATTEMPTS {
            times += usize::from(shows(&chain, stage)?);
        }
        let id = format!("explore/{}-{number}", finding.requirement.to_lowercase());
        let why = format!(
            "Explore found that {} is broken here, from the seed {}. {}",
            finding.requirement, self.seed, finding.message
        );
        let file = chain.file(grammar, &id, &why);
        Ok(Shown {
            finding: Finding { chain, ..finding },
            file,
            shows: (times, ATTEMPTS),
        })
    }
}

fn learn(coverage: &mut Coverage, result: &RunResult) {
    if let Some(exploration) = &result.exploration {
        coverage.learn(exploration);
    }
}

/// The stimuli of which the device, its profile or the bench say that they do not apply.
fn left_out(probes: &[(Chain, ConversationFile)], result: &RunResult) -> Vec<(String, String)> {
    let unfit = probes.iter().filter_map(|(chain, file)| {
        let test = result.tests.iter().find(|test| test.id == file.id)?;
        // Where the time was up, nobody knows why one did not begin.
        let never_began = test.journal.is_none() && !result.partial;
        let never_began = never_began.then(|| test.reason.clone().unwrap_or_default());
        let why = test.not_applicable.clone().or(never_began)?;
        Some((family(chain.stimuli().last()?).to_owned(), why))
    });
    unfit.collect()
}

/// Adds findings to others. One that is there already keeps the shorter conversation.
fn merge(all: &mut Vec<Finding>, more: Vec<Finding>) {
    for one in more {
        match all.iter_mut().find(|own| own.is_of(&one)) {
            Some(own) => own.count += one.count,
            None => all.push(one),
        }
    }
}
