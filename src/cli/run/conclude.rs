//! The end of a run: the bundle is written, and the verdict is said.

use super::Job;
use crate::cli::args;
use crate::cli::exit::Exit;
use crate::cli::problem::Problem;
use crate::cli::screen::Screen;
use crate::report::text;
use crate::result::RunResult;
use crate::run::{Bundle, End, Finished, sources, write_all};
use crate::verdict::Verdict;

impl Job {
    /// Writes the bundle and says the verdict.
    pub(super) fn conclude(self, bundle: &Bundle, finished: Finished, mut terminal: Screen) -> Result<Exit, Problem> {
        let Finished { end, result, recorder } = finished;
        let quoted = sources(&self.library.rules.catalogue, &self.library.rules.suites, &self.pack);
        let root = write_all(bundle, &result, &quoted, recorder.journal());
        let root = root.map_err(|error| Problem::Environment(error.to_string()))?;
        terminal.finish();
        let shown = bundle.folder().display().to_string();
        match self.output.format {
            args::Format::Json => {
                let text =
                    crate::report::json::to_string(&result).map_err(|error| Problem::Environment(error.to_string()))?;
                crate::cli::print(&text)?;
            }
            args::Format::Text => {
                let color = crate::cli::color();
                let mut page = String::new();
                for test in result
                    .tests
                    .iter()
                    .filter(|test| test.verdict.is_some_and(|verdict| verdict > Verdict::Pass))
                {
                    page.push_str(&text::test(test, &quoted, Some(recorder.journal()), color));
                    page.push('\n');
                }
                for monitor in result.monitors.iter().filter(|monitor| !monitor.findings.is_empty()) {
                    page.push_str(&text::monitor(monitor, color));
                    page.push('\n');
                }
                page.push_str(&text::summary(
                    &result,
                    text::Bundle {
                        report: Some(&format!("{shown}/report.html")),
                        root: Some(&root),
                    },
                    color,
                ));
                crate::cli::print(&page)?;
            }
        }
        match end {
            End::Completed => match result.tests.iter().find_map(|test| test.not_applicable.as_deref()) {
                Some(why) if result.verdict.is_none() => Err(Problem::NothingToDo(format!(
                    "no selected test applies to the device: {why}"
                ))),
                _ => Ok(Exit::of(result.verdict)),
            },
            End::Interrupted => Ok(Exit::of_partial(result.verdict, true)),
            End::NoDevice(why) | End::Lost(why) | End::Flooded(why) => Ok(broken_off(&why, &shown, &result)),
            End::Broken(error) => Ok(broken_off(&error.to_string(), &shown, &result)),
        }
    }
}

/// Says why a run broke off. A failure that was found before stands on its evidence.
fn broken_off(why: &str, report: &str, result: &RunResult) -> Exit {
    let problem = Problem::Environment(format!("{why}; the partial report is in {report}"));
    eprintln!("{}", problem.render(console::colors_enabled_stderr()));
    Exit::of_partial(result.verdict, false)
}
