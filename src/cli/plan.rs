//! `run --plan`, and what `validate` says about a good profile.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::json;

use super::args::Format;
use super::exit::Exit;
use super::problem::Problem;
use crate::ui::escaped;
use tck_base::diagnostic::Diagnostic;
use tck_judge::Library;
use tck_profile::{Effective, Surroundings};
use tck_report::advice::advice;
use tck_report::statement::many;
use tck_run::{Floor, How, LiveRun, ProfileContext, RunError, RunPlan, Waits};

/// How many tests of a reason are named.
const NAMED: usize = 3;

/// Prints a plan.
pub(super) fn show(plan: &RunPlan, format: Format) -> Result<Exit, Problem> {
    match format {
        Format::Text => super::print(&text(plan))?,
        Format::Json => super::print(&format!("{:#}\n", json!(plan)))?,
    };
    let runs = plan
        .of_kind(Waits::Runs)
        .chain(plan.of_kind(Waits::DependsOnDevice))
        .count();
    Ok(if runs == 0 { Exit::NothingToDo } else { Exit::Conforms })
}

/// What `validate` says about a profile that `run` would take.
pub(super) fn validated(effective: &Effective, library: &Library) -> Result<String, Vec<Diagnostic>> {
    let pack = tck_run::pack_of(library, effective).map_err(|wrong| vec![wrong])?;
    let surroundings = Surroundings::of_process();
    let mut run = LiveRun::of_profile(effective, library, &pack, &surroundings, ProfileContext::default())?;
    let wrong = |error: RunError| vec![effective.complain("bench.broker", "broker", error.to_string(), "this one")];
    run.overhear(&pack).map_err(wrong)?;
    let layout = run.device.layout.as_ref().map_or("no layout".to_owned(), |layout| {
        format!("layout with {}", many(layout.nodes().count(), "node"))
    });
    let plan = run.plan(library, &pack);
    let mut text = format!(
        "valid profile: {}, VDA 5050 {}; {layout}; {}",
        escaped(&plan.device),
        plan.protocol,
        numbers(&plan).join(", ")
    );
    if let Some(known_from) = &plan.known_from {
        let _ = write!(text, "; {}", escaped(known_from));
    }
    for (label, sentence) in plan.floor.iter().flat_map(of_source) {
        let _ = write!(text, "\n  {label}: {}", escaped(sentence));
    }
    Ok(text)
}

/// Draws the floor of a plan into a file.
pub(super) fn draw(plan: &RunPlan, file: &Path) -> Result<(), Problem> {
    let Some(floor) = &plan.floor else {
        let title = "there is no floor that could be drawn";
        return Err(Diagnostic::whole("floor", title)
            .hint("name it in the section [layout] of the profile")
            .into());
    };
    std::fs::write(file, &floor.svg)
        .map_err(|error| Problem::Environment(format!("cannot write {}: {error}", file.display())))
}

/// What becomes of what the source of a floor has: sentences, and what they are about.
fn of_source(floor: &Floor) -> impl Iterator<Item = (&'static str, &String)> {
    let parts = [
        ("not used", &floor.left_out),
        ("in orders", &floor.said),
        ("not in orders", &floor.unsaid),
    ];
    parts
        .into_iter()
        .flat_map(|(label, all)| all.iter().map(move |sentence| (label, sentence)))
}

/// What of the floor is not used, and which tests want more of it, with the floor itself.
fn floor(floor: &Floor) -> String {
    let mut text = String::new();
    for (label, sentence) in of_source(floor) {
        let _ = writeln!(text, "{label:>17}: {}", escaped(sentence));
    }
    if floor.wanting.is_empty() {
        return text;
    }
    let _ = writeln!(
        text,
        "\nThe floor: {} and {}",
        many(floor.nodes, "node"),
        many(floor.edges, "edge")
    );
    for line in floor.text.lines() {
        let _ = writeln!(text, "  {}", escaped(line));
    }
    let _ = writeln!(text, "\nTests that want more floor:");
    for one in &floor.wanting {
        let from = match one.from {
            0 => "from no place".to_owned(),
            from => format!("only from {from} of {}", many(one.of, "place")),
        };
        let _ = writeln!(
            text,
            "{:>11}  {from}: {}\n             {}",
            many(one.tests.len(), "test"),
            escaped(&one.why),
            first_of(&one.tests)
        );
    }
    text
}

/// The first tests by name, and how many more there are.
fn first_of(tests: &[impl AsRef<str>]) -> String {
    let named: Vec<&str> = tests.iter().take(NAMED).map(AsRef::as_ref).collect();
    match tests.len().saturating_sub(NAMED) {
        0 => named.join(", "),
        more => format!("{} and {more} more", named.join(", ")),
    }
}

/// Refuses a run that would leave tests undecided for what the profile does not say or the bench does not have.
pub(super) fn complete(plan: &RunPlan) -> Result<(), Problem> {
    let mut lacking: Vec<(String, Vec<&str>)> = plan
        .reasons(Waits::Inconclusive)
        .into_iter()
        .map(|(why, tests)| (advice(why), tests))
        .collect();
    let wanting = plan.floor.iter().flat_map(|floor| &floor.wanting);
    lacking.extend(wanting.filter(|one| one.from == 0).map(|one| {
        let tests = one.tests.iter().map(String::as_str).collect();
        (format!("the floor allows them from no place: {}", one.why), tests)
    }));
    if lacking.is_empty() {
        return Ok(());
    }
    let count: usize = lacking.iter().map(|(_, tests)| tests.len()).sum();
    let mut title = format!(
        "a certificate leaves nothing open that profile and bench could decide, and {} would be undecided:",
        many(count, "test")
    );
    for (why, tests) in lacking {
        let _ = write!(
            title,
            "\n{:>11}  {}\n             {}",
            many(tests.len(), "test"),
            escaped(&why),
            first_of(&tests)
        );
    }
    let hint = "say of what the device does not have that it has not (`claims`, in the section [device]), name more floor in the section \
                [layout], or use `run`";
    Err(Diagnostic::whole("certify", title).hint(hint).into())
}

/// How many tests of which kind there are.
fn numbers(plan: &RunPlan) -> Vec<String> {
    let count = |gate| plan.of_kind(gate).count();
    let mut all = vec![format!(
        "{} of {} run",
        count(Waits::Runs),
        many(plan.tests.len(), "test")
    )];
    let others = [
        (Waits::DependsOnDevice, "if the device can do it"),
        (Waits::Inconclusive, "inconclusive"),
        (Waits::NotApplicable, "not applicable"),
    ];
    let others = others.into_iter().filter(|(gate, _)| count(*gate) > 0);
    all.extend(others.map(|(gate, what)| format!("{} {what}", count(gate))));
    all
}

/// A plan for people.
fn text(plan: &RunPlan) -> String {
    let mut text = String::new();
    let _ = writeln!(
        text,
        "Plan for {}, VDA 5050 {}, {}",
        escaped(&plan.device),
        plan.protocol,
        plan.role
    );
    text.push('\n');
    let _ = writeln!(text, "tests    {}", numbers(plan).join(", "));
    if plan.not_drawn > 0 {
        let _ = writeln!(
            text,
            "         {} from schemas and matrices left out by the draw (--thorough runs all)",
            many(plan.not_drawn, "case")
        );
    }
    let people: usize = plan
        .hooks
        .iter()
        .filter(|one| matches!(one.how, How::Person(_)))
        .map(|one| one.times)
        .sum();
    let with_people = if people > 0 {
        ", and the time that people need"
    } else {
        ""
    };
    let _ = writeln!(
        text,
        "time     {}{with_people} (more if the device is slow)",
        plan.duration()
    );
    let motion = match (&plan.stands_still, plan.moving(), plan.role) {
        (_, _, "master-control") => "only the mock vehicles of this tool".to_owned(),
        (Some(why), ..) => format!("none: {}", escaped(&why.to_string())),
        (None, 0, _) => "none: no test drives".to_owned(),
        (None, tests, _) => format!(
            "the vehicle drives in {}, about {} m in all",
            many(tests, "test"),
            plan.metres
        ),
    };
    let _ = writeln!(text, "motion   {motion}");
    let _ = writeln!(
        text,
        "people   {}",
        match people {
            0 => "nobody is asked for anything".to_owned(),
            times => format!("somebody at the terminal is asked {}", many(times, "time")),
        }
    );
    for one in &plan.hooks {
        let how = match &one.how {
            How::Person(prompt) => format!("a person: {prompt}"),
            How::Machine => "done by the profile".to_owned(),
            How::BuiltIn => "done by the built-in device".to_owned(),
        };
        let _ = writeln!(
            text,
            "{:>8}  {}, {}",
            format!("{}×", one.times),
            one.hook,
            escaped(&how)
        );
    }
    if !plan.retained.is_empty() {
        let _ = writeln!(
            text,
            "broker   the mock vehicles keep messages there, which are cleared at the end, or by the next run:"
        );
        for topic in &plan.retained {
            let _ = writeln!(text, "         {}", escaped(topic));
        }
    }
    if let Some(known_from) = &plan.known_from {
        let _ = writeln!(text, "known    {}", escaped(known_from));
    }
    text.extend(plan.floor.iter().map(floor));
    let sections = [
        (Waits::Inconclusive, "To decide more:"),
        (Waits::DependsOnDevice, "Known when the device is there:"),
        (Waits::NotApplicable, "Not applicable:"),
    ];
    for (gate, title) in sections {
        let reasons = plan.reasons(gate);
        if reasons.is_empty() {
            continue;
        }
        let _ = writeln!(text, "\n{title}");
        for (why, tests) in reasons {
            let what = if gate == Waits::Inconclusive {
                advice(why)
            } else {
                why.to_string()
            };
            let _ = writeln!(text, "{:>11}  {}", many(tests.len(), "test"), escaped(&what));
            let _ = writeln!(text, "             {}", first_of(&tests));
        }
    }
    text
}
