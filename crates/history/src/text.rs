//! The history for the terminal.

use std::fmt::Write as _;

use crate::course::Course;
use crate::series::{History, Run, Series};
use crate::words;
use tck_base::verdict::Verdict;
use tck_report::clean::line;

/// How many runs of a series are listed; the last ones.
const RUNS: usize = 20;

/// The history for people: in each series first what happened, then its runs.
#[must_use]
pub fn text(history: &History) -> String {
    let mut text = format!("{}: {}\n", line(&history.folder), words::summary(history));
    for series in &history.series {
        of_series(series, &mut text);
    }
    if !history.left_out.is_empty() {
        text.push_str("\nleft out, and no part of the above\n");
        for one in &history.left_out {
            let _ = writeln!(text, "  {:<14} {}: {}", one.why.word(), line(&one.path), one.text);
        }
    }
    text
}

fn of_series(series: &Series, text: &mut String) {
    let _ = writeln!(text, "\n{} · {}", words::title(series), words::extent(series));
    let _ = writeln!(text, "  requirements: {}", words::counts(series));
    for course in series.news() {
        of_course(course, series, text);
    }
    text.push_str("  runs\n");
    let left = series.runs.len().saturating_sub(RUNS);
    if left > 0 {
        let _ = writeln!(text, "    … and {left} earlier");
    }
    for run in &series.runs[left..] {
        of_run(run, text);
    }
}

fn of_course(course: &Course, series: &Series, text: &mut String) {
    let word = course.state.word().to_uppercase();
    let _ = writeln!(
        text,
        "  {word:<6} {}  {}",
        line(&course.id),
        words::since(course, series)
    );
    if let Some(between) = words::between(course) {
        let _ = writeln!(text, "         {between}");
    }
    if let Some(seen) = &course.text {
        let _ = writeln!(text, "         {seen}");
    }
    let evidence = words::evidence(course, series);
    if !evidence.is_empty() {
        let paths: Vec<String> = evidence.iter().map(|run| line(&run.path).into_owned()).collect();
        let _ = writeln!(text, "         see {}", paths.join(", "));
    }
}

fn of_run(run: &Run, text: &mut String) {
    let verdict = run.verdict.map_or("none", Verdict::word).to_uppercase();
    let decided = format!("{} decided", run.decided);
    let number = format!("#{}", run.number);
    let path = line(&run.path);
    let _ = write!(
        text,
        "    {number:>4}  {}  {verdict:<12} {decided:>11}  {path}",
        words::begun(run)
    );
    for mark in words::marks(run) {
        let _ = write!(text, "  [{mark}]");
    }
    text.push('\n');
    if !run.changes.is_empty() {
        let _ = writeln!(text, "          {}", words::changes(&run.changes));
    }
}
