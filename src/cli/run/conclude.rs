//! The end of a run: the bundle is written, and the verdict is said.

use super::Job;
use crate::cli::args;
use crate::cli::events::Followed;
use crate::cli::exit::Exit;
use crate::cli::gate::Gate;
use crate::cli::outputs::{Outputs, Shown};
use crate::cli::problem::Problem;

use tck_base::diagnostic::Diagnostic;
use tck_base::verdict::Verdict;
use tck_engine::Recorder;
use tck_report::keys::Keys;
use tck_report::sources::Sources;
use tck_report::text::Color;
use tck_report::{overview, text};
use tck_result::RunResult;
use tck_run::{Bundle, End, Finished, sources, write_all};

impl Job {
    /// Writes the bundle and says the verdict.
    pub(super) fn conclude(
        self,
        bundle: &Bundle,
        finished: Finished,
        mut terminal: Followed,
        outputs: &Outputs<'_>,
    ) -> Result<Exit, Problem> {
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
        let quoted = sources(&self.library, &self.pack);
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
        let asked = outputs.write(&Shown {
            result: &result,
            sources: &quoted,
            inconclusive: self.output.inconclusive,
            root: root.as_deref(),
            folder: bundle.folder(),
            keys: Keys::default(),
        });
        if let Err(why) = asked {
            unwritten = Some(why);
        }
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
        let gate = Gate {
            end: &end,
            result: &result,
            known: if self.certifies {
                &[]
            } else {
                &self.effective.profile.known
            },
            written: unwritten.is_none(),
        };
        self.tell_known(&gate)?;
        let exit = gate.exit();
        // What was found is not lost with the paper it should stand on.
        let problem = match unwritten {
            Some(why) => Some(Problem::Environment(format!(
                "{why}; the journal is in {shown}, and `report` reads it"
            ))),
            None => why_not(&end, &result, exit, &shown),
        };
        terminal.ended(&result, root.as_deref(), exit.code());
        if let Some(problem) = problem {
            match self.output.format {
                args::Format::Json => eprintln!("{}", problem.to_json()),
                args::Format::Text => eprintln!("{}", problem.render(console::colors_enabled_stderr())),
            }
        }
        Ok(exit)
    }

    /// Says which failures the profile bears, where a run came to its end.
    fn tell_known(&self, gate: &Gate<'_>) -> Result<(), Problem> {
        let Some(measured) = gate
            .measured()
            .filter(|_| matches!(gate.end, End::Completed) && gate.written)
        else {
            return Ok(());
        };
        match self.output.format {
            args::Format::Text if !self.output.speaks_events() => {
                crate::cli::print(&format!("\n{}", measured.text()))?;
            }
            _ => eprint!("{}", measured.text()),
        }
        Ok(())
    }
}

/// Why a run says nothing, or less than it should.
fn why_not(end: &End, result: &RunResult, exit: Exit, shown: &str) -> Option<Problem> {
    let broken_off = |why: &str| Problem::Environment(format!("{why}; the partial report is in {shown}"));
    match end {
        End::Completed if exit == Exit::NothingToDo => {
            let why = result.tests.iter().find_map(|test| test.not_applicable.as_deref())?;
            Some(Problem::NothingToDo(format!(
                "no selected test applies to the device: {why}"
            )))
        }
        End::Completed | End::Interrupted => None,
        End::Stranger(why) => {
            let hint = "set manufacturer, serial-number, protocol or topic-template in the section [device] of the \
                        profile";
            Some(Diagnostic::whole("another-device", why.as_str()).hint(hint).into())
        }
        End::Changed(why) => Some(
            Diagnostic::whole("resume", why.as_str())
                .hint(super::resume::ONE_THING)
                .into(),
        ),
        End::NoDevice(why) | End::Lost(why) | End::Flooded(why) => Some(broken_off(why)),
        End::Broken(error) => Some(broken_off(&error.to_string())),
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
