//! `list` and `explain`: what there is, what decides what, and why.

use std::fmt::Write as _;
use std::sync::Arc;

use serde_json::json;

use super::args::{Explain, Format, List, Listing};
use super::exit::Exit;
use super::problem::Problem;
use crate::ui::{self, Output};
use tck_base::diagnostic::{self, Diagnostic};
use tck_checks as checks;
use tck_judge::Library;
use tck_pack::{Pack, Requirement, Role};
use tck_profile::VEHICLE_WORDS;
use tck_reference::Fault;
use tck_report::coverage;
use tck_report::statement::{many, verb};
use tck_run::sources;
use tck_simulate::BuiltIn;
use tck_suite::model::{Monitor, Rule, Test, Verb};

/// `list`.
pub fn list(arguments: &List) -> Result<Exit, Problem> {
    if arguments.uncovered && arguments.what != Listing::Coverage {
        return Err(Diagnostic::whole("usage", "`--uncovered` is about `list coverage`").into());
    }
    if arguments.filter.is_some() && arguments.what != Listing::Tests {
        return Err(Diagnostic::whole("usage", "`--filter` is about `list tests`").into());
    }
    if arguments.page && !matches!(arguments.what, Listing::Requirements | Listing::Language) {
        return Err(Diagnostic::whole("usage", "`--page` is about `list requirements` and `list language`").into());
    }
    if arguments.changes.is_some() && arguments.what != Listing::Requirements {
        return Err(Diagnostic::whole("usage", "`--changes` is about `list requirements`").into());
    }
    let library = crate::assets::library(arguments.suites.own())?;
    let pack = super::pack(&library, arguments.protocol.as_deref())?;
    let roles: Vec<Role> = arguments
        .role
        .map_or_else(|| vec![Role::Agv, Role::MasterControl], |role| vec![role]);
    if let Some(range) = &arguments.changes {
        return super::changes::changes(range, &library, &roles, arguments.format);
    }
    let text = match (arguments.what, arguments.format) {
        (Listing::Tests, format) => {
            let all = roles
                .iter()
                .map(|role| Ok((*role, filtered(arguments, &library, &pack, *role)?)));
            let all: Vec<_> = all.collect::<Result<_, Diagnostic>>()?;
            if !roles.iter().any(|role| pack.judges(*role))
                && let Err(none) = library.rules.packs.for_devices(&pack.id, roles[0])
            {
                return Err(Problem::NothingToDo(none.to_string()));
            }
            if all.iter().all(|(_, tests)| tests.is_empty()) {
                return Err(Problem::NothingToDo("no test is like that".to_owned()));
            }
            match format {
                Format::Text => all.iter().map(|(role, all)| tests(all, *role)).collect(),
                Format::Json => lines(all.iter().flat_map(|(_, all)| all).map(|test| {
                    json!({ "id": test.id, "title": test.title, "role": test.device.word(), "moves": test.moves,
                        "tags": test.tags(), "requirements": test.requirements() })
                })),
            }
        }
        (Listing::Requirements, Format::Text) if arguments.page => {
            let quoted = sources(&library, &pack);
            let meant = |role: &str| {
                arguments
                    .role
                    .is_none_or(|wanted| role == wanted.word() || role == "both")
            };
            tck_report::markdown::requirements(&quoted, &pack.version.to_string(), meant)
        }
        (Listing::Requirements, Format::Text) => requirements(&library, &pack, &roles),
        (Listing::Requirements, Format::Json) => lines(of_roles(&library, &pack, &roles).map(|requirement| {
            json!({ "id": requirement.id, "text": requirement.text, "role": requirement.role.word(),
                "mood": requirement.in_version(&pack).map(|note| note.mood.word()) })
        })),
        (Listing::Monitors, Format::Text) => monitors(&library, &pack, &roles),
        (Listing::Monitors, Format::Json) => lines(of_version(&library, &pack, &roles).map(|monitor| {
            let decides: Vec<&str> = monitor
                .checks
                .iter()
                .map(|binding| binding.requirement.as_str())
                .collect();
            json!({ "id": monitor.id, "title": monitor.title, "requirements": decides })
        })),
        (Listing::Coverage, format) => {
            let sources = sources(&library, &pack);
            let mut text = String::new();
            for role in roles {
                let all = coverage::coverage(&sources, role);
                match format {
                    Format::Text if arguments.uncovered => text += &all.uncovered_text(),
                    Format::Text => {
                        let _ = writeln!(text, "{role}, VDA 5050 {}\n\n{}", pack.version, all.text());
                    }
                    Format::Json => {
                        let total = all.total();
                        let uncovered: Vec<&str> = all.uncovered.iter().map(|one| one.id.as_str()).collect();
                        let line = json!({ "role": role.word(), "decided": total.decided, "operator": total.operator,
                            "notTestable": total.not_testable, "uncovered": uncovered });
                        let _ = writeln!(text, "{line}");
                    }
                }
            }
            text
        }
        (Listing::Faults, Format::Text) => {
            let all = roles.iter().map(|role| {
                format!(
                    "{role}\n\n{}\n",
                    ui::faults(BuiltIn::faults(*role), |name| BuiltIn::lapse(*role, name))
                )
            });
            all.collect()
        }
        (Listing::Faults, Format::Json) => {
            let all = roles
                .iter()
                .flat_map(|role| BuiltIn::faults(*role).iter().map(move |fault| (role, fault)));
            lines(all.map(|(role, fault)| json!({ "name": fault.name, "role": role.word(), "breaks": fault.breaks, "wrong": fault.wrong, "lapse": BuiltIn::lapse(*role, fault.name) })))
        }
        (Listing::Tolerances, Format::Text) => {
            let all = roles
                .iter()
                .map(|role| format!("{role}\n\n{}\n", ui::tolerances(BuiltIn::tolerances(*role))));
            all.collect()
        }
        (Listing::Tolerances, Format::Json) => {
            let all = roles
                .iter()
                .flat_map(|role| BuiltIn::tolerances(*role).iter().map(move |one| (role, one)));
            lines(all.map(
                |(role, one)| json!({ "name": one.name, "role": role.word(), "under": one.under, "does": one.does }),
            ))
        }
        (Listing::Counterparts, format) => {
            let known = crate::assets::counterparts()?;
            let all = known.all().filter(|one| roles.contains(&one.role));
            match format {
                Format::Text => ui::counterparts(all),
                Format::Json => lines(all.map(super::explained::counterpart)),
            }
        }
        (Listing::Hooks, Format::Text) => ui::hooks(&library.rules.hooks),
        (Listing::Hooks, Format::Json) => lines(library.rules.hooks.all().map(|hook| {
            let parameters: Vec<&str> = hook
                .parameters
                .iter()
                .map(|parameter| parameter.name.as_str())
                .collect();
            json!({ "name": hook.name, "role": hook.role.word(), "parameters": parameters, "doc": hook.doc })
        })),
        (Listing::Language, Format::Text) => super::language::page(&library).map_err(Problem::Environment)?,
        (Listing::Language, Format::Json) => lines(
            super::language::objects(&library)
                .map_err(Problem::Environment)?
                .into_iter(),
        ),
        (Listing::Asyncapi, _) => {
            let role = arguments.role.unwrap_or(Role::Agv);
            format!("{:#}\n", tck_pack::asyncapi(&pack, role))
        }
        (Listing::Vehicle, Format::Text) => ui::vehicle_words(VEHICLE_WORDS),
        (Listing::Vehicle, Format::Json) => lines(
            VEHICLE_WORDS
                .iter()
                .map(|word| json!({ "name": word.name, "parameters": word.parameters, "doc": word.doc })),
        ),
    };
    super::print(&text)
}

/// The faults of both reference devices.
fn all_faults() -> impl Iterator<Item = &'static Fault> {
    [Role::Agv, Role::MasterControl].into_iter().flat_map(BuiltIn::faults)
}

fn lines(all: impl Iterator<Item = serde_json::Value>) -> String {
    all.fold(String::new(), |mut text, one| {
        let _ = writeln!(text, "{one}");
        text
    })
}

/// The tests of a role for which the filter holds. A term may be about the other role alone.
fn filtered(arguments: &List, library: &Library, pack: &Pack, role: Role) -> Result<Vec<Arc<Test>>, Diagnostic> {
    let own = library.tests(role, &pack.id);
    let Some(filter) = &arguments.filter else {
        return Ok(own);
    };
    let quoted = sources(library, pack);
    let mut all = own.clone();
    if arguments.role.is_none() {
        for other in [Role::Agv, Role::MasterControl]
            .into_iter()
            .filter(|other| *other != role)
        {
            all.extend(library.tests(other, &pack.id));
        }
    }
    tck_run::meant(filter, &all, &own, &quoted)
}

fn tests(all: &[Arc<Test>], role: Role) -> String {
    let mut text = String::new();
    let mut group = "";
    let mut table = "";
    for test in all {
        // The cases that a run draws from are listed as one.
        if test.drawn.is_some() && test.table() == table {
            continue;
        }
        table = test.table();
        if test.group != group {
            group = &test.group;
            let _ = writeln!(text, "{}{role}: {group}", if text.is_empty() { "" } else { "\n" });
        }
        let mut notes = Vec::new();
        if test.moves {
            notes.push("moves".to_owned());
        }
        for (_, steps) in test.sections() {
            for step in steps {
                if let Verb::Operator(operator) = &*step.verb {
                    notes.push(format!("hook {}", operator.hook));
                }
            }
        }
        notes.dedup();
        let notes = if notes.is_empty() {
            String::new()
        } else {
            format!("  ({})", notes.join(", "))
        };
        let _ = writeln!(text, "  {table}\n      {}{notes}", test.title);
        if let Some(drawn) = &test.drawn {
            let cases = all.iter().filter(|other| other.table() == table).count();
            let _ = writeln!(
                text,
                "      {cases} cases {}; a run takes {}, all with --thorough",
                drawn.origin(),
                drawn.draw.min(cases)
            );
        }
    }
    let (cases, written): (Vec<_>, Vec<_>) = all.iter().partition(|test| test.drawn.is_some());
    let moving = written.iter().filter(|test| test.moves).count();
    if !all.is_empty() {
        let more = match cases.len() {
            0 => String::new(),
            cases => format!(", and {cases} cases from schemas and matrices"),
        };
        let _ = writeln!(
            text,
            "\n{} for role {role}, {moving} of them {} the vehicle{more}\n",
            many(written.len(), "test"),
            verb(moving, "moves", "move")
        );
    }
    text
}

fn of_roles<'a>(library: &'a Library, pack: &'a Pack, roles: &'a [Role]) -> impl Iterator<Item = &'a Requirement> {
    let concerns = |requirement: &&Requirement| roles.iter().any(|role| requirement.role.concerns(*role));
    library
        .rules
        .catalogue
        .all()
        .filter(|requirement| requirement.in_version(pack).is_some())
        .map(|requirement| requirement.edition(pack))
        .filter(concerns)
}

fn requirements(library: &Library, pack: &Pack, roles: &[Role]) -> String {
    let mut text = String::new();
    let mut chapter = "";
    for requirement in of_roles(library, pack, roles) {
        if requirement.chapter != chapter {
            chapter = &requirement.chapter;
            let _ = writeln!(text, "{}{chapter}", if text.is_empty() { "" } else { "\n" });
        }
        let mood = requirement.in_version(pack).map_or("", |note| note.mood.word());
        let _ = writeln!(text, "  {:<14} {mood:<6} {}", requirement.id, requirement.text);
    }
    text
}

fn of_version<'a>(library: &'a Library, pack: &'a Pack, roles: &'a [Role]) -> impl Iterator<Item = &'a Arc<Monitor>> {
    let monitors = library
        .rules
        .suites
        .monitors
        .iter()
        .filter(|monitor| monitor.spec.contains(pack.version));
    monitors.filter(|monitor| monitor.device.is_none_or(|device| roles.contains(&device)))
}

fn monitors(library: &Library, pack: &Pack, roles: &[Role]) -> String {
    of_version(library, pack, roles).fold(String::new(), |mut text, monitor| {
        let decides: Vec<&str> = monitor
            .checks
            .iter()
            .map(|binding| binding.requirement.as_str())
            .collect();
        let _ = writeln!(
            text,
            "{}\n    {}\n    decides {}",
            monitor.id,
            monitor.title,
            decides.join(", ")
        );
        text
    })
}

/// `explain`.
pub fn explain(arguments: &Explain) -> Result<Exit, Problem> {
    let library = crate::assets::library(arguments.suites.own())?;
    let pack = super::pack(&library, arguments.protocol.as_deref())?;
    let id = arguments.id.as_str();
    let suites = &library.rules.suites;
    let mut text = String::new();
    if let Some(requirement) = library.rules.catalogue.get(id) {
        text.push_str(&about_requirement(requirement.edition(&pack), &library, &pack));
    }
    let table = |test: &&Arc<Test>| test.id == id || test.id.split('[').next() == Some(id);
    let cases: Vec<_> = suites.tests.iter().filter(table).collect();
    if let Some(test) = cases.first() {
        text.push_str(&about_test(test, cases.len(), &library));
    }
    if let Some(monitor) = suites.monitors.iter().find(|monitor| monitor.id == id) {
        text.push_str(&about_monitor(monitor, &library));
    }
    if let Some(check) = tck_check::find(checks::REGISTRY, id) {
        let _ = writeln!(
            text,
            "check {id}\n\n{}\n\ncan decide {}",
            check.doc,
            check.decides.join(", ")
        );
    }
    for hook in library.rules.hooks.named(id) {
        let tests = super::explained::using(hook, &library);
        if !text.is_empty() {
            text.push('\n');
        }
        text.push_str(&ui::hook(hook, &library.rules.hooks, tests.len()));
    }
    if let Some(doc) = super::explained::setting(id) {
        let _ = writeln!(text, "setting {id} of a profile\n\n{doc}");
    }
    for role in [Role::Agv, Role::MasterControl] {
        let Some(fault) = BuiltIn::faults(role).iter().find(|fault| fault.name == id) else {
            continue;
        };
        let (device, flag) = match role {
            Role::Agv => ("AGV", ""),
            Role::MasterControl => ("master control", " --role master-control"),
        };
        let _ = writeln!(
            text,
            "fault {id} of the reference {device}\n\n{}\n\nbreaks {}\ntry    vda5050-tck run --virtual{flag} --fault {id}",
            fault.wrong,
            fault.breaks.join(", ")
        );
    }
    if text.is_empty() {
        let known: Vec<&str> = library
            .rules
            .catalogue
            .all()
            .map(|requirement| requirement.id.as_str())
            .chain(suites.tests.iter().map(|test| test.id.as_str()))
            .chain(suites.monitors.iter().map(|monitor| monitor.id.as_str()))
            .chain(checks::REGISTRY.iter().map(|check| check.name))
            .chain(library.rules.hooks.all().map(|hook| hook.name.as_str()))
            .chain(all_faults().map(|fault| fault.name))
            .chain(super::explained::settings().map(|(name, _)| name))
            .collect();
        let hint = match diagnostic::closest(id, known) {
            Some(close) => format!("did you mean `{close}`?"),
            None => "`vda5050-tck list` shows what there is".to_owned(),
        };
        return Err(Diagnostic::whole("unknown-id", format!("nothing is called `{id}`"))
            .hint(hint)
            .into());
    }
    if arguments.format == Format::Json {
        return super::print(&lines(super::explained::all(id, &library, &pack).into_iter()));
    }
    super::print(&text)
}

fn about_requirement(requirement: &Requirement, library: &Library, pack: &Pack) -> String {
    let mut text = format!(
        "{}  {}\n\n{}\n\n",
        requirement.id, requirement.chapter, requirement.text
    );
    let _ = writeln!(text, "concerns       {}", requirement.role.word());
    for (version, note) in &requirement.versions {
        let _ = writeln!(
            text,
            "VDA 5050 {version:<5} section {}, {}",
            note.section,
            note.mood.word()
        );
        if let Some(link) = library
            .rules
            .packs
            .get(version)
            .and_then(|pack| requirement.link_in(pack))
        {
            let _ = writeln!(text, "{:<14} {link}", "");
        }
    }
    if requirement.in_version(pack).is_none() {
        let _ = writeln!(text, "VDA 5050 {:<5} does not have it", pack.id);
    }
    for (name, content) in [
        ("stimulus", &requirement.stimulus),
        ("observation", &requirement.observe),
    ] {
        if !content.is_empty() {
            let _ = writeln!(text, "{name:<14} {content}");
        }
    }
    if let Some(ruling) = &requirement.interpretation {
        let _ = writeln!(text, "ruling         {ruling}");
    }
    if let Some(because) = &requirement.because {
        let _ = writeln!(text, "because        {because}");
    }
    if let Some(otherwise) = &requirement.otherwise {
        let _ = writeln!(text, "or else        {otherwise}");
    }
    if !requirement.rests_on.is_empty() {
        let ids: Vec<&str> = requirement
            .rests_on
            .iter()
            .map(tck_pack::RequirementId::as_str)
            .collect();
        let _ = writeln!(text, "rests on       {}", ids.join(", "));
    }
    let _ = writeln!(text, "decided        {}", requirement.decided.word());
    let id = requirement.id.as_str();
    let mut deciders = Vec::new();
    let mut table = "";
    for test in &library.rules.suites.tests {
        if test.drawn.is_some() && test.table() == table {
            continue;
        }
        table = test.table();
        for step in &test.steps {
            deciders.extend(
                step.clauses()
                    .into_iter()
                    .filter(|(other, _)| other.as_str() == id)
                    .map(|(_, clause)| format!("{table} {clause}")),
            );
        }
    }
    for monitor in &library.rules.suites.monitors {
        if monitor.checks.iter().any(|binding| binding.requirement.as_str() == id) {
            deciders.push(format!("monitor {}", monitor.id));
        }
    }
    let _ = writeln!(
        text,
        "by             {}",
        if deciders.is_empty() {
            "nothing"
        } else {
            deciders[0].as_str()
        }
    );
    for decider in deciders.iter().skip(1) {
        let _ = writeln!(text, "               {decider}");
    }
    let mut breaking: Vec<&str> = all_faults()
        .filter(|fault| fault.breaks.contains(&id))
        .map(|fault| fault.name)
        .collect();
    breaking.sort_unstable();
    if !breaking.is_empty() {
        let _ = writeln!(text, "proved with    {}", breaking.join(", "));
    }
    for (at, command) in super::explained::repetitions(id, library).iter().enumerate() {
        let name = if at == 0 { "repeat" } else { "" };
        let _ = writeln!(text, "{name:<14} {command}");
    }
    text
}

fn about_test(test: &Test, cases: usize, library: &Library) -> String {
    let mut text = format!("test {}\n\n{}\n\n{}\n\n", test.id, test.title, test.why.trim());
    let _ = writeln!(text, "file           {}", library.file_of(&test.source));
    let _ = writeln!(text, "for            {}, VDA 5050 {}", test.device, test.spec);
    let _ = writeln!(
        text,
        "vehicle        {}",
        if test.moves { "drives" } else { "stays where it is" }
    );
    match &test.drawn {
        Some(drawn) => {
            let _ = writeln!(
                text,
                "cases          {cases} {}; a run takes {}, all with --thorough",
                drawn.origin(),
                drawn.draw.min(cases)
            );
        }
        None if cases > 1 => {
            let _ = writeln!(text, "cases          {cases}");
        }
        None => {}
    }
    for step in &test.steps {
        for (requirement, clause) in step.clauses() {
            let _ = writeln!(text, "decides        {requirement:<14} {clause}");
        }
    }
    let _ = writeln!(text, "\n{}", test.source.text.trim_end());
    text
}

fn about_monitor(monitor: &Monitor, library: &Library) -> String {
    let decides: Vec<&str> = monitor
        .checks
        .iter()
        .map(|binding| binding.requirement.as_str())
        .collect();
    let mut text = format!(
        "monitor {}\n\n{}\n\n{}\n\n",
        monitor.id,
        monitor.title,
        monitor.why.trim()
    );
    let _ = writeln!(text, "file           {}", library.file_of(&monitor.source));
    let _ = writeln!(text, "decides        {}", decides.join(", "));
    if let Rule::Check(check) = &monitor.rule
        && let Some(definition) = tck_check::find(checks::REGISTRY, &check.name)
    {
        let _ = writeln!(text, "check          {}: {}", check.name, definition.doc);
    }
    text
}

/// Prints to standard output; a reader that has gone away is no failure.
pub(super) fn print(text: &str) -> Result<Exit, Problem> {
    match Output::stdout().text(text) {
        Ok(()) => Ok(Exit::Conforms),
        Err(error) => Err(Problem::Environment(format!(
            "cannot write to standard output: {error}"
        ))),
    }
}
