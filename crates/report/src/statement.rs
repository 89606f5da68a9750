//! What a run says, in one sentence, in numbers, and with its limits.
//!
//! Terminal and HTML say the same words because both take them from here. The sentence never claims more
//! than was decided: a pass speaks of the requirements that were decided and names how many were not.

use std::collections::BTreeSet;

use super::clean::line;
use tck_base::verdict::Verdict;
use tck_result::{NotDecided, ProgramResult, RequirementResult, RunResult, TestResult};

/// How many tests that rest on a person's word are named.
const ON_WORD: usize = 4;

/// How many of something got which verdict.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Passed.
    pub pass: usize,
    /// Passed with a remark.
    pub warning: usize,
    /// Could not be decided.
    pub inconclusive: usize,
    /// Our own trouble.
    pub error: usize,
    /// Failed.
    pub fail: usize,
    /// Without a verdict: not applicable, or not decided.
    pub none: usize,
}

impl Counts {
    /// Counts verdicts.
    #[must_use]
    pub fn of(verdicts: impl IntoIterator<Item = Option<Verdict>>) -> Self {
        let mut counts = Self::default();
        for verdict in verdicts {
            *match verdict {
                Some(Verdict::Pass) => &mut counts.pass,
                Some(Verdict::Warning) => &mut counts.warning,
                Some(Verdict::Inconclusive) => &mut counts.inconclusive,
                Some(Verdict::Error) => &mut counts.error,
                Some(Verdict::Fail) => &mut counts.fail,
                None => &mut counts.none,
            } += 1;
        }
        counts
    }

    /// How many got this verdict.
    #[must_use]
    pub fn get(&self, verdict: Option<Verdict>) -> usize {
        match verdict {
            Some(Verdict::Pass) => self.pass,
            Some(Verdict::Warning) => self.warning,
            Some(Verdict::Inconclusive) => self.inconclusive,
            Some(Verdict::Error) => self.error,
            Some(Verdict::Fail) => self.fail,
            None => self.none,
        }
    }

    /// How many there are.
    #[must_use]
    pub fn total(&self) -> usize {
        self.pass + self.warning + self.inconclusive + self.error + self.fail + self.none
    }

    /// How many were decided one way or the other: pass, warning or fail.
    #[must_use]
    pub fn decided(&self) -> usize {
        self.pass + self.warning + self.fail
    }
}

/// Counts of the tests; `none` is *not applicable*.
#[must_use]
pub fn tests(result: &RunResult) -> Counts {
    Counts::of(result.tests.iter().map(test_verdict))
}

/// The verdict of a test as it counts: one that decided nothing, and was not set aside, is an error.
#[must_use]
pub fn test_verdict(test: &TestResult) -> Option<Verdict> {
    match (test.verdict, &test.not_applicable) {
        (None, None) => Some(Verdict::Error),
        (verdict, _) => verdict,
    }
}

/// Whether a test was decided, as often as it was to be run, or does not apply.
#[must_use]
pub fn is_settled(test: &TestResult) -> bool {
    match test_verdict(test) {
        None => true,
        Some(Verdict::Pass | Verdict::Warning | Verdict::Fail) => test.left_out() == 0,
        Some(Verdict::Inconclusive | Verdict::Error) => false,
    }
}

/// Counts of the monitors; `none` is *nothing to judge*.
#[must_use]
pub fn monitors(result: &RunResult) -> Counts {
    Counts::of(result.monitors.iter().map(|monitor| monitor.verdict))
}

/// Counts of the requirements; `none` is *not decided*.
#[must_use]
pub fn requirements(result: &RunResult) -> Counts {
    counts_of(result.requirements.iter())
}

fn counts_of<'r>(requirements: impl Iterator<Item = &'r RequirementResult>) -> Counts {
    Counts::of(requirements.map(|requirement| requirement.verdict))
}

/// The requirements of the standard.
fn of_standard(result: &RunResult) -> impl Iterator<Item = &RequirementResult> + Clone {
    result
        .requirements
        .iter()
        .filter(|requirement| requirement.own.is_none())
}

/// Why a requirement has no verdict.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gap {
    /// The device declares that it lacks what the requirement is about.
    NotApplicable,
    /// The catalogue says that no test can decide it.
    NotTestable,
    /// Nothing decided it.
    NotDecided,
}

/// Why a requirement has no verdict; `None` when it has one.
#[must_use]
pub fn gap(requirement: &RequirementResult) -> Option<Gap> {
    match (requirement.verdict, &requirement.not_decided) {
        (Some(_), _) => None,
        (None, Some(NotDecided::NotApplicable(_))) => Some(Gap::NotApplicable),
        (None, Some(NotDecided::NotTestable(_))) => Some(Gap::NotTestable),
        (None, _) => Some(Gap::NotDecided),
    }
}

/// How many requirements have no verdict, by the reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gaps {
    /// [`Gap::NotApplicable`].
    pub not_applicable: usize,
    /// [`Gap::NotTestable`].
    pub not_testable: usize,
    /// [`Gap::NotDecided`].
    pub not_decided: usize,
}

/// How many requirements have no verdict, by the reason.
#[must_use]
pub fn gaps(result: &RunResult) -> Gaps {
    gaps_of(result.requirements.iter())
}

fn gaps_of<'r>(requirements: impl Iterator<Item = &'r RequirementResult>) -> Gaps {
    let mut gaps = Gaps::default();
    for requirement in requirements {
        match gap(requirement) {
            Some(Gap::NotApplicable) => gaps.not_applicable += 1,
            Some(Gap::NotTestable) => gaps.not_testable += 1,
            Some(Gap::NotDecided) => gaps.not_decided += 1,
            None => {}
        }
    }
    gaps
}

/// How many requirements apply and were not decided one way or the other.
fn undecided(result: &RunResult) -> usize {
    let counts = requirements(result);
    counts.total() - counts.decided() - gaps(result).not_applicable
}

/// `1 requirement`, `2 requirements`.
#[must_use]
pub fn many(count: usize, one: &str) -> String {
    match count {
        1 => format!("1 {one}"),
        _ => format!("{count} {one}s"),
    }
}

/// `once`, `2 times`.
#[must_use]
pub fn times(count: u64) -> String {
    match count {
        1 => "once".to_owned(),
        _ => format!("{count} times"),
    }
}

/// The word of a pair that goes with a count: `was` or `were`.
#[must_use]
pub fn verb(count: usize, one: &'static str, several: &'static str) -> &'static str {
    if count == 1 { one } else { several }
}

/// Manufacturer and serial number, made safe to show.
#[must_use]
pub fn device(result: &RunResult) -> String {
    let device = &result.device;
    let name = format!("{} {}", device.manufacturer, device.serial_number);
    if name.trim().is_empty() {
        return "The device under test".to_owned();
    }
    line(name.trim()).into_owned()
}

/// `AGV` or `master control`.
#[must_use]
pub fn role(result: &RunResult) -> &str {
    match result.role.as_str() {
        "agv" => "AGV",
        "master-control" => "master control",
        other => other,
    }
}

/// What is said of the requirements of somebody's own, a sentence for each chapter.
fn own_statements(result: &RunResult) -> String {
    let mut chapters: Vec<&str> = Vec::new();
    for chapter in result
        .requirements
        .iter()
        .filter_map(|requirement| requirement.own.as_deref())
    {
        if !chapters.contains(&chapter) {
            chapters.push(chapter);
        }
    }
    let of = |chapter: &str| {
        let own = result
            .requirements
            .iter()
            .filter(|one| one.own.as_deref() == Some(chapter));
        let counts = counts_of(own.clone());
        let applicable = counts.total() - gaps_of(own).not_applicable;
        let broken = match counts.fail {
            0 => "none broken".to_owned(),
            count => format!("{count} broken"),
        };
        let asked = many(applicable, "applicable requirement");
        format!(" {}: {} of {asked} decided, {broken}.", line(chapter), counts.decided())
    };
    chapters.into_iter().map(of).collect()
}

/// The statement of the run: a sentence on the standard, and one on each chapter of requirements of somebody's own. Device
/// strings in it are clean, but not escaped for a format.
#[must_use]
pub fn statement(result: &RunResult) -> String {
    let who = device(result);
    let counts = counts_of(of_standard(result));
    let decided = counts.decided();
    let not_applicable = gaps_of(of_standard(result)).not_applicable;
    let applicable = counts.total() - not_applicable;
    let open = applicable - decided;
    let own_broken = result
        .requirements
        .iter()
        .any(|one| one.own.is_some() && one.verdict == Some(Verdict::Fail));
    let partial = match (result.partial, &result.merged) {
        (true, Some(_)) => "These parts are not the whole. ",
        (true, None) => "This run ended early. ",
        (false, _) => "",
    };
    let share = share(result);
    let standard = format!("VDA 5050 {}", line(&result.protocol));
    let role = match role(result) {
        "AGV" => "an AGV".to_owned(),
        other => format!("a {}", line(other)),
    };
    let of_decided = format!("{decided} of {} decided", many(applicable, "applicable requirement"));
    let rest = match open {
        0 => String::new(),
        _ => format!("; {open} not decided"),
    };
    let sentence = match result.verdict {
        Some(Verdict::Fail) if counts.fail == 0 && !anything_failed(result) => {
            format!(
                "{who} failed: {}, though no requirement of {standard} was found broken; {of_decided}{rest}.",
                ended(result)
            )
        }
        Some(Verdict::Fail) if counts.fail == 0 && own_broken && !program_failed(result) => {
            format!("{who} broke no binding requirement of {standard} as {role}: {of_decided}{rest}.")
        }
        Some(Verdict::Fail) => {
            let broken = match counts.fail {
                0 => "a test or monitor failed".to_owned(),
                count => format!("{} broken", many(count, "requirement")),
            };
            let broken = match program_failed(result) {
                true => format!("{broken}, and {}", ended(result)),
                false => broken,
            };
            format!("{who} does not conform to {standard} as {role}: {broken}; {of_decided}{rest}.")
        }
        Some(Verdict::Error) => format!(
            "No statement on {who} and {standard}: the harness or its environment broke; {of_decided}, none of them broken."
        ),
        Some(Verdict::Inconclusive) => {
            let undecided = match counts.inconclusive {
                _ if result.mixed.is_some() => line(result.mixed.as_deref().unwrap_or_default()).into_owned(),
                0 => "not every test could be completed".to_owned(),
                count => format!("{} could not be decided", many(count, "requirement")),
            };
            format!(
                "Not decided whether {who} conforms to {standard} as {role}: no violation found, but {undecided}; {of_decided}."
            )
        }
        Some(Verdict::Warning) => {
            let remarks = match counts.warning {
                0 => "remarks".to_owned(),
                count => many(count, "remark"),
            };
            format!("{who} broke no binding requirement of {standard} as {role}, with {remarks}: {of_decided}{rest}.")
        }
        Some(Verdict::Pass) if result.partial => {
            format!("Until then {who} broke nothing of {standard} as {role}: {of_decided}{rest}.")
        }
        Some(Verdict::Pass) => {
            format!("{who} conforms to {standard} as {role} in all that was tested: {of_decided}, none broken{rest}.")
        }
        None if result.tests.iter().any(|test| test.not_applicable.is_some()) => {
            format!("No test applied to {who}, so nothing is said about whether it conforms to {standard} as {role}.")
        }
        None => format!("Nothing was decided about {who} and {standard}."),
    };
    let joined = match result.joined.as_slice() {
        [] => String::new(),
        runs => {
            let kept: usize = runs.iter().map(|run| run.kept).sum();
            format!(
                "Joined from {} (decided tests kept from the interrupted: {kept}). ",
                many(runs.len() + 1, "run")
            )
        }
    };
    let flaky = match result.tests.iter().filter(|test| test.is_flaky()).count() {
        0 => String::new(),
        1 => " 1 test is flaky: its repetitions have different verdicts.".to_owned(),
        count => format!(" {count} tests are flaky: their repetitions have different verdicts."),
    };
    let own_statements = own_statements(result);
    let own = if result.suites_modified {
        "With suites that are not the delivered ones: "
    } else {
        ""
    };
    format!("{share}{own}{joined}{partial}{sentence}{own_statements}{flaky}")
}

/// Whether a statement is about a part of a run, or about parts that were joined.
fn share(result: &RunResult) -> String {
    match (&result.shard, &result.merged) {
        (Some(shard), _) => format!("Part {} of {} of a run. ", shard.index, shard.of),
        (None, Some(merged)) => {
            let own = merged.parts.iter().filter(|part| part.counts).count();
            format!("Joined from {}. ", many(own, "part"))
        }
        (None, None) => String::new(),
    }
}

/// Why a run is partial, as a sentence without its end.
#[must_use]
pub fn partial(result: &RunResult) -> Option<String> {
    if !result.partial {
        return None;
    }
    let reason = result
        .partial_reason
        .as_deref()
        .map(|reason| reason.trim_end_matches('.'));
    let what = match result.merged {
        Some(_) => "What was joined is not the whole",
        None => "The run ended before its plan did",
    };
    Some(match reason {
        Some(reason) => format!("{what}: {reason}"),
        None => what.to_owned(),
    })
}

/// Whether the program that was started ended by itself.
fn program_failed(result: &RunResult) -> bool {
    let program = result.program.as_ref().and_then(ProgramResult::verdict);
    program == Some(Verdict::Fail)
}

fn ended(result: &RunResult) -> String {
    let ends = result
        .program
        .as_ref()
        .map_or(0, |program| program.ends - program.excused.min(program.ends));
    match ends {
        1 => "its program ended by itself".to_owned(),
        ends => format!("its program ended by itself {ends} times"),
    }
}

/// Whether a test or a monitor failed. What else makes a run fail is the end of its program.
fn anything_failed(result: &RunResult) -> bool {
    !program_failed(result) || tests(result).fail > 0 || monitors(result).fail > 0
}

/// Whether requirements were left undecided since their tests were not selected.
#[must_use]
pub fn is_selection(result: &RunResult) -> bool {
    let mut all = result.requirements.iter();
    all.any(|requirement| requirement.not_decided == Some(NotDecided::NotSelected))
}

/// Why nobody may take a run for a green one, whatever stands in its tests: it ended early, or decided nothing of what was
/// selected.
#[must_use]
pub fn trouble(result: &RunResult) -> Option<String> {
    let tests = tests(result);
    if result.partial {
        let reason = result.partial_reason.as_deref();
        return Some(reason.unwrap_or("the run ended before its plan did").to_owned());
    }
    if result.verdict.is_none() {
        return Some("nothing was decided".to_owned());
    }
    if requirements(result).decided() == 0 {
        return Some("no requirement was decided".to_owned());
    }
    // What monitors found is about the traffic. Were all tests skipped, nothing would be red.
    match result.tests.len() {
        0 => Some("no test was selected".to_owned()),
        _ if tests.none == result.tests.len() => Some("none of the selected tests applies to the device".to_owned()),
        1 if tests.decided() == 0 => Some("the selected test was not decided".to_owned()),
        all if tests.decided() == 0 => Some(format!("none of the {all} selected tests was decided")),
        _ => None,
    }
}

/// Which tests rest on a person's word, in one sentence; nothing when none does.
fn resting_on_word(result: &RunResult) -> Option<String> {
    let tests: BTreeSet<&str> = result.on_word.iter().map(|one| one.test.as_str()).collect();
    let more = match tests.len().saturating_sub(ON_WORD) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    let verb = match tests.len() {
        0 => return None,
        1 => "rests",
        _ => "rest",
    };
    let count = many(tests.len(), "test");
    let named: Vec<&str> = tests.into_iter().take(ON_WORD).collect();
    let named = line(&named.join(", ")).into_owned();
    Some(format!(
        "{count} {verb} on a person's word, which no message shows (answers to prompts, claims of the profile): {named}{more}."
    ))
}

/// What restricts the statement, one sentence each: what follows from the result itself, then what the run
/// noted. Clean, but not escaped for a format.
#[must_use]
pub fn limits(result: &RunResult) -> Vec<String> {
    let mut all = Vec::new();
    // What keeps parts from being the whole stands among the limits of the result, one by one.
    if let Some(reason) = partial(result).filter(|_| result.merged.is_none()) {
        all.push(format!("{}.", line(&reason)));
    }
    if result.suites_modified {
        all.push("The suites differ from the ones this tool was delivered with.".to_owned());
    }
    if result.vantage == "subscriber" {
        all.push(
            "Packets of the device could not be seen, only what the broker delivered: facts such as last will and keep-alive stay undecided."
                .to_owned(),
        );
    }
    match undecided(result) {
        0 => {}
        1 => all.push("1 applicable requirement was not decided.".to_owned()),
        open => all.push(format!("{open} applicable requirements were not decided.")),
    }
    let young = result
        .tests
        .iter()
        .filter(|test| test.maturity == "watchlist" && matches!(test.verdict, Some(Verdict::Fail | Verdict::Warning)))
        .count();
    if young > 0 {
        let tests = many(young, "test");
        all.push(match young {
            1 => format!("{tests} with a finding is on the watchlist: what it holds true is disputed."),
            _ => format!("{tests} with a finding are on the watchlist: what they hold true is disputed."),
        });
    }
    all.extend(resting_on_word(result));
    for limit in &result.limits {
        let limit = line(limit).into_owned();
        if !all.contains(&limit) {
            all.push(limit);
        }
    }
    all
}

/// Seconds for people: `0.412 s`, `31.9 s`, `12 min 5 s`, `2 h 1 min`.
#[must_use]
pub fn seconds(seconds: f64) -> String {
    // A result may have been read from a file that anybody wrote.
    if !(0.0..1e9).contains(&seconds) {
        return "?".to_owned();
    }
    if seconds < 0.9995 {
        format!("{seconds:.3} s")
    } else if seconds < 59.95 {
        format!("{seconds:.1} s")
    } else {
        let whole = seconds.round();
        let minutes = (whole / 60.0).floor();
        let hours = (minutes / 60.0).floor();
        if hours > 0.0 {
            format!("{hours:.0} h {:.0} min", minutes - hours * 60.0)
        } else {
            format!("{minutes:.0} min {:.0} s", whole - minutes * 60.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_read_well_at_every_size() {
        assert_eq!(seconds(0.0), "0.000 s");
        assert_eq!(seconds(0.4119), "0.412 s");
        assert_eq!(seconds(31.94), "31.9 s");
        assert_eq!(seconds(725.2), "12 min 5 s");
        assert_eq!(seconds(59.96), "1 min 0 s");
        assert_eq!(seconds(7_260.0), "2 h 1 min");
        assert_eq!(seconds(f64::NAN), "?");
        assert_eq!(seconds(f64::MAX), "?");
        assert_eq!(seconds(-1.0), "?");
    }

    #[test]
    fn counts_add_up() {
        let counts = Counts::of(Verdict::ALL.into_iter().map(Some).chain([None, None]));
        assert_eq!(counts.total(), 7);
        assert_eq!(counts.decided(), 3);
        for verdict in Verdict::ALL {
            assert_eq!(counts.get(Some(verdict)), 1);
        }
        assert_eq!(counts.get(None), 2);
    }
}
