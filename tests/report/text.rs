//! What the terminal says, and the coverage table.

use vda5050_tck::journal::Journal;
use vda5050_tck::pack::Role;
use vda5050_tck::report::overview::{Bundle, overview, slowest};
use vda5050_tck::report::text::{self, Color};
use vda5050_tck::report::{coverage, sources::Sources};
use vda5050_tck::result::RunResult;

use crate::samples;

fn whole(result: &RunResult, sources: &Sources, journal: Option<&Journal>, color: Color) -> String {
    let tests = result
        .tests
        .iter()
        .map(|test| text::test(test, sources, journal, color));
    let monitors = result.monitors.iter().map(|monitor| text::monitor(monitor, color));
    let bundle = Bundle {
        report: Some("reports/Lindner-TX-0042/report.html"),
        root: Some("9f2c"),
    };
    let end = overview(result, sources, journal, bundle, color);
    tests.chain(monitors).chain(["\n".to_owned(), end]).collect()
}

#[test]
fn a_failing_run_on_the_terminal() {
    let (result, journal) = samples::fail();
    insta::assert_snapshot!(
        "text_fail",
        whole(&result, &samples::sources(), Some(&journal), Color::Never)
    );
}

#[test]
fn a_passing_run_on_the_terminal() {
    let (result, journal) = samples::pass();
    insta::assert_snapshot!(
        "text_pass",
        whole(&result, &samples::sources(), Some(&journal), Color::Never)
    );
}

#[test]
fn colour_changes_nothing_but_colour() {
    let (result, journal) = samples::fail();
    let sources = samples::sources();
    let colored = whole(&result, &sources, Some(&journal), Color::Always);
    let plain = whole(&result, &sources, Some(&journal), Color::Never);
    assert!(colored.contains('\u{1b}') && !plain.contains('\u{1b}'));
    assert_eq!(console::strip_ansi_codes(&colored), plain);
}

#[test]
fn a_device_cannot_write_control_characters_to_the_terminal() {
    let (result, journal, sources) = samples::hostile();
    let text = whole(&result, &sources, Some(&journal), Color::Never);
    assert!(
        !text.chars().any(|c| (c.is_control() && c != '\n') || c == '\u{202e}'),
        "{text}"
    );
    assert!(text.contains("PARTIAL"));
}

#[test]
fn without_journal_and_catalogue_the_block_still_says_what_is_known() {
    let (result, _) = samples::fail();
    let text = whole(&result, &Sources::default(), None, Color::Never);
    assert!(
        text.contains("closest  #")
            && text.contains("errors[0].errorType is \"orderError\", expected \"orderUpdateError\""),
        "{text}"
    );
}

#[test]
fn coverage_counts_what_decides_what_and_lists_what_nothing_decides() {
    let sources = samples::sources();
    let coverage = coverage::coverage(&sources, Role::Agv);
    insta::assert_snapshot!("coverage", coverage.text());
    assert_eq!(coverage.total().total(), sources.requirements.len());
    let other = coverage::coverage(&sources, Role::MasterControl);
    assert_eq!(
        other.total().total(),
        0,
        "requirements of the vehicle do not concern the other side"
    );
}

/// The sentence a customer reads first must never claim more than was decided.
#[test]
fn the_statement_says_what_was_shown_and_nothing_more() {
    use vda5050_tck::report::statement::statement;
    use vda5050_tck::verdict::Verdict;

    let with = |verdict: Option<Verdict>, found: &[Option<Verdict>], partial: bool| {
        let mut result = samples::pass().0;
        let mut one = result.requirements[0].clone();
        result.requirements.clear();
        for verdict in found {
            one.verdict = *verdict;
            result.requirements.push(one.clone());
        }
        result.verdict = verdict;
        result.partial = partial;
        statement(&result)
    };
    let (pass, warning, fail) = (Some(Verdict::Pass), Some(Verdict::Warning), Some(Verdict::Fail));
    let (open, error) = (Some(Verdict::Inconclusive), Some(Verdict::Error));
    let all = [
        with(pass, &[pass, pass], false),
        with(pass, &[pass, None], true),
        with(warning, &[pass, warning], false),
        with(open, &[pass, open, None], false),
        with(open, &[pass], false),
        with(error, &[pass, error], false),
        with(fail, &[fail], false),
        with(fail, &[fail, fail, pass, None, open], false),
        with(fail, &[pass], false),
        with(None, &[None], false),
    ];
    insta::assert_snapshot!("statements", all.join("\n"));
}

#[test]
fn the_slowest_tests_come_first_and_no_more_than_asked_for() {
    let (result, _) = samples::fail();
    let text = slowest(&result, 1, Color::Never);
    let lines: Vec<&str> = text.lines().collect();
    assert!(lines.len() == 2 && lines[1].contains("connection/last-will"), "{text}");
}
