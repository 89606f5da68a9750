//! Progress for people: a line per test, and below it what is awaited.

use std::io::{self, Write};
use std::time::Duration;

use console::Style;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::output::{Output, escaped};
use super::progress::{Progress, RunTitle, TestLine};
use tck_base::verdict::{Outcome, Verdict};

/// What a terminal can do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TerminalOptions {
    /// Whether results are coloured.
    pub color: bool,
    /// Whether there is a bar.
    pub bar: bool,
    /// Whether results are written; without, only notes and the bar are.
    pub results: bool,
}

impl TerminalOptions {
    /// Those of this process: no bar when standard error is no terminal, no colour when standard output is
    /// none or `NO_COLOR` is set.
    #[must_use]
    pub fn of_process() -> Self {
        let no_color = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
        Self {
            color: !no_color && console::colors_enabled(),
            bar: console::Term::stderr().is_term(),
            results: true,
        }
    }
}

/// Progress on a terminal: results to `W`, everything else to `E`.
#[derive(Debug)]
pub struct Terminal<W, E> {
    results: Output<W>,
    notes: Output<E>,
    options: TerminalOptions,
    bar: ProgressBar,
    /// How much of the run is left, in words.
    left: Option<String>,
}

impl Terminal<io::Stdout, io::Stderr> {
    /// Results to standard output, notes to standard error.
    #[must_use]
    pub fn stdout(options: TerminalOptions) -> Self {
        Self::new(io::stdout(), io::stderr(), options)
    }
}

impl<W: Write, E: Write> Terminal<W, E> {
    /// Results to `results`, notes to `notes`. The bar, if there is one, always goes to standard error.
    pub fn new(results: W, notes: E, options: TerminalOptions) -> Self {
        Self {
            results: Output::to(results),
            notes: Output::to(notes),
            options,
            bar: ProgressBar::hidden(),
            left: None,
        }
    }

    /// How much of the run is left; shown with the next test.
    pub fn left(&mut self, left: &str) {
        self.left = Some(left.to_owned());
    }

    /// Whether nobody reads the results any more.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.results.is_closed()
    }

    /// Draws no bar from now on, since something else writes to standard error.
    pub fn without_bar(&mut self) {
        self.options.bar = false;
        self.clear();
    }

    /// The bar, which may be hidden.
    #[must_use]
    pub fn bar(&self) -> &ProgressBar {
        &self.bar
    }

    /// Takes the bar away.
    pub fn clear(&mut self) {
        self.bar.finish_and_clear();
        self.bar = ProgressBar::hidden();
    }

    fn result(&mut self, text: &str) {
        if self.options.results {
            // A full disk behind the pipe loses the line, not the run: the report has it as well.
            let _ = self.bar.suspend(|| self.results.line(text));
        }
    }

    fn style(&self, verdict: Verdict) -> Style {
        let style = match verdict {
            Verdict::Pass => Style::new().green(),
            Verdict::Warning => Style::new().yellow(),
            Verdict::Inconclusive => Style::new().cyan(),
            Verdict::Error => Style::new().magenta(),
            Verdict::Fail => Style::new().red().bold(),
        };
        style.force_styling(self.options.color)
    }
}

/// Width of the longest verdict.
const WORD: usize = 12;

fn seconds(elapsed: Duration) -> String {
    format!("{:.1} s", elapsed.as_secs_f64())
}

fn count(number: usize, what: &str) -> String {
    format!("{number} {what}{}", if number == 1 { "" } else { "s" })
}

impl<W: Write, E: Write> Progress for Terminal<W, E> {
    fn run_begun(&mut self, title: &RunTitle) {
        self.note(&format!(
            "{}, VDA 5050 {}: {}{}",
            title.device,
            title.protocol,
            count(title.tests, "test"),
            match title.not_applicable {
                0 => String::new(),
                others => format!(", {others} not applicable"),
            }
        ));
        if self.options.bar {
            let length = u64::try_from(title.tests).unwrap_or(u64::MAX);
            self.bar = ProgressBar::with_draw_target(Some(length), ProgressDrawTarget::stderr());
            if let Ok(style) = ProgressStyle::with_template("{spinner} [{pos}/{len}] {prefix}  {wide_msg}") {
                self.bar.set_style(style);
            }
            self.bar.enable_steady_tick(Duration::from_millis(120));
        }
    }

    fn test_begun(&mut self, id: &str, title: &str) {
        let left = self
            .left
            .as_ref()
            .map_or_else(String::new, |left| format!("{left} left  "));
        self.bar.set_prefix(format!("{left}{}", escaped(id)));
        self.bar.set_message(escaped(title));
    }

    fn waiting(&mut self, what: &str, since: Duration) {
        let message = match since.as_secs() {
            0 => format!("waiting for {}", escaped(what)),
            waited => format!("waiting for {}, {waited} s", escaped(what)),
        };
        self.bar.set_message(message);
    }

    fn test_ended(&mut self, line: &TestLine) {
        match &line.outcome {
            Outcome::Judged(verdict) => {
                let word = self.style(*verdict).apply_to(format!("{verdict:<WORD$}"));
                let mut text = format!("{word} {}  {}", escaped(&line.id), seconds(line.elapsed));
                if let Some(reason) = &line.reason {
                    text.push_str("  ");
                    text.push_str(&escaped(reason));
                }
                self.result(&text);
                self.bar.inc(1);
            }
            Outcome::NotApplicable(reason) => {
                let dim = Style::new().dim().force_styling(self.options.color);
                let text = format!("{:<WORD$} {}  {}", "n/a", escaped(&line.id), escaped(reason));
                self.result(&dim.apply_to(text).to_string());
            }
        }
    }

    fn note(&mut self, text: &str) {
        let text = escaped(text);
        let _ = self.bar.suspend(|| self.notes.line(&text));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAIN: TerminalOptions = TerminalOptions {
        color: false,
        bar: false,
        results: true,
    };

    fn told(
        options: TerminalOptions,
        tell: impl FnOnce(&mut Terminal<&mut Vec<u8>, &mut Vec<u8>>),
    ) -> (String, String) {
        let (mut results, mut notes) = (Vec::new(), Vec::new());
        tell(&mut Terminal::new(&mut results, &mut notes, options));
        let text = |bytes| String::from_utf8(bytes).expect("text");
        (text(results), text(notes))
    }

    fn line(id: &str, outcome: Outcome, reason: Option<&str>) -> TestLine {
        TestLine {
            id: id.to_owned(),
            outcome,
            elapsed: Duration::from_millis(3240),
            reason: reason.map(str::to_owned),
        }
    }

    fn whole_run(progress: &mut impl Progress) {
        progress.run_begun(&RunTitle {
            device: "ACME 0001".to_owned(),
            protocol: "1.2.3".to_owned(),
            tests: 2,
            not_applicable: 1,
        });
        progress.test_begun("order/one", "An order");
        progress.waiting("state", Duration::from_secs(4));
        progress.test_ended(&line("order/one", Outcome::Judged(Verdict::Pass), None));
        let reason = Some("ORD-REJ-12: no error\u{1b}[31m appeared");
        progress.test_ended(&line("order/two", Outcome::Judged(Verdict::Fail), reason));
        let absent = Outcome::NotApplicable("the factsheet has no action pick".to_owned());
        progress.test_ended(&line("load/pick", absent, None));
        progress.note("the device reconnected");
    }

    #[test]
    fn results_are_one_line_per_test_and_progress_is_apart_from_them() {
        let (results, notes) = told(PLAIN, |terminal| whole_run(terminal));
        insta::assert_snapshot!(results, @r"
        pass         order/one  3.2 s
        fail         order/two  3.2 s  ORD-REJ-12: no error\u{1b}[31m appeared
        n/a          load/pick  the factsheet has no action pick
        ");
        insta::assert_snapshot!(notes, @r"
        ACME 0001, VDA 5050 1.2.3: 2 tests, 1 not applicable
        the device reconnected
        ");
    }

    #[test]
    fn without_colour_there_is_no_escape_and_with_colour_only_ours() {
        let escapes = |color: bool| {
            let (results, _) = told(TerminalOptions { color, ..PLAIN }, |terminal| whole_run(terminal));
            results.matches('\u{1b}').count()
        };
        assert_eq!(escapes(false), 0);
        let ours = escapes(true);
        assert!(ours > 0);
        let (colored, _) = told(TerminalOptions { color: true, ..PLAIN }, |terminal| whole_run(terminal));
        let (plain, _) = told(PLAIN, |terminal| whole_run(terminal));
        assert_eq!(console::strip_ansi_codes(&colored), plain);
    }

    #[test]
    fn without_results_only_notes_are_written() {
        let (results, notes) = told(
            TerminalOptions {
                results: false,
                ..PLAIN
            },
            |terminal| whole_run(terminal),
        );
        assert_eq!(results, "");
        assert!(!notes.is_empty());
    }
}
