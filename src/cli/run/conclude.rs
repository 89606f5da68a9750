//! The end of a run: the bundle is written, and the verdict is said.

use super::Job;
use crate::cli::args;
use crate::cli::events::Followed;
use crate::cli::exit::Exit;
use crate::cli::problem::Problem;

use tck_base::diagnostic::Diagnostic;
use tck_base::verdict::Verdict;
use tck_engine::Recorder;
use tck_report::known::measure;
use tck_report::sources::Sources;
use tck_report::text::Color;
use tck_report::{overview, text};
use tck_result::RunResult;
use tck_run::{Bundle, End, Finished, sources, write_all};

impl Job {
    /// Writes the bundle and says the verdict.
    pub(super) fn conclude(self, bundle: &Bundle, finished: Finished, mut terminal: Followed) -> Result<Exit, Problem> {
        let Finished {
            end,
            mut result,
            recorder,
        } = finished;
        let mut unwritten = None;
        match bundle.pack_journal() {
            Ok(packed) => packed.clone_into(&mut result.journal),
            Err(error) => unwritten = Some(error.to_string()),
        }
        let quoted = sources(&self.library.rules.catalogue, &self.library.rules.suites, &self.pack);
        let root = write_all(
            bundle,
            &result,
            &quoted,
            recorder.journal(),
            self.output.inconclusive.into(),
        );
        let root = match root {
            Ok(root) => Some(root),
            Err(error) => {
                unwritten = Some(error.to_string());
                None
            }
        };
        terminal.screen.finish();
        let shown = bundle.folder().display().to_string();
        crate::cli::pipeline::tell(&result, &quoted, &shown);
        match self.output.format {
            _ if self.output.speaks_events() => {}
            args::Format::Json => {
                let text =
                    tck_report::json::to_string(&result).map_err(|error| Problem::Environment(error.to_string()))?;
                crate::cli::print(&text)?;
            }
            args::Format::Text => {
                let color = crate::cli::color();
                let mut page = self.details(&result, &quoted, &recorder, color);
                if let Some(count) = self.output.slowest {
                    page.push_str(&overview::slowest(&result, count, color));
                    page.push('\n');
                }
                let report = format!("{shown}/report.html");
                let shown_bundle = overview::Bundle {
                    report: root.as_ref().map(|_| report.as_str()),
                    root: root.as_deref(),
                };
                page.push_str(&overview::overview(
                    &result,
                    &quoted,
                    Some(recorder.journal()),
                    shown_bundle,
                    color,
                ));
                crate::cli::print(&page)?;
            }
        }
        if self.output.open && root.is_some() {
            crate::cli::browser::open(&bundle.folder().join("report.html"));
        }
        let outcome = match unwritten {
            None => self.outcome(end, &result, &shown),
            // What was found is not lost with the paper it should stand on.
            Some(why) => {
                let problem = Problem::Environment(format!("{why}; the journal is in {shown}, and `report` reads it"));
                eprintln!("{}", problem.render(console::colors_enabled_stderr()));
                Ok(Exit::of_partial(result.verdict, matches!(end, End::Interrupted)))
            }
        };
        let exit = outcome.as_ref().map_or_else(Problem::exit, |exit| *exit);
        terminal.ended(&result, root.as_deref(), exit.code());
        outcome
    }

    /// What the end of a run means for whoever started it.
    fn outcome(&self, end: End, result: &RunResult, shown: &str) -> Result<Exit, Problem> {
        match end {
            End::Completed => match result.tests.iter().find_map(|test| test.not_applicable.as_deref()) {
                Some(why) if result.verdict.is_none() => Err(Problem::NothingToDo(format!(
                    "no selected test applies to the device: {why}"
                ))),
                _ => self.exit(result),
            },
            End::Interrupted => Ok(Exit::of_partial(result.verdict, true)),
            End::Stranger(why) => Err(Diagnostic::whole("another-device", why)
                .hint("set manufacturer, serial-number, protocol-version or topic-template in the section [device] of the profile")
                .into()),
            End::NoDevice(why) | End::Lost(why) | End::Flooded(why) => Ok(broken_off(&why, shown, result)),
            End::Broken(error) => Ok(broken_off(&error.to_string(), shown, result)),
        }
    }
}

impl Job {
    /// What tests and monitors found, in full. Undecided tests are many, and have few causes: the overview groups them.
    fn details(&self, result: &RunResult, quoted: &Sources, recorder: &Recorder, color: Color) -> String {
        let mut page = String::new();
        if self.output.quiet {
            return page;
        }
        let shown = |verdict: Verdict| match (self.output.failures, self.output.verbose) {
            (true, _) => verdict >= Verdict::Error,
            (_, 0) => verdict > Verdict::Pass && verdict != Verdict::Inconclusive,
            _ => verdict > Verdict::Pass,
        };
        for test in result.tests.iter().filter(|test| test.verdict.is_some_and(shown)) {
            page.push_str(&text::test(test, quoted, Some(recorder.journal()), color));
            page.push('\n');
        }
        for monitor in result.monitors.iter().filter(|monitor| !monitor.findings.is_empty()) {
            page.push_str(&text::monitor(monitor, color));
            page.push('\n');
        }
        page
    }
}

impl Job {
    /// The exit of a run that came to its end. Failures that the profile lists as known do not count; the verdict stays.
    fn exit(&self, result: &RunResult) -> Result<Exit, Problem> {
        let known = &self.effective.profile.known;
        if known.is_empty() || self.certifies {
            return Ok(Exit::of(result.verdict));
        }
        let measured = measure(result, known);
        match self.output.format {
            args::Format::Text if !self.output.speaks_events() => crate::cli::print(&format!("\n{}", measured.text()))?,
            _ => {
                eprint!("{}", measured.text());
                Exit::Conforms
            }
        };
        Ok(match result.verdict {
            Some(Verdict::Fail) => Exit::of(measured.rest),
            verdict => Exit::of(verdict),
        })
    }
}

/// Says why a run broke off. A failure that was found before stands on its evidence.
fn broken_off(why: &str, report: &str, result: &RunResult) -> Exit {
    let problem = Problem::Environment(format!("{why}; the partial report is in {report}"));
    eprintln!("{}", problem.render(console::colors_enabled_stderr()));
    Exit::of_partial(result.verdict, false)
}
