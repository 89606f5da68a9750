//! A run as cases, as every format for test results has them: the run itself, each test, each monitor.
//!
//! What a case is called in a format, and how an undecided one is shown there, is left to the format.

use std::fmt::Write as _;

use super::findings::{PROGRAM, is_told_by_tests};
use super::repeated;
use super::sources::Sources;
use super::statement;
use tck_base::verdict::Verdict;
use tck_result::{Decision, MonitorResult, RunResult, TestResult};

/// The suite that is about the run itself.
pub const RUN_SUITE: &str = "run";
/// The case of that suite.
pub const RUN_CASE: &str = "the run is complete and decided something";
/// What stands in the place of the verdict of what does not apply.
pub(super) const NOT_APPLICABLE: &str = "not applicable";
/// The suite of the monitors.
pub const MONITORS: &str = "monitors";

/// Where the failure of a case is counted, when that is not the case itself: one mistake is one failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Elsewhere {
    /// In the tests that failed: they show all that a monitor has failed for.
    Tests,
    /// In the case of the requirement that it follows from.
    Cause,
}

impl Elsewhere {
    /// The place as a word.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Tests => "tests",
            Self::Cause => "cause",
        }
    }
}

/// One case. Its texts hold what a device said: they are cleaned by the format that shows them.
#[derive(Clone, Debug, PartialEq)]
pub struct Case<'a> {
    /// The suite it belongs to.
    pub suite: &'a str,
    /// The name: the id of a test or monitor, or a sentence.
    pub name: String,
    /// What it is about, in one line.
    pub title: &'a str,
    /// How long it took.
    pub seconds: f64,
    /// How it ended; none when nothing was decided, see [`absent`](Self::absent).
    pub verdict: Option<Verdict>,
    /// What stands in the place of a verdict: it did not apply, or there was nothing to judge.
    pub absent: &'static str,
    /// Where its failure is counted, when that is not here: then no format counts it.
    pub elsewhere: Option<Elsewhere>,
    /// The requirement of the worst decision.
    pub kind: &'a str,
    /// Why the verdict is not a pass, in one line.
    pub message: String,
    /// All that was found, in many lines.
    pub details: String,
    /// What is said although it passed: a remark, or how often it was run.
    pub remark: Option<String>,
    /// The requirements it decides.
    pub requirements: Vec<&'a str>,
    /// The test, if it is one.
    pub test: Option<&'a TestResult>,
}

impl Case<'_> {
    /// Whether it is about the run itself: then it is red when it is not decided, whatever is asked for.
    #[must_use]
    pub fn of_run(&self) -> bool {
        self.suite == RUN_SUITE
    }

    /// Whether repetitions of its test have different verdicts.
    #[must_use]
    pub fn is_flaky(&self) -> bool {
        self.test.is_some_and(TestResult::is_flaky)
    }

    /// The verdict as a word.
    #[must_use]
    pub fn word(&self) -> &'static str {
        self.verdict.map_or(self.absent, Verdict::word)
    }

    /// The verdict that a format counts: none where it is counted elsewhere.
    #[must_use]
    pub fn counted(&self) -> Option<Verdict> {
        self.verdict.filter(|_| self.elsewhere.is_none())
    }
}

/// All cases of a run: what is about the run, the tests by their groups, the monitors.
#[must_use]
pub fn cases<'a>(result: &'a RunResult, sources: &'a Sources) -> Vec<Case<'a>> {
    let mut all = of_run(result);
    let tests: Vec<Case<'a>> = result.tests.iter().map(of_test).collect();
    let mut groups: Vec<&str> = Vec::new();
    for test in &tests {
        if !groups.contains(&test.suite) {
            groups.push(test.suite);
        }
    }
    for group in groups {
        all.extend(tests.iter().filter(|test| test.suite == group).cloned());
    }
    let monitors = result.monitors.iter();
    all.extend(monitors.map(|monitor| of_monitor(monitor, is_told_by_tests(monitor, result), sources)));
    all
}

/// What is about the run itself: whether it came to its end, whether its program did so by itself, and who was judged.
#[must_use]
pub fn of_run(result: &RunResult) -> Vec<Case<'_>> {
    let of = |name: &str, verdict: Verdict, message: String| Case {
        suite: RUN_SUITE,
        name: name.to_owned(),
        title: "",
        seconds: 0.0,
        verdict: Some(verdict),
        absent: NOT_APPLICABLE,
        elsewhere: None,
        kind: "",
        message,
        details: String::new(),
        remark: None,
        requirements: Vec::new(),
        test: None,
    };
    let statement = statement::statement(result);
    let mut all = vec![match statement::trouble(result) {
        Some(reason) => Case {
            details: statement,
            ..of(RUN_CASE, Verdict::Error, reason)
        },
        None => Case {
            remark: Some(statement),
            ..of(RUN_CASE, Verdict::Pass, String::new())
        },
    }];
    if let Some(program) = &result.program {
        let story = program.story().unwrap_or_default();
        let name = "the program that was started ran until it was ended";
        all.push(Case {
            kind: PROGRAM,
            details: program.first().map_or_else(String::new, |end| end.words.clone()),
            ..of(name, program.verdict().unwrap_or(Verdict::Pass), story)
        });
    }
    if let Some(why) = &result.mixed {
        let name = "nobody else was taken for the device";
        all.push(of(name, Verdict::Inconclusive, why.clone()));
    }
    all
}

fn of_test(test: &TestResult) -> Case<'_> {
    let verdict = statement::test_verdict(test);
    let worst = test.decisions.iter().find(|one| Some(one.verdict()) == verdict);
    let message = match (&test.not_applicable, &test.reason, worst) {
        (Some(why), _, _) if verdict.is_none() => why.as_str(),
        (_, Some(reason), _) => reason.as_str(),
        (_, None, Some(decision)) => decision.message.as_str(),
        (_, None, None) => "the test decided nothing",
    };
    let repeated = repeated::summary(test);
    let message = match &repeated {
        Some(repeated) if test.is_flaky() => format!("{repeated}: {message}"),
        _ => message.to_owned(),
    };
    let mut findings: Vec<&Decision> = test.findings().collect();
    findings.sort_by_key(|decision| std::cmp::Reverse(decision.verdict()));
    let details: Vec<String> = findings.into_iter().map(finding).collect();
    let details = details.join("\n\n");
    let mut requirements: Vec<&str> = Vec::new();
    for decision in &test.decisions {
        if !requirements.contains(&decision.requirement.as_str()) {
            requirements.push(&decision.requirement);
        }
    }
    Case {
        suite: test.id.split_once('/').map_or("tests", |(group, _)| group),
        name: test.id.clone(),
        title: &test.title,
        seconds: test.seconds,
        verdict,
        absent: NOT_APPLICABLE,
        elsewhere: None,
        kind: worst.map_or("", |decision| decision.requirement.as_str()),
        remark: match verdict {
            Some(Verdict::Warning) => Some(format!("warning: {message}\n\n{details}")),
            _ => repeated,
        },
        message,
        details,
        requirements,
        test: Some(test),
    }
}

fn finding(decision: &Decision) -> String {
    let verdict = decision.verdict();
    let Decision {
        requirement,
        clause,
        place,
        message,
        ..
    } = decision;
    let mut text = format!("{verdict}: {requirement}: {message}\n{clause} at {place}");
    if let Some(sent) = &decision.sent {
        let _ = write!(text, "\nsent: {sent}");
    }
    if let Some(witness) = decision.witness {
        let _ = write!(text, "\ndecided by message #{witness}");
    }
    if let Some(nearest) = &decision.nearest {
        let _ = write!(
            text,
            "\nclosest: #{} {}: {} (expected {})",
            nearest.seq, nearest.path, nearest.found, nearest.expected
        );
    }
    if let Some(explanation) = &decision.explanation {
        text.push('\n');
        text.push_str(explanation);
    }
    text
}

/// `told` says that failed tests show all that it has failed for: a mistake is one failure.
fn of_monitor<'a>(monitor: &'a MonitorResult, told: bool, sources: &'a Sources) -> Case<'a> {
    let mut findings: Vec<_> = monitor.findings.iter().collect();
    findings.sort_by_key(|finding| std::cmp::Reverse(finding.verdict));
    let message = match (findings.first(), monitor.verdict) {
        (Some(finding), Some(_)) => finding.message.as_str(),
        (_, None) => "there was nothing to judge",
        (None, Some(_)) => monitor.title.as_str(),
    };
    let lines = findings.iter().map(|finding| {
        let first: Vec<String> = finding.first.iter().map(|seq| format!("#{seq}")).collect();
        format!(
            "{}: {}: {} ({}; first at {})",
            finding.verdict,
            finding.requirement,
            finding.message,
            statement::times(finding.count),
            first.join(", ")
        )
    });
    let details = lines.collect::<Vec<_>>().join("\n");
    let known = sources.monitor(&monitor.id);
    let kind = findings.first().map_or("", |finding| finding.requirement.as_str());
    let message = match told {
        true => format!("the tests that failed show it: {kind}: {message}"),
        false => message.to_owned(),
    };
    Case {
        suite: MONITORS,
        name: monitor.id.clone(),
        title: &monitor.title,
        seconds: 0.0,
        verdict: monitor.verdict,
        absent: "nothing to judge",
        elsewhere: told.then_some(Elsewhere::Tests),
        kind,
        message,
        remark: (told || monitor.verdict == Some(Verdict::Warning)).then(|| details.clone()),
        details,
        requirements: known.map_or_else(Vec::new, |known| {
            known.requirements.iter().map(String::as_str).collect()
        }),
        test: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::tests::run;
    use crate::junit::Inconclusive;
    use crate::keys::Keys;
    use crate::{allure, ctrf, junit};

    #[test]
    fn a_monitor_that_tests_have_told_keeps_its_verdict_and_is_counted_once() {
        let told = run(&[("STATE-12", "fail", 5)], &[("STATE-12", &[5])]);
        let sources = Sources::default();
        let all = cases(&told, &sources);
        let monitor = all.iter().find(|case| case.suite == MONITORS).expect("a monitor");
        assert_eq!((monitor.word(), monitor.counted()), ("fail", None));
        let found = ctrf::render(&told, &sources, Inconclusive::Error);
        let found: serde_json::Value = serde_json::from_str(&found).expect("JSON");
        let tests = found["results"]["tests"].as_array().expect("tests");
        let shown = tests.iter().find(|test| test["name"] == "a/m").expect("a monitor");
        assert_eq!(
            (&shown["status"], &shown["rawStatus"], &shown["extra"]["countedIn"]),
            (&"skipped".into(), &"fail".into(), &"tests".into())
        );
        let files = allure::render(&told, &sources, Inconclusive::Error);
        let file = files
            .iter()
            .find(|(_, text)| text.contains("monitors: a/m"))
            .expect("a monitor");
        assert!(
            file.1.contains("\"skipped\"") && file.1.contains("\"counted-in\""),
            "{}",
            file.1
        );
        let xml = junit::with_keys(&told, &sources, &Keys::default(), junit::Flavour::default()).expect("XML");
        let case = xml
            .lines()
            .find(|line| line.contains("name=\"a/m\""))
            .expect("a monitor");
        for part in [
            "<skipped type=\"fail\"",
            "name=\"vda5050.verdict\" value=\"fail\"",
            "name=\"vda5050.counted-in\" value=\"tests\"",
        ] {
            assert!(case.contains(part), "{part}: {case}");
        }
    }

    #[test]
    fn a_monitor_that_judged_nothing_says_so() {
        let mut nothing = run(&[], &[]);
        nothing.monitors[0].verdict = None;
        let sources = Sources::default();
        let all = cases(&nothing, &sources);
        let monitor = all.iter().find(|case| case.suite == MONITORS).expect("a monitor");
        assert_eq!(monitor.word(), "nothing to judge");
        let xml = junit::render(&nothing, junit::Flavour::default()).expect("XML");
        assert!(xml.contains("<skipped type=\"nothing to judge\""), "{xml}");
    }
}
