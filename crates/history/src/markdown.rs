//! The history in Markdown, for the summary page of a pipeline.

use std::fmt::Write as _;

use crate::course::Course;
use crate::series::{History, Run, Series};
use crate::words;
use tck_report::markdown_table::{Column, cell, table};

/// How many rows a table has at most: a summary page is bounded.
const ROWS: usize = 100;

/// The history as a page: what happened in each series, then its runs.
#[must_use]
pub fn markdown(history: &History) -> String {
    let mut text = format!(
        "## History of {}\n\n{}.\n",
        cell(&history.folder),
        cell(&words::summary(history))
    );
    for series in &history.series {
        of_series(series, &mut text);
    }
    if !history.left_out.is_empty() {
        text.push_str("\n### Left out\n\n");
        let rows = history.left_out.iter().take(ROWS);
        let rows = rows.map(|one| [cell(&one.path), one.why.word().to_owned(), cell(&one.text)]);
        text.push_str(&table(["Bundle", "Why", "What"].map(Column::Text), rows));
        more(history.left_out.len(), &mut text);
    }
    text
}

fn of_series(series: &Series, text: &mut String) {
    let _ = write!(
        text,
        "\n### {}\n\n{}. ",
        cell(&words::title(series)),
        cell(&words::extent(series))
    );
    let _ = writeln!(text, "Requirements: {}.", words::counts(series));
    let news = series.news();
    if !news.is_empty() {
        let columns = ["State", "Requirement", "Since", "What lies between", "Seen", "Evidence"];
        let rows = news.iter().take(ROWS).map(|course| of_course(course, series));
        text.push('\n');
        text.push_str(&table(columns.map(Column::Text), rows));
    }
    more(news.len(), text);
    let columns = [
        Column::Number("Run"),
        Column::Text("Began"),
        Column::Text("Verdict"),
        Column::Number("Decided"),
        Column::Text("Changed since the run before"),
        Column::Text("Bundle"),
    ];
    let left = series.runs.len().saturating_sub(ROWS);
    text.push('\n');
    text.push_str(&table(columns, series.runs[left..].iter().map(of_run)));
    if left > 0 {
        let _ = writeln!(text, "\n… and {left} earlier runs");
    }
}

fn of_course(course: &Course, series: &Series) -> [String; 6] {
    let evidence: Vec<String> = words::evidence(course, series)
        .iter()
        .map(|run| cell(&run.path))
        .collect();
    [
        course.state.word().to_owned(),
        format!("**{}**", cell(&course.id)),
        cell(&words::since(course, series)),
        cell(&words::between(course).unwrap_or_default()),
        cell(course.text.as_deref().unwrap_or_default()),
        evidence.join(", "),
    ]
}

fn of_run(run: &Run) -> [String; 6] {
    let marks: Vec<String> = words::marks(run)
        .iter()
        .map(|mark| format!(" ({})", cell(mark)))
        .collect();
    [
        run.number.to_string(),
        words::begun(run),
        format!("{}{}", words::verdict(run.verdict), marks.concat()),
        run.decided.to_string(),
        cell(&words::changes(&run.changes)),
        cell(&run.path),
    ]
}

fn more(all: usize, text: &mut String) {
    if all > ROWS {
        let _ = writeln!(text, "\n… and {} more; the JSON has all", all - ROWS);
    }
}
