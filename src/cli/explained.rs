//! `explain --format json`: the same for programs, an object for each thing of that name.

use std::collections::BTreeSet;

use serde_json::{Map, Value, json};

use tck_checks as checks;
use tck_judge::Library;
use tck_pack::{HookInfo, Pack, Requirement, Role};
use tck_profile::{HookExample, SAMPLE_ACTIONS, STATEMENTS};
use tck_reference::Fault;
use tck_simulate::{BuiltIn, Counterpart, Habit, Imitation};
use tck_suite::model::{Monitor, Rule, Test};

/// Everything that has this name.
pub(super) fn all(id: &str, library: &Library, pack: &Pack) -> Vec<Value> {
    let suites = &library.rules.suites;
    let mut found = Vec::new();
    if let Some(known) = library.rules.catalogue.get(id) {
        found.push(requirement(known.edition(pack), library, pack));
    }
    let mut tests = suites.tests.iter();
    let is_meant = |test: &&std::sync::Arc<Test>| test.id == id || test.id.split('[').next() == Some(id);
    if let Some(known) = tests.find(is_meant) {
        let cases = suites.tests.iter().filter(is_meant).count();
        found.push(test(known, cases, library));
    }
    let monitors = suites.monitors.iter().filter(|monitor| monitor.id == id);
    found.extend(monitors.map(|known| monitor(known, library)));
    if let Some(check) = tck_check::find(checks::REGISTRY, id) {
        found.push(json!({ "kind": "check", "id": id, "doc": check.doc, "decides": check.decides }));
    }
    found.extend(library.rules.hooks.named(id).map(|known| hook(known, library)));
    if let Some(doc) = setting(id) {
        found.push(json!({ "kind": "setting", "id": id, "doc": doc }));
    }
    for (role, fault) in faults().filter(|(_, fault)| fault.name == id) {
        found.push(
            json!({ "kind": "fault", "id": id, "role": role.word(), "wrong": fault.wrong,
            "breaks": fault.breaks }),
        );
    }
    found
}

/// What the profile says of the device, by the name of the key in `[device]`.
pub(super) fn settings() -> impl Iterator<Item = (&'static str, &'static str)> {
    let statements = STATEMENTS.iter().map(|one| (one.name, one.doc));
    statements.chain(SAMPLE_ACTIONS.iter().map(|one| (one.name, one.doc)))
}

/// What a key of `[device]` means, with `device.` or without.
pub(super) fn setting(id: &str) -> Option<&'static str> {
    let name = id.strip_prefix("device.").unwrap_or(id);
    settings().find(|(known, _)| *known == name).map(|(_, doc)| doc)
}

/// A known product, with its habits.
pub(super) fn counterpart(one: &Counterpart) -> Value {
    let habits: Vec<Value> = one.habits.iter().map(|habit| habit_of(habit, &one.in_run())).collect();
    json!({ "name": one.name, "title": one.title, "role": one.role.word(), "protocol": one.protocol,
        "topicTemplate": one.topic_template, "source": one.source, "habits": habits })
}

fn habit_of(habit: &Habit, in_run: &[&str]) -> Value {
    let (not, only_simulated) = match &habit.imitation {
        Imitation::Not(why) => (Some(why), None),
        Imitation::Imitated { only_simulated, .. } => (None, only_simulated.as_ref()),
    };
    let deviation = habit.deviation();
    let manner = habit.manner().map(tck_engine::Manner::word);
    let taken = manner.or(deviation.map(|deviation| deviation.name));
    json!({ "does": habit.does, "as": deviation.map(|deviation| deviation.name),
        "kind": deviation.map(|deviation| deviation.kind.word()), "inRun": taken.filter(|name| in_run.contains(name)),
        "onlySimulated": only_simulated, "notImitated": not, "where": habit.place, "seen": habit.seen })
}

fn faults() -> impl Iterator<Item = (Role, &'static Fault)> {
    let roles = [Role::Agv, Role::MasterControl].into_iter();
    roles.flat_map(|role| BuiltIn::faults(role).iter().map(move |fault| (role, fault)))
}

fn requirement(known: &Requirement, library: &Library, pack: &Pack) -> Value {
    let id = known.id.as_str();
    let versions = known.versions.iter().map(|(version, note)| {
        let link = library.rules.packs.get(version).and_then(|pack| known.link_in(pack));
        let note = json!({ "section": note.section, "mood": note.mood.word(), "link": link });
        (version.clone(), note)
    });
    let versions: Map<String, Value> = versions.collect();
    let suites = &library.rules.suites;
    let mut by: Vec<String> = suites.deciding(id).iter().map(|test| test.table().to_owned()).collect();
    by.dedup();
    let monitors = suites.monitors.iter();
    let monitors = monitors.filter(|monitor| monitor.checks.iter().any(|one| one.requirement.as_str() == id));
    let monitors: Vec<&str> = monitors.map(|monitor| monitor.id.as_str()).collect();
    let proved: Vec<&str> = faults()
        .filter(|(_, fault)| fault.breaks.contains(&id))
        .map(|(_, fault)| fault.name)
        .collect();
    json!({ "kind": "requirement", "id": id, "chapter": known.chapter, "text": known.text, "role": known.role.word(),
        "versions": versions, "inVersion": known.in_version(pack).is_some(), "interpretation": known.interpretation,
        "because": known.because, "otherwise": known.otherwise, "restsOn": known.rests_on,
        "decided": known.decided.word(), "tests": by, "monitors": monitors, "provedWith": proved,
        "repeat": repetitions(id, library) })
}

/// The commands that repeat a verdict about a requirement: at a device, and at a reference device that breaks it. What only
/// monitors decide is judged in whatever is run.
pub(super) fn repetitions(id: &str, library: &Library) -> Vec<String> {
    let suites = &library.rules.suites;
    let tested = |role: Role| suites.deciding(id).iter().any(|test| test.device == role);
    let watched = |role: Role| {
        let mut monitors = suites.monitors.iter();
        monitors.any(|monitor| {
            monitor.device.is_none_or(|device| device == role)
                && monitor.checks.iter().any(|binding| binding.requirement.as_str() == id)
        })
    };
    let selection = |role: Role| match tested(role) {
        true => format!(" --requirement {id}"),
        false => String::new(),
    };
    let mut all = Vec::new();
    let roles = [(Role::Agv, ""), (Role::MasterControl, " --role master-control")];
    for (role, flag) in roles.into_iter().filter(|(role, _)| tested(*role) || watched(*role)) {
        all.push(format!("vda5050-tck run --profile device.toml{}", selection(role)));
        let breaking = faults().find(|(of, fault)| *of == role && fault.breaks.first() == Some(&id));
        if let Some((_, fault)) = breaking {
            all.push(format!(
                "vda5050-tck run --virtual{flag} --fault {}{}",
                fault.name,
                selection(role)
            ));
        }
    }
    all.dedup();
    all
}

/// The tests that ask for a hook, each table once.
pub(super) fn using<'a>(hook: &HookInfo, library: &'a Library) -> BTreeSet<&'a str> {
    let tests = library.rules.suites.tests.iter();
    let using = tests.filter(|test| test.device == hook.role && test.hooks().contains(hook.name.as_str()));
    using.map(|test| test.table()).collect()
}

fn hook(known: &HookInfo, library: &Library) -> Value {
    let parameters = known.parameters.iter().map(|parameter| {
        let values = parameter.values.iter();
        let values: Vec<Value> = values
            .map(|value| json!({ "id": value.id, "text": value.text }))
            .collect();
        json!({ "name": parameter.name, "about": parameter.about, "example": parameter.example, "values": values })
    });
    let example = HookExample::of(known);
    let opposite = library.rules.hooks.opposite(known).map(|hook| &hook.name);
    json!({ "kind": "hook", "id": known.name, "role": known.role.word(), "doc": known.doc,
        "parameters": parameters.collect::<Vec<Value>>(), "effects": known.effects, "changes": known.changes(),
        "risk": known.risk, "undoes": known.undoes, "undoneBy": opposite, "forAction": known.for_action,
        "optional": known.optional, "tests": using(known, library),
        "profile": [example.prompt, example.run, example.http], "request": example.request })
}

fn test(known: &Test, cases: usize, library: &Library) -> Value {
    let steps = known.steps.iter().flat_map(tck_suite::model::Step::clauses);
    let decides: Vec<Value> = steps
        .map(|(requirement, clause)| json!({ "requirement": requirement, "clause": clause }))
        .collect();
    json!({ "kind": "test", "id": known.id, "title": known.title, "why": known.why.trim(), "file": library.file_of(&known.source),
        "role": known.device.word(), "spec": known.spec.to_string(), "moves": known.moves, "tags": known.tags(),
        "hooks": known.hooks(), "cases": cases, "decides": decides, "source": known.source.text })
}

fn monitor(known: &Monitor, library: &Library) -> Value {
    let decides: Vec<&str> = known.checks.iter().map(|one| one.requirement.as_str()).collect();
    let check = match &known.rule {
        Rule::Check(check) => Some(check.name.clone()),
        _ => None,
    };
    json!({ "kind": "monitor", "id": known.id, "title": known.title, "why": known.why.trim(),
        "file": library.file_of(&known.source), "decides": decides, "check": check })
}
