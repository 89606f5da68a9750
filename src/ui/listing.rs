//! Texts of `list hooks`, `list vehicle`, `list faults`, `list tolerances` and `list counterparts`.

use std::fmt::Write as _;

use tck_pack::{Hooks, Role};
use tck_profile::VehicleWord;
use tck_reference::Fault;
use tck_reference::deviations::agv::Tolerance;
use tck_simulate::{Counterpart, Habit, Imitation};

/// Every hook with its parameters, by role.
#[must_use]
pub fn hooks(hooks: &Hooks) -> String {
    let width = hooks.all().map(|hook| hook.name.len()).max().unwrap_or(0);
    let mut text = String::new();
    for role in [Role::Agv, Role::MasterControl] {
        let mut of_role = hooks.of(role).peekable();
        if of_role.peek().is_none() {
            continue;
        }
        if !text.is_empty() {
            text.push('\n');
        }
        let _ = writeln!(
            text,
            "Hooks for a device of role {role}, and what is true when they are done:"
        );
        for hook in of_role {
            let _ = write!(text, "  {:<width$}  {}", hook.name, hook.doc);
            if !hook.parameters.is_empty() {
                let placeholders = hook
                    .parameters
                    .iter()
                    .map(|parameter| format!("{{{}}}", parameter.name));
                let placeholders: Vec<String> = placeholders.collect();
                let _ = write!(text, " {}", placeholders.join(" "));
            }
            text.push('\n');
        }
    }
    text
}

/// Every word for the mock vehicles with its parameters.
#[must_use]
pub fn vehicle_words(words: &[VehicleWord]) -> String {
    let width = words.iter().map(|word| word.name.len()).max().unwrap_or(0);
    let mut text = "Words for a mock vehicle, when a master control is tested, and what they bring about:\n".to_owned();
    for word in words {
        let _ = write!(text, "  {:<width$}  {}", word.name, word.doc);
        if !word.parameters.is_empty() {
            let _ = write!(text, " {{{}}}", word.parameters.join(", "));
        }
        text.push('\n');
    }
    text
}

/// Every fault with what is wrong and the requirements it breaks; those that end in a warning stand apart.
#[must_use]
pub fn faults(faults: &[Fault], lapse: impl Fn(&str) -> Option<&'static str>) -> String {
    let width = faults.iter().map(|fault| fault.name.len()).max().unwrap_or(0);
    let mut text = String::new();
    let (lapses, faults): (Vec<&Fault>, Vec<&Fault>) = faults.iter().partition(|fault| lapse(fault.name).is_some());
    for fault in faults {
        let breaks = fault.breaks.join(", ");
        let _ = writeln!(text, "{:<width$}  {} ({breaks})", fault.name, fault.wrong);
    }
    if !lapses.is_empty() {
        text.push_str("\nLapses: nobody is failed for these\n\n");
    }
    for fault in lapses {
        let breaks = fault.breaks.join(", ");
        let why = lapse(fault.name).unwrap_or_default();
        let _ = writeln!(text, "{:<width$}  {} ({breaks}) {why}", fault.name, fault.wrong);
    }
    text
}

/// Every tolerance with what the vehicle does and the requirements that leave it the liberty.
#[must_use]
pub fn tolerances(tolerances: &[Tolerance]) -> String {
    let width = tolerances.iter().map(|one| one.name.len()).max().unwrap_or(0);
    tolerances.iter().fold(String::new(), |mut text, one| {
        let under = one.under.join(", ");
        let _ = writeln!(text, "{:<width$}  {} ({under})", one.name, one.does);
        text
    })
}

/// Every counterpart with its habits: what is done about each, and where it was seen.
#[must_use]
pub fn counterparts<'a>(all: impl Iterator<Item = &'a Counterpart>) -> String {
    let mut text = String::new();
    for one in all {
        let version = one.protocol.as_ref().map(|version| format!(", VDA 5050 {version}"));
        let _ = writeln!(
            text,
            "{}{}: {} (role {}{})\n  seen in {}\n",
            if text.is_empty() { "" } else { "\n" },
            one.name,
            one.title,
            one.role,
            version.unwrap_or_default(),
            one.source,
        );
        let in_run = one.in_run();
        for habit in &one.habits {
            let _ = writeln!(text, "  {}\n      {}", habit.does, imitated(habit, &in_run));
            let _ = writeln!(text, "      {} ({})", habit.place, habit.seen);
        }
    }
    text
}

/// By what a habit is imitated, and where.
fn imitated(habit: &Habit, in_run: &[&str]) -> String {
    let (deviation, manner, only_simulated) = match &habit.imitation {
        Imitation::Not(why) => return format!("not imitated: {why}"),
        Imitation::Imitated {
            deviation,
            manner,
            only_simulated,
        } => (deviation, manner, only_simulated),
    };
    let simulated = match deviation {
        Some(deviation) => format!("simulate: {} {}", deviation.kind.word(), deviation.name),
        None => "simulate: the reference device does so anyway".to_owned(),
    };
    let name = manner
        .map(tck_engine::Manner::word)
        .or(deviation.map(|deviation| deviation.name));
    let run = name
        .filter(|name| in_run.contains(name))
        .map(|name| format!("; run: {name}"));
    let why = only_simulated.as_ref().map(|why| format!("; not in a run: {why}"));
    simulated + &run.or(why).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_profile::VEHICLE_WORDS;

    #[test]
    fn counterparts_are_listed_with_their_habits_and_where_they_were_seen() {
        let known = crate::counterparts().expect("the built-in counterparts");
        insta::assert_snapshot!(counterparts(known.all()));
    }

    #[test]
    fn hooks_are_listed_by_role_with_their_parameters() {
        let library = crate::library(None).expect("the built-in suites");
        insta::assert_snapshot!(hooks(&library.rules.hooks));
    }

    #[test]
    fn words_are_listed_with_their_parameters() {
        insta::assert_snapshot!(vehicle_words(VEHICLE_WORDS));
    }

    #[test]
    fn faults_are_listed_with_what_they_break() {
        let some = [
            Fault {
                name: "outdated-update-taken-over",
                breaks: &["ORD-REJ-10", "ORD-REJ-11"],
                wrong: "Takes over an update that is older than the one it has.",
            },
            Fault {
                name: "silent",
                breaks: &["STATE-01"],
                wrong: "Sends no state.",
            },
        ];
        insta::assert_snapshot!(faults(&some, tck_reference::deviations::agv::lapse), @r"
        outdated-update-taken-over  Takes over an update that is older than the one it has. (ORD-REJ-10, ORD-REJ-11)
        silent                      Sends no state. (STATE-01)
        ");
    }
}
