//! The history in Markdown, for the summary page of a pipeline.

use std::fmt::Write as _;

use crate::series::{History, Series};
use crate::words;
use tck_report::clean::{line, short};

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
        text.push_str("\n### Left out\n\n| Bundle | Why | What |\n|---|---|---|\n");
        for one in history.left_out.iter().take(ROWS) {
            let _ = writeln!(
                text,
                "| {} | {} | {} |",
                cell(&one.path),
                one.why.word(),
                cell(&one.text)
            );
        }
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
        text.push_str(
            "\n| State | Requirement | Since | What lies between | Seen | Evidence |\n|---|---|---|---|---|---|\n",
        );
    }
    for course in news.iter().take(ROWS) {
        let evidence: Vec<String> = words::evidence(course, series)
            .iter()
            .map(|run| cell(&run.path))
            .collect();
        let _ = writeln!(
            text,
            "| {} | **{}** | {} | {} | {} | {} |",
            course.state.word(),
            cell(&course.id),
            cell(&words::since(course, series)),
            cell(&words::between(course).unwrap_or_default()),
            cell(course.text.as_deref().unwrap_or_default()),
            evidence.join(", ")
        );
    }
    more(news.len(), text);
    text.push_str(
        "\n| Run | Began | Verdict | Decided | Changed since the run before | Bundle |\n|---:|---|---|---:|---|---|\n",
    );
    let left = series.runs.len().saturating_sub(ROWS);
    for run in &series.runs[left..] {
        let marks: Vec<String> = words::marks(run)
            .iter()
            .map(|mark| format!(" ({})", cell(mark)))
            .collect();
        let _ = writeln!(
            text,
            "| {} | {} | {}{} | {} | {} | {} |",
            run.number,
            words::begun(run),
            words::verdict(run.verdict),
            marks.concat(),
            run.decided,
            cell(&words::changes(&run.changes)),
            cell(&run.path)
        );
    }
    if left > 0 {
        let _ = writeln!(text, "\n… and {left} earlier runs");
    }
}

fn more(all: usize, text: &mut String) {
    if all > ROWS {
        let _ = writeln!(text, "\n… and {} more; the JSON has all", all - ROWS);
    }
}

/// One cell of a table, in which nothing is markup.
fn cell(text: &str) -> String {
    let text = short(&line(text), 600).into_owned();
    let mut safe = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '\\' | '`' | '*' | '_' | '[' | ']' | '|' | '#' | '!' | '~' | '@' => {
                safe.push('\\');
                safe.push(character);
            }
            _ => safe.push(character),
        }
    }
    safe
}
