//! An exploration from its first conversation to its last finding: see what the device is made for, try every stimulus, hold
//! conversations, shrink what fails.

use std::collections::BTreeMap;
use std::ops::Range;
use std::time::Duration;

use super::broken::family;
use super::chain::Chain;
use super::coverage::Coverage;
use super::draw::{Random, draw};
use super::findings::{Finding, by_cause, findings};
use super::grammar::Grammar;
use super::shrink::shrink;
use super::writing::ConversationFile;
use tck_base::shard::{Shard, dealt};
use tck_base::verdict::Verdict;
use tck_journal::Reason;
use tck_result::{RunResult, TestResult};

/// What a round of conversations is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// To see which stimuli the device is made for: the device is met, and nothing is said.
    Gates,
    /// Every stimulus by the shortest way.
    Probe,
    /// The conversations that were drawn.
    Conversations,
    /// A shorter conversation, to see whether it still fails.
    Trial,
    /// The shortest conversations that fail, as evidence.
    Evidence,
}

/// What came of some conversations.
#[derive(Clone, Debug)]
pub struct Round {
    /// The result of the run.
    pub result: RunResult,
    /// The node on which each conversation began, by its id.
    pub began: BTreeMap<String, String>,
}

/// What conversations are carried out on.
pub trait Stage {
    /// Why they could not be.
    type Error;

    /// Carries them out, one after the other, for so long at most.
    ///
    /// # Errors
    /// When they cannot be.
    fn carry_out(
        &mut self,
        files: &[ConversationFile],
        purpose: Purpose,
        within: Option<Duration>,
    ) -> Result<Round, Self::Error>;

    /// How long the exploration has taken.
    fn spent(&self) -> Duration;

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
    /// How many of them are drawn at once; what came of them is known to the next.
    pub at_once: usize,
    /// How many stimuli one of them has at most.
    pub length: usize,
    /// How many trials the shrinking of one finding may take.
    pub trials: usize,
    /// How long all of it may take: trying stimuli, holding conversations, shrinking.
    pub budget: Option<Duration>,
    /// Which part of it is done, where other processes have the rest: of the stimuli that are tried one by one by their names, of
    /// the conversations by their numbers. What one part learns no other part knows, so a conversation is drawn by seed and number
    /// alone.
    pub part: Option<Shard>,
}

/// What came of it.
#[derive(Clone, Debug)]
pub struct Explored {
    /// What is broken, with the shortest conversation that shows it.
    pub findings: Vec<Shown>,
    /// What was seen and did not show again: no statement about the device rests on it.
    pub remarks: Vec<Shown>,
    /// What was tried in which situation.
    pub coverage: Coverage,
    /// How many pairs of situation and stimulus were tried, out of how many there are for this device.
    pub pairs: (usize, usize),
    /// How many conversations were drawn and carried out.
    pub conversations: usize,
    /// How many stimuli were said in them.
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
    /// What else breaks the same requirement, and was not made shorter.
    pub others: Vec<Finding>,
    /// The shortest conversation that was found to show it.
    pub file: ConversationFile,
    /// Out of how many attempts it showed in how many; none where there was no time for them.
    pub shows: (usize, usize),
}

impl Shown {
    /// Whether it was seen more than once: in an attempt to see it again, or, where there was no time for that, in several
    /// conversations.
    #[must_use]
    pub fn is_certain(&self) -> bool {
        match self.shows {
            (0, 0) => self.finding.count > 1,
            (times, _) => times > 0,
        }
    }

    /// Whether the device does not conform by it.
    #[must_use]
    pub fn fails(&self) -> bool {
        self.is_certain() && self.finding.verdict == Verdict::Fail
    }
}

/// How often a shrunk conversation is carried out, to see whether it always fails.
const ATTEMPTS: usize = 3;

/// How often it is asked what the device is made for, with other ways to the stimuli of which that is not known yet.
const GATES: usize = 4;

/// The share of the time after which stimuli are not tried one by one any more before there were conversations.
const ALONE_AT_FIRST: f64 = 0.15;

/// The share of the time after which what was found is made shorter.
const SHRINKING_BEGINS: f64 = 0.7;

/// Why there are no conversations with a device that has no stimulus to begin one.
const SAYS_NOTHING: &str = "the device is made for nothing that may be said to it at first";

/// How many rounds in a row may come to nothing.
const FRUITLESS: usize = 2;

/// What is known so far.
struct Known {
    grammar: Grammar,
    coverage: Coverage,
    found: Vec<Finding>,
    left_out: Vec<(String, String)>,
    conversations: usize,
    stimuli: usize,
    undecided: (usize, Option<String>),
}

impl Known {
    fn learn(&mut self, round: &Round, conversations: &[(Chain, ConversationFile)]) {
        if let Some(exploration) = &round.result.exploration {
            self.coverage.learn(exploration);
        }
        for mut one in findings(&round.result, conversations) {
            one.began = round.began.get(&one.test).cloned();
            match self.found.iter_mut().find(|own| own.is_of(&one)) {
                Some(own) => own.count += one.count,
                None => self.found.push(one),
            }
        }
    }
}

impl Exploration {
    /// The conversations that are to be held, by their numbers, counted from 0.
    #[must_use]
    pub fn numbers(&self) -> Range<usize> {
        let all = self.conversations;
        self.part.map_or(0..all, |part| part.of_many(all))
    }

    /// The conversations that this seed draws.
    #[must_use]
    pub fn drawn(&self, grammar: &Grammar, coverage: &mut Coverage) -> Vec<(Chain, ConversationFile)> {
        let mut random = Random::new(self.seed);
        self.numbers()
            .map(|number| self.one(grammar, &mut random, number + 1, coverage))
            .collect()
    }

    fn one(
        &self,
        grammar: &Grammar,
        random: &mut Random,
        number: usize,
        coverage: &mut Coverage,
    ) -> (Chain, ConversationFile) {
        let chain = match self.part {
            None => draw(grammar, random, self.length, coverage),
            Some(_) => {
                let mut random = Random::of_number(self.seed, number as u64);
                draw(grammar, &mut random, self.length, &mut Coverage::default())
            }
        };
        let why = format!("Drawn by explore from the seed {}.", self.seed);
        let file = chain.file(grammar, &format!("explore/seed-{}-{number}", self.seed), &why);
        (chain, file)
    }

    /// Carries it out. `note` is told how it goes on.
    ///
    /// # Errors
    /// When conversations cannot be carried out.
    pub fn carry_out<S: Stage>(&self, stage: &mut S, note: &mut dyn FnMut(&str)) -> Result<Explored, S::Error> {
        let mut known = Known {
            grammar: self.grammar.clone(),
            coverage: Coverage::default(),
            found: Vec::new(),
            left_out: Vec::new(),
            conversations: 0,
            stimuli: 0,
            undecided: (0, None),
        };
        if self.meet(&mut known, stage)? {
            let mut left = self.to_try(&known);
            let all = left.len();
            note(&format!("trying {all} stimuli one by one"));
            // A slow device comes to conversations, too, and what there was no time for comes behind them.
            self.probe(&mut known, &mut left, (&mut *stage, ALONE_AT_FIRST))?;
            if !left.is_empty() {
                note(&format!(
                    "{} of them were tried before the conversations",
                    all - left.len()
                ));
            }
            self.converse(&mut known, stage, note)?;
            if self.budget.is_some() && known.undecided.1.as_deref() != Some(SAYS_NOTHING) {
                self.probe(&mut known, &mut left, (&mut *stage, SHRINKING_BEGINS))?;
            }
        }
        let shown = self.shrink_all(&mut known, stage, note)?;
        let (findings, remarks): (Vec<Shown>, Vec<Shown>) = shown.into_iter().partition(Shown::is_certain);
        if !findings.is_empty() && !self.is_over(stage, 1.0) {
            let files: Vec<ConversationFile> = findings.iter().map(|one| one.file.clone()).collect();
            stage.carry_out(&files, Purpose::Evidence, self.left(stage, 1.0))?;
        }
        Ok(Explored {
            findings,
            remarks,
            pairs: known.coverage.pairs(&known.grammar),
            coverage: known.coverage,
            conversations: known.conversations,
            stimuli: known.stimuli,
            undecided: known.undecided,
            left_out: known.left_out,
            interrupted: stage.interrupted(),
        })
    }

    /// How much is left of this share of the time.
    fn left<S: Stage>(&self, stage: &S, share: f64) -> Option<Duration> {
        let budget = self.budget?.mul_f64(share);
        Some(budget.saturating_sub(stage.spent()))
    }

    fn is_over<S: Stage>(&self, stage: &S, share: f64) -> bool {
        stage.interrupted() || self.left(stage, share).is_some_and(|left| left.is_zero())
    }

    /// Finds out what the device is made for, before anything is drawn. Where only what leads to a stimulus is not for the
    /// device, another way to it is looked for. `false` when the device cannot be met.
    fn meet<S: Stage>(&self, known: &mut Known, stage: &mut S) -> Result<bool, S::Error> {
        let mut fits: Vec<String> = Vec::new();
        for _ in 0..GATES {
            let ways = Chain::to_every_kind(&known.grammar);
            let open = ways.into_iter().filter(|(name, _)| !fits.iter().any(|one| one == name));
            let open: Vec<(String, Chain)> = open.map(|(name, chain)| (name.to_owned(), chain)).collect();
            if open.is_empty() || self.is_over(stage, 1.0) {
                break;
            }
            let files: Vec<ConversationFile> = open
                .iter()
                .enumerate()
                .map(|(at, (_, chain))| chain.file(&known.grammar, &format!("explore/gate-{at}"), "Nothing is said."))
                .collect();
            let round = stage.carry_out(&files, Purpose::Gates, None)?;
            if round.result.partial {
                known.undecided.1 = round.result.partial_reason;
                return Ok(false);
            }
            let mut unfit: Vec<(String, Chain, String)> = Vec::new();
            for ((name, chain), file) in open.into_iter().zip(&files) {
                let test = round.result.tests.iter().find(|test| test.id == file.id);
                match test.and_then(never_begins) {
                    Some(why) => unfit.push((name, chain, why)),
                    None => fits.push(name),
                }
            }
            let names: Vec<String> = unfit.iter().map(|(name, _, _)| name.clone()).collect();
            for (name, chain, why) in unfit {
                let leads = chain.stimuli().split_last().map_or(&[][..], |(_, leads)| leads);
                if leads.iter().any(|lead| names.contains(lead)) {
                    continue;
                }
                known.grammar.leave_out(&name);
                known.left_out.push((family(&name).to_owned(), why));
            }
        }
        let ways = Chain::to_every_kind(&known.grammar);
        let kinds = known.grammar.kinds();
        let lost = kinds.iter().filter(|(name, _)| !ways.contains_key(name));
        let lost: Vec<String> = lost.map(|(name, _)| (*name).to_owned()).collect();
        for name in lost {
            known.grammar.leave_out(&name);
            let why = "nothing that the device is made for leads there".to_owned();
            known.left_out.push((family(&name).to_owned(), why));
        }
        Ok(true)
    }

    /// Every stimulus by the shortest way, in the order of the seed: what there is no time for is different from run to run.
    fn to_try(&self, known: &Known) -> Vec<(Chain, ConversationFile)> {
        let ways = Chain::to_every_kind(&known.grammar);
        let mut probes: Vec<(Chain, ConversationFile)> = ways
            .into_iter()
            .filter(|(name, _)| self.part.is_none_or(|part| dealt(name, part)))
            .map(|(name, chain)| {
                let id = format!("explore/probe-{}", name.replace('.', "-"));
                let file = chain.file(&known.grammar, &id, "Every stimulus is tried once.");
                (chain, file)
            })
            .collect();
        if self.budget.is_some() {
            Random::new(self.seed).shuffle(&mut probes);
        }
        probes
    }

    /// Tries stimuli one by one until a share of the time is over. What it did not come to is left.
    fn probe<S: Stage>(
        &self,
        known: &mut Known,
        probes: &mut Vec<(Chain, ConversationFile)>,
        (stage, share): (&mut S, f64),
    ) -> Result<(), S::Error> {
        let mut fruitless = 0;
        while !probes.is_empty() && fruitless < FRUITLESS && !self.is_over(stage, share) {
            let files: Vec<ConversationFile> = probes.iter().map(|(_, file)| file.clone()).collect();
            let round = stage.carry_out(&files, Purpose::Probe, self.left(stage, share))?;
            known.learn(&round, probes);
            let before = probes.len();
            // There is no place for it on the floor. Where the run broke off, there may be another reason.
            let named = |file: &ConversationFile| round.result.tests.iter().find(|test| test.id == file.id);
            for (chain, file) in probes.iter().filter(|_| !round.result.partial) {
                let why = named(file).filter(|test| test.cause.is_none()).and_then(never_begins);
                if let (Some(why), Some(name)) = (why, chain.stimuli().last()) {
                    // Other parts do not know it, and all draw from the same grammar.
                    if self.part.is_none() {
                        known.grammar.leave_out(name);
                    }
                    known.left_out.push((family(name).to_owned(), why));
                }
            }
            // What a run did not come to that broke off is tried in the next one.
            probes.retain(|(_, file)| named(file).is_none_or(is_left));
            fruitless = if probes.len() == before { fruitless + 1 } else { 0 };
        }
        Ok(())
    }

    /// Holds conversations: a few are drawn, carried out, and what came of them is known to those that are drawn next.
    fn converse<S: Stage>(&self, known: &mut Known, stage: &mut S, note: &mut dyn FnMut(&str)) -> Result<(), S::Error> {
        let mut random = Random::new(self.seed);
        let own = self.numbers();
        let (mut number, mut fruitless) = (own.start, 0);
        // One that does not begin, because its device was gone, is drawn anew; a part has no numbers for that.
        let is_out_of_numbers = |number: usize| self.part.is_some() && number >= own.end;
        while known.conversations < own.len() && !is_out_of_numbers(number) && fruitless < FRUITLESS {
            // What was found has to be made shorter, which takes time as well.
            let share = match self.is_over(stage, SHRINKING_BEGINS) {
                false => SHRINKING_BEGINS,
                true if known.found.is_empty() && !self.is_over(stage, 1.0) => 1.0,
                true => break,
            };
            let mut until = number + self.at_once.max(1).min(own.len() - known.conversations);
            if self.part.is_some() {
                until = until.min(own.end);
            }
            let drawn: Vec<(Chain, ConversationFile)> = (number + 1..=until)
                .map(|number| self.one(&known.grammar, &mut random, number, &mut known.coverage))
                .collect();
            number = until;
            if drawn.iter().all(|(chain, _)| chain.stimuli().is_empty()) {
                known.undecided.1 = Some(SAYS_NOTHING.to_owned());
                break;
            }
            let files: Vec<ConversationFile> = drawn.iter().map(|(_, file)| file.clone()).collect();
            let round = stage.carry_out(&files, Purpose::Conversations, self.left(stage, share))?;
            known.learn(&round, &drawn);
            let said = round.result.exploration.iter().flat_map(|all| &all.said);
            known.stimuli += said.map(|one| one.answers.tried()).sum::<usize>();
            let tests = &round.result.tests;
            let begun = tests.iter().filter(|test| test.journal.is_some()).count();
            known.conversations += begun;
            fruitless = if begun == 0 { fruitless + 1 } else { 0 };
            let is_cut = self.is_over(stage, share);
            // Those whose time did not come were neither said nor left unfinished.
            let short = tests
                .iter()
                .filter(|test| !is_left(test) && !came_to_its_end(test) && !is_cut);
            for test in short.filter(|test| test.not_applicable.is_none()) {
                known.undecided.0 += 1;
                if known.undecided.1.is_none() {
                    known.undecided.1.clone_from(&test.reason);
                }
            }
            note(&format!(
                "{} conversations, {} stimuli, findings: {}",
                known.conversations,
                known.stimuli,
                known.found.len()
            ));
        }
        Ok(())
    }

    /// Shrinks one finding of each cause, the worst first.
    fn shrink_all<S: Stage>(
        &self,
        known: &mut Known,
        stage: &mut S,
        note: &mut dyn FnMut(&str),
    ) -> Result<Vec<Shown>, S::Error> {
        let mut found = std::mem::take(&mut known.found);
        found.sort_by_key(|one| (std::cmp::Reverse(one.verdict), one.chain.stimuli().len()));
        let causes = by_cause(found);
        let all = causes.len();
        let mut shown = Vec::new();
        for (at, cause) in causes.into_iter().enumerate() {
            let mut cause = cause.into_iter();
            let Some(mut finding) = cause.next() else { continue };
            let others: Vec<Finding> = cause.collect();
            finding.count += others.iter().map(|one| one.count).sum::<usize>();
            let (number, stimuli) = (at + 1, finding.chain.stimuli().len());
            if !self.is_over(stage, 1.0) {
                note(&format!(
                    "shrinking {number} of {all}: {} ({stimuli} stimuli)",
                    finding.requirement
                ));
            }
            shown.push(self.shrunk(&known.grammar, (finding, others), number, stage)?);
        }
        Ok(shown)
    }

    /// Makes the conversation of a finding as short as it goes, and sees how often it shows. It begins where it began.
    fn shrunk<S: Stage>(
        &self,
        grammar: &Grammar,
        (finding, others): (Finding, Vec<Finding>),
        number: usize,
        stage: &mut S,
    ) -> Result<Shown, S::Error> {
        let written = |chain: &Chain, id: &str, why: &str| {
            let file = chain.file(grammar, id, why);
            match &finding.began {
                Some(node) => file.beginning_on(node),
                None => file,
            }
        };
        let mut trial = 0;
        // Whether it shows; nothing where there was no time to see.
        let mut shows = |chain: &Chain, stage: &mut S| -> Result<Option<bool>, S::Error> {
            if self.is_over(stage, 1.0) {
                return Ok(None);
            }
            trial += 1;
            let file = written(chain, &format!("explore/trial-{number}-{trial}"), "A trial.");
            let conversations = [(chain.clone(), file.clone())];
            let round = stage.carry_out(&[file], Purpose::Trial, self.left(stage, 1.0))?;
            let shows = findings(&round.result, &conversations)
                .iter()
                .any(|one| one.is_of(&finding));
            let begun = round.result.tests.iter().any(|test| test.journal.is_some());
            let has_ended = begun && !self.is_over(stage, 1.0);
            Ok((shows || has_ended).then_some(shows))
        };
        let fails = |chain: &Chain| -> Result<bool, S::Error> { Ok(shows(chain, stage)? == Some(true)) };
        let chain = shrink(grammar, &finding.chain, self.trials, fails)?;
        let mut attempts = (0, 0);
        for _ in 0..ATTEMPTS {
            if let Some(again) = shows(&chain, stage)? {
                attempts.0 += usize::from(again);
                attempts.1 += 1;
            }
        }
        let id = format!("explore/{}-{number}", finding.requirement.to_lowercase());
        let why = format!(
            "Explore found that {} is broken here, from the seed {}. {}",
            finding.requirement, self.seed, finding.message
        );
        let file = written(&chain, &id, &why);
        Ok(Shown {
            finding: Finding { chain, ..finding },
            others,
            file,
            shows: attempts,
        })
    }
}

/// Whether the time of a test did not come.
fn is_left(test: &TestResult) -> bool {
    let no_time = matches!(test.cause, Some(Reason::RunEnded | Reason::OverBudget { .. }));
    test.journal.is_none() && no_time
}

/// Why a test does not begin, whatever time there is.
fn never_begins(test: &TestResult) -> Option<String> {
    if test.journal.is_some() || is_left(test) {
        return None;
    }
    test.not_applicable.clone().or_else(|| test.reason.clone())
}

/// Whether a conversation was held to its last stimulus, whatever came of it.
fn came_to_its_end(test: &TestResult) -> bool {
    let mut body = test.steps.iter().filter(|step| step.path.starts_with("steps["));
    test.journal.is_some()
        && body
            .next_back()
            .is_none_or(|last| last.outcome != tck_result::StepResult::NOT_RUN)
}
