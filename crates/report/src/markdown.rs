//! A run in Markdown, for the summary page of a pipeline, and its annotations.

use std::fmt::Write as _;

use super::clean::{line, short};
use super::findings::{Finding, findings};
use super::markdown_table::{Column, cell as escaped, table};
use super::sources::{HowDecided, Sources};
use super::statement;
use super::undecided;
use tck_base::verdict::Verdict;
use tck_result::RunResult;

/// How many rows a table has at most: a summary page is bounded, and the report has everything.
const ROWS: usize = 50;
/// How many annotations are made: GitHub shows ten of a kind for a step.
pub(super) const ANNOTATIONS: usize = 10;

/// The run on one page of Markdown. `report` says where the whole report is.
#[must_use]
pub fn summary(result: &RunResult, sources: &Sources, report: Option<&str>) -> String {
    let word = result
        .verdict
        .map_or("NOTHING DECIDED".to_owned(), |verdict| verdict.word().to_uppercase());
    let mut text = format!("## {word}\n\n{}\n", escaped(&statement::statement(result)));
    let found = findings(result, sources);
    if !found.is_empty() {
        let columns = [
            Column::Text("Requirement"),
            Column::Text("Asked"),
            Column::Text("Seen"),
            Column::Number("Times"),
            Column::Text("By"),
        ];
        text.push('\n');
        text += &table(columns, found.iter().take(ROWS).map(row));
        more(found.len(), &mut text);
    }
    let groups = undecided::groups(result);
    if !groups.is_empty() {
        text += "\n### To decide more\n\n";
        let rows = groups.iter().take(ROWS);
        let rows = rows.map(|group| [escaped(&group.count()), escaped(&group.advice())]);
        text += &table([Column::Number("Tests"), Column::Text("What to do")], rows);
        more(groups.len(), &mut text);
    }
    text.push('\n');
    text += &counted(result);
    let limits = statement::limits(result);
    if !limits.is_empty() {
        text += "\n<details><summary>Limits of this statement</summary>\n\n";
        for limit in limits.iter().take(ROWS) {
            let _ = writeln!(text, "- {}", escaped(limit));
        }
        text += "\n</details>\n";
    }
    if let Some(report) = report {
        let _ = writeln!(text, "\nReport: {}", escaped(report));
    }
    text
}

/// The requirements of a version as a page: what each asks, how it is decided and by what, and how the catalogue reads it
/// where the standard is silent or contradicts itself. `meant` picks by whom a requirement binds.
#[must_use]
pub fn requirements(sources: &Sources, version: &str, meant: impl Fn(&str) -> bool) -> String {
    let mut text = format!("# Requirements of VDA 5050 {}\n", escaped(version));
    let mut chapter = "";
    for requirement in sources.requirements.iter().filter(|one| meant(&one.role)) {
        if requirement.chapter != chapter {
            chapter = &requirement.chapter;
            let _ = write!(text, "\n## {}\n", escaped(chapter));
        }
        let _ = write!(
            text,
            "\n### {}\n\n{}\n\n*{}*, section {}, binds: {}; {}.",
            escaped(&requirement.id),
            escaped(&requirement.text),
            escaped(&requirement.mood),
            escaped(&requirement.section),
            escaped(&requirement.role),
            match &requirement.decided {
                HowDecided::Active => "decided by stimulus".to_owned(),
                HowDecided::Passive => "decided by observation".to_owned(),
                HowDecided::Operator => "decided with an operator".to_owned(),
                HowDecided::NotTestable(why) => format!("not testable: {}", escaped(why)),
            }
        );
        let tests = sources.tests.iter().filter(|test| {
            let mut clauses = test.clauses.iter();
            clauses.any(|clause| clause.requirement == requirement.id)
        });
        // The cases of a table are one test.
        let mut by: Vec<&str> = tests
            .map(|test| test.id.split('[').next().unwrap_or(&test.id))
            .collect();
        by.dedup();
        let monitors = sources
            .monitors
            .iter()
            .filter(|monitor| monitor.requirements.contains(&requirement.id));
        by.extend(monitors.map(|monitor| monitor.id.as_str()));
        if !by.is_empty() {
            let _ = write!(text, " Decided by `{}`.", by.join("`, `"));
        }
        text.push('\n');
        if let Some(ruling) = &requirement.interpretation {
            let _ = write!(text, "\n> **Interpretation.** {}\n", escaped(ruling));
        }
    }
    text
}

/// How often each verdict came out.
fn counted(result: &RunResult) -> String {
    let columns = [
        Column::Text("What"),
        Column::Number("Pass"),
        Column::Number("Warning"),
        Column::Number("Inconclusive"),
        Column::Number("Error"),
        Column::Number("Fail"),
    ];
    let rows = [
        ("Tests", statement::tests(result)),
        ("Monitors", statement::monitors(result)),
        ("Requirements", statement::requirements(result)),
    ];
    let rows = rows.map(|(name, counts)| {
        let [pass, warning, inconclusive, error, fail] =
            Verdict::ALL.map(|verdict| counts.get(Some(verdict)).to_string());
        [name.to_owned(), pass, warning, inconclusive, error, fail]
    });
    table(columns, rows)
}

fn row(finding: &Finding<'_>) -> [String; 5] {
    let by: Vec<&str> = finding.tests.iter().chain(&finding.monitors).copied().take(3).collect();
    [
        format!("**{}** {}", escaped(finding.requirement), finding.verdict.word()),
        escaped(finding.asks.unwrap_or_default()),
        escaped(&finding.seen),
        finding.count.to_string(),
        escaped(&by.join(", ")),
    ]
}

fn more(all: usize, text: &mut String) {
    if all > ROWS {
        let _ = writeln!(text, "\n… and {} more in the report", all - ROWS);
    }
}

/// Workflow commands of GitHub: an annotation for what is wrong with the run itself, and for each of the first ten findings.
#[must_use]
pub fn annotations(result: &RunResult, sources: &Sources) -> String {
    let mut text = String::new();
    if let Some(trouble) = statement::trouble(result) {
        let _ = writeln!(text, "::error title=vda5050-tck::{}", command(&trouble));
    }
    let found = findings(result, sources);
    let causes = found.iter().filter(|finding| finding.follows.is_none());
    for finding in causes.take(ANNOTATIONS) {
        let kind = if finding.verdict == Verdict::Fail {
            "error"
        } else {
            "warning"
        };
        let title = property(finding.requirement);
        let asks = finding.asks.unwrap_or_default();
        let _ = writeln!(
            text,
            "::{kind} title={title}::{}",
            command(&format!("{} (asked: {asks})", finding.seen))
        );
    }
    text
}

/// A property of a workflow command.
pub(super) fn property(text: &str) -> String {
    command(text).replace(':', "%3A").replace(',', "%2C")
}

/// The value of a workflow command: one line, and no end of it.
pub(super) fn command(text: &str) -> String {
    short(&line(text), 500)
        .replace('%', "%25")
        .replace('\r', "%0D")
        .replace('\n', "%0A")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_device_wrote_is_no_markup_and_no_command() {
        let hostile = "a|b <img> [x](y) `z` **bold** @team\n::error::no";
        let safe = escaped(hostile);
        assert!(!safe.contains('\n') && !safe.contains('<'));
        for (at, _) in safe.match_indices(['|', '`', '*', '[', '@']) {
            assert_eq!(&safe[at - 1..at], "\\", "{safe}");
        }
        assert!(!command("50 %\nnext").contains('\n'));
        assert!(command("50 %").contains("%25"));
    }

    #[test]
    fn the_page_of_requirements_has_every_chapter_once_and_says_how_the_catalogue_reads() {
        let library = crate::sources::RequirementText {
            id: "A-1".to_owned(),
            chapter: "First".to_owned(),
            text: "Do this.".to_owned(),
            role: "agv".to_owned(),
            mood: "shall".to_owned(),
            section: "6.1".to_owned(),
            link: None,
            interpretation: Some("Read as that.".to_owned()),
            decided: HowDecided::Passive,
            action: None,
            rests_on: Vec::new(),
        };
        let mut other = library.clone();
        "A-2".clone_into(&mut other.id);
        let mut foreign = library.clone();
        "master-control".clone_into(&mut foreign.role);
        let sources = Sources {
            requirements: vec![library, other, foreign],
            ..Sources::default()
        };
        let page = requirements(&sources, "1.0", |role| role == "agv");
        assert_eq!(page.matches("## First").count(), 1);
        assert_eq!(page.matches("### A-").count(), 2);
        assert!(page.contains("> **Interpretation.** Read as that."));
        assert!(page.contains("*shall*, section 6.1"));
    }
}
