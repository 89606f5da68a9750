//! What came of a part of an exploration, as it is written and read again, and parts put together.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::exploration::{Exploration, Explored, Shown};
use tck_base::verdict::{Accumulated, Verdict};
use tck_journal::event::ShardRecord;
use tck_result::{Answers, MergedBundle, MergedParts, Part, SaidResult, gathered};

/// Format of such a result.
pub const RESULT_FORMAT: &str = "vda5050-tck.explored/1";

/// The result of a part of an exploration, or of several that were joined.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct ExploredResult {
    /// [`RESULT_FORMAT`].
    pub format: String,
    /// Name and version of the tool.
    pub tool: String,
    /// SHA-256 over suites, schemas and requirements.
    pub suites_sha256: String,
    /// `agv` or `master-control`.
    pub role: String,
    /// Protocol version.
    pub protocol: String,
    /// Who has made the device.
    pub manufacturer: String,
    /// Faults and tolerances that a built-in device was given.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub given: Vec<String>,
    /// Where the random choice begins.
    pub seed: u64,
    /// How many stimuli a conversation has at most.
    pub length: usize,
    /// How many seconds it was to take at most; absent where it took as long as it takes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub budget: Option<u64>,
    /// What is broken, what is open, and what is missing.
    pub verdict: Option<Verdict>,
    /// Which part it is; absent when parts were joined.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shard: Option<ShardRecord>,
    /// The parts that were joined into it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub merged: Option<MergedParts>,
    /// How many conversations were to be held.
    pub planned: usize,
    /// How many were held.
    pub conversations: usize,
    /// How many stimuli were said in them.
    pub stimuli: usize,
    /// How many of them could not be carried to their end.
    pub undecided: usize,
    /// The first reason for that, or why none was held.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
    /// Whether it was ended before its time.
    pub interrupted: bool,
    /// What was said in which situation, and what came of it.
    pub said: Vec<SaidResult>,
    /// The stimuli that the device is not made for, and why.
    pub left_out: Vec<LeftOut>,
    /// What is broken, by requirement.
    pub findings: Vec<FoundResult>,
    /// What was seen and did not show again.
    pub remarks: Vec<FoundResult>,
}

/// A stimulus that the device is not made for.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct LeftOut {
    /// Its name.
    pub stimulus: String,
    /// Why.
    pub why: String,
}

/// A requirement that is broken, and the shortest conversation that shows it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct FoundResult {
    /// The requirement.
    pub requirement: String,
    /// How bad.
    pub verdict: Verdict,
    /// What saw it, the one of the shortest conversation first.
    pub by: Vec<String>,
    /// One line about the conversation.
    pub message: String,
    /// In how many conversations it was seen.
    pub conversations: usize,
    /// What is said in the shortest one.
    pub shortest: Vec<String>,
    /// In how many attempts it showed again.
    pub times: usize,
    /// Out of how many.
    pub of: usize,
    /// The conversation as a test.
    pub test: String,
    /// The parts that have found it; none in a part.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<usize>,
}

impl FoundResult {
    fn of(shown: &Shown) -> Self {
        let one = &shown.finding;
        let others = shown.others.iter().map(|other| other.source.to_string());
        Self {
            requirement: one.requirement.clone(),
            verdict: one.verdict,
            by: std::iter::once(one.source.to_string()).chain(others).collect(),
            message: one.message.clone(),
            conversations: one.count,
            shortest: one.chain.stimuli().to_vec(),
            times: shown.shows.0,
            of: shown.shows.1,
            test: shown.file.text.clone(),
            parts: Vec::new(),
        }
    }

    /// What another part has found of the same requirement; the shortest conversation of both is kept.
    fn and(self, other: Self) -> Self {
        let length = |one: &Self| (one.shortest.len(), one.shortest.clone(), one.test.clone());
        let (mut first, second) = match length(&self) <= length(&other) {
            true => (self, other),
            false => (other, self),
        };
        first.verdict = first.verdict.join(second.verdict);
        for by in second.by {
            if !first.by.contains(&by) {
                first.by.push(by);
            }
        }
        first.conversations += second.conversations;
        first.parts.extend(second.parts);
        first.parts.sort_unstable();
        first.parts.dedup();
        first
    }
}

impl ExploredResult {
    /// What came of a part. Tool, suites and device are still to be said.
    #[must_use]
    pub fn of(explored: &Explored, exploration: &Exploration, shard: ShardRecord) -> Self {
        let table = explored.coverage.table().into_iter();
        let said = table.flat_map(|(situation, stimuli)| {
            stimuli.into_iter().map(move |(stimulus, answers)| SaidResult {
                situation: situation.to_owned(),
                stimulus: stimulus.to_owned(),
                answers,
            })
        });
        let left_out = explored.left_out.iter().map(|(stimulus, why)| LeftOut {
            stimulus: stimulus.clone(),
            why: why.clone(),
        });
        let verdicts = explored.findings.iter().map(|shown| shown.finding.verdict);
        // There was no time to see whether it shows again.
        let is_open = |shown: &Shown| shown.shows.1 == 0 && shown.finding.verdict == Verdict::Fail;
        let is_undecided = explored.interrupted
            || explored.conversations == explored.undecided.0
            || explored.remarks.iter().any(is_open);
        let otherwise = if is_undecided {
            Verdict::Inconclusive
        } else {
            Verdict::Pass
        };
        Self {
            format: RESULT_FORMAT.to_owned(),
            tool: tck_journal::tool(),
            suites_sha256: String::new(),
            role: exploration.grammar.role().word().to_owned(),
            protocol: String::new(),
            manufacturer: String::new(),
            given: Vec::new(),
            seed: exploration.seed,
            length: exploration.length,
            budget: exploration.budget.map(|budget| budget.as_secs()),
            verdict: verdicts.chain([otherwise]).collect::<Accumulated>().get(),
            shard: Some(shard),
            merged: None,
            planned: exploration.numbers().len(),
            conversations: explored.conversations,
            stimuli: explored.stimuli,
            undecided: explored.undecided.0,
            why: explored.undecided.1.clone(),
            interrupted: explored.interrupted,
            said: said.collect(),
            left_out: left_out.collect(),
            findings: explored.findings.iter().map(FoundResult::of).collect(),
            remarks: explored.remarks.iter().map(FoundResult::of).collect(),
        }
    }
}

/// A part of an exploration.
#[derive(Clone, Debug, PartialEq)]
pub struct ExplorationPart {
    /// What came out of it.
    pub result: ExploredResult,
    /// Where its bundle is.
    pub bundle: String,
    /// SHA-256 of its result, in hexadecimal.
    pub sha256: String,
}

impl Part for ExplorationPart {
    fn shard(&self) -> Option<&ShardRecord> {
        self.result.shard.as_ref()
    }

    fn evidence(&self) -> &str {
        &self.sha256
    }

    fn name(&self) -> String {
        format!("the exploration in {}", self.bundle)
    }

    fn facts(&self) -> BTreeMap<String, String> {
        let result = &self.result;
        let budget = result
            .budget
            .map_or_else(|| "none".to_owned(), |budget| format!("{budget} s"));
        let all = [
            ("tool", result.tool.clone()),
            ("hash of the suites", result.suites_sha256.clone()),
            ("role", result.role.clone()),
            ("protocol version", result.protocol.clone()),
            ("manufacturer", result.manufacturer.clone()),
            ("built-in device", result.given.join(", ")),
            ("seed", result.seed.to_string()),
            ("length of a conversation", result.length.to_string()),
            ("budget", budget),
        ];
        all.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
    }

    fn unfinished(&self) -> Option<String> {
        let ExploredResult {
            interrupted,
            conversations,
            planned,
            budget,
            why,
            ..
        } = &self.result;
        if *interrupted {
            return Some("it was interrupted".to_owned());
        }
        let why = why.as_deref().map_or_else(String::new, |why| format!(" ({why})"));
        (budget.is_none() && conversations < planned)
            .then(|| format!("{conversations} of its {planned} conversations were held{why}"))
    }
}

/// Joins parts of an exploration. One that is given twice counts once. `None` when there is no part among them.
#[must_use]
pub fn join(parts: &[ExplorationPart]) -> Option<ExploredResult> {
    let parts = gathered(parts)?;
    let own = &parts.own;
    let first = &own.first()?.result;
    let results = || own.iter().map(|part| &part.result);
    let mut said: BTreeMap<(&str, &str), Answers> = BTreeMap::new();
    for one in results().flat_map(|result| &result.said) {
        let all = said.entry((one.situation.as_str(), one.stimulus.as_str())).or_default();
        all.as_demanded += one.answers.as_demanded;
        all.broken += one.answers.broken;
        all.undecided += one.answers.undecided;
    }
    let said = said.into_iter().map(|((situation, stimulus), answers)| SaidResult {
        situation: situation.to_owned(),
        stimulus: stimulus.to_owned(),
        answers,
    });
    let left_out: BTreeSet<&LeftOut> = results().flat_map(|result| &result.left_out).collect();
    let findings = found(own, |result| &result.findings);
    let mut remarks = found(own, |result| &result.remarks);
    // What is certain in one part is no remark of the whole.
    remarks.retain(|remark| findings.iter().all(|one| one.requirement != remark.requirement));
    let open = parts.troubles.iter().map(|_| Verdict::Inconclusive);
    Some(ExploredResult {
        verdict: results()
            .filter_map(|one| one.verdict)
            .chain(open)
            .collect::<Accumulated>()
            .get(),
        shard: None,
        planned: results().map(|one| one.planned).sum(),
        conversations: results().map(|one| one.conversations).sum(),
        stimuli: results().map(|one| one.stimuli).sum(),
        undecided: results().map(|one| one.undecided).sum(),
        why: results().find_map(|one| one.why.clone()),
        interrupted: results().any(|one| one.interrupted),
        said: said.collect(),
        left_out: left_out.into_iter().cloned().collect(),
        findings,
        remarks,
        merged: Some(MergedParts {
            of: parts.of,
            parts: parts.all.iter().map(|(part, counts)| bundle(part, *counts)).collect(),
            troubles: parts.troubles.clone(),
        }),
        ..first.clone()
    })
}

fn bundle(part: &ExplorationPart, counts: bool) -> MergedBundle {
    MergedBundle {
        index: part.index(),
        counts,
        verdict: part.result.verdict,
        size: part.result.conversations,
        bundle: part.bundle.clone(),
        sha256: part.sha256.clone(),
    }
}

/// What all parts have found, by requirement, the worst first.
fn found(own: &[&ExplorationPart], of: impl Fn(&ExploredResult) -> &Vec<FoundResult>) -> Vec<FoundResult> {
    let mut all: BTreeMap<&str, FoundResult> = BTreeMap::new();
    for part in own {
        for one in of(&part.result) {
            let one_of_part = FoundResult {
                parts: vec![part.index()],
                ..one.clone()
            };
            let joined = match all.remove(one.requirement.as_str()) {
                Some(known) => known.and(one_of_part),
                None => one_of_part,
            };
            all.insert(&one.requirement, joined);
        }
    }
    let mut all: Vec<FoundResult> = all.into_values().collect();
    all.sort_by_key(|one| std::cmp::Reverse(one.verdict));
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_result::TroubleKind;

    fn found_one(requirement: &str, shortest: &[&str], conversations: usize) -> FoundResult {
        FoundResult {
            requirement: requirement.to_owned(),
            verdict: Verdict::Fail,
            by: vec![format!("by {}", shortest.len())],
            message: "seen".to_owned(),
            conversations,
            shortest: shortest.iter().map(|name| (*name).to_owned()).collect(),
            times: 3,
            of: 3,
            test: "test: a\n".to_owned(),
            parts: Vec::new(),
        }
    }

    fn part(index: usize, of: usize, findings: Vec<FoundResult>, remarks: Vec<FoundResult>) -> ExplorationPart {
        let verdict = if findings.is_empty() {
            Verdict::Pass
        } else {
            Verdict::Fail
        };
        let answers = Answers {
            as_demanded: index,
            ..Answers::default()
        };
        ExplorationPart {
            result: ExploredResult {
                format: RESULT_FORMAT.to_owned(),
                tool: "vda5050-tck 0".to_owned(),
                suites_sha256: "suites".to_owned(),
                role: "agv".to_owned(),
                protocol: "2.1.0".to_owned(),
                manufacturer: "ACME".to_owned(),
                given: Vec::new(),
                seed: 7,
                length: 12,
                budget: None,
                verdict: Some(verdict),
                shard: Some(ShardRecord {
                    index,
                    of,
                    origin: "--shard".to_owned(),
                    filled: of,
                    whole: 10,
                    selection: "all".to_owned(),
                }),
                merged: None,
                planned: 5,
                conversations: 5,
                stimuli: 60,
                undecided: 1,
                why: None,
                interrupted: false,
                said: vec![SaidResult {
                    situation: "rest".to_owned(),
                    stimulus: "order".to_owned(),
                    answers,
                }],
                left_out: Vec::new(),
                findings,
                remarks,
            },
            bundle: format!("b{index}"),
            sha256: format!("{index:064x}"),
        }
    }

    #[test]
    fn of_each_requirement_the_shortest_conversation_of_all_parts_is_kept() {
        let mut parts = vec![
            part(1, 2, vec![found_one("ORD-1", &["a", "b", "c"], 2)], Vec::new()),
            part(
                2,
                2,
                vec![found_one("ORD-1", &["a", "b"], 3)],
                vec![found_one("ORD-2", &["a"], 1)],
            ),
        ];
        let whole = join(&parts).expect("parts");
        assert_eq!(whole.merged.as_ref().map(|merged| merged.troubles.len()), Some(0));
        let one = &whole.findings[0];
        assert_eq!((one.shortest.len(), one.conversations, &one.parts), (2, 5, &vec![1, 2]));
        assert_eq!(one.by, ["by 2", "by 3"]);
        assert_eq!((whole.remarks.len(), whole.conversations, whole.stimuli), (1, 10, 120));
        assert_eq!(whole.said[0].answers.as_demanded, 3);
        assert_eq!(whole.verdict, Some(Verdict::Fail));
        parts.reverse();
        parts.push(parts[0].clone());
        assert_eq!(join(&parts), Some(whole), "order and repetition change nothing");
    }

    #[test]
    fn what_is_certain_in_one_part_is_no_remark_of_the_whole() {
        let parts = [
            part(1, 2, vec![found_one("ORD-1", &["a"], 2)], Vec::new()),
            part(2, 2, Vec::new(), vec![found_one("ORD-1", &["b"], 1)]),
        ];
        let whole = join(&parts).expect("parts");
        assert_eq!((whole.findings.len(), whole.remarks.len()), (1, 0));
    }

    #[test]
    fn a_part_that_is_missing_or_ended_too_early_or_drew_from_another_seed_leaves_the_whole_undecided() {
        let kinds = |parts: &[ExplorationPart]| -> Vec<(TroubleKind, usize)> {
            let whole = join(parts).expect("parts");
            assert_eq!(whole.verdict, Some(Verdict::Inconclusive));
            let merged = whole.merged.expect("joined");
            merged.troubles.iter().map(|one| (one.kind, one.index)).collect()
        };
        let all = [1, 2, 3].map(|index| part(index, 3, Vec::new(), Vec::new()));
        assert_eq!(kinds(&all[..2]), [(TroubleKind::Missing, 3)]);
        let mut short = all.clone();
        short[1].result.conversations = 4;
        assert_eq!(kinds(&short), [(TroubleKind::Partial, 2)]);
        let mut other = all.clone();
        other[2].result.seed = 8;
        assert_eq!(kinds(&other), [(TroubleKind::Missing, 3), (TroubleKind::Foreign, 3)]);
        let mut timed = all;
        for one in &mut timed {
            one.result.budget = Some(60);
        }
        timed[0].result.conversations = 3;
        assert_eq!(
            join(&timed).and_then(|whole| whole.verdict),
            Some(Verdict::Pass),
            "a budget leaves out what it has no time for"
        );
    }
}
