//! What came out of a run: tests, requirements and the verdict over all, as they stand at any time.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::super::conversation_coverage;
use super::super::decide::mood;
use super::super::merge;
use super::super::monitor_set::MonitorReport;
use super::super::never_shown;
use super::super::on_word::claimed;
use super::super::requirement_verdict::RequirementVerdict;
use super::RunJudge;
use tck_base::pattern::Bindings;
use tck_base::verdict::{Accumulated, Verdict};
use tck_journal::event::Gate;
use tck_journal::{OwnLatency, Reason, Spread};
use tck_pack::Decided;
use tck_result::{
    Capability, Decision, DeviceIdentity, MessageCoverage, NotDecided, OnWord, ProgramResult, RequirementResult,
    RunResult, TestResult,
};
use tck_suite::model::{Monitor, Test};

/// What restricts a run whose connections cannot be traced to the program that it has started.
const UNTRACED: &str = "Whether it was the program of `device.command` that was judged is not known here: only on Linux, and at \
                        the tap, it is seen which program has a connection.";

/// Format of `result.json`.
pub const RESULT_FORMAT: &str = "vda5050-tck.result/1";

impl RunJudge {
    /// The tests that were planned, as this run and the one before it left them: what was run, in the order of the suites,
    /// and then what was not.
    pub(super) fn tests(&self) -> Vec<TestResult> {
        let mut tests = if self.is_stranger {
            Vec::new()
        } else {
            let mut tests = merge::repetitions(&self.done);
            if self.end.is_some() {
                self.complain_of_left_out(&mut tests);
            }
            tests.extend(self.set_aside());
            tests
        };
        if let Some(earlier) = &self.earlier {
            tests = merge::tests(earlier.tests(), tests);
        }
        // Which order they were run in is the harness's own business.
        let suites = self.rules.suites.tests.iter().enumerate();
        let places: BTreeMap<&str, usize> = suites.map(|(at, test)| (test.id.as_str(), at)).collect();
        tests.sort_by_key(|test| match test.journal {
            Some(_) => (false, places.get(test.id.as_str()).copied()),
            None => (true, None),
        });
        tests
    }

    /// The result as it stands.
    pub fn result(&self) -> RunResult {
        let tests = self.tests();
        let watched = self.watched();
        let all = tests
            .iter()
            .filter_map(|test| test.verdict)
            .chain(watched.iter().filter_map(|watched| watched.result.verdict));
        let verdict: Accumulated = all.collect();
        // Monitors alone make no device conform when tests were planned and none of them applied.
        let none_applied = !tests.is_empty() && tests.iter().all(|test| test.verdict.is_none());
        let verdict = verdict
            .get()
            .filter(|verdict| !none_applied || *verdict > Verdict::Warning);
        let (partial, reason) = match &self.end {
            Some((partial, reason)) => (*partial, reason.clone()),
            None => (true, Some("the run has not ended yet".to_owned())),
        };
        // Nobody knows what the rest would have shown. A failure stands on its evidence.
        let says_nothing = self.is_stranger && self.earlier.is_none();
        let unknown = (partial && !says_nothing).then_some(Verdict::Inconclusive);
        let header = &self.header;
        let joined = self.joined();
        let fleet = match &self.earlier {
            Some(earlier) => self.reactions.after(&earlier.reactions).result(),
            None => self.reactions.result(),
        };
        let limits = self.limits(&tests);
        let mut result = RunResult {
            format: RESULT_FORMAT.to_owned(),
            tool: header.tool.clone(),
            run: header.run.clone(),
            mode: header.mode.clone(),
            started: format!("{:.3}", self.begun.utc),
            seconds: joined.iter().map(|run| run.seconds).sum::<f64>()
                + self.last.moment.since(self.begun.moment).as_secs_f64(),
            role: header.role.clone(),
            protocol: header.protocol.clone(),
            partial,
            partial_reason: reason.filter(|_| partial),
            verdict,
            program: self.program(),
            mixed: self.mixed(),
            device: DeviceIdentity {
                manufacturer: header.manufacturer.clone(),
                serial_number: header.serial_number.clone(),
                series_name: self.plan.series_name.clone(),
            },
            vantage: header.vantage.clone(),
            suites_sha256: header.suites.clone(),
            suites_modified: header.modified,
            journal: "journal.jsonl".to_owned(),
            joined,
            shard: header.shard.clone(),
            merged: None,
            requirements: self.requirements(&tests, &watched),
            exploration: conversation_coverage::exploration(&self.rules.suites.tests, &tests, self.role),
            tests,
            monitors: watched.into_iter().map(|watched| watched.result).collect(),
            capabilities: self
                .plan
                .capabilities
                .iter()
                .map(|capability| Capability {
                    name: capability.name.clone(),
                    value: capability.value.clone(),
                    source: capability.source.clone(),
                })
                .collect(),
            fleet,
            message_coverage: None,
            harness_latency: self.latency(),
            on_word: self.on_word(),
            limits,
            deviations: self.plan.deviations.clone(),
            settings: header.settings.clone(),
        };
        result.message_coverage = Some(self.message_coverage(&result));
        let all = result.verdict.into_iter().chain(unknown).chain(result.aside());
        result.verdict = all.collect::<Accumulated>().get();
        result
    }

    /// What rests on a person's word, in this run and in the one before it.
    fn on_word(&self) -> Vec<OnWord> {
        let mut all = self.earlier.as_ref().map_or_else(Vec::new, |earlier| earlier.on_word());
        let tests = self.done.iter().filter_map(|done| self.test(&done.id));
        let claims = tests.flat_map(|test| claimed(&test, &self.plan.capabilities));
        for one in self.answers.said().iter().cloned().chain(claims) {
            if !all.contains(&one) {
                all.push(one);
            }
        }
        all
    }

    /// Which members, words and action types came by, and what is undecided because something never did.
    fn message_coverage(&self, result: &RunResult) -> MessageCoverage {
        let mut coverage = self.messages.result();
        let bindings = Bindings::above(vec![self.ground.pack.words(), Arc::clone(&self.ground.bindings)]);
        let open: BTreeSet<&str> = result
            .requirements
            .iter()
            .filter(|one| one.not_decided == Some(NotDecided::NothingCame))
            .map(|one| one.id.as_str())
            .collect();
        let tests = result.tests.iter().filter_map(|one| {
            let test = self.test(&one.id)?;
            never_shown::of_test(&test, one, &self.messages, &bindings)
        });
        coverage.undecided = tests.collect();
        let is_open = |_: &Monitor, id: &str| open.contains(id);
        let monitors = never_shown::of_monitors(&self.rules, self.role, &self.messages, &bindings, &is_open);
        coverage.undecided.extend(monitors);
        coverage
    }

    /// What became of the program that was started, in this run and in the one before it.
    fn program(&self) -> Option<ProgramResult> {
        let before = self.earlier.as_ref().and_then(|earlier| earlier.program());
        match before {
            Some(before) => Some(before.and(self.program.result())),
            None => self.program.result(),
        }
    }

    /// How long the harness took itself, in this run and in those before it.
    fn latency(&self) -> Option<OwnLatency> {
        let before = self.earlier.as_ref().and_then(|earlier| earlier.latency());
        before.into_iter().chain(self.latency).reduce(OwnLatency::and)
    }

    /// That the harness was slower with a message than the device may be with anything.
    fn too_slow(&self) -> Option<String> {
        let latency = self.latency?;
        let shortest = self.ground.time.shortest();
        let is_slow = |spread: &Spread| spread.worst() > shortest;
        let worst = [latency.passed_on, latency.judged]
            .into_iter()
            .flatten()
            .filter(is_slow);
        let worst = worst.map(Spread::worst).max()?;
        Some(format!(
            "The harness itself took up to {:.1} s to pass a message on or to judge it, longer than the shortest time limit of this \
             run ({:.1} s): what it sent may have come that much later.",
            worst.as_secs_f64(),
            shortest.as_secs_f64()
        ))
    }

    /// Why it is not certain that it was the device that was judged.
    fn mixed(&self) -> Option<String> {
        let before = self.earlier.as_ref().and_then(|earlier| earlier.mixed());
        before.or_else(|| self.company.mixed())
    }

    /// What restricts the statement, and what was not carried out of these tests.
    fn limits(&self, tests: &[TestResult]) -> Vec<String> {
        let mut limits = self.standing_limits();
        let without_time = tests.iter().filter(|test| test.ran_out_of_time()).count();
        let no_time = (without_time > 0).then(|| {
            format!("Of the selected tests {without_time} had no time (--budget): they were not carried out.")
        });
        let first = tests.iter().find_map(|test| match &test.cause {
            Some(Reason::AfterFailure { test }) => Some(test),
            _ => None,
        });
        let failed = first.map(|first| format!("No test was run after {first}, which failed (--fail-fast)."));
        let new = no_time.into_iter().chain(failed);
        let new: Vec<String> = new.filter(|limit| !limits.contains(limit)).collect();
        limits.extend(new);
        limits
    }

    /// What restricts this run and those before it whatever their tests show, the harness's own lag included.
    fn standing_limits(&self) -> Vec<String> {
        let mut limits = self.plan.limits.clone();
        let lag = self.timeline.longest_lag();
        if !lag.is_zero() {
            limits.push(format!(
                "The harness itself was held up for up to {:.1} s; what that can explain was not held against the device.",
                lag.as_secs_f64()
            ));
        }
        limits.extend(self.too_slow());
        if let Some(story) = self.program.result().and_then(|program| program.story()) {
            limits.push(format!("{story}.").replacen("the program", "The program", 1));
        }
        if self.program.is_there() && !self.program.traces() {
            limits.push(UNTRACED.to_owned());
        }
        limits.extend(self.company.limits());
        let before = self.earlier.iter().flat_map(|earlier| earlier.standing_limits());
        let before: Vec<String> = before.filter(|limit| !limits.contains(limit)).collect();
        limits.extend(before);
        limits
    }

    /// A repetition that was asked for and not done is undecided, and so is its test.
    fn complain_of_left_out(&self, tests: &mut [TestResult]) {
        let Some(repeat) = self.plan.repeat else { return };
        for test in tests {
            let planned = self.plan.tests.iter().find(|planned| planned.test == test.id);
            let why = match planned.map(|planned| &planned.gate) {
                Some(Gate::Unobservable(why) | Gate::NotApplicable(why)) => Some(why),
                Some(Gate::Runs) | None => None,
            };
            merge::left_out(test, repeat, why);
        }
    }

    /// The planned tests that did not run, with the reason.
    fn set_aside(&self) -> Vec<TestResult> {
        let mut all = Vec::new();
        for planned in &self.plan.tests {
            if self.done.iter().any(|done| done.id == planned.test) {
                continue;
            }
            let Some(test) = self.test(&planned.test) else { continue };
            let mut result = TestResult {
                id: test.id.clone(),
                title: test.title.clone(),
                verdict: None,
                not_applicable: None,
                seconds: 0.0,
                reason: None,
                cause: None,
                maturity: test.maturity.word().to_owned(),
                maturity_note: test.maturity.note().map(str::to_owned),
                journal: None,
                decisions: Vec::new(),
                steps: Vec::new(),
                allowances: Vec::new(),
                repetitions: Vec::new(),
            };
            let why = match &planned.gate {
                Gate::NotApplicable(why) => {
                    result.not_applicable = Some(why.to_string());
                    result.cause = why.clone().typed();
                    all.push(result);
                    continue;
                }
                Gate::Unobservable(why) => why.clone(),
                Gate::Runs if self.end.is_some() => Reason::RunEnded,
                Gate::Runs => continue,
            };
            result.verdict = Some(Verdict::Inconclusive);
            let sentence = why.to_string();
            for step in &test.steps {
                for (requirement, clause) in step.clauses() {
                    if mood(&self.ground.catalogue, &self.ground.pack, requirement.as_str()).is_some() {
                        result.decisions.push(undecided(
                            requirement.as_str(),
                            clause,
                            step.verb_span.place(),
                            &sentence,
                        ));
                    }
                }
            }
            result.reason = Some(sentence);
            result.cause = why.typed();
            all.push(result);
        }
        all
    }

    fn requirements(&self, tests: &[TestResult], watched: &[MonitorReport]) -> Vec<RequirementResult> {
        let mut decided: BTreeMap<&str, RequirementVerdict> = BTreeMap::new();
        for test in tests {
            for decision in &test.decisions {
                let opinions = decided.entry(decision.requirement.as_str()).or_default();
                opinions.add(decision.verdict(), &test.id, test.journal.is_some());
            }
        }
        let monitored: Vec<(String, Vec<(String, Verdict)>)> = watched
            .iter()
            .map(|watched| (watched.result.id.clone(), watched.decisions()))
            .collect();
        for (id, decisions) in &monitored {
            for (requirement, verdict) in decisions {
                decided.entry(requirement.as_str()).or_default().add(*verdict, id, true);
            }
        }
        let mut all = Vec::new();
        for requirement in self.rules.catalogue.all() {
            let requirement = requirement.edition(&self.ground.pack);
            let id = requirement.id.as_str();
            let opinions = decided.remove(id);
            // What another version asks is listed when a vehicle that speaks it has decided it.
            let is_asked = requirement.in_version(&self.ground.pack).is_some() || opinions.is_some();
            if !requirement.role.concerns(self.role) || !is_asked {
                continue;
            }
            let opinions = opinions.unwrap_or_default();
            let verdict = opinions.verdict();
            let not_decided = match verdict {
                Some(_) => None,
                None => Some(self.why_not(id, &requirement.decided, tests, watched)),
            };
            all.push(RequirementResult {
                id: id.to_owned(),
                own: requirement.is_own.then(|| requirement.chapter.clone()),
                verdict,
                verdicts: opinions.verdicts(),
                decided_by: opinions.by,
                shards: Vec::new(),
                not_decided,
            });
        }
        all
    }

    fn why_not(&self, id: &str, decided: &Decided, tests: &[TestResult], watched: &[MonitorReport]) -> NotDecided {
        if let Decided::NotTestable { reason } = decided {
            return NotDecided::NotTestable(reason.clone());
        }
        let deciding = self.rules.suites.deciding(id).iter();
        let with_test: Vec<&Arc<Test>> = deciding.filter(|test| test.device == self.role).collect();
        if with_test.is_empty() {
            let monitored = watched
                .iter()
                .any(|w| w.monitor.checks.iter().any(|b| b.requirement.as_str() == id));
            return if monitored {
                NotDecided::NothingCame
            } else {
                NotDecided::NoTest
            };
        }
        let reason = with_test.iter().find_map(|test| {
            let result = tests.iter().find(|result| result.id == test.id)?;
            result.not_applicable.clone()
        });
        reason.map_or(NotDecided::NotSelected, NotDecided::NotApplicable)
    }
}

fn undecided(requirement: &str, clause: String, place: String, why: &str) -> Decision {
    Decision::new(requirement, Verdict::Inconclusive, clause, place, why.to_owned())
}
