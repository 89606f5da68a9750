//! The sentences that all renderings share.

use crate::conditions::Change;
use crate::course::{Course, State};
use crate::series::{History, Run, Series};
use tck_base::verdict::Verdict;
use tck_report::clean::{line, short};
use tck_report::compare::Standing;
use tck_report::statement::many;

/// How many changes are told of at most; the JSON has all.
const CHANGES: usize = 6;
/// How long a value may be.
const VALUE: usize = 60;

/// How a series is called.
pub(crate) fn title(series: &Series) -> String {
    let role = match series.role.as_str() {
        "agv" => "AGV",
        "master-control" => "master control",
        other => other,
    };
    let name = format!("{} {}", series.manufacturer, series.serial_number);
    let protocol = line(&series.protocol);
    format!(
        "{}, {}, VDA 5050 {protocol}",
        short(&line(name.trim()), 2 * VALUE),
        line(role)
    )
}

/// How many runs of which time a series has.
pub(crate) fn extent(series: &Series) -> String {
    let count = many(series.runs.len(), series.kind.word());
    let days: Vec<&str> = series.runs.iter().filter_map(|run| run.started.get(..10)).collect();
    match (days.first(), days.last()) {
        (Some(first), Some(last)) if first != last => format!("{count}, {} to {}", line(first), line(last)),
        (Some(first), _) => format!("{count}, {}", line(first)),
        _ => count,
    }
}

/// When a run began, to the minute.
pub(crate) fn begun(run: &Run) -> String {
    match run.started.parse::<jiff::Timestamp>() {
        Ok(at) => at.strftime("%Y-%m-%d %H:%M").to_string(),
        Err(_) if run.started.is_empty() => "unknown".to_owned(),
        Err(_) => short(&line(&run.started), VALUE).into_owned(),
    }
}

/// What restricts what a run says, and so what it may be taken for.
pub(crate) fn marks(run: &Run) -> Vec<String> {
    let partial = run
        .partial
        .as_ref()
        .map(|why| format!("partial: {}", short(&line(why), 120)));
    let selection = run.selection.then(|| "some of the tests only".to_owned());
    partial.into_iter().chain(selection).collect()
}

/// The word of a verdict, or that there is none.
pub(crate) fn verdict(verdict: Option<Verdict>) -> &'static str {
    verdict.map_or("nothing decided", Verdict::word)
}

/// One word and one sign for how a requirement stands in a run.
pub(crate) fn standing(standing: Standing) -> (&'static str, &'static str) {
    match standing {
        Standing::Decided(Verdict::Pass) => ("pass", "✓"),
        Standing::Decided(Verdict::Warning) => ("warning", "!"),
        Standing::Decided(Verdict::Inconclusive) => ("inconclusive", "?"),
        Standing::Decided(Verdict::Error) => ("error", "‼"),
        Standing::Decided(Verdict::Fail) => ("fail", "✕"),
        Standing::Undecided => ("not decided", "·"),
        Standing::NotApplicable => ("not applicable", "–"),
        Standing::Absent => ("not part of the run", " "),
    }
}

/// One change.
pub(crate) fn change(change: &Change) -> String {
    let value = |value: &Option<String>| {
        let value = value.as_ref().map(|value| short(&line(value), VALUE).into_owned());
        value.unwrap_or_else(|| "nothing".to_owned())
    };
    let name = match change.name.as_str() {
        "" => String::new(),
        name => format!(" {}", short(&line(name), VALUE)),
    };
    format!(
        "{}{name}: {} -> {}",
        change.what.word(),
        value(&change.before),
        value(&change.after)
    )
}

/// Several changes in one line.
pub(crate) fn changes(all: &[Change]) -> String {
    let mut told: Vec<String> = all.iter().take(CHANGES).map(change).collect();
    if all.len() > CHANGES {
        told.push(format!("and {} more", all.len() - CHANGES));
    }
    told.join("; ")
}

/// Since when a requirement stands so, in one sentence without its end.
pub(crate) fn since(course: &Course, series: &Series) -> String {
    let run = |number: usize| {
        let day = series.runs.get(number.wrapping_sub(1)).map(begun);
        format!("#{number} ({})", day.unwrap_or_default())
    };
    let named = |number: Option<usize>| number.map_or_else(|| "no run".to_owned(), run);
    let kept = match course.kept_in {
        Some(kept) => format!("kept in {}", run(kept)),
        None => "nothing that found it had decided it before".to_owned(),
    };
    match course.state {
        State::Fails => format!("since {}; {kept}", named(course.since)),
        State::Unseen => format!(
            "since {}; last found in {}, and what found it has not decided it since; {kept}",
            named(course.since),
            named(course.last)
        ),
        State::Flaky => match &course.flaky {
            Some(flaky) if flaky.runs.len() == 1 => {
                format!("repetitions of {} differ in {}", line(&flaky.by), run(flaky.runs[0]))
            }
            Some(flaky) => {
                let runs: Vec<String> = flaky.runs.iter().map(|number| format!("#{number}")).collect();
                format!(
                    "{} turns in {}, and nothing that the runs name has changed",
                    line(&flaky.by),
                    runs.join(", ")
                )
            }
            None => String::new(),
        },
        State::Lost => {
            let last = course
                .runs
                .iter()
                .rposition(|standing| matches!(standing, Standing::Decided(_)));
            format!(
                "last decided in {}, and not in the last run",
                named(last.map(|at| at + 1))
            )
        }
        State::Warns => format!("since {}", named(course.since)),
        State::Fixed => format!(
            "fixed in {}; broken from {} to {}",
            named(course.fixed_in),
            named(course.since),
            named(course.last)
        ),
        State::Keeps => "kept in all runs that decided it".to_owned(),
        State::Open => "decided by no run".to_owned(),
    }
}

/// What lies between, in one sentence without its end; nothing where there is no between.
pub(crate) fn between(course: &Course) -> Option<String> {
    let is_between = match course.state {
        State::Fixed => true,
        State::Fails | State::Unseen | State::Warns => course.kept_in.is_some(),
        _ => false,
    };
    is_between.then(|| match course.changes.as_slice() {
        [] => "nothing that the runs name has changed between".to_owned(),
        all => format!("between: {}", changes(all)),
    })
}

/// The runs that show it best: the first and the last in which it was found.
pub(crate) fn evidence<'s>(course: &Course, series: &'s Series) -> Vec<&'s Run> {
    let runs = match &course.flaky {
        Some(flaky) if course.state == State::Flaky => flaky.runs.iter().rev().take(2).rev().copied().collect(),
        _ => [course.since, course.last, course.fixed_in]
            .into_iter()
            .flatten()
            .collect::<Vec<usize>>(),
    };
    let mut shown: Vec<&Run> = Vec::new();
    for run in runs
        .into_iter()
        .filter_map(|number| series.runs.get(number.wrapping_sub(1)))
    {
        if !shown.iter().any(|known| known.number == run.number) {
            shown.push(run);
        }
    }
    shown
}

/// How many requirements stand how, in one line.
pub(crate) fn counts(series: &Series) -> String {
    let counted = State::ALL.map(|state| (series.count(state), state));
    let told = counted.iter().filter(|(count, _)| *count > 0);
    let told: Vec<String> = told.map(|(count, state)| format!("{count} {}", state.word())).collect();
    told.join(", ")
}

/// The whole history in one line.
pub(crate) fn summary(history: &History) -> String {
    let mut text = format!(
        "{} of {}",
        many(history.bundles, "bundle"),
        match history.series.len() {
            1 => "1 series".to_owned(),
            count => format!("{count} series"),
        }
    );
    if !history.left_out.is_empty() {
        text.push_str(&format!("; {} left out", history.left_out.len()));
    }
    text
}
